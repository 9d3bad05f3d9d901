//! Drives the radar: programs it over its command line, and its recorder over the network.
//!
//! ```text
//! Start -> Programming  all lines but the last (`sensorStart`): whatever ran before is stopped
//!       -> Recorder     DCA1000EVM: set up, recording started          (raw samples only)
//!       -> Programming  `sensorStart`
//!       -> Silent -> Streaming, once data arrives
//! ```
//!
//! The recorder must run before the sensor starts, or byte 0 of its stream lies within a frame. A step that fails is
//! told and all is tried again after [`RETRY_US`]; a radar that stops sending is programmed again. A radar whose
//! command line does not answer may be programmed by somebody else: the recorder runs, and the radar is to be started
//! after it; as long as nothing comes, the command line is tried again.

use core::fmt;

use heapless::String;
use rfhoi_shared::config::{RadarConfig, RadarInput};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::RadarState;

use crate::dca1000::command::{Answer, Code, Report};
use crate::dca1000::setup::{Setup, SetupError};
use crate::mmwave::cfg::{self, DemoOptions, GuiMonitor, LvdsStream, PointOutput};
use crate::mmwave::cli::{CliError, Event, Failure, MAX_LINE, Session, Timeouts};

/// Wait before everything is tried again, us.
pub const RETRY_US: u64 = 5_000_000;
/// A radar that has sent nothing for so long is silent, us: several of the longest frame periods.
pub const QUIET_US: u64 = 3_000_000;
/// A radar that stays silent for so long is programmed again, us.
pub const SILENT_US: u64 = 10_000_000;

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlInput<'a> {
    /// Begin, if stopped.
    Start,
    /// Stop the radar and its recorder.
    Stop,
    /// A datagram of the recorder.
    Recorder(&'a [u8]),
    /// Bytes of the radar's command line.
    Console(&'a [u8]),
    /// So many pieces of data have come since the bridge started; to be told now and then, at least once a second.
    Progress(u32),
    /// Time has passed.
    Tick,
}

/// What is to be done or told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlAction<'a> {
    /// Send this datagram to the recorder.
    Recorder(&'a [u8]),
    /// Write this to the radar's command line.
    Console(&'a str),
    /// The state changed.
    State(RadarState),
    /// Something that a person should know.
    Notice(ControlNotice<'a>),
}

/// What a person should know of the radar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ControlNotice<'a> {
    /// The recorder could not be set up.
    Recorder(SetupError),
    /// The recorder reports this by itself.
    Report(Report),
    /// The radar did not take its program.
    Console(Failure<'a>),
    /// The radar's command line does not answer.
    NoConsole,
    /// No data for this many seconds.
    NoData(u32),
}

impl fmt::Display for ControlNotice<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Recorder(error) => write!(f, "{error}"),
            Self::Report(report) => write!(f, "the DCA1000EVM reports {report:?}"),
            Self::Console(failure) => write!(f, "{failure}"),
            Self::NoConsole => write!(
                f,
                "the radar's command line does not answer: check its UART, or start the radar yourself, now that the bridge listens"
            ),
            Self::NoData(seconds) => write!(f, "no data of the radar for {seconds} s"),
        }
    }
}

/// Lines of the radar's program.
#[derive(Debug, Clone)]
struct Script {
    text: String<{ cfg::TEXT_CAPACITY }>,
    at: usize,
    end: usize,
}

impl Script {
    /// All lines of `config`'s program but the last, and the last.
    fn of(config: &RadarConfig) -> (Self, Self) {
        let raw = matches!(config.input, RadarInput::Dca1000 { .. });
        // Data that nobody reads keeps the radar's processor from its frames.
        let quiet = GuiMonitor {
            points: PointOutput::Off,
            range_profile: false,
            statistics: false,
            ..GuiMonitor::default()
        };
        let full = GuiMonitor { azimuth_heatmap: true, range_doppler_heatmap: true, ..GuiMonitor::default() };
        let demo = DemoOptions {
            lvds: if raw { LvdsStream::RAW } else { LvdsStream::default() },
            gui: if raw { quiet } else { full },
            ..DemoOptions::default()
        };
        let mut text = String::new();
        // There is room for any profile.
        let _ = cfg::write(&config.profile, &demo, &mut text);
        let last = text.trim_end().rfind('\n').map_or(0, |at| at + 1);
        let end = text.len();
        (Self { text: text.clone(), at: 0, end: last }, Self { text, at: last, end })
    }

