//! A recorded person in the place of a generated one: the same room, furniture and tagged things, another motion.
//!
//! In: a motion, and the generated performance of a draw. Out: a [`Performance`] with the generated one's tags, in their order. Things
//! that are carried are taken or left by the recorded hand ([`Recorded::touch`]); all other tags are where the generated performance
//! has them at its beginning. The person rests as long before and after as the generated one does, as still as they began and ended.
//!
//! Where they are follows from what they do: who sits down or stands up does it on the generated person's chair, and who reaches
//! lower than a table, or walks, begins as far back from the table as that takes, if they can stand there. A recorded person does not
//! know of the table: [`Among::past_edge_m`] tells how far they reach into it all the same.

use std::ops::{Range, RangeInclusive};

use glam::{Vec2, Vec3};

use super::{Recast, Recorded, RecordedError, times};
use crate::hoi::Action;
use crate::motion::Motion;
use crate::simulate::body::{Joint, Joints, Side};
use crate::simulate::draw::Draw;
use crate::simulate::perform::{Generated, SHORTEST_S, TABLE_EDGES_M, TABLE_TOPS_M};
use crate::simulate::scene::{Place, Scene};
use crate::simulate::thing::TABLE_WIDTH;
use crate::simulate::{Capsule, Performance, Surface};

/// From the middle of the hips forward to the belly, m.
const BELLY_M: f32 = 0.13;
/// From the middle of a head, a chest or a hand forward to its end, m.
const END_M: f32 = 0.1;
/// What may come under a table when somebody bends.
const BENT: [Joint; 5] =
    [Joint::Spine, Joint::ShoulderCentre, Joint::Head, Joint::HandLeft, Joint::HandRight];
/// Places between where the generated person stands and as far back as is needed that are tried.
const TRIES: u16 = 10;

/// A recorded person among tagged things.
#[derive(Debug, Clone)]
pub struct Among {
    recorded: Recorded,
    side: Side,
    begin_s: f64,
    duration_s: f64,
    /// Number of the tag that the hand moves.
    moved: Option<usize>,
    /// Where the tags are that nobody moves, m, by number.
    still: Vec<Vec3>,
    past_edge_m: f32,
}

impl Among {
    /// Performs the frames of `motion` with numbers in `frames` in place of `generated`, which is the performance of `draw` in
    /// `scene`.
    ///
    /// # Errors
    /// Any [`RecordedError`].
    pub fn new(
        motion: &Motion,
        frames: RangeInclusive<u32>,
        (scene, draw): (&Scene, &Draw),
        generated: &Generated,
    ) -> Result<Self, RecordedError> {
        let radar = scene.radar.position;
        let person = &scene.people[draw.person];
        let stands = Recast { person, place: draw.place(), radar, label: None, side: Side::Right };
        let bare = Recorded::new(motion, frames.clone(), &stands)?;
        let (side, contact_s) = bare.touch();
        let place = match draw.performed.map(|label| label.action) {
            Some(Action::SitDown) => {
                let [from, to] = [bare.joints(bare.duration_s()), generated.joints(generated.duration_s())];
                seated(&stands, &from, &to)
            }
            Some(Action::StandUp) => seated(&stands, &bare.joints(0.0), &generated.joints(0.0)),
            _ => standing_back(&bare, scene, &stands.place),
        };
        let label = draw.performed.filter(|label| label.object.is_carried());
        let recast = Recast { place, label, side, ..stands };
        let recorded = Recorded::touching(motion, frames, &recast, contact_s)?;
        let acts_s = generated.interaction_s();
        let rests_s = (generated.duration_s() - acts_s.end).max(0.0);
        let duration_s = (acts_s.start + recorded.duration_s() + rests_s).max(SHORTEST_S);
        let ahead_m = reach_m(&recorded, &draw.place(), radar);
        Ok(Self {
            side,
            begin_s: acts_s.start,
            duration_s,
            moved: generated.target().filter(|_| label.is_some()),
            still: (0..generated.tags()).map(|tag| generated.tag(tag, 0.0)).collect(),
            past_edge_m: (ahead_m - TABLE_EDGES_M.start).max(0.0),
            recorded,
        })
    }

    /// The hand that acts.
    pub fn side(&self) -> Side {
        self.side
    }

