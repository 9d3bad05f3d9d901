//! `rfhoi bridge`.

mod control;
mod file;
mod list;
mod show;
mod watch;

use anyhow::Context;
use clap::{Args, Subcommand};
use rfhoi::bridge::address::BridgeAddress;
use rfhoi::bridge::client::{Client, Socket};

use super::{Progress, report};

#[derive(Debug, Args)]
pub(super) struct Bridge {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    local: Local,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Find the bridges in the network.
    List(list::List),
    /// Say who a bridge is, its configuration, and how it does.
    Show(show::Show),
    /// Get a bridge's configuration as a file.
    Get(file::Get),
    /// Configure a bridge from a file, and wait until it is back.
    Set(file::Set),
    /// Write the default configuration, explained, to start from.
    Config(file::Config),
    /// Start radar and reader.
    Start(control::Start),
    /// Stop radar and reader.
    Stop(control::Stop),
    /// Restart a bridge, and wait until it is back.
    Restart(control::Restart),
    /// Follow a bridge's data, and record it.
    Watch(watch::Watch),
}

impl Bridge {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let local = &self.local;
        match &self.command {
            Command::List(command) => command.run(local, json),
            Command::Show(command) => command.run(local, json),
            Command::Get(command) => command.run(local, json),
            Command::Set(command) => command.run(local, json),
            Command::Config(command) => command.run(json),
            Command::Start(command) => command.run(local, json),
            Command::Stop(command) => command.run(local, json),
            Command::Restart(command) => command.run(local, json),
            Command::Watch(command) => command.run(local, json),
        }
    }
}

/// This computer's side.
#[derive(Debug, Args)]
struct Local {
    /// UDP port of this computer, where a firewall wants a fixed one; 0 for any.
    #[arg(long, global = true, value_name = "PORT", default_value_t = 0)]
    port: u16,
}

impl Local {
    fn socket(&self) -> anyhow::Result<Socket> {
        Ok(Socket::open(self.port)?)
    }
}

/// The bridge that is meant.
#[derive(Debug, Args)]
struct Target {
    /// IP[:PORT], a host name, or auto for the only bridge in the network.
    address: BridgeAddress,
}

impl Target {
    fn client(&self, local: &Local, progress: &Progress) -> anyhow::Result<Client> {
        let mut socket = local.socket()?;
        let peer = self.address.resolve(&mut socket, &mut |share| progress.show(share))?;
        Ok(Client::new(socket, peer))
    }
}

/// A time given in seconds.
fn seconds(value: f64) -> anyhow::Result<std::time::Duration> {
    std::time::Duration::try_from_secs_f64(value).with_context(|| format!("--seconds {value}"))
}
