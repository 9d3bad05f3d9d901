//! The radar's part: facets to paths, paths to spectra or samples, spectra to maps.
//!
//! ```text
//! vertices at the begin, middle and end of a frame's chirps
//!   --> [view]: what hides what --> [paths]: one path for each facet in sight, more by way of walls
//!   --> [spectrum]: into the few range bins that it reaches, for each chirp and antenna --> cube --> [maps]
//!   or [samples]: the ADC's words, chirp by chirp, as a DCA1000 sends them
//! ```
//!
//! Phases follow the whole way of each path, quadratic in time over a frame; levels follow the radar equation
//! (`front_end.rs`). Both forms share paths, geometry and noise; they differ by what `kernel.rs` leaves out,
//! and in that samples are words, rounded and clipped, where the other form has rounding as noise and no limit.
//! Not simulated: interference, specular highlights, second bounces, coupling between transmitter and receiver, echoes
//! past the profile's range span, which the receiver's filter takes.

mod chirps;
mod front_end;
mod kernel;
mod maps;
mod paths;
mod samples;
mod spectrum;
#[cfg(test)]
mod tests;
mod view;
mod way;

use core::f32::consts::SQRT_2;

use glam::{Mat3, Vec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rfhoi_firmware::dca1000::samples::FULL_SCALE;
use rfhoi_firmware::simulated::Noise;
use rfhoi_shared::config::{Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::SampleFormat;

use super::effects::Effects;
use super::scene::Scene;
use super::{Performance, Surface};
use chirps::Chirps;
use front_end::FrontEnd;
pub use maps::FrameMaps;
use maps::Mapper;
use paths::Moving;
pub use paths::Path;
use samples::Samples;
use spectrum::Spectrum;
use view::View;

/// Why there is no radar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RadarError {
    /// The profile has no antenna geometry.
    #[error(
        "this profile's antennas have no known positions (several transmitters at once, or one that the board does not have)"
    )]
    Geometry,
}

/// A simulated radar in a scene.
pub struct Radar {
    config: RadarConfig,
    effects: Effects,
    front_end: FrontEnd,
    chirps: Chirps,
    position: Vec3,
    axes: Mat3,
    /// Mirror images of the radar in the room's walls, in its own axes, with their reflectivity.
    mirrors: Vec<(Vec3, f32)>,
    /// Furniture in the radar's axes.
    furniture: (Surface, Vec<Vec3>),
    /// Paths of what does not move.
    still: Vec<Path>,
    background: View,
    view: View,
    paths: Vec<Path>,
    spectrum: Spectrum,
    /// Only where samples were asked for.
    samples: Option<Samples>,
    mapper: Mapper,
    jitter: Noise,
    thermal: Noise,
    vertices: [Vec<Vec3>; 3],
}

impl Radar {
    /// The radar of `scene` with these effects.
    ///
    /// # Errors
    /// If the profile has no antenna geometry.
    pub fn new(scene: &Scene, effects: Effects) -> Result<Self, RadarError> {
        let profile = scene.radar.profile.clone();
        let chirps = Chirps::new(&profile).ok_or(RadarError::Geometry)?;
        let gate = scene.gate();
        let processing = Processing::with_gate(&profile, gate);
        let config = RadarConfig { profile, input: RadarInput::Uart, processing };
        let axes = scene.radar.axes();
        let position = scene.radar.position;
        let to_radar = |p: Vec3| axes * (p - position);
        let (surface, vertices) = scene.fixtures();
        Ok(Self {
            front_end: FrontEnd::new(&config.profile, effects.pattern),
            position,
            axes,
            mirrors: scene
                .room
                .images(position)
                .into_iter()
                .map(|image| (to_radar(image), scene.room.reflectivity))
                .collect(),
            furniture: (surface, vertices.into_iter().map(to_radar).collect()),
            still: Vec::new(),
            background: View::empty(),
            view: View::empty(),
            paths: Vec::new(),
            spectrum: Spectrum::new(&chirps, gate),
            samples: None,
            mapper: Mapper::new(&config),
            jitter: Noise::new(0, 1.0),
            thermal: Noise::new(0, 1.0),
            vertices: Default::default(),
            chirps,
            effects,
            config,
        })
    }

    /// The profile and what the bridge makes of it.
    pub fn config(&self) -> &RadarConfig {
        &self.config
    }

