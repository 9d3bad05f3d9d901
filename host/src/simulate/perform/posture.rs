//! From a posture, some angles and where hands and feet are, to the positions of all joints.

use glam::{Quat, Vec3};

use crate::simulate::body::{
    Joint, Joints, Lengths, Side, arc, highest_hip, softly_at_most, stretched, two_bones,
};

/// How the trunk is held and where the feet are: person's axes, x to the right, y forward, z up, from the floor where they
/// stand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Posture {
    /// Middle of the hips, m.
    pub(super) hips: Vec3,
    /// Turn of the hips to the left, rad.
    pub(super) yaw: f32,
    /// Trunk forward, rad.
    pub(super) flexion: f32,
    /// Trunk to the right, rad.
    pub(super) bend: f32,
    /// Turn of the chest against the hips to the left, rad.
    pub(super) twist: f32,
    /// How far the head leans from the trunk's line to the right and forward, as tangents.
    pub(super) head: Vec3,
    /// Ankles, m, left first.
    pub(super) ankles: [Vec3; 2],
    /// Turn of the feet to the left, rad.
    pub(super) feet: [f32; 2],
}

/// Share of the trunk's turns that the hips make.
const HIPS_SHARE: f32 = 0.45;
/// How far hips go back for balance when the trunk goes forward by 90 degrees, as a share of the height.
const BALANCE: f32 = 0.06;

/// The trunk with what hangs on it.
pub(super) struct Trunk {
    joints: Joints,
    chest: Quat,
    /// Turn of the chest to the left, rad.
    heading: f32,
}

impl Posture {
    /// The trunk; hips are lower than asked for where legs do not reach.
    pub(super) fn trunk(&self, lengths: &Lengths) -> Trunk {
        let turn = |yaw: f32, share: f32| {
            Quat::from_rotation_z(yaw)
                * Quat::from_rotation_x(-share * self.flexion)
                * Quat::from_rotation_y(share * self.bend)
        };
        let heading = self.yaw + self.twist;
        let (hips, chest) = (turn(self.yaw, HIPS_SHARE), turn(heading, 1.0));
        let back = Quat::from_rotation_z(self.yaw) * Vec3::NEG_Y;
        let mut centre = self.hips + back * (BALANCE * lengths.height * libm::sinf(self.flexion));
        for side in Side::BOTH {
            let hip = centre + hips * (Vec3::X * side.sign() * lengths.hip);
            let ankle = self.ankles[side.index()];
            let highest = highest_hip(hip, ankle, lengths.leg()) - (hip.z - centre.z);
            centre.z = softly_at_most(centre.z, highest);
        }
        let mut joints = [Vec3::ZERO; Joint::COUNT];
        let mut put = |joint: Joint, place: Vec3| {
            joints[joint.index()] = place;
            place
        };
        put(Joint::HipCentre, centre);
        let waist = put(Joint::Spine, centre + hips * (Vec3::Z * lengths.loins));
        let shoulders = put(Joint::ShoulderCentre, waist + chest * (Vec3::Z * lengths.chest));
        put(Joint::Head, shoulders + chest * ((Vec3::Z + self.head).normalize() * lengths.neck));
        for side in Side::BOTH {
            put(side.leg()[0], centre + hips * (Vec3::X * side.sign() * lengths.hip));
            put(side.arm()[0], shoulders + chest * (Vec3::X * side.sign() * lengths.shoulder));
        }
        Trunk { joints, chest, heading }
    }
}

impl Trunk {
    /// A shoulder joint.
    pub(super) fn shoulder(&self, side: Side) -> Vec3 {
        self.joints[side.arm()[0].index()]
    }

    /// The middle of the head.
    pub(super) fn head(&self) -> Vec3 {
        self.joints[Joint::Head.index()]
    }

    /// Where `offset` from a shoulder is, along the chest's heading and the vertical.
    pub(super) fn beside(&self, side: Side, offset: Vec3) -> Vec3 {
        self.shoulder(side) + Quat::from_rotation_z(self.heading) * offset
    }

    /// `way` in the chest's axes.
    pub(super) fn to_chest(&self, way: Vec3) -> Vec3 {
        self.chest.conjugate() * way
    }

    /// Adds an arm with its hand at `target`, or as near as it reaches, its elbow turned outwards by `swivel` rad.
    pub(super) fn arm(&mut self, lengths: &Lengths, side: Side, target: Vec3, swivel: f32) {
        let [shoulder, elbow, wrist, hand] = side.arm().map(Joint::index);
        let root = self.joints[shoulder];
        let lower = lengths.forearm + lengths.palm;
        let elbow_way = Vec3::new(side.sign() * libm::sinf(swivel), -libm::cosf(swivel), 0.0);
        let reach = stretched((target - root).length(), lengths.arm());
        let way = (target - root).normalize_or(self.chest * Vec3::NEG_Z);
        let bend = bent(self.chest, way, elbow_way);
        let (mid, end) = two_bones(root, way, reach, [lengths.upper_arm, lower], bend);
        self.joints[elbow] = mid;
        self.joints[hand] = end;
        self.joints[wrist] = mid + (end - mid) * (lengths.forearm / lower);
    }

    /// Adds a leg to an ankle, its foot turned to the left by `yaw` rad.
    pub(super) fn leg(&mut self, lengths: &Lengths, side: Side, target: Vec3, yaw: f32) {
        let [hip, knee, ankle, foot] = side.leg().map(Joint::index);
        let root = self.joints[hip];
        let toes = Quat::from_rotation_z(yaw);
        // Knees point where the feet do, whatever the hips do.
        let way = (target - root).normalize_or(Vec3::NEG_Z);
        let bend = bent(toes, way, Vec3::Y);
        let reach = (target - root).length();
        let (mid, end) = two_bones(root, way, reach, [lengths.thigh, lengths.shin], bend);
        self.joints[knee] = mid;
        self.joints[ankle] = end;
        self.joints[foot] = end + toes * Vec3::new(0.0, lengths.foot, -lengths.instep);
    }

    /// All joints, when arms and legs are there.
    pub(super) fn into_joints(self) -> Joints {
        self.joints
    }
}

/// Where a limb bends whose ends lie along `way`, if it bends to `bend` when it hangs down in the axes of `frame`: to where
/// the shortest turn from there takes that.
fn bent(frame: Quat, way: Vec3, bend: Vec3) -> Vec3 {
    frame * (arc(Vec3::NEG_Z, frame.conjugate() * way) * bend)
}
