//! Devices, bridge and host joined, and the time in which they meet.

use std::collections::VecDeque;
use std::iter::Peekable;
use std::ops::RangeInclusive;

use rfhoi::receive::{RadarFrame, Received, Receiver};
use rfhoi_firmware::bridge::{RadarPath, ReaderAction, ReaderInput, ReaderPath};
use rfhoi_firmware::llrp::client::{MAX_MESSAGE_BYTES, Notice};
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{Message, ReaderState, Telemetry};

use super::network::Network;
use super::reader::SimulatedReader;
use super::serial::SerialLine;
use super::tcp::Pipe;

/// A second of [`BridgeTime`].
pub const SECOND: u64 = 1_000_000;
/// Bytes of a chirp of one receiver that the simulated board collects.
pub const ROW: usize = 4096;
/// From one telemetry message to the next, us.
const TELEMETRY_US: u64 = SECOND;
/// Steps without time going on before something is wrong; a handful happen when one thing leads to another.
const MOST_STEPS_AT_ONCE: u32 = 1_000;
/// Time to open a TCP connection, us.
const CONNECT_US: u64 = 1_000;

/// How packets get from bridge to host.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "a world has one of them")]
pub enum Link {
    /// As datagrams.
    Datagrams(Network),
    /// Over a serial line.
    Serial(SerialLine),
}

impl Link {
    fn send(&mut self, now: BridgeTime, packet: &[u8]) -> bool {
        match self {
            Self::Datagrams(network) => network.send(now, packet.to_vec()),
            Self::Serial(line) => return line.send(packet).is_ok(),
        }
        true
    }

    fn next_arrival(&self) -> Option<BridgeTime> {
        match self {
            Self::Datagrams(network) => network.next_arrival(),
            Self::Serial(line) => line.has_arrived().then_some(BridgeTime(0)),
        }
    }

    fn arrive(&mut self, now: BridgeTime) -> Option<Vec<u8>> {
        match self {
            Self::Datagrams(network) => network.arrive(now),
            Self::Serial(line) => line.arrive(),
        }
    }
}

/// The host: what it received, in order.
#[derive(Debug, Default)]
pub struct Host {
    /// Its end of the wire.
    pub receiver: Receiver,
    /// Everything that came out of it.
    pub received: Vec<Received>,
}

impl Host {
    /// Takes a packet.
    pub fn take(&mut self, packet: &[u8]) {
        // What is wrong is counted.
        let _ = self.receiver.push(packet);
        self.received.extend(std::iter::from_fn(|| self.receiver.next()));
    }

    /// Hands on the frame under way.
    pub fn finish(&mut self) {
        self.receiver.finish();
        self.received.extend(std::iter::from_fn(|| self.receiver.next()));
    }

    /// The radar frames.
    pub fn frames(&self) -> impl Iterator<Item = &RadarFrame> {
        self.received.iter().filter_map(|r| if let Received::Frame(f) = r { Some(f) } else { None })
    }

    /// The tag reads.
    pub fn reads(&self) -> impl Iterator<Item = &TagRead> {
        let reads =
            self.received.iter().filter_map(|r| if let Received::Reads(r) = r { Some(r) } else { None });
        reads.flatten()
    }

    /// The bridge's telemetry.
    pub fn telemetry(&self) -> impl Iterator<Item = &Telemetry> {
        self.received.iter().filter_map(|r| if let Received::Telemetry(t) = r { Some(t) } else { None })
    }
}

/// A radar, the network behind its recorder, and the bridge's path for it.
pub struct RadarSide<'m> {
    source: Peekable<Box<dyn Iterator<Item = (BridgeTime, Vec<u8>)> + 'm>>,
    next_sent: Option<BridgeTime>,
    /// Between recorder and bridge.
    pub network: Network,
    /// The bridge's path.
    pub path: RadarPath<'m, ROW>,
}

impl<'m> RadarSide<'m> {
    /// Datagrams with the times at which they are sent, to `path` over `network`.
    pub fn new(
        source: impl Iterator<Item = (BridgeTime, Vec<u8>)> + 'm,
        network: Network,
        path: RadarPath<'m, ROW>,
    ) -> Self {
        let source: Box<dyn Iterator<Item = _>> = Box::new(source);
        let mut source = source.peekable();
        Self { next_sent: source.peek().map(|(time, _)| *time), source, network, path }
    }

    fn step(&mut self, now: BridgeTime, uplink: &mut Uplink, link: &mut Link) {
        while let Some((time, datagram)) = self.source.next_if(|(time, _)| *time <= now) {
            self.network.send(time, datagram);
        }
        self.next_sent = self.source.peek().map(|(time, _)| *time);
        while let Some(datagram) = self.network.arrive(now) {
            self.path.push(now, &datagram, uplink, |_, packet| link.send(now, packet));
        }
    }
}

