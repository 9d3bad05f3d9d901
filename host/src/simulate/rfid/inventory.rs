//! The reader at work: hop after hop, antenna after antenna, round after round.

use std::collections::VecDeque;

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{AntennaPort, BridgeTime, ChannelIndex, SPEED_OF_LIGHT};

use super::channel::{DWELL_S, HOP_S, ReaderSession};
use super::gen2::{AirMode, QAlgorithm, Slots};
use super::link::{Link, Surroundings};
use super::measurement::{Sway, measure};
use super::normal;
use crate::simulate::effects::Effects;
use crate::simulate::scene::{Scene, Tag};
use crate::simulate::{Capsule, Performance};

/// From a round's slots to the next round's, s: reads of a single tag by a single antenna are 14.03 ms apart within a
/// channel (`Test15-5-0`), of which the query and the slot take 0.79 ms.
pub const BETWEEN_ROUNDS_S: f64 = 0.013_24;
/// Its jitter, standard deviation, s: that of those reads.
const JITTER_S: f64 = 0.000_36;
/// Rounds before the next antenna has its turn.
pub const ROUNDS_PER_TURN: u32 = 2;
/// Without carrier at a change of antennas, s: reads by antennas that follow each other are 28.9 ms apart at the peak
/// (the eight `MoveTest1`), which are two rounds and this.
pub const SWITCH_S: f64 = 0.0008;

/// What the reader looks at.
#[derive(Clone, Copy)]
pub struct Situation<'a> {
    /// The room and the reader's antennas.
    pub scene: &'a Scene,
    /// Who stands in the way.
    pub performance: &'a dyn Performance,
    /// Where tag number n is at a time in seconds: [`Performance::tag`], or what stands for it.
    pub position: &'a dyn Fn(usize, f64) -> Vec3,
    /// The tags, one for each of the performance.
    pub tags: &'a [Tag],
    /// What is simulated.
    pub effects: Effects,
}

/// When and how the reader reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// When it begins, s; before 0 so that offsets can be learnt while everything is at rest. Not before the bridge's
    /// time 0.
    pub from_s: f64,
    /// When it ends, s.
    pub until_s: f64,
    /// The bridge's time when the sample begins, at 0 s.
    pub epoch: BridgeTime,
    /// How reader and tags talk.
    pub mode: AirMode,
    /// Share of rounds that a tag with enough power does not take part in, or is not understood in. The RDA samples, of
    /// worn tags: with ten and more, 8 % of the times between two reads of a tag are longer than 170 ms, where 116 ms is common.
    /// A tag carried past four antennas (`MoveTest1`) is missed in 79 %, whatever its signal strength.
    pub missed: f64,
    /// Reads of each tag by each antenna without [`Effects::inventory`], Hz.
    pub even_hz: f64,
    /// Share of these that is lost.
    pub even_loss: f64,
}

impl Options {
    /// From `from_s` to `until_s`, with the sample's beginning at the bridge's time `epoch`.
    pub fn between(from_s: f64, until_s: f64, epoch: BridgeTime) -> Self {
        Self {
            from_s,
            until_s,
            epoch,
            mode: AirMode::MAX_THROUGHPUT,
            missed: 0.08,
            even_hz: 25.0,
            even_loss: 0.2,
        }
    }
}

/// Reads tags as time goes on: an endless session needs no more memory than a short one.
pub struct Inventory<'a> {
    situation: Situation<'a>,
    session: &'a ReaderSession,
    options: Options,
    rng: ChaCha8Rng,
    /// By antenna, then by tag.
    sway: Vec<Vec<Sway>>,
    q: QAlgorithm,
    slots: Slots,
    /// Where the reader has got to, s.
    now_s: f64,
    /// Since when on this channel, s.
    hopped_s: f64,
    /// How long the last round took, s.
    round_s: f64,
    channel: usize,
    antenna: usize,
    /// Rounds of this turn, or reads where they are even.
    turn: u32,
    blockers: Vec<Capsule>,
    identified: Vec<(usize, f64)>,
    ready: VecDeque<TagRead>,
}

impl<'a> Inventory<'a> {
    /// A reader that begins to read.
    ///
    /// # Panics
    /// If the session was not drawn for as many tags, or the scene has no antenna.
    pub fn new(
        situation: Situation<'a>,
        session: &'a ReaderSession,
        options: Options,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        assert_eq!(session.tags.len(), situation.tags.len(), "a session of the same tags");
        assert!(!situation.scene.reader.antennas.is_empty(), "a reader without antennas");
        let mut rng = ChaCha8Rng::from_rng(rng);
        let antennas = &situation.scene.reader.antennas;
        let mut row = |_| situation.tags.iter().map(|_| Sway::draw(&mut rng)).collect();
        let sway = antennas.iter().map(&mut row).collect();
        let from_s = options.from_s.max(-options.epoch.seconds());
        Self {
            situation,
            session,
            options,
            rng,
            sway,
            q: QAlgorithm::new(situation.tags.len()),
            slots: Slots::default(),
            now_s: from_s,
            hopped_s: from_s,
            round_s: 0.0,
            channel: usize::from(session.first.0) - 1,
            antenna: 0,
            turn: 0,
            blockers: Vec::new(),
            identified: Vec::new(),
            ready: VecDeque::new(),
        }
    }

    /// Slots so far, by what came of them.
    pub fn slots(&self) -> Slots {
        self.slots
    }

