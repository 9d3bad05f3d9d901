//! From f32 to int8: scales of activations from samples, of weights from the weights.

use std::collections::BTreeMap;

use rfhoi_int8::{Kernels, NARROW};

use super::dense::Dense;
use super::executor::{Executor, Layers};
use super::{Codes, ExecuteError, Seen};
use crate::model::{Array, Model, Precision, Values};
use crate::network::NameVectors;
use crate::sample::{Runner, SCALARS, Sample};

/// Largest code of a weight: narrow ones are faster where AVX2 is all there is, and the network that ships is no less accurate
/// with them.
const LARGEST: f32 = NARROW as f32;

/// The int8 form of an f32 model. Activations get a scale and a zero point for each layer from what reaches it in `samples`,
/// weights a scale for each output.
///
/// # Errors
/// If the model is not f32, only Burn runs its network, or there are no samples.
pub fn quantize(model: &Model, samples: &[&Sample], names: &NameVectors) -> Result<Model, ExecuteError> {
    if model.description.precision != Precision::F32 {
        return Err(crate::model::ModelError::Precision(model.description.precision, Precision::F32).into());
    }
    if samples.is_empty() {
        return Err(ExecuteError::NoCalibration);
    }
    let mut executor = Executor::new(model, Kernels::best())?;
    for sample in samples {
        executor.clear();
        for number in 0..sample.frames.len() {
            executor.push(sample.frames.frame(number))?;
        }
        let named: Vec<f32> = sample.objects.iter().flat_map(|&o| names[o].iter().copied()).collect();
        executor.answer(0..sample.frames.len(), &named)?;
    }
    let mut arrays: BTreeMap<String, Array> = BTreeMap::new();
    let Layers { dense, patches, convolutions } = executor.layers();
    let mut replaced = Vec::new();
    for layer in dense {
        dense_layer(model, layer, layer.codes(), &mut arrays)?;
        replaced.push(layer.name.clone());
    }
    for layer in patches {
        dense_layer(model, layer, Codes::MAPS, &mut arrays)?;
        replaced.push(layer.name.clone());
    }
    // The pools of all maps go into one dense layer, so their codes mean the same.
    let features = convolutions.iter().filter_map(|[_, second]| second.seen());
    let features = features.fold(Seen::default(), |seen, (_, out, _)| seen.with(out)).codes();
    if !convolutions.is_empty() {
        put_codes(&mut arrays, "radar.encoder.first.input", features);
    }
    for [first, second] in convolutions {
        let Some((_, middle, _)) = first.seen() else { continue };
        // Convolutions gain nothing by small inputs.
        let middle = middle.codes_to(u8::MAX);
        for (layer, input, output) in [(first, Codes::MAPS, middle), (second, middle, features)] {
            let Some((_, _, weights)) = layer.seen() else { continue };
            let shape = model.arrays[&format!("{}.weight", layer.name)].shape.clone();
            put_weights(&mut arrays, &layer.name, weights, shape, layer.outputs());
            put_codes(&mut arrays, &format!("{}.input", layer.name), input);
            put_codes(&mut arrays, &format!("{}.output", layer.name), output);
            replaced.push(layer.name.clone());
        }
    }
    // Biases and normalisation stay as they are.
    for (name, array) in &model.arrays {
        let is_weight = name.strip_suffix(".weight").is_some_and(|of| replaced.iter().any(|name| name == of));
        if !is_weight {
            arrays.insert(name.clone(), array.clone());
        }
    }
    let mut description = model.description.clone();
    description.precision = Precision::Int8;
    Ok(Model { description, arrays })
}

fn dense_layer(
    model: &Model,
    layer: &Dense,
    input: Codes,
    arrays: &mut BTreeMap<String, Array>,
) -> Result<(), ExecuteError> {
    let Some(weights) = layer.floats() else { return Ok(()) };
    put_weights(arrays, &layer.name, weights, vec![layer.outputs, layer.inputs], layer.outputs);
    put_codes(arrays, &format!("{}.input", layer.name), input);
    if layer.name == "radar.encoder.first" {
        let all = model.f32s(&format!("{}.weight", layer.name))?;
        let scalars = all[layer.inputs * layer.outputs..].to_vec();
        let array = Array { shape: vec![SCALARS, layer.outputs], values: Values::F32(scalars) };
        arrays.insert(format!("{}.scalars", layer.name), array);
    }
    Ok(())
}

/// Codes of weights and the scale of each output.
fn put_weights(
    arrays: &mut BTreeMap<String, Array>,
    name: &str,
    weights: &[f32],
    shape: Vec<usize>,
    outputs: usize,
) {
    let (mut codes, mut scales) = (Vec::with_capacity(weights.len()), Vec::with_capacity(outputs));
    for row in weights.chunks_exact(weights.len() / outputs) {
        let most = row.iter().fold(0.0f32, |most, weight| most.max(weight.abs()));
        let scale = if most > 0.0 { most / LARGEST } else { 1.0 };
        codes.extend(row.iter().map(|weight| (weight / scale).round_ties_even() as i8));
        scales.push(scale);
    }
    arrays.insert(format!("{name}.weight"), Array { shape, values: Values::I8(codes) });
    arrays.insert(format!("{name}.scale"), Array { shape: vec![outputs], values: Values::F32(scales) });
}

fn put_codes(arrays: &mut BTreeMap<String, Array>, name: &str, codes: Codes) {
    let values = codes.values();
    arrays.insert(name.to_owned(), Array { shape: vec![values.len()], values: Values::F32(values) });
}
