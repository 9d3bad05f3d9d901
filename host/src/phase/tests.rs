use std::f64::consts::{PI, TAU};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::units::{BridgeTime, CentiDbm, Kilohertz, PhaseCode};

use super::calibration::LearningRule;
use super::*;

const PERIOD_US: u64 = 12_000;
const DWELL_US: u64 = 200_000;
const CHANNELS: u16 = 10;

/// Simulated reads of one tag at `metres(seconds)` from one antenna, which hops over [`CHANNELS`] channels.
fn simulated(seconds: u64, noise_rad: f64, metres: impl Fn(f64) -> f64) -> Vec<TagRead> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let plan = ChannelPlan::fcc();
    let reads = (0..seconds * 1_000_000 / PERIOD_US).map(|n| {
        let time = n * PERIOD_US;
        let channel = ChannelIndex((time / DWELL_US) as u16 % CHANNELS + 1);
        let wavelength = f64::from(plan.frequency(channel).unwrap().wavelength().0);
        let offset = f64::from(channel.0 * channel.0);
        // Triangular, of this standard deviation.
        let noise = noise_rad * 6_f64.sqrt() * (rng.random::<f64>() - rng.random::<f64>());
        let phase = 2.0 * TAU * metres(time as f64 * 1e-6) / wavelength + offset + noise;
        read(time, channel.0, phase)
    });
    reads.collect()
}

fn read(time_us: u64, channel: u16, phase: f64) -> TagRead {
    TagRead {
        time: BridgeTime(time_us),
        epc: Epc::from_hex("e280").unwrap(),
        antenna: AntennaPort(1),
        channel: ChannelIndex(channel),
        phase: Some(PhaseCode::from_radians(phase.rem_euclid(TAU) as f32)),
        rssi: CentiDbm(-4_500),
        doppler: None,
    }
}

fn steps(reads: &[TagRead]) -> Vec<Result<f64, Invalid>> {
    let (samples, _) = analyse(reads, Settings::default());
    samples.iter().filter_map(|s| s.step.map(|step| step.turned)).collect()
}

#[test]
fn a_still_tag_keeps_its_noise_and_loses_the_offsets() {
    let (samples, report) = analyse(&simulated(10, 0.05, |_| 1.3), Settings::default());
    assert_eq!(report.calibrated_groups, u64::from(CHANNELS));
    let (within, after) =
        (report.phase_std_within_channel_deg.unwrap(), report.phase_std_after_correction_deg.unwrap());
    assert!((within - 0.05_f64.to_degrees()).abs() < 0.15, "{within}");
    // The offset of each channel has the noise of the mean of 16 or 17 reads.
    assert!((after - (0.05 * (1.0 + 1.0 / 16.5_f64).sqrt()).to_degrees()).abs() < 0.15, "{after}");
    assert_eq!(report.pi_ambiguous.len(), 0);
    // 10 visits of 16 or 17 reads teach; all later reads are corrected.
    let first_round = CHANNELS as u64 * DWELL_US;
    assert!(samples.iter().all(|s| s.corrected.is_some() == (s.time.0 >= first_round)));
    assert_eq!(
        report.corrected,
        report.reads - samples.iter().filter(|s| s.time.0 < first_round).count() as u64
    );
}

#[test]
fn steps_of_a_moving_tag_follow_its_speed_across_hops() {
    // Still for the first round of hops, then 0.4 m/s for 2.5 s.
    let moving_from = 2.4;
    let metres = |s: f64| 1.0 + 0.4 * (s - moving_from).max(0.0);
    let (samples, report) = analyse(&simulated(5, 0.0, metres), Settings::default());
    let (mut largest_within, mut largest_hop, mut hops) = (0.0_f64, 0.0_f64, 0);
    for pair in samples.windows(2) {
        let [last, now] = pair else { unreachable!() };
        if now.time.seconds() < moving_from + 0.1 {
            continue;
        }
        let wavelength = f64::from(ChannelPlan::fcc().frequency(now.key.channel).unwrap().wavelength().0);
        let expected = 2.0 * TAU * 0.4 * PERIOD_US as f64 * 1e-6 / wavelength;
        let error = (now.step.unwrap().turned.unwrap() - expected).abs();
        if last.key.channel == now.key.channel {
            largest_within = largest_within.max(error);
        } else {
            hops += 1;
            largest_hop = largest_hop.max(error);
        }
    }
    // Two reads of half a code each.
    assert!(largest_within < TAU / 4096.0 + 1e-4, "{largest_within}");
    // 4 pi dd df / c with 1 m and, from channel 10 back to 1, 4.5 MHz: 0.19 rad.
    assert!(hops > 10 && largest_hop < 0.2, "{hops} hops, {largest_hop}");
    assert_eq!(
        report.intervals.valid + report.intervals.invalid(Invalid::UncalibratedHop),
        report.intervals.total()
    );
}

