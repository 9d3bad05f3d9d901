//! Why a phase difference says nothing about movement.

use serde::Serialize;

macro_rules! reasons {
    ($($(#[$doc:meta])* $name:ident, $reason:literal, $text:literal;)*) => {
        /// Why a phase difference says nothing about movement.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Invalid {
            $($(#[$doc])* $name,)*
        }

        impl Invalid {
            /// All reasons, in the order of their declaration.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// The reason as one word in snake case, as reports and serialisation have it.
            pub const fn reason(self) -> &'static str {
                match self {
                    $(Self::$name => $reason,)*
                }
            }
        }

        impl std::fmt::Display for Invalid {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(match self {
                    $(Self::$name => $text,)*
                })
            }
        }
    };
}

reasons! {
    /// The read is no later than the one before: order or clock is wrong.
    NotLater, "not_later", "the read is no later than the one before";
    /// The reader did not report the channel of one of both reads, or one past [`MAX_CHANNELS`](super::MAX_CHANNELS).
    ChannelUnknown, "channel_unknown", "the reader did not report a channel";
    /// Meanwhile a tag can turn the phase by more than half a turn.
    TooLong, "too_long", "too long since the read before";
    /// The reader hopped, and the offset of one of both channels is not known, or not relative to the other.
    UncalibratedHop, "uncalibrated_hop", "a hop between channels whose offsets are not known";
    /// About half a turn from where the tag can be: the carrier's sign, not movement.
    PiAmbiguity, "pi_ambiguity", "half a turn off: the carrier's sign is open";
    /// A hop to where the tag cannot be: the channel's offset is no longer what was learnt.
    StaleCalibration, "stale_calibration", "the channel's learnt offset has become wrong";
    /// The phase went to where acceleration cannot have taken the tag: it is faster than the reads can follow. Holds until
    /// the tag rests or is read often enough.
    Aliased, "aliased", "faster than the reads can follow";
    /// Phases are too noisy for their differences to have one meaning.
    TooNoisy, "too_noisy", "phases are too noisy";
    /// The tag was not read near the frame's beginning or end.
    NoRead, "no_read", "no read near the frame's beginning or end";
    /// The antenna has never read the tag.
    NeverSeen, "never_seen", "the antenna has never read the tag";
    /// Reads came with times that cannot be: the reader's clock jumped.
    ClockJump, "clock_jump", "the reader's clock jumped";
}

impl std::error::Error for Invalid {}
