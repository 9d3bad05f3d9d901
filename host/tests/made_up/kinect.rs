//! A made-up person before a Kinect, as lines of UTKinect-Action3D: the number of a frame and 20 joints, x to the sensor's left, y up
//! and z away from it.

use std::fmt::Write as _;
use std::ops::RangeInclusive;

/// Frames in which they sit down, and in which they crouch and pick something up from near the floor with the right hand.
pub(crate) const SITS: RangeInclusive<u32> = 0..=60;
pub(crate) const PICKS: RangeInclusive<u32> = 100..=160;

/// From the person to the sensor, m.
const AWAY: f64 = 2.5;

/// All frames, each second one as trackers give them.
pub(crate) fn lines() -> String {
    let mut text = String::new();
    for frame in SITS.step_by(2) {
        let done = eased(f64::from(frame) / 60.0);
        let (hips, back) = (0.9 - 0.4 * done, 0.35 * done);
        line(&mut text, frame, hips, back, [0.22, hips - 0.12, AWAY + back]);
    }
    for frame in PICKS.step_by(2) {
        let time = f64::from(frame - 100) / 60.0;
        let down = eased(1.0 - (2.0 * time - 1.0).abs());
        let hips = 0.9 - 0.45 * down;
        let free = if time < 0.5 { [0.22, hips - 0.12, AWAY] } else { [0.15, hips + 0.2, AWAY - 0.3] };
        let touch = [0.20, 0.35, AWAY - 0.35];
        let hand = std::array::from_fn(|axis| free[axis] + (touch[axis] - free[axis]) * down);
        line(&mut text, frame, hips, 0.0, hand);
    }
    text
}

fn eased(u: f64) -> f64 {
    u * u * (3.0 - 2.0 * u)
}

/// A frame of somebody who looks at the sensor, their hips `hips` over the floor and `back` behind their ankles.
fn line(text: &mut String, frame: u32, hips: f64, back: f64, hand: [f64; 3]) {
    let trunk = AWAY + back;
    let middle = [hips, hips + 0.2, hips + 0.5, hips + 0.7].map(|height| [0.0, height, trunk]);
    // The left hand goes no lower than a knee.
    let left = [hips + 0.45, hips + 0.2, (hips - 0.05).max(0.62), (hips - 0.12).max(0.55)];
    let left = left.map(|height| [-0.22, height, trunk]);
    let shoulder = [0.22, hips + 0.45, trunk];
    let along =
        |share: f64| std::array::from_fn(|axis| shoulder[axis] + (hand[axis] - shoulder[axis]) * share);
    let right = [shoulder, along(0.45), along(0.85), hand];
    let leg = |x: f64| {
        let knee = AWAY - 0.1 * (0.9 - hips);
        [[x, hips - 0.02, trunk], [x, 0.5, knee], [x, 0.1, AWAY], [x, 0.03, AWAY - 0.12]]
    };
    write!(text, "{frame}").unwrap();
    for [x, y, z] in [middle, left, right, leg(-0.1), leg(0.1)].into_iter().flatten() {
        write!(text, " {x:.4} {y:.4} {z:.4}").unwrap();
    }
    text.push('\n');
}
