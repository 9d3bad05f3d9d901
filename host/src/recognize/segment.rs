//! When something moves: activity frame by frame in, runs of frames out.
//!
//! Figures in this module are those of the simulated set `--domain site --seed 2` (2,395 interactions, one in a sample, by people in
//! three rooms; of how long a quiet is, of its first 1,216 samples): with these constants the best segment of a sample, with what
//! goes along, and the person's true first and last movement have a mean intersection over union of 0.81, 1.7 % of the
//! interactions come apart, and 0.2 % are missed.

use std::collections::VecDeque;
use std::ops::Range;

/// Moving cells of a radar frame with which a segment begins: a person who stands has no more than 3 in half of the frames, one
/// who reaches has 13 in the median frame that has any.
pub const BEGIN_CELLS: u32 = 6;
/// Frames of the last three that need so many: one alone is noise.
const BEGIN_FRAMES: usize = 2;
const BEGIN_OF: usize = 3;
/// Moving cells with which it goes on: a hand that turns round or grasps shows few.
pub const STAY_CELLS: u32 = 3;
/// Quiet after which it is over, s. Between reaching and carrying people hesitate: 0.8 s of quiet tear one interaction in five
/// apart, 1.2 s one in twenty-five, 1.5 s one in sixty.
const QUIET_S: f64 = 1.5;
/// Longest segment, s: interactions last 2.6, 3.8 and 6.5 s at the 5th, 50th and 95th percentile, at most 7.9 s.
const LONGEST_S: f64 = 8.0;
/// Shortest, s.
const SHORTEST_S: f64 = 0.6;
/// What goes along before and after, s: a movement begins and ends with less than [`BEGIN_CELLS`]. The network is trained with
/// windows that are cut like this.
const PADDING_S: f64 = 0.6;

/// Why a segment ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// It became quiet.
    Quiet,
    /// It was too long, and was cut where it was quietest.
    Cut,
    /// The frames ended, or did not go on evenly.
    Stream,
}

/// A run of frames in which something moved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Segment {
    /// The frames by their numbers, with what goes along before and after.
    pub frames: Range<usize>,
    /// Frames from the first that moved to the last.
    pub moved: usize,
    /// Why it ended.
    pub ended: Ended,
}

/// Finds segments. Frames are numbered from 0.
#[derive(Debug, Clone)]
pub struct Segmenter {
    quiet: usize,
    longest: usize,
    shortest: usize,
    padding: usize,
    /// Number of the next frame.
    next: usize,
    /// No segment begins before this frame.
    earliest: usize,
    open: Option<Open>,
    /// Activity of the last frames, or of the open segment's.
    levels: VecDeque<u32>,
}

/// A segment that has begun.
#[derive(Debug, Clone, Copy)]
struct Open {
    begin: usize,
    /// Past the last frame that moved.
    end: usize,
}

impl Segmenter {
    /// Of frames that are `frame_s` apart.
    pub fn new(frame_s: f64) -> Self {
        let frames = |s: f64| ((s / frame_s).round() as usize).max(1);
        Self {
            quiet: frames(QUIET_S),
            longest: frames(LONGEST_S),
            shortest: frames(SHORTEST_S),
            padding: frames(PADDING_S),
            next: 0,
            earliest: 0,
            open: None,
            levels: VecDeque::new(),
        }
    }

    /// Frames back from the last one that a segment may still begin with.
    pub fn reach(&self) -> usize {
        self.longest + self.quiet + self.padding + BEGIN_OF
    }

    /// Frames that a segment must have moved in.
    pub fn shortest(&self) -> usize {
        self.shortest
    }

