//! Both maps of a frame.

use rfhoi_shared::config::RadarConfig;

use super::flaw::{Flaw, MapState};
use super::raw::{RawFrame, RawMaps};
use super::resample::{Levels, PointsOutside, Resampler};
use crate::receive::{HeatMap, RadarFrame};

/// Share of words at the ADC's limits above which a frame is clipped. A tone over full scale by a tenth of a decibel is at
/// the limits for a tenth of the time.
const MAX_CLIPPED: f32 = 1e-3;
/// Share of chirps lost above which a frame's side lobes stand out: those of losses at random are at `p / (N (1 - p))` of an
/// echo's power, N chirps. Up to here an echo 10 dB below the strongest one of its range keeps its level to within 3 dB (the
/// stability case `frame-holes`).
const MAX_CHIRPS_LOST: f32 = 1.0 / 6.0;
/// A range-time cell is a mean over more draws of noise than a range-Doppler cell, and has not the gain of the
/// Doppler FFT: half as many decibels over the noise are as sure a sign.
const TIME_RISE: f32 = 0.5;

/// What is known of both maps of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairState {
    /// Of range x Doppler.
    pub range_doppler: MapState,
    /// Of range x time.
    pub range_time: MapState,
}

/// Squares of the range-Doppler and the range-time map of each frame.
#[derive(Debug, Clone)]
pub struct MapPair {
    range_doppler: Resampler,
    range_time: Resampler,
    first_bin: u16,
    chirps: u32,
    /// Words of a chirp.
    chirp_words: u32,
}

impl MapPair {
    /// For frames of `config`, to squares of `points` a side.
    ///
    /// # Errors
    /// If there cannot be so few or many points.
    pub fn new(config: &RadarConfig, points: usize) -> Result<Self, PointsOutside> {
        let RadarConfig { profile, processing, .. } = config;
        let rows = processing.gate.bins.into();
        let rise = processing.detection.0;
        Ok(Self {
            range_doppler: Resampler::new(rows, profile.loops.into(), points, rise)?,
            range_time: Resampler::new(rows, processing.range_time_columns.into(), points, rise * TIME_RISE)?,
            first_bin: processing.gate.first,
            chirps: profile.chirps_per_frame(),
            chirp_words: profile.chirp_bytes() / 2,
        })
    }

    /// Writes the squares of a frame that came over the wire.
    pub fn frame(
        &mut self,
        frame: &RadarFrame,
        range_doppler: &mut [f32],
        range_time: &mut [f32],
    ) -> PairState {
        let account = match &frame.info {
            // A radar's own maps over UART know of no chirps.
            Some(info) if info.chirps == 0 => None,
            Some(info) => self.account(info.clipped, info.chirps_lost),
            None => Some(Flaw::Unaccounted),
        };
        let first_bin = self.first_bin;
        let of = |resampler: &mut Resampler, map: &Option<HeatMap>, out: &mut [f32]| match map {
            Some(map) if map.gate.first == first_bin => resampler.map(Levels::Codes(map), out),
            other => {
                out.fill(0.0);
                MapState::none(if other.is_none() { Flaw::Missing } else { Flaw::Shape })
            }
        };
        PairState {
            range_doppler: of(&mut self.range_doppler, &frame.range_doppler, range_doppler),
            range_time: of(&mut self.range_time, &frame.range_time, range_time),
        }
        .with(account)
    }

    /// Writes the squares of a frame of raw samples.
    pub fn raw(
        &mut self,
        maps: &RawMaps,
        frame: RawFrame,
        range_doppler: &mut [f32],
        range_time: &mut [f32],
    ) -> PairState {
        PairState {
            range_doppler: self.range_doppler.map(Levels::Powers(maps.range_doppler()), range_doppler),
            range_time: self.range_time.map(Levels::Powers(maps.range_time()), range_time),
        }
        .with(self.account(frame.clipped, frame.chirps_lost))
    }

    /// What is wrong with a frame as a whole.
    fn account(&self, clipped: u32, chirps_lost: u32) -> Option<Flaw> {
        let chirps = self.chirps as f32;
        let came = self.chirps.saturating_sub(chirps_lost) as f32;
        if chirps_lost as f32 > MAX_CHIRPS_LOST * chirps {
            Some(Flaw::ChirpsLost)
        } else {
            (clipped as f32 > MAX_CLIPPED * came * self.chirp_words as f32).then_some(Flaw::Clipped)
        }
    }
}

impl PairState {
    /// Adds a flaw of the whole frame to maps that have none of their own.
    fn with(self, flaw: Option<Flaw>) -> Self {
        let of = |state: MapState| MapState { flaw: state.flaw.or(flaw), ..state };
        Self { range_doppler: of(self.range_doppler), range_time: of(self.range_time) }
    }
}
