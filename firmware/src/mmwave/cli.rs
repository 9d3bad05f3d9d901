//! A session on the demo's command line (UART, 115 200 baud, 8N1): sends lines one by one, each after the last one's
//! answer.
//!
//! ```text
//! bridge --> channelCfg 15 7 0\n
//! radar  --> channelCfg 15 7 0      echo, where the demo has it on
//!            Done                   or `Error -1`, or an unknown command's `'x' is not recognized as a CLI command`
//!            mmwDemo:/>             prompt: the radar listens again
//! ```
//!
//! Sans-I/O: [`Session::transmit`] gives the bytes of the next line when it may go, [`Session::receive`] takes what
//! came in pieces of any size, [`Session::tick`] is called at [`Session::deadline`]. The next line waits for the prompt
//! after the answer, since the radar loses what comes while it still writes, but no longer than
//! [`Timeouts::prompt_us`]: other firmware has other prompts.
//!
//! A line is never sent twice: the demo adds up some commands (chirps), so a repeated one can leave it configured in
//! another way than asked. After a failure start a new session; the texts of [`super::cfg::write()`] begin with
//! `sensorStop` and `flushCfg`, which bring any state back to a known one. Each session first sends an empty line,
//! which ends what noise may have left in the radar's line buffer.

use core::fmt;

use heapless::String;
use rfhoi_shared::units::BridgeTime;

/// Bytes of a line sent, without its end, at most; the demo's own limit is 256.
pub const MAX_LINE: usize = 200;
/// Bytes kept of a line received; the rest of a longer one is dropped.
pub const MAX_ANSWER: usize = 200;

/// How long to wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Timeouts {
    /// For a line's answer, us.
    pub answer_us: u64,
    /// For the answer to `sensorStart`, which calibrates the radar first, us.
    pub start_us: u64,
    /// For the prompt after an answer, us.
    pub prompt_us: u64,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self { answer_us: 1_000_000, start_us: 5_000_000, prompt_us: 50_000 }
    }
}

/// What a session reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event<'a> {
    /// The radar said something on the way to its answer, as after `version` or while it calibrates.
    Text(&'a str),
    /// A line is answered.
    Done {
        /// Number of the line among those given, from 1.
        line: u32,
        /// The radar had nothing to do: `sensorStop` while stopped, `sensorStart` while started.
        ignored: bool,
    },
    /// The session has failed and sends no more.
    Failed(Failure<'a>),
}

/// Why a session failed, and where.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Failure<'a> {
    /// Number of the line among those given, from 1.
    pub number: u32,
    /// The line.
    pub line: &'a str,
    /// What went wrong.
    pub error: CliError,
    /// What the radar said to it, empty if nothing.
    pub answer: &'a str,
}

/// What went wrong with a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CliError {
    /// The radar answered `Error`.
    Refused,
    /// The radar does not know the command: other firmware, or bytes were lost.
    Unknown,
    /// No answer in time.
    Timeout,
    /// The line is longer than [`MAX_LINE`] or not printable ASCII; it was not sent.
    Unsendable,
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Refused => "the radar refuses",
            Self::Unknown => "the radar does not know",
            Self::Timeout => "the radar does not answer",
            Self::Unsendable => "too long or not ASCII",
        })
    }
}

impl core::error::Error for CliError {}

impl fmt::Display for Failure<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} line {}, `{}`", self.error, self.number, self.line)?;
        if self.answer.is_empty() { Ok(()) } else { write!(f, ": {}", self.answer) }
    }
}

impl core::error::Error for Failure<'_> {}

/// Oddities on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counts {
    /// Bytes that are no printable ASCII, dropped.
    pub noise_bytes: u32,
    /// Bytes past [`MAX_ANSWER`] of a line, dropped.
    pub overlong_bytes: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Nothing has been sent.
    Begin,
    /// The next line may go.
    Ready,
    /// A line was sent.
    Answer {
        deadline: BridgeTime,
    },
    /// The line was answered, or the empty one sent.
    Prompt {
        deadline: BridgeTime,
    },
    Finished,
    Failed(CliError),
}

/// What came of a piece of input; [`Event`] without its text.
enum Outcome {
    Text,
    Done,
    Failed,
}

