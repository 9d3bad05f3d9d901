//! `rfhoi inspect`.

use std::path::PathBuf;

use clap::Args;
use rfhoi::inspect::{Options, inspect};
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::MetresPerSecond;

use super::{ProfileArgs, Progress, report};

#[derive(Debug, Args)]
pub(super) struct Inspect {
    /// DCA1000 samples (.bin, .npy), packets (.pcap, .pcapng, .gz), SDK demo UART (.dat, .csv), LLRP messages, tag reads,
    /// human motion (.amc, .asf, .bvh, Kinect joints).
    file: PathBuf,
    /// Also list frame by frame, message by message, read by read, joint by joint.
    #[arg(long)]
    list: bool,
    /// Fastest tag, m/s: bounds the intervals between reads that mean something.
    #[arg(long, value_name = "M_PER_S", default_value_t = Scene::default().fastest_tag.0)]
    fastest_tag: f32,
    #[command(flatten)]
    profile: ProfileArgs,
}

impl Inspect {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        anyhow::ensure!(
            self.fastest_tag > 0.0,
            "--fastest-tag {}: need a speed above 0 m/s",
            self.fastest_tag
        );
        let scene = Scene { fastest_tag: MetresPerSecond(self.fastest_tag), ..Scene::default() };
        let profile = self.profile.load(Some(&self.file))?;
        let progress = Progress::new(format!("inspecting {}", self.file.display()))?;
        let options = Options { profile, scene, list: self.list };
        let found = inspect(&self.file, &options, &mut |share| progress.show(share))?;
        drop(progress);
        report::print(&found, json)
    }
}
