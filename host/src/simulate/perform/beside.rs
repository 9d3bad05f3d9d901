//! Where a second person stands: in the scene, and what stands around the first person. Out: a place near them.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::simulate::circumstance::BESIDE_M;
use crate::simulate::scene::{NEAREST_M, PERSON_M, Place, Scene, WORKPLACE_M};

/// Places that are tried.
const TRIES: usize = 400;
/// What the hands of the second person reach is so far from the first, and they stand so far off the way from the radar to
/// them, m: they are about, not in between.
const APART_M: f32 = 0.5;

/// A place [`BESIDE_M`] from `user` and not nearer to the radar than anybody stands, in the room; as far as there is one, the
/// second person also, in that order: stands free, of furniture and of `fixtures`, with room for their hands; is not between the
/// radar and `user`; is where the radar looks, though furniture may hide them.
pub(super) fn place(scene: &Scene, user: &Place, fixtures: &[Vec3], rng: &mut ChaCha8Rng) -> Option<Place> {
    let mut best = None;
    for _ in 0..TRIES {
        let away = rng.random_range(BESIDE_M);
        let way: f32 = rng.random_range(-PI..PI);
        let position = user.position + Vec2::new(libm::cosf(way), libm::sinf(way)) * away;
        let place = Place { position, facing_rad: rng.random_range(-PI..PI) };
        let Some(merit) = merit(scene, user, fixtures, &place) else { continue };
        if best.is_none_or(|(most, _)| merit > most) {
            best = Some((merit, place));
        }
        if merit == MOST {
            break;
        }
    }
    best.map(|(_, place)| place)
}

/// All that can be asked of a place.
const MOST: u8 = 3;

/// How much of what is asked of `place` it has, 0 to [`MOST`]; `None` where nobody may stand.
fn merit(scene: &Scene, user: &Place, fixtures: &[Vec3], place: &Place) -> Option<u8> {
    let radar = scene.radar.position.truncate();
    let floor = place.position.extend(scene.room.min.z);
    if !scene.room.contains(floor) || place.position.distance(radar) < NEAREST_M {
        return None;
    }
    let hands = place.position + place.front(scene.radar.position) * WORKPLACE_M;
    let stands_in = |v: &Vec3| v.truncate().distance_squared(place.position) < PERSON_M * PERSON_M;
    let free = scene.has_room(place)
        && off(user.position, [place.position, hands]) >= APART_M
        && !fixtures.iter().any(stands_in);
    let aside = off(place.position, [radar, user.position]) >= APART_M;
    Some(match (free, aside, scene.has_in_view(place)) {
        (false, ..) => 0,
        (true, false, _) => 1,
        (true, true, false) => 2,
        (true, true, true) => MOST,
    })
}

/// From a point to the line between two others, m.
fn off(point: Vec2, [from, to]: [Vec2; 2]) -> f32 {
    let way = to - from;
    let share = (point - from).dot(way) / way.length_squared().max(f32::EPSILON);
    point.distance(from + way * share.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn second_people_stand_near_and_free() {
        let (mut all, mut best) = (0, 0);
        for name in ["working-space", "storage-room", "kitchen", "open-room"] {
            let scene = Scene::named(name).unwrap();
            for (seed, user) in scene.places.iter().enumerate() {
                let rng = &mut ChaCha8Rng::seed_from_u64(seed as u64);
                let place = place(&scene, user, &[], rng).unwrap();
                let away = place.position.distance(user.position);
                assert!((BESIDE_M.start - 1e-4..BESIDE_M.end + 1e-4).contains(&away), "{away} m");
                assert!(scene.has_room(&place), "{name}: {place:?}");
                all += 1;
                best += usize::from(merit(&scene, user, &[], &place) == Some(MOST));
            }
        }
        eprintln!("{best} of {all} second people stand where all is well");
        assert!(best * 10 >= all * 9, "{best} of {all}");
    }

    #[test]
    fn where_all_is_full_they_stand_in_the_room_at_least() {
        let mut scene = Scene::named("kitchen").unwrap();
        let user = scene.places[0];
        // A block that fills the room but for the middle.
        let everywhere: Vec<Vec3> = (0..10_000)
            .map(|n| Vec3::new(-5.0 + 0.1 * (n / 100) as f32, 0.1 * (n % 100) as f32, 0.5))
            .collect();
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        let full = place(&scene, &user, &everywhere, rng).unwrap();
        assert_eq!(merit(&scene, &user, &everywhere, &full), Some(0));
        assert!(scene.room.contains(full.position.extend(0.0)));
        assert!(full.position.distance(scene.radar.position.truncate()) >= NEAREST_M);
        // A shaft.
        let half = Vec3::new(0.5, 0.5, 3.0);
        (scene.room.min, scene.room.max) =
            (user.position.extend(0.0) - half, user.position.extend(0.0) + half);
        assert_eq!(place(&scene, &user, &[], rng), None);
    }
}
