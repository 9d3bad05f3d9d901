//! The host's stream over a long time: nothing is allocated a frame, and memory stays what it was.
//!
//! `RFHOI_SOAK_HOURS=10 cargo test -p rfhoi-tests --test steady -- --nocapture` soaks for ten simulated hours; by default it
//! is a tenth of an hour.

use std::alloc::System;

use rfhoi::align::{FrameStream, MapName, Settings, StreamCounts};
use rfhoi::features::FrameFeatures;
use rfhoi_tests::simulated::traffic::Traffic;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Feeds `frames` frames and hands each aligned one to `each`.
fn run(
    traffic: &mut Traffic,
    stream: &mut FrameStream,
    frames: u32,
    mut each: impl FnMut(&rfhoi::align::AlignedFrame),
) {
    for _ in 0..frames {
        traffic.frame(|packet| stream.push(packet).expect("it is a packet"));
        while let Some(frame) = stream.next() {
            each(&frame);
            stream.recycle(frame);
        }
    }
}

/// What the process has in memory, kB.
fn resident_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[test]
fn nothing_is_allocated_a_frame_and_hours_leave_no_trace() {
    let hours: f64 =
        std::env::var("RFHOI_SOAK_HOURS").ok().map_or(0.1, |h| h.parse().expect("a number of hours"));
    let mut traffic = Traffic::new("kitchen", 5);
    let mut stream = FrameStream::new(Settings::new(traffic.config().clone())).unwrap();
    // The lead-in, all tags seen, every channel learnt.
    let turn = traffic.frames() as u32;
    let mut features = FrameFeatures::new(4, Some(traffic.config().profile.virtual_count()));
    run(&mut traffic, &mut stream, 20 * turn, |frame| {
        features.frame(frame);
    });
    assert_eq!(stream.epcs().len(), 6);

    let (mut frames, mut with_maps, mut differences, mut finite) = (0u64, 0u64, 0u64, true);
    let before = stream.counts();
    let region = Region::new(ALLOCATOR);
    run(&mut traffic, &mut stream, 20 * turn, |frame| {
        frames += 1;
        with_maps += u64::from(frame.invalid(MapName::RangeDoppler).is_none());
        differences += frame.phases().differences().iter().filter(|d| d.is_ok()).count() as u64;
        let shown = features.frame(frame);
        finite &= [shown.scalars, shown.reads, shown.covariance].into_iter().flatten().all(|x| x.is_finite());
    });
    let used = region.change();
    assert_eq!((used.allocations, used.reallocations), (0, 0), "{used:?}");
    assert_eq!(frames, u64::from(20 * turn));
    // It is at work all the same: somebody moves in most frames, and most tags rest.
    assert!(with_maps > frames / 4 && differences > 6 * frames, "{with_maps} {differences} of {frames}");
    assert!(finite, "the network takes numbers");

    let soaked = (hours * 36_000.0) as u32;
    let (began, resident) = (std::time::Instant::now(), resident_kb());
    let region = Region::new(ALLOCATOR);
    run(&mut traffic, &mut stream, soaked, |_| {});
    let used = region.change();
    let (kept, counts) = (used.bytes_allocated as i64 - used.bytes_deallocated as i64, stream.counts());
    println!(
        "{hours} simulated hours, {} frames: {} allocations, {kept} bytes kept, resident {:?} kB before and {:?} after, {:.1} us \
         a frame with making its packets",
        counts.frames - before.frames,
        used.allocations,
        resident,
        resident_kb(),
        began.elapsed().as_secs_f64() * 1e6 / f64::from(soaked.max(1)),
    );
    // After a minute the test harness, too, writes a line.
    assert!(used.allocations < 10 && kept == 0, "{used:?}");
    // Only in the lead-in was the radar silent.
    let new = |count: fn(&StreamCounts) -> u64| count(&counts) - count(&before);
    assert_eq!((new(|c| c.beginnings), new(|c| c.frames_missing), counts.link.packets_lost), (0, 0, 0));
}
