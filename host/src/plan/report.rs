//! A plan for people, as a table, and for programs.

use std::fmt::{self, Write};
use std::time::Duration;

use rfhoi_shared::radar::RadarProfile;
use serde::Serialize;

use super::check::{BINS_A_POINT, counted};
use super::instructions::Instructions;
use super::needs::{Antennas, beam_rad};
use super::reader::Reading;
use super::uplink::Uplink;
use super::{Means, Needs, Plan, Problem};
use crate::profile::NAMES;
use crate::simulate::scene::SAMPLE_TAGS;

/// A plan as text.
#[derive(Debug)]
pub struct Text<'a> {
    /// The scene's name.
    pub scene: &'a str,
    /// The plan.
    pub plan: &'a Plan,
    /// What this computer takes for a frame, if it was measured.
    pub host: Option<Duration>,
    /// A plan to compare with, and the same time.
    pub beside: Option<(&'a Plan, Option<Duration>)>,
}

/// A plan as one object.
#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "the names say what, with units")]
pub struct Report {
    pub scene: String,
    pub needs: NeedsReport,
    pub profile: ProfileReport,
    pub map_points: u16,
    pub angle_points: u16,
    pub antennas: u8,
    pub reading: Reading,
    pub costs: Costs,
    pub smaller: Vec<Smaller>,
    pub warnings: Vec<String>,
    pub paper: Option<Costs>,
}

#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "as above")]
pub struct NeedsReport {
    pub depth_m: f32,
    pub fastest_hand_m_s: f32,
    pub fastest_tag_m_s: f32,
    pub tags: u8,
    pub antennas: Antennas,
    pub range_resolution_m: f32,
    pub velocity_resolution_m_s: f32,
    pub azimuth: bool,
    pub elevation: bool,
    pub elevation_because: String,
}

#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "as above")]
pub struct ProfileReport {
    pub name: Option<&'static str>,
    pub transmitters: usize,
    pub receivers: usize,
    pub samples: u16,
    pub sample_rate_ksps: u32,
    pub slope_khz_per_us: u32,
    pub idle_ns: u32,
    pub ramp_end_ns: u32,
    pub loops: u16,
    pub frame_period_us: u32,
    pub gate_bins: u16,
    pub range_bin_m: f32,
    pub range_span_m: f32,
    pub velocity_bin_m_s: f32,
    pub velocity_span_m_s: f32,
}

#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "as above")]
pub struct Costs {
    pub raw_frame_bytes: u32,
    pub link_bit_s: f64,
    pub link_share: f64,
    pub cube_bytes: u32,
    pub cubes: u8,
    pub memory_share: f64,
    pub instructions: f64,
    pub instructions_share: f64,
    pub stages: Instructions,
    pub uplink: Uplink,
    pub map_values: u32,
    pub host_us: Option<f64>,
}

#[derive(Debug, Serialize)]
#[allow(missing_docs, reason = "as above")]
pub struct Smaller {
    pub choice: String,
    pub breaks: String,
}

impl Costs {
    /// The costs of `plan`, and what this computer takes.
    pub fn of(plan: &Plan, host: Option<Duration>) -> Self {
        let Plan { means: Means { link, board }, config, cost, uplink, .. } = plan;
        Self {
            raw_frame_bytes: config.profile.frame_bytes(),
            link_bit_s: cost.link_bit_s,
            link_share: cost.link_bit_s / link.capacity_bit_s(),
            cube_bytes: cost.cube_bytes,
            cubes: cost.cubes,
            memory_share: f64::from(cost.cube_bytes) * f64::from(cost.cubes.max(1))
                / f64::from(board.cube_bytes),
            instructions: cost.instructions.total(),
            instructions_share: cost.instructions.total() / cost.instructions_there,
            stages: cost.instructions,
            uplink: *uplink,
            map_values: cost.map_values,
            host_us: host.map(|time| time.as_secs_f64() * 1e6),
        }
    }
}

