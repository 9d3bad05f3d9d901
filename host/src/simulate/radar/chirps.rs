//! When and where each chirp sees a path.

use core::f64::consts::{PI, TAU};

use num_complex::{Complex32, Complex64};
use rfhoi_shared::array::{Elements, Position, elements};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::SPEED_OF_LIGHT;

use super::paths::Path;

/// Geometry in space and time of a frame's chirps.
#[derive(Debug, Clone)]
pub(super) struct Chirps {
    pub(super) elements: Elements,
    pub(super) loops: usize,
    pub(super) samples: usize,
    /// Range bins to a metre.
    pub(super) bins_per_m: f32,
    /// From the first chirp of a frame to the end of its last, s.
    pub(super) active_s: f64,
    /// Phase by half a metre there and back, in the middle of a chirp, rad.
    rad_per_m: f64,
    /// Phase from sample to sample by the same, rad.
    sample_rad_per_m: f64,
}

/// Half the length of a path over the frame, `a + b x + c x^2` with x from 0 to 1, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course {
    a: f64,
    b: f64,
    c: f64,
}

impl Course {
    #[inline(always)]
    pub(super) fn of(path: &Path) -> Self {
        let [begin, middle, end] = path.half_m.map(f64::from);
        Self { a: begin, b: 4.0 * middle - 3.0 * begin - end, c: 2.0 * (begin + end) - 4.0 * middle }
    }

    /// The same in range bins by loop, of the chirps of a slot: `a + b l + c l^2`.
    #[inline(always)]
    pub(super) fn bins(&self, chirps: &Chirps, slot: usize) -> [f64; 3] {
        let (x, h) = (chirps.x(slot), 1.0 / chirps.loops as f64);
        let metres = [self.at(x), (self.b + 2.0 * self.c * x) * h, self.c * h * h];
        metres.map(|m| m * f64::from(chirps.bins_per_m))
    }

    #[inline(always)]
    pub(super) fn at(&self, x: f64) -> f64 {
        self.a + x * (self.b + x * self.c)
    }
}

impl Chirps {
    /// Chirps of a profile, or `None` where its antennas have no geometry.
    pub(super) fn new(profile: &RadarProfile) -> Option<Self> {
        let slope = f64::from(profile.slope_khz_per_us) * 1e9;
        let sample_s = 1e-3 / f64::from(profile.sample_rate_ksps);
        // The instant between the two middle samples.
        let middle_s = (f64::from(profile.samples) - 1.0) / 2.0 * sample_s;
        let to_first_hz = f64::from(profile.slope_khz_per_us) * f64::from(profile.adc_start_ns);
        let middle_hz = f64::from(profile.start_khz) * 1e3 + to_first_hz + slope * middle_s;
        Some(Self {
            elements: elements(profile)?,
            loops: profile.loops.into(),
            samples: profile.samples.into(),
            bins_per_m: 1.0 / profile.range_bin().0,
            active_s: profile.chirp_period_ns() as f64 * 1e-9 * f64::from(profile.chirps_per_frame()),
            rad_per_m: 2.0 * TAU * middle_hz / SPEED_OF_LIGHT,
            sample_rad_per_m: 2.0 * TAU * slope * sample_s / SPEED_OF_LIGHT,
        })
    }

    pub(super) fn slots(&self) -> usize {
        self.elements.transmitters.len()
    }

    pub(super) fn receivers(&self) -> usize {
        self.elements.receivers.len()
    }

    /// Share of the frame that has gone by at chirp `index`.
    pub(super) fn x(&self, index: usize) -> f64 {
        index as f64 / (self.slots() * self.loops) as f64
    }

    /// Phase in the middle of a chirp of a path of half length `half_m`, as it leaves transmitter `slot`.
    pub(super) fn phase(&self, half_m: f64, path: &Path, slot: usize) -> f64 {
        half_m * self.rad_per_m - nearer(self.elements.transmitters[slot], path.departure)
    }

    /// Phase from loop to loop at chirp `index`, and how much it grows from loop to loop.
    pub(super) fn steps(&self, course: &Course, index: usize) -> [f64; 2] {
        let (x, h) = (self.x(index), 1.0 / self.loops as f64);
        let change = course.b * h + course.c * h * (2.0 * x + h);
        [change * self.rad_per_m, 2.0 * course.c * h * h * self.rad_per_m]
    }

    /// Factor by which receiver `rx` sees a path.
    pub(super) fn receiver(&self, rx: usize, path: &Path) -> Complex32 {
        let (position, sign) = self.elements.receivers[rx];
        let z = cis(-nearer(position, path.arrival)) * f64::from(sign);
        Complex32::new(z.re as f32, z.im as f32)
    }

    /// Phase from sample to sample of a path of half length `half_m`.
    pub(super) fn sample_step(&self, half_m: f64) -> f64 {
        half_m * self.sample_rad_per_m
    }
}

/// By how much the phase is less at an antenna, rad: it is nearer to what is on its side.
fn nearer(position: Position, [right, up]: [f32; 2]) -> f64 {
    PI * (f64::from(position.azimuth) * f64::from(right) + f64::from(position.elevation) * f64::from(up))
}

pub(super) fn cis(radians: f64) -> Complex64 {
    let (sin, cos) = libm::sincos(radians);
    Complex64::new(cos, sin)
}
