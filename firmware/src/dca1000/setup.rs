//! Sets the recorder up: commands one by one, each after the last one's answer.
//!
//! Sans-I/O, as [`crate::mmwave::cli::Session`]: [`Setup::transmit`] gives the next command's bytes when it may go,
//! [`Setup::receive`] takes datagrams of the recorder, [`Setup::tick`] is called at [`Setup::deadline`]. UDP may lose a
//! command or its answer, so one that is not answered is sent again: all of them can be repeated.

use core::fmt;

use heapless::Vec;
use rfhoi_shared::units::BridgeTime;

use super::command::{Answer, Code, Command, Lanes, MAX_COMMAND};

/// Wait for an answer, us; the FPGA answers within milliseconds.
const ANSWER_US: u64 = 300_000;
/// Times that a command is sent before the recorder counts as absent. After its mode is set it is deaf for a while; and
/// after a start the IP stack looks up one address a second, of which the recorder's may be the third.
const TRIES: u8 = 10;
/// Bytes of a datagram that TI's tools ask for; the FPGA then sends 1466, of which 1456 are samples.
const PACKET_BYTES: u16 = 1470;

/// Why the recorder could not be set up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SetupError {
    /// It did not answer this command.
    Silent(Code),
    /// It answered this command with a failure.
    Failed(Code),
    /// The command cannot be sent: the packet delay is out of range.
    Unsendable(Code),
}

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent(code) => {
                write!(f, "the DCA1000EVM does not answer {code:?}: check its power, cable and address")
            }
            Self::Failed(code) => write!(f, "the DCA1000EVM failed at {code:?}: power it off and on"),
            Self::Unsendable(code) => write!(f, "{code:?} cannot be sent: check the packet delay"),
        }
    }
}

impl core::error::Error for SetupError {}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Ready,
    Sent { until: BridgeTime },
    Finished,
    Failed(SetupError),
}

/// The commands that make the recorder stream, and where they are.
#[derive(Debug, Clone)]
pub struct Setup {
    commands: Vec<Command, 5>,
    at: usize,
    tries: u8,
    state: State,
}

impl Setup {
    /// Starts a recording with this pause between datagrams, us; one under way is ended first.
    pub fn start(delay_us: u16) -> Self {
        let packets = Command::ConfigurePackets { bytes: PACKET_BYTES, delay_us };
        Self::new([
            Command::SystemConnect,
            Command::RecordStop,
            Command::ConfigureFpga(Lanes::Two),
            packets,
            Command::RecordStart,
        ])
    }

    /// Ends the recording.
    pub fn stop() -> Self {
        Self::new([Command::RecordStop])
    }

    fn new(commands: impl IntoIterator<Item = Command>) -> Self {
        Self { commands: commands.into_iter().collect(), at: 0, tries: 0, state: State::Ready }
    }

    /// The command to send now, if one may go.
    pub fn transmit(&mut self, now: BridgeTime) -> Option<Vec<u8, MAX_COMMAND>> {
        if self.state != State::Ready {
            return None;
        }
        let Some(command) = self.commands.get(self.at) else {
            self.state = State::Finished;
            return None;
        };
        match command.encode() {
            Ok(bytes) => {
                self.tries += 1;
                self.state = State::Sent { until: now.after(ANSWER_US) };
                Some(bytes)
            }
            Err(_) => {
                self.state = State::Failed(SetupError::Unsendable(command.code()));
                None
            }
        }
    }

    /// Takes an answer. One to another command, such as a late second one, is ignored.
    pub fn receive(&mut self, answer: Answer) {
        let Some(command) = self.commands.get(self.at) else { return };
        if !matches!(self.state, State::Sent { .. }) || answer.code != command.code() {
            return;
        }
        // A recorder that is not recording may call stopping a failure.
        if answer.status == 0 || *command == Command::RecordStop {
            self.at += 1;
            self.tries = 0;
            self.state = State::Ready;
        } else {
            self.state = State::Failed(SetupError::Failed(answer.code));
        }
    }

