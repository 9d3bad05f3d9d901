use std::string::{String, ToString};
use std::vec::Vec;

use rfhoi_shared::config::BridgeConfig;

use super::*;
use crate::dca1000::command::Command;

/// The radar and its recorder, which answer at once.
struct World {
    control: RadarControl,
    now: BridgeTime,
    console_answers: bool,
    refuses: &'static str,
    recorder_answers: bool,
    lines: Vec<String>,
    commands: Vec<Command>,
    notices: Vec<String>,
    states: Vec<RadarState>,
}

impl World {
    fn new(input: RadarInput) -> Self {
        let config = RadarConfig { input, ..BridgeConfig::default().radar };
        Self {
            control: RadarControl::new(&config),
            now: BridgeTime(0),
            console_answers: true,
            refuses: "-",
            recorder_answers: true,
            lines: Vec::new(),
            commands: Vec::new(),
            notices: Vec::new(),
            states: Vec::new(),
        }
    }

    fn give(&mut self, input: ControlInput<'_>) {
        let mut replies: Vec<(bool, Vec<u8>)> = Vec::new();
        let Self { control, now, lines, commands, notices, states, .. } = self;
        let (console_answers, recorder_answers, refuses) =
            (self.console_answers, self.recorder_answers, self.refuses);
        control.handle(*now, input, |action| match action {
            ControlAction::Console(line) => {
                let line = line.trim_end().to_string();
                let answer =
                    if line.starts_with(refuses) { "Error -1\nmmwDemo:/>" } else { "Done\nmmwDemo:/>" };
                if console_answers {
                    let answer = if line.is_empty() { "mmwDemo:/>" } else { answer };
                    replies.push((true, answer.into()));
                }
                if !line.is_empty() {
                    lines.push(line);
                }
            }
            ControlAction::Recorder(bytes) => {
                let command = Command::decode(bytes).unwrap();
                if recorder_answers {
                    replies.push((false, Answer { code: command.code(), status: 0 }.encode().into()));
                }
                commands.push(command);
            }
            ControlAction::State(state) => states.push(state),
            ControlAction::Notice(notice) => notices.push(notice.to_string()),
        });
        for (console, reply) in replies {
            self.give(if console { ControlInput::Console(&reply) } else { ControlInput::Recorder(&reply) });
        }
    }

    /// Lets time pass in which no data comes.
    fn pass(&mut self, seconds: u64) {
        let end = self.now.after(seconds * 1_000_000);
        while let Some(deadline) = self.control.deadline().filter(|d| *d <= end) {
            self.now = self.now.max(deadline);
            self.give(ControlInput::Tick);
        }
        self.now = end;
    }
}

fn raw() -> RadarInput {
    BridgeConfig::default().radar.input
}

#[test]
fn the_recorder_starts_between_the_program_and_the_sensor() {
    let mut world = World::new(raw());
    world.give(ControlInput::Start);
    assert_eq!(world.lines.first().unwrap(), "sensorStop");
    assert_eq!(world.lines.last().unwrap(), "sensorStart");
    assert_eq!(world.lines.iter().filter(|l| *l == "sensorStart").count(), 1);
    assert!(world.lines.contains(&"lvdsStreamCfg -1 0 1 0".into()), "{:?}", world.lines);
    assert_eq!(world.commands.last(), Some(&Command::RecordStart));
    use RadarState::{Programming, Recorder, Silent, Streaming};
    assert_eq!(world.states, [Programming, Recorder, Programming, Silent]);
    world.give(ControlInput::Progress(1));
    assert_eq!(world.states.last(), Some(&Streaming));
    assert!(world.notices.is_empty(), "{:?}", world.notices);
    world.give(ControlInput::Stop);
    assert_eq!(world.lines.last().unwrap(), "sensorStop");
    assert_eq!(world.commands.last(), Some(&Command::RecordStop));
    assert_eq!(world.control.state(), RadarState::Stopped);
    assert_eq!(world.control.deadline(), None);
}

#[test]
fn a_stop_waits_for_the_line_under_way() {
    let mut world = World::new(raw());
    world.console_answers = false;
    world.give(ControlInput::Start);
    world.give(ControlInput::Console(b"mmwDemo:/>"));
    assert_eq!(world.lines.last().unwrap(), "sensorStop");
    world.give(ControlInput::Stop);
    assert_eq!(world.lines.len(), 1, "the radar works on a line");
    world.console_answers = true;
    world.give(ControlInput::Console(b"Done\nmmwDemo:/>"));
    assert_eq!(world.control.state(), RadarState::Stopped);
    assert_eq!(world.lines.last().unwrap(), "sensorStop");
}

