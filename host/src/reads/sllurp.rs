//! Tables as scripts on sllurp write them.
//!
//! Columns, in any order; others are ignored: `timestamp` (reader's UTC, seconds with up to six decimals), `epc`
//! (hexadecimal, as it is or in Python's `b'...'`), `antenna`, `channel_index`, `rssi` (dBm), and where reported
//! `phase_angle` (4096 codes to the turn) and `doppler_frequency` (1/16 Hz).

use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{AntennaPort, BridgeTime, ChannelIndex};

use super::{Row, RowError, dbm, doppler_code, epc, field_error, phase_code};

pub(super) const TIMESTAMP: &str = "timestamp";
pub(super) const PHASE_ANGLE: &str = "phase_angle";
const EPC: &str = "epc";
const ANTENNA: &str = "antenna";
const CHANNEL: &str = "channel_index";
const RSSI: &str = "rssi";
const DOPPLER: &str = "doppler_frequency";

/// One read, its time still the reader's.
pub(super) fn row(row: &Row<'_>) -> Result<TagRead, RowError> {
    let timestamp = row.required(TIMESTAMP)?;
    let time = microseconds(timestamp)
        .ok_or_else(|| field_error(TIMESTAMP, timestamp, "seconds since 1970 with up to six decimals"))?;
    let hex = row.required(EPC)?;
    let hex = hex.strip_prefix("b'").and_then(|hex| hex.strip_suffix('\'')).unwrap_or(hex);
    Ok(TagRead {
        time: BridgeTime(time),
        epc: epc(EPC, hex)?,
        antenna: AntennaPort(row.number(ANTENNA, "an antenna port")?),
        channel: ChannelIndex(row.number(CHANNEL, "a channel index")?),
        phase: row.optional(PHASE_ANGLE).map(|text| phase_code(PHASE_ANGLE, text)).transpose()?,
        rssi: dbm(RSSI, row.required(RSSI)?)?,
        doppler: row.optional(DOPPLER).map(|text| doppler_code(DOPPLER, text)).transpose()?,
    })
}

/// Exact: a float would carry 16 digits, just what a time of today takes.
fn microseconds(seconds: &str) -> Option<u64> {
    let (whole, decimals) = seconds.split_once('.').unwrap_or((seconds, ""));
    let digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || decimals.len() > 6 || !digits(whole) || !digits(decimals) {
        return None;
    }
    let fraction: u64 = format!("{decimals:0<6}").parse().ok()?;
    whole.parse::<u64>().ok()?.checked_mul(1_000_000)?.checked_add(fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_convert_exactly() {
        assert_eq!(microseconds("1747163003.40465"), Some(1_747_163_003_404_650));
        assert_eq!(microseconds("1747162820.246058"), Some(1_747_162_820_246_058));
        assert_eq!(microseconds("7"), Some(7_000_000));
        for wrong in ["", ".5", "1.1234567", "-1.0", "1e9", "1.2.3", "99999999999999999999", "1.+5"] {
            assert_eq!(microseconds(wrong), None, "{wrong}");
        }
    }
}
