//! A decoder that we did not write (`pyllrp`) reads the LLRP reports of a simulated session: each field must come out as
//! it went in.
//!
//! Needs Python with `pyllrp` 3.1.1 (and `bitstring` below 5, which it uses) in `target/venv`; without it the test says so and passes, unless `RFHOI_REQUIRE` is
//! set.

use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi::simulate::effects::{Domain, Effects};
use rfhoi::simulate::rfid::report::access_report;
use rfhoi::simulate::rfid::{Options, ReaderSession, simulate};
use rfhoi_firmware::llrp::reader_side::MAX_REPORT_BYTES;
use rfhoi_shared::units::{BridgeTime, ReaderTime};
use rfhoi_tests::simulated::machine;
use serde_json::{Value, json};

#[path = "rfid/room.rs"]
mod room;
use room::Room;

const ROSPEC: u32 = 7;
/// UTC of the reader at the bridge's time 0, us: 1 January 2026.
const EPOCH: ReaderTime = ReaderTime(1_767_225_600_000_000);
/// Reads in a report, at most.
const TOGETHER: usize = 5;

#[test]
fn another_decoder_reads_each_field_of_a_simulated_session() {
    let mut python = machine::python();
    if !python.args(["-c", "import pyllrp"]).output().is_ok_and(|o| o.status.success()) {
        return machine::missing("pyllrp (a decoder of LLRP, from PyPI)");
    }
    // EPCs of 12 bytes and of others.
    let room = Room::square(4, &[12, 12, 12, 8, 16, 12]);
    let effects = Effects::of(Domain::Site);
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let session = ReaderSession::draw(4, room.tags.len(), &effects, &mut rng);
    let position = |tag: usize, t: f64| room.place(1.5 + 0.4 * tag as f32, 1.0 + 0.2 * t as f32);
    let options = Options::between(-2.0, 4.0, BridgeTime(2_000_000));
    let reads = simulate(room.situation(&position, effects), &session, options, &mut rng);
    assert!(reads.len() > 500, "{} reads", reads.len());
    assert!([8, 12, 16].iter().all(|&bytes| reads.iter().any(|read| read.epc.bytes().len() == bytes)));

    let mut bytes = Vec::new();
    for (id, reads) in (1..).zip(reads.chunks(TOGETHER)) {
        let mut buffer = [0; TOGETHER * MAX_REPORT_BYTES];
        bytes.extend_from_slice(access_report(&mut buffer, id, reads, ROSPEC, EPOCH).unwrap());
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("reports.llrp");
    std::fs::write(&file, bytes).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("llrp_peer.py");
    let output = machine::python().arg(script).arg(file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let text = String::from_utf8(output.stdout).unwrap();
    let theirs: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(theirs.len(), reads.len());
    for (theirs, read) in theirs.iter().zip(&reads) {
        let seen = EPOCH.0 + read.time.0;
        let ours = json!({
            "epc": read.epc.to_string(),
            "antenna": read.antenna.0,
            "channel": read.channel.0,
            "rospec": ROSPEC,
            "peak_rssi_dbm": read.rssi.dbm().round() as i8,
            "first_seen_us": seen,
            "last_seen_us": seen,
            "count": 1,
            "phase": read.phase.map(|code| code.0),
            "peak_rssi": read.rssi.0,
            "doppler": read.doppler.map(|code| code.0),
            "others": [],
        });
        assert_eq!(theirs, &ours);
    }
}
