//! Labelled recordings of other radars: what their makers' devices give, brought into the maps that the radar's branch takes.
//!
//! | data set | device | what a frame is |
//! |---|---|---|
//! | RadarHAR (`index.csv` with `person`, `doppler_u8_128x156.npy`) | BGT60LTR11AIP, 61 GHz, CW | a window of the spectrogram: how strong each speed is for how long, and at which cadences |
//! | KKT60 (`index.csv` with `label_first`, `.h5` files) | K60168A, 60 GHz FMCW, 2 receivers | range-Doppler and angle-Doppler |
//!
//! None has tags; each sample has one that was never read.

use std::io::Cursor;
use std::path::Path;

use ndarray::{Array3, ArrayView2, Axis, ShapeError};
use ndarray_npy::ReadNpyExt;
use rfhoi_network::sample::{Frame, Frames, MAPS, READ_CHANNELS, SCALARS, Sample, scalar};
use serde::Deserialize;

use super::{Real, RealError, files, micro_doppler};

/// Points of all maps each way.
pub const POINTS: usize = 32;
const SIZE: usize = POINTS * POINTS;

/// Name of the list of recordings.
const INDEX: &str = "index.csv";
/// Codes of an octave of amplitude, and the amplitude that is one unit.
const CODES_OF_OCTAVE: f32 = 28.0;
/// Frames before one, and after it, from which its own label is told: 0.28 and 0.14 s.
const BEFORE: usize = 8;
const AFTER: usize = 4;
/// Frames before a gesture that its clip must have, so that what rests can be taken out.
const FEWEST_BEFORE: usize = 3;

/// What is in a folder or an archive.
#[derive(Debug)]
pub enum Recordings {
    /// Whole recordings with a class each.
    Spectrograms(Real),
    /// Clips in which a gesture begins and ends.
    Heatmaps(Vec<Clip>),
}

/// A clip of two heatmaps a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// What is done in it.
    pub class: String,
    /// When it was recorded.
    pub recorded: String,
    /// `[2][Doppler][range or angle][frames]`, amplitudes.
    values: Vec<f32>,
    /// Whether somebody said that the gesture was going on, frame by frame.
    pub label: Vec<bool>,
}

/// A line of the list; which fields there are depends on the data set.
#[derive(Debug, Clone, Deserialize)]
struct Row {
    class: String,
    #[serde(default)]
    person: String,
    #[serde(default)]
    row: usize,
    #[serde(default)]
    file: String,
    #[serde(default)]
    recorded: String,
}

/// Reads the recordings of a folder or an archive. `progress` is told the share that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If files cannot be read, or are of none of the data sets.
pub fn load(path: &Path, progress: &mut dyn FnMut(f64) -> bool) -> Result<Recordings, RealError> {
    let mut rows: Vec<Row> = Vec::new();
    files::each(path, INDEX, |name, bytes| {
        for row in csv::Reader::from_reader(&bytes[..]).deserialize() {
            rows.push(row.map_err(|error| wrong(name, error))?);
        }
        Ok::<(), RealError>(())
    })?;
    if rows.iter().all(|row| row.file.is_empty()) {
        return spectrograms(path, &rows).map(Recordings::Spectrograms);
    }
    let mut clips = Vec::new();
    files::each(path, ".h5", |name, bytes| {
        if !progress(clips.len() as f64 / rows.len() as f64) {
            return Err(RealError::Interrupted);
        }
        let row = rows.iter().find(|row| name.ends_with(&row.file));
        let row = row.ok_or_else(|| wrong(name, "it is not in the list"))?;
        clips.push(clip(name, &bytes, row)?);
        Ok(())
    })?;
    clips.sort_by(|a: &Clip, b| a.recorded.cmp(&b.recorded));
    Ok(Recordings::Heatmaps(clips))
}

fn wrong(name: &Path, what: impl ToString) -> RealError {
    RealError::Recording { name: name.display().to_string(), what: what.to_string() }
}

