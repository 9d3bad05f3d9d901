//! `rfhoi experiment real-motion`: a network on the motion of recorded people in simulated rooms, beside generated ones.

mod table;

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args;
use rfhoi::hoi::Object;
use rfhoi::real::motion::{self, Kind, Listed, Performed, Seen, Situations};
use rfhoi::recognize::model::built_in;
use rfhoi::recognize::radar::Maps;
use rfhoi::simulate::scene::{SITE, Scene};
use rfhoi::{atomic, learn};
use rfhoi_network::metrics::tuple_probability;
use rfhoi_network::model::{Model, Precision};
use rfhoi_network::sample::{Answer, Sample};
use serde::Serialize;

use self::table::Row;
use super::runs::cores;
use crate::commands::Progress;
use crate::commands::train::{model, names, settings};

/// Share of the work that is not the network's.
const SIMULATING: f64 = 0.9;

/// `rfhoi experiment real-motion`.
#[derive(Debug, Args)]
pub(super) struct RealMotion {
    /// Folder with ACTION_INDEX.tsv, which says what is done in which frames, and the motions beside it or in folders below: .amc
    /// with .asf, .bvh, Kinect's joints.
    #[arg(long, value_name = "DIR")]
    motions: PathBuf,
    /// Folder for real-motion.json and real-motion.txt.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Model (.safetensors); by default the int8 one that is built in.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Setups (room, body, place, direction, things) of each motion.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=1000))]
    setups: u32,
    /// Seed of everything; the network that is built in has learnt from sets of the seeds 2 and 3.
    #[arg(long, default_value_t = 11)]
    seed: u64,
    /// Threads; by default one for each core.
    #[arg(long)]
    workers: Option<usize>,
}

/// What came out.
#[derive(Debug, Serialize)]
struct Compared<'a> {
    simulated: &'static str,
    model: String,
    seed: u64,
    setups: u32,
    /// Tuples less probable are not told.
    least_probability: f32,
    motions: &'a [Listed],
    left_out: Vec<LeftOut<'a>>,
    /// One for each action, and last all.
    actions: Vec<Row>,
    /// One for each person and action.
    people: Vec<Row>,
    samples: Vec<Told<'a>>,
}

/// A motion that cannot be performed.
#[derive(Debug, Serialize)]
struct LeftOut<'a> {
    motion: usize,
    file: &'a str,
    why: &'a str,
}

/// What the network said of a sample.
#[derive(Debug, Serialize)]
struct Told<'a> {
    /// Place in `motions`.
    motion: usize,
    setup: u32,
    kind: Kind,
    scene: &'a str,
    person: &'a str,
    distance_m: f32,
    bearing_deg: f32,
    facing_deg: f32,
    done: String,
    /// The likeliest action and thing; nothing where none is.
    said: Option<String>,
    probability: Option<f32>,
    right: bool,
    figures: motion::Figures,
}

/// A recorded performance and the generated one beside it, each with the network's answer.
type Pair<'a> = [(&'a Seen, &'a Answer); 2];

