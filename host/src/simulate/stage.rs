//! A body and at most one thing, as they are at any time: what plans and recordings are made into.
//!
//! Positions are computed once, on an even grid of 10 ms, and interpolated by cubics (Catmull-Rom) between: for motions of
//! people that is exact to some micrometres, and the radios may ask as often as they like.

use std::ops::Range;

use glam::{Quat, Vec3};

use super::body::{Body, Joint, Joints};
use super::shape::{Solid, append};
use super::{Capsule, Performance, Surface};

/// Step of the grid, s.
const STEP_S: f64 = 0.01;

/// Where a thing is: a turn, then a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    /// The shift, m.
    pub(crate) at: Vec3,
    /// The turn.
    pub(crate) turn: Quat,
}

impl Pose {
    /// Where the thing's point `local` is.
    pub(crate) fn point(&self, local: Vec3) -> Vec3 {
        self.at + self.turn * local
    }

    /// `self` after `first`.
    pub(crate) fn after(&self, first: &Self) -> Self {
        Self { at: self.point(first.at), turn: self.turn * first.turn }
    }

    /// From this pose (0) to another (1), for turns that are close.
    pub(crate) fn towards(&self, other: &Self, share: f32) -> Self {
        let same_way = if self.turn.dot(other.turn) < 0.0 { -other.turn } else { other.turn };
        let turn = (self.turn * (1.0 - share) + same_way * share).normalize();
        Self { at: self.at.lerp(other.at, share), turn }
    }
}

/// All that moves, at one time.
pub(crate) struct Instant {
    /// The body's joints.
    pub(crate) joints: Joints,
    /// How far the chest is further forward than at rest, m.
    pub(crate) breath_m: f32,
    /// Where the thing is.
    pub(crate) thing: Option<Pose>,
}

/// What a tag is on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Mount {
    /// Something that stays: where in the room.
    Still(Vec3),
    /// The thing that moves: where on it.
    Thing(Vec3),
}

/// The tag that a hand moves.
#[derive(Debug, Clone)]
pub(crate) struct Moved {
    /// Its number.
    pub(crate) tag: usize,
    /// The hand.
    pub(crate) hand: Joint,
    /// When, s.
    pub(crate) when_s: Range<f64>,
}

/// A body and a thing over time.
#[derive(Debug, Clone)]
pub(crate) struct Stage {
    duration_s: f64,
    body: Body,
    thing: Vec<Vec3>,
    surface: Surface,
    tags: Vec<Mount>,
    moved: Option<Moved>,
    /// From one step before 0 to two after the end.
    joints: Vec<Joints>,
    breath_m: Vec<f32>,
    poses: Vec<Pose>,
}

impl Stage {
    /// Computes the positions of `body` and `thing` by `at`, which is asked from a step before 0 s to two after the end, in
    /// order.
    pub(crate) fn new(
        duration_s: f64,
        body: Body,
        thing: Solid,
        tags: Vec<Mount>,
        moved: Option<Moved>,
        at: impl Fn(f64) -> Instant,
    ) -> Self {
        let mut surface = body.surface().clone();
        append(&mut surface, &thing.surface, body.vertex_count());
        let keys = (duration_s / STEP_S).floor() as usize + 4;
        let mut stage = Self {
            duration_s,
            body,
            thing: thing.vertices,
            surface,
            tags,
            moved,
            joints: Vec::with_capacity(keys),
            breath_m: Vec::with_capacity(keys),
            poses: Vec::new(),
        };
        for key in 0..keys {
            let instant = at((key as f64 - 1.0) * STEP_S);
            stage.joints.push(instant.joints);
            stage.breath_m.push(instant.breath_m);
            if let Some(mut pose) = instant.thing {
                // Neighbours on the same half of the quaternions, so that their components can be interpolated.
                if stage.poses.last().is_some_and(|last| last.turn.dot(pose.turn) < 0.0) {
                    pose.turn = -pose.turn;
                }
                stage.poses.push(pose);
            }
        }
        stage
    }

    /// Number of vertices, the body's first.
    pub(crate) fn vertex_count(&self) -> usize {
        self.body_vertices() + self.thing.len()
    }