/// What a line received is.
enum Answer {
    /// Nothing, or the line as it was sent.
    Echo,
    Done,
    /// `Ignored: <why>`; most commands go on to `Done`.
    Ignored,
    /// `Error -1`: the end of a refusal.
    Refused,
    /// `Error: <why>`: the beginning of one.
    Why,
    Unknown,
    Text,
}

/// Sends the lines of an iterator; see the [module](self).
#[derive(Debug, Clone)]
pub struct Session<I> {
    lines: I,
    timeouts: Timeouts,
    state: State,
    /// Number of the line in `sent`.
    number: u32,
    /// The line last sent, with its end.
    sent: String<{ MAX_LINE + 1 }>,
    /// The line that is coming in.
    coming: String<MAX_ANSWER>,
    /// The last line of text that came in, or the first that told why a line was refused.
    answer: String<MAX_ANSWER>,
    ignored: bool,
    refused: bool,
    counts: Counts,
}

impl<I, L> Session<I>
where
    I: Iterator<Item = L>,
    L: AsRef<str>,
{
    /// A session that will send `lines`; comments (`%`, `#`) and blank ones are left out.
    pub fn new(lines: I, timeouts: Timeouts) -> Self {
        Self {
            lines,
            timeouts,
            state: State::Begin,
            number: 0,
            sent: String::new(),
            coming: String::new(),
            answer: String::new(),
            ignored: false,
            refused: false,
            counts: Counts::default(),
        }
    }

    /// The bytes to send now, if a line may go: each is given once.
    ///
    /// Call it to begin, and after [`Self::receive`] and [`Self::tick`]. A line that cannot be sent fails the session
    /// ([`Self::failure`]).
    pub fn transmit(&mut self, now: BridgeTime) -> Option<&str> {
        match self.state {
            State::Begin => {
                self.state = State::Prompt { deadline: now.after(self.timeouts.prompt_us) };
                return Some("\n");
            }
            State::Ready => {}
            _ => return None,
        }
        self.sent.clear();
        self.answer.clear();
        self.ignored = false;
        self.refused = false;
        for line in self.lines.by_ref() {
            self.number = self.number.saturating_add(1);
            let line = line.as_ref().trim();
            if line.is_empty() || line.starts_with(['%', '#']) {
                continue;
            }
            let printable = line.bytes().all(|b| matches!(b, b' '..=b'~'));
            let fits =
                line.len() <= MAX_LINE && self.sent.push_str(line).is_ok() && self.sent.push('\n').is_ok();
            if !printable || !fits {
                self.state = State::Failed(CliError::Unsendable);
                return None;
            }
            let slow = line.split_ascii_whitespace().next() == Some("sensorStart");
            let wait = if slow { self.timeouts.start_us } else { self.timeouts.answer_us };
            self.state = State::Answer { deadline: now.after(wait) };
            return Some(&self.sent);
        }
        self.state = State::Finished;
        None
    }
}

