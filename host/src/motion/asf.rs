//! Acclaim skeletons (`.asf`): bones, how they hang together, and how each may turn.
//!
//! Format: J. Lander, "Working with motion capture file formats", Game Developer, January 1998, and the University of
//! Wisconsin's page "Acclaim ASF/AMC". Sections begin with `:`. `:units` has `length` and `angle`; `:root` an `order`
//! of degrees of freedom, a `position` and an `orientation`; `:bonedata` a block `begin` ... `end` for each bone with
//! `name`, `direction` (of the world, at rest), `length`, `axis` (three angles and their order) and `dof`;
//! `:hierarchy` lines of a parent and its children. Other words are passed over.
//!
//! A bone turns by `C M C^-1` (C: its axis, M: its degrees of freedom, the first one applied first), after its parent.
//! Lengths times `length` are inches (CMU's FAQ: `1 / 0.45 * 2.54 / 100` metres with its `length 0.45`).
//! A bone's joint in a [`Motion`] is its far end.

use std::collections::{HashMap, VecDeque};

use super::lines::{Fault, lines, numbers, short};
use super::rotation::{
    Freedom, IDENTITY, Matrix, Vector, about, apply, axis, product, scaled, sum, transpose,
};
use super::{Joint, MAX_JOINTS, Motion};

const METRES_PER_INCH: f64 = 0.0254;
const SECTIONS: [&str; 8] =
    [":version", ":name", ":units", ":documentation", ":root", ":bonedata", ":hierarchy", ":skin"];
const ROOT: &str = "root";

/// Whether `word` begins a section of a skeleton.
pub(super) fn is_section(word: &str) -> bool {
    SECTIONS.iter().any(|s| word.eq_ignore_ascii_case(s))
}

/// A skeleton.
#[derive(Debug, Clone)]
pub struct Skeleton {
    pub(super) bones: Vec<Bone>,
    metres_per_unit: f64,
    position: Vector,
}

#[derive(Debug, Clone)]
pub(super) struct Bone {
    pub(super) name: String,
    parent: Option<usize>,
    direction: Vector,
    length: f64,
    /// Angles in the file's unit, in the order of their axes.
    angles: Vector,
    order: [usize; 3],
    axis: Matrix,
    pub(super) freedoms: Vec<Freedom>,
}

impl Bone {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            parent: None,
            direction: [0.0; 3],
            length: 0.0,
            angles: [0.0; 3],
            order: [0, 1, 2],
            axis: IDENTITY,
            freedoms: Vec::new(),
        }
    }
}

fn freedom(line: usize, word: &str) -> Result<Freedom, Fault> {
    let mut letters = word.chars();
    let found = match (letters.next(), letters.next().and_then(axis), letters.next()) {
        (Some('r' | 'R'), Some(axis), None) => Some(Freedom::Rotation(axis)),
        (Some('t' | 'T'), Some(axis), None) => Some(Freedom::Translation(axis)),
        _ => None,
    };
    found.ok_or_else(|| {
        Fault::new(line, format!("`{}` is no degree of freedom: tx, ty, tz, rx, ry or rz", short(word)))
    })
}

fn freedoms(line: usize, words: &[&str]) -> Result<Vec<Freedom>, Fault> {
    let freedoms: Vec<Freedom> = words.iter().map(|w| freedom(line, w)).collect::<Result<_, _>>()?;
    if freedoms.iter().enumerate().any(|(i, f)| freedoms[..i].contains(f)) {
        return Err(Fault::new(line, "a degree of freedom is there twice"));
    }
    Ok(freedoms)
}

fn order(line: usize, word: &str) -> Result<[usize; 3], Fault> {
    let axes: Vec<usize> = word.chars().filter_map(axis).collect();
    match axes[..] {
        [a, b, c] if word.len() == 3 && a != b && b != c && a != c => Ok([a, b, c]),
        _ => Err(Fault::new(line, format!("`{}` is no order of axes such as XYZ", short(word)))),
    }
}

