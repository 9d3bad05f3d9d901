//! Frames of phase differences allocate nothing once all tags have been seen.

use std::alloc::System;

use rfhoi::phase::{PhaseFrames, Settings};
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, PhaseCode};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// A simulated read of one of six tags by one of four antennas, each 4 ms, on 50 channels.
fn read(n: u64) -> TagRead {
    let time = 1_000_000 + n * 4_000;
    TagRead {
        time: BridgeTime(time),
        epc: Epc::new(&[0xe2, 0x80, (n % 6) as u8]).unwrap(),
        antenna: AntennaPort((n / 6 % 4) as u16 + 1),
        channel: ChannelIndex((time / 200_000 % 50) as u16 + 1),
        phase: Some(PhaseCode((time / 200_000 * 999 % 4_096) as u16)),
        rssi: CentiDbm(-5_000),
        doppler: None,
    }
}

#[test]
fn the_steady_state_does_not_allocate() {
    let mut frames = PhaseFrames::new(Settings::default());
    let mut frame = |from: u64| {
        for n in from..from + 25 {
            let read = read(n);
            frames.push(&read, read.time);
        }
        let begin = 1_000_000 + from * 4_000;
        frames.frame(BridgeTime(begin), BridgeTime(begin + 100_000)).differences().len()
    };
    (0..20).for_each(|n| {
        frame(n * 25);
    });
    // The harness has a thread of its own, which allocates a little while this one runs.
    let mut allocations = (0..5).map(|run| {
        let region = Region::new(GLOBAL);
        for n in 0..400 {
            assert_eq!(frame((20 + 400 * run + n) * 25), 24);
        }
        region.change().allocations
    });
    assert!(allocations.any(|count| count == 0));
}
