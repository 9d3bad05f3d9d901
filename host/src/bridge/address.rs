//! What a user may write for a bridge: `IP`, `IP:PORT`, a host name with or without a port, or `auto`.

use std::convert::Infallible;
use std::net::{SocketAddr, SocketAddrV4, ToSocketAddrs};
use std::str::FromStr;

use rfhoi_shared::wire::BRIDGE_PORT;

use super::BridgeError;
use super::client::Socket;
use super::discovery;

/// A bridge as a user names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BridgeAddress {
    /// The only bridge in the network.
    Auto,
    /// A name or address, perhaps with a port.
    Named(String),
}

impl FromStr for BridgeAddress {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(if text == "auto" { Self::Auto } else { Self::Named(text.to_owned()) })
    }
}

impl BridgeAddress {
    /// The address behind the name.
    ///
    /// # Errors
    /// If the name has none in IPv4; for `auto`, if not exactly one bridge answers.
    pub fn resolve(
        &self,
        socket: &mut Socket,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Result<SocketAddrV4, BridgeError> {
        let Self::Named(text) = self else { return discovery::only(socket, go_on) };
        let no_address = |reason: String| BridgeError::Address { text: text.clone(), reason };
        let found = match text.rsplit_once(':') {
            Some(_) => text.to_socket_addrs(),
            None => (text.as_str(), BRIDGE_PORT).to_socket_addrs(),
        };
        let mut found = found.map_err(|e| no_address(e.to_string()))?;
        found
            .find_map(|a| if let SocketAddr::V4(a) = a { Some(a) } else { None })
            .ok_or_else(|| no_address("it has no IPv4 address, and bridges speak IPv4".to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(text: &str) -> Result<String, String> {
        let mut socket = Socket::open(0).unwrap();
        let address: BridgeAddress = text.parse().unwrap();
        address.resolve(&mut socket, &mut |_| true).map(|a| a.to_string()).map_err(|e| e.to_string())
    }

    #[test]
    fn addresses_ports_and_names() {
        assert_eq!(resolved("10.0.0.3").unwrap(), "10.0.0.3:4780");
        assert_eq!(resolved("10.0.0.3:99").unwrap(), "10.0.0.3:99");
        assert_eq!(resolved("localhost").unwrap(), "127.0.0.1:4780");
        for wrong in ["10.0.0.3:port", "[::1]:80", ""] {
            let error = resolved(wrong).unwrap_err();
            assert!(error.contains("IP:PORT"), "{error}");
        }
    }
}
