//! Things: their meshes, where a hand takes them, what they turn about, and where their tag is.
//!
//! Axes of a thing: x to the right and y away as the person sees it, z up; its origin is the middle of its base. Sizes
//! are those of usual ones, in metres.

use glam::{Quat, Vec3};

use crate::hoi::{Action, Object};
use crate::simulate::shape::{Solid, material};
use crate::simulate::stage::Pose;

/// A line that a part turns about.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hinge {
    pivot: Vec3,
    axis: Vec3,
    /// Least and largest angle of what is called open, rad.
    pub(super) open: [f32; 2],
}

impl Hinge {
    /// Where the part is when it is open by `angle` rad.
    pub(super) fn pose(&self, angle: f32) -> Pose {
        let turn = Quat::from_axis_angle(self.axis, angle);
        Pose { at: self.pivot - turn * self.pivot, turn }
    }
}

/// A thing.
#[derive(Debug, Clone)]
pub(super) struct Thing {
    /// What stays where it is.
    pub(super) still: Solid,
    /// What moves, as it lies or is closed.
    pub(super) moving: Solid,
    /// What that turns about, if it is not carried.
    pub(super) hinge: Option<Hinge>,
    /// Where the middle of the grip is when a hand takes what moves.
    pub(super) grip: Vec3,
    /// The tag on what moves; without anything that moves, on what stays.
    pub(super) tag: Vec3,
    /// Radius that it takes up on a table, m.
    pub(super) radius: f32,
}

/// Tags lie this far above what they stick to, m.
const TAG_GAP: f32 = 0.001;
/// Width of a table's top, m.
pub(super) const TABLE_WIDTH: f32 = 1.4;
/// Depth of a table's top, m.
pub(super) const TABLE_DEPTH: f32 = 0.6;
/// Height of a chair's seat, m.
pub(super) const SEAT_HEIGHT: f32 = 0.45;
/// Half of a seat's depth, m.
pub(super) const SEAT_HALF: f32 = 0.21;

/// A box that stands on z = `base`, its middle at x, y.
fn block(x: f32, y: f32, base: f32, size: Vec3, reflectivity: f32) -> Solid {
    let min = Vec3::new(x - 0.5 * size.x, y - 0.5 * size.y, base);
    Solid::cuboid(min, min + size, reflectivity)
}

fn boxed(width: f32, depth: f32, height: f32, reflectivity: f32) -> Thing {
    let size = Vec3::new(width, depth, height);
    Thing {
        still: Solid::default(),
        moving: block(0.0, 0.0, 0.0, size, reflectivity),
        hinge: None,
        // From above, at the near edge.
        grip: Vec3::new(0.0, -0.35 * depth, height + 0.02),
        tag: Vec3::Z * (height + TAG_GAP),
        radius: 0.5 * size.truncate().length(),
    }
}

/// A vessel about z, taken at its near side at `grip_height`, its tag on the near side too, at `tag_height`.
fn vessel(circles: &[(f32, f32)], reflectivity: f32, grip_height: f32, tag_height: f32) -> Thing {
    /// Half a hand.
    const PALM: f32 = 0.02;
    let radius = circles.iter().map(|c| c.1).fold(0.0, f32::max);
    Thing {
        still: Solid::default(),
        moving: Solid::lathe(circles, reflectivity),
        hinge: None,
        grip: Vec3::new(0.0, -radius - PALM, grip_height),
        tag: Vec3::new(0.0, -radius - TAG_GAP, tag_height),
        radius,
    }
}

