//! A script: all that a body does in a sample, as values over time. It yields joints and the thing's pose at any time.

use std::ops::Range;

use glam::{Quat, Vec3};

use super::idle::Idle;
use super::posture::Posture;
use super::stroke::{Channel, bow};
use crate::simulate::body::{Lengths, Side};
use crate::simulate::grasp::{GRASP_S, Grasp};
use crate::simulate::stage::{Instant, Pose};
use crate::simulate::thing::Hinge;

/// What a hand does: it goes from where it is free to where it touches, and back.
#[derive(Debug, Clone)]
pub(super) struct Hand {
    /// Where it is when free: from the shoulder, along the chest's heading and the vertical, m.
    pub(super) free: Channel<Vec3>,
    /// What it touches, m.
    pub(super) touch: Channel<Vec3>,
    /// Whether it is free, 0, or touches, 1.
    pub(super) engaged: Channel<f32>,
    /// How far it bows from the straight way to the touch, and back from it, m.
    pub(super) bows: [Vec3; 2],
    /// When the way back begins at the earliest, s.
    pub(super) back_s: f64,
    /// Turn of the elbow outwards, rad.
    pub(super) swivel: Channel<f32>,
}

/// How the thing moves.
#[derive(Debug, Clone)]
pub(super) enum Moves {
    /// In the hand, turned there by an axis times an angle.
    Carried { grasp: Grasp, tilt: Channel<Vec3> },
    /// About a hinge, by an angle; the hand follows its grip.
    Hinged { hinge: Hinge, grip: Vec3, angle: Channel<f32> },
}

/// The thing: where it is when it lies or is closed, and how it moves.
#[derive(Debug, Clone)]
pub(super) struct Held {
    pub(super) rest: Pose,
    pub(super) moves: Moves,
}

/// The script.
#[derive(Debug, Clone)]
pub(super) struct Script {
    pub(super) lengths: Lengths,
    pub(super) hips: Channel<Vec3>,
    pub(super) yaw: Channel<f32>,
    pub(super) flexion: Channel<f32>,
    pub(super) bend: Channel<f32>,
    pub(super) twist: Channel<f32>,
    pub(super) head: Channel<Vec3>,
    pub(super) ankles: [Channel<Vec3>; 2],
    pub(super) feet: [Channel<f32>; 2],
    pub(super) hands: [Hand; 2],
    pub(super) held: Option<Held>,
    /// The hand that acts.
    pub(super) side: Side,
    pub(super) idle: Idle,
}

impl Script {
    /// The posture that all strokes so far lead to, without sway.
    pub(super) fn goal(&self) -> Posture {
        Posture {
            hips: self.hips.goal(),
            yaw: self.yaw.goal(),
            flexion: self.flexion.goal(),
            bend: self.bend.goal(),
            twist: self.twist.goal(),
            head: self.head.goal(),
            ankles: [0, 1].map(|i| self.ankles[i].goal()),
            feet: [0, 1].map(|i| self.feet[i].goal()),
        }
    }

    fn posture(&self, time_s: f64) -> Posture {
        Posture {
            hips: self.hips.at(time_s) + self.idle.hips(time_s),
            yaw: self.yaw.at(time_s),
            flexion: self.flexion.at(time_s) + self.idle.flexion(time_s),
            bend: self.bend.at(time_s),
            twist: self.twist.at(time_s),
            head: self.head.at(time_s),
            ankles: [0, 1].map(|i| self.ankles[i].at(time_s)),
            feet: [0, 1].map(|i| self.feet[i].at(time_s)),
        }
    }

    /// When the hand that acts holds the thing, s, if it does: it carries it, or touches it from `contact_s` on until it goes
    /// back.
    pub(super) fn holds_s(&self, contact_s: Option<f64>) -> Option<Range<f64>> {
        match &self.held.as_ref()?.moves {
            Moves::Carried { grasp, .. } => Some(grasp.taken_s..grasp.left_s + GRASP_S),
            Moves::Hinged { .. } => Some(contact_s?..self.hands[self.side.index()].back_s),
        }
    }

    /// All at `time_s`, in the person's axes.
    pub(super) fn at(&self, time_s: f64) -> Instant {
        let posture = self.posture(time_s);
        let mut trunk = posture.trunk(&self.lengths);
        for side in Side::BOTH {
            let i = side.index();
            let hand = &self.hands[i];
            let free = trunk.beside(side, hand.free.at(time_s) + self.idle.hand(i, time_s));
            let touch = match &self.held {
                Some(Held { rest, moves: Moves::Hinged { hinge, grip, angle } }) if side == self.side => {
                    rest.point(hinge.pose(angle.at(time_s)).point(*grip))
                }
                _ => hand.touch.at(time_s),
            };
            let share = hand.engaged.at(time_s);
            let aside = hand.bows[usize::from(time_s >= hand.back_s)] * bow(share);
            trunk.arm(&self.lengths, side, free.lerp(touch, share) + aside, hand.swivel.at(time_s));
            trunk.leg(&self.lengths, side, posture.ankles[i], posture.feet[i]);
        }
        let joints = trunk.into_joints();
        let thing = self.held.as_ref().map(|held| held.at(joints[self.side.hand().index()], time_s));
        Instant { joints, breath_m: self.idle.breath_m(time_s), thing }
    }
}

impl Held {
    /// When the thing moves, s.
    pub(super) fn moved_s(&self) -> Range<f64> {
        match &self.moves {
            Moves::Hinged { angle, .. } => angle.moves_s(),
            Moves::Carried { grasp, .. } => grasp.taken_s..grasp.left_s + GRASP_S,
        }
    }

    /// Where the thing is when the hand is at `hand`.
    fn at(&self, hand: Vec3, time_s: f64) -> Pose {
        match &self.moves {
            Moves::Hinged { hinge, angle, .. } => self.rest.after(&hinge.pose(angle.at(time_s))),
            Moves::Carried { grasp, tilt } => {
                grasp.pose(hand, Quat::from_scaled_axis(tilt.at(time_s)), time_s)
            }
        }
    }
}