    /// Takes the next frame's moving cells. Returns the segment that is over with it.
    pub fn push(&mut self, cells: u32) -> Option<Segment> {
        let now = self.next;
        self.next += 1;
        self.levels.push_back(cells);
        let Some(open) = &mut self.open else {
            if self.levels.len() > BEGIN_OF {
                self.levels.pop_front();
            }
            let moves = |level: &&u32| **level >= BEGIN_CELLS;
            if self.levels.iter().filter(moves).count() >= BEGIN_FRAMES {
                let still = self.levels.iter().take_while(|level| !moves(level)).count();
                self.levels.drain(..still);
                let begin = self.next - self.levels.len();
                let after = self.levels.iter().rev().take_while(|level| **level < STAY_CELLS).count();
                self.open = Some(Open { begin, end: self.next - after });
            }
            return None;
        };
        if cells >= STAY_CELLS {
            open.end = self.next;
        }
        let Open { begin, end } = *open;
        if self.next - end >= self.quiet {
            return self.close(Ended::Quiet);
        }
        if self.next - begin < self.longest {
            return None;
        }
        // The quietest frame of the second half; the first of equals.
        let half = self.longest / 2;
        let quietest =
            self.levels.iter().enumerate().skip(half).min_by_key(|(place, level)| (**level, *place));
        let cut = begin + quietest.map_or(half, |(place, _)| place);
        let segment = Segment { frames: self.padded(begin)..cut, moved: cut - begin, ended: Ended::Cut };
        self.levels.drain(..cut - begin);
        self.earliest = cut;
        self.open = Some(Open { begin: cut, end: end.clamp(cut, now + 1) });
        Some(segment)
    }

    /// Ends the run of frames: what follows is not next to what was. Returns the segment under way.
    pub fn interrupt(&mut self) -> Option<Segment> {
        let segment = self.close(Ended::Stream);
        self.levels.clear();
        self.earliest = self.next;
        segment
    }

    fn padded(&self, begin: usize) -> usize {
        begin.saturating_sub(self.padding).max(self.earliest)
    }

    /// Ends the open segment; `None` where it was too short and others could tell more of it.
    fn close(&mut self, ended: Ended) -> Option<Segment> {
        let Open { begin, end } = self.open.take()?;
        let moved = end - begin;
        let frames = self.padded(begin)..(end + self.padding).min(self.next);
        self.levels.drain(..self.levels.len().saturating_sub(BEGIN_OF));
        if moved < self.shortest && ended == Ended::Quiet {
            return None;
        }
        self.earliest = frames.end;
        (moved > 0).then_some(Segment { frames, moved, ended })
    }
}

