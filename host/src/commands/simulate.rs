//! `rfhoi simulate`.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use rfhoi::atomic;
use rfhoi::simulate::recording::{Options, record};
use rfhoi_firmware::mmwave::cfg::{self, DemoOptions, LvdsStream};
use rfhoi_shared::radar::RadarProfile;
use serde::Serialize;

use super::{ProfileArgs, Progress, report};

#[derive(Debug, Args)]
pub(super) struct Simulate {
    /// File to write: what radar and reader send, as packets (.pcap, or .pcap.gz); its profile goes beside it (.cfg).
    #[arg(long, value_name = "FILE")]
    recording: PathBuf,
    /// Length, s.
    #[arg(long, default_value_t = 4.0)]
    seconds: f64,
    /// Seed of all noise; the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    profile: ProfileArgs,
}

#[derive(Debug, Serialize)]
struct Written {
    simulated: bool,
    seed: u64,
    recording: PathBuf,
    profile: PathBuf,
    #[serde(flatten)]
    summary: rfhoi::simulate::recording::Summary,
}

impl Simulate {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let name = self.recording.to_string_lossy();
        let stem = name.strip_suffix(".gz").unwrap_or(&name);
        let stem = stem
            .strip_suffix(".pcap")
            .with_context(|| format!("{name}: name the recording .pcap or .pcap.gz"))?;
        let beside = PathBuf::from(format!("{stem}.cfg"));
        let profile = self.profile.load(None)?.unwrap_or_else(RadarProfile::default);
        let options = Options { profile: profile.clone(), seconds: self.seconds, seed: self.seed };
        let progress = Progress::new(format!("simulating {name}"))?;
        let summary = record(&self.recording, &options, &mut |share| progress.show(share))?;
        drop(progress);
        let mut text = String::new();
        let demo = DemoOptions { lvds: LvdsStream::RAW, ..DemoOptions::default() };
        cfg::write(&profile, &demo, &mut text).context("this profile cannot be written as a CLI profile")?;
        atomic::write(&beside, text.as_bytes())?;
        let written = Written {
            simulated: true,
            seed: self.seed,
            recording: self.recording.clone(),
            profile: beside,
            summary,
        };
        report::print(&written, json)
    }
}
