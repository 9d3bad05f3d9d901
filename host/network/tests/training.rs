//! Training on samples that mean nothing but themselves.
#![cfg(feature = "train")]

mod common;

use std::sync::{Mutex, MutexGuard, PoisonError};

use common::{config, describe, farthest, names, run, sample};
use rfhoi_network::config::{Beams, Fusion, Temporal};
use rfhoi_network::metrics::Metrics;
use rfhoi_network::model::Model;
use rfhoi_network::reference::Reference;
use rfhoi_network::sample::Sample;
use rfhoi_network::train::{
    Augment, Epoch, Folder, Material, Recipe, TrainError, Watch, answers, device, train,
};

/// Burn's generator of random numbers is one for all threads: tests that train take turns.
static TURN: Mutex<()> = Mutex::new(());

fn turn() -> MutexGuard<'static, ()> {
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Stops after so many batches; never if there are none.
struct After(Option<usize>);

impl Watch for After {
    fn batch(&mut self, _: u32, _: usize, _: usize, _: f64) -> bool {
        self.0 = self.0.map(|left| left.saturating_sub(1));
        self.0 != Some(0)
    }

    fn epoch(&mut self, _: &Epoch) {}
}

fn recipe(epochs: u32) -> Recipe {
    Recipe {
        epochs,
        patience: 0,
        batch: 16,
        learning_rate: 3e-3,
        augment: Augment::NONE,
        ..Recipe::pre_training(7)
    }
}

fn samples(seeds: std::ops::Range<u64>) -> Vec<Sample> {
    seeds.map(|seed| sample(seed, 6 + seed as usize % 5, 3)).collect()
}

fn material<'a>(
    learn: &'a [&'a Sample],
    validation: &'a [&'a Sample],
    names: &'a [Vec<f32>],
) -> Material<'a> {
    Material { samples: learn, beside: &[], validation, names, interchangeable: (&[], &[]), reversed: &[] }
}

fn trained(config: rfhoi_network::config::NetworkConfig, epochs: u32) -> Model {
    let (learn, names) = (samples(0..160), names());
    let learn: Vec<&Sample> = learn.iter().collect();
    let description = describe(config);
    train(&description, None, &recipe(epochs), material(&learn, &[], &names), None, &mut After(None))
        .unwrap()
        .model
}

fn hoi(model: &Model) -> f64 {
    let test = samples(1000..1100);
    let network = model.network(&device()).unwrap();
    let references: Vec<&Sample> = test.iter().collect();
    let answers = answers(&network, &model.description.config, &references, &names()).unwrap();
    Metrics::of(answers.iter().zip(&test), 0.0).hoi.value()
}

#[test]
fn it_learns_what_is_there_and_each_radio_what_it_sees() {
    let _turn = turn();
    let fused = hoi(&trained(config(Fusion::Concat), 60));
    assert!(fused > 0.95, "{fused}");
    // Which tag is meant only the reader knows: one of three is a guess.
    let radar = hoi(&trained(config(Fusion::Radar), 20));
    assert!(radar < 0.6, "{radar}");
}

#[test]
fn every_shape_of_network_learns() {
    let _turn = turn();
    let mut shapes = vec![config(Fusion::Film), config(Fusion::Attention), config(Fusion::None)];
    let mut convolution = config(Fusion::Concat);
    convolution.radar.temporal = Temporal::Convolution;
    convolution.tags.temporal = Temporal::Convolution;
    shapes.push(convolution);
    for shape in shapes {
        let named = format!("{:?} {:?}", shape.fusion, shape.radar.temporal);
        let reached = hoi(&trained(shape, 60));
        assert!(reached > 0.9, "{named}: {reached}");
    }
}

#[test]
fn beams_are_learnt_from_the_covariance() {
    let _turn = turn();
    // The power from one of two directions says which action it is; maps say nothing.
    let with_covariance = |mut sample: Sample| {
        sample.frames.maps.fill(30);
        let side = if sample.action == Some(0) { 0.9f32 } else { -0.9 };
        sample.frames.covariance = (0..sample.frames.len()).flat_map(|_| [1.0, 1.0, side, 0.1]).collect();
        sample
    };
    let (learn, test) = (samples(0..160), samples(1000..1060));
    let [learn, test]: [Vec<Sample>; 2] =
        [learn, test].map(|set| set.into_iter().map(with_covariance).collect());
    let mut shape = config(Fusion::Radar);
    shape.beams = Some(Beams { antennas: 2, beams: 4 });
    let names = names();
    let references: Vec<&Sample> = learn.iter().collect();
    let description = describe(shape);
    let made =
        train(&description, None, &recipe(60), material(&references, &[], &names), None, &mut After(None));
    let model = made.unwrap().model;
    let references: Vec<&Sample> = test.iter().collect();
    let network = model.network(&device()).unwrap();
    let answers = answers(&network, &description.config, &references, &names).unwrap();
    let action = Metrics::of(answers.iter().zip(&test), 0.0).action.value();
    assert!(action > 0.95, "{action}");
}

