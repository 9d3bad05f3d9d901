//! From the last frame of six seconds to the answer, batch 1, frames before it having been taken as they came: int8 with our
//! kernels against f32 on Burn's `ndarray`, and a case for the peers of `tests/peers`.
//!
//! `cargo bench -p rfhoi-network --bench answer -- [MODEL] [--case DIR]`: of the f32 model in that file, or of the shapes `small`
//! and `paper` with random weights. `--case` leaves the model, a window and Burn's answer in DIR for `tests/peers/onnx.py`;
//! `--json` prints one line of our times alone.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use burn::tensor::Device;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_int8::{Kernels, Level};
use rfhoi_network::config::NetworkConfig;
use rfhoi_network::execute::{Executor, quantize};
use rfhoi_network::model::{Description, Model};
use rfhoi_network::network::Network;
use rfhoi_network::reference::Reference;
use rfhoi_network::sample::{Frame, Frames, MAPS, READ_CHANNELS, Runner, SCALARS, Sample};
use safetensors::tensor::{Dtype, TensorView};

/// Six seconds.
const FRAMES: usize = 60;
const TAGS: usize = 6;
/// Runs of which the median counts: of fast runners, of slow ones.
const RUNS: [usize; 2] = [201, 9];

fn sample(config: &NetworkConfig) -> Sample {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut frames = Frames::new(config.points, TAGS, config.antennas);
    for _ in 0..FRAMES {
        let maps: Vec<u8> = (0..MAPS * config.points * config.points).map(|_| rng.random()).collect();
        let scalars: Vec<f32> = (0..SCALARS).map(|_| rng.random()).collect();
        let count = TAGS * config.antennas * READ_CHANNELS;
        let reads: Vec<f32> = (0..count).map(|_| rng.random_range(-1.0..1.0)).collect();
        frames.push(Frame { maps: &maps, scalars: &scalars, reads: &reads, covariance: &[] });
    }
    Sample { frames, objects: (0..TAGS).collect(), action: None, target: None }
}

fn names(config: &NetworkConfig) -> Vec<Vec<f32>> {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let vector = |_| (0..config.name_dimensions).map(|_| rng.random_range(-1.0..1.0)).collect();
    (0..TAGS).map(vector).collect()
}

/// Medians of taking the frame, and of that and answering, ms.
fn time(runner: &mut dyn Runner, sample: &Sample, names: &[f32], runs: usize) -> (f64, f64) {
    let (mut frames, mut answers) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        runner.clear();
        for number in 0..FRAMES - 1 {
            runner.push(sample.frames.frame(number)).expect("a frame of its shape");
        }
        let began = Instant::now();
        runner.push(sample.frames.frame(FRAMES - 1)).expect("a frame of its shape");
        frames.push(began.elapsed().as_secs_f64());
        runner.answer(0..FRAMES, names).expect("frames that were pushed");
        answers.push(began.elapsed().as_secs_f64());
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        1e3 * values[values.len() / 2]
    };
    (median(frames), median(answers))
}

fn case(folder: &Path, model: &Model, sample: &Sample, names: &[f32]) {
    let mut burn = Reference::new(model).expect("an f32 model");
    for number in 0..FRAMES {
        burn.push(sample.frames.frame(number)).expect("a frame of its shape");
    }
    let answer = burn.answer(0..FRAMES, names).expect("frames that were pushed");
    let config = &model.description.config;
    let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let frames = &sample.frames;
    let arrays: BTreeMap<&str, (Dtype, Vec<usize>, Vec<u8>)> = BTreeMap::from([
        ("maps", (Dtype::U8, vec![FRAMES, MAPS, config.points, config.points], frames.maps.clone())),
        ("scalars", (Dtype::F32, vec![FRAMES, SCALARS], bytes(&frames.scalars))),
        ("reads", (Dtype::F32, vec![FRAMES, TAGS, config.antennas, READ_CHANNELS], bytes(&frames.reads))),
        ("names", (Dtype::F32, vec![TAGS, config.name_dimensions], bytes(names))),
        ("actions", (Dtype::F32, vec![answer.actions.len()], bytes(&answer.actions))),
        ("targets", (Dtype::F32, vec![TAGS], bytes(&answer.targets))),
    ]);
    let views = arrays.iter().map(|(name, (dtype, shape, bytes))| {
        (*name, TensorView::new(*dtype, shape.clone(), bytes).expect("bytes of that shape"))
    });
    let file = safetensors::serialize(views.collect::<Vec<_>>(), None).expect("arrays");
    std::fs::create_dir_all(folder).expect("a folder");
    std::fs::write(folder.join("case.safetensors"), file).expect("a file");
    std::fs::write(folder.join("model.safetensors"), model.to_bytes().expect("a model")).expect("a file");
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let value = |name: &str| words.iter().position(|word| word == name).and_then(|at| words.get(at + 1));
    let json = words.iter().any(|word| word == "--json");
    let given = words.first().filter(|word| !word.starts_with("--"));
    let shape = |config: NetworkConfig| {
        let device = Device::ndarray();
        device.seed(1);
        let network = Network::new(&config, &device).expect("a shape that can be");
        let null = serde_json::Value::Null;
        Model::of(&network, Description::new(config, null, "bartlett".into(), 0))
    };
    let models = match given.map(String::as_str) {
        Some("small") => vec![("small".to_owned(), shape(NetworkConfig::small(32)))],
        Some("paper") => vec![("paper".to_owned(), shape(NetworkConfig::paper(32)))],
        Some(path) => {
            let bytes = std::fs::read(path).expect("a model's file");
            vec![(path.to_owned(), Model::from_bytes(&bytes).expect("a model"))]
        }
        None => vec![
            ("small".into(), shape(NetworkConfig::small(32))),
            ("paper".into(), shape(NetworkConfig::paper(32))),
        ],
    };
    for (name, model) in models {
        let sample = sample(&model.description.config);
        let vectors = names(&model.description.config);
        let flat: Vec<f32> = vectors.concat();
        if let Some(folder) = value("--case") {
            case(Path::new(folder), &model, &sample, &flat);
        }
        let int8 = quantize(&model, &[&sample], &vectors).expect("a network that int8 runs");
        let of = |kernels: Kernels| {
            let mut executor = Executor::new(&int8, kernels).expect("a model");
            time(
                &mut executor,
                &sample,
                &flat,
                if model.parameters() < 2_000_000 { RUNS[0] } else { RUNS[0] / 5 },
            )
        };
        let best = [1, 2].map(|threads| of(Kernels::best().with_threads(threads)));
        let mut line = serde_json::json!({
            "model": name,
            "parameters": model.parameters(),
            "level": Kernels::best().level().name(),
            "int8_frame_ms": best.map(|(frame, _)| frame),
            "int8_answer_ms": best.map(|(_, answer)| answer),
        });
        if !json {
            let mut burn = Reference::new(&model).expect("an f32 model");
            let (frame, answer) = time(&mut burn, &sample, &flat, RUNS[1]);
            line["burn_frame_ms"] = frame.into();
            line["burn_answer_ms"] = answer.into();
            line["burn_over_int8"] = best.map(|(_, ours)| answer / ours).to_vec().into();
            for level in Level::ALL {
                if let Some(kernels) = Kernels::new(level) {
                    line[format!("{}_answer_ms", level.name())] = of(kernels).1.into();
                }
            }
        }
        println!("{line}");
    }
}
