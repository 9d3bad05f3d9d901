//! The SDK demo's data UART.

use std::collections::BTreeMap;

use rfhoi_firmware::mmwave::tlv::{Frame, HeaderFormat, StreamParser, Tlv};
use serde::Serialize;

use super::{Builder, InspectError, Report};

/// Bytes given to the parser at once, as a UART's driver would.
pub(crate) const CHUNK: usize = 4096;
/// Longest TLV frame.
pub(crate) const MAX_FRAME: usize = 256 * 1024;
/// Clock of `timeCpuCycles` in the frame header, Hz.
const RADAR_CLOCK_HZ: f64 = 200e6;

#[derive(Debug, Default, Serialize)]
struct Figures {
    bytes: usize,
    frames_complete: u32,
    frames_truncated: u32,
    first_frame: Option<u32>,
    last_frame: Option<u32>,
    frames_missing: u32,
    junk_bytes: u64,
    skipped_bytes: u64,
    resynchronisations: u32,
    tlv_types: Vec<u32>,
    tlv_counts: BTreeMap<u32, u32>,
    tlvs_malformed: u32,
    platform: Option<String>,
    sdk_version: Option<String>,
    frame_period_s: Option<f64>,
    points: u64,
    range_bins: Option<usize>,
    hottest_celsius: Option<i16>,
}

#[derive(Debug, Serialize)]
struct FramePart {
    frame: u32,
    tlv_types: Vec<u32>,
    points: u32,
    cpu_cycles: u32,
}

impl Figures {
    fn take(&mut self, frame: &Frame<'_>) {
        let header = frame.header;
        self.first_frame.get_or_insert(header.number);
        if let Some(last) = self.last_frame.replace(header.number) {
            self.frames_missing += header.number.saturating_sub(last).saturating_sub(1);
        }
        self.points += u64::from(header.points);
        self.platform = Some(format!("{:#x}", header.platform));
        let [major, minor, bugfix, build] = header.version.to_be_bytes();
        self.sdk_version = Some(format!("{major}.{minor}.{bugfix}.{build}"));
        for tlv in frame.tlvs() {
            if !self.tlv_types.contains(&tlv.code) {
                self.tlv_types.push(tlv.code);
            }
            *self.tlv_counts.entry(tlv.code).or_default() += 1;
        }
        for view in frame.views() {
            match view {
                Ok(Tlv::RangeProfile(levels)) => self.range_bins = Some(levels.len()),
                Ok(Tlv::Temperatures(t)) => self.hottest_celsius = self.hottest_celsius.max(t.hottest()),
                Ok(_) => {}
                Err(_) => self.tlvs_malformed += 1,
            }
        }
    }
}

/// Median time from frame to frame of consecutive numbers.
fn period_s(cycles: &[(u32, u32)]) -> Option<f64> {
    let mut steps: Vec<u32> = cycles
        .windows(2)
        .filter(|w| w[1].0 == w[0].0.wrapping_add(1))
        .map(|w| w[1].1.wrapping_sub(w[0].1))
        .collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).map(|&s| f64::from(s) / RADAR_CLOCK_HZ)
}

pub(super) fn inspect(
    mut builder: Builder<'_>,
    bytes: &[u8],
    format: &'static str,
) -> Result<Report, InspectError> {
    let mut parser = Box::new(StreamParser::<MAX_FRAME>::new(HeaderFormat::Subframe));
    let mut figures = Figures { bytes: bytes.len(), ..Figures::default() };
    let mut cycles = Vec::new();
    let mut take = |frame: &Frame<'_>| {
        figures.take(frame);
        cycles.push((frame.header.number, frame.header.cpu_cycles));
        builder.part(FramePart {
            frame: frame.header.number,
            tlv_types: frame.tlvs().map(|t| t.code).collect(),
            points: frame.header.points,
            cpu_cycles: frame.header.cpu_cycles,
        });
    };
    for mut chunk in bytes.chunks(CHUNK) {
        while let Some(frame) = parser.next(&mut chunk) {
            take(&frame);
        }
    }
    while let Some(frame) = parser.finish() {
        take(&frame);
    }
    let counts = *parser.counts();
    if counts.complete == 0 {
        return Err(builder.too_little(format!(
            "{} bytes hold no complete TLV frame ({} begun): is this the data UART (921600 baud), and a whole frame of it?",
            bytes.len(),
            counts.truncated
        )));
    }
    figures.frames_complete = counts.complete;
    figures.frames_truncated = counts.truncated;
    figures.junk_bytes = counts.leading_junk_bytes;
    figures.skipped_bytes = counts.junk_bytes - counts.leading_junk_bytes;
    figures.resynchronisations = counts.resyncs;
    figures.frame_period_s = period_s(&cycles);
    if counts.leading_junk_bytes > 0 {
        builder.note(format!("{} bytes before the first magic word", counts.leading_junk_bytes));
    }
    if counts.truncated > 0 {
        builder.note(format!(
            "{} frames began and were not complete; {} bytes skipped with them",
            counts.truncated, figures.skipped_bytes
        ));
    }
    if figures.frames_missing > 0 {
        builder.note(format!("{} frame numbers are missing", figures.frames_missing));
    }
    Ok(builder.finish(format, figures))
}
