//! Sequences of meshes, as public data sets of people and objects come: a folder of OBJ files, one a frame, and a table.
//!
//! `sequence.toml` beside the files says what they are; the files are taken in the order of their names.
//!
//! ```toml
//! frames_per_second = 30
//! action = "pick up"        # with `object`: the label; neither for no interaction
//! object = "cup"
//! up = "y"                  # y: people look along z, as in SMPL and BVH; z: along -y, as in Blender
//! metres = 1                # metres of a unit; 1 if left out
//! tag = { group = "cup" }   # the middle of an object or group; or { vertex = 1234 }, counted from 1 as in the file
//! hand = { vertex = 4321 }  # the hand that acts, if it is known
//! ```
//!
//! Triangles are those of the first file, and all files have the same. Positions between frames are interpolated by cubics.
//! The sequence is put at a place as it is, turned about the vertical, its first frame's middle there and its lowest point
//! on the floor.

mod obj;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::Deserialize;

use self::obj::Frame;
use super::perform::in_room;
use super::scene::Place;
use super::stage::catmull_rom;
use super::{Capsule, Performance, Surface};
use crate::hoi::{Action, Category, Object};

/// Name of the table.
pub const TABLE: &str = "sequence.toml";
/// Most positions, vertices times frames, that are held: a minute of SMPL-X at 30 frames per second.
pub const MAX_POSITIONS: usize = 1 << 25;
/// Radius of the upright rod that stands in the way of tags for a person whose limbs are not known, m.
const BLOCKER_RADIUS_M: f32 = 0.15;

/// Why a sequence cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// A file or folder cannot be read.
    #[error("cannot read {path}: {source}")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The table breaks its format.
    #[error("{path}: {reason}")]
    Table {
        /// The table.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// There are too few frames.
    #[error("{path} holds {found} OBJ files: a sequence needs two")]
    TooFew {
        /// The folder.
        path: PathBuf,
        /// How many there are.
        found: usize,
    },
    /// A mesh cannot be used.
    #[error("{path}: {reason}")]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Up {
    Y,
    Z,
}

/// A point of a mesh.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Point {
    Group(String),
    Vertex(usize),
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    frames_per_second: f64,
    action: Option<Action>,
    object: Option<Object>,
    up: Up,
    #[serde(default = "one")]
    metres: f32,
    tag: Point,
    hand: Option<Point>,
}

fn one() -> f32 {
    1.0
}

impl Table {
    fn read(path: &Path) -> Result<Self, MeshError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| MeshError::Open { path: path.to_path_buf(), source })?;
        let wrong = |reason: String| MeshError::Table { path: path.to_path_buf(), reason };
        let table: Self = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        if !(1.0..=1000.0).contains(&table.frames_per_second) {
            return Err(wrong(format!("{} frames per second: need 1 to 1000", table.frames_per_second)));
        }
        if !(1e-4..=1e3).contains(&table.metres) {
            return Err(wrong(format!("a unit of {} m: need 0.0001 to 1000", table.metres)));
        }
        if table.action.is_some() != table.object.is_some() {
            return Err(wrong("need both `action` and `object`, or neither".to_owned()));
        }
        Ok(table)
    }

    /// From the file's axes to a person's: to the right, forward and up, in metres.
    fn to_person(&self, v: Vec3) -> Vec3 {
        self.metres
            * match self.up {
                Up::Y => Vec3::new(-v.x, v.z, v.y),
                Up::Z => Vec3::new(-v.x, -v.y, v.z),
            }
    }
}

/// A simulated sample from meshes.
#[derive(Debug, Clone)]
pub struct MeshSequence {
    label: Option<Category>,
    frames_per_second: f64,
    surface: Surface,
    frames: Vec<Vec<Vec3>>,
    tag: Vec<Vec3>,
    hand: Option<Vec<Vec3>>,
}

