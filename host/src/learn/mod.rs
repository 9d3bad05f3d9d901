//! Learning from data sets: from folders to trained, tuned, measured and quantised models.
//!
//! ```text
//! set --features--> [Data] --pre-training--> model --fine-tuning on a split--> model --int8--> model
//!                     |                                                          |
//!                     +-----------------------------the split's other part ------+--> metrics
//! ```

mod data;
mod measure;
mod split;
mod time;
mod tune;

pub use data::{Data, DataError, load};
pub use measure::{MeasureError, answers, answers_with, calibrate, least, metrics};
pub use split::{Split, random_split};
pub use time::{Timing, WINDOW, time};
pub use tune::{Lesson, tune};

/// Samples from which an int8 network learns its scales.
pub const CALIBRATION_SAMPLES: usize = 128;
/// Share of the samples to learn from that only say when to stop, in pre-training.
pub const VALIDATION_SHARE: f64 = 0.05;
/// Tuples less probable than this are not told.
pub const LEAST_PROBABILITY: f32 = 0.5;
