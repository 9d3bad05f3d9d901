//! Recorded people, put at a place: from a [`Motion`], a simulated [`Performance`](super::Performance).
//!
//! Joints of Kinect, of ASF and of common BVH files are found by their names (`joints`), smoothed over time
//! (`smooth`), and scaled to the body. Hips, ankles and hands are then where they were recorded, knees and elbows
//! between (`bends`), and the trunk takes the directions of the recorded bones, all with the body's own lengths: trackers change the
//! lengths of bones from frame to frame, bodies do not.
//!
//! No recording that is read here knows its object. The thing of the label moves with the hand from the moment at which the
//! hand is farthest from where it began (pick up), until then (put down), or always (open, close); table and chair stay
//! where the motion ends or begins. [`Recorded::touch`] finds hand and moment for people who also walk, and [`Among`] puts a
//! recorded person among the tagged things of a generated one.

mod among;
mod bends;
mod joints;
mod smooth;
#[cfg(test)]
mod tests;
mod touch;

use std::ops::RangeInclusive;

use glam::{Quat, Vec3};

pub use self::among::Among;
use self::bends::{Bends, bent};
use super::body::{
    Body, Joint, Joints, Lengths, Side, basis, highest_hip, softly_at_most, stretched, two_bones,
};
use super::grasp::{GRASP_S, Grasp};
use super::perform::in_room;
use super::scene::{Person, Place};
use super::shape::Solid;
use super::stage::{Instant, Mount, Moved, Pose, Stage, Staged};
use super::thing::{SEAT_HEIGHT, Thing};
use crate::hoi::{Action, Category};
use crate::motion::Motion;

/// Longest gap between frames that is filled, s: over a longer one the way between is unknown.
pub const LONGEST_GAP_S: f64 = 0.6;

/// Why a motion cannot be performed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordedError {
    /// A joint that a body needs is not there.
    #[error("the motion has no joint for {joint:?}: looked for {}", tried.join(", "))]
    NoJoint {
        /// The body's joint.
        joint: Joint,
        /// Names that were looked for.
        tried: Vec<String>,
    },
    /// There are no frames with these numbers, or too few.
    #[error("the motion has {found} frames from number {start} to {end}: need {needed}")]
    TooFew {
        /// First number.
        start: u32,
        /// Last number.
        end: u32,
        /// How many there are.
        found: usize,
        /// How many it takes.
        needed: usize,
    },
    /// The frames have a gap.
    #[error("no frames for {gap_s:.1} s after frame {after}: longer than {LONGEST_GAP_S} s")]
    Gap {
        /// Number of the frame before it.
        after: u32,
        /// Its length, s.
        gap_s: f64,
    },
    /// The figure has no size.
    #[error("the figure has no size: its joints lie in one point")]
    NoSize,
}

/// What a recording is made into.
#[derive(Debug, Clone)]
pub struct Recast<'a> {
    /// Who acts: the body takes their height and build.
    pub person: &'a Person,
    /// Where they are at the beginning, and where they look.
    pub place: Place,
    /// Where the radar is, m.
    pub radar: Vec3,
    /// What they do: its object has tag number 0. `None` for nobody's object, without tags.
    pub label: Option<Category>,
    /// The hand that does it.
    pub side: Side,
}

/// A simulated sample after a recording.
#[derive(Debug, Clone)]
pub struct Recorded {
    stage: Stage,
    side: Side,
    contact_s: Option<f64>,
}

impl Recorded {
    /// Performs the frames of `motion` with numbers in `frames`.
    ///
    /// # Errors
    /// Any [`RecordedError`].
    pub fn new(
        motion: &Motion,
        frames: RangeInclusive<u32>,
        recast: &Recast<'_>,
    ) -> Result<Self, RecordedError> {
        Self::with_contact(motion, frames, recast, None)
    }

    /// The same, where the hand that acts takes, leaves or wipes the thing at `contact_s`.
    ///
    /// # Errors
    /// Any [`RecordedError`].
    pub fn touching(
        motion: &Motion,
        frames: RangeInclusive<u32>,
        recast: &Recast<'_>,
        contact_s: f64,
    ) -> Result<Self, RecordedError> {
        Self::with_contact(motion, frames, recast, Some(contact_s))
    }

