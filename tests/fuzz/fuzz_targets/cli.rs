//! A session on the demo's command line, against a console that says anything at any time.
//!
//! The first byte is the number of lines to send. Of each step after it the first byte says what comes: the session's
//! deadline, an answer of the demo, an echo, or that many bytes as they are.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rfhoi_firmware::mmwave::cli::{Event, Session, Timeouts};
use rfhoi_shared::units::BridgeTime;

const LINES: [&str; 8] = [
    "sensorStop",
    "% a comment",
    "flushCfg",
    "",
    "channelCfg 15 7 0",
    "\t guiMonitor -1 1 1 0 0 0 1 ",
    "\u{7f} is not printable",
    "sensorStart",
];

const ANSWERS: [&[u8]; 8] = [
    b"Done\n",
    b"mmwDemo:/>",
    b"\r\n",
    b"Ignored: Sensor is already stopped\r\n",
    b"Error -1\r\n",
    b"Error: not now\r\nDone\r\n",
    b"'x' is not recognized as a CLI command\r\n",
    b"Debug: calibrating\r\n",
];

/// What a session did, and what it must not do.
#[derive(Default)]
struct Watch {
    sent: Vec<String>,
    done: u32,
    failed: bool,
    events: usize,
}

impl Watch {
    fn sent(&mut self, line: &str) {
        assert!(!self.failed, "a session that failed sends no more");
        assert!(line.ends_with('\n') && line.is_ascii());
        self.sent.push(line.to_owned());
    }

    fn event(&mut self, event: Event<'_>) {
        assert!(!self.failed, "a failure is the last word");
        self.events += 1;
        match event {
            Event::Text(text) => assert!(!text.is_empty()),
            Event::Done { line, .. } => {
                assert!(
                    line > self.done && line as usize <= LINES.len(),
                    "each line is answered once, in order"
                );
                self.done = line;
            }
            Event::Failed(failure) => {
                let _ = failure.to_string();
                self.failed = true;
            }
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let Some((&count, mut steps)) = data.split_first() else { return };
    let lines = &LINES[..usize::from(count) % (LINES.len() + 1)];
    let mut session = Session::new(lines.iter(), Timeouts::default());
    let mut watch = Watch::default();
    let mut now = BridgeTime(0);
    let mut bytes = 0;
    while let Some((&step, rest)) = steps.split_first() {
        steps = rest;
        now = now.after(u64::from(step));
        let echo = watch.sent.last().cloned().unwrap_or_default();
        let mut input = match step {
            0..=7 => {
                now = session.deadline().unwrap_or(now).max(now);
                session.tick(now).into_iter().for_each(|e| watch.event(e));
                &[]
            }
            8..=127 => ANSWERS[usize::from(step) % ANSWERS.len()],
            128..=159 => echo.as_bytes(),
            _ => {
                let (part, rest) = steps.split_at_checked(usize::from(step - 159)).unwrap_or((steps, &[]));
                steps = rest;
                part
            }
        };
        bytes += input.len();
        while let Some(event) = session.receive(&mut input, now) {
            watch.event(event);
        }
        assert!(input.is_empty(), "all of the input is taken");
        if let Some(line) = session.transmit(now) {
            watch.sent(line);
        }
    }
    // Left alone, it comes to an end: a line that is not answered fails.
    for _ in 0..4 * LINES.len() {
        if let Some(line) = session.transmit(now) {
            watch.sent(line);
        }
        let Some(deadline) = session.deadline() else { break };
        now = deadline.max(now);
        session.tick(now).into_iter().for_each(|e| watch.event(e));
    }
    assert!(session.is_finished() != session.failure().is_some());
    assert!(watch.events <= bytes + LINES.len() + 1, "an event needs a byte or a deadline");
    let commands = lines.iter().map(|line| line.trim()).filter(|l| !l.is_empty() && !l.starts_with('%'));
    let sent = watch.sent.iter().map(|line| line.trim()).skip(1);
    assert!(sent.zip(commands).all(|(sent, command)| sent == command), "no line twice, none left out");
});