    /// Begins a sample: `fixtures` stand in the room besides its furniture, `rng` seeds all noise.
    pub fn begin(&mut self, fixtures: Option<(&Surface, &[Vec3])>, rng: &mut ChaCha8Rng) {
        self.jitter = Noise::new(rng.next_u64(), 1.0);
        self.thermal = Noise::new(rng.next_u64(), 1.0);
        self.mapper.begin(&self.config);
        let fixtures = fixtures.map(|(surface, vertices)| {
            (surface.clone(), vertices.iter().map(|&p| self.to_radar(p)).collect::<Vec<_>>())
        });
        let all = || [Some(&self.furniture), fixtures.as_ref()].into_iter().flatten();
        self.background = View::empty();
        if self.effects.occlusion {
            for (surface, vertices) in all() {
                self.background.draw(vertices, &surface.triangles);
            }
        }
        let mut still = Vec::new();
        if self.effects.clutter {
            let view = self.effects.occlusion.then_some(&self.background);
            for (surface, vertices) in all() {
                Moving::still(surface, vertices).direct(&self.front_end, view, &mut still);
            }
            for &mirror in &self.mirrors {
                paths::wall(&self.front_end, mirror, &mut still);
            }
            let span_m = self.config.profile.range_span().0;
            still.retain(|p| p.half_m[1] < span_m);
        }
        self.spectrum.keep_still(&self.chirps, &still);
        self.still = still;
        self.samples = None;
    }

    fn to_radar(&self, point: Vec3) -> Vec3 {
        self.axes * (point - self.position)
    }

    /// Takes the frame that begins at `time_s` into view: the paths of all that moves. [`Self::maps`] and
    /// [`Self::chirp`] are about this frame.
    pub fn look(&mut self, performance: &dyn Performance, time_s: f64) -> &[Path] {
        for (i, vertices) in self.vertices.iter_mut().enumerate() {
            performance.vertices(time_s + self.chirps.active_s * i as f64 / 2.0, vertices);
            for p in vertices {
                *p = self.axes * (*p - self.position);
            }
        }
        let [begin, middle, end] = &self.vertices;
        let surface = performance.surface();
        let moving = Moving { surface, vertices: [begin, middle, end] };
        let view = self.effects.occlusion.then(|| {
            self.view.copy_from(&self.background);
            self.view.draw(middle, &surface.triangles);
            &self.view
        });
        self.paths.clear();
        moving.direct(&self.front_end, view, &mut self.paths);
        if self.effects.images {
            for &mirror in &self.mirrors {
                moving.by_wall(&self.front_end, view, mirror, &mut self.paths);
            }
        }
        let span_m = self.config.profile.range_span().0;
        self.paths.retain(|p| p.half_m.iter().all(|&m| m < span_m));
        &self.paths
    }

    /// Paths of what does not move.
    pub fn still(&self) -> &[Path] {
        &self.still
    }

    /// The frame in view straight through its range spectra to the maps that the bridge makes.
    pub fn maps(&mut self) -> FrameMaps {
        let Self { spectrum, chirps, paths, jitter, thermal, front_end, effects, mapper, config, .. } = self;
        spectrum.sum(chirps, paths);
        // Of a transform of N samples, a bin has 1/N of their noise; rounding adds that of a word's last bit.
        let rounding = if effects.quantisation { ROUNDING } else { 0.0 };
        let thermal_noise = if effects.thermal_noise { front_end.noise } else { 0.0 };
        // The bridge doubles real samples, half of whose power is at negative frequencies; their noise has no second part.
        let real = if config.profile.format == SampleFormat::Real { SQRT_2 } else { 1.0 };
        let deviation =
            real * libm::sqrtf((thermal_noise * thermal_noise + rounding * rounding) / chirps.samples as f32);
        mapper.frame(|cube| {
            let jitter = effects.phase_noise.then_some(jitter);
            let thermal = (deviation > 0.0).then_some((thermal, deviation));
            spectrum.store(chirps, jitter, thermal, cube);
        })
    }

    /// Writes chirp `index` of the frame in view, all receivers, as the LVDS link carries it, to `out`, which is as
    /// long as a chirp's bytes. The ADC rounds and clips whatever the switch says: there are only words.
    pub fn chirp(&mut self, index: u32, out: &mut [u8]) {
        self.chirp_samples(index);
        let Self { samples, chirps, config, effects, thermal, front_end, .. } = self;
        let thermal = effects.thermal_noise.then_some((thermal, front_end.noise));
        if let Some(samples) = samples {
            samples.pack(chirps, config.profile.format, thermal, out);
        }
    }

    /// The samples of chirp `index` of the frame in view, receiver by receiver, relative to full scale: before thermal noise
    /// and ADC.
    pub fn chirp_samples(&mut self, index: u32) -> &[num_complex::Complex32] {
        let Self { samples, chirps, paths, still, jitter, effects, .. } = self;
        let jitter_hz = if effects.phase_noise { jitter.draw() * front_end::CARRIER_JITTER_HZ } else { 0.0 };
        let samples = samples.get_or_insert_with(|| Samples::new(chirps, still));
        samples.chirp(chirps, paths, index as usize, jitter_hz)
    }
}

/// Standard deviation of rounding to a word, of full scale: the step over the square root of 12.
const ROUNDING: f32 = 0.288_675_1 / FULL_SCALE;
