//! Packets on their way to the uplink.

use rfhoi_shared::config::Endpoint;
use rfhoi_shared::wire::MAX_PACKET;

/// A packet and whom it is for.
#[derive(Debug, Clone)]
pub(crate) struct Outgoing {
    /// `None` is the host in force when the packet leaves.
    pub(crate) to: Option<Endpoint>,
    bytes: [u8; MAX_PACKET],
    length: usize,
}

impl Outgoing {
    /// A packet of `bytes`; `None` if they are too many.
    pub(crate) fn new(to: Option<Endpoint>, bytes: &[u8]) -> Option<Self> {
        let mut packet = Self { to, bytes: [0; MAX_PACKET], length: bytes.len() };
        packet.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(packet)
    }

    /// The packet's bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or(&[])
    }
}
