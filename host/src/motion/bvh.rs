//! Biovision hierarchies (`.bvh`): skeleton and motion in one file.
//!
//! Format: M. Meredith and S. Maddock, "Motion capture file formats explained", University of Sheffield CS-01-11,
//! section on BVH. `HIERARCHY`, one `ROOT`, nested `JOINT` and `End Site` blocks with `OFFSET` (of the parent, at rest)
//! and `CHANNELS`; `MOTION`, `Frames: N`, `Frame Time: seconds`, then a line for each frame with a value for each channel.
//! Angles are in degrees; the channels' rotations multiply from left to right. Position channels stand in place of the
//! joint's offset. An end site becomes a joint `NAME_end`.
//!
//! The unit of length is not in the file: it is the one of [`UNITS`] that makes the figure at rest 1 to 2.5 m tall.

use super::lines::{Fault, lines, number, numbers, short};
use super::rotation::{Freedom, IDENTITY, Matrix, Vector, about, apply, axis, product, scaled, sum};
use super::{Joint, MAX_JOINTS, Motion};

/// Word that begins the file.
pub(super) const HIERARCHY: &str = "HIERARCHY";
/// Units of length that are in use and their metres; the last is of files made from CMU's ASF skeletons.
pub const UNITS: [(&str, f64); 4] = [
    ("metres", 1.0),
    ("centimetres", 1e-2),
    ("millimetres", 1e-3),
    ("ASF units of 0.45 to the inch", 0.0254 / 0.45),
];
const PLAUSIBLE_HEIGHT_M: std::ops::RangeInclusive<f64> = 1.0..=2.5;

struct Node {
    joint: Joint,
    offset: Vector,
    channels: Vec<Freedom>,
}

/// Reads a motion.
///
/// # Errors
/// The first line that breaks the format, or the one with the motion if no unit makes the figure as tall as a person.
pub fn parse(text: &str) -> Result<Motion, Fault> {
    let mut lines = lines(text);
    let (nodes, line) = hierarchy(&mut lines)?;
    let (unit, metres) = unit(&nodes).map_err(|reason| Fault::new(line, reason))?;
    let mut next = |what: &str| lines.next().ok_or_else(|| Fault::new(line, format!("no `{what}` follows")));
    let frames = match next("Frames:")? {
        (_, words) if words.len() == 2 && words[0] == "Frames:" => words[1].parse::<usize>().ok(),
        _ => None,
    };
    let frames = frames.ok_or_else(|| Fault::new(line + 1, "need `Frames:` and their number"))?;
    let (line, words) = next("Frame Time:")?;
    let period_s = match words[..] {
        ["Frame", "Time:", word] => number(line, word)?,
        _ => return Err(Fault::new(line, "need `Frame Time:` and seconds")),
    };
    if period_s <= 0.0 {
        return Err(Fault::new(line, format!("a frame time of {period_s} s: need more than 0")));
    }

    let mut motion = Motion::new(nodes.iter().map(|n| n.joint.clone()).collect());
    let channels: usize = nodes.iter().map(|n| n.channels.len()).sum();
    let mut last_line = line;
    for (index, (line, words)) in (0_u32..).zip(lines) {
        last_line = line;
        if words.len() != channels {
            return Err(Fault::new(line, format!("a frame needs {channels} values, found {}", words.len())));
        }
        let values: Vec<f64> = words.iter().map(|w| number(line, w)).collect::<Result<_, _>>()?;
        let pose: Vec<Vector> = pose(&nodes, &values).into_iter().map(|p| scaled(p, metres)).collect();
        motion
            .push(index + 1, f64::from(index) * period_s, &pose)
            .map_err(|reason| Fault::new(line, reason))?;
    }
    if motion.numbers().len() != frames {
        let found = motion.numbers().len();
        return Err(Fault::new(last_line, format!("the motion ends after {found} of {frames} frames")));
    }
    if frames == 0 {
        return Err(Fault::new(last_line, "the motion has no frames"));
    }
    motion
        .notes
        .push(format!("BVH files do not tell their unit of length: {unit} make a person of the figure"));
    Ok(motion)
}

