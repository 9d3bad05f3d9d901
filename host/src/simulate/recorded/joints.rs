//! Which recorded joint is which of the body's.

use super::RecordedError;
use crate::motion::Motion;
use crate::simulate::body::{Joint, Side};

/// Where a joint of the body comes from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Source {
    /// The mean of joints of the motion.
    Of(Vec<usize>),
    /// The mean of two of the body's, which are found.
    Between(Joint, Joint),
    /// As far beyond the second of the body's joints as a share of the way from the first.
    Beyond(Joint, Joint, f32),
}

/// Names of the trunk's joints: Kinect, ASF, BVH. Names with `+` are joints whose mean is meant.
const SPINE: &[&str] = &["spine", "upperback", "Spine1", "Chest", "Spine", "abdomen"];
const SHOULDER_CENTRE: &[&str] = &["shoulder_center", "thorax", "Neck", "neck", "Neck1"];
/// A bone of ASF, and a head's end site, end at the crown; Kinect's head is its middle.
const HEAD: &[&str] = &["upperneck+head", "head", "Head+Head_end", "Head"];

/// Names of the limbs' joints, left and right.
const LIMBS: [(&[&str], &[&str]); 8] = [
    (
        &["shoulder_left", "lclavicle", "LeftArm", "LeftUpArm", "lShldr", "LeftShoulder"],
        &["shoulder_right", "rclavicle", "RightArm", "RightUpArm", "rShldr", "RightShoulder"],
    ),
    (
        &["elbow_left", "lhumerus", "LeftForeArm", "LeftLowArm", "lForeArm", "LeftElbow"],
        &["elbow_right", "rhumerus", "RightForeArm", "RightLowArm", "rForeArm", "RightElbow"],
    ),
    (
        &["wrist_left", "lwrist", "LeftHand", "lHand", "LeftWrist"],
        &["wrist_right", "rwrist", "RightHand", "rHand", "RightWrist"],
    ),
    (
        &["hand_left", "lhand", "LeftHandMiddle1", "LeftFingerBase"],
        &["hand_right", "rhand", "RightHandMiddle1", "RightFingerBase"],
    ),
    (
        &["hip_left", "lhipjoint", "LeftUpLeg", "lThigh", "LeftHip"],
        &["hip_right", "rhipjoint", "RightUpLeg", "rThigh", "RightHip"],
    ),
    (
        &["knee_left", "lfemur", "LeftLeg", "LeftLowLeg", "lShin", "LeftKnee"],
        &["knee_right", "rfemur", "RightLeg", "RightLowLeg", "rShin", "RightKnee"],
    ),
    (
        &["ankle_left", "ltibia", "LeftFoot", "lFoot", "LeftAnkle"],
        &["ankle_right", "rtibia", "RightFoot", "rFoot", "RightAnkle"],
    ),
    (
        &["foot_left", "lfoot", "LeftToeBase", "LeftToe", "LeftFoot_end", "LeftAnkle_end"],
        &["foot_right", "rfoot", "RightToeBase", "RightToe", "RightFoot_end", "RightAnkle_end"],
    ),
];

/// Sources of all joints of the body, in their order.
pub(super) fn find(motion: &Motion) -> Result<[Source; Joint::COUNT], RecordedError> {
    use Joint::*;
    let mut found: [Source; Joint::COUNT] = std::array::from_fn(|_| Source::Of(Vec::new()));
    let named = |names: &[&str]| names.iter().find_map(|name| lookup(motion, name)).map(Source::Of);
    let missing = |joint, names: &[&str]| RecordedError::NoJoint {
        joint,
        tried: names.iter().map(|n| (*n).to_owned()).collect(),
    };
    let shoulders = Source::Between(ShoulderLeft, ShoulderRight);
    // What files call the hips' centre is above the hip joints, by a hand's width in Kinect.
    found[HipCentre.index()] = Source::Between(HipLeft, HipRight);
    found[ShoulderCentre.index()] = named(SHOULDER_CENTRE).unwrap_or(shoulders);
    found[Spine.index()] = named(SPINE).unwrap_or(Source::Between(HipCentre, ShoulderCentre));
    found[Head.index()] = named(HEAD).ok_or_else(|| missing(Head, HEAD))?;
    for side in Side::BOTH {
        let joints = side.arm().into_iter().chain(side.leg());
        for (joint, (left, right)) in joints.zip(LIMBS) {
            let names = if side == Side::Left { left } else { right };
            found[joint.index()] = match named(names) {
                Some(source) => source,
                None if joint == side.hand() => Source::Beyond(side.arm()[1], side.arm()[2], 0.3),
                None => return Err(missing(joint, names)),
            };
        }
    }
    Ok(found)
}

fn lookup(motion: &Motion, name: &str) -> Option<Vec<usize>> {
    name.split('+').map(|part| motion.joints().iter().position(|j| j.name == part)).collect()
}
