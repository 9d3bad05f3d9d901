//! The pipeline itself: one read in, one sample out.

use std::collections::BTreeMap;

use rfhoi_shared::scene::Scene;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, ChannelIndex};
use serde::Serialize;

use super::calibration::{Calibration, LearningRule, Visit};
use super::circular::wrap;
use super::{ChannelPlan, PhaseKey};

/// What the pipeline rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The scene; its fastest tag limits how long a step may take.
    pub scene: Scene,
    /// The reader's channels.
    pub channels: ChannelPlan,
    /// When offsets are learnt.
    pub learning: LearningRule,
    /// How near to pi a step must be to look like a flip of the carrier's sign, radians.
    pub flip_tolerance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        // Three standard deviations of the difference of two reads with noise of 0.1 rad each.
        const FLIP_TOLERANCE: f64 = 0.42;
        Self {
            scene: Scene::default(),
            channels: ChannelPlan::default(),
            learning: LearningRule::default(),
            flip_tolerance: FLIP_TOLERANCE,
        }
    }
}

/// Why a step says nothing about movement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Invalid {
    /// The read is no later than the one before: order or clock is wrong.
    NotLater,
    /// The reader did not report the channel of one of both reads.
    ChannelUnknown,
    /// Meanwhile the scene's fastest tag can turn the phase by more than half a turn.
    TooLong,
    /// The reader hopped, and the offset of one of both channels is not known.
    UncalibratedHop,
    /// About half a turn, in less time than the scene's fastest tag takes for it: the carrier's sign, not movement.
    PiAmbiguity,
}

/// From one read of a tag by an antenna to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// How long it took, us.
    pub us: u64,
    /// By how much the phase turned, radians in (-pi, pi], or why that means nothing.
    pub turned: Result<f64, Invalid>,
}

/// What a read says.
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseSample {
    /// When the tag was read.
    pub time: BridgeTime,
    /// Tag, antenna and channel.
    pub key: PhaseKey,
    /// Phase as reported, radians in [0, 2 pi).
    pub raw: f64,
    /// Phase less its channel's offset, radians in (-pi, pi]; `None` until the offset is learnt, and for the reads it is
    /// learnt from.
    pub corrected: Option<f64>,
    /// Step from the last read of the same tag by the same antenna; `None` for the first.
    pub step: Option<Step>,
}

/// Corrects phases read by read. What it keeps grows with the tags, antennas and channels seen, not with time.
#[derive(Debug, Clone)]
pub struct PhasePipeline {
    settings: Settings,
    calibration: Calibration,
    tracks: BTreeMap<(Epc, AntennaPort), Track>,
}

/// One tag as one antenna sees it.
#[derive(Debug, Clone, Default)]
struct Track {
    visit: Option<Visit>,
    last: Option<Last>,
}

#[derive(Debug, Clone, Copy)]
struct Last {
    time: BridgeTime,
    channel: ChannelIndex,
    raw: f64,
    corrected: Option<f64>,
}

impl PhasePipeline {
    /// A pipeline that has learnt nothing yet.
    pub fn new(settings: Settings) -> Self {
        Self::with_calibration(settings, Calibration::default())
    }

    /// A pipeline that starts with offsets learnt before, and learns those that are missing.
    pub fn with_calibration(settings: Settings, calibration: Calibration) -> Self {
        Self { settings, calibration, tracks: BTreeMap::new() }
    }

    /// The offsets so far.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// Takes a read, in the order of time. `None` if it carries no phase.
    pub fn push(&mut self, read: &TagRead) -> Option<PhaseSample> {
        let raw = f64::from(read.phase?.radians());
        let key = PhaseKey::of(read);
        let track = self.tracks.entry((read.epc.clone(), read.antenna)).or_default();
        let mut corrected = None;
        if is_known(read.channel) {
            let visit =
                Visit::at(&mut track.visit, &key, read.time, &self.settings.learning, &mut self.calibration);
            visit.add(raw);
            corrected = self.calibration.offset(&key).map(|offset| wrap(raw - offset.radians));
        }
        let now = Last { time: read.time, channel: read.channel, raw, corrected };
        let step = track.last.replace(now).map(|last| self.settings.step(last, now));
        Some(PhaseSample { time: read.time, key, raw, corrected, step })
    }
}

/// Channel indices count from 1; 0 stands for a reader that does not report them.
fn is_known(channel: ChannelIndex) -> bool {
    channel.0 != 0
}

impl Settings {
    fn step(&self, last: Last, now: Last) -> Step {
        let us = now.time.since(last.time);
        Step { us, turned: self.turned(us, last, now) }
    }

    fn turned(&self, us: u64, last: Last, now: Last) -> Result<f64, Invalid> {
        if us == 0 {
            return Err(Invalid::NotLater);
        }
        if !is_known(last.channel) || !is_known(now.channel) {
            return Err(Invalid::ChannelUnknown);
        }
        let longest = self.scene.longest_read_interval(self.channels.frequency(now.channel));
        // How far the scene's fastest tag turns the phase meanwhile, in half turns.
        let half_turns = us as f64 * 1e-6 / f64::from(longest.0);
        if half_turns > 1.0 {
            return Err(Invalid::TooLong);
        }
        let turned = if last.channel == now.channel {
            wrap(now.raw - last.raw)
        } else {
            match (last.corrected, now.corrected) {
                (Some(last), Some(now)) => wrap(now - last),
                _ => return Err(Invalid::UncalibratedHop),
            }
        };
        let pi = std::f64::consts::PI;
        if turned.abs() > pi - self.flip_tolerance && turned.abs() > half_turns * pi {
            return Err(Invalid::PiAmbiguity);
        }
        Ok(turned)
    }
}
