//! The stream itself.

use std::collections::VecDeque;

use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{HopTable, WireError};
use serde::Serialize;

use super::frame::{AlignedFrame, MAPS, MapInvalid, MapName};
use super::grid::Grid;
use crate::aoa::{self, Estimator, SettingsError};
use crate::maps::{AngleSquare, Flaw, MapPair, PointsOutside, Velocity, VelocityGuard};
use crate::phase::calibration::Calibration;
use crate::phase::{self, PhaseFrames};
use crate::receive::{LinkCounts, RadarFrame, Received, Receiver};

/// Frames in a row that the radar did not send and that are handed on as missing; a longer silence is a new beginning.
const LONGEST_GAP: u32 = 50;
/// Frame periods without a frame of the radar after which frames go on without it.
pub(crate) const SILENCE: u64 = 3;
/// A reader that has sent nothing for so long is not waited for.
const READER_SILENT_US: u64 = 1_000_000;

/// How the angle map is made.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Angles {
    /// With the defaults for the profile's array.
    #[default]
    Default,
    /// With these settings, but the points of the other maps.
    Of(aoa::Settings),
    /// Not at all: it stays zero and invalid.
    LeftOut,
}

/// What a stream is made for.
#[derive(Debug, Clone)]
pub struct Settings {
    /// What the bridge's radar is configured for.
    pub radar: RadarConfig,
    /// Points of a map each way.
    pub points: usize,
    /// Angle of arrival.
    pub angles: Angles,
    /// Phase differences.
    pub phases: phase::Settings,
    /// The tags, in the order of a frame's; if there are none, all tags in the order of first sight.
    pub tags: Vec<Epc>,
    /// Offsets that an earlier session has learnt.
    pub calibration: Calibration,
    /// How long after a frame's end reads of it may come.
    pub patience_us: u64,
}

impl Settings {
    /// The defaults for `radar`: maps of 64 points, tags as they come.
    pub fn new(radar: RadarConfig) -> Self {
        Self {
            angles: Angles::Default,
            radar,
            points: 64,
            phases: phase::Settings::default(),
            tags: Vec::new(),
            calibration: Calibration::default(),
            // The bridge holds reads back for 10 ms to fill a packet; as much again for the reader's report.
            patience_us: 20_000,
        }
    }
}

/// Why there is no stream.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AlignError {
    /// Angle of arrival.
    #[error("angle of arrival: {0}")]
    Angles(#[from] SettingsError),
    /// The maps.
    #[error(transparent)]
    Maps(#[from] PointsOutside),
}

/// What went through, and what did not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct StreamCounts {
    /// The link to the bridge.
    pub link: LinkCounts,
    /// Frames handed on.
    pub frames: u64,
    /// Of these, frames that the radar did not send.
    pub frames_missing: u64,
    /// Times that the grid began anew.
    pub beginnings: u64,
    /// Reads left out, by why.
    pub reads: phase::Dropped,
}

/// Aligns both radios of one bridge.
#[derive(Debug)]
pub struct FrameStream {
    receiver: Receiver,
    maps: MapPair,
    velocity: VelocityGuard,
    /// `None` where angles are left out.
    estimator: Option<Estimator>,
    square: AngleSquare,
    phases: PhaseFrames,
    points: usize,
    /// Fingerprint of the profile.
    profile: u32,
    period_us: u64,
    patience_us: u64,
    grid: Option<Grid>,
    /// Where the grid begins if the radar stays silent.
    first: Option<BridgeTime>,
    /// Radar's parts of the frames that wait for their reads, oldest first, with their time stamps; `None` is missing.
    waiting: VecDeque<(AlignedFrame, Option<BridgeTime>)>,
    ready: VecDeque<AlignedFrame>,
    spare: Vec<AlignedFrame>,
    counts: StreamCounts,
    /// Latest time of the bridge; the radar's packets bear the time at which their frame began.
    now: BridgeTime,
    /// When the latest reads were sent.
    reads_at: Option<BridgeTime>,
}

impl FrameStream {
    /// A stream that has seen nothing yet.
    ///
    /// # Errors
    /// If the settings do not fit the profile.
    pub fn new(settings: Settings) -> Result<Self, AlignError> {
        let Settings { radar, points, angles, phases, tags, calibration, patience_us } = settings;
        let angles = match angles {
            Angles::Default => Some(aoa::Settings::of(&radar.profile)?),
            Angles::Of(settings) => Some(settings),
            Angles::LeftOut => None,
        };
        let estimator = |settings| Estimator::new(&radar.profile, aoa::Settings { points, ..settings });
        Ok(Self {
            receiver: Receiver::new(),
            maps: MapPair::new(&radar, points)?,
            velocity: VelocityGuard::new(&radar),
            estimator: angles.map(estimator).transpose()?,
            square: AngleSquare::new(),
            phases: PhaseFrames::with_calibration(phases, &tags, &calibration),
            points,
            profile: radar.profile.fingerprint(),
            period_us: u64::from(radar.profile.frame_period_us),
            patience_us,
            grid: None,
            first: None,
            waiting: VecDeque::new(),
            ready: VecDeque::new(),
            spare: Vec::new(),
            counts: StreamCounts::default(),
            now: BridgeTime::default(),
            reads_at: None,
        })
    }

