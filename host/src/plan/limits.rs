//! What radar, link and board can do.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use rfhoi_shared::radar::RadarProfile;

/// Slopes of ramps that are tried, MHz/us; the AWR1843 goes no steeper than 100 (E2E 594841).
pub fn slopes() -> impl Iterator<Item = u32> {
    (10..=100).step_by(10)
}

/// Sample rates of the AWR1843, ksps: at least 2 Msps (E2E 894294), at most 12.5 Msps of complex samples (its data sheet).
pub const SAMPLE_RATES_KSPS: RangeInclusive<u32> = 2_000..=12_500;
/// Sample rates are multiples of this, ksps.
pub const SAMPLE_RATE_STEP_KSPS: u32 = 50;
/// Fewest samples of a chirp with which TI has validated the stock demo (SDK 3.3 user's guide, quoted in E2E 894294).
pub const LEAST_SAMPLES: u16 = 64;

/// End of the band in which a ramp from `start_khz` is, kHz: 60 to 64 GHz (xWR68xx), or 76 to 81 GHz.
pub fn band_end_khz(start_khz: u32) -> u64 {
    const ENDS_KHZ: [u64; 2] = [64_000_000, 81_000_000];
    ENDS_KHZ.into_iter().find(|&end| end > start_khz.into()).unwrap_or(ENDS_KHZ[1])
}

/// What carries the radar's raw samples to the bridge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Link {
    /// Ethernet of so many Mbit/s: DCA1000EVM and switch.
    Ethernet(f64),
    /// USB at full speed, as the STM32H743's own transceiver has it.
    Usb,
    /// The radar's data UART.
    Uart,
}

impl Link {
    /// The NUCLEO's Ethernet.
    pub const FAST_ETHERNET: Self = Self::Ethernet(100.0);

    /// Bits that it carries in a second.
    pub fn capacity_bit_s(self) -> f64 {
        match self {
            Self::Ethernet(mbit_s) => mbit_s * 1e6,
            // At most 19 bulk packets of 64 bytes in each millisecond (USB 2.0, table 5-9).
            Self::Usb => 19.0 * 64.0 * 8.0 * 1e3,
            // 921,600 baud, ten bits to the byte.
            Self::Uart => 921_600.0 * 8.0 / 10.0,
        }
    }

    /// What `profile` puts on it, bit/s; on an Ethernet with the overhead of datagrams.
    pub fn load_bit_s(self, profile: &RadarProfile) -> f64 {
        match self {
            Self::Ethernet(_) => profile.ethernet_bit_rate(),
            Self::Usb | Self::Uart => profile.raw_bit_rate(),
        }
    }
}

impl fmt::Display for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ethernet(mbit_s) => write!(f, "{mbit_s} Mbit/s Ethernet"),
            Self::Usb => write!(f, "USB (full speed, {:.2} Mbit/s)", self.capacity_bit_s() / 1e6),
            Self::Uart => write!(f, "UART (921,600 baud, {:.2} Mbit/s)", self.capacity_bit_s() / 1e6),
        }
    }
}

impl FromStr for Link {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "usb" => Ok(Self::Usb),
            "uart" => Ok(Self::Uart),
            _ => match text.parse() {
                Ok(mbit_s) if f64::is_finite(mbit_s) && mbit_s > 0.0 => Ok(Self::Ethernet(mbit_s)),
                _ => Err(format!("{text:?}: need the Mbit/s of an Ethernet, as 100, or usb, or uart")),
            },
        }
    }
}

/// A board as far as a plan goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// Its folder under `firmware/boards`.
    pub name: &'static str,
    /// Memory for gated cubes: `CUBE_CELLS` of `firmware/app`, the same on every board.
    pub cube_bytes: u32,
    /// Instructions a second, if each takes one cycle.
    pub instructions_s: f64,
}

/// Bytes of the cubes' memory.
const CUBE_BYTES: u32 = 2 * 72 * 12 * 64 * 4;

impl Board {
    /// NUCLEO-H743ZI: 480 MHz.
    pub const NUCLEO_H743ZI: Self =
        Self { name: "nucleo-h743zi", cube_bytes: CUBE_BYTES, instructions_s: 480e6 };
    /// QEMU's mps2-an500: an instruction is a nanosecond.
    pub const QEMU_AN500: Self = Self { name: "qemu-an500", cube_bytes: CUBE_BYTES, instructions_s: 1e9 };
    /// All of them.
    pub const ALL: [Self; 2] = [Self::NUCLEO_H743ZI, Self::QEMU_AN500];
}

impl FromStr for Board {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = Self::ALL.map(|board| board.name).join(", ");
        Self::ALL
            .into_iter()
            .find(|board| board.name == text)
            .ok_or_else(|| format!("there is no board {text:?}: the boards are {names}"))
    }
}
