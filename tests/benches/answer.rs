//! From the last frame of six seconds to the answer, batch 1, frames before it having been taken as they came: int8 with our
//! kernels against f32 on Burn's `ndarray`.
//!
//! `cargo bench -p rfhoi-tests --bench answer -- [small|paper|FILE]...`: of these shapes with random weights, or of the f32
//! model in a file. `--case DIR` leaves the last one, a window and Burn's answer there for `tests/peers/onnx.py`; `--json` prints
//! one line of our times alone, which that script's `--ours` takes.

use std::path::Path;
use std::time::Instant;

use rfhoi_int8::{Kernels, Level};
use rfhoi_network::config::NetworkConfig;
use rfhoi_network::execute::{Executor, quantize};
use rfhoi_network::model::Model;
use rfhoi_network::reference::Reference;
use rfhoi_network::sample::Runner;
use rfhoi_tests::network_case::Case;

/// Multiplications in all runs of a measurement, about: small networks run oftener.
const WORK: usize = 40_000_000;

/// Medians of taking the last frame, and of that and answering, ms.
fn time(runner: &mut dyn Runner, case: &Case, runs: usize) -> (f64, f64) {
    let (mut frames, mut answers) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        case.push_all_but_last(runner);
        let began = Instant::now();
        case.push_last(runner);
        frames.push(began.elapsed().as_secs_f64());
        std::hint::black_box(case.answer(runner));
        answers.push(began.elapsed().as_secs_f64());
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        1e3 * values[values.len() / 2]
    };
    (median(frames), median(answers))
}

fn main() {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let (mut names, mut json, mut folder) = (Vec::new(), false, None);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--json" => json = true,
            "--case" => folder = words.next(),
            _ => names.push(word),
        }
    }
    if names.is_empty() {
        names = vec!["small".into(), "paper".into()];
    }
    for name in names {
        let untrained = |config| Model::untrained(config, 1).expect("a shape that can be");
        let model = match name.as_str() {
            "small" => untrained(NetworkConfig::small(32)),
            "paper" => untrained(NetworkConfig::paper(32)),
            path => Model::from_bytes(&std::fs::read(path).expect("a model's file")).expect("a model"),
        };
        let case = Case::new(model);
        if let Some(folder) = &folder {
            case.write(Path::new(folder));
        }
        let int8 = quantize(&case.model, &[&case.sample], &case.names).expect("a network that int8 runs");
        let runs = (WORK / case.model.parameters()).clamp(9, 201);
        let of = |kernels: Kernels| time(&mut Executor::new(&int8, kernels).expect("a model"), &case, runs);
        let best = [1, 2].map(|threads| of(Kernels::best().with_threads(threads)));
        if json {
            let part = |(frame, answer): (f64, f64)| serde_json::json!({ "encoder": frame, "rest": answer - frame, "sum": answer });
            println!("{}", serde_json::json!({ "int8": { "1": part(best[0]), "2": part(best[1]) } }));
            continue;
        }
        let mut line = serde_json::json!({
            "model": name,
            "parameters": case.model.parameters(),
            "level": Kernels::best().level().name(),
            "int8_frame_ms": best.map(|(frame, _)| frame),
            "int8_answer_ms": best.map(|(_, answer)| answer),
        });
        let mut burn = Reference::new(&case.model).expect("an f32 model");
        let (frame, answer) = time(&mut burn, &case, runs.div_ceil(20));
        line["burn_frame_ms"] = frame.into();
        line["burn_answer_ms"] = answer.into();
        line["burn_over_int8"] = serde_json::json!(best.map(|(_, ours)| answer / ours));
        for level in Level::ALL {
            if let Some(kernels) = Kernels::new(level) {
                line[format!("{}_answer_ms", level.name())] = of(kernels).1.into();
            }
        }
        println!("{line}");
    }
}
