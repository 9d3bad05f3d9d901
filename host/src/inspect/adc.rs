//! Raw ADC samples, cut into datagrams as on the wire.

use std::io;

use ndarray::Array1;
use rfhoi_firmware::dca1000::{Event, Reassembly};
use rfhoi_firmware::dsp::RangeStage;
use rfhoi_shared::radar::{IqOrder, MAX_SAMPLES, RadarProfile, SampleFormat};
use serde::Serialize;

use super::{Builder, InspectError, Options, Report};
use crate::datagrams::Datagrams;
use crate::samples::RawSamples;

/// Bytes of the longest chirp of one receiver.
pub(crate) const MAX_ROW: usize = MAX_SAMPLES * 4;
/// Ratio of positive to negative beat frequencies below which the order of I and Q cannot be told.
const CLEAR_DB: f64 = 3.0;
/// Bins on either side of zero that hold what leaks from the transmitter and the ADC's offset.
const LEAKAGE_BINS: usize = 1;

#[derive(Debug, Serialize)]
struct Figures {
    bytes: u64,
    samples_per_chirp: u16,
    receivers: usize,
    transmitters: usize,
    loops_per_frame: u16,
    frames_complete: u32,
    frames_truncated: u32,
    bytes_after_last_frame: u64,
    frame_period_s: f32,
    range_bin_m: f32,
    range_span_m: f32,
    velocity_bin_m_s: f32,
    words_clipped: u64,
    iq_order: Option<&'static str>,
    iq_order_chosen: Option<&'static str>,
    image_ratio_db: Option<f64>,
    strongest_bin: usize,
    strongest_range_m: f32,
    strongest_level_db: f32,
}

#[derive(Debug, Serialize)]
struct FramePart {
    frame: u32,
    chirps_lost: u32,
    words_clipped: u32,
    strongest_bin: usize,
    strongest_level_db: f32,
}

fn order_name(order: IqOrder) -> &'static str {
    match order {
        IqOrder::IFirst => "i-first",
        IqOrder::QFirst => "q-first",
    }
}

/// Mean power by bin of the range FFT, relative to a full-scale tone.
#[derive(Debug, Clone)]
struct MeanSpectrum {
    power: Array1<f64>,
    spectra: u64,
}

impl MeanSpectrum {
    fn new(bins: u16) -> Self {
        Self { power: Array1::zeros(usize::from(bins)), spectra: 0 }
    }

    fn add(&mut self, power: impl Iterator<Item = f32>) {
        for (sum, p) in self.power.iter_mut().zip(power) {
            *sum += f64::from(p);
        }
        self.spectra += 1;
    }

    /// Energy at positive over negative beat frequencies: all bins but zero and the highest, which have no sign.
    fn image_ratio_db(&self) -> f64 {
        let n = self.power.len();
        let energy =
            |bins: std::ops::Range<usize>| bins.map(|b| self.power[b]).sum::<f64>().max(f64::MIN_POSITIVE);
        10.0 * (energy(1..n / 2) / energy(n / 2 + 1..n)).log10()
    }

    /// The strongest bin past the leakage, counted from the other end where the spectrum is mirrored, and its level.
    fn strongest(&self, mirrored: bool) -> (usize, f32) {
        let n = self.power.len();
        let place = |bin: usize| if mirrored { (n - bin) % n } else { bin };
        let bins = LEAKAGE_BINS + 1..n.saturating_sub(LEAKAGE_BINS).max(LEAKAGE_BINS + 2);
        let best = bins.max_by(|&a, &b| self.power[place(a)].total_cmp(&self.power[place(b)])).unwrap_or(0);
        let level = self.power[place(best)] / self.spectra.max(1) as f64;
        (best, (10.0 * level.log10()) as f32)
    }
}

/// What a pass over the samples found.
struct Pass<'p> {
    profile: &'p RadarProfile,
    range: RangeStage,
    /// Rows of the chirp under way: it counts whole or not at all.
    chirp: Vec<u8>,
    all: MeanSpectrum,
    frame: MeanSpectrum,
    clipped: u64,
    frame_clipped: u32,
    frames: Vec<FramePart>,
    keep_frames: bool,
}

impl Pass<'_> {
    fn take(&mut self, event: Event<'_>) {
        match event {
            Event::FrameStart { .. } => {
                self.frame = MeanSpectrum::new(self.profile.range_bins());
                self.frame_clipped = 0;
            }
            Event::Row { receiver, bytes, intact: true, .. } => {
                if receiver == 0 {
                    self.chirp.clear();
                }
                self.chirp.extend_from_slice(bytes);
                if self.chirp.len() < self.profile.chirp_bytes() as usize {
                    return;
                }
                for row in self.chirp.chunks_exact(bytes.len()) {
                    let (spectrum, clipped) = self.range.spectrum(row);
                    self.all.add(spectrum.iter().map(|z| z.norm_sqr()));
                    if self.keep_frames {
                        self.frame.add(spectrum.iter().map(|z| z.norm_sqr()));
                    }
                    self.clipped += u64::from(clipped);
                    self.frame_clipped += clipped;
                }
            }
            Event::FrameEnd { frame, chirps_lost } if self.keep_frames => {
                let (strongest_bin, strongest_level_db) = self.frame.strongest(false);
                let words_clipped = self.frame_clipped;
                self.frames.push(FramePart {
                    frame,
                    chirps_lost,
                    words_clipped,
                    strongest_bin,
                    strongest_level_db,
                });
            }
            _ => {}
        }
    }
}

