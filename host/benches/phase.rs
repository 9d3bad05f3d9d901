//! Time for all of a frame of phase differences, its reads and the frame itself: 6 and 30 simulated tags, 4 antennas, a read of
//! every tag by every antenna each 100 ms, as a quick reader does, and each 20 ms, which is more than any does.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use rfhoi::phase::{PhaseFrames, Settings};
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, PhaseCode};

const FRAME_US: u64 = 100_000;
const DWELL_US: u64 = 200_000;
const CHANNELS: u64 = 50;
const ANTENNAS: u16 = 4;

/// The reads of one frame, in order.
fn reads(tags: u8, between_us: u64, begin: u64, into: &mut Vec<TagRead>) {
    into.clear();
    for round in 0..FRAME_US / between_us {
        for antenna in 1..=ANTENNAS {
            for tag in 0..tags {
                let time = begin + round * between_us + u64::from(antenna) * 4_000 + u64::from(tag) * 100;
                let channel = time / DWELL_US % CHANNELS;
                // An offset for each channel, and a spread of some codes.
                let phase = channel * 1_237 + u64::from(tag) * 77 + time / 1_000 % 7 * 8;
                into.push(TagRead {
                    time: BridgeTime(time),
                    epc: Epc::new(&[0xe2, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, tag]).expect("it is short"),
                    antenna: AntennaPort(antenna),
                    channel: ChannelIndex(channel as u16 + 1),
                    phase: Some(PhaseCode((phase % 4_096) as u16)),
                    rssi: CentiDbm(-5_000),
                    doppler: None,
                });
            }
        }
    }
}

fn bench(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame of phase differences, 4 antennas");
    for (tags, between_us) in [(6, FRAME_US), (30, FRAME_US), (6, 20_000), (30, 20_000)] {
        let mut frames = PhaseFrames::new(Settings::default());
        let (mut begin, mut batch) = (1_000_000, Vec::new());
        group.bench_function(
            format!("{tags} tags, {} reads", u64::from(tags) * 4 * (FRAME_US / between_us)),
            |bencher| {
                bencher.iter_custom(|iterations| {
                    let mut spent = std::time::Duration::ZERO;
                    for _ in 0..iterations {
                        reads(tags, between_us, begin, &mut batch);
                        let start = std::time::Instant::now();
                        for read in &batch {
                            frames.push(read, read.time);
                        }
                        black_box(frames.frame(BridgeTime(begin), BridgeTime(begin + FRAME_US)));
                        spent += start.elapsed();
                        begin += FRAME_US;
                    }
                    spent
                });
            },
        );
        let frame = frames.frame(BridgeTime(begin - FRAME_US), BridgeTime(begin));
        assert_eq!(frame.differences().len(), usize::from(tags) * usize::from(ANTENNAS));
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
