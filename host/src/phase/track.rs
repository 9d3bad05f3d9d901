//! One tag as one antenna sees it: what a read's step is worth.
//!
//! ```text
//!            same channel: raw phases -----------+
//! read --> [offsets] other channel: corrected ---+--> turn modulo 2 pi --> [filter] one meaning? plausible? --> step
//! ```

use std::f64::consts::PI;

use rfhoi_shared::units::ChannelIndex;

use super::calibration::Offset;
use super::circular::wrap;
use super::filter::{Expected, PhaseFilter};
use super::offsets::{Corrected, Offsets, Whereabouts, place};
use super::rest::{Basis, Level, Rest};
use super::{Invalid, Settings, Step};

/// Gates from here on are too wide to tell a turn from the next one, rad: a tenth of a half turn is kept between them.
const WIDEST_GATE: f64 = 0.9 * PI;
/// The same where half turns must be told apart.
const WIDEST_FLIP_GATE: f64 = 0.5 * PI;
/// Flips of late from which on the carrier's sign counts as open.
const FLIPS: f64 = 1.5;
/// Reads over which flips are remembered.
const FLIP_MEMORY: f64 = 200.0;
/// So many reads in a row are left out as flipped; then it was the one before that was.
const MOST_REFUSED: u32 = 3;
/// Steps after which the rate is known.
const KNOWN_STEPS: u32 = 3;
/// Steps that are short enough for the scene's fastest hand after which aliasing is over.
const STEADY_STEPS: u32 = 4;
/// A tag that counts as resting may just have begun to move, with this standard deviation of its speed, m/s.
const REST_SPEED: f64 = 0.2;
/// What a hop adds to the noise, rad: errors of two offsets, each the mean of a visit's reads.
const HOP_NOISE: f64 = 0.08;
/// What the level of a resting tag may be off beyond noise, rad: sway, and errors of offsets.
const REST_BAND: f64 = 0.1;

/// A read's part that matters here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reading {
    /// Bridge's time, us.
    pub(super) time: u64,
    pub(super) channel: ChannelIndex,
    /// Phase as reported, rad in [0, 2 pi).
    pub(super) raw: f64,
    /// Phase less its channel's offset, as that was known when it was read.
    pub(super) corrected: Option<Corrected>,
}

/// What a read has led to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Look {
    pub(super) reading: Reading,
    /// Step from the last read that was taken.
    pub(super) step: Option<Step>,
    /// Whether the next step begins here. It does not if the read came too late or with the carrier's sign turned.
    pub(super) taken: bool,
}

impl Reading {
    /// The turn to a later read, modulo 2 pi.
    pub(super) fn turn_to(&self, later: &Self) -> Result<f64, Invalid> {
        if [self, later].iter().any(|reading| place(reading.channel).is_none()) {
            return Err(Invalid::ChannelUnknown);
        }
        if self.channel == later.channel {
            return Ok(later.raw - self.raw);
        }
        match (self.corrected, later.corrected) {
            (Some(from), Some(to)) if from.tie == to.tie => {
                if from.doubted || to.doubted {
                    return Err(Invalid::StaleCalibration);
                }
                Ok(to.phase - from.phase)
            }
            _ => Err(Invalid::UncalibratedHop),
        }
    }
}

/// One tag as one antenna sees it.
#[derive(Debug, Clone)]
pub(super) struct Track {
    offsets: Offsets,
    level: Level,
    last: Option<Reading>,
    filter: PhaseFilter,
    /// Counts how often the way was lost.
    epoch: u32,
    /// Steps in a row that followed the filter.
    steps: u32,
    refused: u32,
    flips: f64,
    /// Since when the tag is faster than reads can follow, us, and the quick steps since.
    latch: Option<(u64, u32)>,
    interrupted: Option<Invalid>,
}