#[test]
fn an_offset_is_not_learnt_from_a_visit_in_which_the_tag_moves() {
    // A sway of 5 cm: a spread of more than a radian within each visit.
    let (samples, report) =
        analyse(&simulated(5, 0.0, |s| 1.0 + 0.05 * (s * TAU * 3.0).sin()), Settings::default());
    assert_eq!(report.calibrated_groups, 0);
    assert!(samples.iter().all(|s| s.corrected.is_none()));
    assert_eq!(report.phase_std_after_correction_deg, None);
    assert!(report.intervals.invalid(Invalid::UncalibratedHop) > 20);
}

#[test]
fn each_reason_is_told() {
    let known = [read(0, 1, 0.0), read(9_000, 1, 0.3)];
    assert!((steps(&known)[0].unwrap() - 0.3).abs() < 2e-3);
    assert!((steps(&[read(0, 1, 6.2), read(9_000, 1, 0.1)])[0].unwrap() - 0.183).abs() < 2e-3, "wrapped");
    for (second, reason) in [
        (read(0, 1, 0.3), Invalid::NotLater),
        (read(9_000, 0, 0.3), Invalid::ChannelUnknown),
        (read(9_000, 2, 0.3), Invalid::UncalibratedHop),
        (read(9_000, 1, PI - 0.2), Invalid::PiAmbiguity),
        (read(56_000, 1, 0.3), Invalid::TooLong),
    ] {
        assert_eq!(steps(&[known[0].clone(), second]), [Err(reason)]);
    }
    // Slow enough for the scene's fastest tag, so it may be movement.
    assert!(steps(&[read(0, 1, 0.0), read(55_000, 1, PI - 0.2)])[0].is_ok());
}

#[test]
fn longest_step_is_a_quarter_wavelength_at_the_channels_frequency() {
    let step = |us, channel| steps(&[read(0, channel, 0.0), read(us, channel, 0.0)])[0].is_ok();
    for channel in [1, 50] {
        let frequency = ChannelPlan::fcc().frequency(ChannelIndex(channel));
        let longest = f64::from(Settings::default().scene.longest_read_interval(frequency).0) * 1e6;
        assert!(step(longest as u64, channel) && !step(longest as u64 + 2, channel), "{channel}");
    }
    let lowest = Kilohertz(902_750).wavelength().0 / (4.0 * 1.5);
    assert!(step((lowest * 1e6) as u64, 1));
}

#[test]
fn flips_of_the_carriers_sign_are_found_and_marked() {
    let mut reads = simulated(10, 0.05, |_| 1.3);
    for read in reads.iter_mut().step_by(5) {
        read.phase = read.phase.map(|p| PhaseCode((p.0 + 2_048) % 4_096));
    }
    // With flips a visit spreads by more than a still tag's: offsets come from before.
    let mut still = PhasePipeline::new(Settings::default());
    simulated(5, 0.05, |_| 1.3).iter().for_each(|read| {
        still.push(read);
    });
    let mut pipeline = PhasePipeline::with_calibration(Settings::default(), &still.calibration());
    let marked =
        reads.iter().filter_map(|r| pipeline.push(r)?.step).filter(|s| s.turned == Err(Invalid::PiAmbiguity));
    let marked = marked.count();
    // A flipped read is left out, so that the step after it is valid.
    let flips = reads.len().div_ceil(5);
    assert!(marked.abs_diff(flips) <= 3, "{marked} of {flips}");
    let (_, report) = analyse(&reads, Settings::default());
    assert_eq!(report.pi_ambiguous.len(), usize::from(CHANNELS));
    assert!(
        report.pi_ambiguous.values().all(|share| (share - 0.2).abs() < 0.03),
        "{:?}",
        report.pi_ambiguous
    );
}

#[test]
fn a_reader_that_does_not_hop_is_calibrated_after_the_longest_visit() {
    let reads: Vec<_> = (0..100).map(|n| read(n * PERIOD_US, 3, 1.0)).collect();
    let (samples, report) = analyse(&reads, Settings::default());
    assert_eq!(report.calibrated_groups, 1);
    let first = samples.iter().find(|s| s.corrected.is_some()).unwrap();
    let longest = LearningRule::default().longest_us;
    assert!(first.time.0 > longest && first.time.0 <= longest + PERIOD_US);
}

