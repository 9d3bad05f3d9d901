//! The planner: the smallest profile, maps and antennas that a scene needs, and what they cost.
//!
//! In: [`Needs`], from a scene's file and a user, and [`Means`], link and board. Out: a [`Plan`], or a [`Refusal`] that
//! names what keeps everything from working.
//!
//! ```text
//! Needs --space--> configurations, small to large --check--> the first that passes --> Plan --report--> table
//!                                                    ^                                  |
//!                   limits, instructions, reader ----+                                  +--> BridgeConfig
//! ```
//!
//! | module | what it derives | from |
//! |---|---|---|
//! | [`needs`] | whether elevation is needed | heights of the scene's things against the array's beam |
//! | [`space`] | range bin, span, velocity bin | FMCW with TDM-MIMO (TI SWRA553; the paper's section 4.1) by [`rfhoi_shared::radar`] |
//! | [`instructions`] | instructions of a frame on the bridge | counts of QEMU's Cortex-M7 |
//! | [`reader`] | how often a tag is read, which speed that carries | rounds of the simulated reader, lambda / 4 v |
//! | [`limits`] | rates, bands, capacities | data sheets |
//! | [`check`] | the rules, in one place | |

pub mod check;
mod host_time;
pub mod instructions;
pub mod limits;
pub mod needs;
pub mod reader;
mod report;
pub mod search;
pub mod space;
mod uplink;

use rfhoi_shared::config::{BridgeConfig, Processing, RadarConfig, ReaderConfig};
use rfhoi_shared::radar::RadarProfile;

pub use check::{Binding, Cost, Means, Problem};
pub use host_time::host_time;
pub use needs::{Antennas, Needs};
pub use report::{Report, Text};
pub use search::Refusal;
pub use space::Config;
pub use uplink::Uplink;

use check::{LEAST_REACH_SHARE, counted};
use reader::Reading;
use space::{MAP_POINTS, profile};

/// What is to be done, and why nothing less will do.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What was needed.
    pub needs: Needs,
    /// What there was.
    pub means: Means,
    /// What is chosen.
    pub config: Config,
    /// What it costs.
    pub cost: Cost,
    /// What the bridge sends for it.
    pub uplink: Uplink,
    /// The next smaller choice of each kind, and what it breaks.
    pub smaller: Vec<(String, Binding)>,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// The smallest plan that meets `needs` with `means`.
///
/// # Errors
/// What keeps every configuration from working.
pub fn plan(needs: Needs, means: Means) -> Result<Plan, Refusal> {
    let problem = Problem::new(needs, means);
    let (config, cost) = problem.search()?;
    Ok(problem.plan_of(config, cost))
}

/// The paper's configuration (its section 4.1, maps of 256 points, four antennas) in place of that of `plan`, whether it
/// works or not.
pub fn paper(plan: &Plan) -> Plan {
    let problem = Problem::new(plan.needs.clone(), plan.means);
    let RadarProfile { array, mounting, .. } = plan.needs.radar;
    let profile = RadarProfile { array, mounting, ..RadarProfile::paper() };
    let config = Config { profile, map_points: 256, angle_points: 256, antennas: 4 };
    let cost = problem.cost(&config);
    problem.plan_of(config, cost)
}

impl Problem {
    fn plan_of(&self, config: Config, cost: Cost) -> Plan {
        let Self { needs, means, .. } = self.clone();
        let reads_s = f64::from(needs.tags) * f64::from(config.antennas) / f64::from(cost.reading.interval.0);
        let uplink = Uplink::of(&radar(&config, &needs), reads_s);
        let smaller = self.smaller(&config);
        let warnings = self.warnings(&config, &cost);
        Plan { needs, means, config, cost, uplink, smaller, warnings }
    }

