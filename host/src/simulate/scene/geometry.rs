//! Boxes: what is inside, what a ray meets, mirror images in walls, and facets for the radar.

use glam::{Mat3, Vec2, Vec3};

use super::{Furniture, Room, Scene};
use crate::simulate::Surface;

/// Longest edge of a facet of furniture, m.
const FACET_M: f32 = 0.15;
/// Height under which people walk, m.
const HEADROOM_M: f32 = 2.2;
/// Faces nearer than this to a wall are not seen, m.
const FLUSH_M: f32 = 0.01;

impl Room {
    /// Mirror images of `point` in its walls: lowest and highest x, lowest and highest y, floor, ceiling.
    pub fn images(&self, point: Vec3) -> [Vec3; 6] {
        let image = |axis: usize, wall: f32| {
            let mut image = point;
            image[axis] = 2.0 * wall - point[axis];
            image
        };
        [
            image(0, self.min.x),
            image(0, self.max.x),
            image(1, self.min.y),
            image(1, self.max.y),
            image(2, self.min.z),
            image(2, self.max.z),
        ]
    }

    /// Whether `point` is in its air or on its walls.
    pub fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// From `point` inside along the unit vector `direction` to the wall, m.
    pub(super) fn distance_to_wall(&self, point: Vec3, direction: Vec3) -> f32 {
        let ahead = (0..3).filter_map(|axis| {
            let wall = if direction[axis] > 0.0 { self.max[axis] } else { self.min[axis] };
            (direction[axis] != 0.0).then(|| (wall - point[axis]) / direction[axis])
        });
        ahead.fold(f32::INFINITY, f32::min)
    }
}

impl Furniture {
    /// From room to box: rows are its width, depth and height in room coordinates.
    fn axes(&self) -> Mat3 {
        let (sin, cos) = (libm::sinf(self.yaw_rad), libm::cosf(self.yaw_rad));
        Mat3::from_cols(Vec3::new(cos, -sin, 0.0), Vec3::new(sin, cos, 0.0), Vec3::Z).transpose()
    }

    /// Its eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        let to_room = self.axes().transpose();
        std::array::from_fn(|n| {
            let sign = |bit: usize| if n & bit == 0 { -0.5 } else { 0.5 };
            self.centre + to_room * (self.size * Vec3::new(sign(1), sign(2), sign(4)))
        })
    }

    /// Whether `point` is inside.
    pub fn contains(&self, point: Vec3) -> bool {
        (self.axes() * (point - self.centre)).abs().cmplt(self.size / 2.0).all()
    }

    /// Where the way from `start` to `end` enters it, as a share of the way; 0 if `start` is inside. Slab method (T. Kay
    /// and J. Kajiya, 1986).
    pub(super) fn entered(&self, start: Vec3, end: Vec3) -> Option<f32> {
        let axes = self.axes();
        let (from, way, half) = (axes * (start - self.centre), axes * (end - start), self.size / 2.0);
        let (mut enter, mut leave) = (0.0_f32, 1.0_f32);
        for axis in 0..3 {
            if way[axis] == 0.0 {
                if from[axis].abs() >= half[axis] {
                    return None;
                }
                continue;
            }
            let (a, b) = ((-half[axis] - from[axis]) / way[axis], (half[axis] - from[axis]) / way[axis]);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter < leave).then_some(enter)
    }

    /// From `point` on the floor to its outline as seen from above, m; 0 inside.
    pub(super) fn distance_on_floor(&self, point: Vec2) -> f32 {
        let local = (self.axes() * (point.extend(self.centre.z) - self.centre)).abs();
        (local - self.size / 2.0).max(Vec3::ZERO).truncate().length()
    }

    /// Whether people do not walk under it.
    pub(super) fn is_low(&self, room: &Room) -> bool {
        self.centre.z - self.size.z / 2.0 < room.min.z + HEADROOM_M
    }

    /// Whether it is between a person at `stand` and what their hands reach at `hands`.
    pub(super) fn is_between(&self, room: &Room, stand: Vec2, hands: Vec2) -> bool {
        let height = self.centre.z.clamp(room.min.z, room.min.z + HEADROOM_M);
        self.is_low(room) && self.entered(stand.extend(height), hands.extend(height)).is_some()
    }
}