/// Counts the batches of each epoch.
#[derive(Default)]
struct Batches(Vec<usize>);

impl Watch for Batches {
    fn batch(&mut self, _: u32, _: usize, of: usize, _: f64) -> bool {
        self.0.push(of);
        true
    }

    fn epoch(&mut self, epoch: &Epoch) {
        assert!(epoch.training_hoi <= 1.0);
    }
}

#[test]
fn what_is_beside_is_learnt_too() {
    let _turn = turn();
    // Those to learn from know one action, what is beside the others.
    let (learn, names) = (samples(0..64), names());
    let learn: Vec<&Sample> = learn.iter().filter(|sample| sample.action == Some(0)).collect();
    let beside = samples(100..400);
    let beside: Vec<&Sample> = beside.iter().filter(|sample| sample.action != Some(0)).collect();
    let description = describe(config(Fusion::Concat));
    let reached = |share: f64| {
        let material = Material { beside: &beside, ..material(&learn, &[], &names) };
        let mut batches = Batches::default();
        let recipe = Recipe { beside: share, ..recipe(40) };
        let model = train(&description, None, &recipe, material, None, &mut batches).unwrap().model;
        (hoi(&model), batches.0[0])
    };
    let of = |samples: usize| samples.div_ceil(16);
    let (alone, batches) = reached(0.0);
    assert_eq!(batches, of(learn.len()));
    let (both, batches) = reached(2.0);
    assert_eq!(batches, of(3 * learn.len()));
    assert!(both > 0.9 && alone < 0.7, "{alone} alone, {both} with others");
}

#[test]
fn padding_changes_nothing() {
    let _turn = turn();
    let model = trained(config(Fusion::Concat), 2);
    let mixed = [sample(1, 4, 1), sample(2, 19, 5), sample(3, 7, 3)];
    let references: Vec<&Sample> = mixed.iter().collect();
    let network = model.network(&device()).unwrap();
    let together = answers(&network, &model.description.config, &references, &names()).unwrap();
    let mut alone = Reference::new(&model).unwrap();
    for (sample, answer) in mixed.iter().zip(&together) {
        let single = run(&mut alone, sample);
        assert!(farthest(&single.actions, &answer.actions) < 1e-5);
        assert!(farthest(&single.targets, &answer.targets) < 1e-5);
    }
}

#[test]
fn a_killed_run_goes_on_as_if_it_had_not_been() {
    let _turn = turn();
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let [whole, parts] = folders.each_ref().map(|folder| Folder(folder.path().join("run")));
    let (learn, validation, names) = (samples(0..48), samples(500..516), names());
    let (learn, validation): (Vec<&Sample>, Vec<&Sample>) =
        (learn.iter().collect(), validation.iter().collect());
    let mut shape = config(Fusion::Concat);
    // Dropout draws, too.
    shape.dropout = 0.2;
    let description = describe(shape);
    let recipe = Recipe { augment: Augment::default(), ..recipe(3) };
    let go = |folder: &Folder, stop: Option<usize>| {
        train(
            &description,
            None,
            &recipe,
            material(&learn, &validation, &names),
            Some(folder),
            &mut After(stop),
        )
    };
    let straight = go(&whole, None).unwrap();
    // Three batches an epoch: in the middle of the first, the second, the third.
    for stop in [2, 5, 5] {
        assert!(matches!(go(&parts, Some(stop)), Err(TrainError::Interrupted)));
    }
    let resumed = go(&parts, None).unwrap();
    assert_eq!(resumed.model, straight.model);
    let losses = |history: &[Epoch]| history.iter().map(|epoch| epoch.loss).collect::<Vec<_>>();
    assert_eq!(losses(&resumed.history), losses(&straight.history));
    // Another recipe has no business in that folder.
    let other = Recipe { learning_rate: 1e-4, ..recipe.clone() };
    let refused =
        train(&description, None, &other, material(&learn, &[], &names), Some(&parts), &mut After(None));
    assert!(matches!(refused, Err(TrainError::Checkpoint(_))));
}
