//! What actions are made of: reaching, holding, letting go, stepping, each with its variation.

use glam::{Quat, Vec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::idle::Idle;
use super::manner::Ranges;
use super::posture::Posture;
use super::script::{Hand, Script};
use super::stroke::{Channel, Law, Timing};
use crate::simulate::body::{Lengths, Side};
use crate::simulate::grasp::GRASP_S;

/// Knees are a little bent: hips are this much lower than with straight legs, as a share of the height.
const EASE: f32 = 0.005;
/// How much longer a lognormal stroke is until it is done, than a minimum-jerk stroke of the same way.
const LATE: f64 = 1.5;

/// Writes a [`Script`] stroke by stroke; `now_s` is where it has come to.
pub(super) struct Planner<'a> {
    pub(super) script: Script,
    pub(super) ranges: &'static Ranges,
    pub(super) rng: &'a mut ChaCha8Rng,
    pub(super) now_s: f64,
    /// When and where a hand first touched what it reached for, without leaving it at once.
    pub(super) contact: Option<(f64, Vec3)>,
    tempo: f32,
}

/// How the trunk helps a hand to get somewhere.
struct Lean {
    flexion: f32,
    twist: f32,
    hips: Vec3,
}

impl<'a> Planner<'a> {
    /// A person at rest, standing, hands hanging, who will act with the hand of `side`.
    pub(super) fn new(
        lengths: Lengths,
        side: Side,
        ranges: &'static Ranges,
        rng: &'a mut ChaCha8Rng,
    ) -> Self {
        let mut draw = |range: &std::ops::Range<f32>| rng.random_range(range.clone());
        let height = lengths.height;
        let ankles = Side::BOTH.map(|side| {
            let x = side.sign() * (lengths.hip + draw(&ranges.stance_m));
            Channel::new(Vec3::new(x, draw(&(-0.03..0.03)) - 0.02, lengths.ankle))
        });
        let feet = Side::BOTH.map(|side| Channel::new(-side.sign() * draw(&ranges.toes_out)));
        let hands = Side::BOTH.map(|side| {
            let down = -draw(&(0.90..0.935)) * lengths.arm();
            let hang = Vec3::new(side.sign() * draw(&(0.01..0.05)), draw(&(0.02..0.09)), down);
            Hand {
                free: Channel::new(hang),
                touch: Channel::new(Vec3::ZERO),
                engaged: Channel::new(0.0),
                bows: [Vec3::ZERO; 2],
                back_s: f64::INFINITY,
                swivel: Channel::new(draw(&ranges.swivel)),
            }
        });
        let script = Script {
            lengths,
            hips: Channel::new(Vec3::new(0.0, 0.0, lengths.hip_height() - EASE * height)),
            yaw: Channel::new(draw(&(-0.05..0.05))),
            flexion: Channel::new(draw(&ranges.stoop)),
            bend: Channel::new(draw(&(-0.02..0.02))),
            twist: Channel::new(draw(&(-0.05..0.05))),
            head: Channel::new(Vec3::new(draw(&(-0.05..0.05)), draw(&(0.0..0.07)), 0.0)),
            ankles,
            feet,
            hands,
            held: None,
            side,
            idle: Idle::new(ranges, rng),
        };
        let tempo = rng.random_range(ranges.tempo.clone());
        Self { script, ranges, rng, now_s: 0.0, contact: None, tempo }
    }

    /// An even draw.
    pub(super) fn draw(&mut self, range: std::ops::Range<f32>) -> f32 {
        self.rng.random_range(range)
    }

    /// Waits for a time of this range, s.
    pub(super) fn wait(&mut self, range: &std::ops::Range<f64>) {
        self.now_s += self.rng.random_range(range.clone());
    }

    /// Waits as long as a grasp takes.
    pub(super) fn dwell(&mut self) {
        let range = self.ranges.dwell_s.clone();
        self.now_s += self.rng.random_range(range).max(GRASP_S);
    }

    /// A stroke from now on that usually takes `usual_s`.
    pub(super) fn timing(&mut self, usual_s: f64) -> Timing {
        let law = self.ranges.law(self.rng);
        let own = f64::from(self.tempo) * self.rng.random_range(0.92..1.08);
        let late = if self.ranges.sigma.is_some() { LATE } else { 1.0 };
        Timing { onset_s: self.now_s, length_s: usual_s * own * late, law }
    }