impl Scene {
    /// The furniture as the radar sees it: triangles with outward normals, and their vertices, m. Walls are no part of
    /// it: they mirror ([`Room::images`]). Faces that stand against a wall, the floor or the ceiling are left out.
    pub fn fixtures(&self) -> (Surface, Vec<Vec3>) {
        let (mut surface, mut vertices) = (Surface::default(), Vec::new());
        for furniture in &self.furniture {
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    self.face(furniture, (axis, sign), &mut surface, &mut vertices);
                }
            }
        }
        (surface, vertices)
    }

    /// Appends the face of a box across `axis`, on the side of `sign`.
    fn face(
        &self,
        furniture: &Furniture,
        (axis, sign): (usize, f32),
        surface: &mut Surface,
        vertices: &mut Vec<Vec3>,
    ) {
        let to_room = furniture.axes().transpose();
        let normal = to_room.col(axis) * sign;
        let middle = furniture.centre + normal * furniture.size[axis] / 2.0;
        if !self.room.contains(middle + normal * FLUSH_M) {
            return;
        }
        // Right-handed with the normal: u x v points outwards.
        let (u_axis, v_axis) = ((axis + 1) % 3, (axis + 2) % 3);
        let (u, v) = (
            to_room.col(u_axis) * sign * furniture.size[u_axis],
            to_room.col(v_axis) * furniture.size[v_axis],
        );
        let cells = |length: f32| (length / FACET_M).ceil().max(1.0) as u32;
        let (columns, rows) = (cells(furniture.size[u_axis]), cells(furniture.size[v_axis]));
        let first = vertices.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                let share = Vec2::new(column as f32 / columns as f32, row as f32 / rows as f32) - 0.5;
                vertices.push(middle + u * share.x + v * share.y);
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let corner = first + row * (columns + 1) + column;
                let (right, up) = (corner + 1, corner + columns + 1);
                surface.triangles.extend([[corner, right, up + 1], [corner, up + 1, up]]);
                surface.reflectivity.extend([furniture.reflectivity; 2]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    const ROOM: Room =
        Room { min: Vec3::new(-2.0, 0.0, 0.0), max: Vec3::new(2.0, 5.0, 2.6), reflectivity: 0.1 };

    fn cupboard(yaw_rad: f32) -> Furniture {
        Furniture {
            name: "cupboard".into(),
            centre: Vec3::new(1.0, 3.0, 1.0),
            size: Vec3::new(0.8, 0.4, 2.0),
            yaw_rad,
            reflectivity: 0.3,
        }
    }

    #[test]
    fn images_lie_behind_walls_and_mirrored_paths_are_as_long() {
        let (radar, point) = (Vec3::new(0.1, 0.2, 1.0), Vec3::new(1.2, 3.0, 0.7));
        let images = ROOM.images(point);
        assert!(images.iter().all(|&i| !ROOM.contains(i)));
        assert_eq!(images[0], Vec3::new(-5.2, 3.0, 0.7));
        assert_eq!(images[5], Vec3::new(1.2, 3.0, 4.5));
        for (n, image) in images.into_iter().enumerate() {
            // Where the straight way to the image crosses the wall, the real way turns: same length, equal angles.
            let (axis, wall) = (n / 2, if n % 2 == 0 { ROOM.min } else { ROOM.max });
            let share = (wall[axis] - radar[axis]) / (image[axis] - radar[axis]);
            let turn = radar.lerp(image, share);
            let length = radar.distance(turn) + turn.distance(point);
            assert!((length - radar.distance(image)).abs() < 1e-5, "{n}: {length}");
        }
    }

    #[test]
    fn facets_face_outwards_are_small_and_cover_the_box() {
        let scene =
            Scene { room: ROOM, furniture: vec![cupboard(0.4)], ..Scene::named("open-room").unwrap() };
        let (surface, vertices) = scene.fixtures();
        assert_eq!(surface.triangles.len(), surface.reflectivity.len());
        let mut area = 0.0;
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|n| vertices[n as usize]);
            let normal = (b - a).cross(c - a);
            assert!(normal.dot((a + b + c) / 3.0 - scene.furniture[0].centre) > 0.0);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            assert!(longest <= FACET_M * 2.0_f32.sqrt() + 1e-4, "{longest}");
            area += normal.length() / 2.0;
        }
        // All but the underside, which is on the floor.
        let expected = 2.0 * (0.8 + 0.4) * 2.0 + 0.8 * 0.4;
        assert!((area - expected).abs() < 1e-3, "{area}");
    }

    #[test]
    fn yaw_is_clockwise_from_above() {
        let turned = cupboard(FRAC_PI_2);
        assert!(turned.contains(Vec3::new(1.0, 3.35, 1.0)) && !turned.contains(Vec3::new(1.35, 3.0, 1.0)));
        let slightly = cupboard(0.3);
        // Its right end comes nearer to the radar's wall.
        assert!(
            slightly.contains(Vec3::new(1.35, 2.9, 1.0)) && !slightly.contains(Vec3::new(1.35, 3.15, 1.0))
        );
    }

    #[test]
    fn ways_enter_boxes() {
        let cupboard = cupboard(0.0);
        let at = |y| Vec3::new(1.0, y, 1.0);
        assert!((cupboard.entered(at(0.8), at(4.8)).unwrap() - 0.5).abs() < 1e-6);
        assert_eq!(cupboard.entered(at(0.8), at(2.7)), None);
        assert_eq!(cupboard.entered(at(3.1), at(4.0)), Some(0.0));
        assert_eq!(cupboard.entered(Vec3::new(0.5, 0.0, 1.0), Vec3::new(0.5, 5.0, 1.0)), None);
        assert!((cupboard.distance_on_floor(Vec2::new(1.7, 3.6)) - 0.5).abs() < 1e-6);
        assert_eq!(cupboard.distance_on_floor(Vec2::new(1.1, 3.0)), 0.0);
    }

    #[test]
    fn rays_end_at_walls() {
        let from = Vec3::new(0.0, 0.2, 1.0);
        for (direction, distance) in [(Vec3::Y, 4.8), (Vec3::NEG_Y, 0.2), (Vec3::Z, 1.6)] {
            assert!((ROOM.distance_to_wall(from, direction) - distance).abs() < 1e-6);
        }
    }
}
