//! The host's end: commands in, packets out, on one port.
//!
//! A socket of the IP stack does not send past a packet whose address nobody answers for, and is silenced for a second
//! by it. So answers and the stream have a socket each, one that is stuck is replaced, and a host that is absent gets
//! nothing for a while.

use embassy_futures::poll_once;
use embassy_futures::select::{Either4, select4};
use embassy_net::Stack;
use embassy_net::udp::{PacketMetadata, UdpSocket};
use embassy_time::{Duration, Instant, with_timeout};
use rfhoi_shared::config::Endpoint;
use rfhoi_shared::wire::{
    Ack, BRIDGE_PORT, Command, MAX_PACKET, Message, Packet, Refusal, Request, WireError,
};

use crate::bridge::{Bridge, cube_bytes};
use crate::net::{remote, sender};
use crate::{BRIDGES, now};

/// Packets that a socket holds on their way out: while an address is looked up, or the cable is busy.
const PACKETS_OUT: usize = 4;
/// Commands that it holds on their way in.
const PACKETS_IN: usize = 2;
/// How long a packet waits for room.
const PATIENCE: Duration = Duration::from_millis(100);
/// For how long a socket may hold packets: the IP stack looks up one address a second, and after a start there are three.
const LOOKUPS: Duration = Duration::from_secs(3);
/// For how long nothing is sent to a host that was absent.
const ABSENCE: Duration = Duration::from_secs(1);

/// The last command that changed something, so that its repetition does not.
type Last = Option<(Endpoint, u16, Result<(), Refusal>)>;

/// Memory of a socket.
struct Buffers {
    in_metadata: [PacketMetadata; PACKETS_IN],
    in_buffer: [u8; PACKETS_IN * MAX_PACKET],
    out_metadata: [PacketMetadata; PACKETS_OUT],
    out_buffer: [u8; PACKETS_OUT * MAX_PACKET],
}

impl Buffers {
    #[inline(always)]
    const fn new() -> Self {
        Self {
            in_metadata: [PacketMetadata::EMPTY; PACKETS_IN],
            in_buffer: [0; PACKETS_IN * MAX_PACKET],
            out_metadata: [PacketMetadata::EMPTY; PACKETS_OUT],
            out_buffer: [0; PACKETS_OUT * MAX_PACKET],
        }
    }

    fn lane(&mut self, stack: Stack<'static>) -> Option<Lane<'_>> {
        let Self { in_metadata, in_buffer, out_metadata, out_buffer } = self;
        let mut socket = UdpSocket::new(stack, in_metadata, in_buffer, out_metadata, out_buffer);
        socket.bind(BRIDGE_PORT).ok()?;
        Some(Lane { socket, waiting: 0, since: None })
    }
}

/// A socket, and the packets in it since it was last seen empty.
struct Lane<'s> {
    socket: UdpSocket<'s>,
    waiting: u32,
    /// Since when it has not been seen empty.
    since: Option<Instant>,
}

impl Lane<'_> {
    /// Sends a packet, or counts it as dropped. Returns whether the socket is still of use.
    async fn send(&mut self, bridge: &Bridge, bytes: &[u8], to: Endpoint) -> bool {
        if poll_once(self.socket.flush()).is_ready() {
            self.waiting = 0;
            self.since = None;
        } else if self.since.is_some_and(|since| since.elapsed() > LOOKUPS) {
            // Somebody who does not answer is at its head.
            bridge.drop_packets(self.waiting.min(PACKETS_OUT as u32) + 1);
            return false;
        }
        match with_timeout(PATIENCE, self.socket.send_to(bytes, remote(to))).await {
            Ok(Ok(())) => {
                self.waiting += 1;
                self.since.get_or_insert(Instant::now());
            }
            Ok(Err(_)) => bridge.drop_packets(1),
            Err(_) => {
                bridge.drop_packets(self.waiting.min(PACKETS_OUT as u32) + 1);
                return false;
            }
        }
        true
    }
}

/// Which socket is stuck.
enum Stuck {
    Answers,
    Stream,
}

/// What outlives a socket.
#[derive(Default)]
struct Memory {
    last: Last,
    /// A host that did not take what was sent, and until when it gets nothing.
    absent: Option<(Endpoint, Instant)>,
}

