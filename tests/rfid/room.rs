//! A room with reader antennas in its corners, as simulations of tags for tests need it.

use glam::Vec3;
use rfhoi::hoi::Object;
use rfhoi::simulate::effects::Effects;
use rfhoi::simulate::rfid::Situation;
use rfhoi::simulate::scene::{self, RadarPose, Reader, ReaderAntenna, Scene, Stated, Tag};
use rfhoi::simulate::{Capsule, Performance, Surface};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::tag::Epc;

/// Side of the square, m: 15 feet.
pub(crate) const SIDE_M: f32 = 4.572;
/// Height of antennas and tags, m.
const HEIGHT_M: f32 = 1.1;

/// The room, with nobody who moves.
pub(crate) struct Room {
    pub(crate) scene: Scene,
    pub(crate) tags: Vec<Tag>,
    /// Who stands in the way.
    pub(crate) body: Option<Body>,
}

/// Somebody upright: where their feet are at a time.
pub(crate) struct Body(pub(crate) Box<dyn Fn(f64) -> Vec3 + Send + Sync>);

impl Room {
    /// Up to four antennas in the corners, clockwise, looking to the middle; a tag for each of these lengths of EPCs.
    pub(crate) fn square(antennas: usize, epc_bytes: &[usize]) -> Self {
        let corner = |n: usize| {
            let (x, y) = [(0.0, 0.0), (0.0, SIDE_M), (SIDE_M, SIDE_M), (SIDE_M, 0.0)][n];
            let middle = Vec3::new(SIDE_M / 2.0, SIDE_M / 2.0, HEIGHT_M);
            let position = Vec3::new(x, y, HEIGHT_M);
            ReaderAntenna { position, facing: (middle - position).normalize() }
        };
        let tag = |(n, &length): (usize, &usize)| {
            let mut epc = vec![0xe2; length];
            epc[length - 1] = n as u8 + 1;
            Tag { epc: Epc::new(&epc).expect("62 bytes at most"), object: Object::Cup, offset: Vec3::ZERO }
        };
        let room = scene::Room {
            min: Vec3::new(-1.0, -1.0, 0.0),
            max: Vec3::new(SIDE_M + 1.0, SIDE_M + 1.0, 2.7),
            reflectivity: 0.2,
        };
        let radar = RadarPose {
            position: Vec3::ZERO,
            yaw_rad: 0.0,
            pitch_rad: 0.0,
            depth_m: 3.05,
            profile: RadarProfile::bridge(),
        };
        let reader = Reader { antennas: (0..antennas).map(corner).collect(), power_dbm: 30.0 };
        let (furniture, people, places) = Default::default();
        let scene = Scene {
            name: "square".into(),
            room,
            furniture,
            radar,
            reader,
            tags: Vec::new(),
            people,
            places,
            stated: Stated::default(),
        };
        Self { scene, tags: epc_bytes.iter().enumerate().map(tag).collect(), body: None }
    }

    /// A place at the tags' height, m.
    pub(crate) fn place(&self, x: f32, y: f32) -> Vec3 {
        Vec3::new(x, y, HEIGHT_M)
    }

    /// What the reader looks at.
    pub(crate) fn situation<'a>(
        &'a self,
        position: &'a dyn Fn(usize, f64) -> Vec3,
        effects: Effects,
    ) -> Situation<'a> {
        Situation { scene: &self.scene, performance: self, position, tags: &self.tags, effects }
    }
}

impl Performance for Room {
    fn duration_s(&self) -> f64 {
        0.0
    }

    fn surface(&self) -> &Surface {
        unreachable!("the reader asks for no surface")
    }

    fn vertices(&self, _: f64, _: &mut Vec<Vec3>) {
        unreachable!("the reader asks for no vertices")
    }

    fn tags(&self) -> usize {
        self.tags.len()
    }

    fn tag(&self, _: usize, _: f64) -> Vec3 {
        unreachable!("tests tell where tags are")
    }

    fn blockers(&self, time_s: f64, blockers: &mut Vec<Capsule>) {
        /// Of a grown-up, m.
        const TORSO: (f32, f32) = (1.6, 0.17);
        blockers.clear();
        blockers.extend(self.body.as_ref().map(|Body(at)| {
            let feet = at(time_s);
            Capsule { ends: [feet, feet + Vec3::Z * TORSO.0], radius: TORSO.1 }
        }));
    }
}
