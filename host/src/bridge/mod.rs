//! A bridge on the network, as the host speaks with it over UDP (`rfhoi_shared::wire`).
//!
//! * [`conversation`]: commands and their answers with one bridge, sans-I/O: resending, duplicates, restarts.
//! * [`client`]: the same over a socket, and the longer dealings: configure and wait until the bridge is back.
//! * [`discovery`]: which bridges there are, and what to check where there is none.
//! * [`address`]: what a user may write for a bridge.
//! * [`settings`]: the configuration as a TOML file that a person edits.
//! * [`health`], [`live`]: what telemetry and the stream of packets say, in words and rates.

pub mod address;
pub mod client;
pub mod conversation;
pub mod discovery;
pub mod health;
pub mod live;
pub mod settings;

use std::net::SocketAddrV4;

use rfhoi_shared::wire::{Refusal, WireError};

/// Why dealing with a bridge failed.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// No socket.
    #[error("cannot open a UDP socket on port {port} of this computer: {source}{}", if *.port == 0 {
        ""
    } else {
        "; another program may hold the port: leave --port away or choose another"
    })]
    Socket {
        /// The port, 0 for any.
        port: u16,
        /// What the system said.
        source: std::io::Error,
    },
    /// The system does not send there.
    #[error(
        "cannot send to {peer}: {source}; check the cable, and that this computer has an address in the bridge's network"
    )]
    Send {
        /// The bridge, or a broadcast address.
        peer: SocketAddrV4,
        /// What the system said.
        source: std::io::Error,
    },
    /// Receiving failed.
    #[error("cannot receive on the UDP socket: {0}")]
    Receive(std::io::Error),
    /// The name or address means nothing.
    #[error("{text}: {reason}; give IP, IP:PORT, a host name, or auto for the only bridge in the network")]
    Address {
        /// What was given.
        text: String,
        /// Why it is none.
        reason: String,
    },
    /// Nothing answers.
    #[error("{peer} does not answer: {}", discovery::advice(Some(*.peer.ip())))]
    Unanswered {
        /// The bridge.
        peer: SocketAddrV4,
    },
    /// No bridge in the network.
    #[error("no bridge answers a broadcast: {}", discovery::advice(None))]
    NoneFound,
    /// Which of several?
    #[error("{} bridges answer: give the address of one of {}", .0.len(), join(.0))]
    Several(Vec<SocketAddrV4>),
    /// Firmware of another version.
    #[error("{peer}: {error}")]
    Version {
        /// The bridge.
        peer: SocketAddrV4,
        /// Which versions met.
        error: WireError,
    },
    /// The bridge does not do it.
    #[error("the bridge at {peer} refuses: {refusal}")]
    Refused {
        /// The bridge.
        peer: SocketAddrV4,
        /// Why.
        refusal: Refusal,
    },
    /// It took the command to restart and was not heard of again.
    #[error(
        "the bridge took the command but has not come back within {seconds} s{}; look at its lamps or log, \
         and find it with `rfhoi bridge list`", if *.elsewhere {
            ", neither at its old address nor elsewhere in the network"
        } else {
            ""
        }
    )]
    NotBack {
        /// How long it was waited for.
        seconds: u64,
        /// Whether it was looked for at other addresses.
        elsewhere: bool,
    },
    /// It is back, but not with what it was sent.
    #[error(
        "the bridge at {peer} is back but its configuration is not the one it was sent: its memory may be worn or \
         write-protected; `rfhoi bridge get {peer}` shows what is in force"
    )]
    NotInForce {
        /// The bridge.
        peer: SocketAddrV4,
    },
    /// The user stopped it.
    #[error("stopped")]
    Interrupted,
}

fn join(addresses: &[SocketAddrV4]) -> String {
    addresses.iter().map(SocketAddrV4::to_string).collect::<Vec<_>>().join(", ")
}
