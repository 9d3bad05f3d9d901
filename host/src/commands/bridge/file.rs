//! `rfhoi bridge get`, `set` and `config`: configurations as files.

use std::net::SocketAddrV4;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use rfhoi::atomic;
use rfhoi::bridge::BridgeError;
use rfhoi::bridge::client::in_force;
use rfhoi::bridge::health::Identity;
use rfhoi::bridge::settings::{self, Settings};
use rfhoi_shared::config::BridgeConfig;
use serde::Serialize;

use super::{Local, Progress, Target, report};

#[derive(Debug, Args)]
pub(super) struct Get {
    #[command(flatten)]
    target: Target,
    /// Write it to this file (.toml) instead of the standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct Set {
    #[command(flatten)]
    target: Target,
    /// Configuration (.toml), from `rfhoi bridge get` or `rfhoi bridge config`.
    file: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct Config {
    /// Write it to this file (.toml) instead of the standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Serialize)]
struct Written<'a> {
    written: &'a Path,
}

#[derive(Debug, Serialize)]
struct Configured {
    address: SocketAddrV4,
    /// Whether anything had to be changed.
    changed: bool,
    #[serde(flatten)]
    identity: Identity,
    notices: Vec<String>,
}

/// Writes `config` to the file, or prints it.
fn put(config: &BridgeConfig, out: Option<&Path>, json: bool) -> anyhow::Result<()> {
    match out {
        Some(path) => {
            atomic::write(path, settings::write(config).as_bytes())?;
            report::print(&Written { written: path }, json)
        }
        None if json => report::print(&Settings::of(config), true),
        None => {
            print!("{}", settings::write(config));
            Ok(())
        }
    }
}

impl Get {
    pub(super) fn run(&self, local: &Local, json: bool) -> anyhow::Result<()> {
        let progress = Progress::waiting("asking the bridge")?;
        let config = self.target.client(local, &progress)?.config(&mut |share| progress.show(share))?;
        drop(progress);
        put(&config, self.out.as_deref(), json)
    }
}

impl Config {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        put(&BridgeConfig::default(), self.out.as_deref(), json)
    }
}

impl Set {
    pub(super) fn run(&self, local: &Local, json: bool) -> anyhow::Result<()> {
        let config = settings::read(&self.file)?;
        let progress = Progress::waiting("configuring the bridge")?;
        let mut go_on = |share| progress.show(share);
        let mut client = self.target.client(local, &progress)?;
        let hello = client.identify(&mut go_on)?;
        settings::check(&self.file, &config, hello.cube_bytes)?;
        let changed = !in_force(&client.config(&mut go_on)?, &config);
        let back = if changed {
            let kept =
                "nothing has changed but radar and reader are stopped; `rfhoi bridge start` starts them";
            match client.configure(&config, &hello, &mut go_on) {
                Err(error @ BridgeError::Refused { .. }) => return Err(error).context(kept),
                other => other?,
            }
        } else {
            hello
        };
        drop(progress);
        let configured = Configured {
            address: client.peer(),
            changed,
            identity: (&back).into(),
            notices: client.take_notices(),
        };
        report::print(&configured, json)
    }
}
