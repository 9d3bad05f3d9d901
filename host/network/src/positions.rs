//! Sinusoidal positions of a sequence's tokens (Vaswani et al. 2017, section 3.5).

/// Base of the wavelengths.
const BASE: f64 = 10_000.0;

/// `[length][width]`: sine at even places, cosine at odd ones.
pub(crate) fn positions(length: usize, width: usize) -> Vec<f32> {
    let value = |at: usize, place: usize| {
        let angle = at as f64 / BASE.powf((place / 2 * 2) as f64 / width as f64);
        if place.is_multiple_of(2) { angle.sin() as f32 } else { angle.cos() as f32 }
    };
    (0..length).flat_map(|at| (0..width).map(move |place| value(at, place))).collect()
}