/// Reads a skeleton.
///
/// # Errors
/// The first line that breaks the format.
pub fn parse(text: &str) -> Result<Skeleton, Fault> {
    let mut section = String::new();
    let mut bones = vec![Bone::new(ROOT)];
    let mut parents: HashMap<String, String> = HashMap::new();
    let (mut length, mut radians_per_angle, mut position) = (1.0, 1_f64.to_radians(), [0.0; 3]);
    let mut last_line = 1;
    for (line, words) in lines(text) {
        last_line = line;
        let (key, values) = (words[0], &words[1..]);
        if key.starts_with(':') {
            section = key.to_ascii_lowercase();
            continue;
        }
        let bone = bones.len() - 1;
        match (section.as_str(), key) {
            (":units", "length") => {
                [length] = numbers(line, values)?;
                if !(1e-3..=1e3).contains(&length) {
                    return Err(Fault::new(line, format!("unit of length {length}: need 0.001 to 1000")));
                }
            }
            (":units", "angle") => match values {
                ["deg"] => {}
                ["rad"] => radians_per_angle = 1.0,
                _ => return Err(Fault::new(line, "unit of angles: need deg or rad")),
            },
            (":root", "order") => bones[0].freedoms = freedoms(line, values)?,
            (":root", "axis") => bones[0].order = order(line, values.first().copied().unwrap_or_default())?,
            (":root", "position") => position = numbers(line, values)?,
            (":root", "orientation") => bones[0].angles = numbers(line, values)?,
            (":bonedata", "begin") => {
                if bones.len() >= MAX_JOINTS {
                    return Err(Fault::new(line, format!("more than {MAX_JOINTS} bones")));
                }
                bones.push(Bone::new(""));
            }
            (":bonedata", "name" | "direction" | "length" | "axis" | "dof") if bone == 0 => {
                return Err(Fault::new(line, format!("`{key}` before the first `begin`")));
            }
            (":bonedata", "name") => match values {
                [name] if bones.iter().all(|b| b.name != *name) => bones[bone].name = (*name).to_owned(),
                _ => return Err(Fault::new(line, "a bone needs one name of its own")),
            },
            (":bonedata", "direction") => bones[bone].direction = numbers(line, values)?,
            (":bonedata", "length") => [bones[bone].length] = numbers(line, values)?,
            (":bonedata", "axis") => match values {
                [angles @ .., letters] => {
                    bones[bone].angles = numbers(line, angles)?;
                    bones[bone].order = order(line, letters)?;
                }
                [] => return Err(Fault::new(line, "need three angles and the order of axes")),
            },
            (":bonedata", "dof") => {
                bones[bone].freedoms = freedoms(line, values)?;
                if bones[bone].freedoms.iter().any(|f| matches!(f, Freedom::Translation(_))) {
                    return Err(Fault::new(line, "bones that move along an axis are not supported"));
                }
            }
            (":hierarchy", "begin" | "end") => {}
            (":hierarchy", parent) => {
                for name in [parent].iter().chain(values) {
                    if bones.iter().all(|b| b.name != *name) {
                        return Err(Fault::new(line, format!("there is no bone `{}`", short(name))));
                    }
                }
                for child in values {
                    if *child == ROOT || parents.insert((*child).to_owned(), parent.to_owned()).is_some() {
                        return Err(Fault::new(line, format!("bone `{}` has two parents", short(child))));
                    }
                }
            }
            _ => {}
        }
    }
    for bone in &mut bones {
        let turns = bone.order.iter().zip(bone.angles);
        bone.axis = turns.fold(IDENTITY, |so_far, (&axis, angle)| {
            product(&about(axis, angle * radians_per_angle), &so_far)
        });
    }
    let bones = parents_first(bones, &parents).map_err(|reason| Fault::new(last_line, reason))?;
    Ok(Skeleton { bones, metres_per_unit: METRES_PER_INCH / length, position })
}

/// Sorts bones so that parents come before their children, and links them.
fn parents_first(bones: Vec<Bone>, parents: &HashMap<String, String>) -> Result<Vec<Bone>, String> {
    let mut children: HashMap<&str, Vec<Bone>> = HashMap::new();
    let count = bones.len();
    let mut waiting = VecDeque::new();
    for bone in bones {
        match parents.get(&bone.name) {
            Some(parent) => children.entry(parent).or_default().push(bone),
            None if bone.name == ROOT => waiting.push_back(bone),
            None => return Err(format!("bone `{}` is not in the hierarchy", short(&bone.name))),
        }
    }
    let mut sorted: Vec<Bone> = Vec::with_capacity(count);
    while let Some(bone) = waiting.pop_front() {
        let parent = sorted.len();
        for mut child in children.remove(bone.name.as_str()).unwrap_or_default() {
            child.parent = Some(parent);
            waiting.push_back(child);
        }
        sorted.push(bone);
    }
    if sorted.len() < count {
        return Err("some bones of the hierarchy do not hang on the root".to_owned());
    }
    match sorted.len() {
        1 => Err("the skeleton has no bones".to_owned()),
        _ => Ok(sorted),
    }
}

impl Skeleton {
    pub(super) fn joints(&self) -> Vec<Joint> {
        self.bones.iter().map(|b| Joint { name: b.name.clone(), parent: b.parent }).collect()
    }

    /// Far ends of the bones in metres, y up, where `values` has those of each bone's degrees of freedom in radians or
    /// units of length; a value too few counts as 0.
    pub(super) fn pose(&self, values: &[Vec<f64>]) -> Vec<Vector> {
        let mut turns: Vec<Matrix> = Vec::with_capacity(self.bones.len());
        let mut ends: Vec<Vector> = Vec::with_capacity(self.bones.len());
        for (bone, values) in self.bones.iter().zip(values) {
            let (mut motion, mut moved) = (IDENTITY, [0.0; 3]);
            for (freedom, &value) in bone.freedoms.iter().zip(values) {
                match *freedom {
                    Freedom::Rotation(axis) => motion = product(&about(axis, value), &motion),
                    Freedom::Translation(axis) => moved[axis] = value,
                }
            }
            let turn = product(&bone.axis, &product(&motion, &transpose(&bone.axis)));
            let (turn, end) = match bone.parent {
                Some(parent) => {
                    let turn = product(&turns[parent], &turn);
                    let offset = scaled(bone.direction, bone.length * self.metres_per_unit);
                    (turn, sum(ends[parent], apply(&turn, offset)))
                }
                // The root's orientation at rest is turned once more by its motion.
                None => {
                    let at = scaled(sum(self.position, moved), self.metres_per_unit);
                    (product(&turn, &bone.axis), at)
                }
            };
            turns.push(turn);
            ends.push(end);
        }
        ends
    }

    /// The rest pose, as a motion of one frame at time 0.
    pub(super) fn rest(&self) -> Result<Motion, Fault> {
        let mut motion = Motion::new(self.joints());
        let still = vec![Vec::new(); self.bones.len()];
        motion.push(0, 0.0, &self.pose(&still)).map_err(|reason| Fault::new(1, reason))?;
        motion.notes.push("a skeleton without motion: its rest pose".to_owned());
        Ok(motion)
    }
}
