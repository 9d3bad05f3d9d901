//! An Ethernet switch in virtual time, and its outlets as network drivers.
//!
//! Frames to an outlet go over a [`Network`] each, in the conditions of their UDP port: so a test can lose radar data and
//! nothing else. The switch learns addresses, and sends to all where it knows none.

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::task::{Context, Waker};

use embassy_net_driver::{Capabilities, Driver, HardwareAddress, LinkState, RxToken, TxToken};
use etherparse::{SlicedPacket, TransportSlice};
use rfhoi_shared::units::BridgeTime;

use super::clock;
use crate::simulated::network::{Conditions, Network};

/// Longest frame, without its checksum.
const FRAME: usize = 1514;
/// Frames that an outlet's receiver holds, as the descriptors of an Ethernet controller.
const RECEIVED: usize = 16;

/// A MAC address.
pub(super) type Mac = [u8; 6];
/// A UDP payload and when it reached an outlet.
pub type Arrival = (BridgeTime, Vec<u8>);

/// What is plugged in at an outlet.
#[derive(Debug, Default)]
struct Received {
    frames: VecDeque<Vec<u8>>,
    waker: Option<Waker>,
}

#[derive(Debug)]
struct Outlet {
    plugged: bool,
    received: Rc<RefCell<Received>>,
    /// By UDP port, for those that have conditions of their own or are listened to; 0 is everything else.
    networks: BTreeMap<u16, Network>,
    /// What arrived, by UDP port, where it is asked for.
    heard: BTreeMap<u16, Vec<Arrival>>,
    overflowed: u32,
}

#[derive(Debug)]
struct Inner {
    outlets: Vec<Outlet>,
    addresses: BTreeMap<Mac, usize>,
    usual: Conditions,
    seed: u64,
}

/// The switch; clones are the same one.
#[derive(Debug, Clone)]
pub struct Switch(Rc<RefCell<Inner>>);

impl Switch {
    /// A switch on which frames travel in these conditions unless said otherwise.
    pub fn new(usual: Conditions, seed: u64) -> Self {
        let inner = Inner { outlets: Vec::new(), addresses: BTreeMap::new(), usual, seed };
        Self(Rc::new(RefCell::new(inner)))
    }

    /// A new outlet; its number.
    pub fn outlet(&self) -> usize {
        let mut inner = self.0.borrow_mut();
        inner.outlets.push(Outlet {
            plugged: false,
            received: Rc::default(),
            networks: BTreeMap::new(),
            heard: BTreeMap::new(),
            overflowed: 0,
        });
        inner.outlets.len() - 1
    }

    /// Plugs a device with this address in, in place of what was there.
    pub fn plug(&self, outlet: usize, mac: Mac) -> Port {
        let received = Rc::<RefCell<Received>>::default();
        let place = &mut self.0.borrow_mut().outlets[outlet];
        place.received = Rc::clone(&received);
        place.plugged = true;
        Port { switch: self.clone(), outlet, received, mac }
    }

    /// Pulls the cable, or puts it in again.
    pub fn set_plugged(&self, outlet: usize, plugged: bool) {
        let place = &mut self.0.borrow_mut().outlets[outlet];
        place.plugged = plugged;
        place.received.borrow_mut().frames.clear();
    }

    /// Datagrams to this UDP port at this outlet travel in these conditions from now on.
    pub fn set_conditions(&self, outlet: usize, port: u16, conditions: Conditions) {
        self.with_network(outlet, port, |network| network.set_conditions(conditions));
    }

    /// Calls `f` with the network of datagrams to this UDP port at this outlet, which have none in common with others
    /// from now on.
    pub fn with_network<R>(&self, outlet: usize, port: u16, f: impl FnOnce(&mut Network) -> R) -> R {
        let mut inner = self.0.borrow_mut();
        f(inner.network(outlet, port))
    }

    /// Keeps what arrives at this UDP port of this outlet from now on.
    pub fn listen(&self, outlet: usize, port: u16) {
        self.0.borrow_mut().outlets[outlet].heard.entry(port).or_default();
    }

    /// What arrived since [`Self::listen`].
    pub fn heard(&self, outlet: usize, port: u16) -> Vec<Arrival> {
        self.0.borrow().outlets[outlet].heard.get(&port).cloned().unwrap_or_default()
    }

    /// Frames for which the receiver at this outlet had no room.
    pub fn overflowed(&self, outlet: usize) -> u32 {
        self.0.borrow().outlets[outlet].overflowed
    }

