//! The configurations among which a plan is chosen, from small to large.

use std::cmp::Ordering;

use rfhoi_shared::array::{Position, virtual_antennas};
use rfhoi_shared::radar::{MAX_LOOPS, MAX_SAMPLES, RadarProfile};
use rfhoi_shared::units::SPEED_OF_LIGHT;

use super::limits::{LEAST_SAMPLES, SAMPLE_RATE_STEP_KSPS, slopes};
use super::needs::{Needs, extent};

/// Everything that a plan decides.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// What the radar is programmed with.
    pub profile: RadarProfile,
    /// Side of the range-time and range-Doppler maps, points.
    pub map_points: u16,
    /// Side of the angle map, points.
    pub angle_points: u16,
    /// Antennas of the reader in use.
    pub antennas: u8,
}

/// Sides that a map may have (the paper's is 256).
pub const MAP_POINTS: [u16; 5] = [16, 32, 64, 128, 256];
/// Pause before a ramp, ns, at least: that of the shipped profiles; nothing shorter has been tried.
const LEAST_IDLE_NS: u32 = 5_300;
/// From the start of a ramp to the first sample, ns: that of the shipped profiles.
const ADC_START_NS: u32 = 6_000;
/// Fewest loops that are tried, half of what the stock demo takes.
const LEAST_LOOPS: u16 = 8;

/// Order of configurations of the radar: raw bytes a frame, then cells of the cube, then the time that a frame takes on
/// air in whole milliseconds, in which what moves is smeared, then the sample rate.
pub fn by_size(needs: &Needs) -> impl Fn(&RadarProfile, &RadarProfile) -> Ordering {
    move |a, b| {
        let key = |p: &RadarProfile| {
            (
                p.frame_bytes(),
                p.cube_bytes(p.gate_to(needs.depth)),
                p.frame_active_ns() / 1_000_000,
                p.sample_rate_ksps,
            )
        };
        key(a).cmp(&key(b))
    }
}

/// All of the radar's, smallest first.
pub fn profiles(needs: &Needs) -> Vec<RadarProfile> {
    let mut profiles = Vec::new();
    for array in arrays(&needs.radar) {
        for samples in powers(LEAST_SAMPLES / 2, MAX_SAMPLES) {
            for loops in powers(LEAST_LOOPS, MAX_LOOPS) {
                for slope in slopes() {
                    profiles.push(profile(needs, &array, samples, loops, slope));
                }
            }
        }
    }
    profiles.sort_by(by_size(needs));
    profiles
}

/// Powers of two from `least` to `most`.
fn powers(least: u16, most: usize) -> impl Iterator<Item = u16> {
    std::iter::successors(Some(least), |n| n.checked_mul(2)).take_while(move |&n| usize::from(n) <= most)
}

/// Antennas of `board`: all, those that keep its azimuth, its elevation, or neither, each with as few as do.
fn arrays(board: &RadarProfile) -> Vec<RadarProfile> {
    let slots = board.tx_order.len();
    let mut subsets: Vec<RadarProfile> = Vec::new();
    for transmitters in 1..1_u8 << slots {
        let tx_order = board.tx_order.iter().enumerate();
        let tx_order = tx_order.filter(|(slot, _)| transmitters & 1 << slot != 0).map(|(_, &mask)| mask);
        let tx_order: heapless::Vec<u8, _> = tx_order.collect();
        for rx_mask in (1..=board.rx_mask).filter(|mask| mask & !board.rx_mask == 0) {
            subsets.push(RadarProfile { tx_order: tx_order.clone(), rx_mask, ..board.clone() });
        }
    }
    // Fewest first; of as many, the fewest transmitters, whose chirps take time.
    subsets.sort_by_key(|p| (p.virtual_count(), p.tx_slots()));
    let azimuth = |p: &RadarProfile| extent(p, |at: Position| at.azimuth);
    let elevation = |p: &RadarProfile| extent(p, |at: Position| at.elevation);
    let (width, height) = (azimuth(board), elevation(board));
    let known = |p: &&RadarProfile| virtual_antennas(p).is_some();
    let mut arrays: Vec<RadarProfile> = Vec::new();
    for (keep_azimuth, keep_elevation) in [(false, false), (true, false), (false, true), (true, true)] {
        let keeps = |p: &&RadarProfile| {
            (!keep_azimuth || azimuth(p) == width) && (!keep_elevation || elevation(p) == height)
        };
        if let Some(array) = subsets.iter().filter(known).find(keeps)
            && !arrays.contains(array)
        {
            arrays.push(array.clone());
        }
    }
    arrays
}

/// The profile with these antennas, samples, loops and slope whose range bin and, where the pause may be longer, velocity
/// bin are as fine as needed and no finer.
///
/// The range bin is c / (2 B) for a sampled bandwidth B = slope x samples / rate (TI SWRA553), so the slope gives the time of
/// sampling, and half the samples at half the rate keep the bin. The velocity bin is lambda / (2 T M N) for M transmitters,
/// N loops and a chirp period T, which may be lengthened by the pause.
pub fn profile(needs: &Needs, array: &RadarProfile, samples: u16, loops: u16, slope: u32) -> RadarProfile {
    let bandwidth_hz = SPEED_OF_LIGHT / (2.0 * f64::from(needs.range_resolution.0));
    let sampling_s = bandwidth_hz / (f64::from(slope) * 1e12);
    let rate_ksps = f64::from(samples) / sampling_s / 1e3;
    let steps = (rate_ksps / f64::from(SAMPLE_RATE_STEP_KSPS)).floor().max(1.0);
    let sample_rate_ksps = steps as u32 * SAMPLE_RATE_STEP_KSPS;
    let sampling_ns = f64::from(samples) * 1e6 / f64::from(sample_rate_ksps);
    // Whole microseconds.
    let ramp_end_ns = ((f64::from(ADC_START_NS) + sampling_ns) / 1e3).ceil() as u32 * 1_000;
    let mut profile = RadarProfile {
        slope_khz_per_us: slope * 1_000,
        idle_ns: LEAST_IDLE_NS,
        adc_start_ns: ADC_START_NS,
        ramp_end_ns,
        samples,
        sample_rate_ksps,
        loops,
        ..array.clone()
    };
    let chirps = f64::from(profile.chirps_per_frame());
    let period_ns =
        f64::from(profile.wavelength().0) / (2.0 * chirps * f64::from(needs.velocity_resolution.0)) * 1e9;
    let idle_ns = ((period_ns - f64::from(ramp_end_ns)) / 100.0).ceil() * 100.0;
    profile.idle_ns = profile.idle_ns.max(idle_ns as u32);
    profile
}