    fn only(line: &str) -> Self {
        let mut text = String::new();
        // There is room for a line.
        let _ = text.push_str(line);
        Self { at: 0, end: text.len(), text }
    }
}

impl Iterator for Script {
    type Item = String<MAX_LINE>;

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.text.get(self.at..self.end).filter(|rest| !rest.is_empty())?;
        let line = rest.split('\n').next().unwrap_or(rest);
        self.at += line.len() + 1;
        // One that is too long is cut and then refused by the radar; the writer's are not.
        Some(line.chars().take(MAX_LINE).collect())
    }
}

#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant, reason = "there is one of them")]
enum Phase {
    Stopped,
    Waiting { until: BridgeTime },
    Programming(Session<Script>),
    Recorder(Setup),
    Starting(Session<Script>),
    Silent { since: BridgeTime },
    Streaming { heard: BridgeTime },
    StoppingRadar(Session<Script>),
    StoppingRecorder(Setup),
}

/// The radar's and its recorder's state machine.
#[derive(Debug)]
pub struct RadarControl {
    config: RadarConfig,
    phase: Phase,
    state: RadarState,
    progress: u32,
    /// The radar's command line answers, as far as is known.
    console: bool,
    /// A stop waits for the session under way.
    stop: bool,
    /// Pieces of data before the radar was last programmed.
    before: u32,
    strays: u32,
}

/// The phase in which the radar is stopped.
fn stopping() -> Phase {
    Phase::StoppingRadar(Session::new(Script::only("sensorStop"), Timeouts::default()))
}

type Sink<'s> = dyn FnMut(ControlAction<'_>) + 's;

impl RadarControl {
    /// A control that is stopped, of a configuration that is valid.
    pub fn new(config: &RadarConfig) -> Self {
        Self {
            config: config.clone(),
            phase: Phase::Stopped,
            state: RadarState::Stopped,
            progress: 0,
            console: true,
            stop: false,
            before: 0,
            strays: 0,
        }
    }

