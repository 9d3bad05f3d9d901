//! The messages' fields and units.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize, Serializer};

use super::Stream;
use crate::config::{BridgeConfig, ConfigError};
use crate::radar::{MAX_VIRTUAL, RangeGate};
use crate::tag::TagRead;
use crate::units::{BridgeTime, Kilohertz};

/// Bytes of map codes in one packet, at most; the rest of a datagram is for header and fields.
pub const MAX_MAP_BYTES: usize = 1408;
/// Reads in one packet, at most: with the longest EPCs they still fit a datagram.
pub const MAX_READS: usize = 16;
/// Bytes of a board's name, at most.
pub const MAX_BOARD_NAME: usize = 16;
/// Bytes of a notice, at most.
pub const MAX_NOTICE: usize = 160;
/// Points in one packet, at most.
pub const MAX_POINTS: usize = 64;
/// Channels of a hop table, at most (FCC: 50).
pub const MAX_CHANNELS: usize = 64;
/// Real numbers of a packed Hermitian matrix of [`MAX_VIRTUAL`] antennas.
pub const MAX_COVARIANCE: usize = MAX_VIRTUAL * MAX_VIRTUAL;

/// Everything that travels. See the table of the [module](super).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[allow(
    clippy::large_enum_variant,
    reason = "nothing is allocated; a message lives for one encode or decode"
)]
pub enum Message<'a> {
    /// One radar frame.
    Frame(FrameInfo),
    /// Rows of a heatmap.
    #[serde(borrow)]
    MapRows(MapRows<'a>),
    /// Spatial covariance of the moving cells.
    Covariance(Covariance),
    /// Points that the radar detected itself.
    Points(Points),
    /// Tag reads.
    Tags(Vec<TagRead, MAX_READS>),
    /// The reader's hop table.
    HopTable(HopTable),
    /// Health of the bridge.
    Telemetry(Telemetry),
    /// Who the bridge is.
    Hello(Hello),
    /// The configuration in force.
    Config(BridgeConfig),
    /// Outcome of a command.
    Ack(Ack),
    /// What the host asks.
    Command(Command),
    /// Something that a person should know.
    Notice(Notice),
}

impl Message<'_> {
    /// The stream in which it is numbered.
    pub fn stream(&self) -> Stream {
        match self {
            Self::Frame(_) | Self::MapRows(_) | Self::Covariance(_) | Self::Points(_) => Stream::Radar,
            Self::Tags(_) | Self::HopTable(_) => Stream::Tags,
            Self::Telemetry(_) => Stream::Telemetry,
            Self::Hello(_) | Self::Config(_) | Self::Ack(_) | Self::Command(_) | Self::Notice(_) => {
                Stream::Control
            }
        }
    }
}

/// What is known of a radar frame besides its maps. Sent after them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameInfo {
    /// Number of the frame. Of raw samples: counted by the bridge from 0, lost frames too, on across restarts of the
    /// recorder. Of the UART: the radar's own.
    pub frame: u32,
    /// Fingerprint of the profile in force ([`crate::radar::RadarProfile::fingerprint`]).
    pub profile: u32,
    /// Chirps that the frame should have.
    pub chirps: u32,
    /// Chirps of which bytes were lost; they count for nothing in the maps.
    pub chirps_lost: u32,
    /// Samples at the ADC's limits.
    pub clipped: u32,
    /// Range-Doppler cells that counted as moving.
    pub moving_cells: u32,
    /// From the arrival of the frame's last bytes to this message, us.
    pub latency_us: u32,
}

/// Which heatmap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MapKind {
    /// Range x time within the frame, of the first receiver of each transmitter slot: row = range bin of the gate, column =
    /// group of loops, oldest first.
    RangeTime,
    /// Range x Doppler: row = range bin of the gate, column = Doppler bin from `-loops/2` to `loops/2 - 1`.
    RangeDoppler,
}

/// What a map's codes mean: `level = floor_db + step_db * code`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LogScale {
    /// Level of code 0 and below, dB relative to a full-scale tone.
    pub floor_db: f32,
    /// Step of one code, dB.
    pub step_db: f32,
}

