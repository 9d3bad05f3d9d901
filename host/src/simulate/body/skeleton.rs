//! Joints, and how far they are from each other.

use glam::Vec3;

/// Joints, those of Kinect v1 in its order: what recordings have, and enough for a radar with bins of 4 cm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Joint {
    HipCentre,
    Spine,
    ShoulderCentre,
    /// Middle of the head.
    Head,
    ShoulderLeft,
    ElbowLeft,
    WristLeft,
    /// Middle of the grip.
    HandLeft,
    ShoulderRight,
    ElbowRight,
    WristRight,
    /// Middle of the grip.
    HandRight,
    HipLeft,
    KneeLeft,
    AnkleLeft,
    /// Root of the toes.
    FootLeft,
    HipRight,
    KneeRight,
    AnkleRight,
    /// Root of the toes.
    FootRight,
}

impl Joint {
    /// Number of joints.
    pub const COUNT: usize = 20;

    /// Its place in [`Joints`].
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// Positions of all joints, m.
pub type Joints = [Vec3; Joint::COUNT];

/// A side of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The person's left.
    Left,
    /// The person's right.
    Right,
}

impl Side {
    /// Both, left first.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// 0 for left, 1 for right.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The other one.
    pub const fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }

    /// Where it lies on the axis to the person's right: -1 or 1.
    pub const fn sign(self) -> f32 {
        match self {
            Self::Left => -1.0,
            Self::Right => 1.0,
        }
    }

    /// Shoulder, elbow, wrist and hand.
    pub const fn arm(self) -> [Joint; 4] {
        use Joint::*;
        match self {
            Self::Left => [ShoulderLeft, ElbowLeft, WristLeft, HandLeft],
            Self::Right => [ShoulderRight, ElbowRight, WristRight, HandRight],
        }
    }

    /// Hip, knee, ankle and foot.
    pub const fn leg(self) -> [Joint; 4] {
        use Joint::*;
        match self {
            Self::Left => [HipLeft, KneeLeft, AnkleLeft, FootLeft],
            Self::Right => [HipRight, KneeRight, AnkleRight, FootRight],
        }
    }

    /// The hand.
    pub const fn hand(self) -> Joint {
        self.arm()[3]
    }
}

/// Lengths of a body's segments, m.
///
/// Shares of the height: R. Drillis, R. Contini, "Body segment parameters" (1966), as in D. A. Winter, "Biomechanics and
/// motor control of human movement", 4th edition (2009), figure 4.1. What that figure lacks is derived from it: a hip joint
/// lies in the middle of its half of the hips, the grip in the middle of the hand, the waist at two fifths of the trunk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lengths {
    /// Height of the body.
    pub height: f32,
    /// Floor to ankle.
    pub ankle: f32,
    /// Knee to ankle.
    pub shin: f32,
    /// Hip to knee.
    pub thigh: f32,
    /// Middle to hip joint.
    pub hip: f32,
    /// Hips to waist.
    pub loins: f32,
    /// Waist to the line of the shoulders.
    pub chest: f32,
    /// Middle to shoulder joint.
    pub shoulder: f32,
    /// Line of the shoulders to the middle of the head.
    pub neck: f32,
    /// Shoulder to elbow.
    pub upper_arm: f32,
    /// Elbow to wrist.
    pub forearm: f32,
    /// Wrist to grip.
    pub palm: f32,
    /// Ankle to the root of the toes, forward.
    pub foot: f32,
    /// Ankle to the root of the toes, down.
    pub instep: f32,
}

impl Lengths {
    /// Of a person of `height` m.
    pub fn of(height: f32) -> Self {
        const HIP_HEIGHT: f32 = 0.530;
        const SHOULDER_HEIGHT: f32 = 0.818;
        /// Middle between chin (0.870) and crown (1).
        const HEAD_HEIGHT: f32 = 0.935;
        const WAIST: f32 = 0.4;
        let trunk = SHOULDER_HEIGHT - HIP_HEIGHT;
        Self {
            height,
            ankle: 0.039 * height,
            shin: 0.246 * height,
            thigh: 0.245 * height,
            hip: 0.191 / 4.0 * height,
            loins: WAIST * trunk * height,
            chest: (1.0 - WAIST) * trunk * height,
            shoulder: 0.129 * height,
            neck: (HEAD_HEIGHT - SHOULDER_HEIGHT) * height,
            upper_arm: 0.186 * height,
            forearm: 0.146 * height,
            palm: 0.108 / 2.0 * height,
            foot: 0.152 * 0.6 * height,
            instep: 0.027 * height,
        }
    }

    /// Shoulder to grip with the arm straight.
    pub fn arm(&self) -> f32 {
        self.upper_arm + self.forearm + self.palm
    }

    /// Hip to ankle with the leg straight.
    pub fn leg(&self) -> f32 {
        self.thigh + self.shin
    }

    /// Floor to hips, standing with straight legs.
    pub fn hip_height(&self) -> f32 {
        self.ankle + self.leg()
    }
}