    /// Number of the body's vertices.
    pub(crate) fn body_vertices(&self) -> usize {
        self.body.vertex_count()
    }

    /// Where joint `joint` is at `time_s`.
    pub(crate) fn joint(&self, joint: Joint, time_s: f64) -> Vec3 {
        let (first, weights) = self.weights(time_s);
        self.joints[first..].iter().zip(weights).map(|(key, weight)| key[joint.index()] * weight).sum()
    }

    /// Where all joints are at `time_s`.
    pub(crate) fn joints(&self, time_s: f64) -> Joints {
        let (first, weights) = self.weights(time_s);
        let mut joints = [Vec3::ZERO; Joint::COUNT];
        for (key, weight) in self.joints[first..].iter().zip(weights) {
            joints.iter_mut().zip(key).for_each(|(joint, &place)| *joint += place * weight);
        }
        joints
    }

    /// Where the thing is at `time_s`.
    fn pose(&self, time_s: f64) -> Option<Pose> {
        let (first, weights) = self.weights(time_s);
        let keys = self.poses.get(first..)?.iter().zip(weights);
        let (mut at, mut turn) = (Vec3::ZERO, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0));
        for (key, weight) in keys {
            at += key.at * weight;
            turn += key.turn * weight;
        }
        (turn.length_squared() > 0.0).then(|| Pose { at, turn: turn.normalize() })
    }

    /// First of the four keys around `time_s`, and their weights.
    fn weights(&self, time_s: f64) -> (usize, [f32; 4]) {
        let steps = time_s.clamp(0.0, self.duration_s) / STEP_S;
        let first = steps.floor() as usize;
        (first, catmull_rom((steps - first as f64) as f32))
    }
}

/// Weights of four values, one step apart, for the place `u` (0 to 1) between the middle two.
pub(crate) fn catmull_rom(u: f32) -> [f32; 4] {
    let v = 1.0 - u;
    let outer = |near: f32, far: f32| -0.5 * near * far * far;
    let inner = |near: f32| 1.0 + near * near * (1.5 * near - 2.5);
    [outer(u, v), inner(u), inner(v), outer(v, u)]
}

/// What is no more than a [`Stage`] is a [`Performance`].
pub(crate) trait Staged: Send + Sync {
    /// The stage.
    fn stage(&self) -> &Stage;
}

impl Staged for Stage {
    fn stage(&self) -> &Stage {
        self
    }
}

impl<T: Staged> Performance for T {
    fn duration_s(&self) -> f64 {
        self.stage().duration_s
    }

    fn surface(&self) -> &Surface {
        &self.stage().surface
    }

    fn vertices(&self, time_s: f64, vertices: &mut Vec<Vec3>) {
        let stage = self.stage();
        vertices.clear();
        let (first, weights) = stage.weights(time_s);
        let breath_m = stage.breath_m[first..].iter().zip(weights).map(|(key, weight)| key * weight).sum();
        stage.body.vertices(&stage.joints(time_s), breath_m, vertices);
        if let Some(pose) = stage.pose(time_s) {
            vertices.extend(stage.thing.iter().map(|&v| pose.point(v)));
        }
    }

    fn tags(&self) -> usize {
        self.stage().tags.len()
    }

    fn tag(&self, tag: usize, time_s: f64) -> Vec3 {
        let stage = self.stage();
        match stage.tags[tag] {
            Mount::Still(place) => place,
            Mount::Thing(local) => stage.pose(time_s).map_or(local, |pose| pose.point(local)),
        }
    }

    fn proxy(&self, tag: usize, time_s: f64) -> Vec3 {
        match &self.stage().moved {
            Some(Moved { tag: moved, hand, when_s }) if *moved == tag => {
                self.stage().joint(*hand, time_s.clamp(when_s.start, when_s.end))
            }
            _ => self.tag(tag, 0.0),
        }
    }

    fn blockers(&self, time_s: f64, blockers: &mut Vec<Capsule>) {
        let stage = self.stage();
        blockers.clear();
        stage.body.blockers(&stage.joints(time_s), blockers);
    }
}
