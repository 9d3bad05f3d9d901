//! `rfhoi plan`.

use std::path::PathBuf;

use anyhow::Context;
use clap::{ArgAction, Args};
use rfhoi::atomic;
use rfhoi::bridge::settings::{self, ReaderAddress};
use rfhoi::plan::limits::{Board, Link};
use rfhoi::plan::{Antennas, Means, Needs, Report, Text, host_time, paper, plan};
use rfhoi::simulate::scene::Scene;
use rfhoi_shared::config::Endpoint;
use rfhoi_shared::units::{Metres, MetresPerSecond};

use super::report;

#[derive(Debug, Args)]
pub(super) struct Plan {
    /// Scene: a built-in room or a file (see host/scenes).
    scene: String,
    /// Write a configuration for `rfhoi bridge set` to this file (.toml).
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The reader's address, for --out.
    #[arg(long, value_name = "IP", requires = "out")]
    reader: Option<ReaderAddress>,
    /// Print what the paper's configuration costs beside it.
    #[arg(long)]
    compare: bool,
    /// What carries the radar's samples to the bridge: Mbit/s of an Ethernet, usb, or uart.
    #[arg(long, default_value = "100")]
    link: Link,
    /// The bridge's board.
    #[arg(long, default_value = Board::NUCLEO_H743ZI.name)]
    board: Board,
    #[command(flatten)]
    needs: NeedsArgs,
}

/// What replaces the scene's needs.
#[derive(Debug, Args)]
struct NeedsArgs {
    /// Range to which the maps reach, m.
    #[arg(long, value_name = "M")]
    depth: Option<f32>,
    /// Fastest radial speed of a hand or body, m/s.
    #[arg(long, value_name = "M_PER_S")]
    fastest_hand: Option<f32>,
    /// Fastest radial speed of a tag, m/s.
    #[arg(long, value_name = "M_PER_S")]
    fastest_tag: Option<f32>,
    /// Finest step of range, m.
    #[arg(long, value_name = "M")]
    range_resolution: Option<f32>,
    /// Finest step of radial speed, m/s.
    #[arg(long, value_name = "M_PER_S")]
    velocity_resolution: Option<f32>,
    /// Whether elevation tells actions apart.
    #[arg(long, value_name = "TRUE|FALSE", action = ArgAction::Set)]
    elevation: Option<bool>,
    /// Whether azimuth does.
    #[arg(long, value_name = "TRUE|FALSE", action = ArgAction::Set)]
    azimuth: Option<bool>,
    /// Tags in the field at the same time.
    #[arg(long)]
    tags: Option<u8>,
    /// Exactly so many antennas of the reader.
    #[arg(long)]
    antennas: Option<u8>,
}

impl NeedsArgs {
    fn over(&self, mut needs: Needs) -> Needs {
        needs.depth = self.depth.map_or(needs.depth, Metres);
        needs.fastest_hand = self.fastest_hand.map_or(needs.fastest_hand, MetresPerSecond);
        needs.fastest_tag = self.fastest_tag.map_or(needs.fastest_tag, MetresPerSecond);
        needs.range_resolution = self.range_resolution.map_or(needs.range_resolution, Metres);
        needs.velocity_resolution =
            self.velocity_resolution.map_or(needs.velocity_resolution, MetresPerSecond);
        needs.azimuth = self.azimuth.unwrap_or(needs.azimuth);
        needs.tags = self.tags.unwrap_or(needs.tags);
        needs.antennas = self.antennas.map_or(needs.antennas, Antennas::Exactly);
        if let Some(elevation) = self.elevation {
            needs.elevation = elevation;
            needs.elevation_because = format!("--elevation {elevation}");
        }
        needs
    }
}

impl Plan {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let scene = Scene::load_without_profile(&self.scene)?;
        let needs = self.needs.over(Needs::of(&scene));
        let means = Means { link: self.link, board: self.board };
        let plan = plan(needs, means).with_context(|| scene.name.clone())?;
        if let Some(path) = &self.out {
            let address = self.reader.map(|ReaderAddress(address)| Endpoint {
                address: address.ip().octets(),
                port: address.port(),
            });
            let config = plan.bridge(address);
            settings::check(path, &config, self.board.cube_bytes)?;
            atomic::write(path, settings::write(&config).as_bytes())?;
        }
        let beside = self.compare.then(|| paper(&plan));
        let text = Text {
            scene: &scene.name,
            plan: &plan,
            host: Some(host_time(&plan)),
            beside: beside.as_ref().map(|paper| (paper, Some(host_time(paper)))),
        };
        if json {
            return report::print(&Report::of(&text), true);
        }
        print!("{text}");
        Ok(())
    }
}
