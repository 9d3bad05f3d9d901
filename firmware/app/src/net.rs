//! Addresses of the configuration as those of the IP stack.

use core::net::Ipv4Addr;

use embassy_net::udp::UdpMetadata;
use embassy_net::{Config, DhcpConfig, IpAddress, IpEndpoint, Ipv4Cidr, StaticConfigV4};
use rfhoi_shared::config::{Address, BridgeConfig, Endpoint};

/// Sockets that the application opens: recorder, two for hosts, reader, and DHCP's.
pub const SOCKETS: usize = 5;

/// The IP stack's configuration.
pub fn ip_configuration(config: &BridgeConfig) -> Config {
    match config.address {
        Address::Dhcp => Config::dhcpv4(DhcpConfig::default()),
        Address::Static { address, prefix, gateway } => Config::ipv4_static(StaticConfigV4 {
            // A longer prefix is refused by `BridgeConfig::validate`.
            address: Ipv4Cidr::new(Ipv4Addr::from(address), prefix.min(32)),
            gateway: gateway.map(Ipv4Addr::from),
            dns_servers: heapless::Vec::new(),
        }),
    }
}

/// `endpoint` for a socket.
pub(crate) fn remote(endpoint: Endpoint) -> IpEndpoint {
    IpEndpoint::new(IpAddress::Ipv4(Ipv4Addr::from(endpoint.address)), endpoint.port)
}

/// Who sent a datagram.
pub(crate) fn sender(metadata: &UdpMetadata) -> Endpoint {
    let IpAddress::Ipv4(address) = metadata.endpoint.addr;
    Endpoint { address: address.octets(), port: metadata.endpoint.port }
}
