//! Commands to the DCA1000EVM's FPGA and its answers (UDP port 4096, little-endian).
//!
//! A command is `header u16, code u16, length u16, data, footer u16`; an answer `header u16, code u16, status u16,
//! footer u16`. CONFIG_EEPROM (4) is left out on purpose: it changes the board's addresses for good.

use core::fmt;

use heapless::Vec;
use rfhoi_shared::config::PACKET_DELAY_US;

const HEADER: [u8; 2] = 0xA55A_u16.to_le_bytes();
const FOOTER: [u8; 2] = 0xEEAA_u16.to_le_bytes();
/// Bytes of the longest command here.
pub const MAX_COMMAND: usize = 14;
/// Bytes of an answer.
pub const ANSWER_BYTES: usize = 8;
/// The FPGA's clock ticks once in 8 ns, which is the unit of the packet delay.
const TICKS_PER_US: u16 = 125;

/// Code of a command (SPRUIJ4A, table 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u16)]
pub enum Code {
    /// Resets the FPGA.
    ResetFpga = 0x01,
    /// Resets the radar.
    ResetRadar = 0x02,
    /// Sets the FPGA's mode.
    ConfigureFpga = 0x03,
    /// Starts recording; datagrams are numbered from 1 again.
    RecordStart = 0x05,
    /// Stops recording.
    RecordStop = 0x06,
    /// Asks whether the board is there.
    SystemConnect = 0x09,
    /// Reports that something happened; never sent by the host.
    SystemStatus = 0x0A,
    /// Sets the datagrams' size and the pause between them.
    ConfigurePackets = 0x0B,
    /// Asks for the FPGA's version.
    ReadVersion = 0x0E,
}

impl Code {
    fn from_u16(code: u16) -> Option<Self> {
        Some(match code {
            0x01 => Self::ResetFpga,
            0x02 => Self::ResetRadar,
            0x03 => Self::ConfigureFpga,
            0x05 => Self::RecordStart,
            0x06 => Self::RecordStop,
            0x09 => Self::SystemConnect,
            0x0A => Self::SystemStatus,
            0x0B => Self::ConfigurePackets,
            0x0E => Self::ReadVersion,
            _ => return None,
        })
    }
}

/// LVDS lanes of the radar chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Lanes {
    /// AR1243, AWR2243.
    Four,
    /// xWR16xx, 18xx, 64xx, 68xx.
    Two,
}

/// A command. Raw mode, capture to Ethernet and 16-bit words are fixed: nothing else is of use here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// [`Code::ResetFpga`].
    ResetFpga,
    /// [`Code::ResetRadar`].
    ResetRadar,
    /// [`Code::ConfigureFpga`].
    ConfigureFpga(Lanes),
    /// [`Code::RecordStart`]. Start recording before the sensor, or byte 0 is in the middle of a frame.
    RecordStart,
    /// [`Code::RecordStop`].
    RecordStop,
    /// [`Code::SystemConnect`].
    SystemConnect,
    /// [`Code::ConfigurePackets`].
    ConfigurePackets {
        /// Bytes of a datagram, 1470 in TI's tools.
        bytes: u16,
        /// Pause between datagrams in us, 5 to 500.
        delay_us: u16,
    },
    /// [`Code::ReadVersion`].
    ReadVersion,
}

/// Why bytes are no command or no answer, or a command cannot be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandError {
    /// Header, footer or length is wrong.
    Framing,
    /// No such code, or one that is not used here.
    Code(u16),
    /// The command's data makes no sense.
    Data,
    /// The packet delay is outside 5 to 500 us.
    Delay(u16),
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Framing => write!(f, "not framed as a message of the DCA1000EVM"),
            Self::Code(code) => write!(f, "unknown command code {code:#06x}"),
            Self::Data => write!(f, "the command's data makes no sense"),
            Self::Delay(us) => write!(f, "packet delay of {us} us: the FPGA takes 5 to 500"),
        }
    }
}

impl core::error::Error for CommandError {}

impl Command {
    /// The command's code.
    pub fn code(self) -> Code {
        match self {
            Self::ResetFpga => Code::ResetFpga,
            Self::ResetRadar => Code::ResetRadar,
            Self::ConfigureFpga(_) => Code::ConfigureFpga,
            Self::RecordStart => Code::RecordStart,
            Self::RecordStop => Code::RecordStop,
            Self::SystemConnect => Code::SystemConnect,
            Self::ConfigurePackets { .. } => Code::ConfigurePackets,
            Self::ReadVersion => Code::ReadVersion,
        }
    }