    /// A stroke over `way_m` of a hand, that takes the longer, the longer the way.
    fn timing_over(&mut self, way_m: f32) -> Timing {
        self.timing(0.45 + 0.75 * f64::from(way_m))
    }

    /// Where a hand is when it is free and all strokes are done.
    pub(super) fn free_hand(&self, side: Side) -> Vec3 {
        let trunk = self.script.goal().trunk(&self.script.lengths);
        trunk.beside(side, self.script.hands[side.index()].free.goal())
    }

    /// A draw of how far a path of this length bows aside: mostly upwards.
    fn bow(&mut self, way_m: f32) -> Vec3 {
        let share = self.ranges.bow.clone();
        let size = way_m * self.draw(share);
        let angle = self.draw(-0.9..0.9);
        Vec3::new(libm::sinf(angle), 0.0, libm::cosf(angle)) * size
    }

    /// How the trunk leans from `base` so that the arm of `side`, stretched no further than a draw, reaches all `points`.
    fn lean(&mut self, base: &Posture, side: Side, points: &[Vec3]) -> Lean {
        const STEP: f32 = 0.01;
        const MOST_FLEXION: f32 = 0.9;
        const MOST_TWIST: f32 = 0.4;
        const MOST: f32 = 2.0;
        let stretch = self.ranges.stretch.clone();
        let reach = self.draw(stretch) * self.script.lengths.arm();
        let twists = side.sign() * self.draw(0.3..0.8);
        let steps = self.draw(0.03..0.1);
        let middle: Vec3 = points.iter().sum::<Vec3>() / points.len() as f32;
        let ahead = (middle - base.hips).with_z(0.0).normalize_or_zero();
        let mut more = 0.0;
        loop {
            // From the trunk at first; the hips follow slowly, and fast when the trunk can do no more.
            let flexion = (base.flexion + more).min(MOST_FLEXION);
            let shift = steps * more + (base.flexion + more - flexion) * 0.5;
            let hips = base.hips + ahead * shift.min(0.3);
            // The shoulder goes ahead; but what is on the other side may be nearer with the shoulder back.
            for twists in [twists, -twists] {
                let twist = base.twist + (twists * more).clamp(-MOST_TWIST, MOST_TWIST);
                let trunk = Posture { flexion, twist, hips, ..*base }.trunk(&self.script.lengths);
                let near = points.iter().all(|p| p.distance(trunk.shoulder(side)) <= reach);
                if near || more > MOST {
                    return Lean { flexion, twist, hips };
                }
            }
            more += STEP;
        }
    }

    /// The trunk leans from `base` so that the hand, which stays in contact, gets to `point`.
    pub(super) fn follow(&mut self, base: &Posture, side: Side, point: Vec3, timing: Timing) {
        let lean = self.lean(base, side, &[point]);
        self.lean_to(&lean, timing);
    }

    fn lean_to(&mut self, lean: &Lean, timing: Timing) {
        // Trunks begin a little before hands, and end before them.
        let trunk = timing.part(-0.05, 0.95);
        self.script.flexion.go_to(lean.flexion, trunk);
        self.script.twist.go_to(lean.twist, trunk);
        self.script.hips.go_to(lean.hips, trunk);
    }

    /// Looks at `point`.
    pub(super) fn look_at(&mut self, point: Vec3, timing: Timing) {
        let trunk = self.script.goal().trunk(&self.script.lengths);
        let way = trunk.to_chest(point - trunk.head()).normalize_or(Vec3::Y);
        let tilt = Vec3::new(way.x, way.y, 0.0) * (0.6 * (-way.z).clamp(0.0, 1.0));
        self.script.head.go_to(tilt, timing.part(-0.1, 0.6));
    }

