//! What is learnt: the network, what it tells only while it learns, and how wrong all of it is.

use burn::module::Module;
use burn::nn::{Linear, LinearConfig};
use burn::tensor::activation::log_softmax;
use burn::tensor::{Device, Int, Tensor, TensorData};

use super::Recipe;
use crate::config::NetworkConfig;
use crate::network::{Batch, Network, Output};
use crate::sample::Pose;

/// Labels of a batch, by sample.
#[derive(Debug, Clone)]
pub(super) struct Labels {
    /// Number of the action, the last for none.
    pub(super) actions: Vec<usize>,
    pub(super) targets: Vec<Option<usize>>,
    pub(super) poses: Vec<Option<Pose>>,
}

/// Cross-entropy of both heads, and the error of the pose; samples without a target or a pose do not teach these.
pub(super) fn loss(
    out: &Output,
    pose: Option<Tensor<2>>,
    labels: &Labels,
    recipe: &Recipe,
    device: &Device,
) -> Tensor<1> {
    let [samples, tags] = out.targets.dims();
    let action = cross_entropy(out.actions.clone(), &labels.actions, recipe.smoothing, device).mean();
    let targets: Vec<usize> = labels.targets.iter().map(|target| target.unwrap_or(0).min(tags - 1)).collect();
    let there: Vec<f32> = labels.targets.iter().map(|t| f32::from(u8::from(t.is_some()))).collect();
    let count = there.iter().sum::<f32>().max(1.0);
    let there = Tensor::<1>::from_data(TensorData::new(there, [samples]), device);
    // Spreading a label over tags that are not there would push their scores up.
    let target = cross_entropy(out.targets.clone(), &targets, 0.0, device) * there;
    let heads = action + target.sum().mul_scalar(recipe.target_weight / f64::from(count));
    match pose {
        Some(pose) => heads + pose_error(pose, &labels.poses, device).mul_scalar(recipe.pose_weight),
        None => heads,
    }
}

/// Mean over the samples with a pose of the squared error, `[1]`.
fn pose_error(told: Tensor<2>, poses: &[Option<Pose>], device: &Device) -> Tensor<1> {
    let wanted: Vec<f32> = poses.iter().flat_map(|pose| pose.unwrap_or_default().values()).collect();
    let there: Vec<f32> = poses.iter().map(|pose| f32::from(u8::from(pose.is_some()))).collect();
    let count = there.iter().sum::<f32>().max(1.0);
    let wanted = Tensor::<2>::from_data(TensorData::new(wanted, [poses.len(), POSE]), device);
    let there = Tensor::<2>::from_data(TensorData::new(there, [poses.len(), 1]), device);
    let off = (told - wanted) * there;
    (off.clone() * off).sum().div_scalar(count)
}

/// Values of a pose.
const POSE: usize = 4;

impl Pose {
    /// Sine and cosine of where the person looks, of the bearing, and the distance: none far from 0 or larger than 2.
    fn values(self) -> [f32; POSE] {
        let Self { distance_m, bearing_deg, facing_deg } = self;
        let (sine, cosine) = facing_deg.to_radians().sin_cos();
        [sine, cosine, 2.0 * bearing_deg.to_radians().sin(), distance_m - 2.0]
    }
}

/// The network, and what it tells only while it learns.
#[derive(Module, Debug)]
pub(super) struct Learner {
    pub(super) network: Network,
    pose: Option<Linear>,
}

impl Learner {
    pub(super) fn new(network: Network, config: &NetworkConfig, recipe: &Recipe, device: &Device) -> Self {
        let told = recipe.pose_weight > 0.0 && config.fusion.has_radar();
        Self { network, pose: told.then(|| LinearConfig::new(config.radar.width, POSE).init(device)) }
    }

    /// Scores, and the pose `[B, POSE]`.
    pub(super) fn forward(&self, batch: &Batch) -> (Output, Option<Tensor<2>>) {
        let (out, radar) = self.network.forward_with_radar(batch);
        let pose = self.pose.as_ref().zip(radar).map(|(pose, radar)| pose.forward(radar));
        (out, pose)
    }
}

fn cross_entropy(scores: Tensor<2>, labels: &[usize], smoothing: f64, device: &Device) -> Tensor<1> {
    let [samples, classes] = scores.dims();
    let numbers = labels.iter().map(|&label| label as i32).collect::<Vec<_>>();
    let numbers = Tensor::<2, Int>::from_data(TensorData::new(numbers, [samples, 1]), device);
    let logs = log_softmax(scores, 1);
    let hit: Tensor<1> = logs.clone().gather(1, numbers).squeeze_dim(1);
    if smoothing == 0.0 {
        return hit.neg();
    }
    let all: Tensor<1> = logs.sum_dim(1).squeeze_dim(1);
    (hit.mul_scalar(1.0 - smoothing) + all.mul_scalar(smoothing / classes as f64)).neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_counts_where_it_is_known() {
        let device = super::super::device();
        let known = Pose { distance_m: 3.0, bearing_deg: 30.0, facing_deg: 90.0 };
        for (told, place) in known.values().iter().zip([1.0, 0.0, 1.0, 1.0]) {
            assert!((told - place).abs() < 1e-6);
        }
        // Right but for a distance that is half a metre off, beside a sample of which nothing is known.
        let told = Tensor::<2>::from_floats([[1.0, 0.0, 1.0, 1.5], [9.0, 9.0, 9.0, 9.0]], &device);
        let error: f32 = pose_error(told.clone(), &[Some(known), None], &device).into_scalar::<f32>();
        assert!((error - 0.25).abs() < 1e-6, "{error}");
        let none: f32 = pose_error(told, &[None, None], &device).into_scalar::<f32>();
        assert_eq!(none, 0.0);
    }
}
