//! The form over a grid of directions, in decibels.
//!
//! A row of the grid has one elevation, and its form is a polynomial in `exp(j pi u)`: an even part in `cos pi u` and an odd
//! one. The grid is symmetric, so the same cosines and sines serve both signs of azimuth and of elevation.

use core::f64::consts::PI;

use num_complex::Complex64;
use pulp::{Simd, WithSimd};
use rfhoi_firmware::dsp::level;
use rfhoi_shared::radar::MAX_VIRTUAL;

use super::form::Form;

/// 10 log10(2).
const DB_PER_OCTAVE: f32 = 3.010_3;

/// Forms are not told apart below this share of their scale: rounding of f32. 57 dB.
pub(super) const FLOOR: f32 = 2e-6;

/// What a value of the form means.
#[derive(Debug, Clone, Copy)]
pub(super) struct Decibels {
    /// Brings the form to a scale of 1.
    pub(super) scale: f32,
    /// Decibels of the scaled form when it is 1.
    pub(super) offset_db: f32,
    /// Whether a small form is a high peak.
    pub(super) inverse: bool,
}

impl Decibels {
    /// The map's value for a `value` of the form.
    pub(super) fn of(self, value: f64) -> f32 {
        let db = 10.0 * (value * f64::from(self.scale)).max(FLOOR.into()).log10() as f32;
        self.offset_db + if self.inverse { -db } else { db }
    }
}

/// Directions and their tables.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) azimuth_deg: Vec<f32>,
    pub(super) elevation_deg: Vec<f32>,
    /// `exp(j pi w)` of each elevation.
    steps: Vec<Complex64>,
    /// `cos pi u`, then `sin pi u`, of the azimuths from the middle up, by elevations from the middle up.
    tables: Vec<f32>,
    half: usize,
    /// Highest power of `exp(j pi u)`.
    degree: usize,
    /// The widest registers that the machine has.
    pub(super) arch: pulp::Arch,
}

impl Grid {
    /// `points` each way, or one elevation where `span` has no differences upwards.
    pub(super) fn new(points: usize, half_span_deg: f32, span: (usize, usize)) -> Self {
        let step = 2.0 * half_span_deg / (points - 1) as f32;
        // Both halves from the middle, so that they mirror exactly.
        let degrees: Vec<f32> = (0..points).map(|i| (i as f32 - (points - 1) as f32 / 2.0) * step).collect();
        let elevation_deg = if span.1 > 0 { degrees.clone() } else { vec![0.0] };
        let half = points.div_ceil(2);
        let mut tables = Vec::with_capacity(elevation_deg.len().div_ceil(2) * 2 * half);
        for elevation in &elevation_deg[elevation_deg.len() / 2..] {
            let cos = f64::from(*elevation).to_radians().cos();
            let angle = |a: &f32| PI * f64::from(*a).to_radians().sin() * cos;
            tables.extend(degrees[points / 2..].iter().map(|a| angle(a).cos() as f32));
            tables.extend(degrees[points / 2..].iter().map(|a| angle(a).sin() as f32));
        }
        let step = |e: &f32| Complex64::from_polar(1.0, PI * f64::from(*e).to_radians().sin());
        let steps = elevation_deg.iter().map(step).collect();
        Self {
            azimuth_deg: degrees,
            elevation_deg,
            steps,
            tables,
            half,
            degree: span.0,
            arch: pulp::Arch::new(),
        }
    }

    /// Direction cosines of a point.
    pub(super) fn direction(&self, row: usize, column: usize) -> (f64, f64) {
        let elevation = f64::from(self.elevation_deg[row]).to_radians();
        let azimuth = f64::from(self.azimuth_deg[column]).to_radians();
        (azimuth.sin() * elevation.cos(), elevation.sin())
    }

    /// From point to point in the middle of the view, in direction cosines.
    pub(super) fn step(&self) -> f64 {
        f64::from(self.azimuth_deg[1] - self.azimuth_deg[0]).to_radians()
    }

    /// Whether a direction is out of the grid.
    pub(super) fn is_beyond(&self, u: f64, w: f64) -> bool {
        let edge = f64::from(self.azimuth_deg[self.azimuth_deg.len() - 1]).to_radians().sin();
        w.abs() >= edge || u.abs() >= edge * (1.0 - w * w).sqrt()
    }

    /// Writes the map of `form`: rows of rising elevation, columns of rising azimuth.
    pub(super) fn map(&self, form: &Form, decibels: Decibels, map: &mut [f32]) {
        // Loops of a known length.
        match self.degree {
            1 => self.arch.dispatch(Rows::<1> { grid: self, form, decibels, map }),
            2 => self.arch.dispatch(Rows::<2> { grid: self, form, decibels, map }),
            3 => self.arch.dispatch(Rows::<3> { grid: self, form, decibels, map }),
            4 => self.arch.dispatch(Rows::<4> { grid: self, form, decibels, map }),
            5 => self.arch.dispatch(Rows::<5> { grid: self, form, decibels, map }),
            6 => self.arch.dispatch(Rows::<6> { grid: self, form, decibels, map }),
            7 => self.arch.dispatch(Rows::<7> { grid: self, form, decibels, map }),
            _ => self.arch.dispatch(Rows::<{ MAX_VIRTUAL - 1 }> { grid: self, form, decibels, map }),
        }
    }
}

/// All rows, of degree at most `D`.
struct Rows<'a, const D: usize> {
    grid: &'a Grid,
    form: &'a Form,
    decibels: Decibels,
    map: &'a mut [f32],
}

impl<const D: usize> WithSimd for Rows<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { grid, form, decibels, map } = self;
        let Decibels { scale, offset_db, inverse } = decibels;
        let factor = if inverse { -DB_PER_OCTAVE } else { DB_PER_OCTAVE };
        let points = grid.azimuth_deg.len();
        for (row, out) in map.chunks_exact_mut(points).enumerate() {
            let rows = grid.elevation_deg.len();
            let mirrored = row.max(rows - 1 - row) - rows / 2;
            let tables = &grid.tables[mirrored * 2 * grid.half..][..2 * grid.half];
            let (cosines, sines) = tables.split_at(grid.half);
            let b = form.row(grid.steps[row]);
            let (mut even, mut odd) = ([0.0; MAX_VIRTUAL], [0.0; MAX_VIRTUAL]);
            for (d, b) in b.iter().enumerate().take(D + 1) {
                even[d] = b.re as f32 * scale;
                odd[d] = -b.im as f32 * scale;
            }
            let mut left = [0.0; 128];
            let (_, right) = out.split_at_mut(points - grid.half);
            let places = right.iter_mut().zip(&mut left).zip(cosines.iter().zip(sines));
            for ((right, left), (&cos, &sin)) in places {
                let twice = cos + cos;
                // Clenshaw's recurrence, for cosines and for sines.
                let (mut e1, mut e2, mut o1, mut o2) = (0.0, 0.0, 0.0, 0.0);
                for d in (1..=D).rev() {
                    (e1, e2) = (even[d] + (twice * e1 - e2), e1);
                    (o1, o2) = (odd[d] + (twice * o1 - o2), o1);
                }
                let (e, o) = (even[0] + (cos * e1 - e2), sin * o1);
                *right = offset_db + factor * level::log2((e + o).max(FLOOR));
                *left = offset_db + factor * level::log2((e - o).max(FLOOR));
            }
            for (out, &left) in out[..grid.half].iter_mut().rev().zip(&left) {
                *out = left;
            }
        }
    }
}