    /// Takes what happened at `now`, and says what is to be done.
    pub fn handle(
        &mut self,
        now: BridgeTime,
        input: ControlInput<'_>,
        mut act: impl FnMut(ControlAction<'_>),
    ) {
        let out: &mut Sink<'_> = &mut act;
        match input {
            ControlInput::Start => {
                if matches!(self.phase, Phase::Stopped | Phase::StoppingRadar(_) | Phase::StoppingRecorder(_))
                {
                    self.program();
                }
                self.stop = false;
            }
            ControlInput::Stop => match self.phase {
                Phase::Stopped | Phase::StoppingRadar(_) | Phase::StoppingRecorder(_) => {}
                // The radar hears nothing while it works on a line.
                Phase::Programming(_) | Phase::Starting(_) => self.stop = true,
                _ => self.phase = stopping(),
            },
            ControlInput::Recorder(bytes) => self.recorder(bytes, out),
            ControlInput::Console(bytes) => self.console(now, bytes, out),
            ControlInput::Progress(count) => self.progress(now, count),
            ControlInput::Tick => self.tick(now, out),
        }
        self.advance(now, out);
        let state = self.state_of_phase();
        if state != self.state {
            self.state = state;
            out(ControlAction::State(state));
        }
    }

    /// When [`ControlInput::Tick`] is next due.
    pub fn deadline(&self) -> Option<BridgeTime> {
        match &self.phase {
            Phase::Stopped => None,
            Phase::Waiting { until } => Some(*until),
            Phase::Programming(session) | Phase::Starting(session) | Phase::StoppingRadar(session) => {
                session.deadline()
            }
            Phase::Recorder(setup) | Phase::StoppingRecorder(setup) => setup.deadline(),
            Phase::Silent { since } => Some(since.after(SILENT_US)),
            Phase::Streaming { heard } => Some(heard.after(QUIET_US)),
        }
    }

    /// State of the radar.
    pub fn state(&self) -> RadarState {
        self.state
    }

    /// Datagrams that are none of the recorder's.
    pub fn strays(&self) -> u32 {
        self.strays
    }

    fn state_of_phase(&self) -> RadarState {
        match self.phase {
            Phase::Stopped => RadarState::Stopped,
            Phase::Waiting { .. } => RadarState::Waiting,
            Phase::Programming(_) | Phase::Starting(_) | Phase::StoppingRadar(_) => RadarState::Programming,
            Phase::Recorder(_) | Phase::StoppingRecorder(_) => RadarState::Recorder,
            Phase::Silent { .. } => RadarState::Silent,
            Phase::Streaming { .. } => RadarState::Streaming,
        }
    }

    fn is_raw(&self) -> bool {
        matches!(self.config.input, RadarInput::Dca1000 { .. })
    }

    fn program(&mut self) {
        self.before = self.progress;
        self.phase = Phase::Programming(Session::new(Script::of(&self.config).0, Timeouts::default()));
    }

    fn recorder(&mut self, bytes: &[u8], out: &mut Sink<'_>) {
        match Answer::decode(bytes) {
            Ok(answer) if answer.code == Code::SystemStatus => {
                for report in answer.reports() {
                    out(ControlAction::Notice(ControlNotice::Report(report)));
                }
            }
            Ok(answer) => {
                if let Phase::Recorder(setup) | Phase::StoppingRecorder(setup) = &mut self.phase {
                    setup.receive(answer);
                }
            }
            Err(_) => self.strays = self.strays.wrapping_add(1),
        }
    }

    fn console(&mut self, now: BridgeTime, mut bytes: &[u8], out: &mut Sink<'_>) {
        let (Phase::Programming(session) | Phase::Starting(session) | Phase::StoppingRadar(session)) =
            &mut self.phase
        else {
            return;
        };
        while let Some(event) = session.receive(&mut bytes, now) {
            if let Event::Failed(failure) = event {
                out(ControlAction::Notice(ControlNotice::Console(failure)));
            }
        }
    }

    fn progress(&mut self, now: BridgeTime, count: u32) {
        if core::mem::replace(&mut self.progress, count) == count {
            return;
        }
        if let Phase::Silent { .. } | Phase::Streaming { .. } = self.phase {
            self.phase = Phase::Streaming { heard: now };
        }
    }

    fn tick(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        if self.deadline().is_none_or(|deadline| now < deadline) {
            return;
        }
        match &mut self.phase {
            Phase::Stopped => {}
            Phase::Waiting { .. } => self.program(),
            Phase::Programming(session) | Phase::Starting(session) | Phase::StoppingRadar(session) => {
                if let Some(Event::Failed(failure)) = session.tick(now)
                    && failure.error != CliError::Timeout
                {
                    out(ControlAction::Notice(ControlNotice::Console(failure)));
                }
            }
            Phase::Recorder(setup) | Phase::StoppingRecorder(setup) => setup.tick(now),
            Phase::Silent { .. } => self.program(),
            Phase::Streaming { .. } => {
                out(ControlAction::Notice(ControlNotice::NoData((QUIET_US / 1_000_000) as u32)));
                self.phase = Phase::Silent { since: now };
            }
        }
    }

    /// Sends what may go, and goes on to the next phase where one is done.
    fn advance(&mut self, now: BridgeTime, out: &mut Sink<'_>) {
        // Each pass ends a phase; no more follow each other without waiting.
        const MOST_PHASES: usize = 4;
        for _ in 0..MOST_PHASES {
            let next = match &mut self.phase {
                Phase::Stopped | Phase::Waiting { .. } | Phase::Silent { .. } | Phase::Streaming { .. } => {
                    return;
                }
                Phase::Programming(session) | Phase::Starting(session) | Phase::StoppingRadar(session) => {
                    while let Some(line) = session.transmit(now) {
                        out(ControlAction::Console(line));
                    }
                    let failed = session.failure().map(|f| (f.error, f.number));
                    match (failed, session.is_finished()) {
                        (None, false) => return,
                        (None, true) => self.console_done(now),
                        (Some(failure), _) => self.console_failed(now, failure, out),
                    }
                }
                Phase::Recorder(setup) | Phase::StoppingRecorder(setup) => {
                    if let Some(bytes) = setup.transmit(now) {
                        out(ControlAction::Recorder(&bytes));
                    }
                    match setup.outcome() {
                        None => return,
                        Some(outcome) => self.recorder_done(now, outcome, out),
                    }
                }
            };
            self.phase = if core::mem::take(&mut self.stop) { stopping() } else { next };
        }
    }

    fn console_done(&mut self, now: BridgeTime) -> Phase {
        match &self.phase {
            Phase::Programming(_) => {
                self.console = true;
                self.after_program()
            }
            Phase::StoppingRadar(_) => self.after_stop(),
            _ => Phase::Silent { since: now },
        }
    }

    fn after_program(&self) -> Phase {
        match self.config.input {
            RadarInput::Dca1000 { packet_delay_us, .. } => Phase::Recorder(Setup::start(packet_delay_us)),
            RadarInput::Uart => self.starting(),
        }
    }

    fn after_stop(&self) -> Phase {
        if self.is_raw() { Phase::StoppingRecorder(Setup::stop()) } else { Phase::Stopped }
    }

    fn starting(&self) -> Phase {
        Phase::Starting(Session::new(Script::of(&self.config).1, Timeouts::default()))
    }

    fn console_failed(
        &mut self,
        now: BridgeTime,
        (error, line): (CliError, u32),
        out: &mut Sink<'_>,
    ) -> Phase {
        match &self.phase {
            Phase::StoppingRadar(session) => {
                if let Some(failure) = session.failure().filter(|_| self.console) {
                    out(ControlAction::Notice(ControlNotice::Console(failure)));
                }
                self.after_stop()
            }
            // Nothing was ever answered.
            Phase::Programming(_) if error == CliError::Timeout && line <= 1 => {
                if core::mem::take(&mut self.console) {
                    out(ControlAction::Notice(ControlNotice::NoConsole));
                }
                // Somebody started it meanwhile: a new recording would begin within a frame.
                let streams = self.progress != self.before;
                if self.is_raw() && !streams { self.after_program() } else { Phase::Silent { since: now } }
            }
            Phase::Programming(session) | Phase::Starting(session) => {
                if error == CliError::Timeout
                    && let Some(failure) = session.failure()
                {
                    out(ControlAction::Notice(ControlNotice::Console(failure)));
                }
                Phase::Waiting { until: now.after(RETRY_US) }
            }
            _ => Phase::Waiting { until: now.after(RETRY_US) },
        }
    }

    fn recorder_done(&self, now: BridgeTime, outcome: Result<(), SetupError>, out: &mut Sink<'_>) -> Phase {
        if let Phase::StoppingRecorder(_) = self.phase {
            return Phase::Stopped;
        }
        match outcome {
            Ok(()) if self.console => self.starting(),
            Ok(()) => Phase::Silent { since: now },
            Err(error) => {
                out(ControlAction::Notice(ControlNotice::Recorder(error)));
                Phase::Waiting { until: now.after(RETRY_US) }
            }
        }
    }
}

#[cfg(test)]
mod tests;
