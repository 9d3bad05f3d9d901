//! Angle of arrival from the spatial covariance: MUSIC, Capon's and Bartlett's spectrum, and whether to trust them.
//!
//! In: a bridge's [`Covariance`] and the number of cells it is the mean of. Out: a map over azimuth and elevation in decibels,
//! and an [`Estimate`]: directions, and a [`Doubt`] where they are not to be trusted.
//!
//! ```text
//! Covariance --matrix--> R --eigen--> eigenvalues --order--> sources --+
//!                         |            eigenvectors --form, grid--> map, peaks --fit--> Estimate
//!                         +-----------------------------------------------------^
//! ```
//!
//! The steering vector follows from the path: an antenna at (x, y) in half wavelengths, azimuth to the right and
//! elevation upwards, is nearer to a source at direction cosines `u = sin az cos el` (right) and `w = sin el` (up), and its
//! phase is less by `pi (x u + y w)`. A line of antennas sees `u` only: the map has one row, of elevation 0.
//!
//! MUSIC only proposes directions. What is doubted is decided by whether they explain the covariance, antennas' noise and
//! snapshots given: the same for every method. Where snapshots are too few for a subspace, or signal and noise do not stand
//! apart, the spectrum is Bartlett's, and [`Estimate::method`] says so.
//!
//! The snapshots of a bridge are neighbouring range-Doppler cells, the strongest: windows make their noise neither quite white
//! from cell to cell nor independent, and a moving body is no point. [`Settings::snapshots_per_cell`] makes an effective
//! number of them, which is what orders and deviations are computed with; both stay estimates.
//!
//! Which order: simulated, two sources 40 degrees apart at 0 dB in an antenna, 16 snapshots: MDL counts two in 99 of 100 draws
//! with forward-backward averaging, AIC in 87, and more in the others; at -5 dB MDL in 76 with averaging and in 30 without
//! (the table is `rates.rs`). Hence MDL, with averaging.
//!
//! Decomposition: nalgebra, of fixed size, which allocates nothing. For 12 antennas, on one core of a machine in use: real
//! nalgebra 11 us, faer 16 us; complex 19 us and 19 us.

mod doubt;
mod eigen;
mod estimate;
mod fit;
mod form;
mod geometry;
mod grid;
mod judge;
mod matrix;
mod order;
mod peaks;
#[cfg(test)]
mod rates;
mod settings;
#[cfg(test)]
mod tests;

pub use doubt::Doubt;
pub use estimate::{Direction, Estimate};
pub use matrix::hermitian;
pub use settings::{Guards, MAX_PEAKS, Method, Order, Settings, SettingsError, Subarray};

use num_complex::Complex64;
use rfhoi_shared::radar::{MAX_VIRTUAL, RadarProfile};
use rfhoi_shared::wire::Covariance;

use eigen::Eigen;
use form::Form;
use geometry::{Geometry, Matrix};
use grid::{Decibels, Grid};

/// Share of the mean eigenvalue below which eigenvalues are rounding of the f32 numbers that travel.
const ROUNDING: f64 = 1e-6;

/// Estimates angles of one profile; allocates only when it is made.
#[derive(Debug, Clone)]
pub struct Estimator {
    settings: Settings,
    geometry: Geometry,
    /// The array of a subarray, and where it is in the whole one; the array itself where nothing is smoothed.
    part: Geometry,
    places: Vec<[usize; MAX_VIRTUAL]>,
    grid: Grid,
    form: Form,
    full: Matrix,
    smoothed: Matrix,
    map: Vec<f32>,
}

/// How many sources, by which method.
#[derive(Debug, Clone, Copy)]
struct Plan {
    method: Method,
    order: usize,
    gap_db: f64,
    /// Mean eigenvalue of noise.
    noise: f64,
    doubt: Option<Doubt>,
}

/// The stochastic Cramer-Rao bound: least standard deviation, degrees on the sphere, of the direction of a source at `azimuth`
/// and `elevation` (radians) of `snr` (power over white noise in an antenna) in `snapshots` independent snapshots.
///
/// # Errors
/// If the profile's array has no geometry or no azimuth.
pub fn bound_deg(
    profile: &RadarProfile,
    (azimuth, elevation): (f64, f64),
    snr: f64,
    snapshots: f64,
) -> Result<f64, SettingsError> {
    let direction = (azimuth.sin() * elevation.cos(), elevation.sin());
    let bound = fit::bound_deg(&Geometry::of(profile)?, &[direction], &[snr], snapshots);
    Ok(bound.map_or(f64::INFINITY, |bound| bound[0]))
}

