//! The skin: closed tubes of elliptic rings, one for each segment.

use glam::{Quat, Vec3};

use super::{Joint, Joints, Lengths, Side, arc, basis};
use crate::simulate::shape::{append, circle, material, tube};
use crate::simulate::{Capsule, Surface};

/// A cross-section.
struct Ring {
    /// Where it is between the segment's joints: 0 at the first, 1 at the second.
    at: f32,
    /// Its middle's offset along the segment's second cross axis, as a share of the body's height.
    offset: f32,
    /// Half its extent along the two cross axes, as shares of the body's height.
    half: [f32; 2],
}

const fn ring(at: f32, offset: f32, half: [f32; 2]) -> Ring {
    Ring { at, offset, half }
}

const fn round(at: f32, radius: f32) -> Ring {
    ring(at, 0.0, [radius, radius])
}

/// What a part of the mesh follows.
#[derive(Debug, Clone, Copy)]
enum Axis {
    /// From joint to joint, with cross axes to the right and forward.
    Trunk(Joint, Joint),
    /// From joint to joint, with a round cross-section.
    Limb(Parent, Joint, Joint),
    /// From the ankle forward along the sole, for a length of [`Lengths::foot`]; cross axes to the right and up.
    Foot(Side),
}

/// What a limb's segment swings from.
#[derive(Debug, Clone, Copy)]
enum Parent {
    Pelvis,
    Chest,
    /// The limb's segment before it.
    Before,
}

/// A part of the mesh.
struct Segment {
    /// Where its lower and its upper pole are, as [`Ring::at`].
    poles: [f32; 2],
    rings: &'static [Ring],
    sides: usize,
    reflectivity: f32,
    /// Whether it grows with the build.
    girth: bool,
}

// Extents are about the medians of men in ANSUR II (C. C. Gordon et al., "2012 Anthropometric survey of U.S. Army
// personnel", 2014) divided by their height, 1.755 m: circumferences of chest 1.06, waist 0.94, hips 1.02, thigh 0.62,
// calf 0.39, ankle 0.23, upper arm 0.36, forearm 0.31, wrist 0.18, neck 0.40 m; head 0.15 by 0.20 m.
const ABDOMEN: Segment = Segment {
    poles: [-0.75, 1.35],
    rings: &[
        ring(-0.5, 0.0, [0.088, 0.062]),
        ring(0.15, 0.0, [0.098, 0.070]),
        ring(0.95, 0.0, [0.090, 0.064]),
    ],
    sides: 10,
    reflectivity: material::CLOTH,
    girth: true,
};
const THORAX: Segment = Segment {
    poles: [-0.15, 1.12],
    rings: &[
        ring(0.0, 0.0, [0.086, 0.062]),
        ring(0.4, 0.004, [0.094, 0.070]),
        ring(0.8, 0.0, [0.105, 0.062]),
        ring(1.03, -0.004, [0.078, 0.040]),
    ],
    sides: 10,
    reflectivity: material::CLOTH,
    girth: true,
};
const NECK: Segment = Segment {
    poles: [-0.1, 0.8],
    rings: &[round(0.0, 0.036), round(0.6, 0.035)],
    sides: 6,
    reflectivity: material::SKIN,
    girth: true,
};
/// From the neck's joint to the middle of the head and as far beyond it as the crown is: 0.065 of the height.
const HEAD: Segment = Segment {
    poles: [0.44, 1.0 + 0.065 / 0.117],
    rings: &[
        ring(0.62, 0.008, [0.030, 0.038]),
        ring(1.0, 0.004, [0.043, 0.056]),
        ring(1.36, 0.0, [0.034, 0.044]),
    ],
    sides: 8,
    reflectivity: material::SKIN,
    girth: false,
};
const UPPER_ARM: Segment = Segment {
    poles: [-0.16, 1.06],
    rings: &[round(0.0, 0.030), round(0.5, 0.029), round(0.95, 0.024)],
    sides: 6,
    reflectivity: material::CLOTH,
    girth: true,
};
const FOREARM: Segment = Segment {
    poles: [-0.08, 1.05],
    rings: &[round(0.03, 0.025), round(0.3, 0.027), round(0.65, 0.022), round(0.98, 0.016)],
    sides: 8,
    reflectivity: material::SKIN,
    girth: true,
};
/// To the grip and on to the bent fingers.
const HAND: Segment = Segment {
    poles: [-0.05, 1.75],
    rings: &[
        ring(0.15, 0.0, [0.018, 0.014]),
        ring(0.85, 0.0, [0.025, 0.013]),
        ring(1.5, 0.0, [0.020, 0.012]),
    ],
    sides: 6,
    reflectivity: material::SKIN,
    girth: false,
};
const THIGH: Segment = Segment {
    poles: [-0.12, 1.05],
    rings: &[round(0.02, 0.050), round(0.3, 0.054), round(0.65, 0.044), round(0.97, 0.033)],
    sides: 8,
    reflectivity: material::CLOTH,
    girth: true,
};
const SHIN: Segment = Segment {
    poles: [-0.06, 1.06],
    rings: &[round(0.03, 0.032), round(0.3, 0.035), round(0.65, 0.026), round(0.97, 0.021)],
    sides: 6,
    reflectivity: material::CLOTH,
    girth: true,
};
/// Offsets put the sole where the floor is: [`Lengths::ankle`], 0.039 of the height, below the ankle.
const FOOT: Segment = Segment {
    poles: [-0.4, 1.28],
    rings: &[
        ring(-0.25, 0.022 - 0.039, [0.020, 0.022]),
        ring(0.4, 0.021 - 0.039, [0.025, 0.021]),
        ring(1.1, 0.012 - 0.039, [0.026, 0.012]),
    ],
    sides: 6,
    reflectivity: material::CLOTH,
    girth: false,
};

