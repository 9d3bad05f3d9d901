//! The network without Burn against the network with it.

mod common;

use common::{config, farthest, names, run, sample, vectors};
use rfhoi_int8::{Kernels, Level};
use rfhoi_network::config::{Encoder, Fusion, NetworkConfig, Temporal};
use rfhoi_network::execute::{ExecuteError, Executor, quantize};
use rfhoi_network::model::{Model, ModelError, Precision};
use rfhoi_network::reference::Reference;
use rfhoi_network::sample::{Frame, InputError, MAX_FRAMES, Runner, Sample};

fn model(fusion: Fusion) -> Model {
    Model::untrained(config(fusion), 5).unwrap()
}

fn samples() -> Vec<Sample> {
    (0..12).map(|seed| sample(seed, 5 + seed as usize, 4)).collect()
}

const FUSIONS: [Fusion; 4] = [Fusion::Concat, Fusion::None, Fusion::Rfid, Fusion::Radar];

/// The same with maps cut into squares.
fn patched(model: &Model) -> Model {
    let encoder = Encoder::Patches { size: 2, channels: 3 };
    Model::untrained(NetworkConfig { encoder, ..model.description.config.clone() }, 5).unwrap()
}

#[test]
fn in_f32_it_is_the_network() {
    for fusion in FUSIONS {
        for stack in [1, 2] {
            let mut config = model(fusion).description.config;
            config.radar.stack = stack;
            let convolved = Model::untrained(config, 5).unwrap();
            for model in [patched(&convolved), convolved] {
                let mut burn = Reference::new(&model).unwrap();
                let mut ours = Executor::new(&model, Kernels::best()).unwrap();
                for sample in samples() {
                    let (a, b) = (run(&mut burn, &sample), run(&mut ours, &sample));
                    let far = farthest(&a.actions, &b.actions).max(farthest(&a.targets, &b.targets));
                    assert!(far < 1e-5, "{fusion:?}: {far}");
                }
            }
        }
    }
}

#[test]
fn int8_is_close_to_f32_and_the_same_on_every_processor() {
    let models = FUSIONS.map(model);
    let patched = models.each_ref().map(patched);
    for model in models.iter().chain(&patched) {
        let fusion = model.description.config.fusion;
        let samples = samples();
        let int8 = quantize(model, &samples.iter().collect::<Vec<_>>(), &names()).unwrap();
        assert_eq!(int8.description.precision, Precision::Int8);
        // Through a file, as it ships.
        let int8 = Model::from_bytes(&int8.to_bytes().unwrap()).unwrap();
        let mut burn = Reference::new(model).unwrap();
        let mut plain = Executor::new(&int8, Kernels::new(Level::Plain).unwrap()).unwrap();
        let mut others: Vec<Executor> = Level::ALL
            .iter()
            .filter_map(|&level| Kernels::new(level))
            .flat_map(|kernels| [1, 2].map(|threads| kernels.clone().with_threads(threads)))
            .map(|kernels| Executor::new(&int8, kernels).unwrap())
            .collect();
        for sample in &samples {
            let (exact, answer) = (run(&mut burn, sample), run(&mut plain, sample));
            assert!(farthest(&exact.actions, &answer.actions) < 0.03, "{fusion:?}");
            assert!(farthest(&exact.targets, &answer.targets) < 0.03, "{fusion:?}");
            for other in &mut others {
                assert_eq!(run(other, sample), answer);
            }
        }
    }
}

