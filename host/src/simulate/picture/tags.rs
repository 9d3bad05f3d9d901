//! The tags' phase differences over time, a panel for each thing.

use super::maps::time_axis;
use super::{Differences, Sample, Thing};
use crate::plot::{Axis, Lines, Marks, Panel, Series, Style};

/// Least half height of the panels, so that noise does not fill them, degrees.
const LEAST_DEG: f64 = 20.0;

/// A panel for each thing that has differences, the target first, all to the same scale.
pub(super) fn panels(sample: &Sample) -> Vec<Panel> {
    let mut things: Vec<(usize, &Thing)> = sample.things.iter().enumerate().collect();
    things.sort_by_key(|(_, thing)| !thing.target);
    things.into_iter().filter_map(|(n, _)| panel(sample, n, None)).collect()
}

/// The panel of the target with `now_s` marked, if it has differences.
pub(super) fn target(sample: &Sample, now_s: f64) -> Option<Panel> {
    panel(sample, sample.things.iter().position(|t| t.target)?, Some(now_s))
}

fn panel(sample: &Sample, thing: usize, now_s: Option<f64>) -> Option<Panel> {
    let Thing { name, target } = &sample.things[thing];
    let tracks: Vec<&Differences> = sample.differences.iter().filter(|d| d.thing == thing).collect();
    if tracks.is_empty() {
        return None;
    }
    let x = time_axis(sample, now_s);
    let series = tracks.iter().map(|track| Series {
        name: format!("antenna {}", track.antenna),
        points: track.points.iter().map(|&(t, d)| (t, d.map_or(f64::NAN, f64::to_degrees))).collect(),
        style: Style::Line,
    });
    let highest = highest_deg(sample);
    Some(Panel::Lines(Lines {
        title: if *target { format!("Tag on the {name}, the target") } else { format!("Tag on the {name}") },
        x,
        y: Axis::new("phase difference", "deg", -highest, highest),
        series: series.collect(),
        marks: Some(Marks { label: "none valid".into(), spans: gaps(sample, &tracks) }),
    }))
}

/// Half height of all panels, degrees.
fn highest_deg(sample: &Sample) -> f64 {
    let all = sample.differences.iter().flat_map(|d| d.points.iter().filter_map(|p| p.1));
    all.map(|d| d.to_degrees().abs()).filter(|d| d.is_finite()).fold(LEAST_DEG, f64::max) * 1.05
}

/// Frames in which no antenna has a valid difference.
fn gaps(sample: &Sample, tracks: &[&Differences]) -> Vec<(f64, f64)> {
    let frame = |n: usize| n as f64 * sample.frame_s;
    let mut spans: Vec<(f64, f64)> = Vec::new();
    for n in 0..sample.moments.len() {
        let (from, to) = (frame(n), frame(n + 1));
        let mut points = tracks.iter().flat_map(|t| &t.points);
        if points.any(|(t, d)| d.is_some() && (from..to).contains(t)) {
            continue;
        }
        match spans.last_mut() {
            Some(last) if last.1 == from => last.1 = to,
            _ => spans.push((from, to)),
        }
    }
    spans
}
