//! Tag reads as pictures and numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ndarray::{Array1, Array2};
use rfhoi_shared::scene::Scene;
use rfhoi_shared::tag::{Epc, MAX_EPC_BYTES, TagRead};
use rfhoi_shared::units::AntennaPort;
use rfhoi_shared::wire::HopTable;

use super::ReplayError;
use crate::inspect::ReadFigures;
use crate::npz::Npz;
use crate::phase::circular::wrap;
use crate::phase::{ChannelPlan, PhaseSample, Settings, analyse};
use crate::plot::{Axis, Figure, Lines, Marks, Panel, Series, Style};
use crate::reads::write_csv;

/// Pairs of tag and antenna that the picture shows, those with most reads.
const SHOWN: usize = 4;

/// Writes `tags.png`, `tags.npz` and `tag_reads.csv` to the folder `out`.
pub(super) fn write(
    out: &Path,
    reads: &[TagRead],
    hop_table: Option<&HopTable>,
    scene: Scene,
    notes: &mut Vec<String>,
) -> Result<(ReadFigures, Vec<PathBuf>), ReplayError> {
    let mut reads = reads.to_vec();
    reads.sort_by_key(|r| r.time);
    let channels = hop_table.map_or_else(ChannelPlan::default, ChannelPlan::from);
    let settings = Settings { scene, channels, ..Settings::default() };
    let (samples, report) = analyse(&reads, settings.clone());
    let figures = ReadFigures::new(&reads, &settings, &report);
    let csv = out.join("tag_reads.csv");
    write_csv(&csv, &reads)?;
    if samples.is_empty() {
        notes.push(
            "no read carries a phase: the reader is none of Impinj's, or its extensions were off".into(),
        );
        return Ok((figures, vec![csv]));
    }
    let (png, npz) = (out.join("tags.png"), out.join("tags.npz"));
    picture(&samples, notes).save(&png)?;
    numbers(&npz, &samples)?;
    Ok((figures, vec![png, npz, csv]))
}

fn numbers(path: &Path, samples: &[PhaseSample]) -> Result<(), ReplayError> {
    let mut epcs: Vec<&Epc> = samples.iter().map(|s| &s.key.epc).collect();
    epcs.sort();
    epcs.dedup();
    let place = |epc: &Epc| epcs.binary_search(&epc).unwrap_or(0) as u32;
    let mut bytes = Array2::<u8>::zeros((epcs.len(), MAX_EPC_BYTES));
    for (mut row, epc) in bytes.rows_mut().into_iter().zip(&epcs) {
        row.iter_mut().zip(epc.bytes()).for_each(|(cell, &byte)| *cell = byte);
    }
    let column = |value: &dyn Fn(&PhaseSample) -> f64| samples.iter().map(value).collect::<Array1<f64>>();
    let turned = |s: &PhaseSample| s.step.and_then(|step| step.turned.ok()).unwrap_or(f64::NAN);
    Npz::create(path)?
        .array("time_s", &column(&|s| s.time.seconds()))?
        .array("tag", &samples.iter().map(|s| place(&s.key.epc)).collect::<Array1<u32>>())?
        .array("antenna", &samples.iter().map(|s| s.key.antenna.0).collect::<Array1<u16>>())?
        .array("channel", &samples.iter().map(|s| s.key.channel.0).collect::<Array1<u16>>())?
        .array("phase_rad", &column(&|s| s.raw))?
        .array("phase_corrected_rad", &column(&|s| s.corrected.unwrap_or(f64::NAN)))?
        .array("phase_difference_rad", &column(&turned))?
        .array("interval_s", &column(&|s| s.step.map_or(f64::NAN, |step| step.us as f64 * 1e-6)))?
        .array("tag_epc", &bytes)?
        .array("tag_epc_bytes", &epcs.iter().map(|e| e.bytes().len() as u8).collect::<Array1<u8>>())?
        .finish()?;
    Ok(())
}

fn picture(samples: &[PhaseSample], notes: &mut Vec<String>) -> Figure {
    let mut tracks: BTreeMap<(&Epc, AntennaPort), Vec<&PhaseSample>> = BTreeMap::new();
    for sample in samples {
        tracks.entry((&sample.key.epc, sample.key.antenna)).or_default().push(sample);
    }
    let mut by_reads: Vec<_> = tracks.into_iter().collect();
    by_reads.sort_by_key(|(_, samples)| std::cmp::Reverse(samples.len()));
    if by_reads.len() > SHOWN {
        notes.push(format!(
            "tags.png shows the {SHOWN} of {} pairs of tag and antenna with most reads",
            by_reads.len()
        ));
    }
    let ends = samples
        .first()
        .zip(samples.last())
        .map_or((0.0, 1.0), |(first, last)| (first.time.seconds(), last.time.seconds()));
    let x = || Axis::new("time", "s", ends.0, ends.1.max(ends.0 + 1e-3));
    let mut panels = Vec::new();
    for ((epc, antenna), samples) in by_reads.into_iter().take(SHOWN) {
        // The last digits tell tags of a kind apart.
        let epc = epc.to_string();
        let name = format!("tag ..{}, antenna {}", &epc[epc.len().saturating_sub(6)..], antenna.0);
        let dots = |name: &str, value: &dyn Fn(&PhaseSample) -> Option<f64>| Series {
            name: name.into(),
            points: samples.iter().filter_map(|s| Some((s.time.seconds(), value(s)?.to_degrees()))).collect(),
            style: Style::Dots,
        };
        let mut spans: Vec<(f64, f64)> = Vec::new();
        for pair in samples.windows(2).filter(|w| w[1].step.is_some_and(|s| s.turned.is_err())) {
            let (from, to) = (pair[0].time.seconds(), pair[1].time.seconds());
            match spans.last_mut() {
                Some(last) if last.1 == from => last.1 = to,
                _ => spans.push((from, to)),
            }
        }
        panels.push(Panel::Lines(Lines {
            title: format!("Phase, {name}"),
            x: x(),
            y: Axis::new("phase", "deg", -180.0, 180.0),
            series: vec![dots("as read", &|s| Some(wrap(s.raw))), dots("hop-corrected", &|s| s.corrected)],
            marks: None,
        }));
        panels.push(Panel::Lines(Lines {
            title: format!("Difference, {name}"),
            x: x(),
            y: Axis::new("phase difference", "deg", -180.0, 180.0),
            series: vec![dots("from read to read", &|s| s.step?.turned.ok())],
            marks: Some(Marks { label: "not valid".into(), spans }),
        }));
    }
    Figure { columns: 2, width: 1_600, panel_height: 380, ..Figure::new(panels) }
}
