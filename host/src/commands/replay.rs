//! `rfhoi replay`.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use rfhoi::profile::regroup;
use rfhoi::replay::{Options, VibratingTarget, replay};
use rfhoi_shared::config::ClutterRemoval;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::{Metres, MetresPerSecond, Seconds};

use super::{ProfileArgs, Progress, report};

#[derive(Debug, Args)]
pub(super) struct Replay {
    /// A recording that `rfhoi inspect` recognises.
    file: PathBuf,
    /// Folder for pictures (.png) and numbers (.npz); made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Keep range bins up to this depth, m; by default all of them.
    #[arg(long, value_name = "M")]
    depth: Option<f32>,
    /// Removal of what does not move; by default the mean over a frame, or the background where a frame has few loops.
    #[arg(long, value_enum)]
    clutter: Option<ClutterName>,
    /// Time constant of the background, s.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    time_constant: f32,
    /// Take so many loops of consecutive frames as one frame, for recordings with few loops a frame.
    #[arg(long, value_name = "LOOPS")]
    regroup: Option<u16>,
    /// Tell how the strongest target of raw samples vibrates, or that at RANGE_M: displacement and spectrum over the frames.
    #[arg(long, value_name = "RANGE_M", num_args = 0..=1, conflicts_with = "regroup")]
    vibration: Option<Option<f32>>,
    /// Write frames of both radios on one time axis (aligned.npz), as a network takes them, with maps of POINTS each way.
    #[arg(long, value_name = "POINTS", num_args = 0..=1, default_missing_value = "64")]
    aligned: Option<usize>,
    /// Fastest tag, m/s: bounds the intervals between reads that mean something.
    #[arg(long, value_name = "M_PER_S", default_value_t = Scene::default().fastest_tag.0)]
    fastest_tag: f32,
    #[command(flatten)]
    profile: ProfileArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ClutterName {
    Mean,
    Background,
    Off,
}

impl Replay {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        anyhow::ensure!(
            self.fastest_tag > 0.0,
            "--fastest-tag {}: need a speed above 0 m/s",
            self.fastest_tag
        );
        anyhow::ensure!(self.depth.is_none_or(|d| d > 0.0), "--depth must be above 0 m");
        let mut profile = self.profile.load(Some(&self.file))?;
        if let (Some(loops), Some(found)) = (self.regroup, &profile) {
            profile = Some(regroup(found, loops).with_context(|| format!("--regroup {loops}"))?);
        }
        let scene = Scene {
            depth: self.depth.map_or(Scene::default().depth, Metres),
            fastest_tag: MetresPerSecond(self.fastest_tag),
            ..Scene::default()
        };
        let clutter = self.clutter.map(|name| match name {
            ClutterName::Mean => ClutterRemoval::Mean,
            ClutterName::Background => {
                ClutterRemoval::Background { time_constant: Seconds(self.time_constant) }
            }
            ClutterName::Off => ClutterRemoval::Off,
        });
        let vibration = self
            .vibration
            .map(|range| range.map_or(VibratingTarget::Strongest, |m| VibratingTarget::At(Metres(m))));
        anyhow::ensure!(
            vibration.is_none() || profile.is_some(),
            "--vibration needs raw samples and their --profile"
        );
        let options = Options {
            profile,
            scene,
            clutter,
            whole_range: self.depth.is_none(),
            vibration,
            aligned: self.aligned,
        };
        let progress = Progress::new(format!("replaying {}", self.file.display()))?;
        let summary = replay(&self.file, &options, &self.out, &mut |share| progress.show(share))?;
        drop(progress);
        report::print(&summary, json)
    }
}