impl<I> Session<I> {
    /// Takes bytes off the front of `input` up to the next event; `None` when all are taken.
    pub fn receive(&mut self, input: &mut &[u8], now: BridgeTime) -> Option<Event<'_>> {
        while let Some((&byte, rest)) = input.split_first() {
            *input = rest;
            let outcome = match byte {
                b'\r' | b'\n' => self.line_end(now),
                b' '..=b'~' => self.character(char::from(byte), now),
                b'\t' => None,
                _ => {
                    self.counts.noise_bytes = self.counts.noise_bytes.saturating_add(1);
                    None
                }
            };
            if let Some(outcome) = outcome {
                return self.event(outcome);
            }
        }
        None
    }

    /// Call at [`Self::deadline`] or later.
    pub fn tick(&mut self, now: BridgeTime) -> Option<Event<'_>> {
        match self.state {
            State::Answer { deadline } if now >= deadline => {
                let outcome = self.conclude(now).unwrap_or_else(|| self.fail(CliError::Timeout));
                self.event(outcome)
            }
            State::Prompt { deadline } if now >= deadline => {
                self.state = State::Ready;
                None
            }
            _ => None,
        }
    }

    /// When [`Self::tick`] has something to do, if nothing comes before.
    pub fn deadline(&self) -> Option<BridgeTime> {
        match self.state {
            State::Answer { deadline } | State::Prompt { deadline } => Some(deadline),
            _ => None,
        }
    }

    /// Whether all lines are sent and answered.
    pub fn is_finished(&self) -> bool {
        self.state == State::Finished
    }

    /// Why the session failed, if it has.
    pub fn failure(&self) -> Option<Failure<'_>> {
        let State::Failed(error) = self.state else { return None };
        Some(Failure { number: self.number, line: self.sent.trim_end(), error, answer: &self.answer })
    }

    /// Oddities so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    fn character(&mut self, character: char, now: BridgeTime) -> Option<Outcome> {
        if self.coming.push(character).is_err() {
            self.counts.overlong_bytes = self.counts.overlong_bytes.saturating_add(1);
            return None;
        }
        // The name before it is the demo's own.
        if !self.coming.ends_with(":/>") {
            return None;
        }
        self.coming.clear();
        match self.state {
            // The answer may have lacked its end; else this prompt is from before the line.
            State::Answer { .. } => {
                let outcome = self.conclude(now)?;
                if let State::Prompt { .. } = self.state {
                    self.state = State::Ready;
                }
                Some(outcome)
            }
            State::Prompt { .. } => {
                self.state = State::Ready;
                None
            }
            _ => None,
        }
    }

    fn line_end(&mut self, now: BridgeTime) -> Option<Outcome> {
        let answer = self.classify();
        let outcome = match (self.state, answer) {
            (State::Failed(_), _) | (_, Answer::Echo) => None,
            (State::Answer { .. }, answer) => self.answered(&answer, now),
            (_, _) => {
                self.answer.clone_from(&self.coming);
                Some(Outcome::Text)
            }
        };
        self.coming.clear();
        outcome
    }

    fn classify(&self) -> Answer {
        let line = self.coming.trim();
        let after_error = line.strip_prefix("Error");
        if line.is_empty() || line == self.sent.trim_end() {
            Answer::Echo
        } else if line == "Done" {
            Answer::Done
        } else if line.starts_with("Ignored") {
            Answer::Ignored
        } else if after_error.is_some_and(|code| code.trim().parse::<i32>().is_ok()) {
            Answer::Refused
        } else if after_error.is_some() {
            Answer::Why
        } else if line.ends_with("is not recognized as a CLI command") {
            Answer::Unknown
        } else {
            Answer::Text
        }
    }

    fn answered(&mut self, answer: &Answer, now: BridgeTime) -> Option<Outcome> {
        if !self.refused && !matches!(answer, Answer::Done) {
            self.answer.clone_from(&self.coming);
        }
        match answer {
            Answer::Echo => None,
            Answer::Text => Some(Outcome::Text),
            Answer::Ignored => {
                self.ignored = true;
                None
            }
            Answer::Why => {
                self.refused = true;
                None
            }
            Answer::Done if self.refused => Some(self.fail(CliError::Refused)),
            Answer::Done => Some(self.done(now)),
            Answer::Refused => Some(self.fail(CliError::Refused)),
            Answer::Unknown => Some(self.fail(CliError::Unknown)),
        }
    }

    /// Ends a line of which no `Done` or `Error -1` came, if it was answered at all.
    fn conclude(&mut self, now: BridgeTime) -> Option<Outcome> {
        if self.refused {
            Some(self.fail(CliError::Refused))
        } else if self.ignored {
            Some(self.done(now))
        } else {
            None
        }
    }

    fn done(&mut self, now: BridgeTime) -> Outcome {
        self.state = State::Prompt { deadline: now.after(self.timeouts.prompt_us) };
        Outcome::Done
    }

    fn fail(&mut self, error: CliError) -> Outcome {
        self.state = State::Failed(error);
        Outcome::Failed
    }

    fn event(&self, outcome: Outcome) -> Option<Event<'_>> {
        match outcome {
            Outcome::Text => Some(Event::Text(self.answer.trim())),
            Outcome::Done => Some(Event::Done { line: self.number, ignored: self.ignored }),
            Outcome::Failed => self.failure().map(Event::Failed),
        }
    }
}
