//! The seven actions, and what people do that is none of them.

use glam::Vec3;
use rand::RngExt;

use super::planner::Planner;
use super::script::{Held, Moves};
use super::stroke::{Channel, Timing};
use super::workplace::SEATED_BACK;
use crate::hoi::Action;
use crate::simulate::body::Side;
use crate::simulate::grasp::{GRASP_S, Grasp};
use crate::simulate::stage::Pose;
use crate::simulate::thing::{Hinge, SEAT_HEIGHT, Thing};

/// Hip joints of a sitter above the seat, as a share of the height: half a thigh.
const SEATED_HIPS: f32 = 0.054;
/// A wiping hand's grip above the table, m.
const WIPING: f32 = 0.025;

impl Planner<'_> {
    /// Does `action` with the thing that lies at `pose`. Time goes on to its end.
    pub(super) fn act(&mut self, action: Action, thing: &Thing, pose: Pose, surface: Vec3) {
        match (action, thing.hinge) {
            (Action::PickUp, _) => self.pick_up(thing, pose),
            (Action::PutDown, _) => self.put_down(thing, pose),
            (Action::Open | Action::Close, Some(hinge)) => self.swing_open(action, thing, hinge, pose),
            (Action::Open | Action::Close, None) => {}
            (Action::Wipe, _) => self.wipe(surface),
            (Action::SitDown, _) => {
                let seated = self.seated();
                self.sit(&seated);
            }
            (Action::StandUp, _) => {
                let standing = self.standing();
                let seated = self.seated();
                self.start_as(&seated);
                self.rise(&standing);
            }
        }
    }

    fn side(&self) -> Side {
        self.script.side
    }

    /// Reaches for something to stay in contact with it.
    fn touch(&mut self, side: Side, points: &[Vec3]) {
        self.reach(side, points);
        self.contact = Some((self.now_s, points[0]));
    }

    /// Where a thing is held: before the chest, from the shoulder.
    fn hold(&mut self) -> Vec3 {
        let arm = self.script.lengths.arm();
        let inwards = -self.side().sign() * self.draw(0.0..0.2);
        Vec3::new(inwards, self.draw(0.38..0.6), self.draw(-0.55..-0.1)) * arm
    }

    /// How a thing is turned in the hand when it is held.
    fn held_tilt(&mut self) -> Vec3 {
        Vec3::new(self.draw(-0.1..0.7), self.draw(-0.25..0.25), self.draw(-0.4..0.4))
    }

    fn pick_up(&mut self, thing: &Thing, pose: Pose) {
        let (side, posture) = (self.side(), self.script.goal());
        self.touch(side, &[pose.point(thing.grip)]);
        let taken_s = self.now_s;
        self.dwell();
        let (hold, turn) = (self.hold(), self.held_tilt());
        let begin_s = self.now_s;
        self.retract(side, hold, &posture);
        let mut tilt = Channel::new(Vec3::ZERO);
        let length_s = self.now_s - begin_s;
        tilt.go_to(
            turn,
            Timing {
                onset_s: begin_s + 0.2 * length_s,
                length_s: 0.8 * length_s,
                law: self.ranges.law(self.rng),
            },
        );
        let grasp = Grasp { rest: pose, grip: thing.grip, taken_s, left_s: f64::INFINITY };
        let moves = Moves::Carried { grasp, tilt };
        self.script.held = Some(Held { rest: pose, moves });
    }

    fn put_down(&mut self, thing: &Thing, pose: Pose) {
        let (side, posture) = (self.side(), self.script.goal());
        let (hold, turn) = (self.hold(), self.held_tilt());
        let hang = self.script.hands[side.index()].free.goal();
        self.script.hands[side.index()].free = Channel::new(hold);
        let begin_s = self.now_s;
        self.touch(side, &[pose.point(thing.grip)]);
        let mut tilt = Channel::new(turn);
        let length_s = 0.8 * (self.now_s - begin_s);
        tilt.go_to(Vec3::ZERO, Timing { onset_s: begin_s, length_s, law: self.ranges.law(self.rng) });
        let left_s = self.now_s;
        self.dwell();
        self.retract(side, hang, &posture);
        let grasp = Grasp { rest: pose, grip: thing.grip, taken_s: f64::NEG_INFINITY, left_s };
        let moves = Moves::Carried { grasp, tilt };
        self.script.held = Some(Held { rest: pose, moves });
    }

    fn swing_open(&mut self, action: Action, thing: &Thing, hinge: Hinge, pose: Pose) {
        let (side, posture) = (self.side(), self.script.goal());
        let hang = self.script.hands[side.index()].free.goal();
        let open = self.draw(hinge.open[0]..hinge.open[1]);
        let (from, to) = if action == Action::Open { (0.0, open) } else { (open, 0.0) };
        let grip_at = |angle: f32| pose.point(hinge.pose(angle).point(thing.grip));
        const STOPS: u8 = 6;
        let stops: Vec<Vec3> =
            (0..=STOPS).map(|i| grip_at(from + (to - from) * f32::from(i) / f32::from(STOPS))).collect();
        self.touch(side, &stops[..1]);
        self.dwell();
        let mut angle = Channel::new(from);
        let way_m: f32 = stops.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        let mut timing = self.timing(0.5 + 0.75 * f64::from(way_m));
        if self.rng.random_bool(self.ranges.hesitation) {
            // First loose, then all the way.
            let ajar = from + (to - from) * self.draw(0.15..0.6);
            let loosened = timing.part(0.0, 0.6);
            angle.go_to(ajar, loosened);
            self.follow(&posture, side, grip_at(ajar), loosened);
            let pause_s = self.rng.random_range(self.ranges.pause_s.clone());
            timing = Timing { onset_s: loosened.end_s() + pause_s, ..timing.part(0.0, 0.8) };
        }
        angle.go_to(to, timing);
        self.follow(&posture, side, grip_at(to), timing);
        self.script.held = Some(Held { rest: pose, moves: Moves::Hinged { hinge, grip: thing.grip, angle } });
        self.now_s = timing.end_s();
        self.script.hands[side.index()].touch = Channel::new(grip_at(to));
        self.dwell();
        self.retract(side, hang, &posture);
    }

    fn wipe(&mut self, surface: Vec3) {
        let (side, posture) = (self.side(), self.script.goal());
        let hang = self.script.hands[side.index()].free.goal();
        let aside = side.sign() * self.draw(0.0..0.25);
        let middle = surface + Vec3::new(aside, self.draw(-0.15..0.0), WIPING);
        let angle = self.draw(-0.5..0.5);
        let half = Vec3::new(libm::cosf(angle), libm::sinf(angle), 0.0) * self.draw(0.10..0.19) * side.sign();
        let drift = Vec3::Y * self.draw(-0.12..0.12);
        let strokes = self.rng.random_range(4..=6_u8);
        let corners = [middle + half, middle - half, middle + half + drift, middle - half + drift];
        self.touch(side, &corners);
        let mut touch = Channel::new(corners[0]);
        // Nine tenths of a stroke are done after this share of its time.
        let done_at = if self.ranges.sigma.is_some() { 0.65 } else { 0.75 };
        let usual_s = f64::from(self.draw(0.38..0.52));
        for stroke in 0..strokes {
            let timing = self.timing(usual_s);
            let done = drift * (f32::from(stroke + 1) / f32::from(strokes));
            let end = if stroke % 2 == 0 { -half } else { half };
            // The hand turns without a stop: the next stroke begins before this one ends.
            touch.go_by(middle + end + done - touch.goal(), Vec3::ZERO, timing);
            self.now_s = timing.part(0.0, done_at).end_s();
        }
        self.script.hands[side.index()].touch = touch;
        self.dwell();
        self.retract(side, hang, &posture);
    }

    fn standing(&self) -> Rest {
        let goal = self.script.goal();
        Rest {
            hips: goal.hips,
            flexion: goal.flexion,
            hands: [0, 1].map(|i| self.script.hands[i].free.goal()),
        }
    }

    fn seated(&mut self) -> Rest {
        let height = self.script.lengths.height;
        let back = SEATED_BACK * height + self.draw(-0.03..0.03);
        let hips = Vec3::new(0.0, -back, SEAT_HEIGHT + SEATED_HIPS * height);
        let hands = Side::BOTH.map(|side| {
            // On the thighs.
            let inwards = -side.sign() * self.draw(0.01..0.03);
            Vec3::new(inwards, self.draw(0.14..0.19), -self.draw(0.21..0.225)) * height
        });
        Rest { hips, flexion: self.draw(0.0..0.12), hands }
    }

    fn start_as(&mut self, rest: &Rest) {
        self.script.hips = Channel::new(rest.hips);
        self.script.flexion = Channel::new(rest.flexion);
        for (hand, &free) in self.script.hands.iter_mut().zip(&rest.hands) {
            hand.free = Channel::new(free);
        }
    }

    fn sit(&mut self, seated: &Rest) {
        let timing = self.timing(1.7);
        let lean = self.draw(0.45..0.8);
        let onset = f64::from(self.draw(0.05..0.15));
        // The trunk goes forward while the hips go back and down, and upright again on the seat.
        self.script.flexion.go_to(lean, timing.part(0.0, 0.55));
        self.script.flexion.go_to(seated.flexion, timing.part(0.5, 1.05));
        let goal = self.script.hips.goal();
        self.script.hips.go_to(goal.with_y(seated.hips.y), timing.part(onset, 0.8));
        self.script.hips.go_to(seated.hips, timing.part(onset + 0.05, 0.95));
        for (hand, &free) in self.script.hands.iter_mut().zip(&seated.hands) {
            hand.free.go_to(free, timing.part(0.3, 1.05));
        }
        self.now_s = timing.part(0.0, 1.05).end_s();
    }

    fn rise(&mut self, standing: &Rest) {
        let timing = self.timing(1.55);
        let lean = self.draw(0.5..0.85);
        self.script.flexion.go_to(lean, timing.part(0.0, 0.5));
        self.script.flexion.go_to(standing.flexion, timing.part(0.42, 1.0));
        let goal = self.script.hips.goal();
        self.script.hips.go_to(goal.with_y(standing.hips.y), timing.part(0.2, 0.85));
        self.script.hips.go_to(standing.hips, timing.part(0.25, 1.0));
        for (hand, &free) in self.script.hands.iter_mut().zip(&standing.hands) {
            hand.free.go_to(free, timing.part(0.25, 0.95));
        }
        self.now_s = timing.end_s();
    }

    /// Something that is none of the seven actions. Time goes on to its end.
    pub(super) fn pass_time(&mut self, surface: Vec3) {
        match self.rng.random_range(0..6_u8) {
            0 => self.now_s += self.rng.random_range(1.0..2.5),
            1 => self.shift_weight(),
            2 => self.gesture(),
            3 => {
                // A step aside or back, and mostly back again.
                let shift = Vec3::new(self.draw(-0.3..0.3), self.draw(-0.25..0.02), 0.0);
                self.step(shift, 0.0);
                let pause_s = self.ranges.pause_s.clone();
                self.wait(&pause_s);
                if self.rng.random_bool(0.7) {
                    self.step(-shift, 0.0);
                }
            }
            4 => {
                let turn = self.draw(0.4..1.2) * if self.rng.random_bool(0.5) { -1.0 } else { 1.0 };
                self.step(Vec3::ZERO, turn);
            }
            _ => self.nearly_touch(surface),
        }
    }

    fn shift_weight(&mut self) {
        let aside = Vec3::X * self.draw(0.03..0.07) * if self.rng.random_bool(0.5) { -1.0 } else { 1.0 };
        for way in [aside, -aside] {
            let timing = self.timing(0.9);
            let hips = self.script.hips.goal() + way;
            self.script.hips.go_to(hips, timing);
            let bend = self.script.bend.goal() + 0.6 * way.x;
            self.script.bend.go_to(bend, timing);
            self.now_s = timing.end_s();
            let pause_s = self.ranges.pause_s.clone();
            self.wait(&pause_s);
        }
    }

    /// Raises a hand to the head, to the chest or to greet, and lowers it again.
    fn gesture(&mut self) {
        let (side, arm) = (self.side(), self.script.lengths.arm());
        let hang = self.script.hands[side.index()].free.goal();
        let inwards = -side.sign();
        let raised = match self.rng.random_range(0..3_u8) {
            // Near the ear.
            0 => Vec3::new(0.14 * inwards, self.draw(0.12..0.22), self.draw(0.28..0.40)),
            1 => Vec3::new(0.25 * inwards, self.draw(0.25..0.4), self.draw(-0.35..-0.1)),
            _ => Vec3::new(-0.2 * inwards, self.draw(0.3..0.5), self.draw(0.2..0.55)),
        } * arm;
        let timing = self.move_free(side, raised);
        self.now_s = timing.end_s();
        for _ in 0..self.rng.random_range(0..4_u8) {
            // Scratches or waves.
            let way = Vec3::new(self.draw(-0.08..0.08), 0.0, self.draw(-0.05..0.05));
            let timing = self.timing(0.5);
            self.script.hands[side.index()].free.go_by(Vec3::ZERO, way, timing);
            self.now_s = timing.end_s();
        }
        let pause_s = self.ranges.pause_s.clone();
        self.wait(&pause_s);
        let timing = self.move_free(side, hang);
        self.now_s = timing.end_s();
    }

    /// Reaches out over the table and takes the hand back without touching anything.
    fn nearly_touch(&mut self, surface: Vec3) {
        let (side, posture) = (self.side(), self.script.goal());
        let hang = self.script.hands[side.index()].free.goal();
        let above =
            Vec3::new(side.sign() * self.draw(0.0..0.3), self.draw(-0.15..0.1), self.draw(0.15..0.35));
        self.reach(side, &[surface + above]);
        let pause_s = self.ranges.pause_s.clone();
        self.wait(&pause_s);
        self.now_s += GRASP_S;
        self.retract(side, hang, &posture);
    }
}

/// Standing or sitting.
struct Rest {
    hips: Vec3,
    flexion: f32,
    /// As [`super::script::Hand::free`].
    hands: [Vec3; 2],
}
