//! A simulated radar before point scatterers, and the DCA1000EVM behind it.

use std::collections::VecDeque;

use rfhoi::datagrams::Cutter;
use rfhoi_firmware::simulated::{Noise, Scatterer, SimulatedRadar};
use rfhoi_shared::config::{BridgeConfig, Processing, RadarConfig};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::BridgeTime;

/// Range bin of the wall in [`Measurement::hand_before_wall`].
pub const WALL_BIN: usize = 60;

/// A profile whose frames are short, for tests of many: 48 chirps in 3.4 ms, 50 times a second, 67.5 datagrams each.
pub fn short_frames() -> RadarProfile {
    RadarProfile { loops: 16, frame_period_us: 20_000, ..RadarProfile::bridge() }
}

/// Raw samples of `profile`, gated to 3.05 m or what the profile sees, the rest by default.
pub fn configuration(profile: RadarProfile) -> RadarConfig {
    let gate = profile.gate_to(Scene::default().depth);
    let processing = Processing::with_gate(&profile, gate);
    RadarConfig { profile, input: BridgeConfig::default().radar.input, processing }
}

/// A point straight ahead.
pub fn point(range_m: f64, velocity_m_s: f64, amplitude: f64) -> Scatterer {
    Scatterer { range_m, velocity_m_s, azimuth_rad: 0.0, elevation_rad: 0.0, amplitude }
}

/// What the radar is, sees and does.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// What it is programmed with.
    pub profile: RadarProfile,
    /// What it sees.
    pub scatterers: Vec<Scatterer>,
    /// Frames until it stops.
    pub frames: u32,
    /// Start of the first frame.
    pub start: BridgeTime,
    /// Standard deviation of the noise, ADC words.
    pub noise: f32,
    /// Seed of the noise.
    pub seed: u64,
}

/// Samples of one chirp.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chirp {
    /// Number of its frame.
    pub frame: u32,
    /// Number in its frame.
    pub index: u32,
    /// When it ended.
    pub time: BridgeTime,
    /// Words of all receivers.
    pub bytes: Vec<u8>,
}

impl Measurement {
    /// A hand that recedes at 3 Doppler bins before a wall at bin [`WALL_BIN`], in [`short_frames`].
    pub fn hand_before_wall(frames: u32) -> Self {
        let profile = short_frames();
        let velocity = 3.0 * f64::from(profile.velocity_bin().0);
        let wall_m = f64::from(WALL_BIN as u16) * f64::from(profile.range_bin().0);
        let scatterers = vec![point(0.6, velocity, 0.05), point(wall_m, 0.0, 0.3)];
        Self { profile, scatterers, frames, start: BridgeTime(1_000), noise: 2.0, seed: 1 }
    }

    /// Range and Doppler bin (as a column) of scatterer `number` in the middle of `frame`.
    pub fn cell(&self, number: usize, frame: u32) -> (f64, usize) {
        let Self { profile, scatterers, .. } = self;
        let Scatterer { range_m, velocity_m_s, .. } = scatterers[number];
        let active_s = profile.chirp_period_ns() as f64 * 1e-9 * f64::from(profile.chirps_per_frame());
        let time_s = f64::from(frame) * f64::from(profile.frame_period_us) * 1e-6 + active_s / 2.0;
        let range = (range_m + velocity_m_s * time_s) / f64::from(profile.range_bin().0);
        let doppler = (velocity_m_s / f64::from(profile.velocity_bin().0)).round();
        (range, (f64::from(profile.loops / 2) + doppler) as usize)
    }

    /// The chirps in the order of time.
    ///
    /// # Panics
    /// If the profile is invalid or its antennas have no geometry.
    pub fn chirps(&self) -> impl Iterator<Item = Chirp> + use<> {
        let Self { profile, scatterers, frames, start, noise, seed } = self.clone();
        let mut radar = SimulatedRadar::new(&profile).expect("a valid profile with known antennas");
        let mut noise = Noise::new(seed, noise);
        let indices = (0..frames).flat_map({
            let chirps = profile.chirps_per_frame();
            move |frame| (0..chirps).map(move |index| (frame, index))
        });
        indices.map(move |(frame, index)| {
            let mut bytes = vec![0; profile.chirp_bytes() as usize];
            radar.chirp(&scatterers, &mut noise, frame, index, &mut bytes);
            let since_start = u64::from(frame) * u64::from(profile.frame_period_us)
                + u64::from(index + 1) * profile.chirp_period_ns() / 1_000;
            Chirp { frame, index, time: start.after(since_start), bytes }
        })
    }

    /// The recorder's datagrams with the times at which they leave. The last one leaves with the last chirp.
    pub fn datagrams(&self) -> impl Iterator<Item = (BridgeTime, Vec<u8>)> + use<> {
        Recorder {
            chirps: self.chirps(),
            cutter: Cutter::default(),
            time: self.start,
            ready: VecDeque::new(),
        }
    }
}

struct Recorder<I> {
    chirps: I,
    cutter: Cutter,
    time: BridgeTime,
    ready: VecDeque<Vec<u8>>,
}

impl<I: Iterator<Item = Chirp>> Iterator for Recorder<I> {
    type Item = (BridgeTime, Vec<u8>);

    fn next(&mut self) -> Option<Self::Item> {
        while self.ready.is_empty() {
            match self.chirps.next() {
                Some(chirp) => {
                    self.time = chirp.time;
                    self.ready.extend(self.cutter.push(&chirp.bytes).into_iter().map(|d| d.bytes));
                }
                None => self.ready.push_back(self.cutter.finish()?.bytes),
            }
        }
        self.ready.pop_front().map(|bytes| (self.time, bytes))
    }
}
