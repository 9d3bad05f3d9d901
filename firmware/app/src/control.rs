//! Drives the radar and its recorder.

use embassy_futures::poll_once;
use embassy_futures::select::{Either4, select4};
use embassy_net::Stack;
use embassy_net::udp::{PacketMetadata, UdpSocket};
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{Read, Write};
use heapless::{String, Vec};
use rfhoi_firmware::bridge::{ControlAction, ControlInput, RadarControl};
use rfhoi_firmware::dca1000::CONFIG_PORT;
use rfhoi_firmware::dca1000::command::{ANSWER_BYTES, MAX_COMMAND};
use rfhoi_firmware::mmwave::cli::MAX_LINE;
use rfhoi_shared::config::{Endpoint, RadarInput};
use rfhoi_shared::wire::FrameCounts;

use crate::bridge::Bridge;
use crate::net::{remote, sender};
use crate::{instant, now};

/// How often it looks whether data comes.
const LOOK: Duration = Duration::from_millis(500);
/// Pause after an error of the UART, which may come back at once.
const UART_PAUSE: Duration = Duration::from_millis(10);
/// Datagrams that wait in either direction.
const DATAGRAMS: usize = 4;
/// Room for a datagram that is none of the recorder's, to tell that it is not.
const RECEIVED: usize = 64;

/// What is to be written, until it is.
#[derive(Default)]
struct Outbox {
    /// At most a line for each phase that one input ends.
    lines: String<{ 2 * MAX_LINE }>,
    commands: Vec<Vec<u8, MAX_COMMAND>, DATAGRAMS>,
}

/// The radar's and its recorder's task; `from_console` and `to_console` are the UART of the radar's command line, 115 200
/// baud 8N1.
pub async fn radar_control(
    bridge: &'static Bridge,
    stack: Stack<'static>,
    mut from_console: impl Read,
    mut to_console: impl Write,
) {
    let (mut in_metadata, mut in_buffer) = ([PacketMetadata::EMPTY; DATAGRAMS], [0; DATAGRAMS * RECEIVED]);
    let (mut out_metadata, mut out_buffer) =
        ([PacketMetadata::EMPTY; DATAGRAMS], [0; DATAGRAMS * MAX_COMMAND]);
    let mut socket =
        UdpSocket::new(stack, &mut in_metadata, &mut in_buffer, &mut out_metadata, &mut out_buffer);
    let recorder = match bridge.config.radar.input {
        RadarInput::Dca1000 { address, .. } => Some(Endpoint { address, port: CONFIG_PORT }),
        RadarInput::Uart => None,
    };
    if socket.bind(CONFIG_PORT).is_err() {
        return bridge.notice("the port for the recorder's answers cannot be opened");
    }
    let mut control = RadarControl::new(&bridge.config.radar);
    let mut outbox = Outbox::default();
    let (mut heard, mut received) = ([0; 64], [0; RECEIVED]);
    const { assert!(RECEIVED >= ANSWER_BYTES) };
    let mut look = Instant::now();
    loop {
        let due = instant(control.deadline()).min(look);
        let sources = select4(
            from_console.read(&mut heard),
            socket.recv_from(&mut received),
            bridge.radar_runs.wait(),
            Timer::at(due),
        );
        let input = match sources.await {
            Either4::First(Ok(length)) => ControlInput::Console(heard.get(..length).unwrap_or(&[])),
            Either4::First(Err(_)) => {
                Timer::after(UART_PAUSE).await;
                ControlInput::Tick
            }
            Either4::Second(Ok((length, metadata))) => {
                let known = recorder.is_some_and(|r| r.address == sender(&metadata).address);
                // What somebody else says is no answer.
                ControlInput::Recorder(if known { received.get(..length).unwrap_or(&[]) } else { &[] })
            }
            Either4::Second(Err(_)) => ControlInput::Recorder(&[]),
            Either4::Third(true) => ControlInput::Start,
            Either4::Third(false) => ControlInput::Stop,
            Either4::Fourth(()) => ControlInput::Tick,
        };
        look = Instant::now() + LOOK;
        // First, since what is done next depends on whether the radar streams.
        handle(&mut control, bridge, ControlInput::Progress(progress(bridge)), &mut outbox);
        handle(&mut control, bridge, input, &mut outbox);
        if !outbox.lines.is_empty() {
            // A radar that is not there is noticed by its silence.
            let _ = to_console.write_all(outbox.lines.as_bytes()).await;
            outbox.lines.clear();
        }
        while let Some((command, recorder)) = outbox.commands.pop().zip(recorder) {
            // One that is lost is sent again. While nobody has the recorder's address the socket is full, and would be
            // waited for in vain.
            let _ = poll_once(socket.send_to(&command, remote(recorder)));
        }
    }
}

/// Pieces of data of the radar so far: datagrams or frames.
fn progress(bridge: &Bridge) -> u32 {
    let datagrams = bridge.intake.try_borrow().map_or(0, |intake| intake.datagrams().received);
    let FrameCounts { complete, incomplete, .. } = bridge.uart_frames.get();
    datagrams.wrapping_add(complete).wrapping_add(incomplete)
}

fn handle(control: &mut RadarControl, bridge: &Bridge, input: ControlInput<'_>, outbox: &mut Outbox) {
    let Outbox { lines, commands } = outbox;
    control.handle(now(), input, |action| match action {
        // There is room; a line cut would be refused.
        ControlAction::Console(line) => drop(lines.push_str(line)),
        ControlAction::Recorder(command) => drop(Vec::from_slice(command).map(|c| commands.push(c))),
        ControlAction::State(state) => bridge.radar.set(state),
        ControlAction::Notice(notice) => bridge.notice(notice),
    });
    bridge.recorder_strays.set(control.strays());
}
