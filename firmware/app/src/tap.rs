//! Takes the datagrams of one UDP port out of a network driver before the IP stack sees them.
//!
//! The radar's raw samples are 2,700 datagrams a second of 1466 bytes. A stack copies each into a socket's buffer, where
//! its samples no longer begin at a whole word, and sums it up; the copy alone costs more instructions than everything
//! that is then done with the samples. [`Tap`] wraps any [`Driver`]: a datagram to its port is handed on where it lies in
//! the driver's buffer, and the stack gets an empty frame in its place, which it skips. Everything else
//! (ARP, DHCP, TCP, other ports) passes untouched.
//!
//! Only whole IPv4 datagrams without options are taken. Check sums are not verified: the frame's own, which the MAC has
//! checked, covers a cable between radar and board.

use core::task::Context;

use embassy_net_driver::{Capabilities, Driver, HardwareAddress, LinkState, RxToken};
use rfhoi_shared::config::Ipv4;

/// Takes the datagrams of a tapped port.
pub trait Datagrams {
    /// Takes the payload of a datagram that `sender` sent. Called where the stack receives, in the task of its runner.
    fn datagram(&mut self, sender: Ipv4, payload: &[u8]);
}

/// A driver whose datagrams to one UDP port go to `C`.
pub struct Tap<D, C> {
    driver: D,
    port: u16,
    consumer: C,
}

impl<D: Driver, C: Datagrams> Tap<D, C> {
    /// Hands the payload of datagrams to `port` that `driver` receives to `consumer`.
    pub fn new(driver: D, port: u16, consumer: C) -> Self {
        Self { driver, port, consumer }
    }
}

impl<D: Driver, C: Datagrams> Driver for Tap<D, C> {
    type RxToken<'a>
        = TapToken<'a, D::RxToken<'a>, C>
    where
        Self: 'a;
    type TxToken<'a>
        = D::TxToken<'a>
    where
        Self: 'a;

    fn receive(&mut self, cx: &mut Context<'_>) -> Option<(Self::RxToken<'_>, Self::TxToken<'_>)> {
        let (frame, reply) = self.driver.receive(cx)?;
        Some((TapToken { frame, port: self.port, consumer: &mut self.consumer }, reply))
    }

    fn transmit(&mut self, cx: &mut Context<'_>) -> Option<Self::TxToken<'_>> {
        self.driver.transmit(cx)
    }

    fn link_state(&mut self, cx: &mut Context<'_>) -> LinkState {
        self.driver.link_state(cx)
    }

    fn capabilities(&self) -> Capabilities {
        self.driver.capabilities()
    }

    fn hardware_address(&self) -> HardwareAddress {
        self.driver.hardware_address()
    }
}

/// A received frame, of which it is not yet known whose it is.
pub struct TapToken<'a, T, C> {
    frame: T,
    port: u16,
    consumer: &'a mut C,
}

impl<T: RxToken, C: Datagrams> RxToken for TapToken<'_, T, C> {
    fn consume<R, G: FnOnce(&mut [u8]) -> R>(self, stack: G) -> R {
        let Self { frame, port, consumer } = self;
        frame.consume(|frame| match udp_payload(frame, port) {
            Some((sender, payload)) => {
                consumer.datagram(sender, payload);
                stack(&mut [])
            }
            None => stack(frame),
        })
    }
}

/// Ethernet II (IEEE 802.3, 3.2.6): EtherType behind two addresses.
const ETHER_TYPE: usize = 12;
const IPV4: u16 = 0x0800;
/// IPv4 (RFC 791, 3.1), from the beginning of the frame.
const VERSION_IHL: usize = 14;
const TOTAL_LENGTH: usize = 16;
const FLAGS_FRAGMENT: usize = 20;
const PROTOCOL: usize = 23;
const SOURCE: usize = 26;
/// Version 4, and a header of five words.
const WITHOUT_OPTIONS: u8 = 0x45;
/// "More fragments" and the offset; zero in a datagram that is whole.
const FRAGMENTED: u16 = 0x3fff;
const UDP: u8 = 17;
const IPV4_HEADER: usize = 20;
/// UDP (RFC 768), from the beginning of the frame.
const DESTINATION_PORT: usize = 36;
const UDP_LENGTH: usize = 38;
const PAYLOAD: usize = 42;
const UDP_HEADER: usize = 8;