    /// The hand of `side` goes to `points[0]`, the trunk leaning so that it reaches all `points` without moving more; on the
    /// way the person may hesitate. Time goes on to the arrival.
    pub(super) fn reach(&mut self, side: Side, points: &[Vec3]) {
        let way_m = self.free_hand(side).distance(points[0]);
        let lean = self.lean(&self.script.goal(), side, points);
        let mut timing = self.timing_over(way_m);
        let bows = [self.bow(way_m), self.bow(way_m)];
        let swivel = self.ranges.swivel.clone();
        let swivel = self.draw(swivel);
        self.lean_to(&lean, timing);
        self.look_at(points[0], timing);
        let corrected = if self.ranges.sigma.is_some() { self.draw(0.03..0.12) } else { 0.0 };
        let hesitates = self.rng.random_bool(self.ranges.hesitation);
        let hand = &mut self.script.hands[side.index()];
        hand.bows = bows;
        hand.touch = Channel::new(points[0]);
        hand.swivel.go_to(swivel, timing);
        if hesitates {
            // Two strokes with a pause between.
            let share = self.rng.random_range(0.4..0.75);
            let pause_s = self.rng.random_range(self.ranges.pause_s.clone());
            let first = timing.part(0.0, 0.75);
            hand.engaged.go_to(share, first);
            timing.onset_s = first.end_s() + pause_s;
            timing.length_s *= 0.7;
        }
        if corrected > 0.0 {
            // A stroke that falls short, and a small one that corrects it.
            hand.engaged.go_to(1.0 - corrected, timing);
            timing = timing.part(0.55, 1.15);
        }
        hand.engaged.go_to(1.0, timing);
        self.now_s = timing.end_s();
    }

    /// The hand of `side` goes to where it is free, `offset` from the shoulder, and the trunk back to `posture`. Time goes on
    /// to the arrival.
    pub(super) fn retract(&mut self, side: Side, offset: Vec3, posture: &Posture) {
        let hand = &mut self.script.hands[side.index()];
        hand.back_s = self.now_s;
        // Nobody sees where a hand would be if it were free, while it touches.
        let unseen =
            Timing { onset_s: self.now_s - GRASP_S, length_s: GRASP_S, law: Law::MinimumJerk { skew: 1.0 } };
        hand.free.go_to(offset, unseen);
        let touched = hand.touch.goal();
        let lean = Lean { flexion: posture.flexion, twist: posture.twist, hips: posture.hips };
        let now = self.script.goal();
        let back = Posture { flexion: lean.flexion, twist: lean.twist, hips: lean.hips, ..now };
        let way_m = back.trunk(&self.script.lengths).beside(side, offset).distance(touched);
        let timing = self.timing_over(way_m);
        self.lean_to(&lean, timing);
        self.script.head.go_to(posture.head, timing.part(0.2, 1.1));
        self.script.hands[side.index()].engaged.go_to(0.0, timing);
        self.now_s = timing.end_s();
    }

    /// A free hand moves to `offset` from the shoulder, before the body: past the shoulder the arm would fold up. Returns when.
    pub(super) fn move_free(&mut self, side: Side, offset: Vec3) -> Timing {
        let way_m = self.script.hands[side.index()].free.goal().distance(offset);
        let timing = self.timing_over(way_m);
        let bow = Vec3::new(self.draw(-0.1..0.1), self.draw(0.2..0.35), 0.0) * way_m;
        let free = &mut self.script.hands[side.index()].free;
        free.go_by(offset - free.goal(), bow, timing);
        timing
    }

    /// A hand swings with the body by some centimetres while that moves. It ends where it was.
    pub(super) fn swing(&mut self, side: Side, timing: Timing) {
        let way = Vec3::Y * self.draw(-0.08..0.08);
        self.script.hands[side.index()].free.go_by(Vec3::ZERO, way, timing);
    }

    /// One step with each foot: hips and feet move by `shift` and turn to the left by `turn` rad. Time goes on to the end.
    pub(super) fn step(&mut self, shift: Vec3, turn: f32) {
        let centre = self.script.hips.goal().with_z(0.0);
        let first = if shift.x > 0.0 || (shift.x == 0.0 && turn < 0.0) { Side::Right } else { Side::Left };
        let whole = self.timing(1.6);
        for (side, part) in [(first, whole.part(0.0, 0.5)), (first.other(), whole.part(0.45, 0.95))] {
            let lift = Vec3::Z * self.draw(0.05..0.1);
            let ankle = &mut self.script.ankles[side.index()];
            let from = ankle.goal();
            let to = centre + Quat::from_rotation_z(turn) * (from - centre) + shift;
            ankle.go_by(to - from, lift, part);
            let feet = &mut self.script.feet[side.index()];
            feet.go_to(feet.goal() + turn, part);
        }
        let goal = self.script.hips.goal() + shift;
        self.script.hips.go_to(goal, whole.part(0.05, 1.0));
        self.script.yaw.go_to(self.script.yaw.goal() + turn, whole.part(0.0, 0.9));
        self.swing(Side::Left, whole);
        self.swing(Side::Right, whole);
        self.now_s = whole.end_s();
    }
}
