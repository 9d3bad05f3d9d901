//! `rfhoi bridge start`, `stop` and `restart`.

use std::net::SocketAddrV4;

use clap::Args;
use rfhoi::bridge::health::Identity;
use rfhoi_shared::wire::Request;
use serde::Serialize;

use super::{Local, Progress, Target, report};

#[derive(Debug, Args)]
pub(super) struct Start {
    #[command(flatten)]
    target: Target,
}

#[derive(Debug, Args)]
pub(super) struct Stop {
    #[command(flatten)]
    target: Target,
}

#[derive(Debug, Args)]
pub(super) struct Restart {
    #[command(flatten)]
    target: Target,
}

#[derive(Debug, Serialize)]
struct Done {
    address: SocketAddrV4,
    done: &'static str,
    #[serde(flatten)]
    identity: Option<Identity>,
    notices: Vec<String>,
}

impl Start {
    pub(super) fn run(&self, local: &Local, json: bool) -> anyhow::Result<()> {
        simple(&self.target, local, Request::Start, "start", json)
    }
}

impl Stop {
    pub(super) fn run(&self, local: &Local, json: bool) -> anyhow::Result<()> {
        simple(&self.target, local, Request::Stop, "stop", json)
    }
}

fn simple(
    target: &Target,
    local: &Local,
    request: Request,
    done: &'static str,
    json: bool,
) -> anyhow::Result<()> {
    let progress = Progress::waiting("asking the bridge")?;
    let mut client = target.client(local, &progress)?;
    client.ask(request, &mut |share| progress.show(share))?;
    drop(progress);
    let notices = client.take_notices();
    report::print(&Done { address: client.peer(), done, identity: None, notices }, json)
}

impl Restart {
    pub(super) fn run(&self, local: &Local, json: bool) -> anyhow::Result<()> {
        let progress = Progress::waiting("restarting the bridge")?;
        let mut client = self.target.client(local, &progress)?;
        let back = client.restart(&mut |share| progress.show(share))?;
        drop(progress);
        let (address, notices) = (client.peer(), client.take_notices());
        report::print(&Done { address, done: "restart", identity: Some((&back).into()), notices }, json)
    }
}
