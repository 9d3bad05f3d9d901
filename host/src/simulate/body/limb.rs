//! Two bones between two points.

use glam::Vec3;

/// Middle and end of two bones that lead from `root` along the unit vector `way`, their ends `reach` apart, or as far as they can be;
/// they bend towards the unit vector `bend`, which is square to that way.
pub(crate) fn two_bones(
    root: Vec3,
    way: Vec3,
    reach: f32,
    [upper, lower]: [f32; 2],
    bend: Vec3,
) -> (Vec3, Vec3) {
    let reach = reach.clamp((upper - lower).abs() * 1.1 + 1e-3, upper + lower);
    let along = (upper * upper - lower * lower + reach * reach) / (2.0 * reach);
    let aside = (upper * upper - along * along).max(0.0).sqrt();
    (root + way * along + bend * aside, root + way * reach)
}

/// `value`, but at most `limit`; smooth, a little below both where they meet.
pub(crate) fn softly_at_most(value: f32, limit: f32) -> f32 {
    const SOFTNESS_M: f32 = 0.004;
    let apart = value - limit;
    0.5 * (value + limit - (apart * apart + SOFTNESS_M * SOFTNESS_M).sqrt())
}

/// How high a hip joint over `hip` may be for a leg of length `leg` to reach `ankle`, m.
pub(crate) fn highest_hip(hip: Vec3, ankle: Vec3, leg: f32) -> f32 {
    /// Farthest that hips are from ankles, as a share of the leg.
    const STRAIGHT: f32 = 0.996;
    let aside = (hip - ankle).with_z(0.0).length_squared();
    ankle.z + (STRAIGHT * STRAIGHT * leg * leg - aside).max(0.0).sqrt()
}

/// How far the end of an arm of length `straight` gets that should be `wanted` from its root: all of it up to 95 %, then
/// ever less, so that it stretches without a jerk.
pub(crate) fn stretched(wanted: f32, straight: f32) -> f32 {
    let (from, most) = (0.95 * straight, 0.999 * straight);
    if wanted > from {
        from + (most - from) * (1.0 - libm::expf((from - wanted) / (most - from)))
    } else {
        wanted
    }
}
