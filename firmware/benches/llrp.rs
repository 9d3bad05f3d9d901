//! Throughput of framing and decoding a stream of simulated Impinj reads, one read a message, in chunks of TCP size.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rfhoi_firmware::llrp::decode::Incoming;
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::reader_side::{self, MAX_REPORT_BYTES};
use rfhoi_firmware::llrp::report::TagReport;
use rfhoi_shared::units::{AntennaPort, CentiDbm, ChannelIndex, DopplerCode, PhaseCode, ReaderTime};

const READS: u32 = 10_000;
/// Payload of a TCP segment on Ethernet.
const CHUNK: usize = 1460;

fn stream() -> Vec<u8> {
    let mut stream = Vec::new();
    for n in 0..READS {
        let time = ReaderTime(1_700_000_000_000_000 + u64::from(n) * 2_500);
        let report = TagReport {
            epc: &[0x30, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, n as u8],
            antenna: Some(AntennaPort(1)),
            peak_rssi_dbm: Some(-53),
            channel: Some(ChannelIndex(14)),
            first_seen_utc: Some(time),
            last_seen_utc: Some(time),
            count: Some(1),
            phase: Some(PhaseCode(2608)),
            peak_rssi: Some(CentiDbm(-5300)),
            doppler: Some(DopplerCode(-40)),
            ..TagReport::default()
        };
        let mut buffer = [0; MAX_REPORT_BYTES];
        stream.extend(reader_side::ro_access_report(&mut buffer, n, [&report]).expect("it fits"));
    }
    stream
}

fn bench(criterion: &mut Criterion) {
    let stream = stream();
    let mut group = criterion.benchmark_group("llrp");
    group.throughput(Throughput::Bytes(stream.len() as u64));
    group.bench_function("frame", |b| {
        let mut framer = Framer::<8192>::new();
        b.iter(|| {
            let mut messages = 0;
            for mut chunk in black_box(&stream).chunks(CHUNK) {
                while let Ok(Some(message)) = framer.next(&mut chunk) {
                    messages += 1;
                    black_box(message);
                }
            }
            assert_eq!(messages, READS);
        });
    });
    group.bench_function("frame_and_decode", |b| {
        let mut framer = Framer::<8192>::new();
        b.iter(|| {
            let mut reads = 0;
            for mut chunk in black_box(&stream).chunks(CHUNK) {
                while let Ok(Some(message)) = framer.next(&mut chunk) {
                    if let Ok(Incoming::Reports(reports)) = Incoming::decode(&message) {
                        for report in reports {
                            reads += 1;
                            let _ = black_box(report);
                        }
                    }
                }
            }
            assert_eq!(reads, READS);
        });
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
