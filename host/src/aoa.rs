//! Angle of arrival from the spatial covariance.
//!
//! The steering vector follows from the path: an antenna at (x, y) in half wavelengths, azimuth to the right and
//! elevation upwards, is nearer to a source at direction cosines u (right) and w (up), and its phase is less by
//! `pi (x u + y w)`.

use ndarray::{Array1, Array2};
use num_complex::Complex32;
use rfhoi_shared::array::virtual_antennas;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::wire::Covariance;

/// Bartlett's spectrum over a grid of azimuth and elevation: the power of a beam steered there.
#[derive(Debug, Clone)]
pub struct Bartlett {
    /// Azimuths, degrees, to the right.
    pub azimuth_deg: Array1<f32>,
    /// Elevations, degrees, upwards; a single 0 where the array cannot tell.
    pub elevation_deg: Array1<f32>,
    /// Steering vectors by elevation, then azimuth, then antenna.
    steering: Vec<Complex32>,
    antennas: usize,
}

impl Bartlett {
    /// A grid of `points` from -60 to 60 degrees both ways for the antennas of `profile`, or `None` where its geometry is
    /// not defined.
    pub fn new(profile: &RadarProfile, points: usize) -> Option<Self> {
        let antennas = virtual_antennas(profile)?;
        let first = antennas.first()?.position;
        let has_elevation = antennas.iter().any(|a| a.position.elevation != first.elevation);
        let azimuth_deg = Array1::<f32>::linspace(-60.0, 60.0, points);
        let elevation_deg = if has_elevation { azimuth_deg.clone() } else { Array1::zeros(1) };
        let mut steering = Vec::with_capacity(elevation_deg.len() * points * antennas.len());
        for &elevation in &elevation_deg {
            for &azimuth in &azimuth_deg {
                let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
                let (u, w) = (azimuth.sin() * elevation.cos(), elevation.sin());
                steering.extend(antennas.iter().map(|a| {
                    let (x, y) = (f32::from(a.position.azimuth), f32::from(a.position.elevation));
                    let phase = -std::f32::consts::PI * (x * u + y * w);
                    Complex32::from_polar(f32::from(a.sign), phase)
                }));
            }
        }
        Some(Self { azimuth_deg, elevation_deg, steering, antennas: antennas.len() })
    }

    /// Power by elevation and azimuth, `a^H R a / N^2`, relative to a full-scale tone; `None` where the covariance is of
    /// another array.
    pub fn spectrum(&self, covariance: &Covariance) -> Option<Array2<f32>> {
        let n = self.antennas;
        if usize::from(covariance.antennas) != n || covariance.packed.len() != n * n {
            return None;
        }
        let power = self.steering.chunks_exact(n).map(|a| {
            let mut packed = covariance.packed.iter();
            let mut next = || packed.next().copied().unwrap_or(0.0);
            let mut sum = 0.0;
            for (i, ai) in a.iter().enumerate() {
                sum += next() * ai.norm_sqr();
                for aj in &a[i + 1..] {
                    // (i, j) and its conjugate (j, i) together.
                    sum += 2.0 * (ai.conj() * Complex32::new(next(), next()) * aj).re;
                }
            }
            (sum / (n * n) as f32).max(0.0)
        });
        Array2::from_shape_vec((self.elevation_deg.len(), self.azimuth_deg.len()), power.collect()).ok()
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::array::AntennaArray;

    use super::*;

    /// Covariance of one source of power 1 at a direction of the grid.
    fn source(bartlett: &Bartlett, elevation: usize, azimuth: usize) -> Covariance {
        let n = bartlett.antennas;
        let at = (elevation * bartlett.azimuth_deg.len() + azimuth) * n;
        let a = &bartlett.steering[at..at + n];
        let mut packed = heapless::Vec::new();
        for i in 0..n {
            packed.push(a[i].norm_sqr()).unwrap();
            for j in i + 1..n {
                let x = a[i] * a[j].conj();
                packed.extend([x.re, x.im]);
            }
        }
        Covariance { frame: 0, antennas: n as u8, packed }
    }

    #[test]
    fn a_source_is_found_with_its_power() {
        for array in [AntennaArray::Awr1843Aop, AntennaArray::Iwr6843Aop] {
            let bartlett = Bartlett::new(&RadarProfile { array, ..RadarProfile::bridge() }, 41).unwrap();
            for (elevation, azimuth) in [(20, 20), (5, 33), (30, 11)] {
                let spectrum = bartlett.spectrum(&source(&bartlett, elevation, azimuth)).unwrap();
                let best = spectrum.indexed_iter().max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
                assert_eq!(best.0, (elevation, azimuth));
                assert!((best.1 - 1.0).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_line_of_antennas_has_no_elevation() {
        let profile = RadarProfile { tx_order: [1].into_iter().collect(), ..RadarProfile::bridge() };
        assert_eq!(Bartlett::new(&profile, 41).unwrap().elevation_deg.len(), 1);
        let other = Bartlett::new(&RadarProfile::bridge(), 41).unwrap();
        let line = Bartlett::new(&profile, 41).unwrap();
        assert!(other.spectrum(&source(&line, 0, 3)).is_none());
    }
}