    /// The command's bytes on the wire.
    ///
    /// # Errors
    /// [`CommandError::Delay`].
    pub fn encode(self) -> Result<Vec<u8, MAX_COMMAND>, CommandError> {
        let mut data: Vec<u8, 6> = Vec::new();
        match self {
            Self::ConfigureFpga(lanes) => {
                // Raw logging, lanes, capture (not playback), to Ethernet (not SD), 16-bit, timer 30.
                let lanes = if lanes == Lanes::Four { 1 } else { 2 };
                data.extend([1, lanes, 1, 2, 3, 30]);
            }
            Self::ConfigurePackets { bytes, delay_us } => {
                if !PACKET_DELAY_US.contains(&delay_us) {
                    return Err(CommandError::Delay(delay_us));
                }
                data.extend(bytes.to_le_bytes());
                data.extend((delay_us * TICKS_PER_US).to_le_bytes());
                data.extend([0, 0]);
            }
            _ => {}
        }
        let length = (data.len() as u16).to_le_bytes();
        let fields = [&HEADER, &(self.code() as u16).to_le_bytes(), &length, data.as_slice(), &FOOTER];
        Ok(fields.into_iter().flatten().copied().collect())
    }

    /// Reads a command, as a simulated board does.
    ///
    /// # Errors
    /// If the bytes are no command, or one that is not used here.
    pub fn decode(bytes: &[u8]) -> Result<Self, CommandError> {
        let body = unframe(bytes)?;
        let (code, body) = body.split_first_chunk().ok_or(CommandError::Framing)?;
        let (length, data) = body.split_first_chunk().ok_or(CommandError::Framing)?;
        if data.len() != usize::from(u16::from_le_bytes(*length)) {
            return Err(CommandError::Framing);
        }
        let code = u16::from_le_bytes(*code);
        let known = Code::from_u16(code).ok_or(CommandError::Code(code))?;
        match (known, data) {
            (Code::ResetFpga, []) => Ok(Self::ResetFpga),
            (Code::ResetRadar, []) => Ok(Self::ResetRadar),
            (Code::ConfigureFpga, [1, 1, 1, 2, 3, 30]) => Ok(Self::ConfigureFpga(Lanes::Four)),
            (Code::ConfigureFpga, [1, 2, 1, 2, 3, 30]) => Ok(Self::ConfigureFpga(Lanes::Two)),
            (Code::RecordStart, []) => Ok(Self::RecordStart),
            (Code::RecordStop, []) => Ok(Self::RecordStop),
            (Code::SystemConnect, []) => Ok(Self::SystemConnect),
            (Code::ConfigurePackets, &[b0, b1, d0, d1, 0, 0]) => {
                let ticks = u16::from_le_bytes([d0, d1]);
                if !ticks.is_multiple_of(TICKS_PER_US) {
                    return Err(CommandError::Data);
                }
                let bytes = u16::from_le_bytes([b0, b1]);
                Ok(Self::ConfigurePackets { bytes, delay_us: ticks / TICKS_PER_US })
            }
            (Code::ReadVersion, []) => Ok(Self::ReadVersion),
            (Code::SystemStatus, _) => Err(CommandError::Code(code)),
            _ => Err(CommandError::Data),
        }
    }
}

/// An answer of the FPGA, or with [`Code::SystemStatus`] its own report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Answer {
    /// Which command it answers.
    pub code: Code,
    /// 0 for done, 1 for failed; a version for [`Code::ReadVersion`], flags for [`Code::SystemStatus`].
    pub status: u16,
}

impl Answer {
    /// The answer's bytes on the wire, as a simulated board sends them.
    pub fn encode(self) -> [u8; ANSWER_BYTES] {
        let [c0, c1] = (self.code as u16).to_le_bytes();
        let [s0, s1] = self.status.to_le_bytes();
        let ([h0, h1], [f0, f1]) = (HEADER, FOOTER);
        [h0, h1, c0, c1, s0, s1, f0, f1]
    }

    /// Reads an answer.
    ///
    /// # Errors
    /// If the bytes are no answer.
    pub fn decode(bytes: &[u8]) -> Result<Self, CommandError> {
        let &[c0, c1, s0, s1] = unframe(bytes)? else { return Err(CommandError::Framing) };
        let code = u16::from_le_bytes([c0, c1]);
        let code = Code::from_u16(code).ok_or(CommandError::Code(code))?;
        Ok(Self { code, status: u16::from_le_bytes([s0, s1]) })
    }

    /// FPGA version (major, minor) of an answer to [`Code::ReadVersion`].
    pub fn version(self) -> (u8, u8) {
        ((self.status & 0x7f) as u8, ((self.status >> 7) & 0x7f) as u8)
    }

    /// What a report of [`Code::SystemStatus`] says, worst first bits as the FPGA numbers them.
    pub fn reports(self) -> impl Iterator<Item = Report> {
        Report::ALL.into_iter().filter(move |&report| self.status & (1 << report as u16) != 0)
    }
}

