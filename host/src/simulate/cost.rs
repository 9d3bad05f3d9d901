//! What each effect costs, and what it changes.
//!
//! The same samples are made with the effects of `train` alone and with one switch thrown, one after the other, so that a
//! machine that is busy for a while slows both.

use std::time::{Duration, Instant};

use rfhoi_firmware::dsp::level;
use serde::Serialize;

use super::draw::{Draw, Wanted, draw};
use super::effects::{Domain, Effects};
use super::sample::{Maker, Sample, SampleError};
use super::scene::Scene;
use crate::phase::{Settings, analyse};

/// Cells of a map that count as echoes lie this much over its median, dB.
const ECHO_DB: f32 = 10.0;

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum CostError {
    /// A sample.
    #[error(transparent)]
    Sample(#[from] SampleError),
    /// The user stopped it.
    #[error("stopped; nothing was measured to its end")]
    Interrupted,
}

/// What came of throwing one switch.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cost {
    /// The switch.
    pub effect: &'static str,
    /// Whether it was on; else it was taken from the effects of `train`.
    pub on: bool,
    /// Time for a sample, ms.
    pub sample_ms: f64,
    /// The same relative to the effects of `train`, of the same samples.
    pub ratio: f64,
    /// Mean change of the range-Doppler maps' levels where there is an echo with or without it, dB.
    pub maps_db: f64,
    /// Reads a second.
    pub reads_hz: f64,
    /// Spread of phases about the mean of their tag, antenna and channel, deg. Tags that move add to it.
    pub phase_deg: Option<f64>,
}

/// Measures all switches on `samples` samples in `scenes`; the first row is `train` itself. `progress` is told the share that
/// is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If a sample cannot be made, or the user stopped it.
pub fn measure(
    scenes: &[Scene],
    seed: u64,
    samples: u32,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Vec<Cost>, CostError> {
    let domain = Domain::Train;
    let categories = &crate::hoi::CATEGORIES;
    // Places of `site`, as the rooms' effects are about them.
    let wanted = Wanted { samples, ..Wanted::one(Domain::Site, seed, categories) };
    let draws = draw(&wanted, scenes);
    let base = Effects::of(domain);
    let mut rows = Vec::new();
    let variants: Vec<(&str, bool, Effects)> = std::iter::once(("train", true, base))
        .chain(Effects::ALL.iter().map(|&(name, _)| {
            let mut effects = base;
            let on = effects.switch(name).is_some_and(|switch| {
                *switch = !*switch;
                *switch
            });
            (name, on, effects)
        }))
        .chain([("site", true, Effects::of(Domain::Site))])
        .collect();
    for (i, &(effect, on, effects)) in variants.iter().enumerate() {
        let mut without = Maker::new(domain, seed, base, scenes)?;
        let mut with = Maker::new(domain, seed, effects, scenes)?;
        let (mut times, mut change) = ([Duration::ZERO; 2], Change::default());
        for (done, draw) in draws.iter().enumerate() {
            let share = (i as f64 + done as f64 / draws.len() as f64) / variants.len() as f64;
            if !progress(share) {
                return Err(CostError::Interrupted);
            }
            let plain = timed(&mut without, draw, &mut times[0])?;
            let changed = timed(&mut with, draw, &mut times[1])?;
            change.add(&plain, &changed);
        }
        let count = f64::from(samples.max(1));
        rows.push(Cost {
            effect,
            on,
            sample_ms: times[1].as_secs_f64() * 1e3 / count,
            ratio: times[1].as_secs_f64() / times[0].as_secs_f64().max(1e-9),
            maps_db: change.maps_db(),
            reads_hz: change.reads as f64 / change.read_s.max(1e-9),
            phase_deg: change.phase_deg(),
        });
    }
    Ok(rows)
}

fn timed(maker: &mut Maker<'_>, draw: &Draw, time: &mut Duration) -> Result<Sample, SampleError> {
    let begin = Instant::now();
    let sample = maker.make(draw)?;
    *time += begin.elapsed();
    Ok(sample)
}

/// Sums of what changed.
#[derive(Debug, Default)]
struct Change {
    difference_db: f64,
    cells: u64,
    reads: usize,
    read_s: f64,
    phases_deg: Vec<f64>,
}

impl Change {
    fn add(&mut self, plain: &Sample, changed: &Sample) {
        for (a, b) in plain.frames.iter().zip(&changed.frames) {
            let mut sorted = a.range_doppler.clone();
            sorted.sort_unstable();
            let echo = level::SCALE.level_db(sorted[sorted.len() / 2]) + ECHO_DB;
            for (&a, &b) in a.range_doppler.iter().zip(&b.range_doppler) {
                let [a, b] = [a, b].map(|code| level::SCALE.level_db(code));
                if a.max(b) > echo {
                    self.difference_db += f64::from((a - b).abs());
                    self.cells += 1;
                }
            }
        }
        if let (Some(first), Some(last)) = (changed.reads.first(), changed.reads.last()) {
            self.reads += changed.reads.len();
            self.read_s += last.time.seconds() - first.time.seconds();
        }
        let (_, report) = analyse(&changed.reads, Settings::default());
        self.phases_deg.extend(report.phase_std_within_channel_deg);
    }

    fn maps_db(&self) -> f64 {
        self.difference_db / self.cells.max(1) as f64
    }

    fn phase_deg(&self) -> Option<f64> {
        let count = self.phases_deg.len();
        (count > 0).then(|| self.phases_deg.iter().sum::<f64>() / count as f64)
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::radar::RadarProfile;

    use super::*;

    #[test]
    fn every_switch_is_measured_and_changes_its_own_radio_only() {
        let profile = RadarProfile { loops: 16, frame_period_us: 500_000, ..RadarProfile::bridge() };
        let scenes = [Scene::named("kitchen").unwrap().with_profile(&profile).unwrap()];
        let rows = measure(&scenes, 1, 2, &mut |_| true).unwrap();
        assert_eq!(rows.len(), Effects::ALL.len() + 2);
        assert_eq!(rows[0].maps_db, 0.0, "train differs from itself");
        for ((name, what), row) in Effects::ALL.iter().zip(&rows[1..]) {
            assert_eq!(row.effect, *name);
            assert!(row.sample_ms > 0.0 && row.ratio > 0.0);
            if what.trim().starts_with("RFID") {
                assert_eq!(row.maps_db, 0.0, "{row:?}");
            }
            // The others leave little behind: what is still is taken off, and rounding is below the noise.
            if ["occlusion", "pattern", "images", "thermal_noise"].contains(name) {
                assert!(row.maps_db > 0.0, "{row:?}");
            }
        }
    }
}
