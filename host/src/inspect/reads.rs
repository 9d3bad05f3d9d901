//! Tag reads.

use std::collections::BTreeSet;

use rfhoi_shared::tag::TagRead;
use serde::Serialize;

use super::{Builder, InspectError, Options, Report};
use crate::phase::{IntervalCounts, PhaseReport, Settings, analyse};
use crate::reads::ReadTable;

/// Figures of reads, from whatever source.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    reads: usize,
    tags: usize,
    antennas: usize,
    channels: usize,
    duration_s: f64,
    reads_per_second: Option<f64>,
    reads_without_phase: u64,
    phase_std_within_channel_deg: Option<f64>,
    phase_std_after_correction_deg: Option<f64>,
    phases_corrected: u64,
    intervals: IntervalCounts,
    intervals_valid_share: Option<f64>,
    longest_valid_interval_s: f32,
    fastest_tag_m_s: f32,
    groups_pi_ambiguous: usize,
}

impl Figures {
    pub(crate) fn new(reads: &[TagRead], settings: &Settings, phase: &PhaseReport) -> Self {
        let count = |key: fn(&TagRead) -> u16| reads.iter().map(key).collect::<BTreeSet<_>>().len();
        let times = reads.first().zip(reads.last());
        let duration_s = times.map_or(0.0, |(first, last)| last.time.seconds() - first.time.seconds());
        Self {
            reads: reads.len(),
            tags: reads.iter().map(|r| &r.epc).collect::<BTreeSet<_>>().len(),
            antennas: count(|r| r.antenna.0),
            channels: count(|r| r.channel.0),
            duration_s,
            reads_per_second: (duration_s > 0.0).then(|| reads.len() as f64 / duration_s),
            reads_without_phase: phase.without_phase,
            phase_std_within_channel_deg: phase.phase_std_within_channel_deg,
            phase_std_after_correction_deg: phase.phase_std_after_correction_deg,
            phases_corrected: phase.corrected,
            intervals: phase.intervals,
            intervals_valid_share: phase.intervals_valid_share,
            longest_valid_interval_s: settings.scene.longest_read_interval(None).0,
            fastest_tag_m_s: settings.scene.fastest_tag.0,
            groups_pi_ambiguous: phase.pi_ambiguous.len(),
        }
    }
}

#[derive(Debug, Serialize)]
struct ReadPart {
    time_s: f64,
    epc: String,
    antenna: u16,
    channel: u16,
    phase_deg: f64,
    corrected_deg: Option<f64>,
    difference_deg: Option<f64>,
    interval_ms: Option<f64>,
    invalid: Option<crate::phase::Invalid>,
}

pub(super) fn inspect(mut builder: Builder<'_>, options: &Options) -> Result<Report, InspectError> {
    let table = ReadTable::open(&builder.path)?;
    let settings = Settings { scene: options.scene, ..Settings::default() };
    let (samples, phase) = analyse(&table.reads, settings.clone());
    if table.duplicates > 0 {
        builder.note(format!("{} rows repeat another one exactly and were dropped", table.duplicates));
    }
    if !phase.pi_ambiguous.is_empty() {
        let groups = phase.pi_ambiguous.len();
        builder.note(format!("{groups} of tag, antenna and channel have phases in two modes pi apart: the reader's mode leaves the carrier's sign open"));
    }
    for sample in samples {
        let turned = sample.step.map(|s| s.turned);
        builder.part(ReadPart {
            time_s: sample.time.seconds(),
            epc: sample.key.epc.to_string(),
            antenna: sample.key.antenna.0,
            channel: sample.key.channel.0,
            phase_deg: sample.raw.to_degrees(),
            corrected_deg: sample.corrected.map(f64::to_degrees),
            difference_deg: turned.and_then(Result::ok).map(f64::to_degrees),
            interval_ms: sample.step.map(|s| s.us as f64 * 1e-3),
            invalid: turned.and_then(Result::err),
        });
    }
    let figures = Figures::new(&table.reads, &settings, &phase);
    Ok(builder.finish("tag_reads", figures))
}
