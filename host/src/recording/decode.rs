//! From captured bytes to UDP payloads and TCP segments.

use std::net::SocketAddrV4;

use etherparse::{EtherType, NetSlice, SlicedPacket, TransportSlice};

use super::file::Link;
use super::tcp::Segment;

/// Bytes of the "cooked" header that Linux writes for the device `any`, version 2; its first two are the EtherType.
const SLL2_HEADER: usize = 20;

/// What a packet is.
pub(super) enum Content<'a> {
    Udp { source: SocketAddrV4, destination: SocketAddrV4, payload: &'a [u8] },
    Tcp { source: SocketAddrV4, destination: SocketAddrV4, segment: Segment<'a> },
    Fragment,
    Other,
    Malformed,
}

/// Decodes a whole packet. Checksums are not verified: captures of sent packets lack them where the network card makes
/// them.
pub(super) fn decode(link: Link, packet: &[u8]) -> Content<'_> {
    let sliced = match link {
        Link::Ethernet => SlicedPacket::from_ethernet(packet),
        Link::LinuxSll => SlicedPacket::from_linux_sll(packet),
        Link::RawIp => SlicedPacket::from_ip(packet),
        Link::LinuxSll2 => match packet.split_at_checked(SLL2_HEADER) {
            Some(([high, low, ..], rest)) => {
                SlicedPacket::from_ether_type(EtherType(u16::from_be_bytes([*high, *low])), rest)
            }
            _ => return Content::Malformed,
        },
    };
    let Ok(sliced) = sliced else { return Content::Malformed };
    let Some(NetSlice::Ipv4(ip)) = &sliced.net else { return Content::Other };
    if ip.is_payload_fragmented() {
        return Content::Fragment;
    }
    let (from, to) = (ip.header().source_addr(), ip.header().destination_addr());
    let addresses = |ports: (u16, u16)| (SocketAddrV4::new(from, ports.0), SocketAddrV4::new(to, ports.1));
    match &sliced.transport {
        Some(TransportSlice::Udp(udp)) => {
            let (source, destination) = addresses((udp.source_port(), udp.destination_port()));
            Content::Udp { source, destination, payload: udp.payload() }
        }
        Some(TransportSlice::Tcp(tcp)) => {
            let (source, destination) = addresses((tcp.source_port(), tcp.destination_port()));
            let segment = Segment {
                sequence: tcp.sequence_number(),
                syn: tcp.syn(),
                rst: tcp.rst(),
                payload: tcp.payload(),
            };
            Content::Tcp { source, destination, segment }
        }
        _ => Content::Other,
    }
}
