//! `rfhoi simulate`.

mod acted;

use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use glam::Vec2;
use rand_chacha::ChaCha8Rng;
use rfhoi::atomic;
use rfhoi::hoi::{Action, CATEGORIES, Category, Object, UNSEEN};
use rfhoi::simulate::circumstance::Circumstance;
use rfhoi::simulate::cost;
use rfhoi::simulate::draw::{self, Draw, Purpose, Wanted, draw, stream};
use rfhoi::simulate::effects::{Domain, Effects};
use rfhoi::simulate::portrait::{Caption, portray};
use rfhoi::simulate::recording;
use rfhoi::simulate::sample::epoch;
use rfhoi::simulate::scene::{SITE, Scene};
use rfhoi::simulate::session::{self, Session};
use rfhoi::simulate::set;
use rfhoi_shared::units::BridgeTime;
use serde::Serialize;

use self::acted::{Acted, SourceArgs};
use super::{ProfileArgs, Progress, report};

/// The paper's synthetic data set (section 4.3).
const PAPER_SAMPLES: u32 = 7_518;

#[derive(Debug, Args)]
pub(super) struct Simulate {
    #[command(flatten)]
    output: Output,
    /// Whose data it stands for: the paper's recipe for training, or real rooms with all effects.
    #[arg(long, value_enum, default_value_t = DomainName::Site)]
    domain: DomainName,
    /// Scene: a built-in room or a file (see host/scenes); give it again for more. By default open-room for train,
    /// the paper's three rooms for site.
    #[arg(long, value_name = "NAME|FILE")]
    scene: Vec<String>,
    /// Seed of everything; the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Effects to leave out, by name (`--effects` lists them).
    #[arg(long, value_name = "EFFECT", value_delimiter = ',', conflicts_with_all = ["effects", "costs"])]
    without: Vec<String>,
    /// Effects to add to those of the domain; `all` for all.
    #[arg(long, value_name = "EFFECT", value_delimiter = ',', conflicts_with_all = ["effects", "costs"])]
    with: Vec<String>,
    /// What makes it harder; by default nothing does. It is for people who are generated, not for recorded ones or meshes.
    #[arg(long, value_enum, conflicts_with_all = ["effects", "costs", "motion", "meshes"])]
    circumstance: Option<CircumstanceName>,
    #[command(flatten)]
    set: SetArgs,
    #[command(flatten)]
    one: OneArgs,
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    profile: ProfileArgs,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Output {
    /// Folder for a data set: shards (.npz) and manifest.json. If it was begun before, it goes on.
    #[arg(long, value_name = "DIR")]
    set: Option<PathBuf>,
    /// File for one sample as radar and reader send it, packets (.pcap, or .pcap.gz); its profile goes beside it (.cfg).
    #[arg(long, value_name = "FILE")]
    recording: Option<PathBuf>,
    /// Folder for pictures of one sample: all of it (sample.png), a few moments (strip.png), a film (film.gif).
    #[arg(long, value_name = "DIR")]
    picture: Option<PathBuf>,
    /// Only list the effects, and which domain has them.
    #[arg(long)]
    effects: bool,
    /// Measure what each effect costs on this machine and what it changes, on so many samples.
    #[arg(long, value_name = "SAMPLES", value_parser = clap::value_parser!(u32).range(1..=1000))]
    costs: Option<u32>,
}

/// What is about many samples means nothing to these.
const NOT_SET: [&str; 4] = ["recording", "picture", "effects", "costs"];
/// What is about one sample means nothing to these.
const NOT_ONE: [&str; 3] = ["set", "effects", "costs"];

/// A way to look, deg.
fn facing(text: &str) -> Result<f32, String> {
    let whole_turn = -180.0..=180.0;
    text.parse().ok().filter(|deg| whole_turn.contains(deg)).ok_or("give -180 to 180 degrees".to_owned())
}

/// What somebody does; `None` is no interaction.
type Deed = Option<Category>;

/// An action and what it is done to, or nothing.
fn deed(text: &str) -> Result<Deed, String> {
    if text == "nothing" {
        return Ok(None);
    }
    let mut known = CATEGORIES.iter().chain(&UNSEEN);
    let found = known.find(|c| format!("{} {}", c.action, c.object) == text);
    found
        .copied()
        .map(Some)
        .ok_or("give an action and an object, as \"open microwave\", or nothing".to_owned())
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Data set")]
struct SetArgs {
    /// Samples.
    #[arg(long, default_value_t = PAPER_SAMPLES, value_parser = clap::value_parser!(u32).range(1..=200_000), conflicts_with_all = NOT_SET)]
    count: u32,
    /// Which categories take turns.
    #[arg(long, value_enum, default_value_t = CategoriesName::Seen, conflicts_with_all = NOT_SET)]
    categories: CategoriesName,
    /// Share of samples without an interaction, 0 to 1.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, conflicts_with_all = NOT_SET)]
    nothing: f64,
    /// Spread the samples over so many setups, each a room, a person, a place and a way to look, as recordings of real people
    /// are (the paper has 78); for --domain site. By default all of that is drawn for each sample.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), conflicts_with_all = NOT_SET)]
    setups: Option<u32>,
    /// Draw so many rooms, with walls, furniture and people of their own, around what hangs on the scene's wall; by default the
    /// scenes are taken as they are.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1000), conflicts_with_all = NOT_SET)]
    rooms: Option<u32>,
    /// Replace objects where the action would be the same (the paper's algorithm 1).
    #[arg(long, conflicts_with_all = NOT_SET)]
    expand: bool,
    /// Threads; by default one for each core.
    #[arg(long, conflicts_with_all = NOT_SET)]
    workers: Option<usize>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "One sample")]
struct OneArgs {
    /// What is done: "pick up", "put down", "open", "close", "wipe", "sit down", "stand up" or "nothing"; by default
    /// what --labelled says, else "pick up".
    #[arg(long, conflicts_with_all = NOT_ONE)]
    action: Option<String>,
    /// To what; by default the first object that the action is known with.
    #[arg(long, conflicts_with_all = NOT_ONE)]
    object: Option<String>,
    /// Who, by name in the scene; drawn if not given.
    #[arg(long, conflicts_with_all = NOT_ONE)]
    person: Option<String>,
    /// Where, counted from 1 in the scene; drawn if not given.
    #[arg(long, value_name = "NUMBER", conflicts_with_all = NOT_ONE)]
    place: Option<usize>,
    /// What the same person does next, among the same things, as "open microwave" or nothing; give it again for more.
    #[arg(long, value_name = "DEED", value_parser = deed, conflicts_with_all = ["set", "picture", "effects", "costs", "motion", "meshes"])]
    then: Vec<Deed>,
    /// Record what a bridge sends to its host, instead of what the devices send to it: small, and without raw samples.
    #[arg(long, requires = "recording")]
    as_bridge: bool,
    /// Where they look, deg; 0 is towards the radar, growing to their left. Drawn if not given.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = facing, conflicts_with_all = NOT_ONE)]
    facing: Option<f32>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum DomainName {
    Train,
    Site,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum CircumstanceName {
    /// Fingers cover a part of the target's tag while the hand holds the thing: 8.3 dB there and back, on average.
    Hand,
    /// Carried things that nothing is done to lie 0.2 to 0.5 m behind the person.
    Body,
    /// Somebody else, 1 to 2 m away, does things all the time.
    SecondPerson,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum CategoriesName {
    /// The paper's 17.
    Seen,
    /// The 10 of objects that are not among the paper's eight.
    Unseen,
    /// Both.
    All,
}

/// From a person's first movement to the last.
#[derive(Debug, Serialize)]
struct Performed {
    label: String,
    begin_s: f64,
    end_s: f64,
}

#[derive(Debug, Serialize)]
struct Recorded {
    simulated: bool,
    label: String,
    /// Interactions in the recording's time.
    performed: Vec<Performed>,
    /// The recording that was performed.
    #[serde(skip_serializing_if = "Option::is_none")]
    after: Option<String>,
    scene: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    circumstance: Option<Circumstance>,
    seed: u64,
    recording: PathBuf,
    profile: PathBuf,
    #[serde(flatten)]
    summary: recording::Summary,
}

#[derive(Debug, Serialize)]
struct Pictured {
    simulated: bool,
    label: String,
    /// The recording that was performed.
    #[serde(skip_serializing_if = "Option::is_none")]
    after: Option<String>,
    scene: String,
    person: String,
    distance_m: f32,
    bearing_deg: f32,
    facing_deg: f32,
    domain: Domain,
    #[serde(skip_serializing_if = "Option::is_none")]
    circumstance: Option<Circumstance>,
    seed: u64,
    duration_s: f64,
    radar_frames: usize,
    phase_differences: usize,
    pictures: Vec<PathBuf>,
}

#[derive(Debug, Serialize)]
struct Written {
    simulated: bool,
    domain: Domain,
    #[serde(skip_serializing_if = "Option::is_none")]
    circumstance: Option<Circumstance>,
    seed: u64,
    set: PathBuf,
    #[serde(flatten)]
    summary: set::Summary,
}

impl Simulate {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let Output { set, recording, picture, effects: _, costs } = &self.output;
        match (set, recording, picture, costs) {
            (Some(folder), ..) => self.write_set(folder, json),
            (_, Some(file), ..) => self.record(file, json),
            (.., Some(folder), _) => self.picture(folder, json),
            (.., Some(samples)) => self.measure(*samples, json),
            _ => list_effects(json),
        }
    }

    fn domain(&self) -> Domain {
        match self.domain {
            DomainName::Train => Domain::Train,
            DomainName::Site => Domain::Site,
        }
    }

    fn circumstance(&self) -> Option<Circumstance> {
        self.circumstance.map(|name| match name {
            CircumstanceName::Hand => Circumstance::Hand,
            CircumstanceName::Body => Circumstance::Body,
            CircumstanceName::SecondPerson => Circumstance::SecondPerson,
        })
    }

    fn effects(&self) -> anyhow::Result<Effects> {
        let all = self.with.iter().any(|name| name == "all");
        // The site has all effects.
        let mut effects = Effects::of(if all { Domain::Site } else { self.domain() });
        let with = self.with.iter().filter(|name| *name != "all").map(|name| (name, true));
        for (name, on) in self.without.iter().map(|name| (name, false)).chain(with) {
            let known = || Effects::ALL.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
            *effects.switch(name).with_context(|| format!("no effect is called `{name}`: {}", known()))? = on;
        }
        if let Some(name) = self.circumstance().filter(|c| *c != Circumstance::Hand && !effects.blockage) {
            let name = name.name();
            tracing::warn!("--circumstance {name}: bodies weaken no tags without the effect `blockage`");
        }
        Ok(effects)
    }

    /// The scenes, with the profile of the command line.
    fn scenes(&self) -> anyhow::Result<Vec<Scene>> {
        let given: Vec<&str> = match (&self.scene[..], self.domain) {
            ([], DomainName::Train) => vec!["open-room"],
            ([], DomainName::Site) => SITE.to_vec(),
            (given, _) => given.iter().map(String::as_str).collect(),
        };
        let load = |source: &str| -> anyhow::Result<Scene> {
            let scene = Scene::load(source)?;
            let Some(profile) = self.profile.change(&scene.radar.profile)? else { return Ok(scene) };
            let (name, places) = (scene.name.clone(), scene.places.len());
            let scene = scene
                .with_profile(&profile)
                .with_context(|| format!("the profile cannot see the scene {name}"))?;
            if scene.places.len() < places {
                let depth_m = scene.radar.depth_m;
                tracing::warn!(
                    "{name}: the profile sees {depth_m:.2} m, so {} of {places} places are left",
                    scene.places.len()
                );
            }
            Ok(scene)
        };
        given.into_iter().map(load).collect()
    }

    fn write_set(&self, folder: &Path, json: bool) -> anyhow::Result<()> {
        let SetArgs { count, categories, nothing, setups, rooms, expand, workers } = self.set;
        ensure!((0.0..=1.0).contains(&nothing), "--nothing {nothing} is no share: give 0 to 1");
        let categories = match categories {
            CategoriesName::Seen => CATEGORIES.to_vec(),
            CategoriesName::Unseen => UNSEEN.to_vec(),
            CategoriesName::All => CATEGORIES.iter().chain(&UNSEEN).copied().collect(),
        };
        let mut scenes = self.scenes()?;
        if let Some(rooms) = rooms {
            ensure!(scenes.len() == 1, "--rooms are drawn around one scene: give --scene once");
            scenes = draw::rooms(self.domain(), self.seed, &scenes[0], rooms);
            ensure!(
                scenes.iter().all(|scene| !scene.places.is_empty()),
                "--rooms: the radar sees too little of a room for anybody to stand in it; take a profile that sees farther"
            );
        }
        ensure!(
            setups.is_none() || matches!(self.domain, DomainName::Site),
            "--setups is for --domain site: people of train stand anywhere"
        );
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let domain = self.domain();
        let wanted = Wanted {
            domain,
            seed: self.seed,
            samples: count,
            categories: &categories,
            nothing,
            expand,
            setups,
            circumstance: self.circumstance(),
        };
        let options = set::Options {
            wanted,
            effects: self.effects()?,
            scenes: &scenes,
            workers: workers.unwrap_or_else(cores),
        };
        let progress = Progress::new(format!("simulating {count} samples"))?;
        let summary = set::write(folder, &options, &mut |share| progress.show(share))?;
        drop(progress);
        let (circumstance, seed, set) = (self.circumstance(), self.seed, folder.to_path_buf());
        report::print(&Written { simulated: true, domain, circumstance, seed, set, summary }, json)
    }

    /// The sample that the command line asks for, in its scene.
    fn one(&self) -> anyhow::Result<(Scene, Draw)> {
        ensure!(self.scene.len() <= 1, "one sample is in one scene: give --scene once");
        let mut scene = self.scenes()?.swap_remove(0);
        let OneArgs { person, place, facing, .. } = &self.one;
        if let Some(name) = person {
            let names = scene.people.iter().map(|p| p.name.as_str()).collect::<Vec<_>>().join(", ");
            scene.people.retain(|p| p.name == *name);
            ensure!(!scene.people.is_empty(), "nobody in {} is called {name}: there are {names}", scene.name);
        }
        let mut position = None;
        if let Some(number) = *place {
            // A place is listed once for each way to look.
            let mut positions: Vec<Vec2> = scene.places.iter().map(|p| p.position).collect();
            positions.dedup();
            let count = positions.len();
            position = number.checked_sub(1).and_then(|n| positions.get(n)).copied();
            ensure!(position.is_some(), "{} has places 1 to {count}, not {number}", scene.name);
            scene.places.retain(|p| Some(p.position) == position);
        }
        let categories: Vec<Category> = self.category()?.into_iter().collect();
        let wanted = Wanted {
            circumstance: self.circumstance(),
            ..Wanted::one(self.domain(), self.seed, &categories)
        };
        let scenes = [scene];
        let mut drawn = draw(&wanted, &scenes).swap_remove(0);
        drawn.facing_deg = facing.unwrap_or(drawn.facing_deg);
        let [scene] = scenes;
        if let Some(position) = position {
            // In `train` people are anywhere.
            drawn.move_to(position, &scene);
        }
        Ok((scene, drawn))
    }

    /// What is to be done; `None` is nothing.
    fn category(&self) -> anyhow::Result<Option<Category>> {
        let OneArgs { action, object, .. } = &self.one;
        let known = || CATEGORIES.iter().chain(&UNSEEN).copied();
        if action.as_deref() == Some("nothing") {
            ensure!(object.is_none(), "--object has no meaning with --action nothing");
            return Ok(None);
        }
        let action = match action {
            Some(name) => Action::named(name).with_context(|| {
                let names = Action::ALL.iter().map(|a| a.name()).collect::<Vec<_>>().join(", ");
                format!("no action is called `{name}`: {names}, nothing")
            })?,
            None => self.source.action().unwrap_or(Action::PickUp),
        };
        let objects = || known().filter(move |c| c.action == action);
        let Some(object) = object else { return Ok(objects().next()) };
        let named = Object::named(object).and_then(|object| objects().find(|c| c.object == object));
        let names = || objects().map(|c| c.object.name()).collect::<Vec<_>>().join(", ");
        named.map(Some).with_context(|| format!("`{action}` is known with {}, not with `{object}`", names()))
    }

    fn record(&self, file: &Path, json: bool) -> anyhow::Result<()> {
        let name = file.to_string_lossy();
        let stem = name.strip_suffix(".gz").unwrap_or(&name);
        let stem = stem
            .strip_suffix(".pcap")
            .with_context(|| format!("{name}: name the recording .pcap or .pcap.gz"))?;
        let beside = PathBuf::from(format!("{stem}.cfg"));
        let (scene, drawn) = self.one()?;
        let (seed, effects) = (self.seed, self.effects()?);
        let draws = session::draws(drawn, &self.one.then)
            .context("--then: that needs more different things than there are tags in a scene")?;
        let acted = draws.iter().map(|drawn| self.source.act(self.domain(), seed, drawn, &scene));
        let acted: Vec<Acted> = acted.collect::<anyhow::Result<_>>()?;
        let mut takes = acted.iter().map(|acted| acted.take(&scene, effects));
        let session = Session::new(takes.next().context("there is a first")?, takes);
        let [mut radar, mut reader] = self.noise(&draws[0]);
        let record = if self.one.as_bridge { recording::record_bridge } else { recording::record };
        let progress = Progress::new(format!("simulating {name}"))?;
        let summary = record(file, &session, &mut radar, &mut reader, &mut |share| progress.show(share))?;
        drop(progress);
        let text = rfhoi::profile::text(&scene.radar.profile)
            .context("this profile cannot be written as a CLI profile")?;
        atomic::write(&beside, text.as_bytes())?;
        let recorded = Recorded {
            simulated: true,
            performed: performed(&acted, &session, epoch(&effects)),
            label: acted.iter().map(label).collect::<Vec<_>>().join(", "),
            after: acted[0].source.clone(),
            scene: scene.name.clone(),
            circumstance: self.circumstance(),
            seed,
            recording: file.to_path_buf(),
            profile: beside,
            summary,
        };
        report::print(&recorded, json)
    }

    /// Streams of the noise of radar and reader.
    fn noise(&self, drawn: &Draw) -> [ChaCha8Rng; 2] {
        let of = |purpose| stream(self.domain(), self.seed, drawn.sample, purpose);
        [Purpose::Radar, Purpose::Rfid].map(of)
    }

    fn picture(&self, folder: &Path, json: bool) -> anyhow::Result<()> {
        let (scene, drawn) = self.one()?;
        let (domain, seed) = (self.domain(), self.seed);
        let acted = self.source.act(domain, seed, &drawn, &scene)?;
        let take = acted.take(&scene, self.effects()?);
        let person = &scene.people[drawn.person].name;
        let (label, distance_m, facing_deg) = (label(&acted), drawn.distance_m, drawn.facing_deg);
        let who = acted.source.as_ref().map_or(person.clone(), |source| format!("after {source}"));
        let caption = Caption {
            title: format!(
                "Simulated: {label}, {who}, {}, {distance_m:.1} m away, facing {facing_deg:.0} deg",
                scene.name
            ),
            target: acted.target(),
            interaction_s: acted.interaction_s(),
        };
        let [mut radar, mut reader] = self.noise(&drawn);
        let progress = Progress::new(format!("simulating {label}"))?;
        let sample = portray(&take, caption, &mut radar, &mut reader, &mut |share| progress.show(share))?;
        drop(progress);
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let pictured = Pictured {
            simulated: true,
            label,
            after: acted.source.clone(),
            scene: scene.name.clone(),
            person: person.clone(),
            distance_m,
            bearing_deg: drawn.bearing_deg,
            facing_deg,
            domain,
            circumstance: self.circumstance(),
            seed,
            duration_s: take.performance.duration_s(),
            radar_frames: sample.moments.len(),
            phase_differences: sample.differences.iter().map(|d| d.points.len()).sum(),
            pictures: sample.write(folder)?,
        };
        report::print(&pictured, json)
    }
}

/// When each person's movement was, in the recording.
fn performed(acted: &[Acted], session: &Session<'_>, epoch: BridgeTime) -> Vec<Performed> {
    let begins_s = session.begins_s().iter().map(|begin_s| begin_s + epoch.seconds());
    let of = |(acted, begin_s): (&Acted, f64)| {
        let Range { start, end } = acted.interaction_s().unwrap_or_default();
        (acted.label.is_some()).then(|| Performed {
            label: label(acted),
            begin_s: begin_s + start,
            end_s: begin_s + end,
        })
    };
    acted.iter().zip(begins_s).filter_map(of).collect()
}

fn label(acted: &Acted) -> String {
    acted.label.map_or("no interaction".to_owned(), |label| label.to_string())
}

impl Simulate {
    fn measure(&self, samples: u32, json: bool) -> anyhow::Result<()> {
        let scenes = self.scenes()?;
        let progress = Progress::new("measuring effects")?;
        let rows = cost::measure(&scenes, self.seed, samples, &mut |share| progress.show(share))?;
        drop(progress);
        if json {
            println!("{}", serde_json::to_string(&rows)?);
            return Ok(());
        }
        println!("effect           switched  ms/sample  ratio  maps, dB  reads/s  phase, deg");
        for row in rows {
            let switched = if row.on { "on" } else { "off" };
            let phase = row.phase_deg.map_or("-".to_owned(), |deg| format!("{deg:.1}"));
            println!(
                "{:<16} {switched:<8}  {:>9.1}  {:>5.2}  {:>8.2}  {:>7.1}  {phase:>10}",
                row.effect, row.sample_ms, row.ratio, row.maps_db, row.reads_hz
            );
        }
        Ok(())
    }
}

#[derive(Debug, Serialize)]
struct Effect {
    effect: &'static str,
    train: bool,
    site: bool,
    what: &'static str,
}

fn list_effects(json: bool) -> anyhow::Result<()> {
    let [mut train, mut site] = [Domain::Train, Domain::Site].map(Effects::of);
    let mut has = |name| [&mut train, &mut site].map(|e| e.switch(name).is_some_and(|on| *on));
    let list = Effects::ALL.iter().map(|&(effect, what)| {
        let [train, site] = has(effect);
        Effect { effect, train, site, what: what.trim() }
    });
    if json {
        println!("{}", serde_json::to_string(&list.collect::<Vec<_>>())?);
    } else {
        println!("{:<16} train site", "effect");
        let mark = |on| if on { "x" } else { "-" };
        for Effect { effect, train, site, what } in list {
            println!("{effect:<16} {:<5} {:<4} {what}", mark(train), mark(site));
        }
    }
    Ok(())
}
