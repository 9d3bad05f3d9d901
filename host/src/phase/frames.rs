//! The view frame by frame: phase differences of all tags and antennas over each interval of a common time grid.
//!
//! Between two borders of the grid the valid steps are summed read by read, so a tag that turns the phase by more than half a
//! turn within a frame is still followed if it was read often enough. A step that is invalid leaves the frames that it
//! overlaps invalid for the same reason. The phase at a border is interpolated between the reads around it; where the read
//! after has not come yet, the read before holds, carried on at its rate, for as long as [`Settings`] allow. The next frame
//! begins with the value with which the frame before has ended, so frames add up to the movement.

use std::collections::VecDeque;

use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::BridgeTime;
use serde::Serialize;

use super::calibration::Calibration;
use super::reader_clock::ReaderClock;
use super::sighting::{Seen, Sighting, Sightings};
use super::tracks::Tracks;
use super::{ChannelPlan, Invalid, MAX_ANTENNAS, MAX_TAGS, Settings};

/// Reads of a tag by an antenna that are kept for the borders to come; at one each 5 ms, 0.3 s.
const KEPT: usize = 64;
/// Reads that wait for others to be put in order.
const WAITING: usize = 512;

/// Phase differences over one interval.
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseFrame {
    /// Where it begins.
    pub begin: BridgeTime,
    /// Where it ends.
    pub end: BridgeTime,
    antennas: usize,
    differences: Vec<Result<f32, Invalid>>,
    sightings: Vec<Sighting>,
}

impl PhaseFrame {
    /// Becomes a copy of `other` in its own memory.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        let Self { begin, end, antennas, differences, sightings } = other;
        (self.begin, self.end, self.antennas) = (*begin, *end, *antennas);
        self.differences.clone_from(differences);
        self.sightings.clone_from(sightings);
    }

    /// Tags.
    pub fn tags(&self) -> usize {
        self.differences.len() / self.antennas
    }

    /// Antennas.
    pub fn antennas(&self) -> usize {
        self.antennas
    }

    /// By tag, then by antenna port: how far the phase turned, radians, positive where the path grew; or why that is not known.
    pub fn differences(&self) -> &[Result<f32, Invalid>] {
        &self.differences
    }

    /// The same of one tag, by antenna port; empty for a tag that is not there.
    pub fn tag(&self, tag: usize) -> &[Result<f32, Invalid>] {
        self.differences.chunks_exact(self.antennas).nth(tag).unwrap_or(&[])
    }

    /// By tag, then by antenna port: what reads tell as they are.
    pub fn sightings(&self) -> &[Sighting] {
        &self.sightings
    }
}

/// Reads that were left out, by why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Dropped {
    /// Later than the packet that brought them.
    pub from_the_future: u64,
    /// Much earlier than the packet that brought them.
    pub long_past: u64,
    /// Later reads of the same tag and antenna had been taken.
    pub late: u64,
    /// Without a phase.
    pub without_phase: u64,
    /// Of tags that are not on the list, or one too many.
    pub other_tags: u64,
    /// Of antenna ports that the scene does not have.
    pub other_antennas: u64,
}

/// Turns reads into frames of phase differences. Holds up to [`MAX_TAGS`] tags, [`MAX_ANTENNAS`] antennas and
/// [`MAX_CHANNELS`](super::MAX_CHANNELS) channels, and allocates only when a tag is first seen.
#[derive(Debug, Clone)]
pub struct PhaseFrames {
    tracks: Tracks,
    listed: bool,
    waiting: VecDeque<TagRead>,
    newest: BridgeTime,
    clock: ReaderClock,
    /// By tag, then by antenna.
    histories: Vec<History>,
    frame: PhaseFrame,
    dropped: Dropped,
}

/// The last reads of a tag by an antenna.
#[derive(Debug, Clone, Default)]
struct History {
    points: VecDeque<Point>,
    /// Number of the next point.
    next: u64,
    /// Last read that was left out, and why.
    refused: Option<(u64, Invalid)>,
    border: Option<Border>,
    sightings: Sightings,
}

#[derive(Debug, Clone, Copy)]
struct Point {
    time: u64,
    /// Unwrapped phase, rad, and its rate, rad/s.
    phase: f64,
    rate: f64,
    /// Why nothing is known of the way there.
    broken: Option<Invalid>,
}

/// The phase at a border of the grid.
#[derive(Debug, Clone, Copy)]
struct Border {
    time: u64,
    phase: f64,
    /// Number of the point before.
    point: u64,
}

impl PhaseFrames {
    /// Frames of tags as they come, numbered in the order of first sight.
    pub fn new(settings: Settings) -> Self {
        Self::with_calibration(settings, &[], &Calibration::default())
    }