    /// Leaves the channel if the time on it is over.
    fn hop(&mut self) {
        if self.session.hops && self.now_s + self.round_s - self.hopped_s > DWELL_S {
            self.now_s += HOP_S;
            self.hopped_s = self.now_s;
            self.channel = (self.channel + 1) % self.session.channels.len();
        }
    }

    fn next_antenna(&mut self) {
        self.turn = 0;
        self.antenna = (self.antenna + 1) % self.situation.scene.reader.antennas.len();
    }

    fn look(&mut self) {
        if self.situation.effects.blockage {
            self.situation.performance.blockers(self.now_s, &mut self.blockers);
        }
    }

    /// A round of slots.
    fn round(&mut self) {
        self.hop();
        let begin_s = self.now_s;
        self.now_s += (BETWEEN_ROUNDS_S + JITTER_S * normal(&mut self.rng)).max(0.0);
        self.look();
        let mut answers = Vec::with_capacity(self.situation.tags.len());
        for (number, tag) in self.situation.tags.iter().enumerate() {
            let powered = self.link(number, self.now_s).tag_dbm >= self.session.tags[number].sensitivity_dbm;
            if powered && !self.rng.random_bool(self.options.missed) {
                answers.push((tag.epc.bytes().len(), number));
            }
        }
        let mut identified = std::mem::take(&mut self.identified);
        let (length_s, slots) = self
            .q
            .round(&self.options.mode, &answers, &mut self.rng, |tag, after| identified.push((tag, after)));
        for (tag, after_s) in identified.drain(..) {
            self.read(tag, self.now_s + after_s);
        }
        self.identified = identified;
        self.slots.add(slots);
        self.now_s += length_s;
        self.round_s = self.now_s - begin_s;
        self.turn += 1;
        if self.turn == ROUNDS_PER_TURN {
            let before = self.antenna;
            self.next_antenna();
            if self.antenna != before {
                self.now_s += SWITCH_S;
            }
        }
    }

    /// One read, tag after tag and antenna after antenna, or its loss.
    fn even_read(&mut self) {
        self.hop();
        let (tags, antennas) = (self.situation.tags.len(), self.situation.scene.reader.antennas.len());
        self.look();
        if !self.rng.random_bool(self.options.even_loss) {
            self.read(self.turn as usize, self.now_s);
        }
        self.turn += 1;
        if self.turn as usize == tags {
            self.next_antenna();
        }
        self.now_s += 1.0 / (self.options.even_hz * (tags * antennas) as f64);
    }

    fn link(&self, tag: usize, time_s: f64) -> Link {
        let Situation { scene, performance, position, effects, .. } = &self.situation;
        let surroundings = Surroundings::new(&scene.room, &self.blockers, effects);
        let antenna = &scene.reader.antennas[self.antenna];
        let field = surroundings.one_way(antenna, position(tag, time_s), self.session.hertz(self.channel));
        // Fingers are in the way there and back.
        let covered_db = f64::from(performance.covered_db(tag, time_s)) / 2.0;
        Link::new(field, f64::from(scene.reader.power_dbm), self.session.tags[tag].loss_db + covered_db)
    }

    /// Shift of what comes back along the direct path, Hz; a tag that comes nearer shifts it up.
    fn doppler_hz(&self, tag: usize, time_s: f64) -> f64 {
        const STEP_S: f64 = 1e-3;
        let antenna = self.situation.scene.reader.antennas[self.antenna].position;
        let distance = |time_s| f64::from(antenna.distance((self.situation.position)(tag, time_s)));
        let speed = (distance(time_s + STEP_S) - distance(time_s)) / STEP_S;
        -2.0 * speed * self.session.hertz(self.channel) / SPEED_OF_LIGHT
    }

    fn read(&mut self, tag: usize, time_s: f64) {
        if time_s >= self.options.until_s {
            return;
        }
        let (channel, antenna) = (self.channel, self.antenna);
        let measured = measure(
            &self.link(tag, time_s),
            self.session.offset(channel, antenna, tag),
            self.doppler_hz(tag, time_s),
            (&self.sway[antenna][tag], time_s),
            &self.situation.effects,
            &mut self.rng,
        );
        let us = libm::round(time_s * 1e6) as i64;
        self.ready.push_back(TagRead {
            time: BridgeTime(self.options.epoch.0.saturating_add_signed(us)),
            epc: self.situation.tags[tag].epc.clone(),
            antenna: AntennaPort(antenna as u16 + 1),
            channel: ChannelIndex(channel as u16 + 1),
            phase: Some(measured.phase),
            rssi: measured.rssi,
            doppler: Some(measured.doppler),
        });
    }
}

/// Reads in the order of time.
impl Iterator for Inventory<'_> {
    type Item = TagRead;

    fn next(&mut self) -> Option<TagRead> {
        loop {
            if let Some(read) = self.ready.pop_front() {
                return Some(read);
            }
            if self.now_s >= self.options.until_s || self.situation.tags.is_empty() {
                return None;
            }
            if self.situation.effects.inventory {
                self.round();
            } else {
                self.even_read();
            }
        }
    }
}

/// All reads of a sample, in the order of time. See [`Inventory`] for long recordings.
///
/// # Panics
/// As [`Inventory::new`].
pub fn simulate(
    situation: Situation<'_>,
    session: &ReaderSession,
    options: Options,
    rng: &mut ChaCha8Rng,
) -> Vec<TagRead> {
    Inventory::new(situation, session, options, rng).collect()
}
