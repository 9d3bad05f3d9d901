//! Numbers that tell one motion from another, as bodies, radar and reader have them.

use std::ops::Range;

use rfhoi_firmware::dsp::level;
use rfhoi_network::metrics::median;
use rfhoi_shared::radar::RadarProfile;
use serde::Serialize;

use crate::hoi::Action;
use crate::recognize::segment::BEGIN_CELLS;
use crate::simulate::body::{Joint, Joints, Side};
use crate::simulate::draw::Draw;
use crate::simulate::sample::{Sample, Take, epoch};

/// Step at which speeds are taken, s.
const STEP_S: f64 = 0.02;
/// Levels count down to so much under a sample's strongest, dB.
const COUNTS_DB: f32 = 30.0;

/// A performance before it is seen.
pub(super) struct Acted<'a> {
    pub(super) take: Take<'a>,
    /// Where all joints are at a time, s.
    pub(super) joints: &'a dyn Fn(f64) -> Joints,
    /// The hand that acts.
    pub(super) side: Side,
    /// From the first movement to the last, s.
    pub(super) acts_s: Range<f64>,
    pub(super) past_edge_m: f32,
}

/// What tells motions apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figures {
    /// From the first movement to the last, s; of recordings, all of their frames.
    pub movement_s: f64,
    /// Highest speed of the hand that acts, m/s.
    pub hand_m_s: f64,
    /// How far the hips go up and down, m.
    pub hips_m: f64,
    /// Highest radial speed with a level that counts, m/s.
    pub doppler_m_s: f64,
    /// Share of the radar's frames with so many moving cells as a recognised segment begins with, percent.
    pub moving_percent: f64,
    /// Moving cells of these frames, the median.
    pub moving_cells: f64,
    /// From where the target's tag is at first to where it is at last, cm.
    pub tag_cm: f64,
    /// Height of the target's tag where the thing lies, m.
    pub lies_m: f64,
    /// Reads of the target's tag, each second.
    pub reads_per_s: f64,
    /// How far into a table the person walks or reaches below its top
    /// ([`Among::past_edge_m`](crate::simulate::recorded::Among::past_edge_m)), cm; 0 of generated people.
    pub past_edge_cm: f64,
}

impl Figures {
    /// Of what was `measured` of `acted`.
    pub(super) fn of(acted: &Acted<'_>, draw: &Draw, measured: &Sample, profile: &RadarProfile) -> Self {
        let moving: Vec<u32> = measured.frames.iter().map(|frame| frame.moving_cells).collect();
        let lively: Vec<f64> = moving.iter().filter(|&&n| n >= BEGIN_CELLS).map(|&n| n.into()).collect();
        let target = draw.target.unwrap_or_default();
        let mut of_target = measured.tags_m.chunks_exact(measured.epcs.len().max(1)).map(|tags| tags[target]);
        let from = of_target.next().unwrap_or_default();
        let to = of_target.next_back().unwrap_or(from);
        let puts_down = draw.label.is_some_and(|label| label.action == Action::PutDown);
        let (epc, begin) = (measured.epcs.get(target), epoch(&acted.take.effects));
        let reads = measured.reads.iter().filter(|read| Some(&read.epc) == epc && read.time >= begin);
        let bins = fastest_bin(measured);
        Self {
            movement_s: acted.acts_s.end - acted.acts_s.start,
            hand_m_s: acted.fastest(acted.side.hand(), measured.duration_s).into(),
            hips_m: acted.rise(measured.duration_s).into(),
            doppler_m_s: (bins as f32 * profile.velocity_bin().0).into(),
            moving_percent: 100.0 * lively.len() as f64 / moving.len().max(1) as f64,
            moving_cells: median(lively).unwrap_or(0.0),
            tag_cm: (100.0 * from.distance(to)).into(),
            lies_m: if puts_down { to.z } else { from.z }.into(),
            reads_per_s: reads.count() as f64 / measured.duration_s,
            past_edge_cm: (100.0 * acted.past_edge_m).into(),
        }
    }

    /// All, by name.
    pub fn named(&self) -> [(&'static str, f64); 10] {
        [
            ("movement_s", self.movement_s),
            ("hand_m_s", self.hand_m_s),
            ("hips_m", self.hips_m),
            ("doppler_m_s", self.doppler_m_s),
            ("moving_percent", self.moving_percent),
            ("moving_cells", self.moving_cells),
            ("tag_cm", self.tag_cm),
            ("lies_m", self.lies_m),
            ("reads_per_s", self.reads_per_s),
            ("past_edge_cm", self.past_edge_cm),
        ]
    }
}

impl Acted<'_> {
    /// Highest speed of a joint, m/s.
    fn fastest(&self, joint: Joint, duration_s: f64) -> f32 {
        let at = |time_s: f64| (self.joints)(time_s)[joint.index()];
        let speeds = steps(duration_s).map(|t| at(t).distance(at(t + STEP_S)) / STEP_S as f32);
        speeds.fold(0.0, f32::max)
    }

    /// How far the hips go up and down, m.
    fn rise(&self, duration_s: f64) -> f32 {
        let heights = steps(duration_s).map(|t| (self.joints)(t)[Joint::HipCentre.index()].z);
        let ends = (f32::INFINITY, f32::NEG_INFINITY);
        let (low, high) = heights.fold(ends, |(low, high), z| (low.min(z), high.max(z)));
        (high - low).max(0.0)
    }
}

fn steps(duration_s: f64) -> impl Iterator<Item = f64> {
    (0..(duration_s / STEP_S) as u32).map(|step| f64::from(step) * STEP_S)
}

/// Doppler bins from rest to the fastest echo that counts.
fn fastest_bin(measured: &Sample) -> usize {
    let loops = measured.loops.max(1);
    let codes = || measured.frames.iter().flat_map(|frame| frame.range_doppler.iter().enumerate());
    let top = codes().map(|(_, &code)| code).max().unwrap_or(0);
    let least = top.saturating_sub((COUNTS_DB / level::SCALE.step_db) as u8);
    let counts = codes().filter(|&(_, &code)| code > least);
    counts.map(|(cell, _)| (cell % loops).abs_diff(loops / 2)).max().unwrap_or(0)
}
