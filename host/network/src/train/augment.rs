//! What is done to samples before they are learnt from: what rooms, readers and people do that a simulation of few of them has
//! not shown.

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::Material;
use crate::sample::{Frames, MAPS, READ_CHANNELS, SCALARS, Sample, read, scalar};

/// Frames by which a window may begin and end elsewhere.
const WINDOW_FRAMES: usize = 2;
/// Samples that are drawn to find one of the same action.
const DRAWS: usize = 256;

/// How much is done.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Augment {
    /// Frames that may be missing at each end, at most.
    pub crop: usize,
    /// Chance that only the sample's window is left, give or take a few frames at each end.
    pub window: f64,
    /// Chance that a tag other than the target is not read.
    #[serde(default)]
    pub tag: f64,
    /// Chance that of each tag the reads may be, with a chance of one half, those of another sample of the same action on the
    /// same things: few people never show all that their tags could do together.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub exchange: f64,
    /// Chance that an antenna of the reader is dead.
    pub antenna: f64,
    /// Chance that a map is lost, in all frames.
    pub map: f64,
    /// Chance that a frame is lost.
    pub frame: f64,
    /// Rows of range by which the maps may be shifted, at most, as if the person stood elsewhere.
    pub shift: usize,
    /// Chance that all is played backwards: what was opened is closed.
    pub reverse: f64,
    /// Codes by which all maps of a sample may be brighter or darker, at most: another distance, another gain.
    #[serde(default)]
    pub gain: u8,
    /// Codes of noise in maps, at most.
    pub noise: u8,
    /// Chance that the target's name is that of another thing that is handled the same way.
    pub rename: f64,
}

/// Of a chance: recipes of files that do not know it stay as they are.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_zero(chance: &f64) -> bool {
    *chance == 0.0
}

impl Default for Augment {
    fn default() -> Self {
        Self {
            crop: 4,
            window: 0.6,
            tag: 0.0,
            exchange: 0.0,
            antenna: 0.05,
            map: 0.05,
            frame: 0.02,
            shift: 2,
            reverse: 0.5,
            gain: 0,
            noise: 6,
            rename: 0.3,
        }
    }
}

impl Augment {
    /// Nothing.
    pub const NONE: Self = Self {
        crop: 0,
        window: 0.0,
        tag: 0.0,
        exchange: 0.0,
        antenna: 0.0,
        map: 0.0,
        frame: 0.0,
        shift: 0,
        reverse: 0.0,
        gain: 0,
        noise: 0,
        rename: 0.0,
    };

    /// A changed copy; what may be changed, `material` says.
    pub(super) fn apply(&self, sample: &Sample, material: &Material<'_>, rng: &mut ChaCha8Rng) -> Sample {
        let frames = &sample.frames;
        let window = sample.window.clone().filter(|_| self.window > 0.0 && rng.random_bool(self.window));
        let kept = match window {
            Some(window) => near(window, frames.len(), rng),
            None => self.crop(frames.len(), rng),
        };
        let mut changed = Sample { frames: frames.part(kept.clone()), window: None, ..sample.clone() };
        self.exchange(&mut changed, kept.start, material, rng);
        let points = frames.points;
        let most = self.shift as i64;
        let shift = rng.random_range(-most..=most) as isize;
        self.maps(&mut changed.frames.maps, points, shift, rng);
        self.brighten(&mut changed.frames.maps, rng);
        self.losses(&mut changed.frames, rng);
        self.unread(&mut changed, rng);
        if rng.random_bool(self.reverse) {
            reverse(&mut changed, material.reversed);
        }
        self.rename(&mut changed, material.interchangeable, rng);
        changed
    }

    fn crop(&self, frames: usize, rng: &mut ChaCha8Rng) -> Range<usize> {
        let most = self.crop.min(frames / 4);
        rng.random_range(0..=most)..frames - rng.random_range(0..=most)
    }

