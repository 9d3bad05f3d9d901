//! Entry points for fuzzing: each takes arbitrary bytes and walks all that the module could do with them.
//!
//! They return what they counted, so that nothing is optimised away and a test can compare.

use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::BridgeTime;

use super::capabilities::Capabilities;
use super::client::{Client, Output};
use super::decode::Incoming;
use super::frame::Framer;
use super::message::{Message, MessageType};

/// Frames `stream` in chunks whose sizes are the bytes of `cuts` in turn (0 for all that is left), and decodes every
/// message. Returns the messages, and whether the stream ended in a framing error.
pub fn stream(stream: &[u8], cuts: &[u8]) -> (usize, bool) {
    let mut framer = Framer::<512>::new();
    let mut messages = 0;
    let mut rest = stream;
    let mut cuts = cuts.iter().cycle();
    while !rest.is_empty() {
        let cut = cuts.next().map_or(0, |&cut| usize::from(cut));
        let (mut chunk, after) = match cut {
            0 => (rest, [].as_slice()),
            cut => rest.split_at_checked(cut).unwrap_or((rest, &[])),
        };
        rest = after;
        loop {
            match framer.next(&mut chunk) {
                Ok(Some(message)) => {
                    messages += 1;
                    walk(&message);
                }
                Ok(None) => break,
                Err(_) => return (messages, true),
            }
        }
    }
    (messages, false)
}

/// Decodes `body` as the body of every type of message. Returns the items that decoded.
pub fn bodies(body: &[u8]) -> usize {
    MessageType::ALL.iter().map(|&kind| walk(&Message { kind, id: 0, body })).sum()
}

/// Decodes all of `message`. Returns the items that decoded.
pub fn walk(message: &Message<'_>) -> usize {
    match Incoming::decode(message) {
        Ok(Incoming::Reports(reports)) => reports.filter(Result::is_ok).count(),
        Ok(Incoming::Events(events)) => events.filter(Result::is_ok).count(),
        Ok(Incoming::Response(MessageType::GET_READER_CAPABILITIES_RESPONSE, _)) => {
            usize::from(Capabilities::decode(message.body).is_ok())
        }
        Ok(_) => 1,
        Err(_) => 0,
    }
}

/// Feeds a client. The first byte of each step says what happens: 0 to 3 tick at the deadline, 4 connected, 5 connect
/// failed, 6 closed, 7 stop and start, anything else as many bytes received. Returns the reads.
pub fn client(mut steps: &[u8]) -> usize {
    let mut client = Client::<512>::new(ReaderConfig::for_scene([192, 168, 1, 2], &Scene::default()), 1);
    let mut now = BridgeTime(0);
    let mut reads = 0;
    let mut out = |output: Output<'_>| reads += usize::from(matches!(output, Output::Read(_)));
    client.start(now, &mut out);
    while let Some((&step, rest)) = steps.split_first() {
        steps = rest;
        now = now.after(u64::from(step));
        match step {
            0..=3 => {
                now = client.deadline().unwrap_or(now).max(now);
                client.tick(now, &mut out);
            }
            4 => client.connected(now, &mut out),
            5 => client.connect_failed(now, &mut out),
            6 => client.closed(now, &mut out),
            7 => {
                client.stop(now, &mut out);
                client.start(now, &mut out);
            }
            n => {
                let (bytes, rest) = steps.split_at_checked(usize::from(n)).unwrap_or((steps, &[]));
                steps = rest;
                client.received(now, bytes, &mut out);
            }
        }
    }
    reads
}
