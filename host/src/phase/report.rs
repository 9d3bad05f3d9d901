//! A recording's phases in figures.

use std::collections::BTreeMap;

use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::AntennaPort;
use serde::Serialize;

use super::ambiguity::AmbiguityDetector;
use super::circular::{Resultant, pooled_standard_deviation};
use super::{Invalid, PhaseKey, PhasePipeline, PhaseSample, Settings, Step};

/// Steps between consecutive reads of a tag by an antenna, by what became of them. As JSON an object with `valid` and each
/// reason that can be a step's, zero or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct IntervalCounts {
    /// Those whose phase difference has one meaning.
    pub valid: u64,
    invalid: [u64; Invalid::ALL.len()],
}

impl IntervalCounts {
    fn add(&mut self, step: Step) {
        *match step.turned {
            Ok(_) => &mut self.valid,
            Err(why) => &mut self.invalid[why as usize],
        } += 1;
    }

    /// Steps that are invalid for this reason.
    pub fn invalid(&self, why: Invalid) -> u64 {
        self.invalid[why as usize]
    }

    /// All steps.
    pub fn total(&self) -> u64 {
        self.valid + self.invalid.iter().sum::<u64>()
    }
}

impl Serialize for IntervalCounts {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let steps = Invalid::ALL.iter().filter(|&&why| !matches!(why, Invalid::NoRead | Invalid::NeverSeen));
        let invalid = steps.map(|&why| (why.reason(), self.invalid(why)));
        serializer.collect_map(std::iter::once(("valid", self.valid)).chain(invalid))
    }
}

/// What the phases of a recording are worth. The two spreads tell noise from movement only for tags that are still.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct PhaseReport {
    /// Reads.
    pub reads: u64,
    /// Reads without a phase.
    pub without_phase: u64,
    /// Pairs of tag and antenna.
    pub tracks: u64,
    /// Triples of tag, antenna and channel.
    pub groups: u64,
    /// Triples whose offset was learnt.
    pub calibrated_groups: u64,
    /// Circular standard deviation, degrees, of all phases about the mean of their tag, antenna and channel. Channels
    /// that were read once do not count. The noise that correction cannot take away.
    pub phase_std_within_channel_deg: Option<f64>,
    /// Circular standard deviation, degrees, of corrected phases about the mean of their tag and antenna, across
    /// channels. Held out: no read counts from which its offset was learnt.
    pub phase_std_after_correction_deg: Option<f64>,
    /// Corrected phases.
    pub corrected: u64,
    /// Steps between consecutive reads, by what became of them.
    pub intervals: IntervalCounts,
    /// Share of steps that are valid, 0 to 1.
    pub intervals_valid_share: Option<f64>,
    /// Triples whose phases lie in two modes pi apart, with the share of the smaller one.
    pub pi_ambiguous: BTreeMap<PhaseKey, f64>,
}

/// Sums samples up; [`analyse`] does so for a whole recording.
#[derive(Debug, Clone, Default)]
struct Statistics {
    reads: u64,
    without_phase: u64,
    groups: BTreeMap<PhaseKey, AmbiguityDetector>,
    corrected: BTreeMap<(Epc, AntennaPort), Resultant>,
    intervals: IntervalCounts,
}

impl Statistics {
    fn add(&mut self, sample: Option<&PhaseSample>) {
        self.reads += 1;
        let Some(PhaseSample { key, raw, corrected, step, .. }) = sample else {
            self.without_phase += 1;
            return;
        };
        self.groups.entry(key.clone()).or_default().add(*raw);
        let track = self.corrected.entry((key.epc.clone(), key.antenna)).or_default();
        if let Some(phase) = corrected {
            track.add(*phase);
        }
        if let Some(step) = step {
            self.intervals.add(*step);
        }
    }

    fn report(self, calibrated_groups: u64) -> PhaseReport {
        let within = pooled_standard_deviation(self.groups.values().map(AmbiguityDetector::phases));
        let after = pooled_standard_deviation(self.corrected.values());
        let total = self.intervals.total();
        PhaseReport {
            reads: self.reads,
            without_phase: self.without_phase,
            tracks: self.corrected.len() as u64,
            groups: self.groups.len() as u64,
            calibrated_groups,
            phase_std_within_channel_deg: within.map(f64::to_degrees),
            phase_std_after_correction_deg: after.map(f64::to_degrees),
            corrected: self.corrected.values().map(Resultant::count).sum(),
            intervals: self.intervals,
            intervals_valid_share: (total > 0).then(|| self.intervals.valid as f64 / total as f64),
            pi_ambiguous: self
                .groups
                .into_iter()
                .filter_map(|(key, phases)| Some((key, phases.minor_share()?)))
                .collect(),
        }
    }
}

/// Runs all of `reads`, sorted by time, through a new pipeline: the sample of each read that carries a phase, and the
/// report.
///
/// ```
/// use rfhoi::phase::{Settings, analyse};
/// use rfhoi::reads::ReadTable;
///
/// let text = "time_us,epc,antenna,channel,phase_code,rssi_centidbm,doppler_sixteenth_hz\n\
///             0,e280,1,7,100,-4000,\n\
///             9000,e280,1,7,140,-4000,\n";
/// let table = ReadTable::parse("two.csv", text)?;
/// let (samples, report) = analyse(&table.reads, Settings::default());
/// assert_eq!(samples.len(), 2);
/// assert_eq!(report.intervals_valid_share, Some(1.0));
/// # Ok::<(), rfhoi::reads::ReadsError>(())
/// ```
pub fn analyse(reads: &[TagRead], settings: Settings) -> (Vec<PhaseSample>, PhaseReport) {
    let mut pipeline = PhasePipeline::new(settings);
    let mut statistics = Statistics::default();
    let mut samples = Vec::with_capacity(reads.len());
    for read in reads {
        let sample = pipeline.push(read);
        statistics.add(sample.as_ref());
        samples.extend(sample);
    }
    let calibrated = pipeline.calibration().offsets().count() as u64;
    (samples, statistics.report(calibrated))
}