impl RealMotion {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let listed = motion::list(&self.motions)?;
        let (model, model_name) = match &self.model {
            Some(path) => (model(path)?, path.display().to_string()),
            None => (built_in(Precision::Int8)?, "built in, int8".to_owned()),
        };
        let names = names()?;
        let scenes = scenes(&model)?;
        let situations = Situations {
            scenes: &scenes,
            seed: self.seed,
            setups: self.setups,
            settings: settings(&model)?,
            workers: self.workers.unwrap_or_else(cores),
        };
        let progress = Progress::new(format!("{} recorded motions", listed.len()))?;
        let performed =
            motion::perform(&listed, &situations, &mut |share| progress.show(share * SIMULATING))?;
        let vectors = |sample: &Sample| -> Vec<f32> {
            let of = |&object: &usize| names.vector_of(&names.lookup(Object::ALL[object].name())).to_vec();
            sample.objects.iter().flat_map(of).collect()
        };
        let samples: Vec<&Sample> = performed.seen.iter().map(|seen| &seen.sample).collect();
        let answers = learn::answers_with(&model, &vectors, &samples, &mut |share| {
            progress.show(SIMULATING + (1.0 - SIMULATING) * share)
        })?;
        drop(progress);
        let compared = self.compare(model_name, learn::least(&model), &listed, &performed, &answers, &scenes);
        let text = compared.text();
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        atomic::write(self.out.join("real-motion.json"), &serde_json::to_vec_pretty(&compared)?)?;
        atomic::write(self.out.join("real-motion.txt"), text.as_bytes())?;
        if json {
            println!("{}", serde_json::to_string(&compared)?);
        } else {
            print!("{text}");
        }
        Ok(())
    }

    fn compare<'a>(
        &self,
        model: String,
        least: f32,
        listed: &'a [Listed],
        performed: &'a Performed,
        answers: &'a [Answer],
        scenes: &'a [Scene],
    ) -> Compared<'a> {
        let seen: Vec<(&Seen, &Answer)> = performed.seen.iter().zip(answers).collect();
        // A generated performance follows its recorded one.
        let pairs: Vec<Pair<'_>> = seen.as_chunks::<2>().0.to_vec();
        let of = |pair: &Pair<'_>| &listed[pair[0].0.motion];
        let row = |name: &str, person: Option<&str>, which: &dyn Fn(&Listed) -> bool| {
            let chosen: Vec<Pair<'_>> = pairs.iter().filter(|pair| which(of(pair))).copied().collect();
            (!chosen.is_empty()).then(|| Row::of(name, person, &chosen, least))
        };
        let actions = motion::ACTIONS.iter().map(|&action| {
            let which = move |listed: &Listed| listed.action == action;
            row(action.name(), None, &which)
        });
        let actions = actions.chain([row("all", None, &|_| true)]).flatten().collect();
        let mut who: Vec<&str> = listed.iter().map(|listed| listed.person.as_str()).collect();
        who.sort_unstable();
        who.dedup();
        let each = motion::ACTIONS.iter().flat_map(|&action| who.iter().map(move |&person| (action, person)));
        let people = each.filter_map(|(action, person)| {
            let which = move |listed: &Listed| listed.action == action && listed.person == person;
            row(action.name(), Some(person), &which)
        });
        let left_out = performed.left_out.iter().map(|(motion, why)| LeftOut {
            motion: *motion,
            file: &listed[*motion].file,
            why,
        });
        Compared {
            simulated: "radar and reader; motion recorded",
            model,
            seed: self.seed,
            setups: self.setups,
            least_probability: least,
            motions: listed,
            left_out: left_out.collect(),
            actions,
            people: people.collect(),
            samples: seen.iter().map(|&(seen, answer)| Told::of(seen, answer, scenes)).collect(),
        }
    }
}

impl<'a> Told<'a> {
    fn of(seen: &'a Seen, answer: &Answer, scenes: &'a [Scene]) -> Self {
        let (draw, scene) = (&seen.draw, &scenes[seen.draw.scene]);
        let tuple = tuple_probability(answer);
        let said = tuple.and_then(|(action, target, _)| {
            let action = rfhoi::hoi::Action::ALL.get(action)?;
            Some(format!("<{action}, {}>", draw.objects.get(target)?))
        });
        Self {
            motion: seen.motion,
            setup: seen.setup,
            kind: seen.kind,
            scene: &scene.name,
            person: &scene.people[draw.person].name,
            distance_m: draw.distance_m,
            bearing_deg: draw.bearing_deg,
            facing_deg: draw.facing_deg,
            done: draw.label.map_or("nothing".to_owned(), |label| label.to_string()),
            said,
            probability: tuple.map(|(_, _, p)| p),
            right: is_right(answer, &seen.sample),
            figures: seen.figures,
        }
    }
}

/// Whether action and target are both right.
fn is_right(answer: &Answer, sample: &Sample) -> bool {
    let tuple = tuple_probability(answer);
    tuple.is_some_and(|(action, target, _)| (Some(action), Some(target)) == (sample.action, sample.target))
}

/// The rooms, if the model is for their radar.
fn scenes(model: &Model) -> anyhow::Result<Vec<Scene>> {
    let radar = Maps::of(&model.description)?.config(None)?;
    let scenes = SITE.map(Scene::load).into_iter().collect::<Result<Vec<_>, _>>()?;
    for scene in &scenes {
        ensure!(
            scene.radar.profile.fingerprint() == radar.profile.fingerprint()
                && scene.gate() == radar.processing.gate,
            "the model was trained for another radar than that of the room {}: train one with sets of `rfhoi simulate` \
             without --profile, or leave --model out",
            scene.name
        );
    }
    Ok(scenes)
}
