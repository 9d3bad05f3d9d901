//! `rfhoi experiment latency`: what each stage takes on this machine, from a bridge's packets to the answer.

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args;
use rfhoi::atomic;
use rfhoi::plan::instructions::Instructions;
use rfhoi::recognize::model::{built_in, runner, settings};
use rfhoi::recognize::radar::Maps;
use rfhoi::replay::packets;
use rfhoi_int8::Kernels;
use rfhoi_network::model::Precision;
use serde::Serialize;

use super::stages::{ANSWERS, OfNetwork, Stages, measure, time};
use crate::commands::Progress;
use crate::commands::train::names;

/// Clock of the default board, Hz.
const BOARD_HZ: f64 = 480e6;
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
struct Measured {
    recording: String,
    frames: usize,
    tags: usize,
    /// Instructions of a frame on the bridge by the planner's model, and their time if each takes a cycle.
    bridge_instructions: f64,
    bridge_ms: f64,
    #[serde(flatten)]
    stages: Stages,
    kernels: String,
    models: Vec<OfModel>,
}

/// What a network takes.
#[derive(Debug, Clone, Serialize)]
struct OfModel {
    precision: &'static str,
    #[serde(flatten)]
    network: OfNetwork,
    /// A last frame through all stages of the host, and the answer.
    end_to_end_ms: f64,
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
        let (stages, frames, window) =
            measure(&all, &radar, settings, |share| progress.show(0.25 + 0.5 * share))?;
        let instructions = Instructions::of(&radar.profile, radar.processing.gate).total();
        let mut measured = Measured {
            recording: self.file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            frames,
            tags: window.tags,
            bridge_instructions: instructions.round(),
            bridge_ms: 1e3 * instructions / BOARD_HZ,
            stages,
            kernels: Kernels::best().level().to_string(),
            models: Vec::new(),
        };
        let vectors: Vec<f32> = (0..window.tags).flat_map(|_| names.mean().iter().copied()).collect();
        for (model, share) in [(&int8, 0.8), (&reference, 0.9)] {
            ensure!(progress.show(share), "stopped");
            let network = time(runner(model, Kernels::best())?.as_mut(), &window, &vectors, ANSWERS)?;
            measured.models.push(OfModel {
                precision: model.description.precision.name(),
                end_to_end_ms: stages.sum_ms() + network.frame_ms + network.answer_ms,
                network,
            });
        }
        drop(progress);
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        atomic::write(self.out.join("latency.json"), &serde_json::to_vec_pretty(&measured)?)?;
        atomic::write(self.out.join("latency.txt"), measured.text().as_bytes())?;
        if json {
            println!("{}", serde_json::to_string(&measured)?);
        } else {
            print!("{}", measured.text());
        }
        Ok(())
    }
}

impl Measured {
    fn text(&self) -> String {
        let Self { recording, frames, tags, stages, kernels, .. } = self;
        let mut text = format!("{recording}: {frames} frames, {tags} tags; medians, one thread, {kernels}\n");
        let millions = self.bridge_instructions / 1e6;
        let mut row = |name: &str, ms: f64, note: &str| {
            text.push_str(&format!("{name:<44} {ms:>9.4} ms  {note}"));
            text.truncate(text.trim_end().len());
            text.push('\n');
        };
        let note = format!("{millions:.1} million instructions, if each takes a cycle of 480 MHz");
        row("bridge: samples to packets", self.bridge_ms, &note);
        row("host: packets to rows of maps", stages.receive_ms, "");
        row("host: square maps and angles", stages.radar_ms, "");
        row("host: phase differences of all tags", stages.reads_ms, "");
        row("host: a frame as the network takes it", stages.features_ms, "");
        for model in &self.models {
            let OfModel { precision, network, end_to_end_ms } = model;
            let OfNetwork { frame_ms, answer_ms, window_frames } = network;
            row(&format!("network, {precision}: a frame that comes"), *frame_ms, "");
            row(&format!("network, {precision}: answer"), *answer_ms, &format!("on {window_frames} frames"));
            row(&format!("host, {precision}: last packet to answer"), *end_to_end_ms, "");
        }
        text
    }
}
