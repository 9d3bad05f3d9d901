//! Values of single keys: addresses as text, masks as lists of numbers, choices by name.

use std::fmt;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::str::FromStr;

use heapless::Vec as Bounded;
use rfhoi_shared::config::{Endpoint, LLRP_PORT};
use rfhoi_shared::radar::{IqOrder, MAX_TX_SLOTS, SampleFormat};
use serde::{Deserialize, Serialize};

/// `dhcp`, or `192.168.33.30/24`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
#[allow(missing_docs, reason = "documented at Address")]
pub enum NetworkAddress {
    Dhcp,
    Static { address: Ipv4Addr, prefix: u8 },
}

impl TryFrom<String> for NetworkAddress {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let wrong =
            || format!("{text:?}: need \"dhcp\", or an address and its prefix like \"192.168.33.30/24\"");
        if text == "dhcp" {
            return Ok(Self::Dhcp);
        }
        let (address, prefix) = text.split_once('/').ok_or_else(wrong)?;
        let (address, prefix) = (address.parse().ok(), prefix.parse().ok());
        let (address, prefix) = address.zip(prefix).ok_or_else(wrong)?;
        Ok(Self::Static { address, prefix })
    }
}

impl From<NetworkAddress> for String {
    fn from(address: NetworkAddress) -> Self {
        match address {
            NetworkAddress::Dhcp => "dhcp".to_owned(),
            NetworkAddress::Static { address, prefix } => format!("{address}/{prefix}"),
        }
    }
}

/// `192.168.33.40`, or with another port than LLRP's, `192.168.33.40:5085`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ReaderAddress(pub SocketAddrV4);

impl FromStr for ReaderAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let bare = text.parse().map(|ip| SocketAddrV4::new(ip, LLRP_PORT));
        let address = bare.or_else(|_| text.parse());
        address.map(Self).map_err(|_| format!("{text:?}: need an address like \"192.168.33.40\""))
    }
}

impl TryFrom<String> for ReaderAddress {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl fmt::Display for ReaderAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.port() == LLRP_PORT { self.0.ip().fmt(f) } else { self.0.fmt(f) }
    }
}

impl From<ReaderAddress> for String {
    fn from(address: ReaderAddress) -> Self {
        address.to_string()
    }
}

pub(super) fn endpoint(address: SocketAddrV4) -> Endpoint {
    Endpoint { address: address.ip().octets(), port: address.port() }
}

pub(super) fn socket_address(endpoint: &Endpoint) -> SocketAddrV4 {
    SocketAddrV4::new(endpoint.address.into(), endpoint.port)
}

/// How the radar's data arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "documented at RadarInput")]
pub enum Input {
    Dca1000,
    Uart,
}

/// Removal of what does not move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "documented at ClutterRemoval")]
pub enum Clutter {
    Off,
    Mean,
    Background,
}

/// What the ADC delivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "documented at SampleFormat")]
pub enum Samples {
    QFirst,
    IFirst,
    Real,
}

impl From<Samples> for SampleFormat {
    fn from(samples: Samples) -> Self {
        match samples {
            Samples::QFirst => Self::Complex(IqOrder::QFirst),
            Samples::IFirst => Self::Complex(IqOrder::IFirst),
            Samples::Real => Self::Real,
        }
    }
}

impl From<SampleFormat> for Samples {
    fn from(format: SampleFormat) -> Self {
        match format {
            SampleFormat::Complex(IqOrder::QFirst) => Self::QFirst,
            SampleFormat::Complex(IqOrder::IFirst) => Self::IFirst,
            SampleFormat::Real => Self::Real,
        }
    }
}

/// Transmitters of one chirp: `2`, or `[1, 3]` where two send at once.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "need the number of a transmitter, or a list of those that send at once")]
#[allow(missing_docs, reason = "documented above")]
pub enum Slot {
    One(u8),
    Several(Vec<u8>),
}

impl Slot {
    pub(super) fn of(mask: u8) -> Self {
        match numbers(mask)[..] {
            [one] => Self::One(one),
            ref several => Self::Several(several.to_vec()),
        }
    }
}

/// The masks of the chirps of a loop.
pub(super) fn tx_order(slots: &[Slot]) -> Result<Bounded<u8, MAX_TX_SLOTS>, String> {
    let masks: Result<Vec<u8>, String> = slots
        .iter()
        .map(|slot| match slot {
            Slot::One(number) => mask(&[*number]),
            Slot::Several(numbers) => mask(numbers),
        })
        .collect();
    bounded(masks?.into_iter())
}

/// As many as there is room for, or what to correct.
pub(super) fn bounded<T, const N: usize>(
    items: impl ExactSizeIterator<Item = T>,
) -> Result<Bounded<T, N>, String> {
    let count = items.len();
    if count > N { Err(format!("{count} of them: there can be at most {N}")) } else { Ok(items.collect()) }
}

/// Numbers from 1 as bits from 0.
pub(super) fn mask(numbers: &[u8]) -> Result<u8, String> {
    numbers.iter().try_fold(0, |mask, &number| match number {
        1..=8 => Ok(mask | 1 << (number - 1)),
        _ => Err(format!("{number}: they are counted from 1 to 8")),
    })
}

/// Bits from 0 as numbers from 1.
pub(super) fn numbers(mask: u8) -> Vec<u8> {
    (1..=8).filter(|number| mask & 1 << (number - 1) != 0).collect()
}
