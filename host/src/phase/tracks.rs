//! All tags and antennas: finds the track of a read.
//!
//! Tags are interned at first sight; from then on a read costs one look at a table of hashes, and nothing is allocated.

use rfhoi_shared::fnv;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime};

use super::calibration::{Calibration, Offset};
use super::rest::Rest;
use super::track::{Look, Reading, Track};
use super::{Invalid, PhaseKey, Settings};

/// Times that go back by more mean that the clock was set, us; less is a read that came late.
const CLOCK_SET_BACK_US: u64 = 1_000_000;

/// All tags and antennas.
#[derive(Debug, Clone)]
pub(super) struct Tracks {
    pub(super) settings: Settings,
    hashes: Vec<u32>,
    tags: Vec<Tag>,
    tracks: Vec<Track>,
    newest: BridgeTime,
}

#[derive(Debug, Clone)]
struct Tag {
    epc: Epc,
    rest: Rest,
    /// Antennas that have seen it, and the places of their tracks.
    antennas: Vec<(AntennaPort, usize)>,
}

impl Tracks {
    pub(super) fn new(settings: Settings, calibration: &Calibration) -> Self {
        let mut tracks = Self {
            settings,
            hashes: Vec::new(),
            tags: Vec::new(),
            tracks: Vec::new(),
            newest: BridgeTime::default(),
        };
        for (key, offset) in calibration.offsets() {
            tracks.insert(key, offset);
        }
        tracks
    }

    /// Takes an offset learnt before.
    pub(super) fn insert(&mut self, key: &PhaseKey, offset: &Offset) {
        let tag = self.intern(&key.epc);
        let track = self.track(tag, key.antenna);
        self.tracks[track].insert(key.channel, *offset);
    }

    /// Offsets so far.
    pub(super) fn calibration(&self) -> Calibration {
        let mut calibration = Calibration::default();
        for tag in &self.tags {
            for &(antenna, track) in &tag.antennas {
                for (channel, offset) in self.tracks[track].offsets() {
                    calibration.insert(PhaseKey { epc: tag.epc.clone(), antenna, channel }, offset);
                }
            }
        }
        calibration
    }

    /// Number of a tag, if it is known.
    pub(super) fn find(&self, epc: &Epc) -> Option<usize> {
        let hash = fnv::more(fnv::EMPTY, epc.bytes());
        let places = self.hashes.iter().enumerate().filter(|&(_, &other)| other == hash);
        places.map(|(place, _)| place).find(|&place| self.tags[place].epc == *epc)
    }

    /// Number of a tag; a new one if it is not known.
    pub(super) fn intern(&mut self, epc: &Epc) -> usize {
        self.find(epc).unwrap_or_else(|| {
            self.hashes.push(fnv::more(fnv::EMPTY, epc.bytes()));
            self.tags.push(Tag { epc: epc.clone(), rest: Rest::default(), antennas: Vec::new() });
            self.tags.len() - 1
        })
    }

    /// EPCs by number.
    pub(super) fn epcs(&self) -> impl ExactSizeIterator<Item = &Epc> {
        self.tags.iter().map(|tag| &tag.epc)
    }

    /// Since when a tag rests and until when that is known, us.
    pub(super) fn rest(&self, tag: usize) -> Option<(u64, u64)> {
        self.tags[tag].rest.span()
    }

    /// Unwrapped phase and rate of a track, rad and rad/s.
    pub(super) fn estimate(&self, track: usize) -> (f64, f64) {
        self.tracks[track].estimate()
    }

    fn track(&mut self, tag: usize, antenna: AntennaPort) -> usize {
        let antennas = &mut self.tags[tag].antennas;
        if let Some(&(_, track)) = antennas.iter().find(|&&(port, _)| port == antenna) {
            return track;
        }
        antennas.push((antenna, self.tracks.len()));
        self.tracks.push(Track::new(&self.settings));
        self.tracks.len() - 1
    }

    /// Takes a read of tag number `tag`; `None` if it carries no phase. Also the place of its track, counted from 0 in the
    /// order of first sight.
    pub(super) fn push(&mut self, tag: usize, read: &TagRead) -> Option<(usize, Look)> {
        let raw = f64::from(read.phase?.radians());
        if read.time.after(CLOCK_SET_BACK_US) < self.newest {
            self.newest = read.time;
            self.tracks.iter_mut().for_each(|track| track.interrupt(Invalid::ClockJump));
            self.tags.iter_mut().for_each(|tag| tag.rest = Rest::default());
        }
        self.newest = self.newest.max(read.time);
        let track = self.track(tag, read.antenna);
        let now = Reading { time: read.time.0, channel: read.channel, raw, corrected: None };
        Some((track, self.tracks[track].push(now, &mut self.tags[tag].rest, &self.settings)))
    }
}
