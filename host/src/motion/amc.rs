//! Acclaim motions (`.amc`): frame by frame the degrees of freedom of an ASF skeleton.
//!
//! Format: as named in [`asf`]. Comments (`#`), keywords (`:FULLY-SPECIFIED`, `:DEGREES` or `:RADIANS`), then for each
//! frame a line with its number and a line for each bone that has degrees of freedom: its name and their values in the
//! order of the skeleton's `dof`. The rate of frames is not in the file: see [`FRAMES_PER_SECOND`].

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::asf::Skeleton;
use super::lines::{Fault, lines, number, short};
use super::rotation::Freedom;
use super::{Motion, MotionError};

#[cfg(doc)]
use super::asf;

/// Rate of HDM05 (its file names end in it) and of nearly all of CMU's recordings.
pub const FRAMES_PER_SECOND: f64 = 120.0;
const RADIANS: &str = ":RADIANS";
/// Keywords one of which begins the file.
pub(super) const KEYWORDS: [&str; 3] = [":FULLY-SPECIFIED", ":DEGREES", RADIANS];

/// The skeleton of the motion at `path`: the file beside it of the same name or of a part of it that ends before a `_`,
/// the longest first (`HDM_bd_cut_001_120.amc`: `HDM_bd.asf`; `01_02.amc`: `01.asf`).
///
/// # Errors
/// [`MotionError::NoSkeleton`].
pub fn skeleton_beside(path: &Path) -> Result<PathBuf, MotionError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let ends = stem.rmatch_indices('_').map(|(at, _)| at);
    let mut tried = Vec::new();
    for end in std::iter::once(stem.len()).chain(ends) {
        for extension in ["asf", "ASF"] {
            let beside = path.with_file_name(format!("{}.{extension}", &stem[..end]));
            if beside.is_file() {
                return Ok(beside);
            }
        }
        tried.push(format!("{}.asf", &stem[..end]));
    }
    Err(MotionError::NoSkeleton { path: path.to_path_buf(), tried })
}

/// Reads the motion of `skeleton`.
///
/// # Errors
/// The first line that breaks the format, or at which a frame ends that lacks a bone.
pub fn parse(text: &str, skeleton: &Skeleton) -> Result<Motion, Fault> {
    let bones = &skeleton.bones;
    let by_name: HashMap<&str, usize> = bones.iter().enumerate().map(|(i, b)| (b.name.as_str(), i)).collect();
    let mut motion = Motion::new(skeleton.joints());
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); bones.len()];
    let mut frame: Option<u32> = None;
    let mut first = 0;
    let mut in_radians = false;
    let mut last_line = 1;

    let mut finish = |line: usize, number: u32, values: &mut [Vec<f64>]| -> Result<(), Fault> {
        if let Some((bone, _)) = bones.iter().zip(values.iter()).find(|(b, v)| v.len() < b.freedoms.len()) {
            return Err(Fault::new(
                line,
                format!("frame {number} ends without bone `{}`", short(&bone.name)),
            ));
        }
        if motion.numbers().is_empty() {
            first = number;
        }
        let time_s = (f64::from(number) - f64::from(first)) / FRAMES_PER_SECOND;
        let pose = skeleton.pose(values);
        values.iter_mut().for_each(Vec::clear);
        motion.push(number, time_s, &pose).map_err(|reason| Fault::new(line, reason))
    };

    for (line, words) in lines(text) {
        last_line = line;
        let (key, rest) = (words[0], &words[1..]);
        if key.starts_with(':') {
            in_radians |= key.eq_ignore_ascii_case(RADIANS);
        } else if let (Ok(number), []) = (key.parse::<u32>(), rest) {
            if let Some(before) = frame.replace(number) {
                finish(line, before, &mut values)?;
            }
        } else {
            let unknown = || Fault::new(line, format!("there is no bone `{}` in the skeleton", short(key)));
            let bone = *by_name.get(key).ok_or_else(unknown)?;
            let freedoms = &bones[bone].freedoms;
            if frame.is_none() {
                return Err(Fault::new(line, "a bone before the number of the first frame"));
            }
            if !values[bone].is_empty() {
                return Err(Fault::new(line, format!("bone `{}` is there twice in the frame", short(key))));
            }
            if rest.len() != freedoms.len() {
                return Err(Fault::new(
                    line,
                    format!("bone `{}` needs {} values, found {}", short(key), freedoms.len(), rest.len()),
                ));
            }
            for (freedom, word) in freedoms.iter().zip(rest) {
                let value = number(line, word)?;
                let degrees = matches!(freedom, Freedom::Rotation(_)) && !in_radians;
                values[bone].push(if degrees { value.to_radians() } else { value });
            }
        }
    }
    match frame {
        Some(number) => finish(last_line, number, &mut values)?,
        None => return Err(Fault::new(last_line, "the motion has no frames")),
    }
    motion
        .notes
        .push(format!("AMC files do not tell their rate: {FRAMES_PER_SECOND} frames per second assumed"));
    Ok(motion)
}
