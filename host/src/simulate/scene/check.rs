//! Whether the parts of a scene fit each other: everything in the room, nothing in anything else, all places in sight of
//! the radar and within its gate.

use glam::Vec3;
use rfhoi_shared::config::MAX_READER_ANTENNAS;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::Unmet;

use super::document::{At, Document};
use super::read::Draft;
use super::standing::{FIELD_OF_VIEW_RAD, Fault, NEAREST_M, PERSON_M, TOUCH_M, WORKPLACE_M, fault};
use super::{Place, RadarPose, Room, SAMPLE_TAGS, needs};
use crate::profile;

/// Radar and antennas have no wall or furniture before them that is nearer than this, m.
const CLEAR_M: f32 = 0.5;
/// Antennas nearer to each other than this are at one point, m.
const APART_M: f32 = 0.01;

/// Complains of all that does not fit.
///
/// The profile is held against the needs only where it is `in_use`.
pub(super) fn check(document: &mut Document<'_>, draft: &Draft, in_use: bool) {
    counts(document, draft);
    duplicates(document, draft);
    if let Some(radar) = draft.radar.as_ref().filter(|_| in_use) {
        sight(document, draft, &radar.value);
    }
    let Some(room) = draft.room.as_ref().map(|r| r.value) else { return };
    for At { line, value } in &draft.furniture {
        if let Some(corner) = value.corners().into_iter().find(|&c| !touches(&room, c)) {
            let sentence =
                format!("{} reaches out of the room, to {}; {}", value.name, at(corner), walls(&room));
            document.complain(*line, sentence);
        }
    }
    if let Some(At { line, value: radar }) = &draft.radar {
        let forward = radar.axes().row(1);
        stands_free(document, draft, &room, (*line, "the radar"), (radar.position, forward));
    }
    for (number, At { line, value }) in (1..).zip(&draft.antennas) {
        let name = format!("antenna {number} of the reader");
        stands_free(document, draft, &room, (*line, &name), (value.position, value.facing));
    }
    if let Some(radar) = &draft.radar {
        for place in &draft.places {
            if let Some(sentence) = misplaced(draft, &room, &radar.value, &place.value) {
                document.complain(place.line, sentence);
            }
        }
    }
}

fn counts(document: &mut Document<'_>, draft: &Draft) {
    let listed = draft.listed;
    if !(1..=MAX_READER_ANTENNAS).contains(&listed.antennas) {
        let sentence = format!(
            "the reader has {} antennas: it has 1 to {MAX_READER_ANTENNAS} sections [[reader.antennas]]",
            listed.antennas
        );
        document.complain(draft.reader_line, sentence);
    }
    if listed.tags < SAMPLE_TAGS {
        let sentence = format!(
            "the scene has {} tags: a sample has {SAMPLE_TAGS}, one on its object and the rest on others; add [[tags]]",
            listed.tags
        );
        document.complain(1, sentence);
    }
    if listed.people == 0 {
        document.complain(1, "there is nobody in the scene: add [[people]] with name and height_m");
    }
    if listed.places == 0 {
        document.complain(1, "there is no place to act: add [[places]] with position_m and facing_deg");
    }
}

/// Complains of what may be there only once.
fn duplicates(document: &mut Document<'_>, draft: &Draft) {
    for (number, (tag, object_line)) in draft.tags.iter().enumerate() {
        for (other, other_object_line) in &draft.tags[..number] {
            if tag.value.epc == other.value.epc {
                let sentence = format!(
                    "the EPC {} is that of the {} in line {} already: each tag has its own",
                    tag.value.epc, other.value.object, other.line
                );
                document.complain(tag.line, sentence);
            }
            if tag.value.object == other.value.object {
                let sentence = format!(
                    "there is a tag on the {} in line {other_object_line} already: each object is there once, with one tag",
                    tag.value.object
                );
                document.complain(*object_line, sentence);
            }
        }
    }
    let people = draft.people.iter().map(|p| (p.line, "person", p.value.name.as_str()));
    let furniture = draft.furniture.iter().map(|f| (f.line, "piece of furniture", f.value.name.as_str()));
    let names: Vec<_> = people.chain(furniture).collect();
    for (number, (line, kind, name)) in names.iter().enumerate() {
        if let Some((first, ..)) = names[..number].iter().find(|(_, k, n)| (k, n) == (kind, name)) {
            let sentence =
                format!("there is a {kind} {name:?} at line {first} already: give each its own name");
            document.complain(*line, sentence);
        }
    }
    for (number, antenna) in draft.antennas.iter().enumerate() {
        let near = |o: &&At<_>| antenna.value.position.distance(position(o)) < APART_M;
        if let Some(other) = draft.antennas[..number].iter().find(near) {
            let sentence = format!(
                "this antenna is at one point with that of line {}: what two antennas see differs only if they are apart \
                 (the paper's are 0.45 m apart)",
                other.line
            );
            document.complain(antenna.line, sentence);
        }
    }
}

fn position(antenna: &At<super::ReaderAntenna>) -> Vec3 {
    antenna.value.position
}

