//! The host's end: commands in, packets out, on one socket.

use embassy_futures::select::{Either3, select3};
use embassy_net::Stack;
use embassy_net::udp::{PacketMetadata, UdpSocket};
use embassy_time::{Duration, with_timeout};
use rfhoi_shared::config::Endpoint;
use rfhoi_shared::wire::{
    Ack, BRIDGE_PORT, Command, MAX_PACKET, Message, Packet, Refusal, Request, WireError,
};

use crate::bridge::{Bridge, cube_bytes};
use crate::net::{remote, sender};
use crate::packet::Outgoing;
use crate::{BRIDGES, now};

/// Packets that the socket holds on their way out: while an address is looked up, or the cable is busy.
const PACKETS_OUT: usize = 4;
/// Commands that it holds on their way in.
const PACKETS_IN: usize = 2;
/// How long a packet waits for room. An address that does not answer would hold up all others.
const PATIENCE: Duration = Duration::from_millis(100);

/// The last command that changed something, so that its repetition does not.
type Last = Option<(Endpoint, u16, Result<(), Refusal>)>;

#[embassy_executor::task(pool_size = BRIDGES)]
pub(crate) async fn run(bridge: &'static Bridge, stack: Stack<'static>) {
    let (mut in_metadata, mut in_buffer) =
        ([PacketMetadata::EMPTY; PACKETS_IN], [0; PACKETS_IN * MAX_PACKET]);
    let (mut out_metadata, mut out_buffer) =
        ([PacketMetadata::EMPTY; PACKETS_OUT], [0; PACKETS_OUT * MAX_PACKET]);
    let mut socket =
        UdpSocket::new(stack, &mut in_metadata, &mut in_buffer, &mut out_metadata, &mut out_buffer);
    if socket.bind(BRIDGE_PORT).is_err() {
        return;
    }
    let mut received = [0; MAX_PACKET];
    let mut last = None;
    loop {
        let sources = select3(
            socket.recv_from(&mut received),
            bridge.packets.receive(),
            bridge.handover.radar.receive(),
        );
        let packet = match sources.await {
            Either3::First(Ok((length, metadata))) => {
                hear(bridge, sender(&metadata), received.get(..length).unwrap_or(&[]), &mut last);
                continue;
            }
            Either3::First(Err(_)) => {
                bridge.stray();
                continue;
            }
            Either3::Second(packet) | Either3::Third(packet) => packet,
        };
        send(bridge, &mut socket, &packet).await;
    }
}

async fn send(bridge: &Bridge, socket: &mut UdpSocket<'_>, packet: &Outgoing) {
    let Some(to) = packet.to.or(bridge.host()) else { return };
    match with_timeout(PATIENCE, socket.send_to(packet.bytes(), remote(to))).await {
        Ok(Ok(())) => {}
        Ok(Err(_)) => bridge.drop_packet(),
        Err(_) => {
            // What waits for an address that does not answer would hold up everybody else.
            socket.close();
            let _ = socket.bind(BRIDGE_PORT);
            for _ in 0..=PACKETS_OUT {
                bridge.drop_packet();
            }
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
            if request == Request::Hello {
                bridge.set_host(asker);
            }
            bridge.say(Some(asker), Message::Hello(bridge.hello()));
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
