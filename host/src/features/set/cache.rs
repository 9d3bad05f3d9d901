//! Features of a shard in a file, to be read many times.

use std::io::Cursor;
use std::path::Path;

use ndarray::{Array1, Array2, Array4, ArrayBase, Dimension, Ix1, Ix2, Ix4, OwnedRepr, array};
use ndarray_npy::{NpzReader, ReadableElement};
use rfhoi_network::sample::{Frames, MAPS, READ_CHANNELS, SCALARS};
use rfhoi_shared::config::RadarConfig;

use super::{Measured, SetError};
use crate::features::Settings;
use crate::npz::Npz;

/// What a file should hold.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape<'a> {
    pub(super) samples: usize,
    pub(super) tags: usize,
    pub(super) settings: &'a Settings,
    pub(super) radar: &'a RadarConfig,
}

impl Shape<'_> {
    /// Values of a frame's covariance.
    fn covariance(&self) -> usize {
        if self.settings.covariance { self.radar.profile.virtual_count().pow(2) } else { 0 }
    }
}

/// Reads the features of `fingerprint`; `None` where there is no such file, or one of another shape or fingerprint, or one that
/// is damaged: then they are made anew.
pub(super) fn read(path: &Path, fingerprint: u32, shape: Shape<'_>) -> Option<Measured> {
    let bytes = std::fs::read(path).ok()?;
    let measured = NpzReader::new(Cursor::new(&bytes)).ok().and_then(|npz| unpack(npz, fingerprint, shape));
    if measured.is_none() {
        tracing::warn!("{} is damaged or of another set or program; it is made again", path.display());
    }
    measured
}

type Archive<'a> = NpzReader<Cursor<&'a Vec<u8>>>;

/// An array of exactly this shape; the archive's check sums tell damage.
fn take<A: ReadableElement + Clone, D: Dimension>(
    npz: &mut Archive<'_>,
    name: &str,
    shape: D,
) -> Option<Vec<A>> {
    let array: ArrayBase<OwnedRepr<A>, D> = npz.by_name(name).ok()?;
    (array.raw_dim() == shape && array.is_standard_layout()).then(|| array.into_raw_vec_and_offset().0)
}

fn unpack(mut npz: Archive<'_>, fingerprint: u32, shape: Shape<'_>) -> Option<Measured> {
    let Shape { samples, tags, settings: &Settings { points, antennas, .. }, .. } = shape;
    let [there] = take::<u32, _>(&mut npz, "fingerprint", Ix1(1))?[..] else { return None };
    if there != fingerprint {
        return None;
    }
    let firsts: Vec<u32> = take(&mut npz, "frame_first", Ix1(samples + 1))?;
    let count = *firsts.last().filter(|_| firsts.is_sorted())? as usize;
    let interactions: Vec<f32> = take(&mut npz, "interaction_s", Ix2(samples, 2))?;
    let maps: Vec<u8> = take(&mut npz, "maps", Ix4(count, MAPS, points, points))?;
    let scalars: Vec<f32> = take(&mut npz, "scalars", Ix2(count, SCALARS))?;
    let reads: Vec<f32> = take(&mut npz, "reads", Ix4(count, tags, antennas, READ_CHANNELS))?;
    let covariance: Vec<f32> = take(&mut npz, "covariance", Ix2(count, shape.covariance()))?;
    let frames = firsts.windows(2).map(|ends| {
        fn part<A: Clone>(values: &[A], ends: &[u32], size: usize) -> Vec<A> {
            values[ends[0] as usize * size..ends[1] as usize * size].to_vec()
        }
        Frames {
            points,
            tags,
            antennas,
            maps: part(&maps, ends, MAPS * points * points),
            scalars: part(&scalars, ends, SCALARS),
            reads: part(&reads, ends, tags * antennas * READ_CHANNELS),
            covariance: part(&covariance, ends, shape.covariance()),
        }
    });
    let interactions_s = interactions.as_chunks::<2>().0.to_vec();
    Some(Measured { frames: frames.collect(), interactions_s })
}

/// Writes features.
pub(super) fn write(
    path: &Path,
    fingerprint: u32,
    measured: &Measured,
    shape: Shape<'_>,
) -> Result<(), SetError> {
    let Shape { samples, tags, settings: &Settings { points, antennas, .. }, .. } = shape;
    let Measured { frames, interactions_s } = measured;
    let mut count = 0;
    let mut firsts = vec![0];
    for sample in frames {
        count += sample.len();
        firsts.push(count as u32);
    }
    fn all<A: Copy>(frames: &[Frames], part: impl Fn(&Frames) -> &[A]) -> Vec<A> {
        frames.iter().flat_map(|frames| part(frames).iter().copied()).collect()
    }
    let misfit = |e: ndarray::ShapeError| SetError::Shard { path: path.to_path_buf(), what: e.to_string() };
    let maps =
        Array4::from_shape_vec((count, MAPS, points, points), all(frames, |f| &f.maps)).map_err(misfit)?;
    let scalars = Array2::from_shape_vec((count, SCALARS), all(frames, |f| &f.scalars)).map_err(misfit)?;
    let reads = Array4::from_shape_vec((count, tags, antennas, READ_CHANNELS), all(frames, |f| &f.reads));
    let covariance = Array2::from_shape_vec((count, shape.covariance()), all(frames, |f| &f.covariance));
    let interactions = Array2::from_shape_vec((samples, 2), interactions_s.as_flattened().to_vec());
    Npz::create_stored(path)?
        .array("fingerprint", &array![fingerprint])?
        .array("frame_first", &Array1::from_vec(firsts))?
        .array("interaction_s", &interactions.map_err(misfit)?)?
        .array("maps", &maps)?
        .array("scalars", &scalars)?
        .array("reads", &reads.map_err(misfit)?)?
        .array("covariance", &covariance.map_err(misfit)?)?
        .finish()?;
    Ok(())
}
