//! What the radar can see: a depth buffer over the field of view.
//!
//! Directions in front of the radar are points `(x / y, z / y)` of a plane one metre ahead, cut into square cells. Triangles are
//! drawn into them with their depth y; a point is visible if nothing lies clearly before it.

use glam::{Vec2, Vec3};

/// The plane reaches this far to either side: 60 degrees.
const EXTENT: f32 = 1.732;
/// Cells to a side; one is 2.7 cm at 2 m, less than a facet.
const CELLS: usize = 256;
/// A surface does not hide itself: depths may differ by this, m.
const TOLERANCE_M: f32 = 0.04;
/// Nearer than this nothing is seen, m.
const NEAREST_M: f32 = 0.05;

/// Depth by cell.
#[derive(Debug, Clone)]
pub(super) struct View {
    depth: Vec<f32>,
}

impl View {
    /// Nothing in sight.
    pub(super) fn empty() -> Self {
        Self { depth: vec![f32::INFINITY; CELLS * CELLS] }
    }

    /// Takes over what `other` sees.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.depth.copy_from_slice(&other.depth);
    }

    /// Draws triangles; `vertices` are in the radar's axes.
    pub(super) fn draw(&mut self, vertices: &[Vec3], triangles: &[[u32; 3]]) {
        for triangle in triangles {
            let corners = triangle.map(|i| vertices[i as usize]);
            if corners.iter().all(|c| c.y > NEAREST_M) {
                self.triangle(corners);
            }
        }
    }

    fn triangle(&mut self, corners: [Vec3; 3]) {
        let [a, b, c] = corners.map(cell);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let clamp = |x: f32| x.clamp(0.0, CELLS as f32 - 1.0) as usize;
        if high.x < 0.0 || high.y < 0.0 || low.x >= CELLS as f32 || low.y >= CELLS as f32 {
            return;
        }
        let area = (b - a).perp_dot(c - a);
        if area.abs() < 1e-6 {
            return;
        }
        // One over the depth is linear over the plane.
        let near = corners.map(|p| 1.0 / (p.y * area));
        for y in clamp(low.y)..=clamp(high.y) {
            for x in clamp(low.x)..=clamp(high.x) {
                let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let weights = [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)];
                if weights.iter().all(|w| w * area >= 0.0) {
                    let inverse: f32 = weights.iter().zip(near).map(|(w, n)| w * n).sum();
                    let depth = &mut self.depth[y * CELLS + x];
                    *depth = depth.min(1.0 / inverse);
                }
            }
        }
    }

    /// Whether nothing lies before `point`, in the radar's axes. Beyond the field of view nothing hides anything.
    pub(super) fn sees(&self, point: Vec3) -> bool {
        if point.y <= NEAREST_M {
            return false;
        }
        let p = cell(point);
        let inside = p.min_element() >= 0.0 && p.max_element() < CELLS as f32;
        !inside || point.y <= self.depth[p.y as usize * CELLS + p.x as usize] + TOLERANCE_M
    }
}

fn cell(point: Vec3) -> Vec2 {
    (Vec2::new(point.x, point.z) / point.y + EXTENT) * (CELLS as f32 / (2.0 * EXTENT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_behind_a_board_is_not_seen() {
        let board = [[-0.3, 1.0, -0.3], [0.3, 1.0, -0.3], [0.3, 1.0, 0.3], [-0.3, 1.0, 0.3]].map(Vec3::from);
        let mut view = View::empty();
        view.draw(&board, &[[0, 1, 2], [2, 3, 0]]);
        assert!(view.sees(Vec3::new(0.0, 1.0, 0.0)), "the board itself");
        assert!(view.sees(Vec3::new(0.1, 0.8, 0.1)), "before it");
        assert!(!view.sees(Vec3::new(0.1, 1.5, 0.1)), "behind it");
        assert!(view.sees(Vec3::new(0.6, 1.5, 0.0)), "beside it");
        assert!(!view.sees(Vec3::new(0.0, -1.0, 0.0)), "behind the radar");
    }

    #[test]
    fn a_tilted_triangle_hides_by_its_depth() {
        let corners = [[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [0.0, 3.0, 3.0]].map(Vec3::from);
        let mut view = View::empty();
        view.draw(&corners, &[[0, 1, 2]]);
        // At x = 0, z = 0 its depth is 1.5.
        assert!(view.sees(Vec3::new(0.0, 1.5, 0.0)) && !view.sees(Vec3::new(0.0, 1.6, 0.0)));
    }
}
