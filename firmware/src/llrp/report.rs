//! `RO_ACCESS_REPORT`: tag reads (LLRP 1.0.1 section 13.1.1 and 13.2.3; Impinj's custom parameters 56, 57, 68).
//!
//! A report that a reader leaves a field out of means the last value of that field (13.2.3): [`Repeated`] fills in what
//! the standard's fields leave out. Impinj's own fields belong to one singulation and are never filled in.

use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{
    AntennaPort, BridgeTime, CentiDbm, ChannelIndex, DopplerCode, PhaseCode, ReaderTime,
};

use super::message::{IMPINJ, ParameterType as P};
use super::param::{DecodeError, Fault, Fields, Parameters};

/// Strength of a read whose reader says none: below anything that can be received.
const NO_RSSI: CentiDbm = CentiDbm(i16::MIN);

/// One `TagReportData`: what the reader says of one tag. Operations on tags (access results) are not kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TagReport<'a> {
    /// EPC, most significant byte first.
    pub epc: &'a [u8],
    /// ROSpec that made the read.
    pub rospec: Option<u32>,
    /// Antenna port.
    pub antenna: Option<AntennaPort>,
    /// Strength in whole dBm.
    pub peak_rssi_dbm: Option<i8>,
    /// Channel.
    pub channel: Option<ChannelIndex>,
    /// First singulation of the report, UTC.
    pub first_seen_utc: Option<ReaderTime>,
    /// First singulation of the report, since the reader started.
    pub first_seen_uptime: Option<ReaderTime>,
    /// Last singulation of the report, UTC.
    pub last_seen_utc: Option<ReaderTime>,
    /// Last singulation of the report, since the reader started.
    pub last_seen_uptime: Option<ReaderTime>,
    /// Singulations in the report.
    pub count: Option<u16>,
    /// Impinj: phase of the last singulation.
    pub phase: Option<PhaseCode>,
    /// Impinj: strength in hundredths of a dBm.
    pub peak_rssi: Option<CentiDbm>,
    /// Impinj: Doppler shift of the last singulation.
    pub doppler: Option<DopplerCode>,
    /// Parameters of a type that is not known here.
    pub unknown: u16,
}

impl<'a> TagReport<'a> {
    /// From the value of a `TagReportData`.
    ///
    /// # Errors
    /// If a parameter is malformed or there is no EPC.
    pub fn decode(value: Fields<'a>) -> Result<Self, DecodeError> {
        let mut report = Self::default();
        let mut epc = None;
        for parameter in value.parameters() {
            let parameter = parameter?;
            let mut fields = parameter.fields;
            match parameter.kind {
                P::EPC_96 => epc = Some(fields.rest()),
                P::EPC_DATA => {
                    let bits = usize::from(fields.u16()?);
                    epc = Some(fields.bytes(bits.div_ceil(8))?);
                }
                P::ROSPEC_ID => report.rospec = Some(fields.u32()?),
                P::ANTENNA_ID => report.antenna = Some(AntennaPort(fields.u16()?)),
                P::PEAK_RSSI => report.peak_rssi_dbm = Some(fields.i8()?),
                P::CHANNEL_INDEX => report.channel = Some(ChannelIndex(fields.u16()?)),
                P::FIRST_SEEN_UTC => report.first_seen_utc = Some(ReaderTime(fields.u64()?)),
                P::FIRST_SEEN_UPTIME => report.first_seen_uptime = Some(ReaderTime(fields.u64()?)),
                P::LAST_SEEN_UTC => report.last_seen_utc = Some(ReaderTime(fields.u64()?)),
                P::LAST_SEEN_UPTIME => report.last_seen_uptime = Some(ReaderTime(fields.u64()?)),
                P::TAG_SEEN_COUNT => report.count = Some(fields.u16()?),
                P::IMPINJ_RF_PHASE_ANGLE => {
                    let code = fields.u16()?;
                    if code >= PhaseCode::CODES_PER_TURN {
                        return Err(parameter.fields.error(Fault::Value));
                    }
                    report.phase = Some(PhaseCode(code));
                }
                P::IMPINJ_PEAK_RSSI => report.peak_rssi = Some(CentiDbm(fields.i16()?)),
                P::IMPINJ_RF_DOPPLER_FREQUENCY => report.doppler = Some(DopplerCode(fields.i16()?)),
                kind if is_known(kind) => {}
                _ => report.unknown = report.unknown.saturating_add(1),
            }
        }
        report.epc = epc.ok_or(value.error(Fault::Missing(P::EPC_DATA)))?;
        Ok(report)
    }

    /// Time to which phase and Doppler belong: that of the last singulation, or of the first where the reader names
    /// only that; UTC before uptime.
    pub fn time(&self) -> Option<ReaderTime> {
        let first = || self.first_seen_utc.or(self.first_seen_uptime);
        let last = self.last_seen_utc.or(self.last_seen_uptime);
        last.or_else(first)
    }

