//! How well directions explain a covariance, and how exact they can be.

use nalgebra::{SMatrix, SVector};
use num_complex::Complex64;

use super::geometry::{Geometry, Matrix, Vector};
use super::settings::MAX_PEAKS;

/// Of all sources, u and w each.
const PARAMETERS: usize = 2 * MAX_PEAKS;

type Sources = SMatrix<Complex64, MAX_PEAKS, MAX_PEAKS>;

/// Elements of a steering vector and of its derivatives by u and w.
#[derive(Clone, Copy, Default)]
struct Beam {
    steering: Vector,
    derivatives: [Vector; 2],
}

/// A covariance explained by sources in white noise.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Fit {
    /// Mean power of noise in an antenna: all that the directions do not explain (J. F. Böhme 1986).
    pub(super) noise: f64,
    /// Power of each source in an antenna.
    pub(super) powers: [f64; MAX_PEAKS],
    /// Least standard deviation of each direction, degrees on the sphere.
    pub(super) deviation_deg: [f64; MAX_PEAKS],
    /// How far each direction is from where the likelihood is largest, by one step of Newton's method, degrees.
    pub(super) drift_deg: [f64; MAX_PEAKS],
}

/// Explains `covariance` by sources at `directions` (u, w), with `snapshots` independent snapshots; `None` where directions
/// coincide.
pub(super) fn fit(
    geometry: &Geometry,
    covariance: &Matrix,
    directions: &[(f64, f64)],
    snapshots: f64,
) -> Option<Fit> {
    let n = geometry.count;
    let sources = directions.len().min(MAX_PEAKS).min(n.saturating_sub(1));
    let beams = beams(geometry, &directions[..sources]);
    let gram = gram(&beams, sources, n);
    let inverse = gram.try_inverse()?;
    // A^H R A; with G = A^H A the power that the sources explain is tr(G^-1 A^H R A).
    let mut seen = Sources::zeros();
    let mut through = [Vector::default(); MAX_PEAKS];
    for (j, (through, beam)) in through.iter_mut().zip(&beams).enumerate().take(sources) {
        for (x, row) in through.iter_mut().zip(covariance).take(n) {
            *x = dot_plain(row, &beam.steering, n);
        }
        for (i, other) in beams.iter().enumerate().take(sources) {
            seen[(i, j)] = dot(&other.steering, through, n);
        }
    }
    let total: f64 = (0..n).map(|i| covariance[i][i].re).sum();
    let explained = (inverse * seen).trace().re;
    let noise = ((total - explained) / (n - sources) as f64).max(total * 1e-12);
    // S = G^-1 A^H R A G^-1 - noise G^-1.
    let mut power = inverse * seen * inverse - inverse.map(|g| g * noise);
    for absent in sources..MAX_PEAKS {
        power[(absent, absent)] = Complex64::default();
    }
    let mut fit = Fit { noise, ..Fit::default() };
    fit.deviation_deg = [f64::INFINITY; MAX_PEAKS];
    let errors = errors(geometry, &beams[..sources], inverse, power, noise, snapshots);
    let mut gradient = SVector::<f64, PARAMETERS>::zeros();
    for k in 0..sources {
        // R A G^-1, off A, onto the derivatives.
        let mut left = Vector::default();
        for (j, through) in through.iter().enumerate().take(sources) {
            add(&mut left, inverse[(j, k)], through);
        }
        let onto =
            inverse * SVector::<Complex64, MAX_PEAKS>::from_fn(|i, _| dot(&beams[i].steering, &left, n));
        for (j, beam) in beams.iter().enumerate().take(sources) {
            add(&mut left, -onto[j], &beam.steering);
        }
        for axis in 0..2 {
            gradient[2 * k + axis] = dot(&left, &beams[k].derivatives[axis], n).re * 2.0 * snapshots / noise;
        }
    }
    for (k, &(u, w)) in directions.iter().enumerate().take(sources) {
        fit.powers[k] = power[(k, k)].re;
        let Some(errors) = errors.filter(|_| fit.powers[k] > 0.0) else { continue };
        let step = errors.fixed_rows::<2>(2 * k) * gradient;
        let square = |uu: f64, uw: f64, ww: f64| on_sphere_deg(u, w, [uu, uw, ww]);
        let at = |a: usize, b: usize| errors[(2 * k + a, 2 * k + b)];
        fit.deviation_deg[k] = square(at(0, 0), at(0, 1), at(1, 1));
        fit.drift_deg[k] = square(step[0] * step[0], step[0] * step[1], step[1] * step[1]);
    }
    Some(fit)
}

/// The stochastic Cramer-Rao bound of `directions`, degrees on the sphere, of uncorrelated sources of these powers in an antenna
/// with white noise of power 1; `None` where directions coincide.
pub(super) fn bound_deg(
    geometry: &Geometry,
    directions: &[(f64, f64)],
    powers: &[f64],
    snapshots: f64,
) -> Option<[f64; MAX_PEAKS]> {
    let sources = directions.len().min(MAX_PEAKS);
    let beams = beams(geometry, &directions[..sources]);
    let inverse = gram(&beams, sources, geometry.count).try_inverse()?;
    let power = Sources::from_fn(|i, j| powers.get(i).filter(|_| i == j).copied().unwrap_or(0.0).into());
    let errors = errors(geometry, &beams[..sources], inverse, power, 1.0, snapshots)?;
    let mut bound = [0.0; MAX_PEAKS];
    for (k, (bound, &(u, w))) in bound.iter_mut().zip(directions).enumerate() {
        let at = |a: usize, b: usize| errors[(2 * k + a, 2 * k + b)];
        *bound = on_sphere_deg(u, w, [at(0, 0), at(0, 1), at(1, 1)]);
    }
    Some(bound)
}

