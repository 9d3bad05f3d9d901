//! How often a reader reads each tag, and how fast a tag it can follow.
//!
//! A reader works in rounds in which each tag answers once, two rounds on an antenna before the next has its turn; the
//! times are the simulated reader's, which come from recordings ([`crate::simulate::rfid`]). So an antenna reads a tag twice
//! shortly after each other, then not until all others had their turn. The phase difference of two reads has one meaning as
//! long as the tag moves less than a quarter of a wavelength between them.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::{BridgeTime, MetresPerSecond, Seconds};
use serde::Serialize;

use crate::simulate::rfid::channel::{DWELL_S, HOP_S};
use crate::simulate::rfid::gen2::QAlgorithm;
use crate::simulate::rfid::inventory::{BETWEEN_ROUNDS_S, Options, ROUNDS_PER_TURN, SWITCH_S};

/// Bytes of an EPC-96.
const EPC_BYTES: usize = 12;
/// Tags answered, over all rounds that are averaged.
const ANSWERS: usize = 4_096;

/// Rounds of a reader with so many tags in its field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounds {
    /// From the beginning of one to that of the next.
    pub length: Seconds,
    /// Share in which a tag is not read.
    pub missed: f64,
}

impl Rounds {
    /// The mean of rounds by the rules of Gen2 in the reader's fastest mode, after the same draws each time.
    pub fn of(tags: u8) -> Self {
        let Options { mode, missed, .. } = Options::between(0.0, 0.0, BridgeTime(0));
        let tags = usize::from(tags);
        let rounds = ANSWERS.div_ceil(tags.max(1));
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut q = QAlgorithm::new(tags);
        let slots = |_| {
            let answers: Vec<_> =
                (0..tags).filter(|_| !rng.random_bool(missed)).map(|tag| (EPC_BYTES, tag)).collect();
            q.round(&mode, &answers, &mut rng, |_, _| ()).0
        };
        let slots: f64 = (0..rounds).map(slots).sum();
        // A hop interrupts them once in a while.
        let hops = 1.0 + HOP_S / DWELL_S;
        Self { length: Seconds(((BETWEEN_ROUNDS_S + slots / rounds as f64) * hops) as f32), missed }
    }

    /// What it is like to be one of the tags that `antennas` antennas read, one of which moves at up to `fastest`.
    pub fn reading(&self, antennas: u8, fastest: MetresPerSecond) -> Reading {
        let round_s = f64::from(self.length.0);
        let others = f64::from(antennas.saturating_sub(1));
        let turn_s = f64::from(ROUNDS_PER_TURN) * round_s + if antennas > 1 { SWITCH_S } else { 0.0 };
        let away_s = others * turn_s + if antennas > 1 { SWITCH_S } else { 0.0 } + round_s;
        let reads = f64::from(ROUNDS_PER_TURN);
        let (read, missed) = (1.0 - self.missed, self.missed);
        let gap_s =
            |number: u32| if number % ROUNDS_PER_TURN == ROUNDS_PER_TURN - 1 { away_s } else { round_s };
        // From each read of a turn to the next that is not missed, weighted by how often that is and how long it takes.
        let (mut carried_s, mut sure_s, mut all_s) = (0.0, 0.0, 0.0);
        for first in 0..ROUNDS_PER_TURN {
            let (mut step_s, mut share) = (0.0, read);
            for number in first.. {
                step_s += gap_s(number);
                all_s += share * step_s;
                let reach = share_of_reach(carried(step_s) / f64::from(fastest.0));
                carried_s += share * step_s * reach;
                sure_s += if reach == 1.0 { share * step_s } else { 0.0 };
                share *= missed;
                if share < NEVER {
                    break;
                }
            }
        }
        let interval_s = turn_s * f64::from(antennas) / reads / read;
        Reading {
            interval: Seconds(interval_s as f32),
            longest: Seconds(away_s as f32),
            carried: MetresPerSecond(carried(away_s) as f32),
            carried_within_turn: MetresPerSecond(carried(round_s) as f32),
            reach_share: carried_s / all_s,
            sure_share: sure_s / all_s,
        }
    }
}

/// Steps less likely than this are left out.
const NEVER: f64 = 1e-6;

/// How a tag is read by one of several antennas.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reading {
    /// From read to read, on average.
    #[serde(rename = "interval_s")]
    pub interval: Seconds,
    /// While all other antennas have their turns.
    #[serde(rename = "longest_s")]
    pub longest: Seconds,
    /// Speed that is followed over [`Self::longest`] too: always.
    #[serde(rename = "carried_m_s")]
    pub carried: MetresPerSecond,
    /// Speed that is followed from read to read within a turn.
    #[serde(rename = "carried_within_turn_m_s")]
    pub carried_within_turn: MetresPerSecond,
    /// Share of a reach at the scene's fastest tag in which the steps are short enough for its speed at the moment.
    pub reach_share: f64,
    /// The same of steps that are short enough for the fastest tag, whatever its speed at the moment.
    pub sure_share: f64,
}