    /// All joints at `time_s`, m.
    pub fn joints(&self, time_s: f64) -> Joints {
        self.recorded.joints(time_s - self.begin_s)
    }

    /// From the first frame of the motion to the last, s; within the sample.
    pub fn interaction_s(&self) -> Range<f64> {
        self.begin_s..self.begin_s + self.recorded.duration_s()
    }

    /// How far past the edge of the nearest table that generated people have before them the person walks or reaches below its top,
    /// m; 0 where they do not.
    pub fn past_edge_m(&self) -> f32 {
        self.past_edge_m
    }
}

impl Performance for Among {
    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn surface(&self) -> &Surface {
        self.recorded.surface()
    }

    fn vertices(&self, time_s: f64, vertices: &mut Vec<Vec3>) {
        self.recorded.vertices(time_s - self.begin_s, vertices);
    }

    fn tags(&self) -> usize {
        self.still.len()
    }

    fn tag(&self, tag: usize, time_s: f64) -> Vec3 {
        match self.moved {
            Some(moved) if moved == tag => self.recorded.tag(0, time_s - self.begin_s),
            _ => self.still[tag],
        }
    }

    fn proxy(&self, tag: usize, time_s: f64) -> Vec3 {
        match self.moved {
            Some(moved) if moved == tag => self.recorded.proxy(0, time_s - self.begin_s),
            _ => self.still[tag],
        }
    }

    fn blockers(&self, time_s: f64, blockers: &mut Vec<Capsule>) {
        self.recorded.blockers(time_s - self.begin_s, blockers);
    }
}

/// The place at `position` from which one looks along `front`, a unit vector.
fn looking(position: Vec2, front: Vec2, radar: Vec3) -> Place {
    let ahead = Place { position, facing_rad: 0.0 }.front(radar);
    Place { position, facing_rad: ahead.angle_to(front) }
}

/// Where one begins, instead of at `stands`, whose hips, which are `from` then, are to be where they are in `to`, and as turned.
fn seated(stands: &Recast<'_>, from: &Joints, to: &Joints) -> Place {
    let Recast { place, radar, .. } = *stands;
    let [(from_at, from_right), (to_at, to_right)] = [from, to].map(|joints| {
        let right = joints[Joint::HipRight.index()] - joints[Joint::HipLeft.index()];
        (joints[Joint::HipCentre.index()].truncate(), right.truncate().normalize_or(Vec2::X))
    });
    // As complex numbers: from one heading to the other.
    let turn = Vec2::new(from_right.dot(to_right), from_right.perp_dot(to_right));
    let position = to_at + turn.rotate(place.position - from_at);
    looking(position, turn.rotate(place.front(radar)), radar)
}

/// Where one begins, instead of at `place`, who must not walk into a table nor reach below its top: as far back as that takes, or as
/// one can stand.
fn standing_back(bare: &Recorded, scene: &Scene, place: &Place) -> Place {
    let radar = scene.radar.position;
    let front = place.front(radar);
    let needed_m = (reach_m(bare, place, radar) - TABLE_EDGES_M.start).max(0.0);
    let back = |step: u16| {
        let back_m = needed_m * f32::from(step) / f32::from(TRIES);
        looking(place.position - front * back_m, front, radar)
    };
    (1..=TRIES).rev().map(back).find(|place| scene.admits(place)).unwrap_or(*place)
}

/// How far before one who stands at `place` the person walks or reaches below the top of a table, m.
fn reach_m(recorded: &Recorded, place: &Place, radar: Vec3) -> f32 {
    let front = place.front(radar);
    let ahead_m = |joint: Vec3, end_m: f32| {
        let way = joint.truncate() - place.position;
        let before = way.perp_dot(front).abs() < 0.5 * TABLE_WIDTH;
        if before { way.dot(front) + end_m } else { f32::NEG_INFINITY }
    };
    let at = |time_s: f64| {
        let joints = recorded.joints(time_s);
        let bent = BENT.map(|joint| joints[joint.index()]).into_iter();
        let low = bent.filter(|joint| joint.z < TABLE_TOPS_M.end).map(|joint| ahead_m(joint, END_M));
        low.fold(ahead_m(joints[Joint::HipCentre.index()], BELLY_M), f32::max)
    };
    times(recorded.duration_s()).map(at).fold(f32::NEG_INFINITY, f32::max)
}
