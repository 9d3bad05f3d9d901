//! One mesh of a sequence.

use std::io::Cursor;

use glam::Vec3;
use tobj::{LoadError, LoadOptions};

use super::Point;
use crate::simulate::Surface;
use crate::simulate::shape::material;

/// What an OBJ file holds, in its own axes.
pub(super) struct Frame {
    pub(super) vertices: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Objects and groups with the vertices of their faces, as a range of `vertices`.
    groups: Vec<(String, std::ops::Range<usize>)>,
    /// All vertices of the file in their order, used by a face or not.
    listed: Vec<Vec3>,
}

impl Frame {
    /// Reads the text of a file; says what is wrong with it.
    pub(super) fn parse(text: &[u8]) -> Result<Self, String> {
        let options =
            LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
        // Materials are not read: what they reflect at 77 GHz is not in them.
        let loaded = tobj::load_obj_buf(&mut Cursor::new(text), &options, |_| Err(LoadError::GenericFailure));
        let (models, _) = loaded.map_err(|error| format!("no OBJ mesh: {error}"))?;
        let mut frame =
            Self { vertices: Vec::new(), triangles: Vec::new(), groups: Vec::new(), listed: listed(text)? };
        for model in models {
            let first = frame.vertices.len();
            let (points, rest) = model.mesh.positions.as_chunks::<3>();
            let (corners, odd) = model.mesh.indices.as_chunks::<3>();
            if !rest.is_empty() || !odd.is_empty() {
                return Err(format!("`{}` is not made of triangles", model.name));
            }
            frame.vertices.extend(points.iter().map(|&p| Vec3::from(p)));
            frame.triangles.extend(corners.iter().map(|corner| corner.map(|v| v + first as u32)));
            frame.groups.push((model.name, first..frame.vertices.len()));
        }
        if frame.triangles.is_empty() {
            return Err("it has no faces".to_owned());
        }
        let count = frame.vertices.len();
        if frame.triangles.iter().flatten().any(|&v| v as usize >= count) {
            return Err("a face has a vertex that is not there".to_owned());
        }
        match frame.vertices.iter().all(|v| v.is_finite()) {
            true => Ok(frame),
            false => Err("a vertex has a coordinate that is no number".to_owned()),
        }
    }

    /// Its triangles, as clothed people scatter.
    pub(super) fn surface(&self) -> Surface {
        Surface {
            triangles: self.triangles.clone(),
            reflectivity: vec![material::CLOTH; self.triangles.len()],
        }
    }

    /// Where a point is.
    pub(super) fn point(&self, point: &Point) -> Result<Vec3, String> {
        match point {
            Point::Vertex(number) => {
                let vertex = number.checked_sub(1).and_then(|i| self.listed.get(i));
                vertex
                    .copied()
                    .ok_or_else(|| format!("there is no vertex {number}: it has {}", self.listed.len()))
            }
            Point::Group(name) => {
                let ranges =
                    self.groups.iter().filter(|(group, _)| group == name).map(|(_, range)| range.clone());
                let all: Vec<Vec3> = ranges.flat_map(|range| &self.vertices[range]).copied().collect();
                if all.is_empty() {
                    let names: Vec<&str> = self.groups.iter().map(|(group, _)| group.as_str()).collect();
                    return Err(format!("there is no object or group `{name}`: it has {}", names.join(", ")));
                }
                Ok(all.iter().sum::<Vec3>() / all.len() as f32)
            }
        }
    }
}

/// The vertices of a file as it numbers them; the parser of faces numbers them anew.
fn listed(text: &[u8]) -> Result<Vec<Vec3>, String> {
    let text = std::str::from_utf8(text).map_err(|_| "it is no text".to_owned())?;
    let lines =
        text.lines().enumerate().filter_map(|(i, line)| Some((i + 1, line.trim_start().strip_prefix("v ")?)));
    let vertex = |(line, rest): (usize, &str)| {
        let mut numbers = rest.split_whitespace().map(|word| word.parse::<f32>().ok());
        match [numbers.next(), numbers.next(), numbers.next()].map(Option::flatten) {
            [Some(x), Some(y), Some(z)] => Ok(Vec3::new(x, y, z)),
            _ => Err(format!("line {line}: a vertex needs three numbers")),
        }
    };
    lines.map(vertex).collect()
}