    /// When the next frame arrives somewhere.
    pub(super) fn next_arrival(&self) -> Option<BridgeTime> {
        let inner = self.0.borrow();
        inner.outlets.iter().flat_map(|o| o.networks.values()).filter_map(Network::next_arrival).min()
    }

    /// Hands over frames that have arrived.
    pub(super) fn deliver(&self, now: BridgeTime) {
        for outlet in &mut self.0.borrow_mut().outlets {
            let Outlet { plugged, received, networks, heard, overflowed } = outlet;
            let mut received = received.borrow_mut();
            for frame in networks.values_mut().flat_map(|network| std::iter::from_fn(|| network.arrive(now)))
            {
                if !*plugged {
                    continue;
                }
                if let Some((port, payload)) = udp(&frame)
                    && let Some(heard) = heard.get_mut(&port)
                {
                    heard.push((now, payload.to_vec()));
                }
                if received.frames.len() < RECEIVED {
                    received.frames.push_back(frame);
                } else {
                    *overflowed += 1;
                }
                if let Some(waker) = received.waker.take() {
                    waker.wake();
                }
            }
        }
    }

    fn send(&self, from: usize, frame: &[u8]) {
        let mut inner = self.0.borrow_mut();
        let (Some((&to, rest)), true) = (frame.split_first_chunk::<6>(), inner.outlets[from].plugged) else {
            return;
        };
        if let Some(&source) = rest.first_chunk::<6>() {
            inner.addresses.insert(source, from);
        }
        let known = inner.addresses.get(&to).copied();
        let port = udp(frame).map_or(0, |(port, _)| port);
        for outlet in 0..inner.outlets.len() {
            if outlet != from && known.is_none_or(|known| known == outlet) {
                let own = inner.outlets[outlet].networks.contains_key(&port);
                inner.network(outlet, if own { port } else { 0 }).send(clock::now(), frame.to_vec());
            }
        }
    }
}

impl Inner {
    fn network(&mut self, outlet: usize, port: u16) -> &mut Network {
        // Each a seed of its own.
        let seed = self.seed ^ ((outlet as u64 + 1) << 32) ^ (u64::from(port) << 8);
        let usual = self.usual;
        self.outlets[outlet].networks.entry(port).or_insert_with(|| Network::new(usual, seed))
    }
}

/// Destination port and payload of a UDP datagram.
fn udp(frame: &[u8]) -> Option<(u16, &[u8])> {
    match SlicedPacket::from_ethernet(frame).ok()?.transport? {
        TransportSlice::Udp(udp) => Some((udp.destination_port(), udp.payload())),
        _ => None,
    }
}

/// A device's end of a cable.
#[derive(Debug)]
pub struct Port {
    switch: Switch,
    outlet: usize,
    received: Rc<RefCell<Received>>,
    mac: Mac,
}

impl Driver for Port {
    type RxToken<'a> = Frame;
    type TxToken<'a> = Transmission<'a>;

    fn receive(&mut self, cx: &mut Context<'_>) -> Option<(Frame, Transmission<'_>)> {
        let mut received = self.received.borrow_mut();
        received.waker = Some(cx.waker().clone());
        let frame = received.frames.pop_front()?;
        Some((Frame(frame), Transmission { switch: &self.switch, outlet: self.outlet }))
    }

    fn transmit(&mut self, _: &mut Context<'_>) -> Option<Transmission<'_>> {
        Some(Transmission { switch: &self.switch, outlet: self.outlet })
    }

    fn link_state(&mut self, _: &mut Context<'_>) -> LinkState {
        LinkState::Up
    }

    fn capabilities(&self) -> Capabilities {
        let mut capabilities = Capabilities::default();
        capabilities.max_transmission_unit = FRAME;
        capabilities
    }

    fn hardware_address(&self) -> HardwareAddress {
        HardwareAddress::Ethernet(self.mac)
    }
}

/// A frame that was received.
#[derive(Debug)]
pub struct Frame(Vec<u8>);

impl RxToken for Frame {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(mut self, f: F) -> R {
        f(&mut self.0)
    }
}

/// Room for a frame to send.
#[derive(Debug)]
pub struct Transmission<'p> {
    switch: &'p Switch,
    outlet: usize,
}

impl TxToken for Transmission<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let mut frame = vec![0; length];
        let result = f(&mut frame);
        self.switch.send(self.outlet, &frame);
        result
    }
}