    fn maps(&self, maps: &mut [u8], points: usize, shift: isize, rng: &mut ChaCha8Rng) {
        let size = points * points;
        let mut row = vec![0u8; size];
        for (number, map) in maps.chunks_exact_mut(size).enumerate() {
            let angle = number % MAPS == MAPS - 1;
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

    fn brighten(&self, maps: &mut [u8], rng: &mut ChaCha8Rng) {
        if self.gain > 0 {
            let most = i16::from(self.gain);
            let gain = rng.random_range(-most..=most);
            // A map that was lost stays so.
            for code in maps.iter_mut().filter(|code| **code > 0) {
                *code = (i16::from(*code) + gain).clamp(1, 255) as u8;
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

    /// Of a sample whose frames begin at `first`.
    fn exchange(&self, sample: &mut Sample, first: usize, material: &Material<'_>, rng: &mut ChaCha8Rng) {
        if self.exchange == 0.0 || !rng.random_bool(self.exchange) {
            return;
        }
        let Some(other) = another(sample, material, rng) else { return };
        let Frames { tags, antennas, .. } = sample.frames;
        let of_tag = antennas * READ_CHANNELS;
        let others: Vec<bool> = (0..tags).map(|_| rng.random_bool(0.5)).collect();
        for (place, reads) in sample.frames.reads.chunks_exact_mut(of_tag).enumerate() {
            if others[place % tags] {
                let from = (first * tags + place) * of_tag;
                match other.frames.reads.get(from..from + of_tag) {
                    Some(read) => reads.copy_from_slice(read),
                    None => reads.fill(0.0),
                }
            }
        }
    }

    fn unread(&self, sample: &mut Sample, rng: &mut ChaCha8Rng) {
        if self.tag == 0.0 {
            return;
        }
        let Frames { tags, antennas, .. } = sample.frames;
        let lost: Vec<bool> =
            (0..tags).map(|tag| rng.random_bool(self.tag) && sample.target != Some(tag)).collect();
        let of_tag = antennas * READ_CHANNELS;
        for (place, reads) in sample.frames.reads.chunks_exact_mut(of_tag).enumerate() {
            if lost[place % tags] {
                reads.fill(0.0);
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

/// One of the samples to learn from in which the same is done to the same things, which may be the sample itself; `None` if
/// none was drawn.
fn another<'a>(sample: &Sample, material: &Material<'a>, rng: &mut ChaCha8Rng) -> Option<&'a Sample> {
    let samples = material.samples;
    let of = |sample: &Sample| (sample.frames.tags, sample.frames.antennas, sample.action, sample.target);
    let like = |other: &&Sample| of(other) == of(sample) && other.objects == sample.objects;
    (0..DRAWS).map(|_| samples[rng.random_range(0..samples.len())]).find(like)
}

/// A window that begins and ends up to [`WINDOW_FRAMES`] earlier or later.
fn near(window: Range<usize>, frames: usize, rng: &mut ChaCha8Rng) -> Range<usize> {
    let mut off = |end: usize| (end + rng.random_range(0..=2 * WINDOW_FRAMES)).saturating_sub(WINDOW_FRAMES);
    let (first, last) = (off(window.start), off(window.end).min(frames));
    if first < last { first..last } else { window }
}

/// Plays a sample backwards, where the vocabulary says what each action is then: velocities and turns change their signs.
fn reverse(sample: &mut Sample, reversed: &[usize]) {
    let action = match sample.action {
        Some(action) => match reversed.get(action) {
            Some(&action) => Some(action),
            None => return,
        },
        None => None,
    };
    let frames = &sample.frames;
    let mut backwards = Frames::new(frames.points, frames.tags, frames.antennas);
    (0..frames.len()).rev().for_each(|number| backwards.push(frames.frame(number)));
    let rows = backwards.maps.chunks_exact_mut(frames.points).enumerate();
    for (number, row) in rows {
        // Columns are times in a frame, then velocities; an angle stays.
        if number / frames.points % MAPS < 2 {
            row.reverse();
        }
    }
    for read in backwards.reads.chunks_exact_mut(READ_CHANNELS) {
        read[read::DIFFERENCE] *= -1.0;
        read[read::TURN] *= -1.0;
    }
    sample.frames = backwards;
    sample.action = action;
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::sample::Frame;

    #[test]
    fn windows_stay_in_the_sample() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for window in [0..1, 0..20, 3..9, 19..20] {
            for _ in 0..200 {
                let near = near(window.clone(), 20, &mut rng);
                assert!(near.start < near.end && near.end <= 20, "{near:?}");
                assert!(near.start.abs_diff(window.start) <= 2 && near.end.abs_diff(window.end) <= 2);
            }
        }
    }

    #[test]
    fn tags_are_lost_whole_and_maps_are_brighter_by_one_gain() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut frames = Frames::new(4, 3, 1);
        for _ in 0..2 {
            let (maps, reads) = ([100; MAPS * 16], [1.0; 3 * READ_CHANNELS]);
            frames.push(Frame { maps: &maps, scalars: &[1.0; SCALARS], reads: &reads, covariance: &[] });
        }
        frames.maps[7] = 0;
        let sample = Sample { frames, target: Some(1), ..Sample::default() };
        let mut changed = sample.clone();
        Augment { tag: 1.0, ..Augment::NONE }.unread(&mut changed, &mut rng);
        for frame in changed.frames.reads.chunks_exact(3 * READ_CHANNELS) {
            let lost = frame.chunks_exact(READ_CHANNELS).map(|reads| reads == [0.0; READ_CHANNELS]);
            assert!(lost.eq([true, false, true]), "the target is left");
        }
        let mut maps = sample.frames.maps.clone();
        Augment { gain: 30, ..Augment::NONE }.brighten(&mut maps, &mut rng);
        assert!(maps[0] != 100 && maps[0].abs_diff(100) <= 30 && maps[7] == 0);
        assert!(maps.iter().enumerate().all(|(place, code)| place == 7 || *code == maps[0]));
    }

    #[test]
    fn tags_are_exchanged_whole_among_samples_of_one_action() {
        let of = |action, value: f32, count| {
            let mut frames = Frames::new(4, 8, 1);
            for _ in 0..count {
                let reads = [value; 8 * READ_CHANNELS];
                frames.push(Frame {
                    maps: &[0; MAPS * 16],
                    scalars: &[0.0; SCALARS],
                    reads: &reads,
                    covariance: &[],
                });
            }
            Sample { frames, objects: (0..8).collect(), action: Some(action), ..Sample::default() }
        };
        let (own, like, unlike) = (of(0, 1.0, 3), of(0, 2.0, 3), of(1, 9.0, 3));
        let other_things = Sample { objects: vec![0; 8], ..of(0, 9.0, 3) };
        let samples = [&unlike, &like, &other_things];
        let material = Material {
            samples: &samples,
            beside: &[],
            validation: &[],
            names: &[],
            interchangeable: (&[], &[]),
            reversed: &[],
        };
        let augment = Augment { exchange: 1.0, ..Augment::NONE };
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut exchanged = own.clone();
        // The last of three frames has none in the other sample.
        augment.exchange(&mut exchanged, 1, &material, &mut rng);
        let of_tag = |tag: usize| {
            let frames = exchanged.frames.reads.chunks_exact(8 * READ_CHANNELS);
            frames.map(|frame| frame[tag * READ_CHANNELS]).collect::<Vec<_>>()
        };
        let tags: Vec<_> = (0..8).map(of_tag).collect();
        assert!(tags.iter().all(|tag| *tag == [1.0; 3] || *tag == [2.0, 2.0, 0.0]), "{tags:?}");
        assert!(tags.contains(&vec![1.0; 3]) && tags.contains(&vec![2.0, 2.0, 0.0]));

        let mut alone = of(2, 1.0, 3);
        augment.exchange(&mut alone, 0, &material, &mut rng);
        assert_eq!(alone, of(2, 1.0, 3), "nobody else does it");
    }

    #[test]
    fn backwards_twice_is_forwards() {
        let points = 4;
        let mut frames = Frames::new(points, 1, 1);
        for number in 0..3u8 {
            let maps: Vec<u8> = (0..48).map(|cell| 50 * number + cell).collect();
            let mut reads = [0.0; READ_CHANNELS];
            (reads[read::DIFFERENCE], reads[read::TURN], reads[read::TURN + 1]) = (0.5, 0.6, 0.8);
            let scalars = [f32::from(number); SCALARS];
            frames.push(Frame { maps: &maps, scalars: &scalars, reads: &reads, covariance: &[] });
        }
        let sample =
            Sample { frames, objects: vec![0], action: Some(1), target: Some(0), ..Sample::default() };
        let mut changed = sample.clone();
        reverse(&mut changed, &[1, 0]);
        let (first, last) = (changed.frames.frame(0), sample.frames.frame(2));
        assert_eq!(changed.action, Some(0));
        assert_eq!(first.maps[..4], [last.maps[3], last.maps[2], last.maps[1], last.maps[0]]);
        assert_eq!(first.maps[32..], last.maps[32..]);
        assert_eq!(first.reads[..3], [-0.5, 0.0, -0.6]);
        reverse(&mut changed, &[1, 0]);
        assert_eq!(changed, sample);
        // An action of which nobody knows what it is backwards.
        reverse(&mut changed, &[]);
        assert_eq!(changed, sample);
    }
}
