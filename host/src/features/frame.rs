//! One aligned frame as the network takes it.

use std::f32::consts::PI;

use rfhoi_network::sample::{Frame, READ_CHANNELS, SCALARS, read, scalar};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::Covariance;

use crate::align::{AlignedFrame, MAPS, MapName};

/// Decibels of a peak over its floor that count as 1.
const PEAK_DB: f32 = 60.0;
/// Octaves of moving cells that count as 1.
const CELLS_OCTAVES: f32 = 10.0;
/// Reads that count as 1, and no more do.
const MOST_READS: f32 = 4.0;
/// Decibels over the mean signal strength that count as 1.
const RSSI_DB: f32 = 10.0;
/// Largest distance from the mean signal strength, in these units.
const MOST_RSSI: f32 = 2.0;
/// Time over which the mean signal strength is taken, us: longer than an interaction, so that the mean does not follow it.
const MEAN_US: f32 = 5e6;

/// Makes features of one frame after the other. Nothing is allocated once all tags have been seen.
#[derive(Debug, Clone)]
pub struct FrameFeatures {
    antennas: usize,
    /// Virtual antennas of the covariance, where it is wanted.
    virtual_antennas: Option<usize>,
    /// By tag, then by antenna.
    strengths: Vec<Strength>,
    /// What signal strengths are told over, dBm; `None` is each tag's own mean of late.
    usual_dbm: Option<f32>,
    maps: Vec<u8>,
    scalars: [f32; SCALARS],
    reads: Vec<f32>,
    covariance: Vec<f32>,
}

/// Signal strength of a tag at an antenna of late.
#[derive(Debug, Clone, Copy, Default)]
struct Strength {
    mean_dbm: f32,
    /// Frames in the mean, and when the last one ended.
    frames: u32,
    last: BridgeTime,
}

impl Strength {
    /// Takes the strength in a frame that ended at `now`. Returns by how much it is over the mean of the frames before.
    fn over_mean(&mut self, dbm: f32, now: BridgeTime) -> f32 {
        let over = if self.frames == 0 { 0.0 } else { dbm - self.mean_dbm };
        self.frames = self.frames.saturating_add(1);
        let us = now.since(self.last) as f32;
        // At first all frames count alike.
        let gain = (us / (us + MEAN_US)).max(1.0 / self.frames as f32);
        self.mean_dbm = if self.frames == 1 { dbm } else { self.mean_dbm + gain * over };
        self.last = now;
        over
    }
}

impl FrameFeatures {
    /// Features of the first `antennas` of the reader, and of the covariance of `virtual_antennas` where it is wanted.
    pub fn new(antennas: usize, virtual_antennas: Option<usize>) -> Self {
        Self {
            antennas,
            virtual_antennas,
            strengths: Vec::new(),
            usual_dbm: None,
            maps: Vec::new(),
            scalars: [0.0; SCALARS],
            reads: Vec::new(),
            covariance: vec![0.0; virtual_antennas.map_or(0, |n| n * n)],
        }
    }

    /// The same, with signal strengths over `usual_dbm` for all tags: for recordings too short for a mean.
    pub fn over(self, usual_dbm: f32) -> Self {
        Self { usual_dbm: Some(usual_dbm), ..self }
    }

    /// The features of the next frame, of as many points and tags as it has. All of them are finite.
    pub fn frame(&mut self, frame: &AlignedFrame) -> Frame<'_> {
        self.maps.clear();
        for name in MapName::ALL {
            // What is no number becomes 0.
            self.maps.extend(frame.map(name).iter().map(|&value| (value * 255.0 + 0.5) as u8));
        }
        self.scalars = scalars(frame);
        self.watch(frame);
        if self.virtual_antennas.is_some() {
            normalise(frame.covariance.as_ref(), &mut self.covariance);
        }
        let Self { maps, scalars, reads, covariance, .. } = self;
        Frame { maps, scalars, reads, covariance }
    }

    /// Takes the reads of a frame that nobody asks for, as of the time before a sample begins: what is usual for each tag.
    pub fn watch(&mut self, frame: &AlignedFrame) {
        let tags = frame.phases().tags();
        self.strengths.resize(tags * self.antennas, Strength::default());
        self.reads.clear();
        self.reads.resize(tags * self.antennas * READ_CHANNELS, 0.0);
        let cells = self.reads.chunks_exact_mut(READ_CHANNELS).zip(&mut self.strengths).enumerate();
        for (cell, (values, strength)) in cells {
            let (tag, antenna) = (cell / self.antennas, cell % self.antennas);
            if let Some(turned) = frame.phase(tag, antenna).ok().filter(|turned| turned.is_finite()) {
                values[read::DIFFERENCE] = turned / PI;
                values[read::KNOWN] = 1.0;
            }
            let sighting = frame.sighting(tag, antenna);
            if let Some(turn) = sighting.turn.filter(|turn| turn.is_finite()) {
                (values[read::TURN], values[read::TURN + 1]) = turn.sin_cos();
            }
            values[read::READS] = (sighting.reads as f32 / MOST_READS).min(1.0);
            if let Some(dbm) = sighting.rssi_dbm.filter(|dbm| dbm.is_finite()) {
                let over = match self.usual_dbm {
                    Some(usual_dbm) => dbm - usual_dbm,
                    None => strength.over_mean(dbm, frame.end),
                } / RSSI_DB;
                values[read::RSSI] = over.clamp(-MOST_RSSI, MOST_RSSI);
            }
        }
    }
}