/// What the FPGA reports by itself; the number is the bit in the status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u16)]
pub enum Report {
    /// No data on the LVDS lanes: the radar does not stream.
    NoLvdsData = 0,
    /// Data without headers in multi mode.
    NoHeader = 1,
    /// The EEPROM cannot be read.
    EepromFailure = 2,
    /// A card was put in.
    SdDetected = 3,
    /// A card was removed.
    SdRemoved = 4,
    /// The card is full.
    SdFull = 5,
    /// A mode could not be set.
    ModeFailure = 6,
    /// The buffer memory is full: Ethernet is slower than the radar.
    DdrFull = 7,
    /// The recording is complete.
    RecordCompleted = 8,
    /// The LVDS buffer is full.
    LvdsBufferFull = 9,
    /// Playback is complete.
    PlaybackCompleted = 10,
    /// Playback data came out of sequence.
    PlaybackOutOfSequence = 11,
}

impl Report {
    const ALL: [Self; 12] = [
        Self::NoLvdsData,
        Self::NoHeader,
        Self::EepromFailure,
        Self::SdDetected,
        Self::SdRemoved,
        Self::SdFull,
        Self::ModeFailure,
        Self::DdrFull,
        Self::RecordCompleted,
        Self::LvdsBufferFull,
        Self::PlaybackCompleted,
        Self::PlaybackOutOfSequence,
    ];
}

fn unframe(bytes: &[u8]) -> Result<&[u8], CommandError> {
    bytes.strip_prefix(&HEADER).and_then(|b| b.strip_suffix(&FOOTER)).ok_or(CommandError::Framing)
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    fn hex(text: &str) -> Vec<u8> {
        text.split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
    }

    /// Bytes seen from TI's tools and from xwr on the wire.
    const GOLDEN: [(Command, &str); 7] = [
        (Command::SystemConnect, "5A A5 09 00 00 00 AA EE"),
        (Command::ConfigureFpga(Lanes::Two), "5A A5 03 00 06 00 01 02 01 02 03 1E AA EE"),
        (Command::ConfigureFpga(Lanes::Four), "5A A5 03 00 06 00 01 01 01 02 03 1E AA EE"),
        (
            Command::ConfigurePackets { bytes: 1472, delay_us: 25 },
            "5A A5 0B 00 06 00 C0 05 35 0C 00 00 AA EE",
        ),
        (Command::RecordStart, "5A A5 05 00 00 00 AA EE"),
        (Command::RecordStop, "5A A5 06 00 00 00 AA EE"),
        (Command::ReadVersion, "5A A5 0E 00 00 00 AA EE"),
    ];

    #[test]
    fn golden_vectors() {
        for (command, bytes) in GOLDEN {
            assert_eq!(command.encode().unwrap().as_slice(), hex(bytes), "{command:?}");
            assert_eq!(Command::decode(&hex(bytes)), Ok(command));
        }
    }

    #[test]
    fn impossible_delays_are_refused() {
        for delay_us in [0, 4, 501, u16::MAX] {
            let command = Command::ConfigurePackets { bytes: 1470, delay_us };
            assert_eq!(command.encode(), Err(CommandError::Delay(delay_us)));
        }
    }

    #[test]
    fn answers() {
        let done = Answer { code: Code::RecordStart, status: 0 };
        assert_eq!(done.encode().as_slice(), hex("5A A5 05 00 00 00 AA EE"));
        let version = Answer { code: Code::ReadVersion, status: 2 | 9 << 7 };
        assert_eq!(version.version(), (2, 9));
        let report = Answer { code: Code::SystemStatus, status: 1 | 1 << 7 };
        assert!(report.reports().eq([Report::NoLvdsData, Report::DdrFull]));
    }

    #[test]
    fn the_eeprom_command_does_not_exist_here() {
        assert_eq!(Command::decode(&hex("5A A5 04 00 00 00 AA EE")), Err(CommandError::Code(4)));
    }

    proptest! {
        #[test]
        fn commands_survive(bytes: u16, delay_us in 5u16..=500) {
            let command = Command::ConfigurePackets { bytes, delay_us };
            prop_assert_eq!(Command::decode(&command.encode().unwrap()), Ok(command));
        }

        #[test]
        fn answers_survive(status: u16, code in 0u16..16) {
            let bytes = [0x5a, 0xa5, code as u8, 0, status as u8, (status >> 8) as u8, 0xaa, 0xee];
            if let Ok(answer) = Answer::decode(&bytes) {
                prop_assert_eq!(answer.encode(), bytes);
            } else {
                prop_assert!(Code::from_u16(code).is_none());
            }
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..40), framed: bool) {
            let framed = if framed { [&HEADER, bytes.as_slice(), &FOOTER].concat() } else { bytes };
            let _ = Answer::decode(&framed).map(|a| a.reports().count());
            if let Ok(command) = Command::decode(&framed)
                && let Ok(again) = command.encode()
            {
                prop_assert_eq!(again.as_slice(), framed);
            }
        }
    }
}