    /// Frames of the tags `epcs` alone, or of all as they come if there are none, with offsets that an earlier session has
    /// learnt. Offsets of tags that are not listed are left out; of the list, the first [`MAX_TAGS`] are taken.
    pub fn with_calibration(settings: Settings, epcs: &[Epc], calibration: &Calibration) -> Self {
        let antennas = usize::from(settings.scene.reader_antennas).clamp(1, MAX_ANTENNAS);
        let listed = !epcs.is_empty();
        let mut tracks = Tracks::new(settings, &Calibration::default());
        for epc in epcs.iter().take(MAX_TAGS) {
            tracks.intern(epc);
        }
        for (key, offset) in calibration.offsets() {
            if tracks.find(&key.epc).is_some() || !listed && tracks.epcs().len() < MAX_TAGS {
                tracks.insert(key, offset);
            }
        }
        let begin = BridgeTime::default();
        let mut frames = Self {
            tracks,
            listed,
            waiting: VecDeque::with_capacity(WAITING),
            newest: begin,
            clock: ReaderClock::default(),
            histories: Vec::new(),
            frame: PhaseFrame { begin, end: begin, antennas, differences: Vec::new(), sightings: Vec::new() },
            dropped: Dropped::default(),
        };
        frames.grow();
        frames
    }

    /// EPCs of the tags, in the order of a frame's.
    pub fn epcs(&self) -> impl ExactSizeIterator<Item = &Epc> {
        self.tracks.epcs()
    }

    /// The offsets so far, to begin the next session with.
    pub fn calibration(&self) -> Calibration {
        self.tracks.calibration()
    }

    /// Reads left out so far.
    pub fn dropped(&self) -> Dropped {
        self.dropped
    }

    /// The latest frame.
    pub(crate) fn latest(&self) -> &PhaseFrame {
        &self.frame
    }

    /// Takes the reader's channels; they may change when it boots. What was learnt is found wrong by itself where it is.
    pub fn set_channels(&mut self, channels: ChannelPlan) {
        self.tracks.settings.channels = channels;
    }

    /// Takes a read that came with a packet of the bridge's time `sent`. Packets may come a little out of order.
    pub fn push(&mut self, read: &TagRead, sent: BridgeTime) {
        let settings = &self.tracks.settings;
        self.clock.watch(read.time, sent, settings);
        if read.phase.is_none() {
            self.dropped.without_phase += 1;
        } else if read.time > sent.after(settings.lead_us) {
            self.dropped.from_the_future += 1;
        } else if read.time.after(settings.latest_us) < sent {
            self.dropped.long_past += 1;
        } else if !(1..=self.frame.antennas).contains(&usize::from(read.antenna.0)) {
            self.dropped.other_antennas += 1;
        } else {
            let reorder_us = settings.reorder_us;
            // Far back is a bridge that has started anew; its times are not to be sorted among the old ones.
            if read.time.after(settings.latest_us) < self.newest {
                self.take_until(BridgeTime(u64::MAX));
                self.newest = read.time;
            }
            self.newest = self.newest.max(read.time);
            if self.waiting.len() == WAITING {
                self.take_first();
            }
            let place = self.waiting.partition_point(|other| other.time <= read.time);
            self.waiting.insert(place, read.clone());
            self.take_until(BridgeTime(self.newest.0.saturating_sub(reorder_us)));
        }
    }

    /// The differences between `begin` and `end`, from the reads so far. Frames follow each other; `end` is not before `begin`.
    pub fn frame(&mut self, begin: BridgeTime, end: BridgeTime) -> &PhaseFrame {
        self.take_until(end);
        self.frame.begin = begin;
        self.frame.end = end;
        let antennas = self.frame.antennas;
        let clock_wrong = self.clock.verdict(end, &self.tracks.settings);
        let PhaseFrame { differences, sightings, .. } = &mut self.frame;
        let cells = differences.iter_mut().zip(sightings).zip(&mut self.histories).enumerate();
        for (cell, ((difference, sighting), history)) in cells {
            *sighting = history.sightings.frame(begin.0, end.0);
            let holds = Holds::of(&self.tracks, cell / antennas);
            let found = history.difference(begin.0, end.0, holds);
            *difference = match found {
                Ok(_) | Err(Invalid::NoRead | Invalid::NeverSeen) if clock_wrong => Err(Invalid::ClockJump),
                found => found.map(|turned| turned as f32),
            };
        }
        &self.frame
    }

    /// Room for all tags that are known.
    fn grow(&mut self) {
        let cells = self.tracks.epcs().len() * self.frame.antennas;
        let empty = || History { points: VecDeque::with_capacity(KEPT), ..History::default() };
        self.histories.resize_with(cells, empty);
        self.frame.differences.resize(cells, Err(Invalid::NeverSeen));
        self.frame.sightings.resize(cells, Sighting::default());
    }

    fn take_until(&mut self, until: BridgeTime) {
        while self.waiting.front().is_some_and(|read| read.time <= until) {
            self.take_first();
        }
    }