impl Track {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            offsets: Offsets::default(),
            level: Level::default(),
            last: None,
            filter: PhaseFilter::new(settings.noise, 0.0),
            epoch: 0,
            steps: 0,
            refused: 0,
            flips: 0.0,
            latch: None,
            interrupted: None,
        }
    }

    /// Offsets so far.
    pub(super) fn offsets(&self) -> impl Iterator<Item = (ChannelIndex, Offset)> {
        self.offsets.known()
    }

    /// Takes an offset learnt before.
    pub(super) fn insert(&mut self, channel: ChannelIndex, offset: Offset) {
        self.offsets.insert(channel, offset);
    }

    /// Phase since the first read, as far as steps were valid, and its rate; rad and rad/s.
    pub(super) fn estimate(&self) -> (f64, f64) {
        (self.filter.total, self.filter.rate)
    }

    /// The next step says nothing, for this reason.
    pub(super) fn interrupt(&mut self, why: Invalid) {
        if self.last.take().is_some() {
            self.interrupted = Some(why);
        }
        self.offsets.interrupt();
        self.level = Level::default();
    }

    /// Takes a read. `rest` is what all antennas know of the tag.
    pub(super) fn push(&mut self, now: Reading, rest: &mut Rest, settings: &Settings) -> Look {
        if self.last.is_some_and(|last| now.time <= last.time) {
            let step = Some(Step { us: 0, turned: Err(Invalid::NotLater) });
            return Look { reading: now, step, taken: false };
        }
        let known = place(now.channel).is_some();
        if known {
            let rests = rest.span().map(|(since, _)| since);
            self.offsets.visit(now.channel, now.time, rests, self.place(), &settings.learning);
        }
        let now = Reading { corrected: self.correct(now, settings), ..now };
        let (step, taken) = match self.last {
            Some(last) => {
                let us = now.time - last.time;
                let (turned, taken) = self.step(last, now, rest, settings);
                (Some(Step { us, turned }), taken)
            }
            None => {
                self.lose(now, settings);
                (self.interrupted.take().map(|why| Step { us: 0, turned: Err(why) }), true)
            }
        };
        if taken {
            self.refused = 0;
            self.flips *= 1.0 - 1.0 / FLIP_MEMORY;
            self.last = Some(now);
            if known {
                self.offsets.add(now.time, now.raw);
                self.watch(now, rest, settings);
            }
        }
        Look { reading: now, step, taken }
    }

    /// Compares the phase with where it stayed.
    fn watch(&mut self, now: Reading, rest: &mut Rest, settings: &Settings) {
        let (basis, phase) = match now.corrected {
            Some(Corrected { phase, tie, doubted: false }) => (Basis::Tie(tie), phase),
            _ => (Basis::Channel(now.channel.0), now.raw),
        };
        let band = Settings::HOP_GATE * self.filter.noise() + REST_BAND;
        match self.level.look(basis, phase, now.time, band) {
            Some((still, us)) => {
                rest.look(now.time, still, (us as f64) <= settings.longest_us(now.channel));
            }
            None => rest.begin(now.time),
        }
    }

    /// The turn from `last` to `now`, or why there is none; and whether the read is taken.
    fn step(
        &mut self,
        last: Reading,
        now: Reading,
        rest: &Rest,
        settings: &Settings,
    ) -> (Result<f64, Invalid>, bool) {
        if place(last.channel).is_none() || place(now.channel).is_none() {
            return (self.restart(now, settings, Invalid::ChannelUnknown), true);
        }
        let mut from = last.time;
        let resting = rest.span().filter(|&(since, _)| since <= last.time);
        let scale = settings.radians_per_metre(now.channel);
        let half_turns = (now.time - last.time) as f64 / settings.longest_us(now.channel);
        let promised = half_turns <= 1.0;
        // Unseen is only the time since any antenna has seen the tag rest.
        let others =
            resting.map(|(_, until)| until.min(now.time)).filter(|&until| until > last.time || !promised);
        if let Some(until) = others {
            from = from.max(until);
            self.filter.rest(REST_SPEED * scale);
        }
        let hop = last.channel != now.channel;
        let extra = if hop { HOP_NOISE * HOP_NOISE } else { 0.0 };
        let expected =
            self.filter.expect((now.time - from) as f64 * 1e-6, settings.acceleration * scale, extra);
        let deviations = if hop { Settings::HOP_GATE } else { Settings::GATE };
        let mut gate = deviations * expected.variance.sqrt();
        let known = self.steps >= KNOWN_STEPS || resting.is_some();
        if !known {
            // The scene's fastest tag turns no further.
            let noise = (2.0 * self.filter.noise() * self.filter.noise() + extra).sqrt();
            gate = gate.min(half_turns * PI + Settings::HOP_GATE * noise);
        }
        let followed = gate < WIDEST_GATE && known;
        if !promised && !followed {
            return (self.restart(now, settings, Invalid::TooLong), true);
        }
        // As it was corrected when it was read: what its offset has been refined by since is no movement.
        let before = last.corrected.filter(|last| now.corrected.is_some_and(|now| now.tie == last.tie));
        let before = before.or_else(|| self.correct(last, settings));
        let turn = match (Reading { corrected: before, ..last }).turn_to(&now) {
            Ok(turn) => turn,
            Err(why) => {
                self.filter.coast(&expected);
                return (Err(why), true);
            }
        };
        if self.flips >= FLIPS && gate >= WIDEST_FLIP_GATE {
            return (self.restart(now, settings, Invalid::PiAmbiguity), true);
        }
        // Where the gate is wider than a turn, the scene's promise is all there is: the nearest to no turn.
        let beyond = if gate < WIDEST_GATE { wrap(turn - expected.turn) } else { wrap(turn) - expected.turn };
        if gate < WIDEST_GATE && beyond.abs() > gate {
            return self.implausible(now, &expected, beyond, gate, hop, settings);
        }
        self.filter.update(&expected, beyond);
        // What may just have begun to move is less certain than what noise is measured by.
        if others.is_none() {
            self.filter.measure(&expected, beyond);
        }
        self.steps += 1;
        let turned = expected.turn + beyond;
        (self.trusted(last, now, rest, settings).map(|()| turned), true)
    }

    /// The phase has gone to where the tag cannot be.
    fn implausible(
        &mut self,
        now: Reading,
        expected: &Expected,
        beyond: f64,
        gate: f64,
        hop: bool,
        settings: &Settings,
    ) -> (Result<f64, Invalid>, bool) {
        let tolerance = if gate < WIDEST_FLIP_GATE { gate } else { settings.flip_tolerance };
        if PI - beyond.abs() <= tolerance && self.refused < MOST_REFUSED {
            self.refused += 1;
            self.flips += 1.0;
            self.offsets.flipped();
            return (Err(Invalid::PiAmbiguity), false);
        }
        if hop {
            return self.stale(now, expected);
        }
        self.filter.measure(expected, beyond);
        let why = if self.refused > 0 { Invalid::PiAmbiguity } else { Invalid::Aliased };
        if why == Invalid::Aliased {
            self.latch = Some((now.time, 0));
        } else {
            self.offsets.begin_again();
        }
        (self.restart(now, settings, why), true)
    }

    /// A hop to a channel whose offset has changed.
    fn stale(&mut self, now: Reading, expected: &Expected) -> (Result<f64, Invalid>, bool) {
        self.offsets.doubt(now.channel);
        self.filter.coast(expected);
        (Err(Invalid::StaleCalibration), true)
    }

    /// Whether plausible steps may be believed.
    fn trusted(
        &mut self,
        last: Reading,
        now: Reading,
        rest: &Rest,
        settings: &Settings,
    ) -> Result<(), Invalid> {
        if self.filter.noise() > settings.largest_noise {
            return Err(Invalid::TooNoisy);
        }
        let Some((since, quick)) = self.latch else { return Ok(()) };
        let scene = &settings.scene;
        let slower = f64::from(scene.fastest_tag.0) / f64::from(scene.fastest_hand.0).max(1e-3);
        let is_quick = (now.time - last.time) as f64 <= settings.longest_us(now.channel) * slower;
        let quick = if is_quick { quick + 1 } else { 0 };
        let rests = rest.span().is_some_and(|(from, _)| from >= since);
        self.latch = (quick < STEADY_STEPS && !rests).then_some((since, quick));
        Err(Invalid::Aliased)
    }

    /// Goes on from `now` with nothing known of the rate.
    fn restart(&mut self, now: Reading, settings: &Settings, why: Invalid) -> Result<f64, Invalid> {
        self.lose(now, settings);
        Err(why)
    }

    fn lose(&mut self, now: Reading, settings: &Settings) {
        self.filter.restart(likely_rate(now.channel, settings));
        self.steps = 0;
        self.epoch = self.epoch.wrapping_add(1);
    }

    fn place(&self) -> Whereabouts {
        Whereabouts { phase: self.filter.total, epoch: self.epoch }
    }

    fn correct(&self, read: Reading, settings: &Settings) -> Option<Corrected> {
        self.offsets.correct(read.channel, read.raw, self.place(), settings.dispersion(read.channel))
    }
}

/// Standard deviation of the rate of a tag of which nothing is known: the scene's fastest has twice that, rad/s.
fn likely_rate(channel: ChannelIndex, settings: &Settings) -> f64 {
    f64::from(settings.scene.fastest_tag.0) / 2.0 * settings.radians_per_metre(channel)
}
