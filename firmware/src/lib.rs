//! Logic of the RF-HOI bridge: what happens between the radar's and the reader's bytes and the packets to the host.
//!
//! Every piece is sans-I/O: bytes and the time go in, bytes and events come out, nothing waits, nothing allocates, and
//! no input from a wire can make it panic. The same code therefore runs on the MCU, in QEMU, in tests and in the host's
//! `rfhoi replay`. Boards under `firmware/boards` lend it pins, clock, network driver and memory.
//!
//! # The path of a radar frame
//!
//! ```text
//! DCA1000 datagrams --dca1000::Reassembly--> rows --dsp::RangeStage--> gated cube (i16, one exponent a row)
//!                                                                        |
//!       uplink packets <--uplink::MapPacker-- maps, covariance <--dsp::DopplerStage (one range bin at a time)
//!
//! SDK demo's UART  --mmwave::tlv--> range profile, heatmap, points --uplink::Uplink--> uplink packets
//! CLI profile      --mmwave::cfg--> RadarProfile;  --mmwave::cli--> lines to the radar, `Done` or `Error` back
//! LLRP over TCP    --llrp::Client--> tag reads on the bridge's clock --uplink::Uplink--> uplink packets
//! ```
//!
//! [`bridge`] joins them; [`simulated`] is a radar for tests, [`reference`](mod@reference) its scene with a digest of what
//! comes out. To change how a device is spoken to, go to its module ([`dca1000`], [`mmwave`], [`llrp`]);
//! to change what is computed, to [`dsp`]; to change what the host gets, to `rfhoi_shared::wire` and [`uplink`].
#![no_std]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::indexing_slicing
    )
)]

#[cfg(test)]
extern crate std;

pub mod bridge;
pub mod dca1000;
pub mod dsp;
pub mod llrp;
pub mod mmwave;
pub mod reference;
pub mod simulated;
pub mod uplink;