/// A reader, the TCP connection to it, and the bridge's path for it.
#[derive(Debug)]
pub struct ReaderSide {
    /// The reader.
    pub reader: SimulatedReader,
    /// The bridge's path.
    pub path: ReaderPath<MAX_MESSAGE_BYTES>,
    /// Whether the reader's TCP port can be reached.
    pub reachable: bool,
    /// States of the link and when they began.
    pub states: Vec<(BridgeTime, ReaderState)>,
    /// What the path said.
    pub notices: Vec<Notice>,
    /// When the path asked for a connection.
    pub attempts: Vec<BridgeTime>,
    to_reader: Pipe,
    to_bridge: Pipe,
    connecting: Option<BridgeTime>,
    connected: bool,
    started: bool,
    inputs: VecDeque<Input>,
}

/// [`ReaderInput`] that owns its bytes.
#[derive(Debug)]
enum Input {
    Connected,
    ConnectFailed,
    Closed,
    Received(Vec<u8>),
    Tick,
}

impl Input {
    fn borrow(&self) -> ReaderInput<'_> {
        match self {
            Self::Connected => ReaderInput::Connected,
            Self::ConnectFailed => ReaderInput::ConnectFailed,
            Self::Closed => ReaderInput::Closed,
            Self::Received(bytes) => ReaderInput::Received(bytes),
            Self::Tick => ReaderInput::Tick,
        }
    }
}

impl ReaderSide {
    /// A reader at the end of a network where a segment takes a time of this range.
    pub fn new(
        reader: SimulatedReader,
        config: ReaderConfig,
        delay_us: RangeInclusive<u64>,
        seed: u64,
    ) -> Self {
        Self {
            reader,
            path: ReaderPath::new(config, seed),
            reachable: true,
            states: Vec::new(),
            notices: Vec::new(),
            attempts: Vec::new(),
            to_reader: Pipe::new(delay_us.clone(), seed),
            to_bridge: Pipe::new(delay_us, !seed),
            connecting: None,
            connected: false,
            started: false,
            inputs: VecDeque::new(),
        }
    }

    /// Whether bytes of the reader are under way.
    pub fn is_heard_soon(&self) -> bool {
        self.to_bridge.next_arrival().is_some()
    }

    /// The reader loses its power or its cable: what is under way is lost, but half of the next segment. Unless
    /// `quietly`, the bridge's TCP notices.
    pub fn vanish(&mut self, quietly: bool) {
        self.reachable = false;
        self.reader.disconnect();
        self.to_reader.clear();
        if let Some(mut segment) = self.to_bridge.arrive(BridgeTime(u64::MAX)) {
            segment.truncate(segment.len() / 2);
            self.inputs.push_back(Input::Received(segment));
        }
        self.to_bridge.clear();
        if self.connected && !quietly {
            self.connected = false;
            self.inputs.push_back(Input::Closed);
        }
    }

    /// These bytes come out of the reader's stream.
    pub fn inject(&mut self, now: BridgeTime, bytes: &[u8]) {
        self.to_bridge.send(now, bytes);
    }

    fn next_event(&self) -> Option<BridgeTime> {
        let at_once = (!self.started || !self.inputs.is_empty()).then_some(BridgeTime(0));
        let times = [
            at_once,
            self.connecting,
            self.to_reader.next_arrival(),
            self.to_bridge.next_arrival(),
            self.reader.next_message(),
            self.path.deadline(),
        ];
        times.into_iter().flatten().min()
    }

    fn step(&mut self, now: BridgeTime, uplink: &mut Uplink, link: &mut Link) {
        if self.connecting.is_some_and(|at| at <= now) {
            self.connecting = None;
            self.connected = self.reachable;
            if self.reachable {
                let greeting = self.reader.accept(now);
                self.to_bridge.send(now, &greeting);
            }
            self.inputs.push_back(if self.reachable { Input::Connected } else { Input::ConnectFailed });
        }
        while let Some(message) = self.reader.message(now) {
            self.to_bridge.send(now, &message);
        }
        while let Some(segment) = self.to_reader.arrive(now) {
            let answers = self.reader.receive(now, &segment);
            self.to_bridge.send(now, &answers);
        }
        while let Some(segment) = self.to_bridge.arrive(now) {
            self.inputs.push_back(Input::Received(segment));
        }
        if self.reader.is_closing() && self.to_bridge.next_arrival().is_none() && self.connected {
            self.connected = false;
            self.reader.disconnect();
            self.inputs.push_back(Input::Closed);
        }
        if !self.started {
            self.started = true;
            self.path_takes(now, ReaderInput::Start, uplink, link);
        }
        self.inputs.push_back(Input::Tick);
        while let Some(input) = self.inputs.pop_front() {
            self.path_takes(now, input.borrow(), uplink, link);
        }
    }