/// How much of an arm or leg belongs to a capsule: the two joints and the radius as a share of the height.
const CAPSULES: [(Joint, Joint, f32); 14] = {
    use Joint::*;
    [
        (HipCentre, Spine, 0.080),
        (Spine, ShoulderCentre, 0.080),
        (ShoulderCentre, Head, 0.048),
        (ShoulderLeft, ElbowLeft, 0.028),
        (ElbowLeft, WristLeft, 0.023),
        (WristLeft, HandLeft, 0.024),
        (ShoulderRight, ElbowRight, 0.028),
        (ElbowRight, WristRight, 0.023),
        (WristRight, HandRight, 0.024),
        (HipLeft, KneeLeft, 0.045),
        (KneeLeft, AnkleLeft, 0.030),
        (HipRight, KneeRight, 0.045),
        (KneeRight, AnkleRight, 0.030),
        (ShoulderLeft, ShoulderRight, 0.045),
    ]
};

fn segments() -> Vec<(Axis, Segment)> {
    use Axis::{Foot, Limb, Trunk};
    use Joint::*;
    let mut all = vec![
        (Trunk(HipCentre, Spine), ABDOMEN),
        (Trunk(Spine, ShoulderCentre), THORAX),
        (Trunk(ShoulderCentre, Head), NECK),
        (Trunk(ShoulderCentre, Head), HEAD),
    ];
    for side in Side::BOTH {
        let ([shoulder, elbow, wrist, hand], [hip, knee, ankle, _]) = (side.arm(), side.leg());
        all.extend([
            (Limb(Parent::Chest, shoulder, elbow), UPPER_ARM),
            (Limb(Parent::Before, elbow, wrist), FOREARM),
            (Limb(Parent::Before, wrist, hand), HAND),
            (Limb(Parent::Pelvis, hip, knee), THIGH),
            (Limb(Parent::Before, knee, ankle), SHIN),
            (Foot(side), FOOT),
        ]);
    }
    all
}

/// A vertex in its segment.
#[derive(Debug, Clone, Copy)]
struct Skin {
    /// As [`Ring::at`].
    at: f32,
    /// Along the two cross axes, m.
    across: [f32; 2],
    /// How much of the chest's breathing it follows.
    breath: f32,
}

/// A person's mesh.
#[derive(Debug, Clone)]
pub struct Body {
    lengths: Lengths,
    build: f32,
    surface: Surface,
    parts: Vec<(Axis, Vec<Skin>)>,
}

impl Body {
    /// A body of `height_m`, its girth `build` times that of an average person.
    pub fn new(height_m: f32, build: f32) -> Self {
        let mut body =
            Self { lengths: Lengths::of(height_m), build, surface: Surface::default(), parts: Vec::new() };
        let mut first = 0;
        for (number, (axis, segment)) in segments().into_iter().enumerate() {
            let girth = height_m * if segment.girth { build } else { 1.0 };
            let breathes = |forward: f32| if number == 1 { forward.max(0.0) } else { 0.0 };
            let mut skin = vec![Skin { at: segment.poles[0], across: [0.0; 2], breath: 0.0 }];
            for ring in segment.rings {
                skin.extend(circle(segment.sides).map(|(cos, sin)| Skin {
                    at: ring.at,
                    across: [cos * ring.half[0] * girth, ring.offset * height_m + sin * ring.half[1] * girth],
                    breath: breathes(sin),
                }));
            }
            skin.push(Skin { at: segment.poles[1], across: [0.0; 2], breath: 0.0 });
            if let Axis::Foot(_) = axis {
                // Poles lie at half the height of the toes and of the heel, not at that of the ankle.
                let (heel, toes) = (segment.rings[0].offset, segment.rings[segment.rings.len() - 1].offset);
                skin.first_mut().into_iter().for_each(|s| s.across[1] = heel * height_m);
                skin.last_mut().into_iter().for_each(|s| s.across[1] = toes * height_m);
            }
            let triangles = tube(segment.rings.len(), segment.sides, 0);
            let reflectivity = vec![segment.reflectivity; triangles.len()];
            append(&mut body.surface, &Surface { triangles, reflectivity }, first);
            first += skin.len();
            body.parts.push((axis, skin));
        }
        body
    }

