//! `rfhoi bridge list`.

use std::net::{Ipv4Addr, SocketAddrV4};

use clap::Args;
use rfhoi::bridge::BridgeError;
use rfhoi::bridge::address::BridgeAddress;
use rfhoi::bridge::discovery::{Found, LISTEN, broadcasts, discover};
use rfhoi::bridge::health::Identity;
use serde::Serialize;

use super::{Local, Progress, report, seconds};

#[derive(Debug, Args)]
pub(super) struct List {
    /// How long to listen, s.
    #[arg(long, value_name = "S", default_value_t = LISTEN.as_secs_f64())]
    seconds: f64,
    /// Ask this address, of a bridge or a broadcast, instead of all networks of this computer.
    #[arg(long, value_name = "IP[:PORT]")]
    address: Option<BridgeAddress>,
}

#[derive(Debug, Serialize)]
struct Bridges {
    bridges: Vec<Row>,
}

#[derive(Debug, Serialize)]
struct Row {
    address: SocketAddrV4,
    #[serde(flatten)]
    answer: Answer,
}

#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Answer {
    Bridge {
        #[serde(flatten)]
        identity: Identity,
        up_s: f64,
    },
    Other {
        problem: String,
    },
}

impl List {
    pub(super) fn run(&self, local: &Local, json: bool) -> anyhow::Result<()> {
        let length = seconds(self.seconds)?;
        let progress = Progress::new("listening for bridges")?;
        let mut go_on = |share| progress.show(share);
        let mut socket = local.socket()?;
        let targets = match &self.address {
            Some(address) => vec![address.resolve(&mut socket, &mut go_on)?],
            None => broadcasts(),
        };
        let mut bridges = Vec::new();
        let found = |found: Found| {
            bridges.push(row(&found));
            true
        };
        discover(&mut socket, &targets, length, found, &mut go_on)?;
        drop(progress);
        if bridges.is_empty() {
            let is_one = |t: &&SocketAddrV4| self.address.is_some() && *t.ip() != Ipv4Addr::BROADCAST;
            return Err(match targets.first().filter(is_one) {
                Some(&peer) => BridgeError::Unanswered { peer },
                None => BridgeError::NoneFound,
            }
            .into());
        }
        bridges.sort_by_key(|b| b.address);
        report::print(&Bridges { bridges }, json)
    }
}

fn row(found: &Found) -> Row {
    let answer = match &found.hello {
        Ok(hello) => Answer::Bridge { identity: hello.into(), up_s: found.up.seconds() },
        Err(error) => Answer::Other { problem: error.to_string() },
    };
    Row { address: found.address, answer }
}
