//! Models: the two that are built in, those in files, and what runs them.

use rfhoi_int8::Kernels;
use rfhoi_network::execute::Executor;
use rfhoi_network::model::{Description, Model, Precision};
use rfhoi_network::names::{Names, NamesError};
use rfhoi_network::reference::Reference;
use rfhoi_network::sample::Runner;

use super::RecognizeError;
use crate::features::{AngleMap, Settings};

/// The file of the model that is built in.
fn shipped(precision: Precision) -> &'static [u8] {
    match precision {
        Precision::Int8 => include_bytes!("../../../models/rfhoi-int8.safetensors"),
        Precision::F32 => include_bytes!("../../../models/rfhoi-f32.safetensors"),
    }
}

/// The model that is built in.
///
/// # Errors
/// If it was built in damaged.
pub fn built_in(precision: Precision) -> Result<Model, RecognizeError> {
    Ok(Model::from_bytes(shipped(precision))?)
}

/// The names that are built in.
///
/// # Errors
/// If they were built in damaged.
pub fn names() -> Result<Names, NamesError> {
    Names::parse(include_bytes!("../../../models/names.bin"))
}

/// What features a model takes.
///
/// # Errors
/// If its angle map is not known.
pub fn settings(description: &Description) -> Result<Settings, RecognizeError> {
    let angles = AngleMap::ALL.into_iter().find(|angles| angles.to_string() == description.angle);
    let angles = angles.ok_or_else(|| {
        RecognizeError::Description(format!("angle map `{}` is not known", description.angle))
    })?;
    let config = &description.config;
    Ok(Settings {
        points: config.points,
        angles,
        antennas: config.antennas,
        covariance: config.beams.is_some(),
    })
}

/// What runs a model: f32 on Burn, int8 with our kernels.
///
/// # Errors
/// If the model's weights do not fit its network.
pub fn runner(model: &Model, kernels: Kernels) -> Result<Box<dyn Runner>, RecognizeError> {
    Ok(match model.description.precision {
        Precision::F32 => Box::new(Reference::new(model)?),
        Precision::Int8 => Box::new(Executor::new(model, kernels)?),
    })
}
