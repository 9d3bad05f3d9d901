//! Command line: arguments in, text or one JSON object out, exit status 0, 1 (it failed) or 130 (stopped by Ctrl-C).

mod bridge;
#[cfg(feature = "train")]
mod experiment;
mod flash;
mod inspect;
mod plan;
mod recognize;
mod replay;
mod report;
mod simulate;
mod stability;
#[cfg(feature = "train")]
mod train;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::{Args, Parser, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use rfhoi::profile::{self, BoardName, Changes, MOUNTINGS, ProfileFileError};
use rfhoi_firmware::mmwave::cfg::Board;
use rfhoi_shared::radar::{IqOrder, RadarProfile};

/// Human-object interactions from mmWave radar and RFID: the host side.
#[derive(Debug, Parser)]
#[command(name = "rfhoi", version, about, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
    /// One JSON object instead of text.
    #[arg(long, global = true)]
    json: bool,
    /// Tell more of what is done (-vv still more); RUST_LOG has the last word.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Say what is in a recording, what was lost or skipped, and why.
    Inspect(inspect::Inspect),
    /// Feed a recording through the bridge's logic and over the wire; write pictures and numbers.
    Replay(replay::Replay),
    /// Tell who did what to which thing in a recording, or as a bridge sends it, or why that cannot be told.
    Recognize(recognize::Recognize),
    /// Make simulated data: sets of labelled samples, recordings, pictures.
    Simulate(Box<simulate::Simulate>),
    /// Stress each method until it breaks, and tell whether it says so.
    Stability(stability::Stability),
    /// Find the smallest profile, maps and antennas that a scene needs, and what they cost.
    Plan(plan::Plan),
    /// Train a network on a data set.
    #[cfg(feature = "train")]
    Train(train::Train),
    /// Go on training a model on a part of another data set, and measure it on the rest.
    #[cfg(feature = "train")]
    Finetune(train::Finetune),
    /// Measure a model on a data set.
    #[cfg(feature = "train")]
    Evaluate(train::Evaluate),
    /// Make the int8 form of a model.
    #[cfg(feature = "train")]
    Quantize(train::Quantize),
    /// Train and measure several networks, as one table.
    #[cfg(feature = "train")]
    Experiment(experiment::Experiment),
    /// Chart speed against accuracy: profiles, maps, angles, networks, precisions, backends and antennas, with the Pareto front.
    #[cfg(feature = "train")]
    Chart(experiment::StudyArgs),
    /// Find, configure and watch bridges in the network.
    Bridge(bridge::Bridge),
    /// Program a board over its debug probe, and follow its log.
    Flash(flash::Flash),
}

pub(crate) fn run(cli: &Cli) -> ExitCode {
    let level = match cli.verbose {
        // The probes' drivers warn of every kind of probe that is not there.
        0 => "warn,probe_rs=error",
        1 => "rfhoi=info",
        _ => "rfhoi=debug",
    };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new(level));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
    let result = match &cli.command {
        Command::Inspect(command) => command.run(cli.json),
        Command::Replay(command) => command.run(cli.json),
        Command::Recognize(command) => command.run(cli.json),
        Command::Simulate(command) => command.run(cli.json),
        Command::Stability(command) => command.run(cli.json),
        Command::Plan(command) => command.run(cli.json),
        #[cfg(feature = "train")]
        Command::Train(command) => command.run(cli.json),
        #[cfg(feature = "train")]
        Command::Finetune(command) => command.run(cli.json),
        #[cfg(feature = "train")]
        Command::Evaluate(command) => command.run(cli.json),
        #[cfg(feature = "train")]
        Command::Quantize(command) => command.run(cli.json),
        #[cfg(feature = "train")]
        Command::Experiment(command) => command.run(cli.json),
        #[cfg(feature = "train")]
        Command::Chart(command) => command.chart(cli.json),
        Command::Bridge(command) => command.run(cli.json),
        Command::Flash(command) => command.run(cli.json),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("rfhoi: {}", sentence(&error));
            // As a shell reports a program that SIGINT ended.
            const INTERRUPTED: u8 = 130;
            ExitCode::from(if stopped() { INTERRUPTED } else { 1 })
        }
    }
}

/// An error with its causes, but for those that its own text names.
fn sentence(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |text, cause| match &text[..] {
        "" => cause,
        _ if text.contains(&cause) => text,
        _ => format!("{text}: {cause}"),
    })
}

/// The radar's profile, and numbers that replace its own.
#[derive(Debug, Args)]
struct ProfileArgs {
    /// CLI profile (.cfg), mmWave Studio log, or one of paper, fine, bridge; by default a .cfg beside the recording.
    #[arg(long, value_name = "FILE|NAME")]
    profile: Option<String>,
    /// Board, where the profile does not name it; AWR1843AOP if not given.
    #[arg(long, value_enum)]
    board: Option<BoardName>,
    /// Quarter turns of the board, clockwise as seen from behind it.
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..4))]
    quarter_turns: Option<u8>,
    /// ADC samples of a chirp.
    #[arg(long)]
    samples: Option<u16>,
    /// Receivers, the first ones of the board.
    #[arg(long)]
    receivers: Option<u8>,
    /// Transmitters in TDM, the first ones of the board.
    #[arg(long)]
    transmitters: Option<u8>,
    /// Loops of a frame: chirps of each transmitter.
    #[arg(long)]
    loops: Option<u16>,
    /// Sample rate, ksps.
    #[arg(long, value_name = "KSPS")]
    sample_rate: Option<u32>,
    /// Slope, MHz/us.
    #[arg(long, value_name = "MHZ_PER_US")]
    slope: Option<f64>,
    /// Frame period, ms.
    #[arg(long, value_name = "MS")]
    frame_period: Option<f64>,
    /// Which of I and Q comes first.
    #[arg(long, value_enum)]
    iq: Option<IqName>,
    /// Real samples.
    #[arg(long, conflicts_with = "iq")]
    real: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum IqName {
    IFirst,
    QFirst,
}

