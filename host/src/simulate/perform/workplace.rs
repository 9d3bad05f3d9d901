//! Where things are around a person: on a table in front of them, a cabinet above it, a chair behind or beside them; where the
//! brief says so, also on a board behind them.
//!
//! Person's axes: x to the right, y forward, z up, from the floor where they stand.

use std::ops::Range;

use glam::{Quat, Vec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Brief;
use crate::hoi::Object;
use crate::simulate::body::{Lengths, Side};
use crate::simulate::shape::Solid;
use crate::simulate::stage::Pose;
use crate::simulate::thing::{SEAT_HALF, TABLE_DEPTH, TABLE_WIDTH, Thing, board, table};

/// Things and where they are.
pub(super) struct Workplace {
    /// One for each object, as it is when it is at rest, lying or closed.
    pub(super) things: Vec<(Thing, Pose)>,
    /// A table that is none of the objects.
    table: Option<(Thing, Pose)>,
    /// A board behind the person.
    board: Option<(Solid, Pose)>,
    /// Middle of the free surface in front of the person, m.
    pub(super) surface: Vec3,
}

/// How far behind the ankles hips are when they sit, as a share of the height: what the thighs leave with shins upright.
pub(super) const SEATED_BACK: f32 = 0.215;

/// Heights of tables, and how far before the middle of a person they begin, m.
pub(in crate::simulate) const TABLE_TOPS_M: Range<f32> = 0.72..0.76;
pub(in crate::simulate) const TABLE_EDGES_M: Range<f32> = 0.22..0.30;
/// From the middle of a person to their back, m.
const BACK: f32 = 0.13;
/// What lies behind a person is so far aside at most, m: hidden by them from one who stands before them.
const BEHIND_ASIDE: f32 = 0.25;
/// Half the width of the board that it lies on, and how much deeper that is than where middles of things may be, m.
const BOARD_HALF: f32 = 0.4;
const BOARD_RIM: f32 = 0.1;

fn upright(at: Vec3, yaw: f32) -> Pose {
    Pose { at, turn: Quat::from_rotation_z(yaw) }
}

impl Workplace {
    /// Lays out the brief's objects for a person who acts with the hand of `side`, as they are before its label is done.
    pub(super) fn new(brief: &Brief<'_>, lengths: &Lengths, side: Side, rng: &mut ChaCha8Rng) -> Self {
        let Brief { objects, within_reach, label, .. } = *brief;
        let height = rng.random_range(TABLE_TOPS_M);
        let near = rng.random_range(TABLE_EDGES_M);
        let surface = Vec3::new(0.0, near + 0.5 * TABLE_DEPTH, height);
        let is_target = |object: Object| {
            objects.contains(&object)
                && (label.is_some_and(|label| label.object == object) || within_reach.contains(&object))
        };
        // Who sits down has their things behind the chair's back, not where they will sit.
        let seat = if is_target(Object::Chair) { SEATED_BACK * lengths.height } else { 0.0 };
        let mut taken: Vec<(Vec3, f32)> = Vec::new();
        if is_target(Object::Microwave) {
            // Its door needs room.
            taken.push((surface + Vec3::new(0.2 * side.sign(), -0.1, 0.0), 0.35));
        }
        // What is acted on chooses its place first, then the largest.
        let mut order: Vec<usize> = (0..objects.len()).collect();
        order.sort_by_key(|&i| (!is_target(objects[i]), objects[i] != Object::Microwave));
        let mut things: Vec<Option<(Thing, Pose)>> = vec![None; objects.len()];
        for i in order {
            let object = objects[i];
            let acted_on = is_target(object);
            let action = label.filter(|label| label.object == object).map(|label| label.action);
            let mirrored = object == Object::Cabinet && rng.random_bool(0.5);
            let thing =
                if object == Object::Table { table(height) } else { Thing::new(object, action, mirrored) };
            let yaw = rng.random_range(-0.3_f32..0.3);
            let placed = match object {
                Object::Table => (thing, upright(surface.with_z(0.0), 0.0)),
                Object::Chair => {
                    let at = if acted_on {
                        Vec3::NEG_Y * (SEATED_BACK * lengths.height - 0.25 * SEAT_HALF)
                    } else {
                        let aside =
                            rng.random_range(0.95..1.1) * if rng.random_bool(0.5) { -1.0 } else { 1.0 };
                        Vec3::new(aside, rng.random_range(-0.2..0.3), 0.0)
                    };
                    (thing, upright(at, if acted_on { 0.0 } else { 2.0 * yaw }))
                }
                Object::Cabinet => {
                    // On the wall, its lower edge well above the table and within reach. Beside the person, not
                    // between them and what they look at, which may be the radar.
                    let x = if acted_on {
                        rng.random_range(0.40..0.50) * side.sign()
                    } else {
                        rng.random_range(0.60..0.90) * if rng.random_bool(0.5) { -1.0 } else { 1.0 }
                    };
                    let base = (0.72 * lengths.height).max(height + 0.4);
                    (thing, upright(Vec3::new(x, near + 0.40, base), 0.0))
                }
                Object::Microwave => {
                    let x = if acted_on {
                        rng.random_range(0.12..0.30) * side.sign()
                    } else {
                        rng.random_range(0.40..0.46) * if rng.random_bool(0.5) { -1.0 } else { 1.0 }
                    };
                    let at = Vec3::new(x, near + TABLE_DEPTH - 0.17, height);
                    taken.push((at, thing.radius));
                    (thing, upright(at, 0.0))
                }
                _ => {
                    let at = free_place(&taken, thing.radius, rng, |rng| {
                        if acted_on {
                            let aside = rng.random_range(-0.08..0.36) * side.sign();
                            return Vec3::new(aside, near + rng.random_range(0.12..0.34), height);
                        }
                        if let Some(range) = &brief.behind_m {
                            let nearest = (BACK + thing.radius).clamp(range.start, range.end - 0.01);
                            let back = seat + rng.random_range(nearest..range.end);
                            return Vec3::new(rng.random_range(-BEHIND_ASIDE..BEHIND_ASIDE), -back, height);
                        }
                        let half = Vec3::new(0.5 * TABLE_WIDTH - 0.1, 0.5 * TABLE_DEPTH - 0.1, 0.0);
                        let share = Vec3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), 0.0);
                        surface + half * share
                    });
                    taken.push((at, thing.radius));
                    (thing, upright(at, yaw))
                }
            };
            things[i] = Some(placed);
        }
        let lies_on = |o: &Object| o.is_carried() || *o == Object::Microwave;
        let needs_table = objects.iter().any(lies_on) && !objects.contains(&Object::Table);
        let table = needs_table.then(|| (table(height), upright(surface.with_z(0.0), 0.0)));
        let is_behind = |object: &Object| object.is_carried() && !is_target(*object);
        let behind = brief.behind_m.as_ref().filter(|_| objects.iter().any(is_behind));
        let board = behind.map(|range| {
            let (from, to) = (BACK, range.end + BOARD_RIM);
            let at = Vec3::NEG_Y * (seat + 0.5 * (from + to));
            (board(2.0 * BOARD_HALF, to - from, height), upright(at, 0.0))
        });
        Self { things: things.into_iter().flatten().collect(), table, board, surface }
    }

    /// All that stays where it is while `moving` moves.
    pub(super) fn fixtures(&self, moving: Option<usize>) -> Solid {
        let mut fixtures = Solid::default();
        for (i, (thing, pose)) in self.things.iter().enumerate() {
            fixtures.add(&thing.still, |v| pose.point(v));
            if moving != Some(i) {
                fixtures.add(&thing.moving, |v| pose.point(v));
            }
        }
        if let Some((table, pose)) = &self.table {
            fixtures.add(&table.still, |v| pose.point(v));
        }
        if let Some((board, pose)) = &self.board {
            fixtures.add(board, |v| pose.point(v));
        }
        fixtures
    }
}

/// The best of some places for what takes up `radius`.
fn free_place(
    taken: &[(Vec3, f32)],
    radius: f32,
    rng: &mut ChaCha8Rng,
    place: impl Fn(&mut ChaCha8Rng) -> Vec3,
) -> Vec3 {
    const TRIES: usize = 24;
    let room =
        |at: Vec3| taken.iter().map(|(other, r)| at.distance(*other) - r - radius).fold(f32::MAX, f32::min);
    let mut best = place(rng);
    for _ in 1..TRIES {
        // Any place with a hand's width around it will do.
        if room(best) >= 0.08 {
            break;
        }
        let at = place(rng);
        if room(at) > room(best) {
            best = at;
        }
    }
    best
}
