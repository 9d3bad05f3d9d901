//! The network without Burn: int8 with kernels of our own, a frame at a time.
//!
//! ```text
//! push(frame):   maps u8 --[squares, or conv, conv, pool]--> u8 --[dense, norm; dense, norm]--> radar token, kept
//! answer(range): radar tokens --[transformer]--> mean --------------------------------+
//!                reads --[phase encoder, transformer]--> mean, with names and turns --+--> heads
//! ```
//!
//! The same code runs in f32 while it watches which values reach each layer ([`quantize()`](crate::execute::quantize)), which is
//! where the scales of the int8 network come from; so the two differ in the layers' arithmetic alone.

mod convolution;
mod dense;
mod executor;
mod quantize;
mod transformer;

pub use executor::Executor;
pub use quantize::quantize;

use rfhoi_int8::SMALL;

use crate::model::{Model, ModelError};

/// Why a model cannot be executed.
#[derive(Debug, thiserror::Error)]
pub enum ExecuteError {
    /// The model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// What only Burn does.
    #[error("{0} run in f32 only: use --precision f32")]
    Unsupported(&'static str),
    /// A calibration sample.
    #[error("calibration: {0}")]
    Calibration(#[from] crate::sample::InputError),
    /// No calibration.
    #[error("int8 needs samples to learn its scales from, and there are none")]
    NoCalibration,
}

/// Which values reached a layer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seen {
    least: f32,
    most: f32,
}

impl Default for Seen {
    fn default() -> Self {
        // 0 must have a code: it is what padding is.
        Self { least: 0.0, most: 0.0 }
    }
}

impl Seen {
    pub(crate) fn look(&mut self, values: &[f32]) {
        for &value in values {
            self.least = self.least.min(value);
            self.most = self.most.max(value);
        }
    }

    pub(crate) fn with(self, other: Self) -> Self {
        Self { least: self.least.min(other.least), most: self.most.max(other.most) }
    }

    /// Codes of 7 bits that cover them: dense layers multiply those fastest where AVX2 is all there is, and the network that
    /// ships is no less accurate with them.
    pub(crate) fn codes(self) -> Codes {
        self.codes_to(SMALL)
    }

    /// Scale and zero point of codes from 0 to `top` that cover them.
    pub(crate) fn codes_to(self, top: u8) -> Codes {
        let scale = (self.most - self.least) / f32::from(top);
        let scale = if scale > 0.0 { scale } else { 1.0 };
        Codes { scale, zero: (-self.least / scale).round_ties_even() as u8, top }
    }
}

/// What u8 codes mean: `value = (code - zero) * scale`, codes going from 0 to `top`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Codes {
    pub(crate) scale: f32,
    pub(crate) zero: u8,
    pub(crate) top: u8,
}

impl Codes {
    /// Of maps, which come as codes.
    pub(crate) const MAPS: Self = Self { scale: 1.0 / 255.0, zero: 0, top: u8::MAX };

    /// As array `name` of an int8 model says them: scale, zero point, greatest code; the last was not written at first, when it
    /// was 255.
    pub(crate) fn load(model: &Model, name: &str) -> Result<Self, ModelError> {
        let (scale, zero, top) = match *model.f32s(name)? {
            [scale, zero] => (scale, zero, u8::MAX),
            [scale, zero, top] => (scale, zero, top as u8),
            _ => return Err(ModelError::Weights(format!("{name} is no scale, zero and greatest code"))),
        };
        Ok(Self { scale, zero: (zero as u8).min(top), top })
    }

    /// What [`load`](Self::load) reads.
    pub(crate) fn values(self) -> Vec<f32> {
        vec![self.scale, self.zero.into(), self.top.into()]
    }

    pub(crate) fn quant(self) -> rfhoi_int8::Quant {
        rfhoi_int8::Quant { inverse: 1.0 / self.scale, zero: self.zero, top: self.top }
    }
}

/// Values between two layers: f32 while scales are learnt, codes after.
#[derive(Debug, Clone, Default)]
pub(crate) struct Between {
    pub(crate) floats: Vec<f32>,
    pub(crate) codes: Vec<u8>,
}

/// `y` if it is positive, else a little of it.
pub(crate) fn leaky(value: f32, leak: f32) -> f32 {
    if value >= 0.0 { value } else { value * leak }
}
