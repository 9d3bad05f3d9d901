//! An inventory round of Gen2: slots, collisions, and how long they take.
//!
//! "EPC UHF Gen2 Air Interface Protocol", release 2.0.1: link timing in section 6.3.1.6, commands in 6.3.2.12, the slot
//! counter in annex C, and the choice of Q in annex D. Left out: flags of a session between rounds (with dual target
//! each tag takes part in each round), and the capture of a collision by the stronger tag.

use rand::{Rng, RngExt};

/// How reader and tag talk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AirMode {
    /// Backscatter link frequency, Hz.
    pub link_hz: f64,
    /// Subcarrier cycles of a symbol; 1 is FM0.
    pub miller: u32,
    /// Length of a reader's 0, s.
    pub tari_s: f64,
    /// Length of a reader's 1, in those of a 0.
    pub one: f64,
    /// The divide ratio DR, which relates TRcal to the link frequency.
    pub divide_ratio: f64,
}

impl AirMode {
    /// Mode 0 of an R420: FM0 at 640 kHz, Tari 6.25 us, PIE 1.5 (the capabilities in its answer to
    /// `GET_READER_CAPABILITIES`).
    pub const MAX_THROUGHPUT: Self =
        Self { link_hz: 640e3, miller: 1, tari_s: 6.25e-6, one: 1.5, divide_ratio: 64.0 / 3.0 };

    /// A reader's symbol 0 and 1 after each other (RTcal), s.
    fn calibration_s(&self) -> f64 {
        self.tari_s * (1.0 + self.one)
    }

    /// A command of `bits`, as many ones as zeros, behind a frame-sync, s.
    fn command_s(&self, bits: u32) -> f64 {
        const DELIMITER_S: f64 = 12.5e-6;
        let frame_sync = DELIMITER_S + self.tari_s + self.calibration_s();
        frame_sync + f64::from(bits) * self.calibration_s() / 2.0
    }

    /// A tag's answer of `bits` behind the short preamble, s.
    fn answer_s(&self, bits: u32) -> f64 {
        let preamble = if self.miller == 1 { 6 } else { 10 };
        f64::from((preamble + bits + 1) * self.miller) / self.link_hz
    }

    /// From the reader's end to the tag's beginning (T1), s.
    fn tag_pause_s(&self) -> f64 {
        self.calibration_s().max(10.0 / self.link_hz)
    }

    /// From the tag's end to the reader's beginning (T2, 3 to 20 cycles), s.
    fn reader_pause_s(&self) -> f64 {
        10.0 / self.link_hz
    }

    /// The `Query` that opens a round, s.
    pub fn query_s(&self) -> f64 {
        self.command_s(22) + self.divide_ratio / self.link_hz
    }

    /// A slot that no tag answers in, with the `QueryRep` that opens the next, s.
    pub fn empty_s(&self) -> f64 {
        self.tag_pause_s() + self.command_s(4)
    }

    /// A slot whose RN16 nobody understands, s: it is acknowledged in vain.
    pub fn collided_s(&self) -> f64 {
        self.until_acknowledged_s() + self.tag_pause_s() + self.command_s(4)
    }

    /// From a slot's beginning to the end of the EPC of `bytes`, with its protocol control and check words, s.
    pub fn identified_s(&self, bytes: usize) -> f64 {
        self.until_acknowledged_s() + self.tag_pause_s() + self.answer_s(32 + 8 * bytes as u32)
    }

    /// From the end of an EPC to the next slot, s.
    pub fn next_s(&self) -> f64 {
        self.reader_pause_s() + self.command_s(4)
    }

    fn until_acknowledged_s(&self) -> f64 {
        self.tag_pause_s() + self.answer_s(16) + self.reader_pause_s() + self.command_s(18)
    }
}

/// What came of the slots of a round.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Slots {
    /// No tag answered.
    pub empty: u64,
    /// One did.
    pub single: u64,
    /// More did.
    pub collided: u64,
}

impl Slots {
    /// Counts those of another round too.
    pub fn add(&mut self, other: Self) {
        self.empty += other.empty;
        self.single += other.single;
        self.collided += other.collided;
    }
}

/// A reader's Q, which follows the number of tags (annex D).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QAlgorithm {
    q: f64,
}

impl QAlgorithm {
    /// How fast Q moves with empty and collided slots (annex D: 0.1 to 0.5).
    const STEP: f64 = 0.3;
    const MOST: f64 = 15.0;

    /// For about `tags` tags.
    pub fn new(tags: usize) -> Self {
        Self { q: libm::log2(tags.max(1) as f64) }
    }

    fn slots(self) -> u32 {
        1 << libm::round(self.q) as u32
    }

    /// Sets the round off: each tag draws a slot, and those that collide draw again, until all are identified. `answers`
    /// holds the lengths of the tags' EPCs and who they are; `identified` is told who, and when after the round's
    /// beginning, s. The next round begins with the Q that this one ended with.
    ///
    /// Gives the round's length, s, and its slots.
    pub fn round(
        &mut self,
        mode: &AirMode,
        answers: &[(usize, usize)],
        rng: &mut impl Rng,
        mut identified: impl FnMut(usize, f64),
    ) -> (f64, Slots) {
        let mut time = mode.query_s();
        let mut slots = Slots::default();
        let mut waiting = answers.to_vec();
        loop {
            let frame = self.slots();
            let mut counters: Vec<_> = waiting.iter().map(|_| rng.random_range(0..frame)).collect();
            let mut slot = 0;
            // A frame ends with its last slot, or as soon as Q moves on and is told by `QueryAdjust`.
            while slot < frame && self.slots() == frame {
                let mut here = (0..waiting.len()).filter(|&n| counters[n] == slot);
                match (here.next(), here.next()) {
                    (None, _) => {
                        slots.empty += 1;
                        time += mode.empty_s();
                        self.q = (self.q - Self::STEP).max(0.0);
                    }
                    (Some(only), None) => {
                        slots.single += 1;
                        let (bytes, tag) = waiting.swap_remove(only);
                        counters.swap_remove(only);
                        time += mode.identified_s(bytes);
                        identified(tag, time);
                        time += mode.next_s();
                    }
                    (Some(_), Some(_)) => {
                        slots.collided += 1;
                        time += mode.collided_s();
                        self.q = (self.q + Self::STEP).min(Self::MOST);
                    }
                }
                slot += 1;
            }
            if waiting.is_empty() {
                return (time, slots);
            }
        }
    }
}