impl Report {
    /// Everything that [`Text`] says.
    pub fn of(text: &Text<'_>) -> Self {
        let Text { scene, plan, host, beside } = text;
        let Needs { depth, fastest_hand, fastest_tag, tags, antennas, azimuth, elevation, .. } = &plan.needs;
        let profile = &plan.config.profile;
        Self {
            scene: (*scene).to_owned(),
            needs: NeedsReport {
                depth_m: depth.0,
                fastest_hand_m_s: fastest_hand.0,
                fastest_tag_m_s: fastest_tag.0,
                tags: *tags,
                antennas: *antennas,
                range_resolution_m: plan.needs.range_resolution.0,
                velocity_resolution_m_s: plan.needs.velocity_resolution.0,
                azimuth: *azimuth,
                elevation: *elevation,
                elevation_because: plan.needs.elevation_because.clone(),
            },
            profile: ProfileReport {
                name: name(profile),
                transmitters: profile.tx_slots(),
                receivers: profile.rx_count(),
                samples: profile.samples,
                sample_rate_ksps: profile.sample_rate_ksps,
                slope_khz_per_us: profile.slope_khz_per_us,
                idle_ns: profile.idle_ns,
                ramp_end_ns: profile.ramp_end_ns,
                loops: profile.loops,
                frame_period_us: profile.frame_period_us,
                gate_bins: profile.gate_to(*depth).bins,
                range_bin_m: profile.range_bin().0,
                range_span_m: profile.range_span().0,
                velocity_bin_m_s: profile.velocity_bin().0,
                velocity_span_m_s: profile.velocity_span().0,
            },
            map_points: plan.config.map_points,
            angle_points: plan.config.angle_points,
            antennas: plan.config.antennas,
            reading: plan.cost.reading,
            costs: Costs::of(plan, *host),
            smaller: plan
                .smaller
                .iter()
                .map(|(choice, binding)| Smaller { choice: choice.clone(), breaks: binding.to_string() })
                .collect(),
            warnings: plan.warnings.clone(),
            paper: beside.map(|(plan, host)| Costs::of(plan, host)),
        }
    }
}

/// The shipped profile that this is, its board and mounting aside.
fn name(profile: &RadarProfile) -> Option<&'static str> {
    let same = |name: &&str| {
        let shipped = RadarProfile::named(name);
        let RadarProfile { array, mounting, format, .. } = *profile;
        shipped.is_some_and(|shipped| RadarProfile { array, mounting, format, ..shipped } == *profile)
    };
    NAMES.into_iter().find(same)
}

/// Columns of text, as wide as their widest cell but for the last.
fn table(f: &mut fmt::Formatter<'_>, rows: &[Vec<String>]) -> fmt::Result {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    for row in rows {
        let mut line = String::new();
        for (cell, width) in row.iter().zip(&widths) {
            write!(line, "{cell:width$}  ")?;
        }
        writeln!(f, "{}", line.trim_end())?;
    }
    Ok(())
}

fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).to_vec()
}

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, plan, host, beside } = self;
        let config = &plan.config;
        let profile = match name(&config.profile) {
            Some(name) => format!("profile `{name}`"),
            None => "a profile of its own".to_owned(),
        };
        writeln!(
            f,
            "{scene}: {profile}, maps of {} points, angle map of {}, {} of the reader\n",
            config.map_points,
            config.angle_points,
            counted(config.antennas, "antenna")
        )?;
        table(f, &choices(plan))?;
        writeln!(f)?;
        let paper = beside.map(|(paper, host)| (Costs::of(paper, host), paper));
        table(f, &costs(&Costs::of(plan, *host), plan, paper.as_ref()))?;
        writeln!(f)?;
        let mut smaller = vec![row(["what would not do", "why"])];
        smaller
            .extend(plan.smaller.iter().map(|(choice, binding)| vec![choice.clone(), binding.to_string()]));
        table(f, &smaller)?;
        for warning in &plan.warnings {
            writeln!(f, "\nwarning: {warning}")?;
        }
        Ok(())
    }
}

/// Need, choice, why.
fn choices(plan: &Plan) -> Vec<Vec<String>> {
    let Plan { needs, config, cost, .. } = plan;
    let profile = &config.profile;
    let gate = profile.gate_to(needs.depth);
    let mut rows = vec![row(["need", "choice", "why"])];
    let mut add = |need: String, choice: String, why: String| rows.push(vec![need, choice, why]);
    add(
        format!("range to {:.1} cm", needs.range_resolution.0 * 100.0),
        format!(
            "{:.2} GHz at {} MHz/us",
            profile.sampled_bandwidth_hz() / 1e9,
            profile.slope_khz_per_us / 1_000
        ),
        format!("bin c / 2B = {:.2} cm", profile.range_bin().0 * 100.0),
    );
    add(
        format!("depth {:.2} m", needs.depth.0),
        format!("{} samples at {} ksps", profile.samples, profile.sample_rate_ksps),
        format!("spans {:.2} m, {} bins are kept", profile.range_span().0, gate.bins),
    );
    add(
        if needs.elevation { "elevation".to_owned() } else { "no elevation".to_owned() },
        format!(
            "{} x {}",
            counted(profile.tx_slots() as u8, "transmitter"),
            counted(profile.rx_count() as u8, "receiver")
        ),
        needs.elevation_because.clone(),
    );
    add(
        format!("hands to {:.1} m/s", needs.fastest_hand.0),
        format!("a chirp each {:.1} us", profile.chirp_period_ns() as f64 * 1e-3),
        format!("lambda / 4TM = {:.2} m/s either way", profile.velocity_span().0),
    );
    add(
        format!("speed to {:.1} cm/s", needs.velocity_resolution.0 * 100.0),
        format!("{} loops in {} ms", profile.loops, profile.frame_period_us / 1_000),
        format!(
            "bin {:.1} cm/s, {:.1} ms on air",
            profile.velocity_bin().0 * 100.0,
            profile.frame_active_ns() as f64 * 1e-6
        ),
    );
    add(
        format!("{} x {} bins", gate.bins, profile.loops),
        format!("maps of {0} x {0} points", config.map_points),
        format!(
            "at most {BINS_A_POINT} bins a point, the width of a Hann window; below 1 points only interpolate"
        ),
    );
    let beam = beam_rad(profile, |at| at.azimuth).to_degrees();
    add(
        format!("beams of {beam:.0} degrees"),
        format!("angle map of {0} x {0} points", config.angle_points),
        "two points or more in a beam".to_owned(),
    );
    let Reading { interval, longest, carried, reach_share, sure_share, .. } = cost.reading;
    add(
        format!("{}, to {:.1} m/s", counted(needs.tags, "tag"), needs.fastest_tag.0),
        match needs.antennas {
            Antennas::UpTo(there) => format!("{} of {}", config.antennas, counted(there, "antenna")),
            Antennas::Exactly(_) => format!("{}, as asked", counted(config.antennas, "antenna")),
        },
        format!("each reads a tag every {:.0} ms, with gaps of {:.0} ms", interval.0 * 1e3, longest.0 * 1e3),
    );
    add(
        String::new(),
        "RF mode 0, session 1, dual target".to_owned(),
        format!(
            "steps of phase mean something in {:.0} % of a reach ({:.0} % whatever its speed), to {:.2} m/s always",
            100.0 * reach_share,
            100.0 * sure_share,
            carried.0
        ),
    );
    if usize::from(needs.tags) > SAMPLE_TAGS {
        add(String::new(), String::new(), of_a_sample(plan));
    }
    rows
}

