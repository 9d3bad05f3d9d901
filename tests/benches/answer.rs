//! From the last frame of six seconds to the answer, batch 1, frames before it having been taken as they came: int8 with our
//! kernels against f32 on Burn's `ndarray`.
//!
//! `cargo bench -p rfhoi-tests --bench answer -- [small|paper|FILE]...`: of these shapes with random weights, or of the f32
//! model in a file. `--tags N` takes so many tags in place of six. `--case DIR` leaves the last one, a window and Burn's answer
//! there for `tests/peers/onnx.py`; `--json` prints one line of our times alone, which that script's `--ours` takes.

use std::path::Path;
use std::time::Instant;

use rfhoi_int8::{Kernels, Level};
use rfhoi_network::config::NetworkConfig;
use rfhoi_network::execute::{Executor, quantize};
use rfhoi_network::model::Model;
use rfhoi_network::reference::Reference;
use rfhoi_network::sample::Runner;
use rfhoi_tests::network_case::{Case, TAGS};

/// Multiplications in all runs of a measurement, about: small networks run oftener.
const WORK: usize = 40_000_000;

/// Rounds in which all are measured by turns, so that what slows the machine for a while slows all of them.
const ROUNDS: usize = 9;

/// A runner, its runs in a round, and what was measured: taking the last frame, and that and answering, s.
struct Timed<'a> {
    runner: Box<dyn Runner + 'a>,
    runs: usize,
    frames: Vec<f64>,
    answers: Vec<f64>,
}

impl<'a> Timed<'a> {
    fn new(runner: impl Runner + 'a, runs: usize) -> Self {
        Self { runner: Box::new(runner), runs: runs.max(1), frames: Vec::new(), answers: Vec::new() }
    }

    fn round(&mut self, case: &Case) {
        for _ in 0..self.runs {
            case.push_all_but_last(self.runner.as_mut());
            let began = Instant::now();
            case.push_last(self.runner.as_mut());
            self.frames.push(began.elapsed().as_secs_f64());
            std::hint::black_box(case.answer(self.runner.as_mut()));
            self.answers.push(began.elapsed().as_secs_f64());
        }
    }

    /// Medians, ms.
    fn medians(mut self) -> (f64, f64) {
        let median = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            1e3 * values[values.len() / 2]
        };
        (median(&mut self.frames), median(&mut self.answers))
    }
}

/// Medians of all, measured by turns.
fn time<const N: usize>(mut timed: [Timed<'_>; N], case: &Case) -> [(f64, f64); N] {
    (0..ROUNDS).for_each(|_| timed.iter_mut().for_each(|timed| timed.round(case)));
    timed.map(Timed::medians)
}

fn main() {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let (mut names, mut json, mut folder, mut tags) = (Vec::new(), false, None, TAGS);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--json" => json = true,
            "--case" => folder = words.next(),
            "--tags" => tags = words.next().and_then(|n| n.parse().ok()).expect("a number of tags"),
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
        let case = Case::with_tags(model, tags);
        if let Some(folder) = &folder {
            case.write(Path::new(folder));
        }
        let int8 = quantize(&case.model, &[&case.sample], &case.names).expect("a network that int8 runs");
        let runs = WORK / case.model.parameters() / ROUNDS;
        let of = |kernels: Kernels| Timed::new(Executor::new(&int8, kernels).expect("a model"), runs);
        let best = |threads| of(Kernels::best().with_threads(threads));
        if json {
            let part = |(frame, answer): (f64, f64)| serde_json::json!({ "encoder": frame, "rest": answer - frame, "sum": answer });
            let [one, two] = time([best(1), best(2)], &case);
            println!("{}", serde_json::json!({ "int8": { "1": part(one), "2": part(two) } }));
            continue;
        }
        let burn = Reference::new(&case.model).expect("an f32 model");
        let [one, two, burn] = time([best(1), best(2), Timed::new(burn, runs / 8)], &case);
        let mut line = serde_json::json!({
            "model": name,
            "tags": tags,
            "parameters": case.model.parameters(),
            "level": Kernels::best().level().name(),
            "int8_frame_ms": [one.0, two.0],
            "int8_answer_ms": [one.1, two.1],
            "burn_frame_ms": burn.0,
            "burn_answer_ms": burn.1,
            "burn_over_int8": [burn.1 / one.1, burn.1 / two.1],
        });
        for kernels in Level::ALL.into_iter().filter_map(Kernels::new) {
            let level = format!("{}_answer_ms", kernels.level().name());
            let [(_, answer)] = time([of(kernels)], &case);
            line[level] = answer.into();
        }
        println!("{line}");
    }
}
