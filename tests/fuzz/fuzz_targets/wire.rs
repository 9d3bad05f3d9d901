//! Packets between bridge and host, bare and serial-framed.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rfhoi_shared::wire::{MAGIC, MAX_PACKET, Packet, VERSION, serial};

fn check(bytes: &[u8]) {
    if let Ok(packet) = Packet::decode(bytes) {
        // NaNs are not equal to themselves, so the bytes are compared; varints may be longer than they need to be.
        let mut buffer = [0; MAX_PACKET];
        let again = packet.encode(&mut buffer).expect("what was decoded fits");
        let (mut once, mut twice) = ([0; MAX_PACKET], [0; MAX_PACKET]);
        let once = Packet::decode(again).expect("what was encoded decodes").encode(&mut once);
        assert_eq!(once, packet.encode(&mut twice));
    }
}

fuzz_target!(|data: &[u8]| {
    check(data);
    check(&[&MAGIC[..], &[VERSION], data].concat());
    let mut decoder = serial::Decoder::new();
    decoder.push(data, |_| {});
    if data.len() <= MAX_PACKET {
        let mut frame = [0; serial::MAX_FRAME];
        let frame = serial::encode(data, &mut frame).expect("a packet's length fits");
        decoder.push(&[0], |_| {});
        decoder.push(frame, |_| {});
    }
});
