//! What is done to samples before they are learnt from: what rooms, readers and people do that a simulation of few of them has
//! not shown.

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::sample::{Frames, MAPS, READ_CHANNELS, SCALARS, Sample, scalar};

/// How much is done.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Augment {
    /// Frames that may be missing at each end, at most.
    pub crop: usize,
    /// Chance that an antenna of the reader is dead.
    pub antenna: f64,
    /// Chance that a map is lost, in all frames.
    pub map: f64,
    /// Chance that a frame is lost.
    pub frame: f64,
    /// Rows of range by which the maps may be shifted, at most, as if the person stood elsewhere.
    pub shift: usize,
    /// Chance that all is mirrored left to right.
    pub mirror: f64,
    /// Codes of noise in maps, at most.
    pub noise: u8,
    /// Chance that the target's name is that of another thing that is handled the same way.
    pub rename: f64,
}

impl Default for Augment {
    fn default() -> Self {
        Self { crop: 4, antenna: 0.1, map: 0.05, frame: 0.02, shift: 2, mirror: 0.5, noise: 6, rename: 0.3 }
    }
}

impl Augment {
    /// Nothing.
    pub const NONE: Self =
        Self { crop: 0, antenna: 0.0, map: 0.0, frame: 0.0, shift: 0, mirror: 0.0, noise: 0, rename: 0.0 };

    /// A changed copy; `interchangeable` are objects and the actions for which one may stand for another.
    pub(super) fn apply(
        &self,
        sample: &Sample,
        interchangeable: (&[usize], &[usize]),
        rng: &mut ChaCha8Rng,
    ) -> Sample {
        let frames = &sample.frames;
        let kept = self.crop(frames.len(), rng);
        let mut changed = Sample { frames: frames.part(kept), ..sample.clone() };
        let points = frames.points;
        let most = self.shift as i64;
        let shift = rng.random_range(-most..=most) as isize;
        let mirror = rng.random_bool(self.mirror);
        self.maps(&mut changed.frames.maps, points, shift, mirror, rng);
        self.losses(&mut changed.frames, rng);
        self.rename(&mut changed, interchangeable, rng);
        changed
    }

    fn crop(&self, frames: usize, rng: &mut ChaCha8Rng) -> Range<usize> {
        let most = self.crop.min(frames / 4);
        rng.random_range(0..=most)..frames - rng.random_range(0..=most)
    }

    fn maps(&self, maps: &mut [u8], points: usize, shift: isize, mirror: bool, rng: &mut ChaCha8Rng) {
        let size = points * points;
        let mut row = vec![0u8; size];
        for (number, map) in maps.chunks_exact_mut(size).enumerate() {
            let angle = number % MAPS == MAPS - 1;
            if angle && mirror {
                map.chunks_exact_mut(points).for_each(<[u8]>::reverse);
            }
            if !angle && shift != 0 {
                row.copy_from_slice(map);
                for (to, out) in map.chunks_exact_mut(points).enumerate() {
                    match to.checked_add_signed(-shift).filter(|&from| from < points) {
                        Some(from) => out.copy_from_slice(&row[from * points..(from + 1) * points]),
                        None => out.fill(0),
                    }
                }
            }
            if self.noise > 0 {
                // Four codes of noise of one draw: what counts is that they differ.
                for four in map.chunks_mut(4) {
                    let draw: u32 = rng.random();
                    for (code, byte) in four.iter_mut().zip(draw.to_le_bytes()) {
                        let noise = i16::from(byte) * i16::from(self.noise) / 128 - i16::from(self.noise);
                        // A map that was lost stays so.
                        if *code > 0 {
                            *code = (i16::from(*code) + noise).clamp(1, 255) as u8;
                        }
                    }
                }
            }
        }
    }

    fn losses(&self, frames: &mut Frames, rng: &mut ChaCha8Rng) {
        let size = frames.points * frames.points;
        let lost: [bool; MAPS] = std::array::from_fn(|_| rng.random_bool(self.map));
        let dead: Vec<bool> = (0..frames.antennas).map(|_| rng.random_bool(self.antenna)).collect();
        // One antenna is left.
        let dead = if dead.iter().all(|&dead| dead) { vec![false; dead.len()] } else { dead };
        for number in 0..frames.len() {
            let gone = rng.random_bool(self.frame);
            let scalars = &mut frames.scalars[number * SCALARS..(number + 1) * SCALARS];
            for map in (0..MAPS).filter(|&map| gone || lost[map]) {
                frames.maps[(number * MAPS + map) * size..][..size].fill(0);
                scalars[scalar::VALID + map] = 0.0;
            }
            if gone {
                scalars.fill(0.0);
            }
        }
        for (place, read) in frames.reads.chunks_exact_mut(READ_CHANNELS).enumerate() {
            if dead[place % dead.len()] {
                read.fill(0.0);
            }
        }
    }

    fn rename(&self, sample: &mut Sample, (objects, actions): (&[usize], &[usize]), rng: &mut ChaCha8Rng) {
        let (Some(action), Some(target)) = (sample.action, sample.target) else { return };
        if objects.is_empty() || !actions.contains(&action) || !rng.random_bool(self.rename) {
            return;
        }
        let (old, new) = (sample.objects[target], objects[rng.random_range(0..objects.len())]);
        // One of each kind: the other one of that name takes the old name.
        if let Some(other) = sample.objects.iter_mut().find(|object| **object == new) {
            *other = old;
        }
        sample.objects[target] = new;
    }
}
