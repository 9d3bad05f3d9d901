//! The SDK demo's command line in virtual time: it echoes, works on a line for a while, and hears nothing meanwhile.

use rfhoi_shared::units::BridgeTime;

/// Time that the demo works on a command, us.
const COMMAND_US: u64 = 3_000;
/// Time that `sensorStart` takes, which calibrates first, us.
const START_US: u64 = 1_500_000;
/// A character at 115 200 baud, us.
pub const CHARACTER_US: u64 = 87;

/// What the demo says, and when the last character of it is out.
pub type Said = (BridgeTime, String);

/// A console that nobody has spoken to yet.
#[derive(Debug, Default)]
pub struct Console {
    /// A command that it refuses.
    pub refuses: Option<&'static str>,
    line: String,
    busy_until: BridgeTime,
    taken: Vec<String>,
    unheard: usize,
    started: Option<BridgeTime>,
}

impl Console {
    /// Hears bytes of a host, unless it is busy. Once a line is complete it says its answer, then the prompt.
    pub fn hear(&mut self, now: BridgeTime, bytes: &str) -> Vec<Said> {
        if now < self.busy_until {
            self.unheard += bytes.len();
            return Vec::new();
        }
        self.line.push_str(bytes);
        let Some(line) = self.line.strip_suffix('\n').map(str::to_owned) else { return Vec::new() };
        self.line.clear();
        let works_us = if line == "sensorStart" { START_US } else { COMMAND_US };
        let mut time = now.after(works_us);
        let worked = time;
        let said =
            [format!("{line}\r\n{}", self.answer(worked, &line)), "mmwDemo:/>".to_owned()].map(|words| {
                time = time.after(CHARACTER_US * words.len() as u64);
                (time, words)
            });
        self.busy_until = time;
        said.into()
    }

    fn answer(&mut self, now: BridgeTime, line: &str) -> &'static str {
        let Some(command) = line.split(' ').next().filter(|c| !c.is_empty()) else { return "" };
        if self.refuses == Some(command) {
            return "Error: Invalid usage of the CLI command\nError -1\n";
        }
        self.taken.push(line.to_owned());
        match command {
            "sensorStop" if self.started.take().is_none() => "Ignored: Sensor is already stopped\nDone\n",
            "sensorStart" => {
                self.started = Some(now);
                "Debug: Init Calibration Status = 0x1ffe\nDone\n"
            }
            _ => "Done\n",
        }
    }

    /// Lines that it took.
    pub fn taken(&self) -> &[String] {
        &self.taken
    }

    /// Bytes that came while it was busy, and are lost.
    pub fn unheard(&self) -> usize {
        self.unheard
    }

    /// Whether the sensor was started.
    pub fn is_started(&self) -> bool {
        self.started.is_some()
    }

    /// When the sensor begins its first frame, if it was started and not stopped since.
    pub fn started(&self) -> Option<BridgeTime> {
        self.started
    }
}
