//! Figures in motion, as animated GIF files.

use std::borrow::Cow;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use gif::{Encoder, Frame, Repeat};

use super::canvas::{Canvas, FRAME, GRID, INK, Rgb};
use super::{Figure, PlotError, colour};
use crate::atomic::AtomicFile;

/// How long the last picture stays, 1/100 s.
const LAST_STAYS: u64 = 100;
/// Colours of maps, greys, and steps from white to each series' colour: together at most 256.
const MAP_COLOURS: usize = 120;
const GREYS: usize = 52;
const LEVELS: usize = 20;
const TINTS: usize = 8;
/// Bits of each channel by which the nearest colour is found.
const BITS: u32 = 5;

/// Draws `figures`, all of one size, one after the other every `frame_s` seconds and puts them at `path`, which should end
/// in `.gif`. GIF counts in hundredths of a second, to which the times are rounded so that they do not drift; the last
/// picture stays for a second before the film begins again.
///
/// # Errors
/// Any [`PlotError`]; a figure of another size than the first is refused.
pub fn save_film(
    path: impl AsRef<Path>,
    figures: impl IntoIterator<Item = Figure>,
    frame_s: f64,
) -> Result<(), PlotError> {
    let path = path.as_ref();
    let trouble = |reason: String| PlotError::Draw { path: path.to_path_buf(), reason };
    let palette = Palette::new();
    let mut figures = figures.into_iter();
    let first = figures.next().ok_or_else(|| trouble("a film needs one picture or more".into()))?;
    let (size, pixels) = pixels_of(&first, path)?;

    let file = AtomicFile::create(path)?;
    let out = File::create(file.temporary()).map_err(|e| trouble(e.to_string()))?;
    let encoder = Encoder::new(BufWriter::new(out), size.0 as u16, size.1 as u16, &palette.bytes());
    let mut encoder = encoder.map_err(|e| trouble(e.to_string()))?;
    encoder.set_repeat(Repeat::Infinite).map_err(|e| trouble(e.to_string()))?;

    let hundredths = |n: u32| (f64::from(n) * frame_s * 100.0).round() as u64;
    let mut shown = palette.indices(&pixels);
    let mut frame = changed(&[], &shown, size.0 as usize);
    for number in 1.. {
        let next = figures.next();
        let stay = if next.is_some() { hundredths(number) - hundredths(number - 1) } else { LAST_STAYS };
        frame.delay = u16::try_from(stay).unwrap_or(u16::MAX);
        encoder.write_frame(&frame).map_err(|e| trouble(e.to_string()))?;
        let Some(next) = next else { break };
        let (next_size, pixels) = pixels_of(&next, path)?;
        if next_size != size {
            return Err(trouble(format!(
                "picture {} of the film has another size than the first",
                number + 1
            )));
        }
        let indices = palette.indices(&pixels);
        frame = changed(&shown, &indices, size.0 as usize);
        shown = indices;
    }
    let mut out = encoder.into_inner().map_err(|e| trouble(e.to_string()))?;
    out.flush().map_err(|e| trouble(e.to_string()))?;
    Ok(file.commit()?)
}

/// Width and height of a figure and its pixels, row by row.
fn pixels_of(figure: &Figure, path: &Path) -> Result<((u32, u32), Vec<u8>), PlotError> {
    let canvas = figure.canvas(path, Canvas::of_pixels)?;
    canvas.pixels().map_err(|e| PlotError::Draw { path: path.to_path_buf(), reason: e.to_string() })
}

/// The rectangle in which `after` differs from `before`; all of it if there is nothing before, one pixel if nothing does.
fn changed(before: &[u8], after: &[u8], width: usize) -> Frame<'static> {
    let differs = |n: usize| before.get(n) != Some(&after[n]);
    let (mut left, mut right, mut top, mut bottom) = (width, 0, usize::MAX, 0);
    for n in (0..after.len()).filter(|&n| differs(n)) {
        let (x, y) = (n % width, n / width);
        (left, right) = (left.min(x), right.max(x));
        (top, bottom) = (top.min(y), bottom.max(y));
    }
    if left > right {
        (left, right, top, bottom) = (0, 0, 0, 0);
    }
    let rows = (top..=bottom).flat_map(|y| &after[y * width + left..=y * width + right]);
    Frame {
        left: left as u16,
        top: top as u16,
        width: (right - left + 1) as u16,
        height: (bottom - top + 1) as u16,
        buffer: Cow::Owned(rows.copied().collect()),
        ..Frame::default()
    }
}

