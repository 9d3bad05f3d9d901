//! Rooms drawn from random numbers: other walls, furniture and people around the radar, the reader and the tags of a scene.
//!
//! What is trained in one room learns that room's echoes (section 2.2 of the paper); what is trained in many learns what they
//! have in common.

use std::ops::Range;

use glam::{Vec2, Vec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Furniture, Person, Place, Room, Scene};
use crate::simulate::perform::Manner;

/// From the radar to the walls at its sides, behind it and before it, m.
const SIDE_M: Range<f32> = 1.8..4.0;
const BEHIND_M: Range<f32> = 0.2..0.6;
const BEFORE_M: Range<f32> = 3.4..6.0;
/// Height of the ceiling, m.
const CEILING_M: Range<f32> = 2.4..3.2;
/// Share of the power that walls reflect: plasterboard to tiles.
const WALLS: Range<f32> = 0.03..0.3;
/// Share that furniture scatters: wood to steel.
const SCATTERED: Range<f32> = 0.1..0.9;
/// Most pieces of furniture.
const MOST_FURNITURE: usize = 7;
/// Nothing stands nearer to the radar and the reader's antennas, m.
const AROUND_RADIOS_M: f32 = 0.9;
/// People of each room.
const PEOPLE: usize = 7;
const HEIGHT_M: Range<f32> = 1.5..1.95;
const BUILD: Range<f32> = 0.8..1.3;
/// Places that a room must have, and how many are listed.
const FEWEST_PLACES: usize = 4;
const PLACES: usize = 12;
/// Points that are tried for them.
const TRIES: usize = 60;

impl Scene {
    /// Another room, the `number`th, with its own furniture, people, who move in `manner`, and places; what is on the walls is
    /// this scene's.
    pub fn other_room(&self, number: usize, manner: Option<Manner>, rng: &mut ChaCha8Rng) -> Self {
        let radar = self.radar.position;
        let near = Vec3::new(
            radar.x - rng.random_range(SIDE_M),
            radar.y - rng.random_range(BEHIND_M),
            self.room.min.z,
        );
        let far = Vec3::new(
            radar.x + rng.random_range(SIDE_M),
            radar.y + rng.random_range(BEFORE_M),
            near.z + rng.random_range(CEILING_M),
        );
        // Antennas of other scenes may hang anywhere.
        let antennas = || self.reader.antennas.iter().map(|antenna| antenna.position);
        let (min, max) = (antennas().fold(near, Vec3::min), antennas().fold(far, Vec3::max));
        let room = Room { min, max, reflectivity: rng.random_range(WALLS) };
        let mut scene = Self { name: format!("room {number}"), room, ..self.clone() };
        scene.furniture = (0..rng.random_range(0..=MOST_FURNITURE)).map(|n| piece(n, &room, rng)).collect();
        scene.furniture.retain(|piece| {
            let radios = scene.reader.antennas.iter().map(|antenna| antenna.position).chain([radar]);
            radios.into_iter().all(|radio| piece.distance_on_floor(radio.truncate()) > AROUND_RADIOS_M)
        });
        scene.people = (1..=PEOPLE)
            .map(|n| Person {
                name: format!("R{number}-{n}"),
                height_m: rng.random_range(HEIGHT_M),
                build: rng.random_range(BUILD),
                manner,
            })
            .collect();
        loop {
            scene.places = scene.some_places(rng);
            // Too full to act in.
            if scene.places.len() >= FEWEST_PLACES || scene.furniture.pop().is_none() {
                return scene;
            }
        }
    }

    /// Places where people have room, looking at the radar.
    fn some_places(&self, rng: &mut ChaCha8Rng) -> Vec<Place> {
        let Room { min, max, .. } = self.room;
        let mut place = || {
            let position = Vec2::new(rng.random_range(min.x..max.x), rng.random_range(min.y..max.y));
            Place { position, facing_rad: 0.0 }
        };
        (0..TRIES).map(|_| place()).filter(|place| self.admits(place)).take(PLACES).collect()
    }
}

/// A piece of furniture, at a wall or anywhere.
fn piece(number: usize, room: &Room, rng: &mut ChaCha8Rng) -> Furniture {
    let mut length = rng.random_range(0.4..2.6_f32);
    let depth = rng.random_range(0.3..0.8_f32);
    let height = rng.random_range(0.4..2.1_f32);
    let Room { min, max, .. } = *room;
    // Left, right and far wall, or in the room.
    let wall = rng.random_range(0..4);
    let along = if wall == 2 { 0 } else { 1 };
    length = length.min((max - min)[along] - 0.1);
    let place = rng.random_range(min[along] + length / 2.0..max[along] - length / 2.0);
    let z = min.z + height / 2.0;
    let (centre, size, yaw_rad) = match wall {
        0 => (Vec3::new(min.x + depth / 2.0, place, z), Vec3::new(depth, length, height), 0.0),
        1 => (Vec3::new(max.x - depth / 2.0, place, z), Vec3::new(depth, length, height), 0.0),
        2 => (Vec3::new(place, max.y - depth / 2.0, z), Vec3::new(length, depth, height), 0.0),
        _ => {
            // Low, so that one sees and stands behind it.
            let size = Vec3::new(length.min(1.6), depth, height.min(0.8));
            let half = size.truncate().length() / 2.0;
            let x = rng.random_range(min.x + half..max.x - half);
            let y = rng.random_range(min.y + half..max.y - half);
            let yaw_rad = rng.random_range(0.0..std::f32::consts::PI);
            (Vec3::new(x, y, min.z + size.z / 2.0), size, yaw_rad)
        }
    };
    let name = format!("piece {number}");
    Furniture { name, centre, size, yaw_rad, reflectivity: rng.random_range(SCATTERED) }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn rooms_differ_hold_what_is_in_them_and_have_places() {
        let hall = Scene::named("open-room").unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let rooms: Vec<Scene> = (0..40).map(|number| hall.other_room(number, None, &mut rng)).collect();
        for scene in &rooms {
            assert!(scene.places.len() >= FEWEST_PLACES, "{}", scene.name);
            assert!(scene.places.iter().all(|place| scene.admits(place)));
            let slack = Vec3::splat(1e-3);
            let walls = Room { min: scene.room.min - slack, max: scene.room.max + slack, ..scene.room };
            assert!(scene.furniture.iter().flat_map(Furniture::corners).all(|corner| walls.contains(corner)));
            let radios = scene.reader.antennas.iter().map(|antenna| antenna.position);
            for point in radios.chain([scene.radar.position]) {
                assert!(scene.room.contains(point));
                assert!(!scene.furniture.iter().any(|piece| piece.contains(point)));
            }
            assert_eq!((scene.radar.clone(), scene.tags.len()), (hall.radar.clone(), hall.tags.len()));
        }
        assert!(rooms.windows(2).all(|pair| pair[0].room != pair[1].room));
        assert!(rooms.iter().any(|scene| scene.furniture.is_empty()));
        assert!(rooms.iter().any(|scene| scene.furniture.len() > 3));
    }
}