    /// Its triangles.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Its lengths.
    pub fn lengths(&self) -> &Lengths {
        &self.lengths
    }

    /// Number of its vertices.
    pub fn vertex_count(&self) -> usize {
        self.parts.iter().map(|(_, skin)| skin.len()).sum()
    }

    /// Adds the positions of its vertices to `vertices`, with the chest `breath_m` further forward than at rest. The floor
    /// is hard: nothing is below z = 0.
    pub fn vertices(&self, joints: &Joints, breath_m: f32, vertices: &mut Vec<Vec3>) {
        let mut turns = Turns::of(joints);
        for (axis, skin) in &self.parts {
            let Placed { origin, along, across: [first, second] } = turns.place(*axis, joints, &self.lengths);
            vertices.extend(skin.iter().map(|s| {
                let across = first * s.across[0] + second * (s.across[1] + breath_m * s.breath);
                let place = origin + along * s.at + across;
                place.with_z(place.z.max(0.0))
            }));
        }
    }

    /// Adds the body to what stands in the way of tags.
    pub fn blockers(&self, joints: &Joints, blockers: &mut Vec<Capsule>) {
        blockers.extend(CAPSULES.iter().map(|&(from, to, radius)| Capsule {
            ends: [joints[from.index()], joints[to.index()]],
            radius: radius * self.lengths.height * self.build,
        }));
    }
}

/// Where a part of the mesh is: a point of its own axes, the way along it for a change of 1 of [`Ring::at`], and its cross
/// axes, right-handed with that way.
struct Placed {
    origin: Vec3,
    along: Vec3,
    across: [Vec3; 2],
}

/// Turns of segments: each takes x to the right, y forward and z up at rest.
struct Turns {
    pelvis: Quat,
    chest: Quat,
    /// Of the last limb's segment.
    limb: Quat,
}

impl Turns {
    fn of(joints: &Joints) -> Self {
        use Joint::*;
        let way = |from: Joint, to: Joint| joints[to.index()] - joints[from.index()];
        Self {
            pelvis: basis(way(HipLeft, HipRight), way(HipCentre, Spine)),
            chest: basis(way(ShoulderLeft, ShoulderRight), way(Spine, ShoulderCentre)),
            limb: Quat::IDENTITY,
        }
    }

    /// Where the next part is; a limb's segments come one after the other.
    fn place(&mut self, axis: Axis, joints: &Joints, lengths: &Lengths) -> Placed {
        /// A segment swings from its parent the shortest way.
        fn swung(parent: Quat, rest: Vec3, along: Vec3) -> Quat {
            parent * arc(rest, parent.conjugate() * along.normalize_or(parent * rest))
        }
        let at = |joint: Joint| joints[joint.index()];
        match axis {
            Axis::Trunk(from, to) => {
                let parent = if from == Joint::HipCentre { self.pelvis } else { self.chest };
                let along = at(to) - at(from);
                let turn = swung(parent, Vec3::Z, along);
                Placed { origin: at(from), along, across: [turn * Vec3::X, turn * Vec3::Y] }
            }
            Axis::Limb(parent, from, to) => {
                let parent = match parent {
                    Parent::Pelvis => self.pelvis,
                    Parent::Chest => self.chest,
                    Parent::Before => self.limb,
                };
                let along = at(to) - at(from);
                self.limb = swung(parent, Vec3::NEG_Z, along);
                Placed { origin: at(from), along, across: [self.limb * Vec3::X, self.limb * Vec3::NEG_Y] }
            }
            Axis::Foot(side) => {
                let [_, knee, ankle, foot] = side.leg().map(at);
                let (to_toes, shin) = ((foot - ankle).normalize_or(Vec3::Y), knee - ankle);
                let right = to_toes.cross(shin).normalize_or(Vec3::X);
                // The toes are lower than the ankle when the sole is level.
                let slope = lengths.instep / lengths.foot;
                let forward = (to_toes + right.cross(to_toes) * slope).normalize();
                Placed {
                    origin: ankle,
                    along: forward * lengths.foot,
                    across: [-right, right.cross(forward)],
                }
            }
        }
    }
}