impl MeshSequence {
    /// Reads the folder `path` and puts what is in it at `place`; the radar is at `radar`.
    ///
    /// # Errors
    /// Any [`MeshError`].
    pub fn open(path: &Path, place: &Place, radar: Vec3) -> Result<Self, MeshError> {
        let table = Table::read(&path.join(TABLE))?;
        let open = |source| MeshError::Open { path: path.to_path_buf(), source };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(path).map_err(open)? {
            let file = entry.map_err(open)?.path();
            if file.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
                files.push(file);
            }
        }
        files.sort();
        if files.len() < 2 {
            return Err(MeshError::TooFew { path: path.to_path_buf(), found: files.len() });
        }
        let mut sequence = Self {
            label: table.action.zip(table.object).map(|(action, object)| Category { action, object }),
            frames_per_second: table.frames_per_second,
            surface: Surface::default(),
            frames: Vec::with_capacity(files.len()),
            tag: Vec::with_capacity(files.len()),
            hand: table.hand.as_ref().map(|_| Vec::with_capacity(files.len())),
        };
        for file in &files {
            let wrong = |reason: String| MeshError::Mesh { path: file.clone(), reason };
            let bytes =
                std::fs::read(file).map_err(|source| MeshError::Open { path: file.clone(), source })?;
            let frame = Frame::parse(&bytes).map_err(wrong)?;
            sequence.push(&table, frame, files.len()).map_err(wrong)?;
        }
        sequence.put(place, radar);
        Ok(sequence)
    }

    fn push(&mut self, table: &Table, frame: Frame, files: usize) -> Result<(), String> {
        if self.frames.is_empty() {
            let positions = frame.vertices.len().saturating_mul(files);
            if positions > MAX_POSITIONS {
                return Err(format!("{positions} positions in all files: more than {MAX_POSITIONS}"));
            }
            self.surface = frame.surface();
        } else if self.surface.triangles != frame.triangles {
            let (first, found) = (self.surface.triangles.len(), frame.triangles.len());
            return Err(format!("its {found} triangles are not the {first} of the first file"));
        }
        self.tag.push(table.to_person(frame.point(&table.tag)?));
        if let (Some(point), Some(hand)) = (&table.hand, &mut self.hand) {
            hand.push(table.to_person(frame.point(point)?));
        }
        self.frames.push(frame.vertices.iter().map(|&v| table.to_person(v)).collect());
        Ok(())
    }

    /// Moves all from where the files have it to `place`.
    fn put(&mut self, place: &Place, radar: Vec3) {
        let first = &self.frames[0];
        let middle = first.iter().sum::<Vec3>() / first.len() as f32;
        let floor = self.frames.iter().flatten().map(|v| v.z).fold(f32::INFINITY, f32::min);
        let (to_room, origin) = (in_room(place, radar), middle.with_z(floor));
        let points =
            self.frames.iter_mut().flatten().chain(&mut self.tag).chain(self.hand.iter_mut().flatten());
        points.for_each(|v| *v = to_room.point(*v - origin));
    }

    /// What is done; `None` for no interaction.
    pub fn label(&self) -> Option<Category> {
        self.label
    }

    /// Where the hand that acts is at `time_s`, m; `None` if the table does not tell.
    pub fn hand(&self, time_s: f64) -> Option<Vec3> {
        let hand = self.hand.as_ref()?;
        Some(self.around(time_s).into_iter().map(|(frame, weight)| hand[frame] * weight).sum())
    }

    /// The four frames around `time_s` with their weights; the first and the last stand for what is beyond.
    fn around(&self, time_s: f64) -> [(usize, f32); 4] {
        let last = self.frames.len() - 1;
        let at = (time_s * self.frames_per_second).clamp(0.0, last as f64);
        let before = at.floor() as usize;
        let weights = catmull_rom((at - before as f64) as f32);
        std::array::from_fn(|i| ((before + i).saturating_sub(1).min(last), weights[i]))
    }
}

impl Performance for MeshSequence {
    fn proxy(&self, tag: usize, time_s: f64) -> Vec3 {
        self.hand(time_s).unwrap_or_else(|| self.tag(tag, time_s))
    }

    fn duration_s(&self) -> f64 {
        (self.frames.len() - 1) as f64 / self.frames_per_second
    }

    fn surface(&self) -> &Surface {
        &self.surface
    }

    fn vertices(&self, time_s: f64, vertices: &mut Vec<Vec3>) {
        vertices.clear();
        let around = self.around(time_s);
        vertices.extend(
            (0..self.frames[0].len())
                .map(|v| around.iter().map(|&(frame, weight)| self.frames[frame][v] * weight).sum::<Vec3>()),
        );
    }

    fn tags(&self) -> usize {
        1
    }

    fn tag(&self, _: usize, time_s: f64) -> Vec3 {
        self.around(time_s).into_iter().map(|(frame, weight)| self.tag[frame] * weight).sum()
    }

    fn blockers(&self, time_s: f64, blockers: &mut Vec<Capsule>) {
        blockers.clear();
        let [_, (frame, _), ..] = self.around(time_s);
        let vertices = &self.frames[frame];
        let middle = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
        let top = vertices.iter().map(|v| v.z).fold(0.0, f32::max) - BLOCKER_RADIUS_M;
        let ends = [middle.with_z(BLOCKER_RADIUS_M), middle.with_z(top.max(BLOCKER_RADIUS_M))];
        blockers.push(Capsule { ends, radius: BLOCKER_RADIUS_M });
    }
}
