//! The DCA1000EVM's commands, answers and datagrams.
//!
//! The first byte of a datagram says how it is derived: continuing the stream, jumping in it, or as it is.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rfhoi_firmware::dca1000::command::{Answer, Command};
use rfhoi_firmware::dca1000::{Datagram, Event, Reassembly};
use rfhoi_shared::radar::RadarProfile;

/// 64 bytes a row, 2 rows a chirp, 6 chirps a frame.
fn reassembly() -> Reassembly<64> {
    let profile = RadarProfile { samples: 16, rx_mask: 0b11, loops: 2, ..RadarProfile::paper() };
    Reassembly::new(&profile).expect("a row of this profile has 64 bytes")
}

fuzz_target!(|data: &[u8]| {
    let _ = Command::decode(data).map(Command::encode);
    let _ = Answer::decode(data).map(|a| a.reports().count());

    let mut reassembly = reassembly();
    let mut open = false;
    let (mut next_row, mut hole) = (0, false);
    let mut check = |event: Event<'_>| match event {
        Event::FrameStart { .. } => {
            assert!(!open);
            open = true;
            next_row = 0;
        }
        Event::Row { chirp, receiver, bytes, intact } => {
            assert!(open && (chirp, receiver) == (next_row / 2, next_row % 2) && bytes.len() == 64);
            assert!(receiver == 0 || !(hole && intact));
            next_row += 1;
            hole = !intact;
        }
        Event::FrameEnd { chirps_lost, .. } => {
            assert!(open && next_row == 12 && chirps_lost <= 6);
            open = false;
        }
        Event::Restarted | Event::FramesLost(_) => assert!(!open),
    };
    let (mut sequence, mut position) = (1u32, 0u64);
    for part in data.chunks(48) {
        let Some((&kind, payload)) = part.split_first() else { continue };
        match kind {
            0..=99 => {}
            100..=199 => {
                let jump = i32::from(kind) - 150;
                sequence = sequence.wrapping_add_signed(jump);
                position = position.wrapping_add_signed(i64::from(jump) * 47);
            }
            200..=219 => (sequence, position) = (1, 0),
            _ => {
                reassembly.push(payload, &mut check);
                continue;
            }
        }
        let header = Datagram::header(sequence, position % Datagram::BYTE_COUNT_MODULUS);
        reassembly.push(&[&header, payload].concat(), &mut check);
        sequence = sequence.wrapping_add(1);
        position = position.wrapping_add(payload.len() as u64);
    }
    reassembly.finish(&mut check);
});