    /// The configurations next to `config` that are smaller, or have an antenna more; those of one name with all slopes.
    /// With fewer samples, loops or antennas of the radar the rest of the profile follows anew, as in the search.
    pub fn neighbours(&self, config: &Config) -> Vec<(String, Config)> {
        let own = &config.profile;
        let mut neighbours = Vec::new();
        let mut derived = |name: String, array: &RadarProfile, samples: u16, loops: u16| {
            for slope in limits::slopes() {
                let profile = profile(&self.needs, array, samples, loops, slope);
                neighbours.push((name.clone(), Config { profile, ..config.clone() }));
            }
        };
        derived(format!("{} samples a chirp", own.samples / 2), own, own.samples / 2, own.loops);
        derived(format!("{} loops", own.loops / 2), own, own.samples, own.loops / 2);
        let (mut fewer_tx, rx_mask) = (own.clone(), own.rx_mask & (own.rx_mask - 1));
        fewer_tx.tx_order.pop();
        if !fewer_tx.tx_order.is_empty() {
            let name = counted(fewer_tx.tx_order.len() as u8, "transmitter");
            derived(name, &fewer_tx, own.samples, own.loops);
        }
        if rx_mask != 0 {
            let fewer_rx = RadarProfile { rx_mask, ..own.clone() };
            derived(counted(rx_mask.count_ones() as u8, "receiver"), &fewer_rx, own.samples, own.loops);
        }
        let same_chirps = RadarProfile { loops: own.loops / 2, ..own.clone() };
        neighbours.push((
            format!("{} loops of the same chirps", own.loops / 2),
            Config { profile: same_chirps, ..config.clone() },
        ));
        let below = |points: u16| MAP_POINTS.into_iter().rev().find(|&p| p < points);
        if let Some(map_points) = below(config.map_points) {
            neighbours
                .push((format!("maps of {map_points} points"), Config { map_points, ..config.clone() }));
        }
        if let Some(angle_points) = below(config.angle_points) {
            neighbours.push((
                format!("angle map of {angle_points} points"),
                Config { angle_points, ..config.clone() },
            ));
        }
        if let Antennas::UpTo(there) = self.needs.antennas
            && config.antennas < there
        {
            let antennas = config.antennas + 1;
            neighbours.push((counted(antennas, "antenna"), Config { antennas, ..config.clone() }));
        }
        neighbours
    }

    /// What each kind of neighbour breaks: of all slopes the one that comes nearest.
    fn smaller(&self, config: &Config) -> Vec<(String, Binding)> {
        let mut smaller: Vec<(String, Binding)> = Vec::new();
        for (name, config) in self.neighbours(config) {
            let Err(binding) = self.check(&config) else { continue };
            match smaller.iter_mut().find(|(known, _)| *known == name) {
                Some((_, nearest)) => *nearest = nearest.nearer(binding),
                None => smaller.push((name, binding)),
            }
        }
        smaller
    }

    fn warnings(&self, config: &Config, cost: &Cost) -> Vec<String> {
        let mut warnings = Vec::new();
        if cost.cubes < 2 {
            warnings.push(
                "the board holds one cube of two: a frame that begins before the last is done is lost, up to every second \
                 one"
                .to_owned(),
            );
        }
        let Reading { reach_share, carried, .. } = cost.reading;
        if reach_share < LEAST_REACH_SHARE {
            let few = self.most_antennas();
            let remedy =
                few.map_or_else(String::new, |few| format!(" ({} would do)", counted(few, "antenna")));
            warnings.push(format!(
                "with {} a tag is followed at all times to {:.2} m/s only, and in {:.0} % of the fastest reach: less than \
                 half{remedy}",
                counted(config.antennas, "antenna"),
                carried.0,
                100.0 * reach_share
            ));
        }
        warnings
    }
}

/// The radar of a bridge with `config`.
fn radar(config: &Config, needs: &Needs) -> RadarConfig {
    let profile = config.profile.clone();
    let processing = Processing::with_gate(&profile, profile.gate_to(needs.depth));
    RadarConfig { profile, processing, ..BridgeConfig::default().radar }
}

impl Plan {
    /// The bridge's configuration, with a reader at `address` if there is one; all that a plan does not decide is as by
    /// default.
    pub fn bridge(&self, address: Option<rfhoi_shared::config::Endpoint>) -> BridgeConfig {
        let scene = self.needs.scene(self.config.antennas);
        let reader = address
            .map(|endpoint| ReaderConfig { endpoint, ..ReaderConfig::for_scene(endpoint.address, &scene) });
        BridgeConfig { radar: radar(&self.config, &self.needs), reader, scene, ..BridgeConfig::default() }
    }
}

#[cfg(test)]
mod tests;