impl Thing {
    /// `object` as it is for `action`: books are carried whole, or opened. `mirrored` doors have their hinge to the right.
    pub(super) fn new(object: Object, action: Option<Action>, mirrored: bool) -> Self {
        use material::{GLASS, PAPER, PLASTIC, WATER};
        let opens = matches!(action, Some(Action::Open | Action::Close));
        match object {
            Object::Phone => boxed(0.075, 0.15, 0.009, GLASS),
            Object::Book if opens => opened_book(),
            Object::Book => boxed(0.15, 0.21, 0.025, PAPER),
            Object::Pen => pen(),
            Object::Bottle => {
                let circles = [
                    (0.0, 0.033),
                    (0.06, 0.033),
                    (0.12, 0.033),
                    (0.17, 0.032),
                    (0.21, 0.014),
                    (0.235, 0.014),
                ];
                vessel(&circles, WATER, 0.12, 0.06)
            }
            Object::Microwave => {
                cased(Vec3::new(0.46, 0.34, 0.27), 0.34, material::METAL, PLASTIC, 0.14, [1.1, 1.7], mirrored)
            }
            Object::Cabinet => cased(
                Vec3::new(0.40, 0.30, 0.60),
                0.40,
                material::WOOD,
                material::WOOD,
                0.08,
                [0.9, 1.5],
                mirrored,
            ),
            Object::Table => table(0.74),
            Object::Chair => chair(),
            Object::Jar => {
                vessel(&[(0.0, 0.045), (0.06, 0.045), (0.11, 0.045), (0.13, 0.038)], GLASS, 0.08, 0.06)
            }
            Object::Lunchbox => boxed(0.20, 0.14, 0.07, PLASTIC),
            Object::Bowl => vessel(&[(0.0, 0.035), (0.03, 0.060), (0.06, 0.075)], GLASS, 0.05, 0.05),
            Object::Cup => vessel(&[(0.0, 0.035), (0.05, 0.040), (0.095, 0.042)], GLASS, 0.05, 0.05),
            Object::EyeglassCase => boxed(0.16, 0.065, 0.045, PLASTIC),
        }
    }
}

fn pen() -> Thing {
    const RADIUS: f32 = 0.006;
    let upright = Solid::lathe(&[(-0.07, RADIUS), (0.07, RADIUS)], material::PLASTIC);
    let mut moving = Solid::default();
    moving.add(&upright, |v| Vec3::new(v.z, v.x, v.y + RADIUS));
    Thing {
        still: Solid::default(),
        moving,
        hinge: None,
        grip: Vec3::new(0.0, -0.01, 0.025),
        tag: Vec3::Z * (2.0 * RADIUS + TAG_GAP),
        radius: 0.07,
    }
}

/// A book that lies, its spine to the left; the cover is taken at its right edge.
fn opened_book() -> Thing {
    const WIDTH: f32 = 0.15;
    const DEPTH: f32 = 0.21;
    const PAGES: f32 = 0.02;
    const COVER: f32 = 0.004;
    let pages = block(0.0, 0.0, 0.0, Vec3::new(WIDTH, DEPTH, PAGES), material::PAPER);
    let cover = block(0.0, 0.0, PAGES, Vec3::new(WIDTH, DEPTH, COVER), material::PAPER);
    Thing {
        still: pages,
        moving: cover,
        hinge: Some(Hinge {
            pivot: Vec3::new(-0.5 * WIDTH, 0.0, PAGES),
            axis: Vec3::NEG_Y,
            open: [2.5, 2.9],
        }),
        grip: Vec3::new(0.5 * WIDTH + 0.01, -0.05, PAGES + 0.02),
        tag: Vec3::new(0.02, 0.0, PAGES + COVER + TAG_GAP),
        radius: 0.13,
    }
}

/// A case of `size` with a door `width` wide in front, taken at its free edge at the height `grip`.
fn cased(size: Vec3, width: f32, case: f32, door: f32, grip: f32, open: [f32; 2], mirrored: bool) -> Thing {
    const DOOR: f32 = 0.02;
    let side = if mirrored { -1.0 } else { 1.0 };
    let hinge_x = -0.5 * size.x * side;
    let front = -0.5 * size.y;
    let middle = hinge_x + 0.5 * width * side;
    let edge = hinge_x + (width - 0.02) * side;
    Thing {
        still: block(0.0, 0.0, 0.0, size, case),
        moving: block(middle, front - 0.5 * DOOR, 0.0, Vec3::new(width, DOOR, size.z), door),
        hinge: Some(Hinge { pivot: Vec3::new(hinge_x, front, 0.0), axis: Vec3::NEG_Z * side, open }),
        grip: Vec3::new(edge, front - DOOR - 0.02, grip),
        tag: Vec3::new(middle + 0.1 * width * side, front - DOOR - TAG_GAP, 0.5 * size.z),
        radius: 0.5 * size.x,
    }
}

