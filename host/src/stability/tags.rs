//! Phase differences of tags where they are known to fail. All reads are simulated.
//!
//! Each draw is a tag that rests, is moved away from the antenna by an arm's reach of least jerk, and rests again, while the
//! reader hops. Right is a movement whose phase turns add up to the truth within the tolerance; announced is one of whose
//! frames one says that it is invalid. Whether an announcement was needless is judged by what the unguarded sum gives.

mod reach;

use std::f64::consts::{PI, TAU};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::units::{BridgeTime, PhaseCode};

use self::reach::{CHANNELS, Reach, Reads};
use super::{Case, Measure, Stress, Trial};

/// An error of a movement's phase that is no mistake, rad: a sixth of the least mistake, a turn, and 26 mm. Noise alone
/// makes 0.2 in three of a hundred.
const TOLERANCE: f64 = 1.0;
const SUM: Measure = Measure { label: "error of the movement's phase", unit: "rad", tolerance: TOLERANCE };
const WORST: Measure = Measure { label: "error of the worst frame", unit: "rad", tolerance: TOLERANCE };

/// A case of this module: a name, an axis, and what makes a draw.
struct TagCase {
    name: &'static str,
    about: &'static str,
    stress: Stress,
    measure: Measure,
    draw: fn(f64, &mut ChaCha8Rng) -> Reads,
}

impl Case for TagCase {
    fn name(&self) -> &'static str {
        self.name
    }

    fn about(&self) -> &'static str {
        self.about
    }

    fn stress(&self) -> Stress {
        self.stress
    }

    fn measure(&self) -> Measure {
        self.measure
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let reads = (self.draw)(stress, rng);
        if self.measure == WORST { reads.worst_frame(guard) } else { reads.trial(guard) }
    }
}