    /// What went through so far.
    pub fn counts(&self) -> StreamCounts {
        StreamCounts { link: self.receiver.counts(), reads: self.phases.dropped(), ..self.counts }
    }

    /// EPCs of the tags, in the order of a frame's.
    pub fn epcs(&self) -> impl ExactSizeIterator<Item = &Epc> {
        self.phases.epcs()
    }

    /// Offsets learnt so far, to begin the next session with.
    pub fn calibration(&self) -> Calibration {
        self.phases.calibration()
    }

    /// Takes one packet of the bridge.
    ///
    /// # Errors
    /// If it is no packet, or of another version of the wire.
    pub fn push(&mut self, packet: &[u8]) -> Result<(), WireError> {
        self.receiver.push(packet)?;
        let now = self.receiver.time();
        while let Some(received) = self.receiver.next() {
            self.take(&received, now);
            if let Received::Frame(frame) = received {
                self.receiver.recycle(frame);
            }
        }
        self.advance(now);
        Ok(())
    }

    /// Takes what a packet of the bridge's time `sent` has led to, for those who have a [`Receiver`] of their own.
    pub fn take(&mut self, received: &Received, sent: BridgeTime) {
        match received {
            Received::Frame(frame) => self.push_frame(frame),
            Received::Reads(reads) => self.push_reads(reads, sent),
            Received::HopTable(table) => self.push_hop_table(table),
            Received::Restarted => self.restart(),
            _ => {}
        }
        self.advance(sent);
    }

    /// Takes a frame of the radar that came by another way than packets.
    pub fn push_frame(&mut self, frame: &RadarFrame) {
        self.place(frame.frame, frame.time);
        let mut aligned = self.blank(frame.frame);
        self.fill(frame, &mut aligned);
        self.waiting.push_back((aligned, Some(frame.time)));
    }

    /// Takes reads that were sent at `sent`.
    pub fn push_reads(&mut self, reads: &[TagRead], sent: BridgeTime) {
        self.reads_at = Some(sent);
        for read in reads {
            self.phases.push(read, sent);
        }
    }

    /// Takes the reader's channels.
    pub fn push_hop_table(&mut self, table: &HopTable) {
        self.phases.set_channels(table.into());
    }

    /// Tells that the bridge's clock is at `now`, and that all that was sent before has been pushed. [`Self::push`] does that
    /// itself.
    pub fn advance(&mut self, now: BridgeTime) {
        self.now = self.now.max(now);
        self.skip_silence();
        // Without a reader there is nothing to wait for.
        let reading = self.reads_at.is_some_and(|at| self.now.since(at) < READER_SILENT_US);
        let (now, patience_us) = (self.now, self.patience_us);
        let due = |grid: Grid| !reading || now >= grid.end().after(patience_us);
        while self.grid.is_some_and(due) && self.complete() {}
    }

    /// Hands on the oldest frame that waits. Returns whether there was one.
    fn complete(&mut self) -> bool {
        let (Some(grid), Some((mut aligned, stamp))) = (&mut self.grid, self.waiting.pop_front()) else {
            return false;
        };
        (aligned.begin, aligned.end) = grid.take(stamp);
        aligned.phases.copy_from(self.phases.frame(aligned.begin, aligned.end));
        self.counts.frames += 1;
        self.counts.frames_missing += u64::from(stamp.is_none());
        self.ready.push_back(aligned);
        true
    }

    /// Ends the stream: all that has come is handed on.
    pub fn finish(&mut self) {
        self.receiver.finish();
        while let Some(received) = self.receiver.next() {
            if let Received::Frame(frame) = received {
                self.push_frame(&frame);
            }
        }
        self.flush();
    }

    /// The next frame that is complete.
    #[allow(clippy::should_implement_trait, reason = "more may follow after None")]
    pub fn next(&mut self) -> Option<AlignedFrame> {
        self.ready.pop_front()
    }

    /// Takes back a frame that is no longer needed, for its memory.
    pub fn recycle(&mut self, frame: AlignedFrame) {
        if self.spare.len() < 2 * LONGEST_GAP as usize {
            self.spare.push(frame);
        }
    }