impl LogScale {
    /// The level of `code` in dB relative to a full-scale tone.
    pub fn level_db(self, code: u8) -> f32 {
        self.floor_db + self.step_db * f32::from(code)
    }
}

/// Whole rows of a heatmap; a lost packet costs its rows, not the frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MapRows<'a> {
    /// Which map.
    pub map: MapKind,
    /// Frame number, as in [`FrameInfo`].
    pub frame: u32,
    /// First range bin of the map, and rows of the whole map.
    pub gate: RangeGate,
    /// First row in this packet, counted from the gate's start.
    pub first_row: u16,
    /// Columns of a row.
    pub columns: u16,
    /// What the codes mean.
    pub scale: LogScale,
    /// The rows, one after the other.
    #[serde(serialize_with = "as_bytes")]
    pub codes: &'a [u8],
}

/// Bytes at one go, of the same form in postcard as one by one.
fn as_bytes<S: Serializer>(bytes: &&[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}

/// Spatial covariance `mean(x x^H)` over the moving cells of a frame, x the virtual antennas in cube order with the TDM
/// phase compensated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Covariance {
    /// Frame number, as in [`FrameInfo`].
    pub frame: u32,
    /// Virtual antennas N.
    pub antennas: u8,
    /// Row by row, for row i: the diagonal element, then real and imaginary part of (i, j) for j > i; N x N numbers.
    /// Unit: power relative to a full-scale tone.
    pub packed: Vec<f32, MAX_COVARIANCE>,
}

/// A point that the radar's own firmware detected (SDK demo, TLV 1 and 7).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Point {
    /// To the right, forward, up, in metres.
    pub position_m: [f32; 3],
    /// Radial velocity, m/s, positive recedes.
    pub velocity_m_s: f32,
    /// Signal to noise ratio in 0.1 dB, where reported.
    pub snr_decidb: Option<i16>,
}

/// Points of a frame; a long list takes several packets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Points {
    /// Frame number.
    pub frame: u32,
    /// The points.
    pub points: Vec<Point, MAX_POINTS>,
}

/// The reader's channels; it may change whenever the reader boots.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HopTable {
    /// Number of the table in the reader.
    pub table: u16,
    /// Frequency of channel 1, 2, ...
    pub channels: Vec<Kilohertz, MAX_CHANNELS>,
}

/// State of the link to the reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReaderState {
    /// No reader is configured.
    #[default]
    None,
    /// Waiting before the next attempt.
    Waiting,
    /// Opening the connection and waiting for the reader's first event.
    Connecting,
    /// Sending settings.
    Configuring,
    /// Reads arrive.
    Reading,
    /// Another client holds the reader.
    Occupied,
}

/// State of the radar as the bridge drives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RadarState {
    /// Stopped by command.
    #[default]
    Stopped,
    /// Waiting before the next attempt.
    Waiting,
    /// The DCA1000EVM is being set up.
    Recorder,
    /// The radar is being programmed over its command line.
    Programming,
    /// Set up; nothing has come yet, or nothing comes any more.
    Silent,
    /// Data arrives.
    Streaming,
}

/// Why the bridge started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RestartReason {
    /// The board cannot tell.
    #[default]
    Unknown,
    /// Power came on.
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// The reset button or pin.
    Pin,
    /// A host asked for it, or a configuration took effect.
    Command,
    /// The watchdog was not fed: the firmware hung.
    Watchdog,
    /// The firmware found itself in a state that cannot be; its log says which.
    Panic,
}

/// Counts of the radar's raw data path since the bridge started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DatagramCounts {
    /// Datagrams or serial reads taken in.
    pub received: u32,
    /// Datagrams that never came.
    pub lost: u32,
    /// Datagrams that came twice.
    pub duplicate: u32,
    /// Datagrams that came after their place was given up.
    pub late: u32,
    /// Datagrams that are none of the DCA1000's, or do not fit the sequence.
    pub malformed: u32,
    /// Times the recorder began anew.
    pub restarts: u32,
}

