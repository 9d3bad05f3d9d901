//! Both radios together: clocks, losses, and extremes of a scene, through [`FrameStream`](crate::align::FrameStream).

mod room;

use rand_chacha::ChaCha8Rng;

use super::{Case, Measure, Stress, Trial};
use room::{Asked, Room};

/// A quarter of the least mistake that aliasing can make: a turn of the phase, 164 mm.
const MOVEMENT: Measure =
    Measure { label: "error of a tag's movement in a frame", unit: "mm", tolerance: 41.0 };

/// The cases of this module.
pub fn cases() -> Vec<Box<dyn Case>> {
    vec![Box::new(Skew), Box::new(FramesLost), Box::new(TagCount), Box::new(Length), Box::new(EmptyRoom)]
}

/// The reader's clock against the bridge's.
struct Skew;

impl Case for Skew {
    fn name(&self) -> &'static str {
        "align-skew"
    }

    fn about(&self) -> &'static str {
        "the stamps of reads are early or late against the radar's; guard: reads are compared with when they came"
    }

    fn stress(&self) -> Stress {
        const VALUES: &[f64] = &[
            -3000.0, -1000.0, -300.0, -200.0, -100.0, -50.0, -20.0, 0.0, 5.0, 20.0, 50.0, 100.0, 300.0,
            1000.0,
        ];
        Stress { label: "stamps of reads late by", unit: "ms", values: VALUES }
    }

    fn measure(&self) -> Measure {
        MOVEMENT
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let mut room = Room::draw(rng);
        room.late_us = (stress * 1e3) as i64;
        room.movement(guard, rng)
    }
}

/// Frames of the radar that never come.
struct FramesLost;

impl Case for FramesLost {
    fn name(&self) -> &'static str {
        "frames-lost"
    }

    fn about(&self) -> &'static str {
        "frames of the radar never come; guard: they have a place in time all the same, marked as missing"
    }

    fn stress(&self) -> Stress {
        const VALUES: &[f64] = &[0.0, 0.01, 0.1, 0.3, 0.5, 0.8, 0.95, 1.0];
        Stress { label: "share of frames lost", unit: "", values: VALUES }
    }

    fn measure(&self) -> Measure {
        MOVEMENT
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let mut room = Room::draw(rng);
        room.frames_lost = stress;
        room.frame(guard, rng)
    }
}

/// How many tags there are.
struct TagCount;

impl Case for TagCount {
    fn name(&self) -> &'static str {
        "tag-count"
    }

    fn about(&self) -> &'static str {
        "more tags share a reader's 70 reads a second, none to more than are held; guard: steps that speed can alias are refused"
    }

    fn stress(&self) -> Stress {
        const VALUES: &[f64] = &[0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0, 30.0, 64.0, 100.0];
        Stress { label: "tags", unit: "", values: VALUES }
    }

    fn measure(&self) -> Measure {
        MOVEMENT
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let mut room = Room::draw(rng);
        room.tags = stress as usize;
        room.movement(guard, rng)
    }
}

/// How long the stream is.
struct Length;

impl Case for Length {
    fn name(&self) -> &'static str {
        "stream-length"
    }

    fn about(&self) -> &'static str {
        "a movement at the end of one frame or of ten minutes; guard: hops between channels not yet learnt are refused"
    }

    fn stress(&self) -> Stress {
        const VALUES: &[f64] = &[1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 600.0, 6000.0];
        Stress { label: "length of the stream", unit: "frames", values: VALUES }
    }

    fn measure(&self) -> Measure {
        MOVEMENT
    }

    fn cost(&self, stress: f64) -> u32 {
        (stress / 100.0).clamp(1.0, 50.0) as u32
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let mut room = Room::draw(rng);
        room.frames = stress as u32;
        room.asked = Asked::Last;
        room.movement(guard, rng)
    }
}

/// Whether anything is there.
struct EmptyRoom;

impl Case for EmptyRoom {
    fn name(&self) -> &'static str {
        "empty-room"
    }

    fn about(&self) -> &'static str {
        "an echo sinks into the noise until the room is empty; guard: a map in which nothing rises is marked and left dark"
    }

    fn stress(&self) -> Stress {
        const VALUES: &[f64] = &[-30.0, -10.0, 0.0, 5.0, 10.0, 12.0, 14.0, 16.0, 20.0, 30.0, 50.0];
        Stress { label: "echo over noise in its cell", unit: "dB", values: VALUES }
    }

    fn measure(&self) -> Measure {
        Measure { label: "error of the strongest echo's range", unit: "bins", tolerance: 2.0 }
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let mut room = Room::draw(rng);
        room.echo_db = stress;
        room.tags = 0;
        room.echo(guard, rng)
    }
}