pub(super) fn inspect(mut builder: Builder<'_>, options: &Options) -> Result<Report, InspectError> {
    let path = builder.path.clone();
    let profile = options.profile.as_ref().ok_or_else(|| InspectError::NoProfile { path: path.clone() })?;
    let samples = RawSamples::open(&path)?;
    let (bytes, repair) = (samples.stream_bytes(), samples.repair());
    let mut reassembly = Reassembly::<MAX_ROW>::new(profile)
        .ok_or_else(|| builder.too_little("the profile's chirps are longer than any radar's"))?;
    let mut range = RangeStage::new();
    range.configure(profile, profile.gate_to(profile.range_span()));
    let empty = MeanSpectrum::new(profile.range_bins());
    let mut pass = Pass {
        profile,
        range,
        chirp: Vec::new(),
        all: empty.clone(),
        frame: empty,
        clipped: 0,
        frame_clipped: 0,
        frames: Vec::new(),
        keep_frames: builder.list,
    };
    for datagram in Datagrams::new(samples) {
        let datagram =
            datagram.map_err(|source: io::Error| InspectError::Read { path: path.clone(), source })?;
        reassembly.push(&datagram.bytes, |event| pass.take(event));
        builder.go_on(datagram.byte_count as f64 / bytes.max(1) as f64)?;
    }
    let complete = reassembly.frames().complete;
    let frame_bytes = u64::from(profile.frame_bytes());
    if complete == 0 {
        return Err(builder.too_little(format!(
            "{bytes} bytes are less than one frame of this profile ({frame_bytes} bytes): another profile, or fewer --loops?"
        )));
    }
    let after = bytes - u64::from(complete) * frame_bytes;
    let chosen = match profile.format {
        SampleFormat::Complex(order) => Some(order),
        SampleFormat::Real => None,
    };
    let ratio = chosen.map(|_| pass.all.image_ratio_db());
    let mirrored = ratio.is_some_and(|r| r < -CLEAR_DB);
    let found =
        chosen.filter(|_| ratio.is_some_and(|r| r.abs() >= CLEAR_DB)).map(|order| match (order, mirrored) {
            (order, false) => order,
            (IqOrder::IFirst, true) => IqOrder::QFirst,
            (IqOrder::QFirst, true) => IqOrder::IFirst,
        });
    if let (Some(chosen), true) = (chosen, mirrored) {
        let other = found.map_or("the other", order_name);
        builder.note(format!(
            "the profile says {}, but the energy is at negative beat frequencies: the samples are {other}; with the \
             wrong order near targets appear at the far end (give --iq {other})",
            order_name(chosen)
        ));
    } else if chosen.is_some() && found.is_none() {
        builder.note(
            "positive and negative beat frequencies are equally strong: the order of I and Q cannot be told",
        );
    }
    if after > 0 {
        builder.note(format!(
            "{after} bytes after the last whole frame, from offset {}: the recording stopped within a frame, or the \
             profile is another one",
            bytes - after
        ));
    }
    if repair.rewrapped > 0 {
        builder
            .note(format!("{} words had been decoded as unsigned and were wrapped back", repair.rewrapped));
    }
    if repair.rounded > 0 {
        builder.note(format!("{} words were no whole numbers and were rounded", repair.rounded));
    }
    if pass.clipped > 0 {
        builder.note(format!("{} words are at the ADC's limits: lower the receiver's gain", pass.clipped));
    }
    let (strongest_bin, strongest_level_db) = pass.all.strongest(mirrored);
    for frame in std::mem::take(&mut pass.frames) {
        builder.part(frame);
    }
    let figures = Figures {
        bytes,
        samples_per_chirp: profile.samples,
        receivers: profile.rx_count(),
        transmitters: profile.tx_slots(),
        loops_per_frame: profile.loops,
        frames_complete: complete,
        frames_truncated: u32::from(after > 0),
        bytes_after_last_frame: after,
        frame_period_s: profile.frame_period().0,
        range_bin_m: profile.range_bin().0,
        range_span_m: profile.range_span().0,
        velocity_bin_m_s: profile.velocity_bin().0,
        words_clipped: pass.clipped,
        iq_order: found.map(order_name),
        iq_order_chosen: chosen.map(order_name),
        image_ratio_db: ratio.map(f64::abs),
        strongest_bin,
        strongest_range_m: strongest_bin as f32 * profile.range_bin().0,
        strongest_level_db,
    };
    Ok(builder.finish("dca1000_adc", figures))
}
