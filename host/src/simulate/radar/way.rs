//! Where the wave of a path goes: for pictures.

use glam::Vec3;

use super::{Path, Radar};

impl Radar {
    /// The way of `path`, one of the frame in view, in the room, m: from the radar to the scatterer and back, by way of a wall
    /// in between if it has such a leg; as it is in the middle of the frame's chirps.
    pub fn way(&self, path: &Path) -> Vec<Vec3> {
        let whole_m = 2.0 * path.half_m[1];
        let legs = [path.departure, path.arrival];
        let points = if legs[0] == legs[1] {
            vec![unit(legs[0]) * path.half_m[1]]
        } else {
            // Either leg may be the one by way of the wall; one order and one wall fit.
            let ways = self.mirrors.iter().flat_map(|&(image, _)| {
                let [out, back] = legs;
                let forth = by_wall(image, whole_m, out, back);
                let reverse = by_wall(image, whole_m, back, out);
                [(forth.0, forth.1.to_vec()), (reverse.0, reverse.1.into_iter().rev().collect())]
            });
            ways.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(Vec::new(), |(_, points)| points)
        };
        let to_room = self.axes.transpose();
        let ends = |p: Vec3| self.position + to_room * p;
        std::iter::once(Vec3::ZERO).chain(points).chain([Vec3::ZERO]).map(ends).collect()
    }
}

/// The direction with these cosines to the right and upwards: nothing is seen behind.
fn unit([right, up]: [f32; 2]) -> Vec3 {
    Vec3::new(right, libm::sqrtf((1.0 - right * right - up * up).max(0.0)), up)
}

/// Scatterer, and where the wave meets the wall in which the radar's image is at `image`, if it leaves straight and comes back
/// by that wall over `whole_m`; and by how much it then does not come from `back`.
fn by_wall(image: Vec3, whole_m: f32, out: [f32; 2], back: [f32; 2]) -> (f32, [Vec3; 2]) {
    let out = unit(out);
    // The scatterer is on an ellipsoid about the radar and its image: |d out - image| = whole - d.
    let direct_m = (whole_m * whole_m - image.length_squared()) / (2.0 * (whole_m - out.dot(image)));
    let scatterer = out * direct_m;
    let (normal, half) = (image.normalize(), image.length() / 2.0);
    let mirrored = scatterer - 2.0 * scatterer.dot(normal) * normal + image;
    let wall = mirrored * (half / mirrored.dot(normal));
    let off = (mirrored.normalize() - unit(back)).length();
    // Scatterers are on the radar's side of the wall.
    let possible = direct_m > 0.0 && scatterer.dot(normal) < half && off.is_finite();
    (if possible { off } else { f32::INFINITY }, [scatterer, wall])
}

#[cfg(test)]
mod tests {
    use crate::simulate::effects::Effects;
    use crate::simulate::radar::Radar;
    use crate::simulate::scene::{Person, Scene};
    use crate::simulate::{Performance, perform};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn ways_are_as_long_as_their_paths_and_turn_on_people_and_walls() {
        let scene = Scene::named("kitchen").unwrap();
        let effects = Effects { clutter: false, ..Effects::of(crate::simulate::effects::Domain::Site) };
        let mut radar = Radar::new(&scene, effects).unwrap();
        let person = Person { name: "somebody".to_owned(), height_m: 1.7, build: 1.0, manner: None };
        let brief = perform::Brief {
            person: &person,
            place: scene.places[0],
            radar: scene.radar.position,
            label: None,
            objects: &[],
            within_reach: &[],
            offsets: &[],
            manner: perform::Manner::MinimumJerk,
            covers_db: 0.0,
            behind_m: None,
            stay: None,
        };
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        let somebody = perform::Generated::new(&brief, rng).unwrap();
        radar.begin(None, rng);
        let paths = radar.look(&somebody, 1.0).to_vec();
        let mut vertices = Vec::new();
        somebody.vertices(1.0, &mut vertices);
        let room = &scene.room;
        let on_wall = |p: glam::Vec3| {
            let off = (p - room.min).abs().min((p - room.max).abs());
            off.min_element() < 0.01
        };
        let mut by_walls = 0;
        for path in &paths {
            let way = radar.way(path);
            let length: f32 = way.windows(2).map(|w| w[0].distance(w[1])).sum();
            assert!((length - 2.0 * path.half_m[1]).abs() < 0.01, "{length} m of {path:?}: {way:?}");
            assert_eq!((way[0], way[way.len() - 1]), (scene.radar.position, scene.radar.position));
            let turns = &way[1..way.len() - 1];
            let near = |p: glam::Vec3| vertices.iter().any(|v| v.distance(p) < 0.1);
            match turns {
                [body] => assert!(near(*body), "{body}"),
                [a, b] => {
                    by_walls += 1;
                    assert!(near(*a) && on_wall(*b) || near(*b) && on_wall(*a), "{way:?}");
                }
                other => panic!("{other:?}"),
            }
        }
        assert!(by_walls > 100 && by_walls < paths.len(), "{by_walls} of {}", paths.len());
    }
}
