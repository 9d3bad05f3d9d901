//! Which bridges there are. Out: a broadcast hello, a few times. In: who answers.

use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};
use std::time::{Duration, Instant};

use if_addrs::{IfAddr, Ifv4Addr};
use rfhoi_shared::config::{Address, BridgeConfig};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{BRIDGE_PORT, Hello, Message, Packet, Request, WireError};

use super::BridgeError;
use super::client::Socket;
use super::conversation::Conversation;

/// How long bridges are given to answer, by default.
pub const LISTEN: Duration = Duration::from_millis(1500);
/// From one broadcast to the next.
const REPEAT: Duration = Duration::from_millis(500);

/// A bridge that answered.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Where it answers from.
    pub address: SocketAddrV4,
    /// Boot number.
    pub boot: u16,
    /// Since it started.
    pub up: BridgeTime,
    /// Who it is, or the version of the wire that it speaks instead of ours.
    pub hello: Result<Hello, WireError>,
}

/// Broadcast addresses of this computer's networks and of the local link, port [`BRIDGE_PORT`].
pub fn broadcasts() -> Vec<SocketAddrV4> {
    let mut targets = vec![Ipv4Addr::BROADCAST];
    targets.extend(networks().iter().filter_map(|n| n.broadcast));
    targets.sort();
    targets.dedup();
    targets.into_iter().map(|ip| SocketAddrV4::new(ip, BRIDGE_PORT)).collect()
}

/// Sends hello to `targets` and listens for `length`. Every bridge that answers is handed to `found`, once for each start
/// of it; that returns whether to go on. A bridge sends its data to whoever said hello last, so here it must not be asked
/// more often than needed.
///
/// # Errors
/// If no target can be sent to, or listening fails.
pub fn discover(
    socket: &mut Socket,
    targets: &[SocketAddrV4],
    length: Duration,
    mut found: impl FnMut(Found) -> bool,
    go_on: &mut dyn FnMut(f64) -> bool,
) -> Result<(), BridgeError> {
    let began = Instant::now();
    let seed = socket.seed();
    let mut conversations: Vec<Conversation> =
        targets.iter().map(|&t| Conversation::new(SocketAddr::V4(t), seed, began)).collect();
    let mut seen: Vec<(SocketAddrV4, Option<u16>)> = Vec::new();
    let mut next = began;
    loop {
        let now = Instant::now();
        if now >= began + length {
            return Ok(());
        }
        if now >= next {
            next = now + REPEAT;
            let mut refused = None;
            let mut sent = false;
            for (conversation, &target) in conversations.iter_mut().zip(targets) {
                match socket.send(target, &conversation.datagram(Request::Identify, now)) {
                    Ok(()) => sent = true,
                    // One of several networks may be down.
                    Err(error) => refused = refused.or(Some(error)),
                }
            }
            if let (false, Some(error)) = (sent, refused) {
                return Err(error);
            }
        }
        if !go_on((now - began).as_secs_f64() / length.as_secs_f64()) {
            return Err(BridgeError::Interrupted);
        }
        let Some((address, bytes)) = socket.receive(next.min(began + length))? else { continue };
        let Some(answer) = answer(address, bytes) else { continue };
        let key = (address, answer.hello.is_ok().then_some(answer.boot));
        if !seen.contains(&key) {
            seen.push(key);
            if !found(answer) {
                return Ok(());
            }
        }
    }
}

fn answer(address: SocketAddrV4, bytes: &[u8]) -> Option<Found> {
    match Packet::decode(bytes) {
        Ok(Packet { header, message: Message::Hello(hello) }) => {
            Some(Found { address, boot: header.boot, up: header.time, hello: Ok(hello) })
        }
        Err(error @ WireError::Version { .. }) => {
            Some(Found { address, boot: 0, up: BridgeTime::default(), hello: Err(error) })
        }
        _ => None,
    }
}

/// The only bridge in the network.
///
/// # Errors
/// If there is none, or more than one.
pub fn only(socket: &mut Socket, go_on: &mut dyn FnMut(f64) -> bool) -> Result<SocketAddrV4, BridgeError> {
    let mut all = Vec::new();
    let found = |f: Found| {
        all.push(f);
        true
    };
    discover(socket, &broadcasts(), LISTEN, found, go_on)?;
    one_of(all)
}

