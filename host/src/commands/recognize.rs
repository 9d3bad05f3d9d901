//! `rfhoi recognize`.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use rfhoi::bridge::BridgeError;
use rfhoi::bridge::address::BridgeAddress;
use rfhoi::bridge::client::{Client, Socket};
use rfhoi::recognize::model::{built_in, names};
use rfhoi::recognize::tags::TagNames;
use rfhoi::recognize::{Outcome, Recognition, Recognizer, Settings};
use rfhoi::replay::{ReplayError, packets};
use rfhoi_network::model::{Model, Precision};
use rfhoi_shared::radar::RadarProfile;
use serde::Serialize;

use super::{ProfileArgs, Progress, stopped};

/// From one hello to the next: a bridge that restarts, or that spoke with another host, finds this one again.
const GREET: Duration = Duration::from_secs(2);

#[derive(Debug, Args)]
pub(super) struct Recognize {
    /// A recording of radar and reader, or of a bridge's packets, that `rfhoi inspect` recognises.
    #[arg(required_unless_present = "live", conflicts_with = "live")]
    file: Option<PathBuf>,
    /// A bridge to follow until Ctrl-C: IP[:PORT], a host name, or auto for the only bridge in the network.
    #[arg(long, value_name = "BRIDGE")]
    live: Option<BridgeAddress>,
    /// Which tag is on which thing: lines of EPC = "name" (TOML), or of EPC,name (.csv). Other tags do not count. By default
    /// the tags of the simulated rooms.
    #[arg(long, value_name = "FILE")]
    tags: Option<PathBuf>,
    /// Model (.safetensors); by default one that is built in.
    #[arg(long, value_name = "FILE", conflicts_with = "precision")]
    model: Option<PathBuf>,
    /// Which of the models that are built in.
    #[arg(long, value_enum, default_value = "int8")]
    precision: PrecisionName,
    /// Tell tuples of at least this probability, 0 to 1; by default what the model says.
    #[arg(long, value_name = "P", value_parser = probability)]
    least: Option<f32>,
    /// Threads that share an answer of the int8 network: worth it with many tags.
    #[arg(long, value_name = "N", default_value = "1")]
    threads: NonZeroUsize,
    #[command(flatten)]
    profile: ProfileArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PrecisionName {
    Int8,
    F32,
}

fn probability(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|p| (0.0..=1.0).contains(p)).ok_or("give a probability, 0 to 1".to_owned())
}

/// What was recognised.
#[derive(Debug, Serialize)]
struct Recognised<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<&'a PathBuf>,
    /// The model, or which of those that are built in.
    model: String,
    least_probability: f32,
    /// Where the things' names are from.
    names: &'static str,
    tags: Vec<Tag>,
    recognitions: &'a [Recognition],
    tuples: usize,
    nothing: usize,
    cannot_tell: usize,
    radar_frames: u64,
    notes: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Tag {
    epc: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
}

impl Recognize {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let (model, model_name) = self.model()?;
        let tags = self.tags.as_deref().map_or_else(|| Ok(TagNames::simulated()), TagNames::read)?;
        let names_from = if tags.is_list() { "list" } else { "simulated tags" };
        let profile = self.profile.load(self.file.as_deref())?;
        let settings = Settings { profile: profile.clone(), tags, least: self.least, threads: self.threads };
        let mut recognizer = Recognizer::new(&model, &names()?, settings)?;
        let mut notes = recognizer.remarks().to_vec();
        let mut screen = Screen { json, live: self.live.is_some(), ..Screen::default() };
        if !json {
            screen.begin(&model_name, names_from, &recognizer)?;
        }
        match (&self.file, &self.live) {
            (Some(_), _) => notes.extend(self.recording(profile.as_ref(), &mut recognizer, &mut screen)?),
            (None, Some(address)) => follow(address, &mut recognizer, &mut screen)?,
            (None, None) => {}
        }
        recognizer.finish()?;
        screen.show(&mut recognizer)?;
        let counts = recognizer.counts();
        if counts.link.frames == 0 {
            notes.push("the radar sent no frame: `rfhoi inspect` tells what is in the recording".to_owned());
        }
        let recognised = Recognised {
            file: self.file.as_ref(),
            model: model_name,
            least_probability: recognizer.least(),
            names: names_from,
            tags: recognizer
                .tags()
                .map(|(epc, name)| Tag { epc: epc.to_string(), name: name.map(str::to_owned) })
                .collect(),
            tuples: screen.tuples,
            nothing: screen.nothing,
            cannot_tell: screen.cannot_tell,
            recognitions: &screen.all,
            radar_frames: counts.link.frames,
            notes,
        };
        if json {
            println!("{}", serde_json::to_string(&recognised)?);
        } else {
            recognised.say_the_end();
        }
        Ok(())
    }

    fn model(&self) -> anyhow::Result<(Model, String)> {
        if let Some(path) = &self.model {
            let bytes =
                std::fs::read(path).with_context(|| format!("cannot read the model {}", path.display()))?;
            let model = Model::from_bytes(&bytes).with_context(|| path.display().to_string())?;
            return Ok((model, path.display().to_string()));
        }
        let precision = match self.precision {
            PrecisionName::Int8 => Precision::Int8,
            PrecisionName::F32 => Precision::F32,
        };
        Ok((built_in(precision)?, format!("built in, {}", precision.name())))
    }

    /// Recognises what is in the recording. Returns what a person should know of it.
    fn recording(
        &self,
        profile: Option<&RadarProfile>,
        recognizer: &mut Recognizer,
        screen: &mut Screen,
    ) -> anyhow::Result<Vec<String>> {
        let Some(file) = &self.file else { return Ok(Vec::new()) };
        // Raw samples do not tell their profile: without one they are left out, and that is said.
        let radar = profile.map(|_| recognizer.radar().clone());
        let progress = Progress::new(format!("recognising {}", file.display()))?;
        let failed = std::cell::Cell::new(None::<anyhow::Error>);
        let mut take = |packet: &[u8]| -> anyhow::Result<()> {
            recognizer.push(packet)?;
            screen.show(recognizer)
        };
        let is_fine = || {
            let error = failed.take();
            let fine = error.is_none();
            failed.set(error);
            fine
        };
        let bridged = packets(
            file,
            radar.as_ref(),
            &mut |_, packet| {
                if is_fine()
                    && let Err(error) = take(packet)
                {
                    failed.set(Some(error));
                }
            },
            &mut |share| progress.show(share) && is_fine(),
        );
        drop(progress);
        match (failed.take(), bridged) {
            (Some(error), _) => Err(error),
            (None, Err(ReplayError::Interrupted)) => anyhow::bail!("stopped"),
            (None, bridged) => Ok(bridged?.notes),
        }
    }
}