fn scalars(frame: &AlignedFrame) -> [f32; SCALARS] {
    let mut scalars = [0.0; SCALARS];
    for (valid, name) in scalars[scalar::VALID..scalar::VALID + MAPS].iter_mut().zip(MapName::ALL) {
        *valid = f32::from(u8::from(frame.invalid(name).is_none()));
    }
    scalars[scalar::PEAK] = frame.peak_db.filter(|db| db.is_finite()).unwrap_or(0.0) / PEAK_DB;
    scalars[scalar::CELLS] = (1.0 + frame.moving_cells.unwrap_or(0) as f32).log2() / CELLS_OCTAVES;
    scalars[scalar::PRESENT] = f32::from(u8::from(frame.sent));
    scalars
}

/// Moving cells of a frame with these scalars; 0 where the radar did not send it.
pub fn moving_cells(scalars: &[f32]) -> u32 {
    ((scalars[scalar::CELLS] * CELLS_OCTAVES).exp2() - 1.0).round() as u32
}

/// Brings a covariance to a mean power of 1; all to 0 where there is none, or one of another array.
fn normalise(covariance: Option<&Covariance>, out: &mut [f32]) {
    out.fill(0.0);
    let Some(covariance) = covariance.filter(|covariance| covariance.packed.len() == out.len()) else {
        return;
    };
    let antennas = usize::from(covariance.antennas);
    // Row i begins with its diagonal element and has two numbers for each of those after it.
    let row_lengths = (0..antennas).map(|row| 2 * (antennas - row) - 1);
    let diagonal = row_lengths.scan(0, |begin, length| Some(std::mem::replace(begin, *begin + length)));
    let power: f32 = diagonal.filter_map(|place| covariance.packed.get(place)).sum();
    let scale = antennas as f32 / power;
    let finite = covariance.packed.iter().all(|x| (x * scale).is_finite());
    if power > 0.0 && finite {
        for (out, x) in out.iter_mut().zip(&covariance.packed) {
            *out = x * scale;
        }
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::config::BridgeConfig;

    use super::*;

    fn covariance(antennas: u8, packed: &[f32]) -> Covariance {
        Covariance { frame: 0, antennas, packed: packed.iter().copied().collect() }
    }

    #[test]
    fn a_covariance_has_a_mean_power_of_one() {
        let mut out = [9.0; 9];
        let packed = [2.0, 1.0, -1.0, 0.5, 0.25, 4.0, 3.0, 1.5, 6.0];
        normalise(Some(&covariance(3, &packed)), &mut out);
        assert_eq!((out[0], out[5], out[8]), (0.5, 1.0, 1.5));
        assert_eq!(out[1], 0.25);
        for wrong in [covariance(2, &packed[..4]), covariance(3, &[0.0; 9]), covariance(3, &[f32::NAN; 9])] {
            normalise(Some(&wrong), &mut out);
            assert_eq!(out, [0.0; 9]);
        }
    }

    #[test]
    fn moving_cells_come_back() {
        let mut scalars = [0.0; SCALARS];
        for cells in [0, 1, 2, 3, 6, 100, 1_000, 4_096] {
            scalars[scalar::CELLS] = (1.0 + cells as f32).log2() / CELLS_OCTAVES;
            assert_eq!(moving_cells(&scalars), cells);
        }
    }

    #[test]
    fn strength_is_over_the_mean_of_the_frames_before() {
        let mut strength = Strength::default();
        let mut over = |frame: u64, dbm: f32| strength.over_mean(dbm, BridgeTime(frame * 100_000));
        assert_eq!(over(100, -50.0), 0.0);
        for frame in 101..200 {
            assert!(over(frame, -50.0).abs() < 1e-3);
        }
        assert!((over(200, -60.0) + 10.0).abs() < 1e-3);
        for frame in 201..500 {
            over(frame, -60.0);
        }
        assert!(over(500, -60.0).abs() < 0.1, "the mean has followed");
    }

    #[test]
    fn a_frame_that_nobody_sent_is_zero() {
        let settings = crate::features::Settings {
            points: 16,
            angles: crate::features::AngleMap::None,
            antennas: 2,
            covariance: true,
        };
        let radar = BridgeConfig::default().radar;
        let mut stream = crate::align::FrameStream::new(settings.stream(&radar).unwrap()).unwrap();
        for ms in 0..5 {
            stream.advance(BridgeTime(100_000 * ms));
        }
        let frame = stream.next().unwrap();
        let mut features = settings.frame_features(&radar);
        let Frame { maps, scalars, reads, covariance } = features.frame(&frame);
        assert!(maps.len() == 3 * 16 * 16 && maps.iter().all(|x| *x == 0));
        assert!(scalars.iter().chain(covariance).all(|x| *x == 0.0) && covariance.len() == 144);
        assert!(reads.is_empty());
        assert_eq!(frame.invalid(MapName::Angle).unwrap().reason(), "left_out");
    }
}
