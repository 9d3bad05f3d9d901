use std::vec;
use std::vec::Vec;

use proptest::prelude::*;
use rfhoi_shared::radar::{RadarProfile, SampleFormat};

use super::*;

/// 16 samples x 2 bytes: 32 bytes a row, 64 a chirp of 2 receivers, 6 chirps a frame; full datagrams of 100 bytes
/// straddle them all.
const ROW: u32 = 32;
const CHIRP: u32 = 2 * ROW;
const FRAME: u32 = 6 * CHIRP;
const PAYLOAD: usize = 100;

fn profile() -> RadarProfile {
    RadarProfile {
        samples: 16,
        format: SampleFormat::Real,
        rx_mask: 0b101,
        loops: 2,
        ..RadarProfile::paper()
    }
}

fn reassembly() -> Reassembly<32> {
    Reassembly::new(&profile()).unwrap()
}

/// Byte of the stream at `position`, the same in every frame: tells every place of a frame from its neighbours.
fn truth(position: u64) -> u8 {
    ((position % u64::from(FRAME)).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as u8 | 1
}

fn datagram(sequence: u32, start: u64, length: usize) -> Vec<u8> {
    let mut bytes = Datagram::header(sequence, start % Datagram::BYTE_COUNT_MODULUS).to_vec();
    bytes.extend((0..length as u64).map(|i| truth(start + i)));
    bytes
}

/// The first `n` datagrams of a stream.
fn stream(n: u32) -> Vec<Vec<u8>> {
    (0..n).map(|i| datagram(i + 1, u64::from(i) * PAYLOAD as u64, PAYLOAD)).collect()
}

/// What came out, with every row checked: an intact one against the truth, another to hold truth or zeros.
#[derive(Debug, Default)]
struct Log {
    frames: Vec<(u32, u32)>,
    open: Option<u32>,
    next_row: u32,
    /// The chirp under way has a hole.
    hole: bool,
    marked: u32,
    restarts: u32,
    frames_lost: u32,
}

impl Log {
    fn take(&mut self, event: Event<'_>) {
        match event {
            Event::Restarted => {
                assert_eq!(self.open, None);
                self.restarts += 1;
            }
            Event::FramesLost(n) => {
                assert_eq!(self.open, None);
                self.frames_lost += n;
            }
            Event::FrameStart { frame } => {
                assert_eq!(self.open.replace(frame), None);
                self.next_row = 0;
                self.marked = 0;
            }
            Event::Row { chirp, receiver, bytes, intact } => {
                assert_eq!((chirp, receiver), (self.next_row / 2, self.next_row % 2));
                assert_eq!(bytes.len(), ROW as usize);
                assert!(self.open.is_some(), "a row belongs to a frame");
                let start = u64::from(self.next_row * ROW);
                for (i, &byte) in bytes.iter().enumerate() {
                    assert!(byte == truth(start + i as u64) || (byte == 0 && !intact), "shifted");
                }
                self.next_row += 1;
                assert!(!(self.hole && intact), "a chirp with a hole stays marked");
                self.hole = !intact;
                if receiver == 1 {
                    self.marked += u32::from(std::mem::take(&mut self.hole));
                }
            }
            Event::FrameEnd { frame, chirps_lost } => {
                assert_eq!(self.open.take(), Some(frame));
                assert_eq!(self.next_row, FRAME / ROW);
                assert_eq!(chirps_lost, self.marked);
                self.frames.push((frame, chirps_lost));
            }
        }
    }
}

fn run(datagrams: &[Vec<u8>]) -> (Log, Reassembly<32>) {
    let mut reassembly = reassembly();
    let mut log = Log::default();
    for bytes in datagrams {
        reassembly.push(bytes, |e| log.take(e));
    }
    reassembly.finish(|e| log.take(e));
    (log, reassembly)
}

#[test]
fn a_clean_stream_has_no_marks() {
    // 96 datagrams are 25 frames exactly.
    let (log, reassembly) = run(&stream(96));
    assert_eq!(log.frames, (0..25).map(|f| (f, 0)).collect::<Vec<_>>());
    assert_eq!(reassembly.frames(), FrameCounts { complete: 25, incomplete: 0, lost: 0 });
    assert_eq!(reassembly.datagrams(), DatagramCounts { received: 96, ..Default::default() });
}

#[test]
fn a_lost_datagram_marks_the_chirps_that_it_touches() {
    let mut datagrams = stream(96);
    datagrams.remove(1); // bytes 100 to 199: chirps 1, 2 and 3
    let (log, reassembly) = run(&datagrams);
    assert_eq!(log.frames[..2], [(0, 3), (1, 0)]);
    assert_eq!(reassembly.datagrams().lost, 1);
    assert_eq!(reassembly.frames().incomplete, 1);
}

#[test]
fn rows_before_and_after_a_hole_are_told_apart() {
    let mut datagrams = stream(96);
    datagrams.remove(1); // bytes 100 to 199: rows 3 to 6
    let mut reassembly = reassembly();
    let mut intact_rows = Vec::new();
    for bytes in &datagrams[..5] {
        reassembly.push(bytes, |event| {
            if let Event::Row { chirp, receiver, intact: true, .. } = event {
                intact_rows.push((chirp, receiver));
            }
        });
    }
    // Row 2 came before the hole in its chirp was known; row 7 came whole behind one.
    assert_eq!(intact_rows[..4], [(0, 0), (0, 1), (1, 0), (4, 0)]);
}

#[test]
fn whole_frames_that_are_missing_are_counted_not_filled() {
    let mut datagrams = stream(96);
    datagrams.drain(2..50); // bytes 200 to 4999: the rest of frame 0, frames 1 to 12, 8 bytes of frame 13
    let (log, reassembly) = run(&datagrams);
    assert_eq!(log.frames[..3], [(0, 3), (13, 1), (14, 0)]);
    assert_eq!((log.frames_lost, reassembly.datagrams().lost), (12, 48));
}

#[test]
fn duplicates_and_late_datagrams_are_told_apart() {
    let mut datagrams = stream(96);
    let late = datagrams.remove(10);
    datagrams.insert(15, late);
    datagrams.insert(30, datagrams[28].clone());
    let (log, reassembly) = run(&datagrams);
    let counts = reassembly.datagrams();
    assert_eq!((counts.late, counts.duplicate, counts.lost, counts.received), (1, 1, 1, 95));
    assert_eq!(log.frames.iter().filter(|f| f.1 > 0).count(), 1);
}

#[test]
fn a_restart_ends_the_frame_and_begins_at_a_frame() {
    let mut datagrams = stream(70);
    datagrams.extend(stream(96));
    let (log, reassembly) = run(&datagrams);
    assert_eq!((log.restarts, reassembly.datagrams().restarts), (1, 1));
    // 70 datagrams are 18 frames and 88 bytes of another: one chirp of six is whole.
    assert_eq!(log.frames[18], (18, 5));
    assert_eq!(log.frames.len(), 19 + 25);
    assert!(log.frames[19..].iter().all(|f| f.1 == 0));
}

#[test]
fn a_restart_whose_first_datagram_is_lost_is_found_by_its_run() {
    let mut datagrams = stream(90);
    datagrams.extend(stream(96).into_iter().skip(1));
    let (log, reassembly) = run(&datagrams);
    assert_eq!(reassembly.datagrams().restarts, 1);
    assert_eq!(log.restarts, 1);
    assert_eq!(log.frames.last().unwrap().1, 0, "in step again");
}

#[test]
fn a_single_old_first_datagram_does_not_restart() {
    let mut datagrams = stream(40);
    datagrams.insert(20, datagrams[0].clone());
    let (log, reassembly) = run(&datagrams);
    assert_eq!(log.restarts, 0);
    assert_eq!(reassembly.datagrams().duplicate, 1);
}

#[test]
fn joining_in_the_middle_starts_with_a_hole() {
    let (log, reassembly) = run(&stream(96)[50..]);
    // Datagram 51 begins at byte 5000 = frame 13 + 8 bytes; numbers count from the first frame seen.
    assert_eq!(log.frames[0].1, 1);
    assert_eq!(reassembly.datagrams().lost, 0);
}

#[test]
fn garbage_neither_moves_the_stream_nor_starts_one() {
    let mut datagrams = stream(96);
    datagrams.insert(0, datagram(77, 5, PAYLOAD));
    datagrams.insert(10, datagram(0xdead_beef, 0x1234_5678, PAYLOAD));
    datagrams.insert(20, vec![1, 2, 3]);
    datagrams.insert(30, datagram(30, 1 << 40, PAYLOAD));
    let (log, reassembly) = run(&datagrams);
    assert_eq!(log.frames, (0..25).map(|f| (f, 0)).collect::<Vec<_>>());
    assert_eq!(reassembly.datagrams().malformed, 4);
}

#[test]
fn counters_wrap_without_a_trace() {
    // The sequence wraps after 4 datagrams, the byte count after 10.
    let start = Datagram::BYTE_COUNT_MODULUS - 1000;
    let datagrams: Vec<_> = (0..60u32)
        .map(|i| datagram((u32::MAX - 3).wrapping_add(i), start + u64::from(i) * PAYLOAD as u64, PAYLOAD))
        .collect();
    let mut reassembly = reassembly();
    // Joined there, so numbers do not agree; a run of datagrams makes it the stream.
    let (mut ends, mut marked) = (0, 0);
    for bytes in &datagrams {
        reassembly.push(bytes, |event| {
            if let Event::FrameEnd { chirps_lost, .. } = event {
                ends += 1;
                marked += chirps_lost;
            }
        });
    }
    let counts = reassembly.datagrams();
    assert_eq!((counts.lost, counts.restarts, counts.late), (0, 0, 0));
    assert_eq!(counts.received + counts.malformed, 60);
    assert!(ends > 8 && marked <= 6, "{ends} frames, {marked} chirps marked");
}

#[test]
fn profiles_that_do_not_fit_are_refused() {
    assert!(Reassembly::<31>::new(&profile()).is_none());
    assert!(Reassembly::<32>::new(&RadarProfile { loops: 0, ..profile() }).is_none());
    assert!(Reassembly::<32>::new(&RadarProfile { rx_mask: 0, ..profile() }).is_none());
    assert!(Reassembly::<32>::new(&RadarProfile { samples: 0, ..profile() }).is_none());
}

/// What the network does to one datagram.
#[derive(Debug, Clone, Copy)]
enum Fate {
    Arrives,
    Lost,
    Twice,
    Delayed(usize),
}

fn fate() -> impl Strategy<Value = Fate> {
    prop_oneof![
        12 => Just(Fate::Arrives),
        2 => Just(Fate::Lost),
        1 => Just(Fate::Twice),
        1 => (1usize..12).prop_map(Fate::Delayed),
    ]
}

proptest! {
    #[test]
    fn whatever_the_network_does_nothing_is_shifted(fates in prop::collection::vec(fate(), 1..300)) {
        let mut queue: Vec<(usize, Vec<u8>)> = Vec::new();
        for (i, (bytes, fate)) in stream(300).into_iter().zip(&fates).enumerate() {
            match fate {
                Fate::Lost => {}
                Fate::Arrives => queue.push((i * 2, bytes)),
                Fate::Twice => queue.extend([(i * 2, bytes.clone()), (i * 2, bytes)]),
                Fate::Delayed(by) => queue.push((i * 2 + by * 2 + 1, bytes)),
            }
        }
        queue.sort_by_key(|entry| entry.0);
        let arrived: Vec<_> = queue.into_iter().map(|entry| entry.1).collect();
        let (log, reassembly) = run(&arrived);
        let counts = reassembly.datagrams();
        prop_assert_eq!(counts.malformed, 0);
        prop_assert_eq!(counts.received + counts.late + counts.duplicate, arrived.len() as u32);
        prop_assert_eq!(log.restarts, 0);
        let frames = reassembly.frames();
        prop_assert_eq!(log.frames.len() as u32, frames.complete + frames.incomplete);
        prop_assert_eq!(log.frames_lost, frames.lost);
        // Every frame that the recorder sent is numbered, up to the last of which anything came.
        if let Some(&(last, _)) = log.frames.last() {
            prop_assert_eq!(last + 1, log.frames.len() as u32 + log.frames_lost);
        }
        // A frame none of whose datagrams was touched is complete.
        let untouched = fates.iter().all(|f| matches!(f, Fate::Arrives | Fate::Twice));
        let whole = (fates.len() * PAYLOAD).is_multiple_of(FRAME as usize);
        prop_assert_eq!(frames.incomplete == 0 && frames.lost == 0 && whole, untouched && whole);
    }

    #[test]
    fn arbitrary_bytes_never_panic(
        datagrams in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 0..50),
        valid in 0u32..40,
    ) {
        let mut reassembly = reassembly();
        let mut bytes_out = 0u64;
        for bytes in stream(valid).iter().chain(&datagrams).chain(&stream(valid)) {
            reassembly.push(bytes, |e| {
                if let Event::Row { bytes, .. } = e {
                    bytes_out += bytes.len() as u64;
                }
            });
        }
        reassembly.finish(|_| {});
        // Bounded: a datagram can fill in at most the two frames around a jump.
        prop_assert!(bytes_out <= (u64::from(valid) * 2 + datagrams.len() as u64 + 1) * 3 * u64::from(FRAME));
    }
}
