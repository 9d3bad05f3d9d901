//! The log of a running board. In: bytes of its RTT channel 0, in defmt's encoding. Out: lines.

use std::time::{Duration, Instant};

use defmt_decoder::{DecodeError, StreamDecoder, Table};
use probe_rs::Session;
use probe_rs::rtt::{self, Rtt, ScanRegion};
use serde::Serialize;

use super::{Board, Firmware, FlashError, sentence};

/// The channel's buffer is looked at this often; it holds about a kilobyte.
const POLL: Duration = Duration::from_millis(10);
/// How long a board may take to set its log up.
const SET_UP: Duration = Duration::from_secs(5);

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LogLine {
    /// Time by the board's clock as its firmware writes it, or since the log was opened, s.
    pub time: String,
    /// Level; `None` for what is printed without one.
    pub level: Option<&'static str>,
    /// Text.
    pub message: String,
}

/// Follows the log of `board`, which runs `firmware`, until `go_on` says to stop. The channel's mode is left as it is: a
/// host that reads too slowly loses lines and does not hold the board up. Without a log in the firmware nothing comes.
///
/// # Errors
/// [`FlashError::Log`].
pub fn follow(
    board: &mut Board,
    firmware: &Firmware,
    mut line: impl FnMut(LogLine),
    mut go_on: impl FnMut() -> bool,
) -> Result<(), FlashError> {
    let (Some(address), Some(table)) = (firmware.rtt, &firmware.table) else { return Ok(()) };
    let began = Instant::now();
    let mut decoder = table.new_stream_decoder();
    let mut buffer = [0; 4096];
    let mut channel: Option<Rtt> = None;
    let mut set_up_by = began + SET_UP;
    while go_on() {
        let opened = match &mut channel {
            Some(opened) => opened,
            None => match attach(&mut board.session, address) {
                Ok(rtt) => channel.insert(rtt),
                // Not set up yet, or half set up.
                Err(_) if Instant::now() < set_up_by => {
                    std::thread::sleep(POLL);
                    continue;
                }
                Err(error) => return Err(FlashError::Log(sentence(&error))),
            },
        };
        let Ok(bytes) = read(&mut board.session, opened, &mut buffer) else {
            // The board has restarted and sets its channel up anew; if it is gone, attaching tells.
            channel = None;
            set_up_by = Instant::now() + SET_UP;
            decoder = table.new_stream_decoder();
            continue;
        };
        decoder.received(&buffer[..bytes]);
        drain(decoder.as_mut(), table, began.elapsed(), &mut line).map_err(|()| {
            FlashError::Log("its bytes do not decode; is this the firmware that runs?".to_owned())
        })?;
        if bytes == 0 {
            std::thread::sleep(POLL);
        }
    }
    Ok(())
}

fn attach(session: &mut Session, address: u64) -> Result<Rtt, rtt::Error> {
    Rtt::attach_region(&mut session.core(0)?, &ScanRegion::Exact(address))
}

fn read(session: &mut Session, rtt: &mut Rtt, buffer: &mut [u8]) -> Result<usize, rtt::Error> {
    let channel = rtt.up_channel(0).ok_or(rtt::Error::MissingChannel(0))?;
    channel.read(&mut session.core(0)?, buffer)
}

/// Hands on the lines that are complete.
fn drain(
    decoder: &mut dyn StreamDecoder,
    table: &Table,
    since: Duration,
    line: &mut impl FnMut(LogLine),
) -> Result<(), ()> {
    loop {
        match decoder.decode() {
            Ok(frame) => {
                let time = frame.display_timestamp().map(|t| t.to_string());
                line(LogLine {
                    time: time.unwrap_or_else(|| format!("{:.3}", since.as_secs_f64())),
                    level: frame.level().map(|l| l.as_str()),
                    message: frame.display_message().to_string(),
                });
            }
            Err(DecodeError::UnexpectedEof) => return Ok(()),
            // A line of which bytes were lost.
            Err(DecodeError::Malformed) if table.encoding().can_recover() => {}
            Err(DecodeError::Malformed) => return Err(()),
        }
    }
}
