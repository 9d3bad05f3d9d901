//! `rfhoi experiment latency`: what each stage takes on this machine, from a bridge's packets to the answer.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, ensure};
use clap::Args;
use rfhoi::align::{AlignError, AlignedFrame, FrameStream};
use rfhoi::features::Settings;
use rfhoi::plan::instructions::Instructions;
use rfhoi::receive::{Received, Receiver};
use rfhoi::recognize::model::{built_in, runner, settings};
use rfhoi::recognize::radar::Maps;
use rfhoi::replay::packets;
use rfhoi::{atomic, learn};
use rfhoi_int8::Kernels;
use rfhoi_network::metrics::median;
use rfhoi_network::model::{Model, Precision};
use rfhoi_network::sample::Frames;
use rfhoi_shared::config::RadarConfig;
use serde::Serialize;

use crate::commands::Progress;
use crate::commands::train::names;

/// Clock of the default board, Hz.
const BOARD_HZ: f64 = 480e6;
/// Answers that are timed.
const ANSWERS: usize = 31;
/// How often the whole recording is taken; the median over all frames counts.
const ROUNDS: usize = 5;

/// `rfhoi experiment latency`.
#[derive(Debug, Args)]
pub(super) struct Latency {
    /// Recording of a bridge, or of the devices.
    file: PathBuf,
    /// Folder for latency.json and latency.txt.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// What each stage takes: medians over frames, one thread.
#[derive(Debug, Clone, Serialize)]
struct Stages {
    recording: String,
    frames: usize,
    tags: usize,
    /// Instructions of a frame on the bridge by the planner's model, and their time if each takes a cycle.
    bridge_instructions: f64,
    bridge_ms: f64,
    /// A frame's packets to rows of maps.
    receive_ms: f64,
    /// A radar frame's square maps and angle map.
    radar_ms: f64,
    /// Phase differences of all tags in a frame.
    reads_ms: f64,
    /// A frame as the network takes it.
    features_ms: f64,
    kernels: String,
    models: Vec<OfModel>,
}

/// What a network takes.
#[derive(Debug, Clone, Serialize)]
struct OfModel {
    precision: &'static str,
    /// A frame that comes.
    frame_ms: f64,
    /// The answer on so many frames that came.
    answer_ms: f64,
    window_frames: usize,
    /// A last frame through all stages of the host, and the answer.
    end_to_end_ms: f64,
}

/// Times of stages, s, frame by frame.
#[derive(Debug, Default)]
struct Times {
    receive: Vec<f64>,
    radar: Vec<f64>,
    reads: Vec<f64>,
    features: Vec<f64>,
}

fn median_ms(seconds: Vec<f64>) -> f64 {
    1e3 * median(seconds).unwrap_or(0.0)
}

fn seconds(work: impl FnOnce()) -> f64 {
    let began = Instant::now();
    work();
    began.elapsed().as_secs_f64()
}

impl Times {
    /// Takes a recording once; hands each aligned frame to `take`, whose time is that of its features.
    fn round(&mut self, packets: &[Vec<u8>], mut stream: FrameStream, mut take: impl FnMut(&AlignedFrame)) {
        let mut receiver = Receiver::new();
        let (mut receiving_s, mut reading_s) = (0.0, 0.0);
        for packet in packets {
            let mut next = None;
            // What is no packet is counted by the receiver.
            receiving_s += seconds(|| {
                let _ = receiver.push(packet);
                next = receiver.next();
            });
            let now = receiver.time();
            while let Some(received) = next.take() {
                match received {
                    Received::Frame(frame) => {
                        self.radar.push(seconds(|| stream.push_frame(&frame)));
                        self.receive.push(std::mem::take(&mut receiving_s));
                        receiver.recycle(frame);
                    }
                    other => reading_s += seconds(|| stream.take(&other, now)),
                }
                receiving_s += seconds(|| next = receiver.next());
            }
            reading_s += seconds(|| stream.advance(now));
            while let Some(aligned) = stream.next() {
                self.reads.push(std::mem::take(&mut reading_s));
                self.features.push(seconds(|| take(&aligned)));
                stream.recycle(aligned);
            }
        }
    }
}

/// Frames that follow each other with the same tags.
fn keep(kept: &mut Vec<Frames>, settings: Settings, tags: usize, frame: rfhoi_network::sample::Frame<'_>) {
    match kept.last_mut().filter(|frames| frames.tags == tags) {
        Some(frames) => frames.push(frame),
        None => {
            let mut frames = Frames::new(settings.points, tags, settings.antennas);
            frames.push(frame);
            kept.push(frames);
        }
    }
}

impl Latency {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let progress = Progress::new("timing")?;
        let names = names()?;
        let (int8, reference) = (built_in(Precision::Int8)?, built_in(Precision::F32)?);
        let radar = Maps::of(&int8.description)?.config(None)?;
        let mut all: Vec<Vec<u8>> = Vec::new();
        packets(&self.file, Some(&radar), &mut |_, packet| all.push(packet.to_vec()), &mut |share| {
            progress.show(share / 4.0)
        })
        .with_context(|| format!("cannot read {}", self.file.display()))?;
        let settings = settings(&int8.description)?;
        let (mut times, mut kept) = (Times::default(), Vec::new());
        for round in 0..ROUNDS {
            ensure!(progress.show(0.25 + 0.5 * round as f64 / ROUNDS as f64), "stopped");
            let stream = FrameStream::new(settings.stream(&radar).map_err(AlignError::from)?)?;
            let mut features = settings.frame_features(&radar);
            times.round(&all, stream, |aligned| {
                let frame = features.frame(aligned);
                if round == 0 {
                    keep(&mut kept, settings, aligned.phases().tags(), frame);
                }
            });
        }
        let window = kept.iter().max_by_key(|frames| frames.len());
        let window = window.context("the recording has no frames of the radar: see `rfhoi inspect`")?;
        let mut stages = self.stages(times, &radar, window.tags);
        for (model, share) in [(&int8, 0.8), (&reference, 0.9)] {
            ensure!(progress.show(share), "stopped");
            let vectors: Vec<f32> = (0..window.tags).flat_map(|_| names.mean().iter().copied()).collect();
            let timed = stages.of_model(model, window, &vectors)?;
            stages.models.push(timed);
        }
        drop(progress);
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        atomic::write(self.out.join("latency.json"), &serde_json::to_vec_pretty(&stages)?)?;
        atomic::write(self.out.join("latency.txt"), stages.text().as_bytes())?;
        if json {
            println!("{}", serde_json::to_string(&stages)?);
        } else {
            print!("{}", stages.text());
        }
        Ok(())
    }