impl Estimator {
    /// An estimator for the antennas of `profile`.
    ///
    /// # Errors
    /// If the profile has no geometry or no azimuth, or the settings do not fit it.
    pub fn new(profile: &RadarProfile, settings: Settings) -> Result<Self, SettingsError> {
        let geometry = Geometry::of(profile)?;
        let (part, places) = match settings.smoothing {
            None => (geometry.clone(), Vec::new()),
            Some(subarray) => {
                let found = geometry.rectangles(subarray).filter(|(part, _)| part.span().0 > 0);
                found.ok_or(SettingsError::NoSubarray(subarray.columns, subarray.rows))?
            }
        };
        settings.validate(part.count)?;
        if settings.forward_backward && part.opposite.is_none() {
            return Err(SettingsError::NotSymmetric);
        }
        let grid = Grid::new(settings.points, settings.half_span_deg, part.span());
        let map = vec![f32::NAN; grid.azimuth_deg.len() * grid.elevation_deg.len()];
        let form = Form::new(&part);
        let (full, smoothed) = (Matrix::default(), Matrix::default());
        Ok(Self { settings, geometry, part, places, grid, form, full, smoothed, map })
    }

    /// Azimuths of the map's columns, degrees to the right, rising.
    pub fn azimuth_deg(&self) -> &[f32] {
        &self.grid.azimuth_deg
    }

    /// Elevations of the map's rows, degrees upwards, rising; a single 0 where the array cannot tell.
    pub fn elevation_deg(&self) -> &[f32] {
        &self.grid.elevation_deg
    }

    /// The latest map, dB: rows of rising elevation, columns of rising azimuth. Bartlett's and Capon's relative to a full-scale
    /// tone, MUSIC's relative to a direction within the noise subspace. Not a number where there was no covariance.
    pub fn map_db(&self) -> &[f32] {
        &self.map
    }

    /// Writes the latest map's maximum over elevation to `row`, by azimuth, as far as it reaches.
    pub fn azimuth_row(&self, row: &mut [f32]) {
        row.fill(f32::NAN);
        for map in self.map.chunks_exact(self.grid.azimuth_deg.len()) {
            for (most, &level) in row.iter_mut().zip(map) {
                *most = most.max(level);
            }
        }
    }

    /// Estimates each range's angles: `covariances` of cells of a range each and their numbers of snapshots, in the order of
    /// the rows of `map_db` (range x azimuth, [`azimuth_row`](Self::azimuth_row) of each). `each` gets every estimate.
    pub fn range_azimuth<'c>(
        &mut self,
        covariances: impl IntoIterator<Item = (&'c Covariance, u32)>,
        map_db: &mut [f32],
        mut each: impl FnMut(usize, &Estimate),
    ) {
        map_db.fill(f32::NAN);
        let rows = map_db.chunks_exact_mut(self.grid.azimuth_deg.len());
        for (range, (row, (covariance, snapshots))) in rows.zip(covariances).enumerate() {
            let estimate = self.estimate(covariance, snapshots);
            self.azimuth_row(row);
            each(range, &estimate);
        }
    }

    /// Estimates the directions in `covariance`, the mean over `snapshots` range-Doppler cells, and leaves the map.
    pub fn estimate(&mut self, covariance: &Covariance, snapshots: u32) -> Estimate {
        let power = match matrix::unpack(&self.geometry, covariance, &mut self.full) {
            Ok(power) => power,
            Err(doubt) => return self.nothing(doubt),
        };
        if snapshots == 0 {
            return self.nothing(Doubt::TooFewSnapshots);
        }
        let (n, snapshots) = (self.part.count, f64::from(snapshots) * self.settings.snapshots_per_cell);
        let matrix = if self.places.is_empty() {
            &self.full
        } else {
            matrix::smooth(&self.full, &self.places, n, &mut self.smoothed);
            &self.smoothed
        };
        let opposite = self.part.opposite.as_ref().filter(|_| self.settings.forward_backward);
        let Some(mut eigen) = eigen::decompose(matrix, n, opposite) else {
            return self.nothing(Doubt::NotPositive);
        };
        if eigen.values[n - 1] < -1e-3 * n as f64 {
            return self.nothing(Doubt::NotPositive);
        }
        let floor = if self.settings.guards.is_some() { ROUNDING } else { 0.0 };
        // A subarray may see more power or less than the whole array does.
        let loading = self.settings.loading * eigen.values[..n].iter().sum::<f64>() / n as f64;
        for value in &mut eigen.values[..n] {
            *value = (*value + loading).max(floor);
        }
        let plan = self.plan(&eigen.values[..n], loading, snapshots);
        let decibels = self.spectrum(plan, &eigen, power);
        self.grid.map(&self.form, decibels, &mut self.map);
        let inverse = plan.method != Method::Bartlett;
        let peaks = peaks::find(&self.grid, &self.form, &self.map, inverse, plan.order);
        self.judge(plan, &peaks, decibels, snapshots)
    }

