//! [`RadarProfile`] to CLI text.

use core::fmt;

use rfhoi_shared::array::AntennaArray;
use rfhoi_shared::radar::{IqOrder, RadarProfile, SampleFormat};

use super::{DemoOptions, LvdsData, PointOutput};
use crate::mmwave::decimal::Decimal;

/// Bytes that hold the text of any profile.
pub const TEXT_CAPACITY: usize = 1536;

/// Writes the commands that program the stock demo with `profile`, one a line, from `sensorStop` to `sensorStart`.
///
/// The demo refuses to start on less than the full set, so all commands of the visualiser's stock profiles are there,
/// in their order; what `profile` and `demo` do not say is as in those files for the board. Read back by
/// [`super::CliProfile::parse`] with the same board, the text gives `profile` and `demo` again. A profile that fails
/// [`RadarProfile::validate`] gives text that the radar refuses.
///
/// # Errors
/// Those of `out`; [`TEXT_CAPACITY`] bytes are enough.
pub fn write(profile: &RadarProfile, demo: &DemoOptions, out: &mut impl fmt::Write) -> fmt::Result {
    front_end(profile, demo, out)?;
    detection(profile, demo, out)?;
    monitors(profile, out)?;
    out.write_str("calibData 0 0 0\nsensorStart\n")
}

/// Antennas, ADC, chirps and frame.
fn front_end(profile: &RadarProfile, demo: &DemoOptions, out: &mut impl fmt::Write) -> fmt::Result {
    let tx_mask = profile.tx_order.iter().fold(0, |mask, tx| mask | tx);
    let (adc_format, buffer_format, swap) = match profile.format {
        SampleFormat::Complex(order) => (1, 0, u8::from(order == IqOrder::QFirst)),
        SampleFormat::Real => (0, 1, 1),
    };
    // Bits 0 to 5 receiver gain in dB, bits 6 and 7 RF gain target: the visualiser's values for 77 and 60 GHz.
    let rx_gain = if profile.array == AntennaArray::Iwr6843Aop { 158 } else { 30 };
    // The visualiser has the ADC in low-power mode on xWR16xx; 68xx do not know that mode.
    let adc_low_power = u8::from(profile.array == AntennaArray::Xwr1642Boost);
    let thousandths = |value| Decimal { value, decimals: 3 };

    out.write_str("sensorStop\nflushCfg\ndfeDataOutputMode 1\n")?;
    writeln!(out, "channelCfg {} {tx_mask} 0", profile.rx_mask)?;
    writeln!(out, "adcCfg 2 {adc_format}")?;
    writeln!(out, "adcbufCfg -1 {buffer_format} {swap} 1 1")?;
    writeln!(
        out,
        "profileCfg 0 {} {} {} {} 0 0 {} 1 {} {} 0 0 {rx_gain}",
        Decimal { value: profile.start_khz, decimals: 6 },
        thousandths(profile.idle_ns),
        thousandths(profile.adc_start_ns),
        thousandths(profile.ramp_end_ns),
        thousandths(profile.slope_khz_per_us),
        profile.samples,
        profile.sample_rate_ksps,
    )?;
    for (chirp, tx) in profile.tx_order.iter().enumerate() {
        writeln!(out, "chirpCfg {chirp} {chirp} 0 0 0 0 0 {tx}")?;
    }
    writeln!(
        out,
        "frameCfg 0 {} {} {} {} 1 0",
        profile.tx_slots().saturating_sub(1),
        profile.loops,
        demo.frames,
        thousandths(profile.frame_period_us),
    )?;
    writeln!(out, "lowPower 0 {adc_low_power}")
}

/// The demo's signal processing and what it streams.
fn detection(profile: &RadarProfile, demo: &DemoOptions, out: &mut impl fmt::Write) -> fmt::Result {
    let gui = &demo.gui;
    let points = match gui.points {
        PointOutput::Off => 0,
        PointOutput::WithSideInfo => 1,
        PointOutput::Alone => 2,
    };
    let [range, noise, azimuth, doppler, statistics] = [
        gui.range_profile,
        gui.noise_profile,
        gui.azimuth_heatmap,
        gui.range_doppler_heatmap,
        gui.statistics,
    ]
    .map(u8::from);
    writeln!(out, "guiMonitor -1 {points} {range} {noise} {azimuth} {doppler} {statistics}")?;
    // CFAR at 15 dB: along range against the smaller side's mean, along Doppler against both. The Doppler window must
    // fit the loops: the visualiser has 4 + 2 cells a side for 16 of them, 8 + 4 for 64 and 128.
    out.write_str("cfarCfg -1 0 2 8 4 3 0 15 1\n")?;
    out.write_str(if profile.loops < 64 {
        "cfarCfg -1 1 0 4 2 3 1 15 1\n"
    } else {
        "cfarCfg -1 1 0 8 4 4 1 15 1\n"
    })?;
    out.write_str("multiObjBeamForming -1 1 0.5\n")?;
    writeln!(out, "clutterRemoval -1 {}", u8::from(demo.clutter_removal))?;
    out.write_str("calibDcRangeSig -1 0 -5 8 256\nextendedMaxVelocity -1 0\n")?;
    let two_transmitters = profile.array == AntennaArray::Xwr1642Boost;
    if two_transmitters {
        out.write_str("bpmCfg -1 0 0 1\n")?;
    }
    let data = match demo.lvds.data {
        LvdsData::Off => 0,
        LvdsData::Adc => 1,
        LvdsData::CpAdcCq => 4,
    };
    writeln!(out, "lvdsStreamCfg -1 {} {data} {}", u8::from(demo.lvds.header), u8::from(demo.lvds.software))?;
    out.write_str("compRangeBiasAndRxChanPhase 0.0")?;
    for channel in 0..if two_transmitters { 8 } else { 12 } {
        // Two of the IWR6843AOP's patches are fed from the other side.
        let turned = profile.array == AntennaArray::Iwr6843Aop && channel % 2 == 1;
        out.write_str(if turned { " -1 0" } else { " 1 0" })?;
    }
    out.write_str("\nmeasureRangeBiasAndRxChanPhase 0 1.5 0.2\n")
}

/// Monitors, off by `analogMonitor` but required, and fields of view, which are the full ones.
fn monitors(profile: &RadarProfile, out: &mut impl fmt::Write) -> fmt::Result {
    // Saturation monitor: overlapping slices of `slice` x 0.16 us over the sampling time, at most 127 of them
    // (mmWaveLink rlRxSatMonConf_t; the formulas give the numbers of the stock profiles).
    let sampling_ns = u64::from(profile.samples) * 1_000_000 / u64::from(profile.sample_rate_ksps.max(1));
    let overlapping = |whole: u64| (2 * whole).saturating_sub(1);
    let slices = |slice: u64| overlapping(sampling_ns / (slice * 160));
    let mut slice = 4;
    while slices(slice) > 127 && slice < 255 {
        slice += 1;
    }
    writeln!(out, "CQRxSatMonitor 0 3 {slice} {} 0", slices(slice).min(127))?;
    let image_slice = (profile.samples / 64).max(4);
    let image_slices = overlapping(u64::from(profile.samples / image_slice));
    writeln!(out, "CQSigImgMonitor 0 {image_slices} {image_slice}")?;
    out.write_str("analogMonitor 0 0\naoaFovCfg -1 -90 90 -90 90\n")?;
    writeln!(out, "cfarFovCfg -1 0 0 {:.2}", profile.range_span().0)?;
    let speed = profile.velocity_span().0;
    writeln!(out, "cfarFovCfg -1 1 {:.2} {speed:.2}", -speed)
}