    fn stages(&self, times: Times, radar: &RadarConfig, tags: usize) -> Stages {
        let instructions = Instructions::of(&radar.profile, radar.processing.gate).total();
        Stages {
            recording: self.file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            frames: times.features.len() / ROUNDS,
            tags,
            bridge_instructions: instructions.round(),
            bridge_ms: 1e3 * instructions / BOARD_HZ,
            receive_ms: median_ms(times.receive),
            radar_ms: median_ms(times.radar),
            reads_ms: median_ms(times.reads),
            features_ms: median_ms(times.features),
            kernels: Kernels::best().level().to_string(),
            models: Vec::new(),
        }
    }
}

impl Stages {
    /// Times a model on the first frames of `frames`, up to 6 s.
    fn of_model(&self, model: &Model, frames: &Frames, vectors: &[f32]) -> anyhow::Result<OfModel> {
        let mut runner = runner(model, Kernels::best())?;
        let count = learn::WINDOW.min(frames.len());
        let (mut pushes, mut answers) = (Vec::new(), Vec::new());
        for _ in 0..ANSWERS {
            runner.clear();
            for number in 0..count {
                let began = Instant::now();
                runner.push(frames.frame(number))?;
                pushes.push(began.elapsed().as_secs_f64());
            }
            let began = Instant::now();
            runner.answer(0..count, vectors)?;
            answers.push(began.elapsed().as_secs_f64());
        }
        let (frame_ms, answer_ms) = (median_ms(pushes), median_ms(answers));
        let before = self.receive_ms + self.radar_ms + self.reads_ms + self.features_ms;
        Ok(OfModel {
            precision: model.description.precision.name(),
            frame_ms,
            answer_ms,
            window_frames: count,
            end_to_end_ms: before + frame_ms + answer_ms,
        })
    }

    fn text(&self) -> String {
        let Self { recording, frames, tags, kernels, .. } = self;
        let mut text = format!("{recording}: {frames} frames, {tags} tags; medians, one thread, {kernels}\n");
        let millions = self.bridge_instructions / 1e6;
        let mut row = |name: &str, ms: f64, note: &str| {
            text.push_str(&format!("{name:<44} {ms:>9.4} ms  {note}"));
            text.truncate(text.trim_end().len());
            text.push('\n');
        };
        let note = format!("{millions:.1} million instructions, if each takes a cycle of 480 MHz");
        row("bridge: samples to packets", self.bridge_ms, &note);
        row("host: packets to rows of maps", self.receive_ms, "");
        row("host: square maps and angles", self.radar_ms, "");
        row("host: phase differences of all tags", self.reads_ms, "");
        row("host: a frame as the network takes it", self.features_ms, "");
        for model in &self.models {
            let OfModel { precision, frame_ms, answer_ms, window_frames, end_to_end_ms } = model;
            row(&format!("network, {precision}: a frame that comes"), *frame_ms, "");
            row(&format!("network, {precision}: answer"), *answer_ms, &format!("on {window_frames} frames"));
            row(&format!("host, {precision}: last packet to answer"), *end_to_end_ms, "");
        }
        text
    }
}