    /// Makes the next place in `waiting` that of frame `number`, with missing frames before it, or a new grid.
    fn place(&mut self, number: u32, time: BridgeTime) {
        let waiting = self.waiting.len() as u32;
        let missing = self.grid.and_then(|grid| grid.ahead(number, time)?.checked_sub(waiting));
        match missing.filter(|&missing| missing <= LONGEST_GAP) {
            Some(missing) => (0..missing).for_each(|_| self.miss()),
            None => {
                self.flush();
                self.grid = Some(Grid::new(number, time, self.period_us));
                self.counts.beginnings += 1;
            }
        }
    }

    /// Puts a frame that the radar did not send.
    fn miss(&mut self) {
        let Some(grid) = self.grid else { return };
        let number = grid.number.wrapping_add(self.waiting.len() as u32);
        let aligned = self.blank(number);
        self.waiting.push_back((aligned, None));
    }

    /// Lets frames go on where the radar is silent.
    fn skip_silence(&mut self) {
        let Some(grid) = self.grid else {
            let first = *self.first.get_or_insert(self.now);
            if self.now.since(first) >= SILENCE * self.period_us {
                self.grid = Some(Grid::new(0, first, self.period_us));
                self.counts.beginnings += 1;
            }
            return;
        };
        let due = grid.begin.after((self.waiting.len() as u64 + SILENCE) * self.period_us);
        let Some(late_us) = self.now.0.checked_sub(due.0) else { return };
        let missing = late_us / self.period_us.max(1) + 1;
        if missing > u64::from(LONGEST_GAP) {
            // Nobody was there for long: nothing is made up for it.
            self.flush();
        } else {
            (0..missing).for_each(|_| self.miss());
        }
    }

    /// Hands on what waits, complete or not, and ends the grid.
    fn flush(&mut self) {
        while self.complete() {}
        self.grid = None;
        self.first = None;
    }

    /// The bridge has started anew: its clock and its numbers too.
    fn restart(&mut self) {
        self.flush();
        self.now = BridgeTime::default();
        self.reads_at = None;
    }

    /// A frame of which nothing is there yet.
    fn blank(&mut self, number: u32) -> AlignedFrame {
        let mut aligned = self
            .spare
            .pop()
            .unwrap_or_else(|| AlignedFrame::empty(self.points, self.phases.latest().clone()));
        aligned.number = number;
        aligned.sent = false;
        (aligned.moving_cells, aligned.peak_db) = (None, None);
        (aligned.covariance, aligned.estimate) = (None, None);
        aligned.invalid = [Some(MapInvalid::Flaw(Flaw::Missing)); MAPS];
        if self.estimator.is_none() {
            aligned.invalid[MapName::Angle as usize] = Some(MapInvalid::LeftOut);
        }
        for map in &mut aligned.maps {
            map.fill(0.0);
        }
        aligned
    }

    /// Puts the radar's part into a frame.
    fn fill(&mut self, frame: &RadarFrame, aligned: &mut AlignedFrame) {
        aligned.sent = true;
        if frame.info.is_some_and(|info| info.profile != self.profile) {
            aligned.invalid = [Some(MapInvalid::OtherProfile); MAPS];
            return;
        }
        let [range_time, range_doppler, angle] = &mut aligned.maps;
        let maps = self.maps.frame(frame, range_doppler, range_time);
        let folded = self.velocity.frame(frame) == Velocity::Aliased;
        let [time, doppler] =
            [maps.range_time.flaw, maps.range_doppler.flaw].map(|flaw| flaw.map(MapInvalid::Flaw));
        let folded = folded.then_some(MapInvalid::Folded);
        aligned.invalid[MapName::RangeTime as usize] = time;
        aligned.invalid[MapName::RangeDoppler as usize] = doppler.or(folded);
        aligned.moving_cells = frame.info.map(|info| info.moving_cells);
        aligned.peak_db =
            Some(maps.range_doppler.peak_db - maps.range_doppler.floor_db).filter(|db| db.is_finite());
        aligned.covariance.clone_from(&frame.covariance);
        let (Some(covariance), Some(estimator)) = (&frame.covariance, &mut self.estimator) else { return };
        let estimate = estimator.estimate(covariance, aligned.moving_cells.unwrap_or(0));
        if estimate.doubt.is_none_or(|doubt| !doubt.is_empty()) {
            self.square.map(estimator.map_db(), angle);
        }
        // Rows of maps that are lost on the way take nothing from the covariance; losses before it do.
        let before = maps.range_doppler.flaw.filter(|flaw| matches!(flaw, Flaw::ChirpsLost | Flaw::Clipped));
        aligned.invalid[MapName::Angle as usize] =
            before.map(MapInvalid::Flaw).or(folded).or(estimate.doubt.map(MapInvalid::Doubt));
        aligned.estimate = Some(estimate);
    }
}
