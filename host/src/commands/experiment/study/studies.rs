//! What each study compares, and what the paper found.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rfhoi::features::set::Listed;
use rfhoi::hoi::{Action, CATEGORIES, Category};
use rfhoi_network::config::{Beams, Fusion, NetworkConfig, Temporal};
use rfhoi_network::train::Recipe;

use super::plan::{Before, Plan, USUAL};
use super::run::Test;
use super::scenes;
use super::sets::{self, Seen};
use super::table::{Arm, At};

/// Shares of the site's samples to learn from, of those that are there.
const SHARES: [f64; 4] = [0.17, 0.33, 0.67, 1.0];
/// Both ways to begin.
const BEFORE: [(&str, Before); 2] = [("pre-trained", Before::PreTrained), ("from scratch", Before::Scratch)];

/// Some arms held against each other.
#[derive(Debug)]
pub(in super::super) struct Study {
    /// As in the command and in names of files.
    pub(super) name: &'static str,
    /// In the command's help and above the table.
    pub(super) title: &'static str,
    /// Of the paper.
    pub(super) section: &'static str,
    /// What the arms are arranged by.
    pub(super) axis: &'static str,
    /// Plans what it compares.
    pub(super) arms: fn(&mut Plan) -> anyhow::Result<Vec<Arm>>,
}

/// All of them, as help and report have them.
pub(in super::super) static STUDIES: [Study; 15] = [
    Study {
        name: "modality",
        title: "What each radio brings, against the amount of fine-tuning data",
        section: "5.2",
        axis: "of the samples to fine-tune on, %",
        arms: modality,
    },
    Study {
        name: "pre-training",
        title: "With and without pre-training, against the amount of fine-tuning data",
        section: "5.4.3",
        axis: "of the samples to fine-tune on, %",
        arms: pre_training,
    },
    Study {
        name: "setups",
        title: "Setups that were not learnt from, against how many were, five samples of each",
        section: "5.4.4",
        axis: "setups that were learnt from",
        arms: setups,
    },
    Study {
        name: "factors",
        title: "Samples of one value of a factor, which was learnt from or kept out",
        section: "2.2",
        axis: "factor",
        arms: factors,
    },
    Study {
        name: "pairs",
        title: "Pairs of an action and an object that were not fine-tuned on, though each of both was",
        section: "5.4.1",
        axis: "pairs that were kept out",
        arms: pairs,
    },
    Study {
        name: "objects",
        title: "Picking up and putting down things that were never learnt from",
        section: "5.4.2",
        axis: "objects",
        arms: objects,
    },
    Study {
        name: "fusion",
        title: "How the branches are joined",
        section: "5.5.1",
        axis: "fusion",
        arms: fusion,
    },
    Study {
        name: "encoders",
        title: "Encoders of the radar, from scratch",
        section: "5.5.2",
        axis: "encoder",
        arms: encoders,
    },
    Study {
        name: "antennas",
        title: "Antennas of the reader, from scratch",
        section: "5.5.3",
        axis: "antennas",
        arms: antennas,
    },
    Study {
        name: "loss-weight",
        title: "Weight of the target's loss beside the action's, from scratch",
        section: "5.5.4",
        axis: "weight",
        arms: loss_weight,
    },
    Study {
        name: "synthetic",
        title: "Amount of simulated data to pre-train on",
        section: "5.5.5",
        axis: "of the pre-training samples, %",
        arms: synthetic,
    },
    Study {
        name: "occlusion",
        title: "The target's tag under the hand, other things behind the person; the same performances",
        section: "5.6.1",
        axis: "occlusion",
        arms: occlusion,
    },
    Study {
        name: "second-person",
        title: "Somebody else busy in the room; the same performances",
        section: "5.6.2",
        axis: "people",
        arms: second_person,
    },
    Study {
        name: "fine-tuning",
        title: "Time to fine-tune, on one core of the machine that the report names",
        section: "5.7.1",
        axis: "fine-tuning, s",
        arms: fine_tuning,
    },
    Study {
        name: scenes::NAME,
        title: "No more than a scene needs: the planner's radar and the paper's",
        section: "4.1",
        axis: "scene",
        arms: scenes,
    },
];

