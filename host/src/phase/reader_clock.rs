//! Whether the times of reads can be right.
//!
//! The bridge maps the reader's clock to its own and stamps each packet. A read is made before its packet is sent, reads come
//! in the order in which they were made, and the quickest take about as long as ever. Where that does not hold, the reader's
//! clock was set or has drifted from the mapping.

use rfhoi_shared::units::BridgeTime;

use super::Settings;

/// Delays are compared over as long, us.
const WINDOW_US: u64 = 500_000;
/// Reads of a packet may be out of order by as much, us.
const DISORDER_US: u64 = 5_000;
/// No read so far.
const NONE: i64 = i64::MAX;

/// Times of reads against those of the packets that brought them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ReaderClock {
    newest: BridgeTime,
    sent: BridgeTime,
    /// Least time from read to packet, us: ever, in this window, and in the one before.
    least: i64,
    window: i64,
    window_before: i64,
    window_begin: BridgeTime,
    wrong: bool,
}

impl Default for ReaderClock {
    fn default() -> Self {
        let begin = BridgeTime::default();
        Self {
            newest: begin,
            sent: begin,
            least: NONE,
            window: NONE,
            window_before: NONE,
            window_begin: begin,
            wrong: false,
        }
    }
}

impl ReaderClock {
    /// A read of `read`, brought by a packet of `sent`.
    pub(super) fn watch(&mut self, read: BridgeTime, sent: BridgeTime, settings: &Settings) {
        if sent.after(settings.latest_us) < self.sent {
            // The bridge has started anew.
            *self = Self::default();
        }
        let delay = sent.0.cast_signed() - read.0.cast_signed();
        self.wrong |= delay < -settings.lead_us.cast_signed();
        self.wrong |= delay > settings.latest_us.cast_signed();
        // A packet that comes late brings older reads; one in order does not.
        self.wrong |= sent >= self.sent && read.after(DISORDER_US) < self.newest;
        self.sent = self.sent.max(sent);
        self.newest = read;
        self.least = self.least.min(delay);
        self.window = self.window.min(delay);
    }

    /// Whether times have been wrong since last asked.
    pub(super) fn verdict(&mut self, now: BridgeTime, settings: &Settings) -> bool {
        if now.since(self.window_begin) >= WINDOW_US {
            self.window_begin = now;
            self.window_before = std::mem::replace(&mut self.window, NONE);
        }
        let least = self.window.min(self.window_before);
        // From the start too: the mapping makes the quickest about as early as it makes any.
        let usual = self.least.min(settings.lead_us.cast_signed());
        let lags = least != NONE && least - usual > settings.lag_us.cast_signed();
        std::mem::take(&mut self.wrong) || lags
    }
}