/// Sender and payload of `frame`, if it is an Ethernet frame with a whole UDP datagram over IPv4 to `port`.
fn udp_payload(frame: &[u8], port: u16) -> Option<(Ipv4, &[u8])> {
    let (header, rest) = frame.split_first_chunk::<PAYLOAD>()?;
    let word = |at: usize| header.get(at..)?.first_chunk().map(|bytes| u16::from_be_bytes(*bytes));
    let ours = word(ETHER_TYPE)? == IPV4
        && header[VERSION_IHL] == WITHOUT_OPTIONS
        && word(FLAGS_FRAGMENT)? & FRAGMENTED == 0
        && header[PROTOCOL] == UDP
        && word(DESTINATION_PORT)? == port;
    let length = usize::from(word(UDP_LENGTH)?);
    if !ours || length + IPV4_HEADER != usize::from(word(TOTAL_LENGTH)?) {
        return None;
    }
    let sender = header.get(SOURCE..)?.first_chunk()?;
    // Short frames are padded, so the rest may be longer.
    Some((*sender, rest.get(..length.checked_sub(UDP_HEADER)?)?))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec;
    use std::vec::Vec;

    use embassy_net_driver::TxToken;

    use super::*;

    const PORT: u16 = 4098;
    const SENDER: Ipv4 = [192, 168, 33, 180];

    /// What was taken.
    #[derive(Default)]
    struct Taken(Option<Vec<u8>>);

    impl Datagrams for &mut Taken {
        fn datagram(&mut self, sender: Ipv4, payload: &[u8]) {
            assert_eq!(sender, SENDER);
            self.0 = Some(payload.to_vec());
        }
    }

    /// A driver with one frame that it gives for ever.
    struct OneFrame(Vec<u8>);

    struct Rx<'a>(&'a mut [u8]);
    struct Tx;

    impl RxToken for Rx<'_> {
        fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, f: F) -> R {
            f(self.0)
        }
    }

    impl TxToken for Tx {
        fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
            f(&mut vec![0; length])
        }
    }

    impl Driver for OneFrame {
        type RxToken<'a> = Rx<'a>;
        type TxToken<'a> = Tx;

        fn receive(&mut self, _: &mut Context<'_>) -> Option<(Rx<'_>, Tx)> {
            Some((Rx(&mut self.0), Tx))
        }

        fn transmit(&mut self, _: &mut Context<'_>) -> Option<Tx> {
            Some(Tx)
        }

        fn link_state(&mut self, _: &mut Context<'_>) -> LinkState {
            LinkState::Up
        }

        fn capabilities(&self) -> Capabilities {
            let mut capabilities = Capabilities::default();
            capabilities.max_transmission_unit = 1514;
            capabilities
        }

        fn hardware_address(&self) -> HardwareAddress {
            HardwareAddress::Ethernet([2, 0, 0, 0, 0, 1])
        }
    }

    /// A frame as the DCA1000 sends it.
    fn frame(payload: &[u8]) -> Vec<u8> {
        let udp = (payload.len() + UDP_HEADER) as u16;
        let mut frame = vec![0; PAYLOAD];
        frame[ETHER_TYPE..][..2].copy_from_slice(&IPV4.to_be_bytes());
        frame[VERSION_IHL] = WITHOUT_OPTIONS;
        frame[TOTAL_LENGTH..][..2].copy_from_slice(&(udp + IPV4_HEADER as u16).to_be_bytes());
        // "Don't fragment" is no fragment.
        frame[FLAGS_FRAGMENT] = 0x40;
        frame[PROTOCOL] = UDP;
        frame[SOURCE..][..4].copy_from_slice(&SENDER);
        frame[DESTINATION_PORT..][..2].copy_from_slice(&PORT.to_be_bytes());
        frame[UDP_LENGTH..][..2].copy_from_slice(&udp.to_be_bytes());
        frame.extend_from_slice(payload);
        frame
    }

    /// What of `frame` is taken, and what the stack.
    fn pass(frame: Vec<u8>) -> (Option<Vec<u8>>, Vec<u8>) {
        let mut taken = Taken::default();
        let mut tap = Tap::new(OneFrame(frame), PORT, &mut taken);
        let mut cx = Context::from_waker(core::task::Waker::noop());
        let (token, _) = tap.receive(&mut cx).expect("a frame");
        let stack = token.consume(|frame| frame.to_vec());
        (taken.0, stack)
    }

    #[test]
    fn a_datagram_to_the_port_is_taken() {
        let payload: Vec<u8> = (0..1466).map(|i| i as u8).collect();
        assert_eq!(pass(frame(&payload)), (Some(payload), vec![]));
        assert_eq!(pass(frame(&[])), (Some(vec![]), vec![]));
    }

    #[test]
    fn padding_is_cut_off() {
        let mut padded = frame(&[1, 2, 3]);
        padded.resize(60, 0);
        assert_eq!(pass(padded).0, Some(vec![1, 2, 3]));
    }

    #[test]
    fn everything_else_passes_whole() {
        let changes: [(usize, u8); 7] = [
            (ETHER_TYPE + 1, 0x06),
            (VERSION_IHL, 0x46),
            (FLAGS_FRAGMENT, 0x20),
            (FLAGS_FRAGMENT + 1, 1),
            (PROTOCOL, 6),
            (DESTINATION_PORT + 1, 3),
            (TOTAL_LENGTH + 1, 0),
        ];
        for (at, value) in changes {
            let mut other = frame(&[7; 100]);
            assert_ne!(other[at], value);
            other[at] = value;
            assert_eq!(pass(other.clone()), (None, other), "byte {at}");
        }
    }

    #[test]
    fn lengths_that_lie_pass_whole() {
        for length in 0..PAYLOAD + 10 {
            let mut short = frame(&[7; 20]);
            short.truncate(length);
            assert_eq!(pass(short.clone()), (None, short), "{length} bytes");
        }
        for udp in 0..UDP_HEADER as u16 {
            let mut small = frame(&[7; 20]);
            small[TOTAL_LENGTH..][..2].copy_from_slice(&(udp + IPV4_HEADER as u16).to_be_bytes());
            small[UDP_LENGTH..][..2].copy_from_slice(&udp.to_be_bytes());
            assert_eq!(pass(small.clone()), (None, small), "UDP length {udp}");
        }
    }

    #[test]
    fn the_rest_is_the_drivers() {
        let mut taken = Taken::default();
        let mut tap = Tap::new(OneFrame(vec![]), PORT, &mut taken);
        let mut cx = Context::from_waker(core::task::Waker::noop());
        assert!(tap.transmit(&mut cx).is_some());
        assert!(tap.link_state(&mut cx) == LinkState::Up);
        assert_eq!(tap.capabilities().max_transmission_unit, 1514);
        assert_eq!(tap.hardware_address(), HardwareAddress::Ethernet([2, 0, 0, 0, 0, 1]));
    }
}
