//! The configurations of the chart.

use rfhoi::features::AngleMap;
use rfhoi_network::config::{Encoder, NetworkConfig};
use serde::{Deserialize, Serialize};

use crate::commands::experiment::study::plan::{Plan, Shape};
use crate::commands::experiment::study::sets::{
    self, BRIDGE, FEWER_LOOPS, FEWER_SAMPLES, FEWER_TRANSMITTERS, Radar,
};

/// In what a configuration differs from the default.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Varied {
    /// Widths, layers, tokens, encoder.
    Network,
    /// Points of the maps.
    Maps,
    /// How the angle map is made.
    Angles,
    /// Antennas of the reader.
    Antennas,
    /// The radar's profile.
    Radar,
    /// The network, its maps and angles at a time.
    All,
}

/// A configuration and what is trained for it.
pub(super) struct Point {
    pub(super) name: String,
    /// Nothing is the default.
    pub(super) varied: Option<Varied>,
    pub(super) radar: Radar,
    /// Each run's folder, and the key of its test.
    pub(super) runs: Vec<(String, String)>,
}

/// The smallest maps that there are, points.
const LEAST_POINTS: usize = 16;

/// All of them, planned.
pub(super) fn points(plan: &mut Plan) -> anyhow::Result<Vec<Point>> {
    let usual = plan.scale.network.clone();
    let half = (usual.points / 2).max(LEAST_POINTS);
    let changed = |change: &dyn Fn(&mut NetworkConfig)| {
        let mut network = usual.clone();
        change(&mut network);
        Shape::from(&network)
    };
    let angles = |angle| Shape { angle, ..Shape::from(&usual) };
    let tokens = |radar: usize, tags: usize| {
        changed(&|network| (network.radar.stack, network.tags.stack) = (radar, tags))
    };
    let width = |factor: f64| {
        changed(&|network| {
            for branch in [&mut network.radar, &mut network.tags] {
                branch.width = (branch.width as f64 * factor) as usize;
                branch.feed_forward = 2 * branch.width;
            }
        })
    };
    let layers =
        |layers: usize| changed(&|network| (network.radar.layers, network.tags.layers) = (layers, layers));
    let antennas = |antennas: usize| changed(&|network| network.antennas = antennas);
    // As many values of a map as the default has.
    let encoder = Encoder::Convolutions { channels: [4, 8], strides: [2, 2], pool: 1 };
    // A square of 8 points spans as much as one of 4 does on half as many.
    let finer = Encoder::Patches { size: 8, channels: 8 };
    let smallest = Shape {
        angle: AngleMap::None,
        ..changed(&|network| {
            network.points = half;
            network.maps[2] = false;
            (network.radar.stack, network.tags.stack) = (4, 6);
            for branch in [&mut network.radar, &mut network.tags] {
                (branch.width, branch.layers) = (branch.width / 2, 1);
                branch.feed_forward = 2 * branch.width;
            }
        })
    };
    let without_angles = Shape { angle: AngleMap::None, ..changed(&|network| network.maps[2] = false) };
    use Varied::{All, Angles, Antennas, Maps, Network};
    let side = |points: usize| format!("maps of {points}");
    let wide = |factor: f64| format!("width {}", usual.radar.width as f64 * factor);
    let named = |name: &str| name.to_owned();
    let networks = [
        (named("tokens of 1 and 1 frames"), Network, tokens(1, 1)),
        (named("tokens of 1 and 2 frames"), Network, tokens(1, 2)),
        (named("tokens of 4 and 6 frames"), Network, tokens(4, 6)),
        (wide(0.5), Network, width(0.5)),
        (wide(2.0), Network, width(2.0)),
        (named("1 layer"), Network, layers(1)),
        (named("3 layers"), Network, layers(3)),
        (named("convolutions"), Network, changed(&|network| network.encoder = encoder)),
        (side(half), Maps, changed(&|network| network.points = half)),
        (
            side(2 * usual.points),
            Maps,
            changed(&|network| (network.points, network.encoder) = (2 * network.points, finer)),
        ),
        (named("no angles"), Angles, without_angles),
        (named("Capon"), Angles, angles(AngleMap::Capon)),
        (named("MUSIC"), Angles, angles(AngleMap::Music)),
        (named("1 antenna"), Antennas, antennas(1)),
        (named("2 antennas"), Antennas, antennas(2)),
        (named("3 antennas"), Antennas, antennas(3)),
        (named("smallest"), All, smallest),
    ];
    let default = (named("default"), None, BRIDGE, Shape::from(&usual));
    let networks = networks.into_iter().map(|(name, varied, shape)| (name, Some(varied), BRIDGE, shape));
    let radars =
        [("32 loops", FEWER_LOOPS), ("64 samples", FEWER_SAMPLES), ("2 transmitters", FEWER_TRANSMITTERS)];
    let radars = radars.map(|(name, radar)| (named(name), Some(Varied::Radar), radar, Shape::from(&usual)));
    let all: Vec<_> = std::iter::once(default).chain(networks).chain(radars).collect();
    all.into_iter()
        .map(|(name, varied, radar, shape)| {
            let runs = runs(plan, radar.set, &shape)?;
            Ok(Point { name, varied, radar, runs })
        })
        .collect()
}

/// Pre-trained with the default radar, fine-tuned on `set`, once with each seed; in both precisions.
fn runs(plan: &mut Plan, set: &'static str, shape: &Shape) -> anyhow::Result<Vec<(String, String)>> {
    let mut runs = Vec::new();
    for seed in 1..=plan.scale.seeds {
        // All sets of the site have the same performances, so the same samples are learnt and tested.
        let split = plan.split(sets::SITE, seed)?;
        let test = plan.test("site", set, split.test)?;
        let key = test.key();
        let from = plan.pre_train(shape.clone(), 1.0, |_| {})?;
        let folder =
            plan.fine_tune(shape.clone(), from, (set, split.learn), vec![test], |r| r.seed = seed)?;
        plan.quantise(&folder);
        runs.push((folder, key));
    }
    Ok(runs)
}
