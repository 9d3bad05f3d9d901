//! Where people may stand: free, with room for their hands, in sight of the radar and within its gate.

use glam::{Vec2, Vec3};

use super::{Furniture, Place, RadarPose, Room, Scene};

/// What a person needs around them, m.
pub const PERSON_M: f32 = 0.35;
/// What is done with the hands happens up to this far in front of a person, m.
pub const WORKPLACE_M: f32 = 0.8;
/// Nearest place to the radar, so that the workplace before a person who looks at it does not reach it, m.
pub const NEAREST_M: f32 = 0.9;
/// What the radar's antennas see to either side and up and down: 120 degrees in all.
pub const FIELD_OF_VIEW_RAD: f32 = core::f32::consts::FRAC_PI_3;
/// Height of a standing person's chest over the floor, the middle of what the radar must see, m.
pub const CHEST_M: f32 = 1.2;
/// A little under the top of the lowest table, over the floor, m.
const TABLE_M: f32 = 0.7;
/// From the middle of a person to the end of a shoulder, m.
const SHOULDER_M: f32 = 0.25;
/// Rounding of coordinates: what touches a wall is not in it, m.
pub(super) const TOUCH_M: f32 = 1e-3;

/// Why nobody can act at a place; numbers are those of pieces of furniture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fault {
    /// They would be out of the room.
    Outside,
    /// They would stand in a wall.
    InWall,
    /// They would stand in a piece of furniture.
    InFurniture(usize),
    /// There is a wall where their hands would be.
    WallBefore,
    /// There is a piece of furniture where their hands would be.
    FurnitureBefore(usize),
    /// The radar is too near, m.
    Near { distance_m: f32 },
    /// They are beside, above or below what the radar sees, rad.
    OutOfSight { azimuth_rad: f32, elevation_rad: f32 },
    /// They are past the range gate, m.
    Far { range_m: f32 },
    /// A piece of furniture stands before them.
    Hidden(usize),
}

/// Why nobody can act at `place`; `None` if they can.
pub(super) fn fault<'a>(
    room: &Room,
    radar: &RadarPose,
    furniture: impl Iterator<Item = &'a Furniture> + Clone,
    place: &Place,
) -> Option<Fault> {
    let stand = place.position;
    let floor = stand.extend(room.min.z);
    let margin = Vec3::new(PERSON_M - TOUCH_M, PERSON_M - TOUCH_M, 0.0);
    if !room.contains(floor - margin) || !room.contains(floor + margin) {
        return Some(if room.contains(floor) { Fault::InWall } else { Fault::Outside });
    }
    let low = || furniture.clone().enumerate().filter(|(_, piece)| piece.is_low(room));
    if let Some((n, _)) = low().find(|(_, piece)| piece.distance_on_floor(stand) < PERSON_M - TOUCH_M) {
        return Some(Fault::InFurniture(n));
    }
    if let Some(fault) = before(room, radar, furniture.clone(), place) {
        return Some(fault);
    }
    let distance_m = stand.distance(radar.position.truncate());
    if distance_m < NEAREST_M - TOUCH_M {
        return Some(Fault::Near { distance_m });
    }
    let chest = place.chest(room);
    let seen = radar.axes() * (chest - radar.position);
    let azimuth_rad = libm::atan2f(seen.x, seen.y);
    let elevation_rad = libm::atan2f(seen.z, seen.truncate().length());
    if azimuth_rad.abs() > FIELD_OF_VIEW_RAD || elevation_rad.abs() > FIELD_OF_VIEW_RAD {
        return Some(Fault::OutOfSight { azimuth_rad, elevation_rad });
    }
    let range_m = seen.length();
    if range_m > radar.depth_m {
        return Some(Fault::Far { range_m });
    }
    let hides = furniture.enumerate().find(|(_, piece)| piece.entered(radar.position, chest).is_some());
    hides.map(|(n, _)| Fault::Hidden(n))
}

/// What is where the hands of a person at `place` would be.
fn before<'a>(
    room: &Room,
    radar: &RadarPose,
    furniture: impl Iterator<Item = &'a Furniture>,
    place: &Place,
) -> Option<Fault> {
    let hands = place.hands(radar.position);
    if !room.contains(hands.extend(room.min.z)) {
        return Some(Fault::WallBefore);
    }
    let between = furniture.enumerate().find(|(_, piece)| piece.is_between(room, place.position, hands));
    between.map(|(n, _)| Fault::FurnitureBefore(n))
}