    fn with_contact(
        motion: &Motion,
        frames: RangeInclusive<u32>,
        recast: &Recast<'_>,
        contact_s: Option<f64>,
    ) -> Result<Self, RecordedError> {
        let found = joints::find(motion)?;
        let track = smooth::Track::new(motion, &found, frames)?;
        let body = Body::new(recast.person.height_m, recast.person.build);
        let scale = body.lengths().leg() / smooth::leg(motion, &found)?;
        let fitted = Fitted::new(&track, *body.lengths(), scale);
        let duration_s = track.duration_s();
        let hand = recast.side.hand().index();
        let attached = |label| Attached::new(label, &fitted, duration_s, recast.side, contact_s);
        let held = recast.label.map(attached);
        let to_room = in_room(&recast.place, recast.radar);
        let (thing, tags) = match &held {
            None => (Solid::default(), Vec::new()),
            Some(Attached::Still(place)) => (Solid::default(), vec![Mount::Still(to_room.point(*place))]),
            Some(Attached::Carried(thing, _)) => (thing.moving.clone(), vec![Mount::Thing(thing.tag)]),
        };
        let moved = match &held {
            Some(Attached::Carried(_, Grasp { taken_s, left_s, .. })) => {
                let when_s = taken_s.max(0.0)..(left_s + GRASP_S).min(duration_s);
                Some(Moved { tag: 0, hand: recast.side.hand(), when_s })
            }
            _ => None,
        };
        let stage = Stage::new(duration_s, body, thing, tags, moved, |time_s| {
            let joints = fitted.at(time_s);
            let thing = match &held {
                Some(Attached::Carried(_, grasp)) => {
                    Some(to_room.after(&grasp.pose(joints[hand], Quat::IDENTITY, time_s)))
                }
                _ => None,
            };
            Instant { joints: joints.map(|joint| to_room.point(joint)), breath_m: 0.0, thing }
        });
        let contact_s = match held {
            Some(Attached::Carried(_, grasp)) => {
                [grasp.taken_s, grasp.left_s].into_iter().find(|t| t.is_finite())
            }
            _ => None,
        };
        Ok(Self { stage, side: recast.side, contact_s })
    }

    /// Where the hand that acts is at `time_s`, m.
    pub fn hand(&self, time_s: f64) -> Vec3 {
        self.stage.joint(self.side.hand(), time_s)
    }

    /// All joints at `time_s`, m.
    pub fn joints(&self, time_s: f64) -> Joints {
        self.stage.joints(time_s)
    }

    /// When the hand is taken to grasp or leave the thing, s; `None` if it does neither.
    pub fn contact_s(&self) -> Option<f64> {
        self.contact_s
    }
}

impl Staged for Recorded {
    fn stage(&self) -> &Stage {
        &self.stage
    }
}

/// A body in the recorded postures, in the axes of the person at the beginning.
struct Fitted<'a> {
    track: &'a smooth::Track,
    lengths: Lengths,
    scale: f32,
    /// From the recording's axes, scaled.
    to_person: Pose,
    bends: Bends,
}

impl<'a> Fitted<'a> {
    fn new(track: &'a smooth::Track, lengths: Lengths, scale: f32) -> Self {
        use Joint::*;
        let first = track.at(0.0);
        let right = first[HipRight.index()] - first[HipLeft.index()];
        // The person looks along y at the beginning, whatever way the recording looks.
        let turn = Quat::from_rotation_z(-libm::atan2f(right.y, right.x));
        let origin = turn * first[HipCentre.index()] * scale;
        // The floor is where the lower ankle usually is.
        let mut lowest: Vec<f32> = times(track.duration_s())
            .map(|time_s| {
                let joints = track.at(time_s);
                scale * joints[AnkleLeft.index()].z.min(joints[AnkleRight.index()].z)
            })
            .collect();
        lowest.sort_by(f32::total_cmp);
        let floor = lowest[lowest.len() / 2] - lengths.ankle;
        let to_person = Pose { at: Vec3::new(-origin.x, -origin.y, -floor), turn };
        let mut fitted = Self { track, lengths, scale, to_person, bends: Bends::default() };
        let mut bends = Bends::default();
        for time_s in Bends::times(track.duration_s()) {
            bends.begin_time();
            fitted.joints(time_s, |limb, wanted, out| bends.follow(limb, wanted, out));
        }
        fitted.bends = bends;
        fitted
    }

    /// Joints at `time_s`.
    fn at(&self, time_s: f64) -> Joints {
        self.joints(time_s, |limb, wanted, out| self.bends.at(limb, time_s, wanted, out))
    }