impl ProfileArgs {
    fn board(&self) -> Board {
        let mounting = MOUNTINGS[usize::from(self.quarter_turns.unwrap_or(0))];
        Board { array: self.board.unwrap_or(BoardName::Awr1843aop).into(), mounting }
    }

    fn changes(&self) -> Changes {
        Changes {
            samples: self.samples,
            loops: self.loops,
            receivers: self.receivers,
            transmitters: self.transmitters,
            sample_rate_ksps: self.sample_rate,
            slope_mhz_us: self.slope,
            frame_ms: self.frame_period,
            iq: self.iq.map(|iq| match iq {
                IqName::IFirst => IqOrder::IFirst,
                IqName::QFirst => IqOrder::QFirst,
            }),
            real: self.real,
        }
    }

    /// `own` with what is given in its place, or `None` where nothing is.
    fn change(&self, own: &RadarProfile) -> anyhow::Result<Option<RadarProfile>> {
        let changes = self.changes();
        let mut profile = match &self.profile {
            Some(source) => profile::load(source, self.board())?,
            None if changes == Changes::default() && self.board.is_none() && self.quarter_turns.is_none() => {
                return Ok(None);
            }
            None => own.clone(),
        };
        if self.board.is_some() {
            profile.array = self.board().array;
        }
        if self.quarter_turns.is_some() {
            profile.mounting = self.board().mounting;
        }
        Ok(Some(changes.apply(profile).map_err(|e: ProfileFileError| e)?))
    }

    /// The profile, or `None` where none is given and none lies beside `recording`.
    fn load(&self, recording: Option<&Path>) -> anyhow::Result<Option<RadarProfile>> {
        let changes = self.changes();
        let beside = recording.and_then(profile_beside);
        let source = match (&self.profile, &beside) {
            (Some(source), _) => source.clone(),
            (None, Some(path)) => {
                tracing::info!("profile {} beside the recording", path.display());
                path.to_string_lossy().into_owned()
            }
            // Single numbers change the default profile.
            (None, None) if changes != Changes::default() => "bridge".to_owned(),
            (None, None) => return Ok(None),
        };
        let profile = profile::load(&source, self.board())?;
        Ok(Some(changes.apply(profile).map_err(|e: ProfileFileError| e)?))
    }
}

/// The `.cfg` of the same name as `recording`.
fn profile_beside(recording: &Path) -> Option<PathBuf> {
    let name = recording.file_name()?.to_str()?;
    let stem = name.strip_suffix(".gz").unwrap_or(name);
    let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
    let path = recording.with_file_name(format!("{stem}.cfg"));
    (path.is_file() && path != recording).then_some(path)
}

static STOPPED: AtomicBool = AtomicBool::new(false);

fn stopped() -> bool {
    STOPPED.load(Ordering::Relaxed)
}

/// From here on, Ctrl-C sets a mark instead of ending the program.
fn listen_for_ctrl_c() -> anyhow::Result<()> {
    static LISTENS: OnceLock<()> = OnceLock::new();
    if LISTENS.set(()).is_ok() {
        ctrlc::set_handler(|| STOPPED.store(true, Ordering::Relaxed)).context("cannot listen for Ctrl-C")?;
    }
    Ok(())
}

/// Shows progress once something has taken a second, and listens for Ctrl-C.
struct Progress {
    name: String,
    template: &'static str,
    began: Instant,
    bar: OnceLock<ProgressBar>,
}

impl Progress {
    /// Of something whose share that is done is known.
    fn new(name: impl Into<String>) -> anyhow::Result<Self> {
        Self::with_template(name, "{msg} {wide_bar} {percent} % {eta} left")
    }

    /// Of waiting for something.
    fn waiting(name: impl Into<String>) -> anyhow::Result<Self> {
        Self::with_template(name, "{spinner} {msg} {elapsed}")
    }

    fn with_template(name: impl Into<String>, template: &'static str) -> anyhow::Result<Self> {
        listen_for_ctrl_c()?;
        Ok(Self { name: name.into(), template, began: Instant::now(), bar: OnceLock::new() })
    }

    /// Shows that `share` is done, 0 to 1. Returns whether to go on.
    fn show(&self, share: f64) -> bool {
        const STEPS: u64 = 1000;
        if self.began.elapsed() > Duration::from_secs(1) {
            let bar = self.bar.get_or_init(|| {
                let style = ProgressStyle::with_template(self.template);
                let bar = ProgressBar::new(STEPS)
                    .with_message(self.name.clone())
                    .with_elapsed(self.began.elapsed());
                bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
            });
            bar.set_position((share.clamp(0.0, 1.0) * STEPS as f64) as u64);
        }
        !stopped()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}