    /// Call at [`Self::deadline`] or later.
    pub fn tick(&mut self, now: BridgeTime) {
        let State::Sent { until } = self.state else { return };
        if now < until {
            return;
        }
        let code = self.commands.get(self.at).map_or(Code::SystemConnect, |c| c.code());
        self.state = if self.tries < TRIES { State::Ready } else { State::Failed(SetupError::Silent(code)) };
    }

    /// When [`Self::tick`] has something to do.
    pub fn deadline(&self) -> Option<BridgeTime> {
        if let State::Sent { until } = self.state { Some(until) } else { None }
    }

    /// `None` while commands are under way; then how it ended.
    pub fn outcome(&self) -> Option<Result<(), SetupError>> {
        match self.state {
            State::Finished => Some(Ok(())),
            State::Failed(error) => Some(Err(error)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Runs `setup` against a recorder that answers `reply(command, how often it came)`; the commands sent.
    fn run(mut setup: Setup, reply: impl Fn(Command, usize) -> Option<u16>) -> (Setup, Vec<Command>) {
        let (mut now, mut sent) = (BridgeTime(0), Vec::new());
        while setup.outcome().is_none() {
            if let Some(bytes) = setup.transmit(now) {
                let command = Command::decode(&bytes).unwrap();
                sent.push(command);
                let times = sent.iter().filter(|c| **c == command).count();
                if let Some(status) = reply(command, times) {
                    setup.receive(Answer { code: command.code(), status });
                }
            } else if let Some(deadline) = setup.deadline() {
                now = deadline;
                setup.tick(now);
            }
        }
        (setup, sent)
    }

    #[test]
    fn a_recorder_is_set_up_in_order_and_recording_starts_last() {
        let (setup, sent) = run(Setup::start(60), |_, _| Some(0));
        assert_eq!(setup.outcome(), Some(Ok(())));
        assert_eq!(sent.len(), 5);
        assert_eq!(sent[3], Command::ConfigurePackets { bytes: 1470, delay_us: 60 });
        assert_eq!(sent[4], Command::RecordStart);
    }

    #[test]
    fn lost_commands_are_repeated_and_a_refused_stop_is_no_failure() {
        let (setup, sent) = run(Setup::start(60), |command, times| {
            let status = u16::from(command == Command::RecordStop);
            (times >= 3).then_some(status)
        });
        assert_eq!((setup.outcome(), sent.len()), (Some(Ok(())), 15));
    }

    #[test]
    fn absence_and_failure_are_told_apart() {
        let (setup, sent) = run(Setup::start(60), |_, _| None);
        assert_eq!(setup.outcome(), Some(Err(SetupError::Silent(Code::SystemConnect))));
        assert_eq!(sent.len(), usize::from(TRIES));
        let (setup, _) = run(Setup::start(60), |c, _| Some(u16::from(c == Command::RecordStart)));
        assert_eq!(setup.outcome(), Some(Err(SetupError::Failed(Code::RecordStart))));
        let (setup, _) = run(Setup::start(3), |_, _| Some(0));
        assert_eq!(setup.outcome(), Some(Err(SetupError::Unsendable(Code::ConfigurePackets))));
    }

    #[test]
    fn answers_to_other_commands_are_ignored() {
        let mut setup = Setup::stop();
        setup.receive(Answer { code: Code::RecordStop, status: 0 });
        setup.transmit(BridgeTime(0)).unwrap();
        setup.receive(Answer { code: Code::RecordStart, status: 0 });
        assert_eq!(setup.outcome(), None);
        setup.receive(Answer { code: Code::RecordStop, status: 0 });
        assert_eq!(setup.transmit(BridgeTime(0)), None);
        assert_eq!(setup.outcome(), Some(Ok(())));
    }
}