/// Counts of radar frames since the bridge started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameCounts {
    /// Frames without a hole.
    pub complete: u32,
    /// Frames with a hole, zero-filled and marked.
    pub incomplete: u32,
    /// Frames of which nothing came.
    pub lost: u32,
}

/// Counts of the reader's link since the bridge started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReaderCounts {
    /// State of the link.
    pub state: ReaderState,
    /// Reads forwarded.
    pub reads: u32,
    /// Times the link was lost.
    pub link_losses: u32,
    /// Messages and parameters of unknown type, skipped.
    pub unknown: u32,
    /// Messages that were malformed.
    pub malformed: u32,
}

/// Health of the bridge, once a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Telemetry {
    /// Radar frames.
    pub frames: FrameCounts,
    /// Raw radar data.
    pub datagrams: DatagramCounts,
    /// Reader.
    pub reader: ReaderCounts,
    /// Packets that the uplink could not take.
    pub uplink_dropped: u32,
    /// Frames for which the processor was too slow.
    pub overruns: u32,
    /// Datagrams on the bridge's ports for commands and for the recorder's answers that are neither.
    pub strays: u32,
    /// State of the radar.
    pub radar: RadarState,
    /// Why the bridge started.
    pub restart: RestartReason,
    /// Time that the processor has worked since the bridge started, us; with the packet's time it gives the load.
    pub busy_us: u64,
    /// How late the executor of network and devices was in the last second while a frame was worked on, at most, us, rounded
    /// up: a timer of its own, which is looked at every 10 ms. 0 if no frame was worked on when it looked.
    pub late_us: u32,
    /// Temperature of the bridge's MCU, 0.1 degrees Celsius.
    pub bridge_decicelsius: Option<i16>,
    /// Temperature of the radar, 0.1 degrees Celsius.
    pub radar_decicelsius: Option<i16>,
}

/// Who the bridge is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Hello {
    /// Board name.
    pub board: String<MAX_BOARD_NAME>,
    /// The board's MAC address, by which bridges are told apart.
    pub id: [u8; 6],
    /// Firmware version: major, minor, patch.
    pub firmware: [u8; 3],
    /// Memory for one gated cube, bytes.
    pub cube_bytes: u32,
    /// Fingerprint of the profile in force.
    pub profile: u32,
}

/// Something that a person should know: what a device refused, or why a link was lost.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Notice {
    /// One sentence; cut where it is too long.
    pub text: String<MAX_NOTICE>,
}

/// What the host asks, with a number that the answer repeats.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Command {
    /// Number of the command.
    pub id: u16,
    /// What to do.
    pub request: Request,
}

/// Requests of a host.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(
    clippy::large_enum_variant,
    reason = "nothing is allocated; a request lives for one encode or decode"
)]
pub enum Request {
    /// Say [`Hello`], and send everything to the asker from now on.
    Hello,
    /// Say [`Message::Config`].
    GetConfig,
    /// Take this configuration, as a whole or not at all: the bridge checks and keeps it, answers, and restarts with it.
    Configure(BridgeConfig),
    /// Start radar and reader.
    Start,
    /// Stop radar and reader.
    Stop,
    /// Restart the bridge.
    Restart,
    /// Say [`Hello`] to the asker, and nothing else.
    Identify,
}

/// Outcome of a command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ack {
    /// Number of the command.
    pub id: u16,
    /// When the bridge took it.
    pub at: BridgeTime,
    /// Done, or why not.
    pub outcome: Result<(), Refusal>,
}

/// Why a command was refused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// The configuration breaks a rule.
    Config(ConfigError),
    /// Not in this state: for example a configuration while the radar runs.
    Busy,
    /// The board could not keep the configuration; nothing has changed.
    NotKept,
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Config(e) => write!(f, "configuration refused: {e}"),
            Self::Busy => write!(f, "busy: stop radar and reader first"),
            Self::NotKept => {
                write!(f, "the board's memory did not take the configuration; nothing has changed")
            }
        }
    }
}

impl core::error::Error for Refusal {}