fn one_of(found: Vec<Found>) -> Result<SocketAddrV4, BridgeError> {
    match &found[..] {
        [] => Err(BridgeError::NoneFound),
        [Found { address, hello, .. }] => match hello {
            Ok(_) => Ok(*address),
            Err(error) => Err(BridgeError::Version { peer: *address, error: *error }),
        },
        several => Err(BridgeError::Several(several.iter().map(|f| f.address).collect())),
    }
}

/// This computer's IPv4 networks but for its own loopback.
fn networks() -> Vec<Ifv4Addr> {
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    let v4 = interfaces.into_iter().filter_map(|i| if let IfAddr::V4(a) = i.addr { Some(a) } else { None });
    v4.filter(|a| !a.is_loopback()).collect()
}

/// What to check where `bridge`, or any, does not answer.
pub(super) fn advice(bridge: Option<Ipv4Addr>) -> String {
    advice_for(bridge, &networks())
}

fn advice_for(bridge: Option<Ipv4Addr>, networks: &[Ifv4Addr]) -> String {
    let factory = match BridgeConfig::default().address {
        Address::Static { address, .. } => Ipv4Addr::from(address),
        Address::Dhcp => Ipv4Addr::UNSPECIFIED,
    };
    let (address, whose) = match bridge {
        Some(address) => (address, "it"),
        None => (factory, "a bridge with factory settings"),
    };
    let mask = |ip: Ipv4Addr, n: &Ifv4Addr| u32::from(ip) & u32::from(n.netmask);
    let in_reach = address.is_loopback() || networks.iter().any(|n| mask(address, n) == mask(n.ip, n));
    let mut checks = vec!["check its power and cable".to_owned()];
    if !in_reach {
        let own: Vec<String> = networks.iter().map(|n| format!("{}/{}", n.ip, n.prefixlen)).collect();
        let own = if own.is_empty() { "none".to_owned() } else { own.join(", ") };
        checks.push(format!(
            "give this computer an address in the network of {address}, where {whose} is (it has {own})"
        ));
    }
    checks.push(format!("let a firewall pass UDP from port {BRIDGE_PORT}"));
    if bridge.is_some() {
        checks.push("find bridges with `rfhoi bridge list`".to_owned());
    }
    checks.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(ip: [u8; 4], prefixlen: u8) -> Ifv4Addr {
        let netmask = Ipv4Addr::from(u32::MAX << (32 - prefixlen));
        Ifv4Addr { ip: ip.into(), netmask, prefixlen, broadcast: None }
    }

    #[test]
    fn advice_names_the_address_that_is_missing() {
        let home = network([10, 0, 0, 5], 8);
        let none = advice_for(None, std::slice::from_ref(&home));
        assert!(none.contains("192.168.33.30") && none.contains("10.0.0.5/8"), "{none}");
        let both = advice_for(None, &[home.clone(), network([192, 168, 33, 20], 24)]);
        assert!(!both.contains("give this computer"), "{both}");
        let one = advice_for(Some(Ipv4Addr::new(10, 9, 9, 9)), &[home]);
        assert!(!one.contains("give this computer") && one.contains("4780"), "{one}");
    }

    #[test]
    fn auto_takes_one_bridge_and_no_more() {
        let found = |last, hello| Found {
            address: SocketAddrV4::new(Ipv4Addr::new(10, 0, 0, last), BRIDGE_PORT),
            boot: 1,
            up: BridgeTime(0),
            hello,
        };
        let hello = || {
            Ok(Hello { board: Default::default(), id: [0; 6], firmware: [0; 3], cube_bytes: 0, profile: 0 })
        };
        assert_eq!(*one_of(vec![found(1, hello())]).unwrap().ip(), Ipv4Addr::new(10, 0, 0, 1));
        let several = one_of(vec![found(1, hello()), found(2, hello())]).unwrap_err().to_string();
        assert!(several.contains("10.0.0.1:4780, 10.0.0.2:4780"), "{several}");
        assert!(matches!(one_of(vec![]), Err(BridgeError::NoneFound)));
        let other = one_of(vec![found(1, Err(WireError::Version { theirs: 1, ours: 2 }))]);
        assert!(matches!(other, Err(BridgeError::Version { .. })));
    }
}
