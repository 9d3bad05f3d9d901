//! `GET_READER_CAPABILITIES_RESPONSE`: what the client needs of a reader's capabilities (LLRP 1.0.1 section 10.2).

use heapless::Vec;
use rfhoi_shared::units::{CentiDbm, Kilohertz};
use rfhoi_shared::wire::HopTable;

use super::message::ParameterType as P;
use super::param::{DecodeError, Fields, Parameters};
use super::request::TransmitChannel;

/// What a reader can do.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Capabilities {
    /// Antenna ports.
    pub antennas: u16,
    /// Whether timestamps are UTC; otherwise they count from the reader's start.
    pub has_utc_clock: bool,
    /// Private enterprise number of the manufacturer.
    pub manufacturer: u32,
    /// The manufacturer's number of the model.
    pub model: u32,
    /// Whether the reader hops.
    pub hopping: bool,
    /// Its channels: the first hop table, or the fixed frequencies under the number 0. `None` if it names neither.
    pub channels: Option<HopTable>,
    /// Channels beyond those that [`HopTable`] has room for.
    pub channels_omitted: u16,
    /// Entries of the table of transmit powers.
    pub power_levels: u16,
    /// Highest transmit power, where the reader has a table of them.
    pub max_power: Option<CentiDbm>,
}

impl Capabilities {
    /// From a message's body.
    ///
    /// # Errors
    /// If general or regulatory capabilities are missing or malformed.
    pub fn decode(body: &[u8]) -> Result<Self, DecodeError> {
        let mut general = Parameters::new(body).find(P::GENERAL_DEVICE_CAPABILITIES)?;
        let mut capabilities = Self {
            antennas: general.u16()?,
            has_utc_clock: general.u16()? & 0x4000 != 0,
            manufacturer: general.u32()?,
            model: general.u32()?,
            hopping: false,
            channels: None,
            channels_omitted: 0,
            power_levels: 0,
            max_power: None,
        };
        let mut regulatory = Parameters::new(body).find(P::REGULATORY_CAPABILITIES)?;
        regulatory.u16()?; // country
        regulatory.u16()?; // communications standard
        for band in regulatory.parameters() {
            let band = band?;
            if band.kind == P::UHF_BAND_CAPABILITIES {
                capabilities.band(band.fields.parameters())?;
            }
        }
        Ok(capabilities)
    }

    /// What to put in `RFTransmitter`.
    pub fn transmit_channel(&self) -> TransmitChannel {
        match &self.channels {
            Some(table) if self.hopping => TransmitChannel { hop_table: table.table, channel: 0 },
            _ => TransmitChannel { hop_table: 0, channel: 1 },
        }
    }

    fn band(&mut self, parameters: Parameters<'_>) -> Result<(), DecodeError> {
        for parameter in parameters {
            let parameter = parameter?;
            let mut fields = parameter.fields;
            match parameter.kind {
                P::TRANSMIT_POWER_LEVEL_TABLE_ENTRY => {
                    fields.u16()?; // index
                    let power = CentiDbm(fields.i16()?);
                    self.power_levels = self.power_levels.saturating_add(1);
                    self.max_power = self.max_power.max(Some(power));
                }
                P::FREQUENCY_INFORMATION => {
                    self.hopping = fields.u8()? & 0x80 != 0;
                    self.frequencies(fields.parameters())?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn frequencies(&mut self, parameters: Parameters<'_>) -> Result<(), DecodeError> {
        for parameter in parameters {
            let parameter = parameter?;
            let mut fields = parameter.fields;
            let table = match parameter.kind {
                P::FREQUENCY_HOP_TABLE => {
                    let id = fields.u8()?;
                    fields.u8()?; // reserved
                    u16::from(id)
                }
                P::FIXED_FREQUENCY_TABLE => 0,
                _ => continue,
            };
            if self.channels.is_none() {
                self.table(table, fields)?;
            }
        }
        Ok(())
    }

    fn table(&mut self, table: u16, mut fields: Fields<'_>) -> Result<(), DecodeError> {
        let mut channels = Vec::new();
        for _ in 0..fields.u16()? {
            if channels.push(Kilohertz(fields.u32()?)).is_err() {
                self.channels_omitted = self.channels_omitted.saturating_add(1);
            }
        }
        self.channels = Some(HopTable { table, channels });
        Ok(())
    }
}
