//! Labelled reads of tags (samples of the RDA form, see [`rda`](crate::reads::rda)): tags that people wear, one antenna.
//!
//! Tags keep their places on the body, so a tag's name is which one it is: a vector with one 1. Nobody has read before a
//! sample begins, so its signal strength is told over a usual one, not over the tag's own mean. The channel was not recorded: it
//! is taken for one and the same.

use std::path::Path;

use rfhoi_network::sample::{Frames, MAX_TAGS, Sample};
use rfhoi_shared::config::BridgeConfig;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{BridgeTime, ChannelIndex, Kilohertz};
use rfhoi_shared::wire::HopTable;

use super::{Real, RealError, files};
use crate::align::{self, FrameStream, SILENCE};
use crate::features::{AngleMap, Settings};
use crate::reads::{Annotation, ReadTable};

/// Points of the maps that nobody looks at: as few as there can be.
pub const POINTS: usize = 16;
/// Signal strength that is told as 0, dBm: near the mean of the RDA data set, -66.6.
const USUAL_DBM: f32 = -65.0;

/// Of all reads, with a frequency in the middle of the band.
const CHANNEL: (ChannelIndex, Kilohertz) = (ChannelIndex(1), Kilohertz(920_000));

/// What features are made of.
pub const SETTINGS: Settings =
    Settings { points: POINTS, angles: AngleMap::None, antennas: 1, covariance: false };

/// Reads all samples (`.txt`) of a folder or an archive. `progress` is told the share that is done, 0 to 1, and says whether to
/// go on.
///
/// # Errors
/// If files cannot be read, are no labelled reads, or there are too many tags.
pub fn load(path: &Path, progress: &mut dyn FnMut(f64) -> bool) -> Result<Real, RealError> {
    let mut tables: Vec<(ReadTable, Annotation)> = Vec::new();
    files::each(path, ".txt", |name, bytes| {
        let table = ReadTable::parse(name, &String::from_utf8_lossy(&bytes))?;
        let annotation = table.annotation.ok_or_else(|| RealError::Unlabelled(name.display().to_string()))?;
        tables.push((table, annotation));
        Ok::<(), RealError>(())
    })?;
    let sorted = |mut all: Vec<u32>| {
        all.sort_unstable();
        all.dedup();
        all
    };
    let classes = sorted(tables.iter().map(|(_, label)| label.activity).collect());
    let mut epcs: Vec<Epc> =
        tables.iter().flat_map(|(table, _)| table.reads.iter().map(|r| r.epc.clone())).collect();
    epcs.sort();
    epcs.dedup();
    if epcs.len() > MAX_TAGS {
        return Err(RealError::Tags(epcs.len()));
    }
    let mut real = Real {
        classes: classes.iter().map(u32::to_string).collect(),
        names: (0..epcs.len()).map(|tag| one_of(tag, epcs.len())).collect(),
        ..Real::default()
    };
    for (number, (table, label)) in tables.iter().enumerate() {
        if !progress(number as f64 / tables.len() as f64) {
            return Err(RealError::Interrupted);
        }
        real.samples.push(Sample {
            frames: frames(table, &epcs)?,
            objects: (0..epcs.len()).collect(),
            action: classes.iter().position(|class| *class == label.activity),
            ..Sample::default()
        });
        real.people.push(label.person);
    }
    Ok(real)
}

fn one_of(place: usize, of: usize) -> Vec<f32> {
    (0..of).map(|other| f32::from(u8::from(other == place))).collect()
}

/// Frames of a table, the way live reads go.
fn frames(table: &ReadTable, epcs: &[Epc]) -> Result<Frames, RealError> {
    let radar = BridgeConfig::default().radar;
    let stream = SETTINGS.stream(&radar).map_err(align::AlignError::from)?;
    let mut stream = FrameStream::new(align::Settings { tags: epcs.to_vec(), ..stream })?;
    let mut features = SETTINGS.frame_features(&radar).over(USUAL_DBM);
    let mut frames = Frames::new(POINTS, epcs.len(), SETTINGS.antennas);
    let mut advance = |stream: &mut FrameStream, now: BridgeTime| {
        stream.advance(now);
        while let Some(frame) = stream.next() {
            frames.push(features.frame(&frame));
            stream.recycle(frame);
        }
    };
    stream.push_hop_table(&HopTable { table: 1, channels: [CHANNEL.1].into_iter().collect() });
    advance(&mut stream, BridgeTime(0));
    for read in &table.reads {
        stream.push_reads(&[TagRead { channel: CHANNEL.0, ..read.clone() }], read.time);
        advance(&mut stream, read.time);
    }
    let last = table.reads.last().map_or(BridgeTime(0), |read| read.time);
    // The frame of the last read, and no more: without a radar frames lag behind.
    let period_us = u64::from(radar.profile.frame_period_us);
    advance(&mut stream, BridgeTime((last.0 / period_us + SILENCE) * period_us));
    Ok(frames)
}