/// What the reader could do with the tags of one sample.
fn of_a_sample(plan: &Plan) -> String {
    let needs = Needs { tags: SAMPLE_TAGS as u8, ..plan.needs.clone() };
    let problem = Problem::new(needs, plan.means);
    let most = problem.most_antennas();
    let antennas = most.map_or_else(|| "none".to_owned(), |n| counted(n, "antenna"));
    format!("with {SAMPLE_TAGS} tags in the field, as in a sample: {antennas}")
}

/// Cost, limit, share; the same of another plan, and what is saved.
fn costs(costs: &Costs, plan: &Plan, other: Option<&(Costs, &Plan)>) -> Vec<Vec<String>> {
    let Plan { means: Means { link, board }, cost, .. } = plan;
    let mut head = row(["cost", "", "of", "share"]);
    if other.is_some() {
        head.extend(row(["the paper's", "saved"]));
    }
    let mut rows = vec![head];
    let mut add =
        |name: &str, unit: &str, of: String, whole: f64, of_costs: &dyn Fn(&Costs) -> Option<f64>| {
            let Some(value) = of_costs(costs) else { return };
            let share = if whole > 0.0 { format!("{:.0} %", 100.0 * value / whole) } else { String::new() };
            let mut cells = vec![name.to_owned(), shown(value, unit), of, share];
            if let Some(theirs) = other.and_then(|(theirs, _)| of_costs(theirs)) {
                cells.push(shown(theirs, unit));
                cells.push(format!("{:.0} %", 100.0 * (1.0 - value / theirs)));
            }
            rows.push(cells);
        };
    let capacity = link.capacity_bit_s() / 1e6;
    add("link", "Mbit/s", link.to_string(), capacity, &|c| Some(c.link_bit_s / 1e6));
    let cubes = f64::from(cost.cubes.max(1));
    let memory = format!(
        "{} of {:.0} kB, {}",
        board.name,
        f64::from(board.cube_bytes) / 1e3,
        counted(cost.cubes, "cube")
    );
    add("memory", "kB a cube", memory, f64::from(board.cube_bytes) / 1e3 / cubes, &|c| {
        Some(f64::from(c.cube_bytes) / 1e3)
    });
    let there = cost.instructions_there / 1e6;
    let budget = format!("{there:.0} million in a frame");
    add("instructions", "million", budget, there, &|c| Some(c.instructions / 1e6));
    add("uplink", "bytes a frame", String::new(), 0.0, &|c| Some(c.uplink.frame_bytes as f64));
    let reads = format!("{:.0} reads/s", costs.uplink.reads_s);
    add("with reads", "Mbit/s", reads, 0.0, &|c| Some(c.uplink.bit_s / 1e6));
    add("model input", "values a frame", String::new(), 0.0, &|c| Some(f64::from(c.map_values)));
    add("this computer", "us a frame", "receive, angle map".to_owned(), 0.0, &|c| c.host_us);
    rows
}

fn shown(value: f64, unit: &str) -> String {
    if value >= 100.0 { format!("{value:.0} {unit}") } else { format!("{value:.2} {unit}") }
}