    /// The read at `time`, by `antenna` where the reader does not name one; `None` if the EPC is longer than Gen2 allows.
    pub fn to_read(&self, time: BridgeTime, antenna: AntennaPort) -> Option<TagRead> {
        Some(TagRead {
            time,
            epc: Epc::new(self.epc)?,
            antenna: self.antenna.unwrap_or(antenna),
            channel: self.channel.unwrap_or(ChannelIndex(0)),
            phase: self.phase,
            rssi: self.rssi().unwrap_or(NO_RSSI),
            doppler: self.doppler,
        })
    }

    /// Strength, Impinj's fine one where there is one.
    pub fn rssi(&self) -> Option<CentiDbm> {
        self.peak_rssi.or(self.peak_rssi_dbm.map(CentiDbm::from_whole_dbm))
    }
}

/// Types that a tag report may hold and that are of no use here: the standard's TVs, results of operations on tags
/// (342 to 349 and 15), Impinj's TID and position.
fn is_known(kind: P) -> bool {
    match kind {
        P::Tv(_) => true,
        P::Tlv(kind) => (342..=349).contains(&kind),
        P::Custom { vendor, subtype } => vendor == IMPINJ && matches!(subtype, 55 | 58 | 73),
    }
}

/// The tag reports of a message's body. One that is malformed is an error and does not end the walk.
#[derive(Debug, Clone, Copy)]
pub struct TagReports<'a> {
    parameters: Parameters<'a>,
    others: u16,
}

impl<'a> TagReports<'a> {
    /// Those of this `RO_ACCESS_REPORT`.
    pub fn new(body: &'a [u8]) -> Self {
        Self { parameters: Parameters::new(body), others: 0 }
    }

    /// Parameters so far that are no tag report (RF surveys, vendors' own).
    pub fn others(&self) -> u16 {
        self.others
    }
}

impl<'a> Iterator for TagReports<'a> {
    type Item = Result<TagReport<'a>, DecodeError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.parameters.next()? {
                Ok(p) if p.kind == P::TAG_REPORT_DATA => return Some(TagReport::decode(p.fields)),
                Ok(_) => self.others = self.others.saturating_add(1),
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

/// The last value of each field that a reader may leave out while it does not change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Repeated {
    antenna: Option<AntennaPort>,
    peak_rssi_dbm: Option<i8>,
    channel: Option<ChannelIndex>,
    first_seen_utc: Option<ReaderTime>,
    first_seen_uptime: Option<ReaderTime>,
    last_seen_utc: Option<ReaderTime>,
    last_seen_uptime: Option<ReaderTime>,
    count: Option<u16>,
}

impl Repeated {
    /// Fills in what `report` leaves out, and keeps what it does not.
    pub fn fill(&mut self, report: &mut TagReport<'_>) {
        fn repeat<T: Copy>(last: &mut Option<T>, field: &mut Option<T>) {
            *field = field.or(*last);
            *last = *field;
        }
        repeat(&mut self.antenna, &mut report.antenna);
        repeat(&mut self.peak_rssi_dbm, &mut report.peak_rssi_dbm);
        repeat(&mut self.channel, &mut report.channel);
        repeat(&mut self.first_seen_utc, &mut report.first_seen_utc);
        repeat(&mut self.first_seen_uptime, &mut report.first_seen_uptime);
        repeat(&mut self.last_seen_utc, &mut report.last_seen_utc);
        repeat(&mut self.last_seen_uptime, &mut report.last_seen_uptime);
        repeat(&mut self.count, &mut report.count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_the_last_value() {
        let mut repeated = Repeated::default();
        let mut first = TagReport {
            antenna: Some(AntennaPort(2)),
            phase: Some(PhaseCode(7)),
            peak_rssi: Some(CentiDbm(-5100)),
            ..TagReport::default()
        };
        repeated.fill(&mut first);
        let mut second = TagReport { channel: Some(ChannelIndex(9)), ..TagReport::default() };
        repeated.fill(&mut second);
        let expected = TagReport {
            antenna: Some(AntennaPort(2)),
            channel: Some(ChannelIndex(9)),
            ..TagReport::default()
        };
        assert_eq!(second, expected, "phase and fine RSSI are never repeated");
    }

    #[test]
    fn time_is_that_of_the_last_singulation() {
        let at = |t| Some(ReaderTime(t));
        let mut report = TagReport { first_seen_uptime: at(1), ..TagReport::default() };
        assert_eq!(report.time(), at(1));
        report.first_seen_utc = at(2);
        assert_eq!(report.time(), at(2));
        report.last_seen_utc = at(3);
        assert_eq!(report.time(), at(3));
    }
}