/// A table of this height on four legs; its tag is on the top, in the far left corner.
pub(super) fn table(height: f32) -> Thing {
    const TOP_THICKNESS: f32 = 0.025;
    let (width, depth) = (TABLE_WIDTH, TABLE_DEPTH);
    let top = Vec3::new(width, depth, TOP_THICKNESS);
    let mut still = block(0.0, 0.0, height - TOP_THICKNESS, top, material::WOOD);
    legs(&mut still, 0.5 * width - 0.03, 0.5 * depth - 0.03, height - TOP_THICKNESS);
    Thing {
        still,
        moving: Solid::default(),
        hinge: None,
        grip: Vec3::Z * height,
        tag: Vec3::new(-0.42 * width, 0.42 * depth, height + TAG_GAP),
        radius: 0.5 * width,
    }
}

/// A board, its upper side at this height, its middle at x, y = 0.
pub(super) fn board(width: f32, depth: f32, height: f32) -> Solid {
    const THICKNESS: f32 = 0.025;
    block(0.0, 0.0, height - THICKNESS, Vec3::new(width, depth, THICKNESS), material::WOOD)
}

/// A chair whose sitter looks along y; its tag is on the seat, near the front edge.
fn chair() -> Thing {
    const SEAT: f32 = 0.03;
    const BACK: Vec3 = Vec3::new(2.0 * SEAT_HALF, 0.025, 0.40);
    let seat = Vec3::new(2.0 * SEAT_HALF, 2.0 * SEAT_HALF, SEAT);
    let mut still = block(0.0, 0.0, SEAT_HEIGHT - SEAT, seat, material::WOOD);
    let back = block(0.0, -SEAT_HALF - 0.5 * BACK.y, SEAT_HEIGHT, BACK, material::WOOD);
    still.add(&back, |v| v);
    legs(&mut still, SEAT_HALF - 0.02, SEAT_HALF - 0.02, SEAT_HEIGHT - SEAT);
    Thing {
        still,
        moving: Solid::default(),
        hinge: None,
        grip: Vec3::Z * SEAT_HEIGHT,
        tag: Vec3::new(0.0, 0.8 * SEAT_HALF, SEAT_HEIGHT + TAG_GAP),
        radius: 0.3,
    }
}

fn legs(solid: &mut Solid, x: f32, y: f32, height: f32) {
    for (x, y) in [(-x, -y), (x, -y), (-x, y), (x, y)] {
        solid.add(&block(x, y, 0.0, Vec3::new(0.04, 0.04, height), material::WOOD), |v| v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doors_open_towards_the_person_and_covers_up() {
        for mirrored in [false, true] {
            for (object, way) in
                [(Object::Microwave, Vec3::NEG_Y), (Object::Cabinet, Vec3::NEG_Y), (Object::Book, Vec3::Z)]
            {
                let thing = Thing::new(object, Some(Action::Open), mirrored);
                let hinge = thing.hinge.unwrap();
                assert!((hinge.pose(0.0).point(thing.tag) - thing.tag).length() < 1e-6);
                let moved = hinge.pose(0.5).point(thing.grip) - thing.grip;
                assert!(moved.dot(way) > 0.04, "{object} moves by {moved}");
            }
        }
    }

    #[test]
    fn what_is_carried_moves_whole() {
        for &object in Object::ALL {
            let thing = Thing::new(object, None, false);
            let carried = thing.hinge.is_none() && !thing.moving.vertices.is_empty();
            assert_eq!(carried, object.is_carried(), "{object}");
            assert_eq!(thing.still.vertices.is_empty(), object.is_carried(), "{object}");
        }
    }
}