#[embassy_executor::task(pool_size = BRIDGES)]
pub(crate) async fn run(bridge: &'static Bridge, stack: Stack<'static>) {
    // One by one, or they are made on the stack.
    let mut answers = Buffers::new();
    let mut stream = Buffers::new();
    let mut memory = Memory::default();
    loop {
        let Some(mut answers) = answers.lane(stack) else { return };
        loop {
            let Some(mut stream) = stream.lane(stack) else { return };
            match serve(bridge, &mut answers, &mut stream, &mut memory).await {
                Stuck::Answers => break,
                Stuck::Stream => {}
            }
        }
    }
}

/// Hears and sends until a socket is stuck.
async fn serve(
    bridge: &Bridge,
    answers: &mut Lane<'_>,
    stream: &mut Lane<'_>,
    Memory { last, absent }: &mut Memory,
) -> Stuck {
    // A command comes out of the socket that the stack has first in its list.
    let mut received = [[0; MAX_PACKET]; 2];
    loop {
        let [first, second] = &mut received;
        let sources = select4(
            answers.socket.recv_from(first),
            stream.socket.recv_from(second),
            bridge.handover.packets.receive(),
            bridge.handover.radar.receive(),
        );
        let (heard, bytes) = match sources.await {
            Either4::First(heard) => (heard, &*first),
            Either4::Second(heard) => (heard, &*second),
            Either4::Third(packet) | Either4::Fourth(packet) => {
                if let Some(asker) = packet.to {
                    if !answers.send(bridge, packet.bytes(), asker).await {
                        return Stuck::Answers;
                    }
                } else if let Some(host) = bridge.host() {
                    if absent.is_some_and(|(who, until)| who == host && Instant::now() < until) {
                        bridge.drop_packets(1);
                    } else if !stream.send(bridge, packet.bytes(), host).await {
                        *absent = Some((host, Instant::now() + ABSENCE));
                        return Stuck::Stream;
                    }
                }
                continue;
            }
        };
        match heard {
            Ok((length, metadata)) => {
                hear(bridge, sender(&metadata), bytes.get(..length).unwrap_or(&[]), last);
            }
            Err(_) => bridge.stray(),
        }
    }
}

fn hear(bridge: &Bridge, asker: Endpoint, bytes: &[u8], last: &mut Last) {
    match Packet::decode(bytes) {
        Ok(Packet { message: Message::Command(command), .. }) => obey(bridge, asker, command, last),
        // The answer's version tells the asker what is wrong.
        Err(WireError::Version { .. }) => bridge.say(Some(asker), Message::Hello(bridge.hello())),
        _ => bridge.stray(),
    }
}

fn obey(bridge: &Bridge, asker: Endpoint, command: Command, last: &mut Last) {
    let Command { id, request } = command;
    let repeated = last.filter(|(who, which, _)| (*who, *which) == (asker, id)).map(|(.., outcome)| outcome);
    let outcome = match request {
        Request::Identify | Request::Hello => {
            let is_new = request == Request::Hello && bridge.set_host(asker);
            bridge.say(Some(asker), Message::Hello(bridge.hello()));
            if is_new {
                bridge.reader_tells.signal(());
                bridge.tell_last_words();
            }
            Ok(())
        }
        Request::GetConfig => {
            bridge.say(Some(asker), Message::Config(bridge.config.clone()));
            Ok(())
        }
        request => {
            let outcome = repeated.unwrap_or_else(|| change(bridge, request));
            *last = Some((asker, id, outcome));
            outcome
        }
    };
    bridge.say(Some(asker), Message::Ack(Ack { id, at: now(), outcome }));
}

/// Does what changes the bridge's state.
fn change(bridge: &Bridge, request: Request) -> Result<(), Refusal> {
    match request {
        Request::Start => bridge.run(true),
        Request::Stop => bridge.run(false),
        Request::Restart => bridge.restart.signal(()),
        Request::Configure(config) => {
            config.validate(cube_bytes()).map_err(Refusal::Config)?;
            // Flash cannot be written while datagrams arrive.
            if !bridge.is_stopped() {
                return Err(Refusal::Busy);
            }
            bridge.keep(&config).map_err(|_| Refusal::NotKept)?;
            bridge.restart.signal(());
        }
        Request::Identify | Request::Hello | Request::GetConfig => {}
    }
    Ok(())
}