/// Segments of frames that are `frame_s` apart, by the moving cells of each.
pub fn segments(levels: impl IntoIterator<Item = u32>, frame_s: f64) -> Vec<Segment> {
    let mut segmenter = Segmenter::new(frame_s);
    let mut found: Vec<_> = levels.into_iter().filter_map(|level| segmenter.push(level)).collect();
    found.extend(segmenter.interrupt());
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segments(levels: impl IntoIterator<Item = u32>) -> Vec<Segment> {
        super::segments(levels, 0.1)
    }

    fn levels(runs: &[(u32, usize)]) -> Vec<u32> {
        runs.iter().flat_map(|&(level, frames)| std::iter::repeat_n(level, frames)).collect()
    }

    #[test]
    fn what_moves_is_found_with_rest_around_it() {
        let found = segments(levels(&[(0, 20), (12, 25), (0, 10), (5, 4), (0, 40)]));
        let want = Segment { frames: 14..65, moved: 39, ended: Ended::Quiet };
        assert_eq!(found, [want]);
    }

    #[test]
    fn quiet_and_flicker_are_nothing() {
        assert_eq!(segments(levels(&[(5, 500)])), []);
        assert_eq!(segments(levels(&[(0, 20), (40, 1), (0, 20), (40, 3), (0, 20)])), []);
        assert_eq!(segments([]), []);
        assert_eq!(segments([50]), []);
    }

    #[test]
    fn what_lasts_is_cut_where_it_is_quietest() {
        let found = segments(levels(&[(20, 55), (7, 1), (20, 60), (0, 30)]));
        assert_eq!(found.iter().map(|s| s.frames.clone()).collect::<Vec<_>>(), [0..55, 55..122]);
        assert_eq!((found[0].ended, found[1].ended), (Ended::Cut, Ended::Quiet));
        // Everything moves all the time.
        let found = segments(levels(&[(u32::MAX, 6_000)]));
        assert!(found.iter().all(|s| s.frames.len() <= 80));
        assert!(found.windows(2).all(|pair| pair[0].frames.end == pair[1].frames.start));
        assert_eq!((found[0].frames.start, found.last().unwrap().frames.end), (0, 6_000));
    }

    #[test]
    fn an_interruption_ends_what_is_under_way() {
        let mut segmenter = Segmenter::new(0.1);
        levels(&[(0, 5), (9, 3)]).into_iter().for_each(|level| assert_eq!(segmenter.push(level), None));
        let want = Segment { frames: 0..8, moved: 3, ended: Ended::Stream };
        assert_eq!(segmenter.interrupt(), Some(want));
        assert_eq!(segmenter.interrupt(), None);
        let after = levels(&[(9, 20), (0, 15)]).into_iter().find_map(|level| segmenter.push(level));
        assert_eq!(after.unwrap().frames.start, 8, "nothing from before");
    }

    /// Figures of this module on a set: `RFHOI_SET=DIR cargo test -p rfhoi --lib segments_of_a_set -- --ignored --nocapture`.
    #[test]
    #[ignore = "needs a data set, and prints what it finds"]
    fn segments_of_a_set() {
        let folder = std::path::PathBuf::from(std::env::var_os("RFHOI_SET").expect("RFHOI_SET names a set"));
        let (mut overlaps, mut torn, mut missed, mut idle, mut idle_found) = (Vec::new(), 0, 0, 0, 0);
        for shard in
            (0..).map(|n| folder.join(crate::simulate::set::shard_name(n))).take_while(|path| path.exists())
        {
            let mut npz = ndarray_npy::NpzReader::new(std::fs::File::open(shard).unwrap()).unwrap();
            let first: ndarray::Array1<u32> = npz.by_name("frame_first").unwrap();
            let cells: ndarray::Array1<u32> = npz.by_name("moving_cells").unwrap();
            let truth: ndarray::Array2<f32> = npz.by_name("interaction_s").unwrap();
            for (sample, ends) in first.as_slice().unwrap().windows(2).enumerate() {
                let found = segments((ends[0]..ends[1]).map(|frame| cells[frame as usize]));
                let [begin, end] = [0, 1].map(|n| 10.0 * truth[(sample, n)]);
                if end == 0.0 {
                    idle += 1;
                    idle_found += usize::from(!found.is_empty());
                    continue;
                }
                let overlap = |segment: &Segment| {
                    let Range { start, end: stop } = segment.frames;
                    let (start, stop) = (start as f32, stop as f32);
                    (stop.min(end) - start.max(begin)).max(0.0) / (stop.max(end) - start.min(begin))
                };
                torn += usize::from(found.len() > 1);
                missed += usize::from(found.is_empty());
                overlaps.push(found.iter().map(overlap).fold(0.0, f32::max));
            }
        }
        let count = overlaps.len();
        let mean = overlaps.iter().sum::<f32>() / count as f32;
        let poor = overlaps.iter().filter(|overlap| **overlap < 0.5).count();
        println!(
            "{count} interactions: mean intersection over union {mean:.3}, {poor} below 0.5, {torn} in pieces, {missed} missed; \
             {idle} without one, something moved in {idle_found}"
        );
        assert!(mean > 0.8);
    }

    #[test]
    fn nothing_is_kept_for_long() {
        let mut segmenter = Segmenter::new(0.1);
        for frame in 0..100_000_u32 {
            if let Some(segment) = segmenter.push(frame.wrapping_mul(2_654_435_761) >> 27) {
                assert!(segmenter.next - segment.frames.start <= segmenter.reach());
            }
            assert!(segmenter.levels.len() <= segmenter.longest + segmenter.quiet);
        }
    }
}