#[test]
fn reads_without_phase_or_channel_are_counted_and_break_nothing() {
    let reads = [TagRead { phase: None, ..read(0, 1, 0.0) }, read(5_000, 0, 1.0), read(9_000, 0, 1.0)];
    let (samples, report) = analyse(&reads, Settings::default());
    assert_eq!((samples.len(), report.reads, report.without_phase), (2, 3, 1));
    assert_eq!(report.intervals.invalid(Invalid::ChannelUnknown), 1);
    assert_eq!(report.calibrated_groups, 0);
    let json = serde_json::to_string(&report).unwrap();
    assert!(json.contains("\"channel_unknown\":1"), "{json}");
}

#[test]
fn a_calibration_survives_as_json_and_serves_the_next_session() {
    let reads = simulated(5, 0.02, |_| 1.3);
    let mut first = PhasePipeline::new(Settings::default());
    for read in &reads {
        first.push(read);
    }
    let learnt = first.calibration();
    let json = serde_json::to_string(&learnt).unwrap();
    assert!(json.starts_with(r#"[{"epc":"e280","antenna":1,"channel":1,"radians":"#), "{json}");
    let kept: calibration::Calibration = serde_json::from_str(&json).unwrap();
    // JSON's decimals may be off by the last bit.
    let same = kept.offsets().zip(learnt.offsets()).all(|((key, kept), (other, offset))| {
        key == other && kept.tie == offset.tie && (kept.radians - offset.radians).abs() < 1e-12
    });
    assert!(same && kept.offsets().count() == usize::from(CHANNELS));
    assert!(serde_json::from_str::<calibration::Calibration>(&json.replace("e280", "e28")).is_err());
    let mut second = PhasePipeline::with_calibration(Settings::default(), &kept);
    let invalid = reads.iter().filter_map(|r| second.push(r)?.step?.turned.err()).count();
    assert_eq!(invalid, 0, "no hop is new");
}

#[test]
fn a_channel_never_visited_at_rest_is_learnt_when_the_tag_rests_elsewhere() {
    // Channels 8 to 10 come for the first time after the tag has been moved by 0.4 m within the second round's first visits.
    let moved = |s: f64| 1.0 + 0.4 * ((s - 2.2) / 1.0).clamp(0.0, 1.0);
    let mut reads = simulated(8, 0.05, moved);
    reads.retain(|read| read.channel.0 < 8 || read.time.0 > 3_400_000);
    let mut pipeline = PhasePipeline::new(Settings::default());
    let samples: Vec<_> = reads.iter().filter_map(|read| pipeline.push(read)).collect();
    assert_eq!(pipeline.calibration().offsets().count(), usize::from(CHANNELS));
    let ties: std::collections::BTreeSet<_> = pipeline.calibration().offsets().map(|(_, o)| o.tie).collect();
    assert_eq!(ties.len(), 1, "all are relative to each other");
    let late = samples.iter().filter(|sample| sample.time.0 > 5_800_000);
    let turned: Vec<_> = late.map(|sample| sample.step.unwrap().turned.unwrap()).collect();
    assert!(turned.iter().all(|turned| turned.abs() < 0.4), "{turned:?}");
}

#[test]
fn a_calibration_that_has_become_wrong_is_told_forgotten_and_learnt_anew() {
    let mut reads = simulated(12, 0.05, |_| 1.3);
    for read in reads.iter_mut().filter(|read| read.time.0 >= 4_000_000) {
        let shift = u32::from(read.channel.0) * 1_500;
        read.phase = read.phase.map(|p| PhaseCode(((u32::from(p.0) + shift) % 4_096) as u16));
    }
    let mut pipeline = PhasePipeline::new(Settings::default());
    let steps: Vec<_> = reads
        .iter()
        .filter_map(|read| pipeline.push(read))
        .filter_map(|sample| Some((sample.time.0, sample.step?.turned)))
        .collect();
    let stale = steps.iter().filter(|(_, turned)| *turned == Err(Invalid::StaleCalibration)).count();
    assert!((1..=usize::from(CHANNELS)).contains(&stale), "{stale}");
    let wrong = steps.iter().filter(|(_, turned)| turned.is_ok_and(|turned| turned.abs() > 0.5));
    assert_eq!(wrong.count(), 0);
    assert!(steps.iter().filter(|(time, _)| *time > 8_500_000).all(|(_, turned)| turned.is_ok()));
}

#[test]
fn reasons_have_names_and_texts() {
    for why in Invalid::ALL {
        assert_eq!(serde_json::to_string(why).unwrap(), format!("\"{}\"", why.reason()));
        assert!(!why.to_string().is_empty());
    }
}
