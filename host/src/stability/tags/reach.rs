//! Simulated reads of a tag that rests, is moved once, and rests again; and what is made of them.

use std::f64::consts::TAU;

use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{BridgeTime, ChannelIndex};

use crate::phase::circular::wrap;
use crate::phase::{PhaseFrames, PhasePipeline, Settings};
use crate::stability::Trial;
pub(super) use crate::stability::hopping::CHANNELS;
use crate::stability::hopping::{
    DWELL_US, EPOCH_US, FRAME_US, channel, place, radians_per_metre, reached, read, step_us,
};

/// After a frame's end until it is asked for, us: the time its packets take.
const LAG_US: u64 = 20_000;
/// From the beginning to the movement at the earliest, us: all channels are visited twice.
const LEARNING_US: u64 = 4_400_000;
/// Rest after the movement, us.
const REST_US: u64 = 600_000;
/// A reach with least jerk (Flash and Hogan, 1985) away from the antennas, and how it is read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// How far, m.
    pub(super) metres: f64,
    /// Highest speed, m/s.
    pub(super) speed: f64,
    /// From read to read of an antenna, s.
    pub(super) interval_s: f64,
    /// Antennas, in turn.
    pub(super) antennas: u16,
    /// Phase noise, rad.
    pub(super) noise: f64,
}

impl Default for Reach {
    /// A cup put aside: 0.4 m in 0.8 s, read each 14 ms.
    fn default() -> Self {
        Self { metres: 0.4, speed: 0.9375, interval_s: 0.014, antennas: 1, noise: 0.1 }
    }
}

/// One draw of a [`Reach`].
#[derive(Debug, Clone)]
pub(super) struct Reads {
    /// When each read was made, us, and what the host is told.
    pub(super) reads: Vec<(u64, TagRead)>,
    /// Beginning and end of the movement, us.
    pub(super) moves: (u64, u64),
    reach: Reach,
    order: Vec<ChannelIndex>,
}

impl Reach {
    /// Draws channels, offsets, the moment and the reads.
    pub(super) fn draw(self, rng: &mut ChaCha8Rng) -> Reads {
        let mut order: Vec<_> = (0..CHANNELS).map(channel).collect();
        order.shuffle(rng);
        let offsets: Vec<f64> =
            (0..CHANNELS * usize::from(self.antennas)).map(|_| TAU * rng.random::<f64>()).collect();
        let begin = EPOCH_US + LEARNING_US + rng.random_range(0..2 * DWELL_US);
        // The peak of least jerk is 15/8 of the mean.
        let end = begin + (1.875 * self.metres / self.speed * 1e6) as u64;
        let mut reads = Reads { reads: Vec::new(), moves: (begin, end), reach: self, order };
        let step = self.interval_s * 1e6 / f64::from(self.antennas);
        let mut time_us = EPOCH_US as f64 + step * rng.random::<f64>();
        let mut turn = 0;
        while time_us < (end + REST_US) as f64 {
            let (time, antenna) = (time_us as u64, turn % usize::from(self.antennas));
            let place = place(time);
            let offset = offsets[antenna * CHANNELS + place];
            let phase = reads.radians_per_metre(place) * (1.5 + reads.metres(time))
                + offset
                + self.noise * rng.sample::<f64, _>(StandardNormal);
            reads.reads.push((time, read(time, 0, antenna, reads.order[place], phase)));
            time_us += step_us(step, rng);
            turn += 1;
        }
        reads
    }
}

impl Reads {
    fn radians_per_metre(&self, place: usize) -> f64 {
        radians_per_metre(self.order[place])
    }

    fn metres(&self, time: u64) -> f64 {
        self.reach.metres * reached(time, self.moves.0, self.moves.1)
    }

    /// By how much the phase truly turns between two times, rad.
    fn truly(&self, begin: u64, end: u64) -> f64 {
        let (mut at, mut turned) = (begin, 0.0);
        while at < end {
            let next = end.min((at / DWELL_US + 1) * DWELL_US);
            turned += self.radians_per_metre(place(at)) * (self.metres(next) - self.metres(at));
            at = next;
        }
        turned
    }

    /// Frames that hold the movement, and one or two of rest before and after.
    fn frames(&self) -> impl Iterator<Item = u64> + use<> {
        let (begin, end) = self.moves;
        (begin / FRAME_US - 1..(end + REST_US / 2) / FRAME_US).map(|n| n * FRAME_US)
    }

    /// Reads on these channels, by place in the hop table, fulfil `with` each.
    pub(super) fn on_channels(&mut self, chosen: &[bool; CHANNELS], mut with: impl FnMut(&mut TagRead, u64)) {
        let order = self.order.clone();
        for (time, read) in &mut self.reads {
            let place = order.iter().position(|&channel| channel == read.channel);
            if place.is_some_and(|place| chosen[place]) {
                with(read, *time);
            }
        }
    }

    /// How the first antenna's movement comes out: the error of the sum over all frames, rad. With the guard by
    /// [`PhaseFrames`]; without, wrapped differences of consecutive hop-corrected phases as they come are summed.
    pub(super) fn trial(&self, guard: bool) -> Trial {
        self.judge(guard, |errors| errors.iter().sum::<f64>().abs())
    }

    /// The same with the error of the worst frame.
    pub(super) fn worst_frame(&self, guard: bool) -> Trial {
        self.judge(guard, |errors| errors.iter().fold(0.0, |worst, error| error.abs().max(worst)))
    }

    fn judge(&self, guard: bool, error: impl Fn(&[f64]) -> f64) -> Trial {
        let truth: Vec<_> = self.frames().map(|begin| self.truly(begin, begin + FRAME_US)).collect();
        let off = |found: &[f64]| -> Vec<f64> { found.iter().zip(&truth).map(|(f, t)| f - t).collect() };
        if guard {
            match self.guarded() {
                Ok(found) => return Trial { error: error(&off(&found)), announced: None },
                Err(why) => {
                    let error = error(&off(&self.unguarded()));
                    return Trial { error, announced: Some(why.reason()) };
                }
            }
        }
        Trial { error: error(&off(&self.unguarded())), announced: None }
    }

    fn guarded(&self) -> Result<Vec<f64>, crate::phase::Invalid> {
        let mut frames = PhaseFrames::new(Settings::default());
        let mut reads = self.reads.iter().peekable();
        let mut found = Vec::new();
        for begin in self.frames() {
            let end = begin + FRAME_US;
            while let Some((time, read)) = reads.next_if(|(time, _)| *time <= end + LAG_US) {
                frames.push(read, BridgeTime(*time));
            }
            let frame = frames.frame(BridgeTime(begin), BridgeTime(end));
            let first = frame.differences().first().copied();
            found.push(f64::from(first.unwrap_or(Err(crate::phase::Invalid::NeverSeen))?));
        }
        Ok(found)
    }

    fn unguarded(&self) -> Vec<f64> {
        let mut pipeline = PhasePipeline::new(Settings::default());
        let mut found = vec![0.0; self.frames().count()];
        let first = self.frames().next().unwrap_or(0);
        let mut before = None;
        for (_, read) in self.reads.iter().filter(|(_, read)| read.antenna.0 == 1) {
            let Some(sample) = pipeline.push(read) else { continue };
            let phase = sample.corrected.unwrap_or(sample.raw);
            let turned = before.replace(phase).map_or(0.0, |before| wrap(phase - before));
            let frame = sample.time.0.checked_sub(first).map(|us| (us / FRAME_US) as usize);
            if let Some(sum) = frame.and_then(|frame| found.get_mut(frame)) {
                *sum += turned;
            }
        }
        found
    }
}