    fn path_takes(&mut self, now: BridgeTime, input: ReaderInput<'_>, uplink: &mut Uplink, link: &mut Link) {
        let Self { path, to_reader, states, notices, attempts, connecting, connected, reader, .. } = self;
        let act = |action: ReaderAction<'_>| match action {
            ReaderAction::Connect(_) => {
                attempts.push(now);
                *connecting = Some(now.after(CONNECT_US));
            }
            ReaderAction::Close => {
                *connecting = None;
                *connected = false;
                reader.disconnect();
                to_reader.clear();
            }
            ReaderAction::Send(bytes) => to_reader.send(now, bytes),
            ReaderAction::State(state) => states.push((now, state)),
            ReaderAction::Notice(notice) => notices.push(notice),
        };
        path.handle(now, input, uplink, |_, packet| link.send(now, packet), act);
        if !*connected {
            self.to_bridge.clear();
        }
    }
}

/// Everything at one place.
pub struct World<'m> {
    /// The time.
    pub now: BridgeTime,
    /// Radar and its path, if there is one.
    pub radar: Option<RadarSide<'m>>,
    /// Reader and its path, if there is one.
    pub reader: Option<ReaderSide>,
    /// Numbers the bridge's packets.
    pub uplink: Uplink,
    /// Between bridge and host.
    pub link: Link,
    /// The host.
    pub host: Host,
    next_telemetry: BridgeTime,
}

impl<'m> World<'m> {
    /// A bridge that has started for the `boot`th time, with neither radar nor reader.
    pub fn new(boot: u16, link: Link, host: Host) -> Self {
        Self {
            now: BridgeTime(0),
            radar: None,
            reader: None,
            uplink: Uplink::new(boot),
            link,
            host,
            next_telemetry: BridgeTime(TELEMETRY_US),
        }
    }

    /// Lets happen what happens until `end`.
    ///
    /// # Panics
    /// If time stands still: a deadline is past and stays so, whatever is done.
    pub fn run_until(&mut self, end: BridgeTime) {
        let mut steps_at_once = 0;
        while let Some(next) = self.next_event().filter(|&next| next <= end) {
            steps_at_once = if next > self.now { 0 } else { steps_at_once + 1 };
            assert!(steps_at_once < MOST_STEPS_AT_ONCE, "time stands still at {:?}", self.now);
            self.now = self.now.max(next);
            self.step();
        }
        self.now = end;
    }

    /// Radar and reader stop, and what is under way arrives.
    pub fn finish(&mut self) {
        let Self { now, radar, reader, uplink, link, .. } = self;
        if let Some(RadarSide { path, .. }) = radar {
            path.finish(*now, uplink, |_, packet| link.send(*now, packet));
        }
        if let Some(reader) = reader {
            reader.path_takes(*now, ReaderInput::Stop, uplink, link);
        }
        // Longer than the reader's goodbye and any delay.
        self.run_until(self.now.after(2 * SECOND));
        self.host.finish();
    }

    fn next_event(&self) -> Option<BridgeTime> {
        let radar = self.radar.as_ref();
        let times = [
            radar.and_then(|r| r.next_sent),
            radar.and_then(|r| r.network.next_arrival()),
            self.reader.as_ref().and_then(ReaderSide::next_event),
            self.link.next_arrival(),
            Some(self.next_telemetry),
        ];
        times.into_iter().flatten().min()
    }

    fn step(&mut self) {
        let Self { now, radar, reader, uplink, link, host, next_telemetry } = self;
        let now = *now;
        if let Some(radar) = radar {
            radar.step(now, uplink, link);
        }
        if let Some(reader) = reader {
            reader.step(now, uplink, link);
        }
        if *next_telemetry <= now {
            *next_telemetry = now.after(TELEMETRY_US);
            let telemetry = Telemetry {
                frames: radar.as_ref().map(|r| r.path.frames()).unwrap_or_default(),
                datagrams: radar.as_ref().map(|r| r.path.datagrams()).unwrap_or_default(),
                reader: reader.as_ref().map(|r| r.path.counts().link).unwrap_or_default(),
                uplink_dropped: uplink.unsent(),
                ..Telemetry::default()
            };
            uplink.send(now, Message::Telemetry(telemetry), |_, packet| link.send(now, packet));
        }
        while let Some(packet) = link.arrive(now) {
            host.take(&packet);
        }
    }
}
