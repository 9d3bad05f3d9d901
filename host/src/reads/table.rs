//! The table of reads that RF-HOI itself writes.

use std::path::Path;

use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex};

use super::{Row, RowError, doppler_code, epc, phase_code};
use crate::atomic::{self, WriteError};

pub(super) const TIME: &str = "time_us";
const EPC: &str = "epc";
const ANTENNA: &str = "antenna";
const CHANNEL: &str = "channel";
const PHASE: &str = "phase_code";
const RSSI: &str = "rssi_centidbm";
const DOPPLER: &str = "doppler_sixteenth_hz";

/// Columns of the RF-HOI table, in the order in which [`write_csv`] writes them; read in any order.
///
/// | column | what |
/// |---|---|
/// | `time_us` | bridge's time, microseconds |
/// | `epc` | EPC, hexadecimal |
/// | `antenna` | antenna port, from 1 |
/// | `channel` | index into the reader's hop table, from 1; 0 unknown |
/// | `phase_code` | backscatter phase, 4096 codes to the turn; empty if not reported |
/// | `rssi_centidbm` | received signal strength, 0.01 dBm |
/// | `doppler_sixteenth_hz` | Doppler shift, 1/16 Hz; empty if not reported |
pub const COLUMNS: [&str; 7] = [TIME, EPC, ANTENNA, CHANNEL, PHASE, RSSI, DOPPLER];

/// Writes `reads` as a table with the [`COLUMNS`].
///
/// # Errors
/// Any [`WriteError`].
pub fn write_csv(path: impl AsRef<Path>, reads: &[TagRead]) -> Result<(), WriteError> {
    use std::fmt::Write;

    let mut text = COLUMNS.join(",") + "\n";
    for read in reads {
        let TagRead { time, epc, antenna, channel, phase, rssi, doppler } = read;
        let phase = phase.map(|p| p.0.to_string()).unwrap_or_default();
        let doppler = doppler.map(|d| d.0.to_string()).unwrap_or_default();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{epc},{},{},{phase},{},{doppler}", time.0, antenna.0, channel.0, rssi.0);
    }
    atomic::write(path, text.as_bytes())
}

pub(super) fn row(row: &Row<'_>) -> Result<TagRead, RowError> {
    Ok(TagRead {
        time: BridgeTime(row.number(TIME, "microseconds")?),
        epc: epc(EPC, row.required(EPC)?)?,
        antenna: AntennaPort(row.number(ANTENNA, "an antenna port")?),
        channel: ChannelIndex(row.number(CHANNEL, "a channel index, 0 if unknown")?),
        phase: row.optional(PHASE).map(|text| phase_code(PHASE, text)).transpose()?,
        rssi: CentiDbm(row.number(RSSI, "hundredths of a dBm, -32768 to 32767")?),
        doppler: row.optional(DOPPLER).map(|text| doppler_code(DOPPLER, text)).transpose()?,
    })
}