#[test]
fn frames_go_by_and_old_ones_are_forgotten() {
    let model = model(Fusion::Concat);
    let long = sample(3, 3 * MAX_FRAMES, 2);
    let mut runner = Executor::new(&model, Kernels::best()).unwrap();
    for number in 0..long.frames.len() {
        runner.push(long.frames.frame(number)).unwrap();
    }
    let (end, names) = (long.frames.len(), vectors(&long));
    let late = runner.answer(end - 40..end, &names).unwrap();
    assert_eq!(runner.answer(0..40, &names), Err(InputError::NotThere { first: 0, last: 40 }));
    assert_eq!(
        runner.answer(end - 1..end + 1, &names),
        Err(InputError::NotThere { first: end - 1, last: end + 1 })
    );
    assert_eq!(runner.answer(0..end, &names), Err(InputError::Frames(end)));
    let part = Sample { frames: long.frames.part(end - 40..end), ..long };
    assert_eq!(run(&mut runner, &part), late);
}

#[test]
fn what_it_cannot_take_it_refuses() {
    let model = model(Fusion::Concat);
    let mut runners: [Box<dyn Runner>; 2] = [
        Box::new(Executor::new(&model, Kernels::best()).unwrap()),
        Box::new(Reference::new(&model).unwrap()),
    ];
    for runner in &mut runners {
        let good = sample(1, 3, 2);
        let frame = good.frames.frame(0);
        let not_finite = vec![f32::NAN; frame.reads.len()];
        assert!(matches!(runner.push(Frame { maps: &[], ..frame }), Err(InputError::Shape { .. })));
        assert!(matches!(runner.push(Frame { reads: &not_finite, ..frame }), Err(InputError::NotFinite(_))));
        assert!(matches!(runner.push(Frame { reads: &[0.0; 7], ..frame }), Err(InputError::Shape { .. })));
        runner.push(frame).unwrap();
        // Another number of tags than before.
        let other = sample(1, 3, 3);
        assert!(matches!(runner.push(other.frames.frame(0)), Err(InputError::Shape { .. })));
        assert!(matches!(runner.answer(0..1, &[]), Err(InputError::Shape { .. })));
        assert!(matches!(runner.answer(0..0, &vectors(&good)), Err(InputError::Frames(0))));
        runner.clear();
        // Without tags there is no target, and still an answer.
        let empty = sample(1, 3, 0);
        assert!(run(runner.as_mut(), &empty).targets.is_empty());
    }
}

#[test]
fn only_burn_runs_the_rest() {
    let refused = |model: &Model| Executor::new(model, Kernels::best()).err();
    assert!(matches!(refused(&model(Fusion::Film)), Some(ExecuteError::Unsupported(_))));
    let mut config = config(Fusion::Concat);
    config.radar.temporal = Temporal::Convolution;
    let model = Model::untrained(config, 5).unwrap();
    assert!(matches!(refused(&model), Some(ExecuteError::Unsupported(_))));
}

#[test]
fn damaged_files_are_refused() {
    let model = model(Fusion::Concat);
    let bytes = model.to_bytes().unwrap();
    assert_eq!(Model::from_bytes(&bytes).unwrap(), model);
    assert!(Model::from_bytes(&bytes[..bytes.len() - 1]).is_err());
    assert!(Model::from_bytes(b"no model").is_err());
    let mut fewer = model.clone();
    fewer.arrays.pop_first();
    assert!(matches!(Reference::new(&fewer).err(), Some(ModelError::Weights(_))));
    assert!(matches!(Executor::new(&fewer, Kernels::best()), Err(ExecuteError::Model(_))));
    let mut wrong = model.clone();
    wrong.description.config.radar.width = 17;
    assert!(Model::from_bytes(&wrong.to_bytes().unwrap()).is_err());
}

#[test]
fn threads_that_share_tags_answer_the_same() {
    let model = model(Fusion::Concat);
    // Enough tags for it to be worth it, more than groups.
    let sample = sample(7, 100, 40);
    let int8 = quantize(&model, &[&sample], &names()).unwrap();
    let answers = [1, 2, 3].map(|threads| {
        let kernels = Kernels::best().with_threads(threads);
        let mut executor = Executor::new(&int8, kernels).unwrap();
        [run(&mut executor, &sample), run(&mut executor, &sample)]
    });
    assert!(answers.iter().flatten().all(|answer| *answer == answers[0][0]));
}
