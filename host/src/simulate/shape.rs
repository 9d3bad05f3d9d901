//! Triangle meshes of simple solids.

use glam::Vec3;

use super::Surface;

/// Longest edge of a facet of a box, m: two bins of the radar.
const FACET_M: f32 = 0.08;

/// Shares of power that materials scatter: the reflection at normal incidence, |(n - 1) / (n + 1)|^2, at 77 GHz.
pub(crate) mod material {
    /// Dry skin, permittivity 6.6 - 8.9j (C. Gabriel et al., "The dielectric properties of biological tissues", 1996).
    pub(crate) const SKIN: f32 = 0.34;
    /// Skin below a layer of cotton, which takes a little over 1 dB of the way in and out.
    pub(crate) const CLOTH: f32 = 0.25;
    /// Metal, less what paint takes.
    pub(crate) const METAL: f32 = 0.95;
    /// Water behind thin plastic, permittivity about 8 - 14j.
    pub(crate) const WATER: f32 = 0.45;
    /// Glass and glazed ware, permittivity 6.
    pub(crate) const GLASS: f32 = 0.18;
    /// Plastic, permittivity 2.8.
    pub(crate) const PLASTIC: f32 = 0.06;
    /// A stack of paper, permittivity 2.5.
    pub(crate) const PAPER: f32 = 0.05;
    /// Wood, permittivity 2.
    pub(crate) const WOOD: f32 = 0.03;
}

/// A mesh with the positions of its vertices.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Solid {
    /// Vertices, m.
    pub(crate) vertices: Vec<Vec3>,
    /// Triangles of them.
    pub(crate) surface: Surface,
}

impl Solid {
    /// A box from corner to corner.
    pub(crate) fn cuboid(min: Vec3, max: Vec3, reflectivity: f32) -> Self {
        let mut solid = Self::default();
        let size = max - min;
        for axis in 0..3 {
            let (u, v) = (Vec3::AXES[(axis + 1) % 3], Vec3::AXES[(axis + 2) % 3]);
            let (u, v) = (u * size, v * size);
            // On the far side u, v, outward are right-handed; on the near side v, u, outward.
            solid.grid(min + Vec3::AXES[axis] * size, u, v, reflectivity);
            solid.grid(min, v, u, reflectivity);
        }
        solid
    }

    /// A rectangle from `corner` along `u` and `v`, seen from where u turns to v counter-clockwise.
    fn grid(&mut self, corner: Vec3, u: Vec3, v: Vec3, reflectivity: f32) {
        let cells = |edge: Vec3| ((edge.length() / FACET_M).ceil() as u32).max(1);
        let (columns, rows) = (cells(u), cells(v));
        let first = self.vertices.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                let at = u * (column as f32 / columns as f32) + v * (row as f32 / rows as f32);
                self.vertices.push(corner + at);
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * (columns + 1) + column;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                self.surface.triangles.extend([[a, b, c], [a, c, d]]);
                self.surface.reflectivity.extend([reflectivity; 2]);
            }
        }
    }

    /// A closed tube about z: circles of (height, radius) from the lowest to the highest.
    pub(crate) fn lathe(circles: &[(f32, f32)], reflectivity: f32) -> Self {
        const SIDES: usize = 8;
        let mut vertices = vec![Vec3::Z * circles[0].0];
        for &(z, radius) in circles {
            vertices.extend(circle(SIDES).map(|(cos, sin)| Vec3::new(radius * cos, radius * sin, z)));
        }
        vertices.push(Vec3::Z * circles[circles.len() - 1].0);
        let triangles = tube(circles.len(), SIDES, 0);
        let reflectivity = vec![reflectivity; triangles.len()];
        Self { vertices, surface: Surface { triangles, reflectivity } }
    }

    /// Adds another mesh, each vertex moved by `place`.
    pub(crate) fn add(&mut self, other: &Self, place: impl Fn(Vec3) -> Vec3) {
        append(&mut self.surface, &other.surface, self.vertices.len());
        self.vertices.extend(other.vertices.iter().map(|&v| place(v)));
    }
}

/// Adds triangles to a surface, of vertices from number `first`.
pub(crate) fn append(surface: &mut Surface, other: &Surface, first: usize) {
    let first = first as u32;
    surface.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    surface.reflectivity.extend_from_slice(&other.reflectivity);
}

/// Cosine and sine of `sides` even steps of a turn.
pub(crate) fn circle(sides: usize) -> impl Iterator<Item = (f32, f32)> {
    (0..sides).map(move |side| {
        let angle = std::f32::consts::TAU * side as f32 / sides as f32;
        (libm::cosf(angle), libm::sinf(angle))
    })
}

/// Triangles of a closed tube whose vertices are, from number `first`: its lower pole; `rings` rings of `sides` vertices
/// from the lowest to the highest, each counter-clockwise as seen from above; its upper pole.
pub(crate) fn tube(rings: usize, sides: usize, first: u32) -> Vec<[u32; 3]> {
    let at = |ring: usize, side: usize| first + 1 + (ring * sides + side % sides) as u32;
    let top = first + 1 + (rings * sides) as u32;
    let mut triangles = Vec::with_capacity(2 * rings * sides);
    for side in 0..sides {
        triangles.push([first, at(0, side + 1), at(0, side)]);
        for ring in 0..rings - 1 {
            let (a, b) = (at(ring, side), at(ring, side + 1));
            let (c, d) = (at(ring + 1, side + 1), at(ring + 1, side));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        triangles.push([top, at(rings - 1, side), at(rings - 1, side + 1)]);
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(solid: &Solid) -> f32 {
        let corner = |t: &[u32; 3]| t.map(|v| solid.vertices[v as usize]);
        solid.surface.triangles.iter().map(corner).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn solids_are_closed_and_face_outward() {
        let cuboid = Solid::cuboid(Vec3::splat(-0.1), Vec3::new(0.2, 0.3, 0.4), material::WOOD);
        assert!((volume(&cuboid) - 0.3 * 0.4 * 0.5).abs() < 1e-5, "{}", volume(&cuboid));
        let cylinder = Solid::lathe(&[(0.0, 0.1), (0.1, 0.1), (0.2, 0.1)], material::GLASS);
        let octagon = 4.0 * 0.01 * libm::sinf(std::f32::consts::FRAC_PI_4);
        assert!((volume(&cylinder) - octagon * 0.2).abs() < 1e-6);
        assert_eq!(cylinder.surface.triangles.len(), cylinder.surface.reflectivity.len());
    }
}
