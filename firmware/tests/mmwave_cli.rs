//! A CLI session against a simulated radar that answers as the SDK's demo does.

use proptest::collection::vec;
use proptest::prelude::*;
use rfhoi_firmware::mmwave::cfg::{self, DemoOptions, TEXT_CAPACITY};
use rfhoi_firmware::mmwave::cli::{CliError, Event, MAX_LINE, Session, Timeouts};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::BridgeTime;

const NOW: BridgeTime = BridgeTime(1_000_000);
const PROMPT: &str = "mmwDemo:/>";

/// The demo's command line, as `cli.c` of the SDK writes to its UART.
#[derive(Default)]
struct SimulatedRadar {
    line: String,
    started: bool,
    mute_prompt: bool,
    no_echo: bool,
    commands: Vec<String>,
}

impl SimulatedRadar {
    fn hear(&mut self, bytes: &[u8]) -> String {
        let mut said = String::new();
        for &byte in bytes {
            if byte != b'\n' {
                self.line.push(char::from(byte));
                continue;
            }
            if !self.no_echo {
                said += &self.line;
                said += "\r\n";
            }
            let line = std::mem::take(&mut self.line);
            self.answer(&line, &mut said);
            if !self.mute_prompt {
                said += PROMPT;
            }
        }
        said
    }

    fn answer(&mut self, line: &str, said: &mut String) {
        let Some(command) = line.split_whitespace().next() else { return };
        self.commands.push(line.into());
        match command {
            "sensorStop" if !self.started => *said += "Ignored: Sensor is already stopped\n",
            "sensorStart" if self.started => *said += "Ignored: Sensor is already started\n",
            "sensorStart" => {
                *said += "Debug: Init Calibration Status = 0x1ffe\r\n";
                self.started = true;
            }
            "version" => {
                *said += "Platform                : xWR18xx\r\nmmWave SDK Version      : 03.06.00.00\r\n"
            }
            "channelCfg" if line != "channelCfg 15 7 0" => {
                *said += "Error: Invalid usage of the CLI command\nError -1\n";
                return;
            }
            c if !is_known(c) => {
                *said += &format!("'{c}' is not recognized as a CLI command\n");
                return;
            }
            _ => {}
        }
        *said += "Done\r\n\n";
    }
}

/// The profile that the sessions below send.
fn stock_text() -> heapless::String<TEXT_CAPACITY> {
    let mut text = heapless::String::new();
    cfg::write(&RadarProfile::bridge(), &DemoOptions::default(), &mut text).expect("fits");
    text
}

fn is_known(command: &str) -> bool {
    command == "version" || stock_text().lines().any(|line| line.split(' ').next() == Some(command))
}

/// What a session came to.
#[derive(Debug, Default, PartialEq)]
struct Report {
    texts: Vec<String>,
    done: Vec<u32>,
    ignored: Vec<u32>,
    failure: Option<(u32, String, CliError, String)>,
}

impl Report {
    fn take(&mut self, event: Event<'_>) {
        match event {
            Event::Text(text) => self.texts.push(text.into()),
            Event::Done { line, ignored } => {
                self.done.push(line);
                if ignored {
                    self.ignored.push(line);
                }
            }
            Event::Failed(f) => self.failure = Some((f.number, f.line.into(), f.error, f.answer.into())),
        }
    }
}

/// Runs `text` against `radar`, whose answers come in chunks of this size.
fn run(text: &str, radar: &mut SimulatedRadar, chunk: usize) -> (Report, bool) {
    let mut session = Session::new(text.lines(), Timeouts::default());
    let mut report = Report::default();
    let mut now = NOW;
    loop {
        if let Some(bytes) = session.transmit(now) {
            let said = radar.hear(bytes.as_bytes());
            for mut bytes in said.as_bytes().chunks(chunk) {
                while let Some(event) = session.receive(&mut bytes, now) {
                    report.take(event);
                }
            }
        } else if let Some(deadline) = session.deadline() {
            now = deadline;
            if let Some(event) = session.tick(now) {
                report.take(event);
            }
        } else {
            return (report, session.is_finished());
        }
    }
}

