//! Tag reads as an Impinj reader's LLRP reports.

use rfhoi_firmware::llrp::encode::EncodeError;
use rfhoi_firmware::llrp::reader_side::ro_access_report;
use rfhoi_firmware::llrp::report::TagReport;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::ReaderTime;

/// The report of one read, by the ROSpec of this number, from a reader whose UTC is `epoch` at the read's time 0.
pub fn tag_report(read: &TagRead, rospec: u32, epoch: ReaderTime) -> TagReport<'_> {
    let seen = Some(ReaderTime(epoch.0 + read.time.0));
    TagReport {
        epc: read.epc.bytes(),
        rospec: Some(rospec),
        antenna: Some(read.antenna),
        peak_rssi_dbm: Some(libm::roundf(read.rssi.dbm()) as i8),
        channel: Some(read.channel),
        first_seen_utc: seen,
        last_seen_utc: seen,
        count: Some(1),
        phase: read.phase,
        peak_rssi: Some(read.rssi),
        doppler: read.doppler,
        ..TagReport::default()
    }
}

/// The `RO_ACCESS_REPORT` with message ID `id` of these reads, in `buffer`:
/// [`MAX_REPORT_BYTES`](rfhoi_firmware::llrp::reader_side::MAX_REPORT_BYTES) for each are enough.
///
/// # Errors
/// If the buffer is too short.
pub fn access_report<'b>(
    buffer: &'b mut [u8],
    id: u32,
    reads: &[TagRead],
    rospec: u32,
    epoch: ReaderTime,
) -> Result<&'b [u8], EncodeError> {
    let reports: Vec<_> = reads.iter().map(|read| tag_report(read, rospec, epoch)).collect();
    ro_access_report(buffer, id, &reports)
}