/// Reads up to the line `MOTION`; returns its number too.
fn hierarchy<'t>(
    lines: &mut impl Iterator<Item = (usize, Vec<&'t str>)>,
) -> Result<(Vec<Node>, usize), Fault> {
    let mut nodes: Vec<Node> = Vec::new();
    // The joints that are open, and whether the block of the last one has begun.
    let mut open: Vec<usize> = Vec::new();
    let mut begun = true;
    let mut last_line = 1;
    for (line, words) in lines {
        last_line = line;
        match words[..] {
            [HIERARCHY] if nodes.is_empty() => {}
            ["MOTION"] if open.is_empty() && !nodes.is_empty() => return Ok((nodes, line)),
            ["{"] if !begun => begun = true,
            ["}"] if begun && open.pop().is_some() => {}
            ["ROOT" | "JOINT" | "End", ..] if begun => {
                let parent = open.last().copied();
                let name = match (words[0], parent) {
                    ("ROOT", None) if nodes.is_empty() => words[1..].join(" "),
                    ("JOINT", Some(_)) => words[1..].join(" "),
                    ("End", Some(parent)) => format!("{}_end", nodes[parent].joint.name),
                    _ => return Err(Fault::new(line, "need one ROOT, and all other joints within it")),
                };
                if nodes.len() >= MAX_JOINTS {
                    return Err(Fault::new(line, format!("more than {MAX_JOINTS} joints")));
                }
                open.push(nodes.len());
                begun = false;
                nodes.push(Node { joint: Joint { name, parent }, offset: [0.0; 3], channels: Vec::new() });
            }
            [key @ ("OFFSET" | "CHANNELS"), ref values @ ..] if begun => {
                let Some(&node) = open.last() else {
                    return Err(Fault::new(line, format!("`{key}` outside of a joint")));
                };
                match (key, values) {
                    ("OFFSET", _) => nodes[node].offset = numbers(line, values)?,
                    (_, [count, names @ ..]) if count.parse() == Ok(names.len()) && names.len() <= 6 => {
                        nodes[node].channels =
                            names.iter().map(|name| channel(line, name)).collect::<Result<_, _>>()?;
                    }
                    _ => {
                        return Err(Fault::new(
                            line,
                            "need the number of channels, up to 6, and their names",
                        ));
                    }
                }
            }
            _ => return Err(Fault::new(line, format!("`{}` does not belong here", short(words[0])))),
        }
    }
    Err(Fault::new(last_line, "the file ends before its MOTION"))
}

fn channel(line: usize, name: &str) -> Result<Freedom, Fault> {
    let mut letters = name.chars();
    match (letters.next().and_then(axis), letters.as_str()) {
        (Some(axis), "position") => Ok(Freedom::Translation(axis)),
        (Some(axis), "rotation") => Ok(Freedom::Rotation(axis)),
        _ => Err(Fault::new(line, format!("`{}` is no channel such as Xposition, Zrotation", short(name)))),
    }
}

/// Positions of the joints in the file's unit; without `values` those of the rest pose.
fn pose(nodes: &[Node], values: &[f64]) -> Vec<Vector> {
    let mut turns: Vec<Matrix> = Vec::with_capacity(nodes.len());
    let mut places: Vec<Vector> = Vec::with_capacity(nodes.len());
    let mut rest = values;
    for node in nodes {
        let (mut turn, mut offset) = (IDENTITY, node.offset);
        let (own, others) = rest.split_at(node.channels.len().min(rest.len()));
        rest = others;
        for (channel, &value) in node.channels.iter().zip(own) {
            match *channel {
                Freedom::Rotation(axis) => turn = product(&turn, &about(axis, value.to_radians())),
                Freedom::Translation(axis) => offset[axis] = value,
            }
        }
        let (turn, place) = match node.joint.parent {
            Some(parent) => {
                (product(&turns[parent], &turn), sum(places[parent], apply(&turns[parent], offset)))
            }
            None => (turn, offset),
        };
        turns.push(turn);
        places.push(place);
    }
    places
}

/// The unit of length. A figure at rest stands, or stands with its arms spread: as tall as its largest extent.
fn unit(nodes: &[Node]) -> Result<(&'static str, f64), String> {
    let rest = pose(nodes, &[]);
    let extent = |axis: usize| {
        let along = rest.iter().map(|p| p[axis]);
        along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
    };
    let height = extent(0).max(extent(1)).max(extent(2));
    UNITS.into_iter().find(|(_, metres)| PLAUSIBLE_HEIGHT_M.contains(&(height * metres))).ok_or_else(|| {
        format!("the figure at rest measures {height}: no known unit of length makes a person of it")
    })
}