    fn nothing(&mut self, doubt: Doubt) -> Estimate {
        self.map.fill(f32::NAN);
        Estimate::nothing(self.settings.method, doubt)
    }

    /// Chooses order and method by eigenvalues to which `loading` is added.
    fn plan(&self, eigenvalues: &[f64], loading: f64, snapshots: f64) -> Plan {
        let Settings { method, forward_backward, order, largest_order, .. } = self.settings;
        let n = eigenvalues.len();
        let mut seen = order::select(order, eigenvalues, snapshots, forward_backward);
        if let Some(guards) = &self.settings.guards {
            let least = eigenvalues[0] * 10f64.powf(-guards.dynamic_range_db / 10.0);
            seen = seen.min(eigenvalues.iter().filter(|&&v| v > least).count());
        }
        let gap = |k: usize| 10.0 * (eigenvalues[k - 1] / eigenvalues[k].max(f64::MIN_POSITIVE)).log10();
        let order = seen.clamp(1, largest_order);
        let mean = |k: usize| eigenvalues[k..].iter().sum::<f64>() / (n - k) as f64;
        let noise = |k: usize| (mean(k) - loading).max(0.0);
        let plan = Plan { method, order, gap_db: gap(order), noise: noise(order), doubt: None };
        let Some(guards) = self.settings.guards else { return plan };
        let samples = if forward_backward { 2.0 * snapshots } else { snapshots };
        let fall_back =
            |doubt| Plan { method: Method::Bartlett, order: 1, gap_db: gap(1), noise: noise(1), doubt };
        if samples < guards.snapshots_per_antenna * n as f64 {
            // One source at most, of which the fit tells whether it is all.
            return fall_back(None);
        }
        if seen == 0 || plan.gap_db < guards.gap_db {
            return fall_back(Some(Doubt::NoGap));
        }
        // Fewer eigenvalues of noise are less than they should be, the more sources took from it.
        Plan { noise: plan.noise / (1.0 - order as f64 / samples), ..plan }
    }

    /// Makes the form of the method; returns what its values mean.
    fn spectrum(&mut self, plan: Plan, eigen: &Eigen, power: f64) -> Decibels {
        let n = self.part.count;
        let antennas = n as f64;
        let matrix = if self.places.is_empty() { &self.full } else { &self.smoothed };
        let mut q = Matrix::default();
        let mut add = |weight: f64, vector: &[Complex64]| {
            for (i, x) in vector.iter().enumerate() {
                let x = x * weight;
                for (q, y) in q[i][i..].iter_mut().zip(&vector[i..]) {
                    *q += x * y.conj();
                }
            }
        };
        let power_db = 10.0 * power.log10() as f32;
        match plan.method {
            Method::Bartlett => {
                self.form.set(&self.part, matrix);
                // The form is at most N^2 times the mean power.
                let scale = (antennas * antennas).recip() as f32;
                Decibels { scale, offset_db: power_db, inverse: false }
            }
            Method::Music => {
                for vector in &eigen.vectors[..plan.order] {
                    add(-1.0, &vector[..n]);
                }
                for (i, row) in q.iter_mut().enumerate().take(n) {
                    row[i] += 1.0;
                }
                self.form.set(&self.part, &q);
                Decibels { scale: antennas.recip() as f32, offset_db: 0.0, inverse: true }
            }
            Method::Capon => {
                // In units of the least eigenvalue: the form is at most N.
                let least = eigen.values[n - 1].max(f64::MIN_POSITIVE);
                for (value, vector) in eigen.values.iter().zip(&eigen.vectors).take(n) {
                    add(least / value.max(least), &vector[..n]);
                }
                self.form.set(&self.part, &q);
                let offset_db = power_db + 10.0 * (least / antennas).log10() as f32;
                Decibels { scale: antennas.recip() as f32, offset_db, inverse: true }
            }
        }
    }
}
