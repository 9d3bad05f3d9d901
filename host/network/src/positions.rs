//! Sinusoidal positions of a sequence's tokens (Vaswani et al. 2017, section 3.5).

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::sample::MAX_FRAMES;

/// Base of the wavelengths.
const BASE: f64 = 10_000.0;

/// Tables by width, so that no answer has to compute sines.
static TABLES: Mutex<BTreeMap<usize, Arc<[f32]>>> = Mutex::new(BTreeMap::new());

/// At least `[length][width]`: sine at even places, cosine at odd ones.
pub(crate) fn positions(length: usize, width: usize) -> Arc<[f32]> {
    let mut tables = TABLES.lock().unwrap_or_else(PoisonError::into_inner);
    let table = tables.entry(width).or_insert_with(|| sines(MAX_FRAMES, width).into());
    if table.len() < length * width {
        *table = sines(length, width).into();
    }
    Arc::clone(table)
}

fn sines(length: usize, width: usize) -> Vec<f32> {
    let slow: Vec<f64> = (0..width).map(|n| BASE.powf((n / 2 * 2) as f64 / width as f64)).collect();
    let value = |at: usize, place: usize| {
        let angle = at as f64 / slow[place];
        if place.is_multiple_of(2) { angle.sin() as f32 } else { angle.cos() as f32 }
    };
    (0..length).flat_map(|at| (0..width).map(move |place| value(at, place))).collect()
}