fn spectrograms(path: &Path, rows: &[Row]) -> Result<Real, RealError> {
    const DOPPLER: &str = "doppler_u8_128x156.npy";
    let mut found = None;
    files::each(path, DOPPLER, |name, bytes| {
        let values = Array3::<u8>::read_npy(Cursor::new(bytes)).map_err(|error| wrong(name, error))?;
        let good =
            values.dim().1 == 128 && values.dim().2 == 156 && rows.iter().all(|row| row.row < values.dim().0);
        found = Some(values);
        if good { Ok(()) } else { Err(wrong(name, "its shape is not that of the list")) }
    })?;
    let values = found.ok_or_else(|| wrong(path, "no recordings"))?;
    let of = |each: fn(&Row) -> &String| {
        let mut all: Vec<String> = rows.iter().map(|row| each(row).clone()).collect();
        all.sort();
        all.dedup();
        all
    };
    let (classes, people) = (of(|row| &row.class), of(|row| &row.person));
    let mut real = Real { names: vec![vec![1.0]], ..Real::default() };
    for row in rows {
        real.samples.push(Sample {
            frames: spectrogram(values.index_axis(Axis(0), row.row)).map_err(|error| wrong(path, error))?,
            objects: vec![0],
            action: classes.iter().position(|class| *class == row.class),
            ..Sample::default()
        });
        real.people.push(people.iter().position(|person| *person == row.person).unwrap_or(0) as u32);
    }
    real.classes = classes;
    real.who = people;
    Ok(real)
}

/// Frames of a spectrogram, `[Doppler][frames][high band, low band]`, of which the last two are one axis.
fn spectrogram(both: ArrayView2<'_, u8>) -> Result<Frames, ShapeError> {
    let (rows, columns) = both.dim();
    let both = both.into_shape_with_order((rows, columns / 2, 2))?;
    let mut frames = Frames::new(POINTS, 1, 1);
    micro_doppler::frames(both).iter().for_each(|maps| push(&mut frames, maps));
    Ok(frames)
}

/// The code of an amplitude, 0 to 255.
fn octaves(value: f32) -> u8 {
    ((1.0 + value).log2() * CODES_OF_OCTAVE).min(255.0) as u8
}

/// The code of a difference of amplitudes; 128 is none.
fn signed(value: f32) -> u8 {
    let octaves = (1.0 + value.abs()).log2().copysign(value);
    (128.0 + octaves * CODES_OF_OCTAVE / 2.0).clamp(0.0, 255.0) as u8
}

fn push(frames: &mut Frames, maps: &[u8]) {
    let mut scalars = [0.0; SCALARS];
    scalars[scalar::VALID..scalar::VALID + MAPS].fill(1.0);
    scalars[scalar::PRESENT] = 1.0;
    frames.push(Frame { maps, scalars: &scalars, reads: &[0.0; READ_CHANNELS], covariance: &[] });
}

fn clip(name: &Path, bytes: &[u8], row: &Row) -> Result<Clip, RealError> {
    let file = hdf5_reader::Hdf5File::from_bytes(bytes).map_err(|error| wrong(name, error))?;
    let words = |path: &str, shape: &[u64]| -> Result<Vec<u16>, RealError> {
        let data = file.dataset(path).map_err(|error| wrong(name, error))?;
        if data.shape().len() != shape.len() || data.shape().iter().zip(shape).any(|(a, b)| *b > 0 && a != b)
        {
            return Err(wrong(name, format!("{path} has the shape {:?}", data.shape())));
        }
        let bytes = data.read_native_bytes().map_err(|error| wrong(name, error))?;
        let (words, rest) = bytes.as_chunks::<2>();
        if words.len() as u64 != data.shape().iter().product::<u64>() || !rest.is_empty() {
            return Err(wrong(name, format!("{path} has no numbers of two bytes")));
        }
        Ok(words.iter().map(|word| u16::from_ne_bytes(*word)).collect())
    };
    let side = POINTS as u64;
    let values = words("DS1", &[2, side, side, 0])?;
    let label = words("LABEL", &[0, 1])?;
    if values.len() != 2 * SIZE * label.len() {
        return Err(wrong(name, "frames and labels differ in number"));
    }
    Ok(Clip {
        class: row.class.clone(),
        recorded: row.recorded.clone(),
        values: values.into_iter().map(|bits| half::f16::from_bits(bits).to_f32()).collect(),
        label: label.into_iter().map(|label| label > 0).collect(),
    })
}

