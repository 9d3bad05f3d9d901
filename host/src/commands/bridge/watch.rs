//! `rfhoi bridge watch`.

use std::io::{IsTerminal, stderr, stdout};
use std::net::SocketAddrV4;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use rfhoi::bridge::BridgeError;
use rfhoi::bridge::client::Client;
use rfhoi::bridge::live::{Live, Moment, Totals};
use rfhoi::recording::{HOST_IP, Writer, WriterError};
use rfhoi_shared::wire::BRIDGE_PORT;
use serde::Serialize;

use super::super::stopped;
use super::{Local, Progress, Target, report, seconds};

/// From one line to the next.
const LOOK: Duration = Duration::from_secs(1);
/// From one hello to the next: a bridge that restarts, or that spoke with another host, finds this one again.
const GREET: Duration = Duration::from_secs(2);

#[derive(Debug, Args)]
pub(super) struct Watch {
    #[command(flatten)]
    target: Target,
    /// Record its packets for `rfhoi inspect` and `replay` (.pcap, or .pcap.gz).
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// How long, s; by default until Ctrl-C.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Line<'a> {
    time_s: f64,
    #[serde(flatten)]
    moment: &'a Moment,
    notices: &'a [String],
}

#[derive(Debug, Serialize)]
struct Summary<'a> {
    address: SocketAddrV4,
    #[serde(flatten)]
    totals: Totals,
    recording: Option<&'a Path>,
}

impl Watch {
    /// Ends in order on Ctrl-C, which is a failure only where a time was given that is not over.
    pub(super) fn run(&self, local: &Local, json: bool) -> anyhow::Result<()> {
        let length = self.seconds.map(seconds).transpose()?;
        let progress = Progress::waiting("asking the bridge")?;
        let mut client = self.target.client(local, &progress)?;
        // Made before the first packet, so that a folder that is not there is told at once.
        let mut recorder = match &self.record {
            Some(path) => Some(Recorder::new(path, &client)?),
            None => None,
        };
        client.hello(&mut |share| progress.show(share))?;
        drop(progress);
        let (mut live, mut screen) = (Live::default(), Screen::new(json));
        let began = Instant::now();
        let (mut look, mut greet) = (began + LOOK, began + GREET);
        let mut last_look = began;
        let mut notices = client.take_notices();
        let is_over = |now: Instant| length.is_some_and(|l| now - began >= l);
        loop {
            let now = Instant::now();
            let end = stopped() || is_over(now);
            if now >= look || end {
                look += LOOK;
                notices.extend(live.take_notices());
                let moment = live.look(now - last_look);
                last_look = now;
                screen.show(now - began, &moment, &notices)?;
                notices.clear();
            }
            if end {
                break;
            }
            if now >= greet {
                greet += GREET;
                // The link may be down for a while.
                match client.greet() {
                    Err(error @ BridgeError::Send { .. }) => notices.push(error.to_string()),
                    other => other?,
                }
            }
            let Some(bytes) = client.receive(look.min(greet))? else { continue };
            live.push(bytes);
            if let Some(recorder) = &mut recorder {
                recorder.packet(bytes)?;
            }
        }
        screen.clear();
        let totals = live.totals(began.elapsed());
        if let Some(recorder) = recorder {
            recorder.writer.finish()?;
        }
        report::print(&Summary { address: client.peer(), totals, recording: self.record.as_deref() }, json)?;
        anyhow::ensure!(length.is_none() || is_over(Instant::now()), "stopped before the time was over");
        Ok(())
    }
}

/// Writes what arrives to a recording, in UTC.
struct Recorder {
    writer: Writer,
    bridge: SocketAddrV4,
    host: SocketAddrV4,
    /// When it began, and that in UTC: times must not jump when the computer's clock is set.
    began: Instant,
    began_utc: Duration,
}

impl Recorder {
    fn new(path: &Path, client: &Client) -> Result<Self, WriterError> {
        // By this port recordings are understood, whichever it was reached by.
        let bridge = SocketAddrV4::new(*client.peer().ip(), BRIDGE_PORT);
        let ip = client.local_ip().unwrap_or(HOST_IP);
        let host = SocketAddrV4::new(ip, client.local_port());
        let began_utc = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Ok(Self { writer: Writer::create(path)?, bridge, host, began: Instant::now(), began_utc })
    }

    fn packet(&mut self, bytes: &[u8]) -> Result<(), WriterError> {
        let time = self.began_utc + self.began.elapsed();
        let time_us = u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
        self.writer.udp(time_us, self.bridge, self.host, bytes)
    }
}

/// One line that changes on a terminal; else one line a second.
enum Screen {
    Terminal(ProgressBar),
    Lines,
    Json,
}

impl Screen {
    fn new(json: bool) -> Self {
        if json {
            return Self::Json;
        }
        if !(stdout().is_terminal() && stderr().is_terminal()) {
            return Self::Lines;
        }
        let bar = ProgressBar::new_spinner();
        let style = ProgressStyle::with_template("{wide_msg}");
        Self::Terminal(bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner())))
    }

    fn show(&mut self, time: Duration, moment: &Moment, notices: &[String]) -> anyhow::Result<()> {
        let time_s = time.as_secs_f64();
        match self {
            Self::Json => report::print(&Line { time_s, moment, notices }, true)?,
            Self::Terminal(bar) => {
                notices.iter().for_each(|notice| bar.println(format!("{time_s:.1} s: {notice}")));
                bar.set_message(moment.to_string());
            }
            Self::Lines => {
                notices.iter().for_each(|notice| println!("{time_s:.1} s: {notice}"));
                println!("{time_s:.1} s: {moment}");
            }
        }
        Ok(())
    }

    fn clear(&self) {
        if let Self::Terminal(bar) = self {
            bar.finish_and_clear();
        }
    }
}