    fn take_first(&mut self) {
        let Some(read) = self.waiting.pop_front() else { return };
        let tag = match self.tracks.find(&read.epc) {
            Some(tag) => tag,
            None if self.listed || self.tracks.epcs().len() == MAX_TAGS => {
                self.dropped.other_tags += 1;
                return;
            }
            None => {
                let tag = self.tracks.intern(&read.epc);
                self.grow();
                tag
            }
        };
        let Some((track, look)) = self.tracks.push(tag, &read) else { return };
        let history = &mut self.histories[tag * self.frame.antennas + usize::from(read.antenna.0) - 1];
        let broken = look.step.and_then(|step| step.turned.err());
        if broken != Some(Invalid::NotLater) {
            let seen = Seen { reading: look.reading, rssi: read.rssi, upright: look.taken };
            history.sightings.add(seen);
        }
        if look.taken {
            let (phase, rate) = self.tracks.estimate(track);
            history.add(Point { time: read.time.0, phase, rate, broken });
        } else if broken == Some(Invalid::NotLater) {
            self.dropped.late += 1;
            history.refused = Some((read.time.0, Invalid::NotLater));
        } else {
            history.refused = broken.map(|why| (read.time.0, why));
        }
    }
}

/// For how long a read holds.
#[derive(Debug, Clone, Copy)]
struct Holds {
    moving_us: u64,
    resting_us: u64,
    /// Since when the tag rests and until when that is known.
    rest: Option<(u64, u64)>,
}

impl Holds {
    fn of(tracks: &Tracks, tag: usize) -> Self {
        let settings = &tracks.settings;
        let longest = settings.scene.longest_read_interval(None);
        Self { moving_us: (longest.0 * 1e6) as u64, resting_us: settings.hold_us, rest: tracks.rest(tag) }
    }

    fn holds(&self, point: u64, border: u64) -> bool {
        let rested = self.rest.filter(|&(since, _)| since <= point).map_or(point, |(_, until)| until);
        border.saturating_sub(point.max(rested)) <= self.moving_us && border - point <= self.resting_us
    }
}

impl History {
    fn add(&mut self, point: Point) {
        if self.points.back().is_some_and(|last| last.time >= point.time) {
            // The clock was set back: what was before compares with nothing.
            self.points.clear();
            self.border = None;
        }
        if self.points.len() == KEPT {
            self.points.pop_front();
        }
        self.points.push_back(point);
        self.next += 1;
    }

    fn difference(&mut self, begin: u64, end: u64, holds: Holds) -> Result<f64, Invalid> {
        if self.next == 0 {
            return Err(Invalid::NeverSeen);
        }
        let from = match self.border.take() {
            Some(border) if border.time == begin => Ok(border),
            _ => self.at(begin, holds),
        };
        let to = self.at(end, holds);
        self.border = to.ok();
        // A hole on the way says more than a border that nobody has read.
        if let Some(why) = self.hole(begin, end) {
            return Err(why);
        }
        let (from, to) = (from?, to?);
        match self.broken(from.point + 1, to.point) {
            Some(why) => Err(why),
            None => Ok(to.phase - from.phase),
        }
    }

    /// Number of the first point that is kept.
    fn first(&self) -> u64 {
        self.next - self.points.len() as u64
    }

    /// Why the way over the points from number `from` to `to` is not known, if it is not.
    fn broken(&self, from: u64, to: u64) -> Option<Invalid> {
        let Some(skip) = from.checked_sub(self.first()) else { return Some(Invalid::NoRead) };
        let count = (to + 1).saturating_sub(from);
        self.points.iter().skip(skip as usize).take(count as usize).find_map(|point| point.broken)
    }

    /// Why part of the time between two borders is not known, as far as points say so.
    fn hole(&self, begin: u64, end: u64) -> Option<Invalid> {
        let within = self.points.iter().filter(|point| point.time > begin && point.time <= end);
        let after = self.points.iter().find(|point| point.time > end);
        let step = within.chain(after).find_map(|point| point.broken);
        let refused = self.refused.filter(|&(time, _)| {
            time > begin && time <= end && self.points.back().is_none_or(|last| last.time <= begin)
        });
        step.or(refused.map(|(_, why)| why))
    }

    fn at(&self, time: u64, holds: Holds) -> Result<Border, Invalid> {
        let place = self.points.partition_point(|point| point.time <= time);
        let before = place.checked_sub(1).and_then(|place| self.points.get(place)).ok_or(Invalid::NoRead)?;
        let point = self.first() + place as u64 - 1;
        let since = (time - before.time) as f64;
        let phase = match self.points.get(place).filter(|after| after.broken.is_none()) {
            Some(after) => {
                before.phase + (after.phase - before.phase) * since / (after.time - before.time) as f64
            }
            None if holds.holds(before.time, time) => {
                before.phase + before.rate * since.min(holds.moving_us as f64) * 1e-6
            }
            None => return Err(Invalid::NoRead),
        };
        Ok(Border { time, phase, point })
    }
}

#[cfg(test)]
#[path = "frames_tests.rs"]
mod tests;