/// Complains if the profile does not see what the scene needs.
fn sight(document: &mut Document<'_>, draft: &Draft, radar: &RadarPose) {
    let Some(stated) = &draft.stated else { return };
    let Err(unmet) = needs(radar.depth_m, draft.antennas.len(), stated).gate(&radar.profile) else { return };
    let others = profile::NAMES.into_iter().filter_map(|name| Some((name, RadarProfile::named(name)?)));
    let name = &draft.profile.value;
    let sentence = match unmet {
        Unmet::Depth { needed, span } => {
            let spans: Vec<String> =
                others.map(|(name, p)| format!("{name:?} {:.2} m", p.range_span().0)).collect();
            format!(
                "the profile {name:?} cannot see the room: it sees {:.2} m, depth_m (line {}) is {:.2} m; take a profile \
                 that sees farther ({}), or a smaller depth_m and nearer places",
                span.0,
                draft.depth_line,
                needed.0,
                spans.join(", ")
            )
        }
        Unmet::Speed { needed, span } => format!(
            "the profile {name:?} cannot follow hands: they move at up to {:.1} m/s, it is unambiguous to {:.2} m/s; take \
             a shorter idle_ns or ramp_end_ns, or fewer transmitters",
            needed.0, span.0
        ),
    };
    document.complain(draft.profile.line, sentence);
}

/// Complains if what is at a point, looking somewhere, is out of the room, in furniture, or looks into either.
fn stands_free(
    document: &mut Document<'_>,
    draft: &Draft,
    room: &Room,
    (line, name): (usize, &str),
    (point, direction): (Vec3, Vec3),
) {
    if !room.contains(point) {
        document.complain(line, format!("{name} is out of the room, at {}; {}", at(point), walls(room)));
        return;
    }
    if let Some(inside) = draft.furniture.iter().find(|f| f.value.contains(point)) {
        let sentence = format!(
            "{name} is inside of {} (line {}), at {}; move one of them",
            inside.value.name,
            inside.line,
            at(point)
        );
        document.complain(line, sentence);
        return;
    }
    let wall = (room.distance_to_wall(point, direction), "a wall");
    let ahead = draft.furniture.iter().filter_map(|f| {
        let share = f.value.entered(point, point + direction * CLEAR_M)?;
        Some((share * CLEAR_M, f.value.name.as_str()))
    });
    let nearest = ahead.chain([wall]).min_by(|a, b| a.0.total_cmp(&b.0)).filter(|n| n.0 < CLEAR_M);
    if let Some((distance, obstacle)) = nearest {
        let sentence = format!(
            "{name} looks into {obstacle} {distance:.2} m before it: turn it (yaw_deg, pitch_deg) or move it, so that \
             {CLEAR_M} m are free"
        );
        document.complain(line, sentence);
    }
}

/// What is wrong with a place, in a sentence.
fn misplaced(draft: &Draft, room: &Room, radar: &RadarPose, place: &Place) -> Option<String> {
    let furniture = draft.furniture.iter().map(|f| &f.value);
    let fault = fault(room, radar, furniture, place)?;
    let stand = place.position;
    let who = format!("a person at [{:.2}, {:.2}]", stand.x, stand.y);
    let facing = place.facing_rad.to_degrees().round();
    let piece = |number: usize| {
        let At { line, value } = &draft.furniture[number];
        format!("{} (line {line})", value.name)
    };
    Some(match fault {
        Fault::Outside => {
            format!("{who} would be out of the room: they need {PERSON_M} m around them; {}", walls(room))
        }
        Fault::InWall => {
            format!("{who} would stand in a wall: they need {PERSON_M} m around them; {}", walls(room))
        }
        Fault::InFurniture(n) => {
            format!("{who} would stand in {}: they need {PERSON_M} m around them", piece(n))
        }
        Fault::WallBefore => format!(
            "{who} with facing_deg {facing} has a wall before them: their hands need {WORKPLACE_M} m; {}",
            walls(room)
        ),
        Fault::FurnitureBefore(n) => format!(
            "{who} with facing_deg {facing} has {} before them: their hands need {WORKPLACE_M} m for the sample's own \
             things",
            piece(n)
        ),
        Fault::Near { distance_m } => format!(
            "{who} is {distance_m:.2} m from the radar, nearer than {NEAREST_M} m: what their hands do before them would \
             reach behind it"
        ),
        Fault::OutOfSight { azimuth_rad, elevation_rad } => format!(
            "the radar does not see {who}: they are {:.0} degrees to its right and {:.0} degrees up, it sees {:.0} \
             degrees either way",
            azimuth_rad.to_degrees(),
            elevation_rad.to_degrees(),
            FIELD_OF_VIEW_RAD.to_degrees()
        ),
        Fault::Far { range_m } => format!(
            "{who} is {range_m:.2} m from the radar, past its range gate, which ends at depth_m of {:.2} m (line {}): move \
             the place nearer or raise depth_m",
            radar.depth_m, draft.depth_line
        ),
        Fault::Hidden(n) => {
            format!("the radar does not see {who}: {} stands between them", piece(n))
        }
    })
}

fn touches(room: &Room, point: Vec3) -> bool {
    let slack = Vec3::splat(TOUCH_M);
    Room { min: room.min - slack, max: room.max + slack, ..*room }.contains(point)
}

fn at(point: Vec3) -> String {
    format!("[{:.2}, {:.2}, {:.2}]", point.x, point.y, point.z)
}

/// The room's bounds for a complaint.
fn walls(room: &Room) -> String {
    let Room { min, max, .. } = room;
    format!(
        "the room has x from {} to {}, y from {} to {}, z from {} to {}",
        min.x, max.x, min.y, max.y, min.z, max.z
    )
}