/// Covariance of the errors of u and w, source by source, by the stochastic Cramer-Rao bound for sources of covariance `power`
/// in white noise. Zero for w where the array has no elevation.
///
/// P. Stoica and A. Nehorai 1990, "Performance study of conditional and unconditional direction-of-arrival estimation",
/// eq. 2.13: `noise / (2 T) [Re(D^H P D . (S A^H R^-1 A S)^T)]^-1`, P the projector off A, with a column of D for each of u
/// and w. `S A^H R^-1 A S = S G (S G + noise)^-1 S` with `G = A^H A`, of which `inverse` is given.
fn errors(
    geometry: &Geometry,
    beams: &[Beam],
    inverse: Sources,
    power: Sources,
    noise: f64,
    snapshots: f64,
) -> Option<SMatrix<f64, PARAMETERS, PARAMETERS>> {
    let (n, two) = (geometry.count, geometry.span().1 > 0);
    // S G (S G + noise)^-1 S = S (G S + noise)^-1 G S = S (S + noise G^-1)^-1 S.
    let weight = power * (power + inverse.map(|g| g * noise)).try_inverse()? * power;
    let used: heapless::Vec<(usize, usize), PARAMETERS> =
        (0..2 * beams.len()).map(|p| (p / 2, p % 2)).filter(|&(_, axis)| axis == 0 || two).collect();
    let mut onto = [SVector::<Complex64, MAX_PEAKS>::zeros(); PARAMETERS];
    for &(k, axis) in &used {
        for (i, beam) in beams.iter().enumerate() {
            onto[2 * k + axis][i] = dot(&beam.steering, &beams[k].derivatives[axis], n);
        }
    }
    let mut information = SMatrix::<f64, PARAMETERS, PARAMETERS>::identity();
    for (first, &(k, a)) in used.iter().enumerate() {
        let left = inverse * onto[2 * k + a];
        for &(l, b) in &used[first..] {
            let plain = dot(&beams[k].derivatives[a], &beams[l].derivatives[b], n);
            let off = plain - left.dotc(&onto[2 * l + b]);
            let element = (off * weight[(l, k)]).re * 2.0 * snapshots / noise;
            information[(2 * k + a, 2 * l + b)] = element;
            information[(2 * l + b, 2 * k + a)] = element;
        }
    }
    let mut errors = information.cholesky()?.inverse();
    for p in (0..PARAMETERS).filter(|&p| !used.contains(&(p / 2, p % 2))) {
        errors[(p, p)] = 0.0;
    }
    Some(errors)
}

/// Length of a step on the sphere, degrees, of squares and product of its parts in u and w:
/// `du^2 + dw^2 + dv^2` with `v = sqrt(1 - u^2 - w^2)`.
fn on_sphere_deg(u: f64, w: f64, [uu, uw, ww]: [f64; 3]) -> f64 {
    let ahead = (1.0 - u * u - w * w).max(1e-3);
    let aside = u * u * uu + 2.0 * u * w * uw + w * w * ww;
    (uu + ww + aside / ahead).max(0.0).sqrt().to_degrees()
}

fn beams(geometry: &Geometry, directions: &[(f64, f64)]) -> [Beam; MAX_PEAKS] {
    let mut beams = [Beam::default(); MAX_PEAKS];
    for (beam, &(u, w)) in beams.iter_mut().zip(directions) {
        beam.steering = geometry.steering(u, w);
        for (i, &(x, y)) in geometry.positions.iter().enumerate().take(geometry.count) {
            let slope = |place: i32| Complex64::new(0.0, -core::f64::consts::PI * f64::from(place));
            beam.derivatives[0][i] = beam.steering[i] * slope(x);
            beam.derivatives[1][i] = beam.steering[i] * slope(y);
        }
    }
    beams
}

/// `A^H A`, with ones for the sources that are not there.
fn gram(beams: &[Beam; MAX_PEAKS], sources: usize, n: usize) -> Sources {
    Sources::from_fn(|i, j| {
        if i < sources && j < sources {
            dot(&beams[i].steering, &beams[j].steering, n)
        } else {
            Complex64::from(f64::from(i == j))
        }
    })
}

fn add(to: &mut Vector, factor: Complex64, vector: &Vector) {
    for (x, y) in to.iter_mut().zip(vector) {
        *x += factor * y;
    }
}

fn dot(a: &Vector, b: &Vector, n: usize) -> Complex64 {
    a.iter().zip(b).take(n).map(|(a, b)| a.conj() * b).sum()
}

fn dot_plain(a: &Vector, b: &Vector, n: usize) -> Complex64 {
    a.iter().zip(b).take(n).map(|(a, b)| a * b).sum()
}
