//! Turns between directions.

use glam::{Mat3, Quat, Vec3};

/// The shortest turn from one unit vector to another; smooth but where they are opposite.
pub(crate) fn arc(from: Vec3, to: Vec3) -> Quat {
    const OPPOSITE: f32 = 1e-6;
    let w = 1.0 + from.dot(to);
    let axis = from.cross(to);
    if w > OPPOSITE {
        Quat::from_xyzw(axis.x, axis.y, axis.z, w).normalize()
    } else {
        let axis = from.any_orthonormal_vector();
        Quat::from_xyzw(axis.x, axis.y, axis.z, 0.0)
    }
}

/// The turn that takes x (right), y (forward) and z (up) to a body's own axes: `up` in full, `right` as far as it is
/// square to it. The identity for directions of no length.
pub(crate) fn basis(right: Vec3, up: Vec3) -> Quat {
    let forward = up.cross(right).try_normalize();
    match (forward, up.try_normalize()) {
        (Some(forward), Some(up)) => {
            Quat::from_mat3(&Mat3::from_cols(forward.cross(up), forward, up)).normalize()
        }
        _ => Quat::IDENTITY,
    }
}