/// Follows a bridge until Ctrl-C.
fn follow(address: &BridgeAddress, recognizer: &mut Recognizer, screen: &mut Screen) -> anyhow::Result<()> {
    let progress = Progress::waiting("asking the bridge")?;
    let mut socket = Socket::open(0)?;
    let peer = address.resolve(&mut socket, &mut |share| progress.show(share))?;
    let mut client = Client::new(socket, peer);
    client.hello(&mut |share| progress.show(share))?;
    drop(progress);
    let mut greet = Instant::now() + GREET;
    while !stopped() {
        if Instant::now() >= greet {
            greet += GREET;
            // The link may be down for a while.
            match client.greet() {
                Err(error @ BridgeError::Send { .. }) => tracing::warn!("{error}"),
                other => other?,
            }
        }
        let Some(bytes) = client.receive(greet)? else { continue };
        recognizer.push(bytes)?;
        screen.show(recognizer)?;
    }
    Ok(())
}

/// Shows what is recognised, as it comes.
#[derive(Default)]
struct Screen {
    json: bool,
    live: bool,
    /// Of a recording; what is live goes on for long.
    all: Vec<Recognition>,
    tuples: usize,
    nothing: usize,
    cannot_tell: usize,
}

/// Width of a tuple's column: of the longest with a name of the simulated rooms.
const TUPLE: usize = 25;

impl Screen {
    fn begin(&self, model: &str, names: &str, recognizer: &Recognizer) -> anyhow::Result<()> {
        ensure!(recognizer.least() <= 1.0, "the model asks for a probability of {}", recognizer.least());
        println!("model {model}; names of {names}; tuples of at least {:.2}", recognizer.least());
        for remark in recognizer.remarks() {
            println!("{remark}");
        }
        println!("{:>8} {:>8}  {:<TUPLE$} {:>5}", "begin, s", "end, s", "what", "p");
        Ok(())
    }

    fn show(&mut self, recognizer: &mut Recognizer) -> anyhow::Result<()> {
        while let Some(recognition) = recognizer.next() {
            match (self.json, self.live) {
                (false, _) => println!("{}", line(&recognition)),
                (true, true) => println!("{}", serde_json::to_string(&recognition)?),
                (true, false) => {}
            }
            match &recognition.outcome {
                Outcome::Tuple(_) => self.tuples += 1,
                Outcome::Nothing { .. } => self.nothing += 1,
                Outcome::CannotTell { .. } => self.cannot_tell += 1,
            }
            if !self.live {
                self.all.push(recognition);
            }
        }
        Ok(())
    }
}

/// One recognition as a row.
fn line(recognition: &Recognition) -> String {
    let Recognition { begin_s, end_s, outcome } = recognition;
    let (what, p, why) = match outcome {
        Outcome::Tuple(guess) => (guess.to_string(), Some(guess.p), String::new()),
        Outcome::Nothing { p } => ("nothing".to_owned(), Some(*p), String::new()),
        Outcome::CannotTell { why, guess } => {
            let guess = guess.as_ref().map(|guess| format!(" (best guess {guess})")).unwrap_or_default();
            ("cannot tell".to_owned(), None, format!("  {why}{guess}"))
        }
    };
    let p = p.map_or("-".to_owned(), |p| format!("{p:.2}"));
    format!("{begin_s:>8.1} {end_s:>8.1}  {what:<TUPLE$} {p:>5}{why}")
}

impl Recognised<'_> {
    fn say_the_end(&self) {
        // What was said of the names stands above.
        for note in self.notes.iter().filter(|note| !note.starts_with("the name '")) {
            println!("{note}");
        }
        let unnamed: Vec<&str> =
            self.tags.iter().filter(|tag| tag.name.is_none()).map(|tag| tag.epc.as_str()).collect();
        if !unnamed.is_empty() {
            println!("tags without a name, see --tags: {}", unnamed.join(", "));
        }
        println!(
            "{} tuples, {} times nothing, {} times not to be told; {} radar frames, {} tags",
            self.tuples,
            self.nothing,
            self.cannot_tell,
            self.radar_frames,
            self.tags.len()
        );
    }
}