    /// Joints at `time_s`; `bend` makes the bend of a limb (left and right arm, left and right leg) of the one that is seen and
    /// the direction of the limb.
    fn joints(&self, time_s: f64, mut bend: impl FnMut(usize, Vec3, Vec3) -> Vec3) -> Joints {
        use Joint::*;
        let recorded = self.track.at(time_s);
        let way = |from: Joint, to: Joint, rest: Vec3| {
            let way = recorded[to.index()] - recorded[from.index()];
            self.to_person.turn * way.normalize_or(rest)
        };
        let lengths = &self.lengths;
        let mut joints = [Vec3::ZERO; Joint::COUNT];
        let mut put = |joint: Joint, place: Vec3| {
            joints[joint.index()] = place;
            place
        };
        let place = |joint: Joint| self.to_person.point(recorded[joint.index()] * self.scale);
        let mut centre = place(HipCentre);
        let across = way(HipLeft, HipRight, Vec3::X) * lengths.hip;
        let ankles = Side::BOTH.map(|side| {
            let ankle = place(side.leg()[2]);
            ankle.with_z(ankle.z.max(lengths.ankle))
        });
        for (side, ankle) in Side::BOTH.into_iter().zip(ankles) {
            let up = side.sign() * across.z;
            let highest = highest_hip(centre + side.sign() * across, ankle, lengths.leg()) - up;
            centre.z = softly_at_most(centre.z, highest);
        }
        put(HipCentre, centre);
        let spine = put(Spine, centre + way(HipCentre, Spine, Vec3::Z) * lengths.loins);
        let shoulders = put(ShoulderCentre, spine + way(Spine, ShoulderCentre, Vec3::Z) * lengths.chest);
        put(Head, shoulders + way(ShoulderCentre, Head, Vec3::Z) * lengths.neck);
        // Shoulders square to the spine: trackers let them sag.
        // The hips have a say in where right is: to one who bends to the camera, it may see one shoulder over the other.
        let right = way(ShoulderLeft, ShoulderRight, Vec3::X) + 0.5 * way(HipLeft, HipRight, Vec3::X);
        let chest = basis(right, way(Spine, ShoulderCentre, Vec3::Z));
        for side in Side::BOTH {
            let [shoulder, elbow, wrist, hand] = side.arm();
            let at = put(shoulder, shoulders + chest * (Vec3::X * side.sign() * lengths.shoulder));
            let (lower, to_hand) = (lengths.forearm + lengths.palm, place(hand) - at);
            let out = to_hand.normalize_or(Vec3::NEG_Z);
            let wanted = bent(way(shoulder, elbow, Vec3::NEG_Z), chest * Vec3::NEG_Y, out);
            let bend_arm = bend(side.index(), wanted, out);
            let reach = stretched(to_hand.length(), lengths.arm());
            let (mid, end) = two_bones(at, out, reach, [lengths.upper_arm, lower], bend_arm);
            put(elbow, mid);
            put(wrist, mid + (end - mid) * (lengths.forearm / lower));
            put(hand, end);
            let [hip, knee, ankle, foot] = side.leg();
            let at = put(hip, centre + across * side.sign());
            let leg = ankles[side.index()] - at;
            let down = leg.normalize_or(Vec3::NEG_Z);
            let forward = Vec3::Z.cross(across).normalize_or(Vec3::Y);
            let bend_leg = bend(2 + side.index(), bent(way(hip, knee, Vec3::NEG_Z), forward, down), down);
            let (mid, end) = two_bones(at, down, leg.length(), [lengths.thigh, lengths.shin], bend_leg);
            let at = put(ankle, end);
            put(knee, mid);
            let length = libm::hypotf(lengths.foot, lengths.instep);
            put(foot, at + way(ankle, foot, Vec3::Y) * length);
        }
        joints
    }
}

/// Times at which a motion is looked through, s.
fn times(duration_s: f64) -> impl Iterator<Item = f64> {
    const STEP_S: f64 = 0.05;
    (0..=(duration_s / STEP_S) as u32).map(|i| f64::from(i) * STEP_S)
}

/// The label's object.
enum Attached {
    /// It stays: where its tag is, m.
    Still(Vec3),
    /// It moves with the hand.
    Carried(Box<Thing>, Grasp),
}

impl Attached {
    /// Touched at `contact_s`; without, when the hand is farthest from where it began.
    fn new(
        label: Category,
        fitted: &Fitted<'_>,
        duration_s: f64,
        side: Side,
        contact_s: Option<f64>,
    ) -> Self {
        let hand = |time_s: f64| fitted.at(time_s)[side.hand().index()];
        let away = |t: f64| hand(t).distance(hand(0.0));
        let farthest = || times(duration_s).max_by(|&a, &b| away(a).total_cmp(&away(b)));
        let touched_s = contact_s.or_else(farthest).unwrap_or_default();
        let hips = |time_s: f64| fitted.at(time_s)[Joint::HipCentre.index()].with_z(SEAT_HEIGHT);
        let (taken_s, left_s) = match label.action {
            Action::SitDown => return Self::Still(hips(duration_s)),
            Action::StandUp => return Self::Still(hips(0.0)),
            Action::Wipe => return Self::Still(hand(touched_s)),
            Action::PickUp => (touched_s, f64::INFINITY),
            Action::PutDown => (f64::NEG_INFINITY, touched_s),
            Action::Open | Action::Close => (f64::NEG_INFINITY, f64::INFINITY),
        };
        let mut thing = Thing::new(label.object, Some(label.action), false);
        if thing.hinge.is_some() {
            // A door without its hinge is its tag.
            thing.moving = Solid::default();
        }
        // Where the hand is so low that the thing would be below the floor, it is held higher up.
        let contact = hand(touched_s);
        let at = contact - thing.grip;
        let rest = Pose { at: at.with_z(at.z.max(0.0)), turn: Quat::IDENTITY };
        let grasp = Grasp { rest, grip: contact - rest.at, taken_s, left_s };
        Self::Carried(Box::new(thing), grasp)
    }
}