/// Speed at which a tag moves a quarter of a wavelength in `step_s`, m/s.
fn carried(step_s: f64) -> f64 {
    let quarter_wave = Scene { fastest_tag: MetresPerSecond(1.0), ..Scene::default() };
    f64::from(quarter_wave.longest_read_interval(None).0) / step_s
}

/// Share of a minimum-jerk reach's time at less than `speed`, relative to its fastest. At share u of the time it has
/// 16 u^2 (1 - u)^2 of that (T. Flash, N. Hogan, "The coordination of arm movements", J. Neuroscience 5, 1985).
fn share_of_reach(speed: f64) -> f64 {
    if speed >= 1.0 { 1.0 } else { 1.0 - 2.0 * (0.25 - speed.max(0.0).sqrt() / 4.0).sqrt() }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::Vec3;

    use super::*;
    use crate::simulate::effects::Effects;
    use crate::simulate::rfid::tests::Still;
    use crate::simulate::rfid::{ReaderSession, Situation, simulate};
    use crate::simulate::scene;

    #[test]
    fn a_reach_is_slow_at_its_ends() {
        // By its positions, 10 u^3 - 15 u^4 + 6 u^5.
        const STEPS: usize = 100_000;
        let at = |u: f64| u.powi(3) * (10.0 + u * (6.0 * u - 15.0));
        let u = |n: usize| n as f64 / STEPS as f64;
        let speed = |n: usize| (at(u(n + 1)) - at(u(n))) * STEPS as f64 / 1.875;
        for share in [0.1, 0.3, 0.6, 0.9] {
            let slower = (0..STEPS).filter(|&n| speed(n) < share).count() as f64 / STEPS as f64;
            assert!((slower - share_of_reach(share)).abs() < 1e-3, "{share}: {slower}");
        }
        assert_eq!([share_of_reach(0.0), share_of_reach(1.0), share_of_reach(2.0)], [0.0, 1.0, 1.0]);
    }

    /// Steps of all tags and antennas of a simulated reader, s.
    fn simulated(tags: usize, antennas: usize) -> Vec<f64> {
        let mut room = scene::Scene::named("open-room").unwrap();
        room.reader.antennas.truncate(antennas);
        let effects = Effects { hopping: true, inventory: true, ..Effects::NONE };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let session = ReaderSession::draw(antennas, tags, &effects, &mut rng);
        let situation = Situation {
            scene: &room,
            performance: &Still(Vec::new()),
            // Near, so that all have power.
            position: &|tag, _| Vec3::new(0.02 * tag as f32, 1.0, 1.0),
            tags: &room.tags[..tags],
            effects,
        };
        let options = Options::between(0.0, 60.0, BridgeTime(0));
        let mut last = BTreeMap::new();
        let reads = simulate(situation, &session, options, &mut rng);
        let steps = reads.into_iter().filter_map(|read| {
            let before = last.insert((read.epc, read.antenna), read.time)?;
            Some(read.time.seconds() - before.seconds())
        });
        steps.collect()
    }

    #[test]
    fn the_simulated_reader_reads_as_often() {
        let fastest = MetresPerSecond(1.5);
        for (tags, antennas) in [(1, 1), (6, 1), (6, 2), (6, 4), (13, 3)] {
            let steps = simulated(tags, antennas);
            let mean = steps.iter().sum::<f64>() / steps.len() as f64;
            let valid = |s: f64| share_of_reach(carried(s) / f64::from(fastest.0));
            let reach = steps.iter().map(|&s| s * valid(s)).sum::<f64>() / steps.iter().sum::<f64>();
            let modelled = Rounds::of(tags as u8).reading(antennas as u8, fastest);
            println!("{tags} tags, {antennas} antennas: {mean:.4} s, {reach:.3}; model {modelled:?}");
            assert!((f64::from(modelled.interval.0) / mean - 1.0).abs() < 0.03, "{mean} {modelled:?}");
            assert!((modelled.reach_share - reach).abs() < 0.03, "{reach} {modelled:?}");
        }
    }

    #[test]
    fn more_tags_and_more_antennas_are_read_less_often() {
        let fastest = MetresPerSecond(1.5);
        let one = Rounds::of(1).reading(1, fastest);
        assert!((one.interval.0 - 0.0157).abs() < 0.0005, "a round of 14.0 ms, hops and misses: {one:?}");
        assert_eq!((one.carried, one.reach_share), (one.carried_within_turn, one.reach_share.min(1.0)));
        let mut before = (0.0, 2.0);
        for (tags, antennas) in [(1, 1), (6, 1), (6, 2), (6, 3), (6, 4), (13, 4), (30, 4), (255, 4)] {
            let reading = Rounds::of(tags).reading(antennas, fastest);
            assert!(reading.interval.0 > before.0 && reading.reach_share < before.1, "{reading:?}");
            assert!(
                reading.sure_share <= reading.reach_share && reading.carried <= reading.carried_within_turn
            );
            before = (reading.interval.0, reading.reach_share);
        }
    }
}