impl Place {
    /// Where a person at this place looks, for a radar at `radar`: a unit vector on the floor.
    pub fn front(&self, radar: Vec3) -> Vec2 {
        let towards = (radar.truncate() - self.position).normalize_or(Vec2::NEG_Y);
        Vec2::new(libm::cosf(self.facing_rad), libm::sinf(self.facing_rad)).rotate(towards)
    }

    /// Where their chest is when they stand.
    pub(super) fn chest(&self, room: &Room) -> Vec3 {
        self.position.extend(room.min.z + CHEST_M)
    }

    /// As far before them as their hands reach.
    fn hands(&self, radar: Vec3) -> Vec2 {
        self.position + self.front(radar) * WORKPLACE_M
    }
}

impl Scene {
    /// Whether the hands of a person at `place` have room for a sample's own things.
    pub fn is_free(&self, place: &Place) -> bool {
        before(&self.room, &self.radar, self.furniture.iter(), place).is_none()
    }

    /// Whether a person at `place` stands free and has room for their hands, wherever the radar looks.
    pub fn has_room(&self, place: &Place) -> bool {
        let fault = fault(&self.room, &self.radar, self.furniture.iter(), place);
        matches!(fault, None | Some(Fault::OutOfSight { .. } | Fault::Far { .. } | Fault::Hidden(_)))
    }

    /// Whether a person at `place` has room, and is where the radar looks, though furniture may hide them.
    pub fn has_in_view(&self, place: &Place) -> bool {
        let fault = fault(&self.room, &self.radar, self.furniture.iter(), place);
        matches!(fault, None | Some(Fault::Hidden(_)))
    }

    /// From a person at `place` straight back to a wall, or to a piece of furniture at the height of a table, over the width
    /// of their shoulders, m; 0 if there is one beside them.
    pub fn room_behind(&self, place: &Place) -> f32 {
        let back = -place.front(self.radar.position).extend(0.0);
        let middle = place.position.extend(self.room.min.z + TABLE_M);
        let free = |aside: f32| {
            let from = middle + back.cross(Vec3::Z) * aside;
            if !self.room.contains(from) {
                return 0.0;
            }
            let wall_m = self.room.distance_to_wall(from, back);
            let entered = self.furniture.iter().filter_map(|piece| piece.entered(from, from + back * wall_m));
            entered.fold(1.0, f32::min) * wall_m
        };
        [-SHOULDER_M, 0.0, SHOULDER_M].map(free).into_iter().fold(f32::INFINITY, f32::min)
    }

    /// Whether a person at `place` stands free, has room for their hands, and is seen by the radar.
    pub fn admits(&self, place: &Place) -> bool {
        fault(&self.room, &self.radar, self.furniture.iter(), place).is_none()
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn people_turn_to_their_left() {
        let radar = Vec3::new(0.0, 0.2, 1.0);
        let place = |facing_rad| Place { position: Vec2::new(0.0, 2.2), facing_rad };
        assert!(place(0.0).front(radar).distance(Vec2::NEG_Y) < 1e-6);
        // Who looks at the radar has x, which is the radar's right, on their left.
        assert!(place(FRAC_PI_2).front(radar).distance(Vec2::X) < 1e-6);
    }
    #[test]
    fn behind_people_there_is_room_up_to_a_wall_or_a_desk() {
        let scene = Scene::named("working-space").unwrap();
        let radar = scene.radar.position.truncate();
        let at = |x: f32, y: f32| Place { position: Vec2::new(x, y), facing_rad: 0.0 };
        // Who looks at the radar has the far wall behind them, at 6 m, or the desks before it, from 5 m on.
        let straight = at(radar.x, 5.5);
        assert!((scene.room_behind(&straight) - 0.5).abs() < 1e-3, "{}", scene.room_behind(&straight));
        let left = Place { facing_rad: -libm::atan2f(2.5, 3.6), ..at(-2.5, 4.0) };
        assert!(left.front(scene.radar.position).distance(Vec2::NEG_Y) < 1e-3);
        assert!((scene.room_behind(&left) - 1.0).abs() < 1e-3, "{}", scene.room_behind(&left));
        assert_eq!(scene.room_behind(&at(-3.3, 5.0)), 0.0);
        for place in &scene.places {
            assert!(scene.has_room(place) && scene.has_in_view(place) && scene.room_behind(place) > 0.5);
        }
        let past = at(0.0, 4.6);
        assert!(scene.has_room(&past) && !scene.has_in_view(&past) && !scene.admits(&past));
    }
}