#[test]
fn a_profile_is_sent_line_by_line() {
    for chunk in [1, 3, 1000] {
        let mut radar = SimulatedRadar::default();
        let (report, finished) = run(&stock_text(), &mut radar, chunk);
        assert!(finished && report.failure.is_none(), "{report:?}");
        assert_eq!(radar.commands, stock_text().lines().collect::<Vec<_>>());
        assert_eq!(report.done, (1..=30).collect::<Vec<_>>());
        assert_eq!(report.ignored, [1], "the radar was stopped before");
        assert_eq!(report.texts, ["Debug: Init Calibration Status = 0x1ffe"]);
    }
}

#[test]
fn without_echo_or_prompt_too() {
    for (no_echo, mute_prompt) in [(true, false), (false, true), (true, true)] {
        let mut radar = SimulatedRadar { no_echo, mute_prompt, ..SimulatedRadar::default() };
        let (report, finished) = run(&stock_text(), &mut radar, 5);
        assert!(finished, "{report:?}");
        assert_eq!(report.done.len(), 30);
    }
}

#[test]
fn a_started_radar_ignores_its_start() {
    let mut radar = SimulatedRadar { started: true, ..SimulatedRadar::default() };
    let (report, finished) = run("% comment\r\n\r\nversion\r\nsensorStart\r\n", &mut radar, 4);
    assert!(finished);
    assert_eq!((report.done, report.ignored), (vec![3, 4], vec![4]));
    assert_eq!(report.texts, ["Platform                : xWR18xx", "mmWave SDK Version      : 03.06.00.00"]);
}

#[test]
fn a_refused_line_is_named() {
    let (report, finished) =
        run("flushCfg\nchannelCfg 15 9 0\nsensorStart\n", &mut SimulatedRadar::default(), 2);
    assert!(!finished);
    assert_eq!(report.done, [1]);
    let why = "Error: Invalid usage of the CLI command";
    assert_eq!(report.failure, Some((2, "channelCfg 15 9 0".into(), CliError::Refused, why.into())));

    let (report, _) = run("flushCgf\n", &mut SimulatedRadar::default(), 2);
    let why = "'flushCgf' is not recognized as a CLI command";
    assert_eq!(report.failure, Some((1, "flushCgf".into(), CliError::Unknown, why.into())));
}

#[test]
fn noise_left_in_the_radar_is_flushed() {
    let mut radar = SimulatedRadar { line: "\u{e9}x?".into(), ..SimulatedRadar::default() };
    let (report, finished) = run("sensorStop\nflushCfg\n", &mut radar, 1);
    assert!(finished, "{report:?}");
    assert_eq!(report.done, [1, 2]);
}

/// A session that has just sent `line`.
fn waiting(line: &str) -> Session<std::str::Lines<'_>> {
    let mut session = Session::new(line.lines(), Timeouts::default());
    assert_eq!(session.transmit(NOW), Some("\n"));
    assert_eq!(session.receive(&mut PROMPT.as_bytes(), NOW), None);
    assert_eq!(session.transmit(NOW), Some(format!("{line}\n").as_str()));
    assert_eq!(session.transmit(NOW), None, "each line is given once");
    session
}

#[test]
fn a_silent_radar_times_out() {
    let timeouts = Timeouts::default();
    for (line, wait) in [("flushCfg", timeouts.answer_us), ("sensorStart 0", timeouts.start_us)] {
        let mut session = waiting(line);
        let deadline = NOW.after(wait);
        assert_eq!(session.deadline(), Some(deadline));
        assert_eq!(session.tick(BridgeTime(deadline.0 - 1)), None);
        let event = session.tick(deadline);
        assert!(
            matches!(event, Some(Event::Failed(f)) if f.error == CliError::Timeout && f.line == line),
            "{event:?}"
        );
        assert_eq!(session.deadline(), None);
        assert_eq!(session.transmit(deadline), None);
        let text = session.failure().expect("failed").to_string();
        assert_eq!(text, format!("the radar does not answer line 1, `{line}`"));
    }
}