#[test]
fn a_radar_on_its_uart_needs_no_recorder() {
    let mut world = World::new(RadarInput::Uart);
    world.give(ControlInput::Start);
    assert_eq!((world.commands.len(), world.control.state()), (0, RadarState::Silent));
    assert!(world.lines.iter().any(|l| l.starts_with("guiMonitor -1 1 1 0 1 1")), "{:?}", world.lines);
    world.give(ControlInput::Stop);
    assert_eq!((world.commands.len(), world.control.state()), (0, RadarState::Stopped));
}

#[test]
fn a_refused_line_is_told_and_all_is_tried_again() {
    let mut world = World::new(raw());
    world.refuses = "profileCfg";
    world.give(ControlInput::Start);
    assert_eq!(world.control.state(), RadarState::Waiting);
    assert!(world.notices[0].contains("profileCfg"), "{:?}", world.notices);
    assert_eq!((world.notices.len(), world.commands.len()), (1, 0));
    world.refuses = "-";
    world.pass(RETRY_US / 1_000_000);
    assert_eq!((world.control.state(), world.notices.len()), (RadarState::Silent, 1));
}

#[test]
fn an_absent_recorder_is_told_and_looked_for_again() {
    let mut world = World::new(raw());
    world.recorder_answers = false;
    world.give(ControlInput::Start);
    world.pass(4);
    assert_eq!(world.control.state(), RadarState::Waiting);
    assert!(world.notices[0].contains("does not answer SystemConnect"), "{:?}", world.notices);
    assert!(!world.lines.contains(&"sensorStart".into()));
    world.recorder_answers = true;
    world.pass(RETRY_US / 1_000_000);
    assert_eq!(world.control.state(), RadarState::Silent);
}

#[test]
fn without_a_command_line_the_recorder_runs_and_waits() {
    let mut world = World::new(raw());
    world.console_answers = false;
    world.give(ControlInput::Start);
    world.pass(60);
    assert_eq!((world.control.state(), world.notices.len()), (RadarState::Silent, 1), "told once");
    world.give(ControlInput::Progress(5));
    assert_eq!(world.control.state(), RadarState::Streaming);
}

#[test]
fn a_radar_that_comes_up_late_is_programmed() {
    let mut world = World::new(raw());
    world.console_answers = false;
    world.give(ControlInput::Start);
    world.pass(30);
    world.console_answers = true;
    world.pass((SILENT_US + 2_000_000) / 1_000_000);
    assert_eq!(world.lines.last().unwrap(), "sensorStart");
}

#[test]
fn a_recording_that_begins_while_the_command_line_is_tried_goes_on() {
    let mut world = World::new(raw());
    world.console_answers = false;
    world.give(ControlInput::Start);
    while world.control.state() != RadarState::Silent {
        world.pass(1);
    }
    let recordings = |world: &World| world.commands.iter().filter(|c| **c == Command::RecordStart).count();
    let before = recordings(&world);
    while world.control.state() != RadarState::Programming {
        world.pass(1);
    }
    world.give(ControlInput::Progress(1));
    world.pass(3);
    assert_eq!(recordings(&world), before);
    world.give(ControlInput::Progress(2));
    assert_eq!(world.control.state(), RadarState::Streaming);
}

#[test]
fn a_radar_that_falls_silent_is_programmed_again() {
    let mut world = World::new(raw());
    world.give(ControlInput::Start);
    world.give(ControlInput::Progress(1));
    world.pass(QUIET_US / 1_000_000);
    assert_eq!((world.control.state(), world.notices.len()), (RadarState::Silent, 1));
    world.pass(SILENT_US / 1_000_000);
    assert_eq!(world.lines.iter().filter(|l| *l == "sensorStart").count(), 2);
    assert_eq!(world.commands.iter().filter(|c| **c == Command::RecordStart).count(), 2);
}

#[test]
fn reports_are_told_and_strays_counted() {
    let mut world = World::new(raw());
    world.give(ControlInput::Start);
    world.give(ControlInput::Recorder(&Answer { code: Code::SystemStatus, status: 1 << 7 }.encode()));
    world.give(ControlInput::Recorder(b"garbage"));
    world.give(ControlInput::Console(b"garbage\r\n"));
    assert_eq!(
        (world.notices.as_slice(), world.control.strays()),
        (&["the DCA1000EVM reports DdrFull".to_string()][..], 1)
    );
    assert_eq!(world.control.state(), RadarState::Silent);
}
