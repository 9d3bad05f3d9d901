//! A device with an IP stack of its own at the switch.

use std::net::Ipv4Addr;

use embassy_net::tcp::TcpSocket;
use embassy_net::udp::{PacketMetadata, UdpSocket};
use embassy_net::{Config, IpEndpoint, Ipv4Cidr, Runner, Stack, StackResources, StaticConfigV4};
use rfhoi_shared::config::Endpoint;
use rfhoi_shared::wire::MAX_PACKET;

use super::switch::{Port, Switch};

/// Sockets of a station, at most.
const SOCKETS: usize = 8;
/// Datagrams that a socket holds in either direction.
const DATAGRAMS: usize = 64;
/// Bytes that a TCP socket holds in either direction.
const STREAM: usize = 16 * 1024;
/// Length of the network's prefix.
const PREFIX: u8 = 24;

/// A station with this address at a new outlet: the outlet's number, the stack, and what is to run.
pub(super) fn station(switch: &Switch, address: [u8; 4]) -> (usize, Stack<'static>, Runner<'static, Port>) {
    let outlet = switch.outlet();
    let mac = [0x02, 0, 0, 0, 1, address[3]];
    let config = Config::ipv4_static(StaticConfigV4 {
        address: Ipv4Cidr::new(Ipv4Addr::from(address), PREFIX),
        gateway: None,
        dns_servers: Default::default(),
    });
    let resources = Box::leak(Box::new(StackResources::<SOCKETS>::new()));
    let (stack, runner) = embassy_net::new(switch.plug(outlet, mac), config, resources, address[3].into());
    (outlet, stack, runner)
}

/// A UDP socket that is bound to this port.
///
/// # Panics
/// If the port is taken.
pub(super) fn udp_socket(stack: Stack<'static>, port: u16) -> UdpSocket<'static> {
    let metadata = || vec![PacketMetadata::EMPTY; DATAGRAMS].leak();
    let buffer = || vec![0; DATAGRAMS * MAX_PACKET].leak();
    let mut socket = UdpSocket::new(stack, metadata(), buffer(), metadata(), buffer());
    socket.bind(port).expect("the port is free");
    socket
}

/// A TCP socket.
pub(super) fn tcp_socket(stack: Stack<'static>) -> TcpSocket<'static> {
    TcpSocket::new(stack, vec![0; STREAM].leak(), vec![0; STREAM].leak())
}

/// `endpoint` for a socket.
pub(super) fn remote(endpoint: Endpoint) -> IpEndpoint {
    IpEndpoint::new(Ipv4Addr::from(endpoint.address).into(), endpoint.port)
}