#[test]
fn ends_of_answers() {
    let outcome = |said: &str| {
        let mut session = waiting("sensorStop");
        let mut report = Report::default();
        let mut bytes = said.as_bytes();
        while let Some(event) = session.receive(&mut bytes, NOW) {
            report.take(event);
        }
        (report.done == [1], report.ignored == [1], report.failure.map(|f| (f.2, f.3)), session.counts())
    };
    // `Ignored` without `Done`, as some versions answer: the prompt ends it.
    let (done, ignored, failure, _) = outcome("Ignored: Sensor is already stopped\nmmwDemo:/>");
    assert!(done && ignored && failure.is_none());
    // A complaint without a code.
    let (done, _, failure, _) = outcome("Error: no\r\nmmwDemo:/>");
    assert!(!done && failure == Some((CliError::Refused, "Error: no".into())));
    let (done, _, failure, _) = outcome("Error: no\r\nDone\r\n");
    assert!(!done && failure == Some((CliError::Refused, "Error: no".into())));
    let (_, _, failure, _) = outcome("Error -203620\r\n");
    assert_eq!(failure, Some((CliError::Refused, "Error -203620".into())));
    // A prompt from before the line ends nothing.
    let (done, _, failure, _) = outcome("mmwDemo:/>mmwDemo:/>sensorStop\r\n");
    assert!(!done && failure.is_none());
    // Bytes that are no text are passed over; a long line is cut.
    let (done, _, _, counts) = outcome("\0\u{ff}Do\u{7f}ne\r\n");
    assert!(done && counts.noise_bytes == 4);
    let (done, _, _, counts) = outcome(&format!("{}\r\nDone\n", "x".repeat(300)));
    assert!(done && counts.overlong_bytes == 100);
}

#[test]
fn what_cannot_be_sent_is_not() {
    for line in ["x".repeat(MAX_LINE + 1), "frameCfg \u{b5}".into(), "a\x07b".into()] {
        let (report, finished) = run(&line, &mut SimulatedRadar::default(), 9);
        assert!(!finished && report.done.is_empty());
        let mut session = Session::new(line.lines(), Timeouts::default());
        session.transmit(NOW);
        session.tick(NOW.after(Timeouts::default().prompt_us));
        assert_eq!(session.transmit(NOW), None);
        assert_eq!(session.failure().map(|f| (f.number, f.error)), Some((1, CliError::Unsendable)));
    }
    let longest = "x".repeat(MAX_LINE);
    assert_eq!(waiting(&longest).failure(), None);
}

proptest! {
    #[test]
    fn any_answer_is_safe(
        pieces in vec(prop_oneof![
            vec(any::<u8>(), 0..20),
            prop::sample::select(vec!["Done\r\n", "Error -1\n", "Error: x\n", "Ignored\n", PROMPT, "flushCfg\n", "\n"])
                .prop_map(|s| s.as_bytes().to_vec()),
        ], 0..20),
        chunk in 1usize..20,
    ) {
        let bytes = pieces.concat();
        let outcome = |chunk: usize| {
            let mut session = Session::new(["flushCfg", "sensorStop", "sensorStart"].iter(), Timeouts::default());
            let mut report = Report::default();
            let mut now = NOW;
            let _ = session.transmit(now);
            for mut input in bytes.chunks(chunk) {
                while let Some(event) = session.receive(&mut input, now) {
                    report.take(event);
                }
                assert!(input.is_empty());
            }
            while let Some(deadline) = session.deadline() {
                now = now.max(deadline);
                if let Some(event) = session.tick(now) {
                    report.take(event);
                }
                let _ = session.transmit(now);
            }
            report
        };
        prop_assert_eq!(outcome(chunk), outcome(1000));
    }
}