/// The cases of this module.
pub fn cases() -> Vec<Box<dyn Case>> {
    let case = |name, about, (label, unit, values), draw| {
        let stress = Stress { label, unit, values };
        Box::new(TagCase { name, about, stress, measure: SUM, draw }) as Box<dyn Case>
    };
    const SPEEDS: &[f64] = &[0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0];
    const LOSSES: &[f64] = &[0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.2];
    const SHARES: &[f64] = &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
    vec![
        case(
            "phase-read-rate",
            "A tag is read too seldom for its speed; the scene's fastest tag limits the time between reads",
            (
                "time between reads",
                "ms",
                &[5.0, 10.0, 14.0, 20.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 150.0, 200.0],
            ),
            |ms, rng| Reach { interval_s: ms * 1e-3, ..Reach::default() }.draw(rng),
        ),
        case(
            "phase-speed",
            "A tag read each 14 ms moves ever faster; acceleration out of the gate latches",
            ("highest speed", "m/s", SPEEDS),
            |speed, rng| Reach { speed, metres: speed.min(0.8), ..Reach::default() }.draw(rng),
        ),
        case(
            "phase-speed-seldom-read",
            "A tag read each 40 ms moves ever faster, past the 2 m/s at which steps alias; acceleration out of the gate latches",
            ("highest speed", "m/s", SPEEDS),
            |speed, rng| {
                Reach { speed, metres: speed.min(0.8), interval_s: 0.04, ..Reach::default() }.draw(rng)
            },
        ),
        case(
            "phase-lost-antenna",
            "One of two antennas loses the tag for a while; a step over the gap must be short enough, or the tag at rest",
            ("time without reads", "s", LOSSES),
            |seconds, rng| {
                let mut reads = Reach { antennas: 2, interval_s: 0.028, ..Reach::default() }.draw(rng);
                let lost = gap(&reads, seconds, rng);
                reads.reads.retain(|(time, read)| read.antenna.0 != 1 || !lost.contains(time));
                reads
            },
        ),
        case(
            "phase-lost-tag",
            "No antenna reads the tag for a while; a step over the gap must be short enough",
            ("time without reads", "s", LOSSES),
            |seconds, rng| {
                let mut reads = Reach::default().draw(rng);
                let lost = gap(&reads, seconds, rng);
                reads.reads.retain(|(time, _)| !lost.contains(time));
                reads
            },
        ),
        case(
            "phase-hop-in-motion",
            "The reader hops during the movement, to channels of which a share was never visited at rest; such hops are no steps",
            ("share of channels without offset", "", SHARES),
            |share, rng| {
                let mut reads = Reach::default().draw(rng);
                let (chosen, begin) = (choose(share, rng), reads.moves.0);
                reads.on_channels(&chosen, |read, time| {
                    // A whole visit before the first frame may teach no more.
                    if time + 500_000 < begin {
                        read.phase = None;
                    }
                });
                reads
            },
        ),
        Box::new(TagCase {
            name: "phase-wrong-hop-table",
            about: "Offsets of a share of the channels change just before the movement; hops out of the gate call them stale",
            stress: Stress { label: "share of channels whose offset changed", unit: "", values: SHARES },
            // Offsets change by any amount, not by turns: what fits the gate is as small as noise, frame by frame.
            measure: WORST,
            draw: |share, rng| {
                let mut reads = Reach::default().draw(rng);
                let (chosen, begin) = (choose(share, rng), reads.moves.0);
                let changes: Vec<f64> = (0..=u8::MAX).map(|_| TAU * rng.random::<f64>()).collect();
                reads.on_channels(&chosen, |read, time| {
                    if time >= begin {
                        turn(read, changes[usize::from(read.channel.0)]);
                    }
                });
                reads
            },
        }),
        case(
            "phase-pi-ambiguity",
            "A share of the phases is half a turn off; they are found by the gate and left out",
            ("share of flipped phases", "", &[0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5]),
            |share, rng| {
                let mut reads = Reach::default().draw(rng);
                for (_, read) in &mut reads.reads {
                    if rng.random_bool(share) {
                        turn(read, PI);
                    }
                }
                reads
            },
        ),
        Box::new(TagCase {
            name: "phase-clock-drift",
            about: "The reader's clock drifts against the bridge's; reads of times that cannot be are left out",
            stress: Stress {
                label: "drift of the reader's clock",
                unit: "ppm",
                values: &[0.0, 10.0, 100.0, 1e3, 3e3, 1e4, 3e4, 1e5, 2e5, 3e5],
            },
            measure: WORST,
            draw: |ppm, rng| {
                let mut reads = Reach::default().draw(rng);
                let drift = if rng.random_bool(0.5) { ppm } else { -ppm } * 1e-6;
                let start = reads.reads.first().map_or(0, |&(time, _)| time);
                shift(&mut reads, |time| (time.saturating_sub(start) as f64 * drift) as i64);
                reads
            },
        }),
        Box::new(TagCase {
            name: "phase-clock-jump",
            about: "The reader's clock jumps during the movement; reads of times that cannot be are left out",
            stress: Stress {
                label: "jump of the reader's clock",
                unit: "s",
                values: &[
                    -10.0, -3.0, -1.0, -0.5, -0.2, -0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0,
                    3.0, 10.0,
                ],
            },
            measure: WORST,
            draw: |seconds, rng| {
                let mut reads = Reach::default().draw(rng);
                let (begin, end) = reads.moves;
                let at = rng.random_range(begin..end);
                shift(&mut reads, |time| if time >= at { (seconds * 1e6) as i64 } else { 0 });
                reads
            },
        }),
        case(
            "phase-noise",
            "Phases become noisier; measured noise past a third of a radian is too noisy",
            ("phase noise", "rad", &[0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0]),
            |noise, rng| Reach { noise, ..Reach::default() }.draw(rng),
        ),
    ]
}

/// A gap of `seconds` around a moment of the movement, us.
fn gap(reads: &Reads, seconds: f64, rng: &mut ChaCha8Rng) -> std::ops::Range<u64> {
    let (begin, end) = reads.moves;
    let (middle, half) = (rng.random_range(begin..end), (seconds * 0.5e6) as u64);
    middle - half..middle + half
}

/// Each channel with a chance of `share`.
fn choose(share: f64, rng: &mut ChaCha8Rng) -> [bool; CHANNELS] {
    [(); CHANNELS].map(|()| rng.random_bool(share))
}

fn turn(read: &mut rfhoi_shared::tag::TagRead, by: f64) {
    read.phase = read.phase.map(|phase| PhaseCode::from_radians(phase.radians() + by as f32));
}

/// Shifts the times that the host is told.
fn shift(reads: &mut Reads, by: impl Fn(u64) -> i64) {
    for (time, read) in &mut reads.reads {
        read.time = BridgeTime(time.saturating_add_signed(by(*time)));
    }
}