/// The colours of a film: one table for all its pictures, so that they do not flicker.
struct Palette {
    colours: Vec<Rgb>,
    /// Number of the nearest colour by the upper bits of red, green and blue.
    nearest: Vec<u8>,
}

impl Palette {
    fn new() -> Self {
        let share = |n: usize, of: usize| n as f64 / (of - 1) as f64;
        let mut colours: Vec<Rgb> =
            (0..MAP_COLOURS).map(|n| colour::of_value(share(n, MAP_COLOURS))).collect();
        colours.extend((0..GREYS).map(|n| [(255.0 * share(n, GREYS)).round() as u8; 3]));
        colours.extend((0..LEVELS).map(|n| colour::of_level(share(n, LEVELS))));
        for series in 0..colour::SERIES_COUNT {
            let [r, g, b] = colour::of_series(series).map(f64::from);
            colours.extend((0..TINTS).map(|n| {
                let tint = 1.0 - n as f64 / TINTS as f64;
                [r, g, b].map(|c| (255.0 + (c - 255.0) * tint).round() as u8)
            }));
        }
        colours.extend([INK, FRAME, GRID]);
        debug_assert!(colours.len() <= 256);
        let side = 1_usize << BITS;
        let nearest = (0..side * side * side).map(|cell| {
            // From 0 to 255, so that black and white are themselves.
            let channel = |n: usize| ((cell >> (BITS as usize * n)) % side * 255 / (side - 1)) as i32;
            let at = [channel(2), channel(1), channel(0)];
            let distance = |colour: &Rgb| -> i32 {
                (0..3).map(|c| (i32::from(colour[c]) - at[c]).pow(2) * [2, 4, 1][c]).sum()
            };
            colours.iter().enumerate().min_by_key(|(_, c)| distance(c)).map_or(0, |(n, _)| n as u8)
        });
        let nearest = nearest.collect();
        Self { colours, nearest }
    }

    fn bytes(&self) -> Vec<u8> {
        self.colours.concat()
    }

    fn indices(&self, pixels: &[u8]) -> Vec<u8> {
        let cell = |p: &[u8]| {
            let channel = |n: usize| usize::from(p[n] >> (8 - BITS));
            channel(0) << (2 * BITS) | channel(1) << BITS | channel(2)
        };
        pixels.chunks_exact(3).map(|p| self.nearest[cell(p)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_pictures_are_near_to_those_of_films() {
        let palette = Palette::new();
        assert!(palette.colours.len() <= 256);
        let drawn = (0..=50).map(|n| colour::of_value(f64::from(n) / 50.0)).chain([[255; 3], INK, GRID]);
        assert_eq!(palette.colours[usize::from(palette.indices(&[255; 3])[0])], [255; 3]);
        for colour in drawn.chain((0..colour::SERIES_COUNT).map(colour::of_series)) {
            let shown = palette.colours[usize::from(palette.indices(&colour)[0])];
            let off = (0..3).map(|c| colour[c].abs_diff(shown[c])).max();
            assert!(off <= Some(14), "{colour:?} -> {shown:?}");
        }
    }

    #[test]
    fn only_what_changes_is_written() {
        let before = [0_u8; 12];
        let mut after = before;
        (after[5], after[10]) = (3, 4);
        let frame = changed(&before, &after, 4);
        assert_eq!((frame.left, frame.top, frame.width, frame.height), (1, 1, 2, 2));
        assert_eq!(*frame.buffer, [3, 0, 0, 4]);
        assert_eq!(changed(&before, &before, 4).buffer.len(), 1);
        assert_eq!(changed(&[], &after, 4).buffer.len(), 12);
    }
}
