//! What scenes cost as they need and as the paper would have it, by the planner: beside the study of their accuracy.

use std::fmt::Write as _;

use anyhow::Context;
use rfhoi::plan::{Means, Needs, Plan, host_time, paper, plan};
use rfhoi::simulate::scene::Scene;
use serde::{Deserialize, Serialize};

use super::sets::SCENES;

/// Of the study of the scenes' accuracy.
pub(super) const NAME: &str = "scenes";

/// A scene's costs.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Costs {
    pub(super) scene: String,
    pub(super) as_needed: Cost,
    pub(super) as_paper: Cost,
}

/// Of one configuration: profile, maps, antennas of the reader.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Cost {
    pub(super) configuration: String,
    /// From the radar to the bridge.
    radar_link_mbit_s: f64,
    /// A gated cube on the bridge, and how many of two fit.
    cube_kb: f64,
    cubes: u8,
    /// Of a frame on the bridge.
    mcu_instructions: f64,
    /// From the bridge to the host, with reads.
    host_link_mbit_s: f64,
    /// Values of a frame's maps.
    map_values: f64,
    /// From a frame's packets to its maps, on this computer.
    host_us: f64,
}

/// Of all scenes of the study.
pub(super) fn costs() -> anyhow::Result<Vec<Costs>> {
    SCENES
        .iter()
        .map(|seen| {
            let scene = Scene::load_without_profile(seen.scene)?;
            let planned = plan(Needs::of(&scene), Means::default()).with_context(|| scene.name.clone())?;
            let as_paper = Cost::of(&paper(&planned));
            Ok(Costs { scene: seen.scene.to_owned(), as_needed: Cost::of(&planned), as_paper })
        })
        .collect()
}

impl Cost {
    fn of(plan: &Plan) -> Self {
        let Plan { config, cost, uplink, .. } = plan;
        let profile = &config.profile;
        Self {
            configuration: format!(
                "{} x {} samples, maps of {}, angle map of {}, {} antennas",
                profile.loops, profile.samples, config.map_points, config.angle_points, config.antennas
            ),
            radar_link_mbit_s: cost.link_bit_s / 1e6,
            cube_kb: f64::from(cost.cube_bytes) / 1e3,
            cubes: cost.cubes,
            mcu_instructions: cost.instructions.total().round(),
            host_link_mbit_s: uplink.bit_s / 1e6,
            map_values: f64::from(cost.map_values),
            host_us: host_time(plan).as_secs_f64() * 1e6,
        }
    }

    /// What of `self` is saved of `of`, by name.
    fn rows(&self, of: &Self) -> [(&'static str, f64, f64); 6] {
        [
            ("radar's link, Mbit/s", self.radar_link_mbit_s, of.radar_link_mbit_s),
            ("a cube on the bridge, kB", self.cube_kb, of.cube_kb),
            ("bridge, million instructions a frame", self.mcu_instructions / 1e6, of.mcu_instructions / 1e6),
            ("to the host, Mbit/s", self.host_link_mbit_s, of.host_link_mbit_s),
            ("values of a frame's maps", self.map_values, of.map_values),
            ("packets to maps on the host, us", self.host_us, of.host_us),
        ]
    }
}

/// As a table in Markdown.
pub(super) fn page(costs: &[Costs]) -> String {
    let mut page = "\n|scene||as it needs|the paper's|saved|\n|---|---|---|---|---|\n".to_owned();
    for Costs { scene, as_needed, as_paper } in costs {
        let _ = writeln!(
            page,
            "|{scene}|loops x samples, maps, antennas|{}|{}||",
            as_needed.configuration, as_paper.configuration
        );
        let _ = writeln!(
            page,
            "||cubes that fit on the bridge; 2 lose no frame, 0 do not run|{}|{}||",
            as_needed.cubes, as_paper.cubes
        );
        for (name, ours, theirs) in as_needed.rows(as_paper) {
            let saved = 100.0 * (1.0 - ours / theirs);
            let _ = writeln!(page, "||{name}|{ours:.2}|{theirs:.2}|{saved:.0} %|");
        }
    }
    page.push_str("\nCosts are the planner's (`rfhoi plan SCENE --compare`); both networks of a row are of the same shape, see above.\n");
    page
}
