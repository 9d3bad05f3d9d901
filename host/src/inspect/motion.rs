//! Recorded human motion.

use serde::Serialize;

use super::{Builder, InspectError, Report};
use crate::motion::{Kind, Motion, actions};

#[derive(Debug, Serialize)]
struct Figures {
    joints: usize,
    frames: usize,
    first_frame: Option<u32>,
    last_frame: Option<u32>,
    duration_s: f64,
    frames_per_second: Option<f64>,
    height_m: Option<f32>,
    fastest_joint: Option<FastestJoint>,
    actions: Vec<ActionPart>,
}

#[derive(Debug, Serialize)]
struct FastestJoint {
    name: String,
    path_m: f32,
    usual_top_speed_m_s: f32,
    peak_speed_m_s: f32,
}

/// A stretch of the motion that is labelled.
#[derive(Debug, Serialize)]
struct ActionPart {
    action: String,
    start_frame: u32,
    end_frame: u32,
    /// Frames of the file within it.
    frames: usize,
    duration_s: Option<f64>,
}

#[derive(Debug, Serialize)]
struct JointPart {
    joint: String,
    parent: Option<String>,
    bone_length_m: Option<f32>,
    bone_length_spread_m: Option<f32>,
    path_m: Option<f32>,
    usual_top_speed_m_s: Option<f32>,
    peak_speed_m_s: Option<f32>,
}

fn joint_part(motion: &Motion, index: usize) -> JointPart {
    let joint = &motion.joints()[index];
    let lengths = motion.bone_lengths_m(index).map(|lengths| {
        lengths.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), l| (low.min(l), high.max(l)))
    });
    let speed = motion.speed(index);
    JointPart {
        joint: joint.name.clone(),
        parent: joint.parent.map(|p| motion.joints()[p].name.clone()),
        bone_length_m: lengths.map(|(low, high)| f32::midpoint(low, high)),
        bone_length_spread_m: lengths.map(|(low, high)| high - low),
        path_m: speed.map(|s| s.path_m),
        usual_top_speed_m_s: speed.map(|s| s.usual_top_m_s),
        peak_speed_m_s: speed.map(|s| s.peak_m_s),
    }
}

fn action_part(motion: &Motion, action: actions::Action) -> ActionPart {
    let from = motion.numbers().partition_point(|&n| n < action.start);
    let times = &motion.times_s()[from..motion.numbers().partition_point(|&n| n <= action.end).max(from)];
    ActionPart {
        action: action.name,
        start_frame: action.start,
        end_frame: action.end,
        frames: times.len(),
        duration_s: times.first().zip(times.last()).map(|(first, last)| last - first),
    }
}

pub(super) fn inspect(mut builder: Builder<'_>) -> Result<Report, InspectError> {
    let (kind, motion) = Motion::open(&builder.path)?;
    let mut labelled = Vec::new();
    if let Some((table, actions)) = actions::beside(&builder.path)? {
        labelled.extend(actions.into_iter().map(|action| action_part(&motion, action)));
        let outside = labelled.iter().filter(|a| a.frames == 0).count();
        if outside > 0 {
            let table = table.display();
            builder.note(format!("{outside} actions of {table} hold no frame of this file"));
        }
    }
    for note in &motion.notes {
        builder.note(note.as_str());
    }
    for index in 0..motion.joints().len() {
        builder.part(joint_part(&motion, index));
    }
    let frames = motion.frames().len();
    let duration_s = motion.duration_s();
    let figures = Figures {
        joints: motion.joints().len(),
        frames,
        first_frame: motion.numbers().first().copied(),
        last_frame: motion.numbers().last().copied(),
        duration_s,
        frames_per_second: (duration_s > 0.0).then(|| (frames - 1) as f64 / duration_s),
        height_m: motion.height_m(),
        fastest_joint: motion.fastest().map(|(joint, speed)| FastestJoint {
            name: motion.joints()[joint].name.clone(),
            path_m: speed.path_m,
            usual_top_speed_m_s: speed.usual_top_m_s,
            peak_speed_m_s: speed.peak_m_s,
        }),
        actions: labelled,
    };
    let format = match kind {
        Kind::Asf => "asf_skeleton",
        Kind::Amc => "amc_motion",
        Kind::Bvh => "bvh_motion",
        Kind::JointList => "kinect_joints",
    };
    Ok(builder.finish(format, figures))
}