fn first(samples: &[usize], share: f64) -> Vec<usize> {
    samples[..((samples.len() as f64 * share).round() as usize).clamp(1, samples.len())].to_vec()
}

fn seeds(plan: &Plan) -> std::ops::RangeInclusive<u64> {
    1..=plan.scale.seeds
}

/// Learns `network` from samples once, and tests it; gives the run's folder and the key of its test.
fn once(
    plan: &mut Plan,
    network: &NetworkConfig,
    before: Before,
    learn: (&'static str, Vec<usize>),
    test: Test,
    change: impl FnOnce(&mut Recipe),
) -> anyhow::Result<(String, String)> {
    let key = test.key();
    Ok((plan.learn(network, before, learn, vec![test], change)?, key))
}

/// The site's samples, of which a share of those to be learnt from is learnt, once with each seed.
fn on_site(
    plan: &mut Plan,
    network: &NetworkConfig,
    before: Before,
    share: f64,
    change: impl Fn(&mut Recipe),
) -> anyhow::Result<Vec<(String, String)>> {
    seeds(plan)
        .map(|seed| {
            let split = plan.split(sets::SITE, seed)?;
            let test = plan.test("site", sets::SITE, split.test)?;
            let learn = (sets::SITE, first(&split.learn, share));
            once(plan, network, before, learn, test, |recipe| {
                recipe.seed = seed;
                change(recipe);
            })
        })
        .collect()
}

fn modality(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let networks = [
        ("fusion", Fusion::Concat, 96.97),
        ("no fusion", Fusion::None, 77.10),
        ("tags alone", Fusion::Rfid, 60.90),
        ("radar alone", Fusion::Radar, 16.91),
    ];
    let mut arms = Vec::new();
    for (series, fusion, paper) in networks {
        let network = NetworkConfig { fusion, ..plan.scale.network.clone() };
        for share in SHARES {
            let runs = on_site(plan, &network, Before::PreTrained, share, |_| {})?;
            if share == 1.0 {
                runs.iter().for_each(|(folder, _)| plan.quantise(folder));
            }
            let paper = (share == 1.0).then_some(paper);
            arms.push(Arm { series: series.into(), at: At::Number(100.0 * share), runs, paper });
        }
    }
    Ok(arms)
}

fn pre_training(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let mut arms = Vec::new();
    for (series, before) in BEFORE {
        for share in SHARES {
            let runs = on_site(plan, &network, before, share, |_| {})?;
            arms.push(Arm { series: series.into(), at: At::Number(100.0 * share), runs, paper: None });
        }
    }
    Ok(arms)
}

/// Samples of each setup that are learnt from (section 5.4.4 of the paper).
const OF_A_SETUP: usize = 5;

fn setups(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let samples = plan.listing(sets::SETUPS)?.samples.clone();
    let there = samples.iter().filter_map(|sample| sample.setup.number).max().map_or(0, |most| most + 1);
    let mut arms = Vec::new();
    for (series, before) in BEFORE {
        for seen in [20, 40, 60] {
            let mut runs = Vec::new();
            for seed in seeds(plan) {
                let mut order: Vec<usize> = (0..there).collect();
                order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
                let seen = &order[..seen.min(there - 1)];
                let of = |setup: usize| {
                    let own = samples.iter().enumerate().filter(move |(_, s)| s.setup.number == Some(setup));
                    own.map(|(number, _)| number)
                };
                let learn = seen.iter().flat_map(|&setup| of(setup).take(OF_A_SETUP)).collect();
                let others = order[seen.len()..].iter().flat_map(|&setup| of(setup)).collect();
                let test = plan.test("unseen setups", sets::SETUPS, others)?;
                runs.push(once(plan, &network, before, (sets::SETUPS, learn), test, |r| r.seed = seed)?);
            }
            arms.push(Arm { series: series.into(), at: At::Number(seen as f64), runs, paper: None });
        }
    }
    Ok(arms)
}

/// A factor, and whether a sample has the value of it that is kept out.
type Factor = (&'static str, fn(&Listed) -> bool);

/// Each has about a fifth of the samples or more.
const FACTORS: [Factor; 4] = [
    ("orientation", |sample| sample.setup.pose.facing_deg > 50.0),
    ("distance", |sample| sample.setup.pose.distance_m > 2.2),
    ("person", |sample| sample.setup.person == 0),
    ("room", |sample| sample.setup.scene == 2),
];

fn factors(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let samples = plan.listing(sets::SITE)?.samples.clone();
    let mut arms = Vec::new();
    for (way, before) in BEFORE {
        for seen in [true, false] {
            for (name, has) in FACTORS {
                let mut runs = Vec::new();
                for seed in seeds(plan) {
                    let split = plan.split(sets::SITE, seed)?;
                    let kept_out = split.learn.iter().copied().filter(|&n| !has(&samples[n]));
                    let mut learn: Vec<usize> = kept_out.collect();
                    if seen {
                        // As many, of all values.
                        learn = split.learn[..learn.len()].to_vec();
                    }
                    let test = split.test.into_iter().filter(|&n| has(&samples[n])).collect();
                    let test = plan.test(name, sets::SITE, test)?;
                    runs.push(once(plan, &network, before, (sets::SITE, learn), test, |r| r.seed = seed)?);
                }
                let series = format!("{way}, {}", if seen { "seen" } else { "unseen" });
                arms.push(Arm { series, at: At::Label(name.into()), runs, paper: None });
            }
        }
    }
    Ok(arms)
}

/// Some categories without which all actions and all objects are still there.
fn kept_out(count: usize, seed: u64) -> Vec<Category> {
    let mut order = CATEGORIES.to_vec();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let mut out: Vec<Category> = Vec::new();
    for category in order {
        let left = |other: &&Category| **other != category && !out.contains(other);
        let action = CATEGORIES.iter().filter(left).any(|other| other.action == category.action);
        let object = CATEGORIES.iter().filter(left).any(|other| other.object == category.object);
        if out.len() < count && action && object {
            out.push(category);
        }
    }
    out
}

fn is_of(sample: &Listed, categories: &[Category]) -> bool {
    let of = |label| categories.iter().any(|c| (c.action.index(), c.object.index()) == label);
    sample.label.is_some_and(of)
}

fn pairs(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let samples = plan.listing(sets::SITE)?.samples.clone();
    let mut arms = Vec::new();
    for (series, before) in BEFORE {
        for count in [1, 2, 3, 4, 5] {
            let mut runs = Vec::new();
            for seed in seeds(plan) {
                let out = kept_out(count, 100 * count as u64 + seed);
                let split = plan.split(sets::SITE, seed)?;
                let learn = split.learn.into_iter().filter(|&n| !is_of(&samples[n], &out)).collect();
                let test = split.test.into_iter().filter(|&n| is_of(&samples[n], &out)).collect();
                let test = plan.test("unseen pairs", sets::SITE, test)?;
                runs.push(once(plan, &network, before, (sets::SITE, learn), test, |r| r.seed = seed)?);
            }
            let paper = (count == 5 && before == Before::PreTrained).then_some(81.25);
            arms.push(Arm { series: series.into(), at: At::Number(count as f64), runs, paper });
        }
    }
    Ok(arms)
}

fn objects(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let unseen = plan.which(sets::UNSEEN, |_| true)?;
    let seen = plan.listing(sets::SITE)?.samples.clone();
    let moved = |sample: &Listed| {
        let agnostic = |action: usize| Action::ALL[action].is_object_agnostic();
        sample.label.is_some_and(|(action, _)| agnostic(action))
    };
    let mut arms = Vec::new();
    for (series, expanded) in [("as it is", false), ("names replaced (algorithm 1)", true)] {
        let renaming = move |recipe: &mut Recipe| {
            if !expanded {
                recipe.augment.rename = 0.0;
            }
        };
        let from = plan.pre_train(&network, 1.0, renaming)?;
        let mut runs: [Vec<(String, String)>; 2] = Default::default();
        for seed in seeds(plan) {
            let split = plan.split(sets::SITE, seed)?;
            let same = split.test.into_iter().filter(|&n| moved(&seen[n])).collect();
            let tests =
                [plan.test("seen", sets::SITE, same)?, plan.test("unseen", sets::UNSEEN, unseen.clone())?];
            let keys = tests.each_ref().map(|test| test.key());
            let learn = (sets::SITE, split.learn);
            let recipe = |recipe: &mut Recipe| {
                recipe.seed = seed;
                renaming(recipe);
            };
            let folder = plan.fine_tune(&network, from.clone(), learn, tests.into(), recipe)?;
            for (runs, key) in runs.iter_mut().zip(keys) {
                runs.push((folder.clone(), key));
            }
        }
        let paper = if expanded { [90.5, 93.1] } else { [94.5, 71.3] };
        for ((at, runs), paper) in ["seen objects", "unseen objects"].into_iter().zip(runs).zip(paper) {
            arms.push(Arm { series: series.into(), at: At::Label(at.into()), runs, paper: Some(paper) });
        }
    }
    Ok(arms)
}

fn fusion(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let ways =
        [("side by side", Fusion::Concat), ("FiLM", Fusion::Film), ("cross-attention", Fusion::Attention)];
    let mut arms = Vec::new();
    for (at, fusion) in ways {
        let network = NetworkConfig { fusion, ..plan.scale.network.clone() };
        let runs = on_site(plan, &network, Before::PreTrained, USUAL, |_| {})?;
        arms.push(Arm { series: "HOI".into(), at: At::Label(at.into()), runs, paper: None });
    }
    Ok(arms)
}

/// Virtual antennas of the radar, and beams that are learnt from them, as many as the angle map has points in a row.
const BEAMS: Beams = Beams { antennas: 12, beams: 32 };

fn encoders(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let usual = plan.scale.network.clone();
    let mut xrf55 = usual.clone();
    xrf55.radar.temporal = Temporal::Convolution;
    let cubelearn = NetworkConfig { beams: Some(BEAMS), ..usual.clone() };
    let ways = [
        ("transformer", usual),
        ("temporal CNN (XRF55)", xrf55),
        ("learnt transform (CubeLearn)", cubelearn),
    ];
    let mut arms = Vec::new();
    for (at, network) in ways {
        let runs = on_site(plan, &network, Before::Scratch, USUAL, |_| {})?;
        arms.push(Arm { series: "HOI".into(), at: At::Label(at.into()), runs, paper: None });
    }
    Ok(arms)
}

fn antennas(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let mut arms = Vec::new();
    for (antennas, paper) in (1..).zip([74.91, 85.66, 87.20, 87.87]) {
        let network = NetworkConfig { antennas, ..plan.scale.network.clone() };
        let runs = on_site(plan, &network, Before::Scratch, USUAL, |_| {})?;
        let at = At::Number(antennas as f64);
        arms.push(Arm { series: "from scratch".into(), at, runs, paper: Some(paper) });
    }
    Ok(arms)
}

fn loss_weight(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let mut arms = Vec::new();
    let weights = [(0.005, Some(83.47)), (0.05, None), (0.5, Some(87.50)), (5.0, None), (50.0, Some(69.11))];
    for (weight, paper) in weights {
        let runs = on_site(plan, &network, Before::Scratch, USUAL, |recipe| recipe.target_weight = weight)?;
        arms.push(Arm { series: "HOI".into(), at: At::Label(weight.to_string()), runs, paper });
    }
    Ok(arms)
}

fn synthetic(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let mut arms = Vec::new();
    let shares = [(0.2, Some(76.90)), (0.4, Some(92.84)), (0.6, None), (0.8, None), (1.0, Some(94.0))];
    for (share, paper) in shares {
        let from = plan.pre_train(&network, share, |_| {})?;
        let mut runs = Vec::new();
        for seed in seeds(plan) {
            let split = plan.split(sets::SITE, seed)?;
            let test = plan.test("site", sets::SITE, split.test)?;
            let key = test.key();
            let learn = (sets::SITE, first(&split.learn, USUAL));
            let tests = vec![test];
            runs.push((plan.fine_tune(&network, from.clone(), learn, tests, |r| r.seed = seed)?, key));
        }
        arms.push(Arm { series: "HOI".into(), at: At::Number(100.0 * share), runs, paper });
    }
    Ok(arms)
}

/// Both radios, and each by itself: whose trouble it is.
const RADIOS: [(&str, Fusion); 3] =
    [("fusion", Fusion::Concat), ("tags alone", Fusion::Rfid), ("radar alone", Fusion::Radar)];

/// The networks of the site, on sets that were never learnt from.
fn elsewhere(
    plan: &mut Plan,
    places: &[(&str, &'static str)],
    keep: fn(&Listed) -> bool,
) -> anyhow::Result<Vec<Arm>> {
    let mut arms = Vec::new();
    for (series, fusion) in RADIOS {
        let network = NetworkConfig { fusion, ..plan.scale.network.clone() };
        for &(label, set) in places {
            let samples = plan.which(set, keep)?;
            let mut runs = Vec::new();
            for seed in seeds(plan) {
                let split = plan.split(sets::SITE, seed)?;
                let test = plan.test(label, set, samples.clone())?;
                let learn = (sets::SITE, split.learn);
                runs.push(once(plan, &network, Before::PreTrained, learn, test, |r| r.seed = seed)?);
            }
            arms.push(Arm { series: series.into(), at: At::Label(label.into()), runs, paper: None });
        }
    }
    Ok(arms)
}

fn occlusion(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let places = [("none", sets::STILL), ("hand", sets::HAND), ("body", sets::BODY)];
    // Actions in which the hand touches the object, as in the paper.
    let touches = |sample: &Listed| {
        let touched = [Action::PickUp, Action::PutDown, Action::Open, Action::Close];
        sample.label.is_some_and(|(action, _)| touched.contains(&Action::ALL[action]))
    };
    let arms = elsewhere(plan, &places, touches)?;
    Ok(arms)
}

fn second_person(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let places = [("alone", sets::STILL), ("a second person", sets::SECOND)];
    let arms = elsewhere(plan, &places, |sample| sample.label.is_some())?;
    Ok(arms)
}

fn fine_tuning(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let epochs = if plan.scale.fine_epochs > 1 { &[1, 2, 4, 8, 15, 30][..] } else { &[1, 2] };
    let mut arms = Vec::new();
    for &epochs in epochs {
        let runs = on_site(plan, &network, Before::PreTrained, USUAL, |recipe| recipe.epochs = epochs)?;
        arms.push(Arm { series: "HOI".into(), at: At::Seconds, runs, paper: None });
    }
    Ok(arms)
}

/// A way to see a scene, and the set that is seen so.
type Sight = (&'static str, fn(&Seen) -> &'static str);

fn scenes(plan: &mut Plan) -> anyhow::Result<Vec<Arm>> {
    let network = plan.scale.network.clone();
    let ways: [Sight; 2] =
        [("as it needs", |seen| seen.as_needed), ("the paper's radar", |seen| seen.as_paper)];
    let mut arms = Vec::new();
    for (series, set) in ways {
        for seen in &sets::SCENES {
            let set = set(seen);
            let mut runs = Vec::new();
            for seed in seeds(plan) {
                let split = plan.split(set, seed)?;
                let test = plan.test(seen.scene, set, split.test)?;
                let learn = (set, split.learn);
                runs.push(once(plan, &network, Before::PreTrained, learn, test, |r| r.seed = seed)?);
            }
            arms.push(Arm { series: series.into(), at: At::Label(seen.scene.into()), runs, paper: None });
        }
    }
    Ok(arms)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_actions_and_objects_are_left() {
        for (count, seed) in (1..=5).flat_map(|count| (0..50).map(move |seed| (count, seed))) {
            let out = kept_out(count, seed);
            assert_eq!(out.len(), count, "{seed}");
            let left: Vec<_> = CATEGORIES.iter().filter(|c| !out.contains(c)).collect();
            for category in CATEGORIES {
                assert!(left.iter().any(|c| c.action == category.action));
                assert!(left.iter().any(|c| c.object == category.object));
            }
        }
    }
}
