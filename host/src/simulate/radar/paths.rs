//! Facets to paths.

use glam::Vec3;

use super::super::Surface;
use super::front_end::{FrontEnd, lambert};
use super::view::View;

/// Of so many facets one stands for all in paths by way of walls: they are weak, and the sum of their powers counts.
const IMAGE_STRIDE: usize = 4;

/// A way from the radar to something and back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    /// Half its length at the beginning, in the middle and at the end of a frame's chirps, m.
    pub half_m: [f32; 3],
    /// Direction cosines to the right and upwards, in which the wave leaves.
    pub departure: [f32; 2],
    /// The same of where it comes from.
    pub arrival: [f32; 2],
    /// Amplitude relative to full scale.
    pub amplitude: f32,
}

/// A surface at the beginning, in the middle and at the end of a frame's chirps, in the radar's axes.
#[derive(Clone, Copy)]
pub(super) struct Moving<'a> {
    pub(super) surface: &'a Surface,
    pub(super) vertices: [&'a [Vec3]; 3],
}

/// A facet in the middle of the frame.
struct Facet {
    centres: [Vec3; 3],
    /// As long as the area.
    normal: Vec3,
    reflectivity: f32,
}

impl Facet {
    fn cos_to(&self, from: Vec3) -> f32 {
        let way = from - self.centres[1];
        self.normal.dot(way) / (self.normal.length() * way.length())
    }
}

impl<'a> Moving<'a> {
    /// Something that does not move.
    pub(super) fn still(surface: &'a Surface, vertices: &'a [Vec3]) -> Self {
        Self { surface, vertices: [vertices; 3] }
    }

    fn facets(self) -> impl Iterator<Item = Facet> + 'a {
        let triangles = self.surface.triangles.iter().zip(&self.surface.reflectivity);
        triangles.map(move |(corners, &reflectivity)| {
            let centres = self.vertices.map(|v| corners.iter().map(|&i| v[i as usize]).sum::<Vec3>() / 3.0);
            let [a, b, c] = corners.map(|i| self.vertices[1][i as usize]);
            Facet { centres, normal: (b - a).cross(c - a) / 2.0, reflectivity }
        })
    }

    /// Adds the direct paths of what `view` sees to `paths`; without one of all that is turned to the radar.
    pub(super) fn direct(self, front_end: &FrontEnd, view: Option<&View>, paths: &mut Vec<Path>) {
        for facet in self.facets() {
            let centre = facet.centres[1];
            let cos = facet.cos_to(Vec3::ZERO);
            if cos <= 0.0 || !view.is_none_or(|v| v.sees(centre)) {
                continue;
            }
            let sigma = lambert(facet.reflectivity, facet.normal.length(), cos, cos);
            let direction = cosines(centre);
            push(
                paths,
                Path {
                    half_m: facet.centres.map(Vec3::length),
                    departure: direction,
                    arrival: direction,
                    amplitude: front_end.echo(sigma, centre, centre),
                },
            );
        }
    }

    /// Adds the paths that go one way directly and the other by way of a wall: `image` is the radar's mirror image in it.
    /// Whether something stands in the way of the wall's leg is not looked at.
    pub(super) fn by_wall(
        self,
        front_end: &FrontEnd,
        view: Option<&View>,
        (image, reflectivity): (Vec3, f32),
        paths: &mut Vec<Path>,
    ) {
        let normal = image.normalize();
        let mirrored = |p: Vec3| p - 2.0 * p.dot(normal) * normal + image;
        for facet in self.facets().step_by(IMAGE_STRIDE) {
            let centre = facet.centres[1];
            let (cos_in, cos_out) = (facet.cos_to(Vec3::ZERO), facet.cos_to(image));
            if cos_in <= 0.0 || cos_out <= 0.0 || !view.is_none_or(|v| v.sees(centre)) {
                continue;
            }
            let area_m2 = facet.normal.length() * IMAGE_STRIDE as f32;
            let sigma = reflectivity * lambert(facet.reflectivity, area_m2, cos_in, cos_out);
            let there = Path {
                half_m: facet.centres.map(|c| (c.length() + mirrored(c).length()) / 2.0),
                departure: cosines(centre),
                arrival: cosines(mirrored(centre)),
                amplitude: front_end.echo(sigma, centre, mirrored(centre)),
            };
            push(paths, there);
            push(paths, Path { departure: there.arrival, arrival: there.departure, ..there });
        }
    }
}

/// The radar's own reflection in a wall.
pub(super) fn wall(front_end: &FrontEnd, (image, reflectivity): (Vec3, f32), paths: &mut Vec<Path>) {
    let direction = cosines(image);
    push(
        paths,
        Path {
            half_m: [image.length() / 2.0; 3],
            departure: direction,
            arrival: direction,
            amplitude: front_end.reflection(reflectivity, image),
        },
    );
}

fn push(paths: &mut Vec<Path>, path: Path) {
    if path.amplitude > 0.0 {
        paths.push(path);
    }
}

fn cosines(point: Vec3) -> [f32; 2] {
    let unit = point.normalize();
    [unit.x, unit.z]
}
