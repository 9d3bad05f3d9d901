//! The host's readers of files: packets, arrays of samples, tables of reads.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use rfhoi::reads::ReadTable;
use rfhoi::recording::Recording;
use rfhoi::samples::RawSamples;

/// Headers of a pcap of Ethernet packets and of one packet of `length` bytes.
fn pcap(packet: &[u8]) -> Vec<u8> {
    let length = (packet.len() as u32).to_le_bytes();
    let file = [0xd4, 0xc3, 0xb2, 0xa1, 2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 1, 0, 0, 0];
    [&file[..], &[0; 8], &length, &length, packet].concat()
}

fuzz_target!(|data: &[u8]| {
    for bytes in [data.to_vec(), pcap(data)] {
        let length = bytes.len();
        if let Ok(recording) = Recording::from_reader("fuzz.pcap", Cursor::new(bytes)) {
            let payload: usize = recording.map_while(Result::ok).map(|r| r.payload.len()).sum();
            // Compressed input may hold more than its own length.
            assert!(payload <= length || data.starts_with(&[0x1f, 0x8b]), "{payload} bytes out of {length}");
        }
    }
    let _ = RawSamples::from_npy("fuzz.npy", data);
    if let Ok(text) = std::str::from_utf8(data)
        && let Ok(table) = ReadTable::parse("fuzz.csv", text)
    {
        assert!(table.reads.is_sorted_by_key(|r| r.time));
    }
});
