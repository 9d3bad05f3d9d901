//! A client that we did not write (`llrpkit`) against our simulated reader: it must take what the reader says, and read
//! what the reader read. So tests of our own client against this reader are not a monologue.
//!
//! Needs `llrpkit`; without it the test says so and passes, unless `RFHOI_REQUIRE` is set.

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::process::Stdio;
use std::time::{Duration, Instant};

use rfhoi_shared::units::BridgeTime;
use rfhoi_tests::simulated::machine;
use rfhoi_tests::simulated::reader::{Setup, SimulatedReader, Tag};

/// Reads that the client asks for.
const READS: usize = 200;
/// Longest wait for the client; Python starts within seconds.
const PATIENCE: Duration = Duration::from_secs(60);

/// Lets `reader` speak on `connection` until the client closes it, in the time of the wall.
fn serve(reader: &mut SimulatedReader, mut connection: TcpStream, start: Instant) {
    let now = || BridgeTime(start.elapsed().as_micros() as u64);
    connection.set_nonblocking(true).unwrap();
    let mut said = reader.accept(now());
    let mut heard = [0; 4096];
    while start.elapsed() < PATIENCE {
        match connection.read(&mut heard) {
            Ok(0) => return,
            Ok(length) => said.extend(reader.receive(now(), &heard[..length])),
            Err(error) => assert_eq!(error.kind(), ErrorKind::WouldBlock),
        }
        while let Some(message) = reader.message(now()) {
            said.extend(message);
        }
        let gone = !said.is_empty() && connection.write_all(&said).is_err();
        if gone || reader.is_closing() {
            return;
        }
        said.clear();
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("the client does not come to an end");
}

#[test]
fn another_client_reads_what_the_simulated_reader_reads() {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = listener.local_addr().unwrap().port().to_string();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("reads.jsonl");
    let mut command = machine::llrpkit();
    command.args(["inventory", "127.0.0.1", "--port", &port, "--antennas", "1,2", "--phase"]);
    command.args(["--count", &READS.to_string(), "--output"]).arg(&output);
    let client = match command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn() {
        Ok(client) => client,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return machine::missing("llrpkit (an LLRP client, from PyPI)");
        }
        Err(error) => panic!("llrpkit: {error}"),
    };
    let tags = [1, 2].map(|n| Tag { epc: [n; 12], distance_m: f64::from(n), swing_m: 0.1 });
    let mut reader = SimulatedReader::new(Setup::new(tags.into()));
    let (connection, _) = listener.accept().unwrap();
    serve(&mut reader, connection, Instant::now());
    let client = client.wait_with_output().unwrap();
    let words = String::from_utf8_lossy(&client.stdout) + String::from_utf8_lossy(&client.stderr);
    assert!(client.status.success(), "{words}");

    let text = std::fs::read_to_string(&output).unwrap();
    let theirs: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert!(theirs.len() >= READS, "{words}");
    for (theirs, ours) in theirs.iter().zip(reader.reads()) {
        let epc = ours.epc.to_string();
        assert_eq!(theirs["epc"], epc.as_str(), "{theirs}");
        assert_eq!(theirs["antenna"], u64::from(ours.antenna.0), "{theirs}");
    }
}