impl Clip {
    /// Frames.
    pub fn len(&self) -> usize {
        self.label.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.label.is_empty()
    }

    /// Its first frame that is labelled, and past the last; `None` without one, or with too few frames before it.
    pub fn gesture(&self) -> Option<std::ops::Range<usize>> {
        let first = self.label.iter().position(|label| *label).filter(|first| *first >= FEWEST_BEFORE)?;
        let last = self.label.iter().rposition(|label| *label)?;
        Some(first..last + 1)
    }

    /// Cell of a map at a time.
    fn value(&self, map: usize, cell: usize, time: usize) -> f32 {
        self.values[(map * SIZE + cell) * self.len() + time]
    }

    /// Mean of a cell over some frames.
    fn mean(&self, map: usize, cell: usize, times: std::ops::Range<usize>) -> f32 {
        let count = times.len().max(1) as f32;
        times.map(|time| self.value(map, cell, time)).sum::<f32>() / count
    }

    /// Some of its frames, without what rested in `rest`: range-Doppler and angle-Doppler are the second and third map.
    pub fn without_rest(&self, times: std::ops::Range<usize>, rest: std::ops::Range<usize>) -> Frames {
        let mut frames = Frames::new(POINTS, 1, 1);
        let means: Vec<f32> =
            (0..2 * SIZE).map(|place| self.mean(place / SIZE, place % SIZE, rest.clone())).collect();
        let mut maps = vec![0; MAPS * SIZE];
        for time in times {
            for (place, mean) in means.iter().enumerate() {
                maps[SIZE + place] = signed(self.value(place / SIZE, place % SIZE, time) - mean);
            }
            push(&mut frames, &maps);
        }
        frames
    }

    /// The frames around each of its frames, from which its own label is told: amplitudes, and as the first map what has changed in
    /// range and Doppler since the frames before.
    pub fn around(&self) -> Vec<Frames> {
        let mut all = Frames::new(POINTS, 1, 1);
        let mut maps = vec![0; MAPS * SIZE];
        let mut sums = vec![0.0; SIZE];
        for time in 0..self.len() {
            for (cell, sum) in sums.iter_mut().enumerate() {
                let value = self.value(0, cell, time);
                maps[cell] = if time == 0 { 128 } else { signed(value - *sum / time as f32) };
                maps[SIZE + cell] = octaves(value);
                maps[2 * SIZE + cell] = octaves(self.value(1, cell, time));
                *sum += value;
            }
            push(&mut all, &maps);
        }
        let around = |time: usize| time.saturating_sub(BEFORE)..(time + AFTER + 1).min(self.len());
        (0..self.len()).map(|time| all.part(around(time))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(label: &[bool]) -> Clip {
        let count = label.len();
        let values = (0..2 * SIZE * count).map(|place| if place % count >= 4 { 9.0 } else { 2.0 }).collect();
        Clip { class: "fist".into(), recorded: String::new(), values, label: label.to_vec() }
    }

    #[test]
    fn what_rests_is_taken_out() {
        let moves = [false, false, false, false, true, true, false];
        let clip = clip(&moves);
        assert_eq!(clip.gesture(), Some(4..6));
        let frames = clip.without_rest(4..6, 0..4);
        // 7 over the rest are three octaves of 1 + 7.
        assert!(frames.frame(0).maps[SIZE..].iter().all(|code| *code == 128 + 42));
        assert!(clip.without_rest(0..4, 0..4).frame(1).maps[SIZE..].iter().all(|code| *code == 128));
        let around = clip.around();
        assert_eq!((around.len(), around[0].len(), around[6].len()), (7, 5, 7));
        assert_eq!(around[4].frame(4).maps[0], 128 + 42);
        assert_eq!(self::clip(&moves[2..]).gesture(), None, "too few frames before it");
        assert_eq!(self::clip(&[false; 5]).gesture(), None);
    }
}
