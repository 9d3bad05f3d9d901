//! The table of the radar profiles, held as a whole: every derived number of each named profile.

use expect_test::expect;
use rfhoi_shared::array::virtual_antennas;
use rfhoi_shared::radar::{MAX_VIRTUAL, ProfileError, RadarProfile, SampleFormat};
use rfhoi_shared::scene::Scene;

fn row(name: &str) -> String {
    let p = RadarProfile::named(name).unwrap();
    p.validate().unwrap();
    let gate = Scene::default().gate(&p).unwrap();
    let yes = |b| if b { "yes" } else { "no" };
    format!(
        "{name:<6} | {:>4} x {:>3} | {:.2} cm, {:.2} m | +-{:.2} m/s, {:.2} cm/s | {:>7} B, {:>5.1} Mbit/s, {:>7.2} datagrams | 100M {:<3} | stock {:<3} | {} bins, cube {:.0} KB\n",
        p.samples,
        p.loops,
        p.range_bin().0 * 100.0,
        p.range_span().0,
        p.velocity_span().0,
        p.velocity_bin().0 * 100.0,
        p.frame_bytes(),
        p.raw_bit_rate() / 1e6,
        p.datagrams_per_frame(),
        yes(p.fits_100mbit()),
        yes(p.fits_stock_firmware()),
        gate.bins,
        f64::from(p.cube_bytes(gate)) / 1000.0,
    )
}

#[test]
fn derived_numbers_of_the_named_profiles() {
    let table: String = ["paper", "fine", "bridge"].into_iter().map(row).collect();
    expect![[r#"
        paper  |  256 x 128 | 4.29 cm, 10.99 m | +-4.49 m/s, 7.02 cm/s | 1572864 B, 125.8 Mbit/s, 1080.26 datagrams | 100M no  | stock no  | 72 bins, cube 442 KB
        fine   |  128 x 128 | 4.29 cm, 5.50 m | +-4.49 m/s, 7.02 cm/s |  786432 B,  62.9 Mbit/s,  540.13 datagrams | 100M yes | stock yes | 72 bins, cube 442 KB
        bridge |  128 x  64 | 4.29 cm, 5.50 m | +-4.49 m/s, 14.04 cm/s |  393216 B,  31.5 Mbit/s,  270.07 datagrams | 100M yes | stock yes | 72 bins, cube 221 KB
    "#]].assert_eq(&table);
}

#[test]
fn the_papers_figures_follow_from_its_profile() {
    // Section 4.1: 11 m, 4.3 cm, 4.5 m/s, 7.1 cm/s. The last is 2 x 4.5 / 128 with 4.5 rounded up: 7.02 here.
    let p = RadarProfile::paper();
    assert!((p.range_span().0 - 11.0).abs() < 0.02);
    assert!((p.range_bin().0 - 0.043).abs() < 5e-4);
    assert!((p.velocity_span().0 - 4.5).abs() < 0.02);
    assert!((p.velocity_bin().0 - 0.071).abs() < 1e-3);
    assert_eq!(p.virtual_count(), MAX_VIRTUAL);
    assert_eq!(virtual_antennas(&p).unwrap().len(), MAX_VIRTUAL);
}

#[test]
fn fine_keeps_the_papers_bins_at_half_the_span() {
    let (paper, fine) = (RadarProfile::paper(), RadarProfile::fine());
    assert_eq!(paper.range_bin(), fine.range_bin());
    assert_eq!(paper.velocity_bin(), fine.velocity_bin());
    assert!((paper.range_span().0 / fine.range_span().0 - 2.0).abs() < 1e-6);
}

#[test]
fn real_samples_give_half_the_bins_and_bytes() {
    let complex = RadarProfile::bridge();
    let real = RadarProfile { format: SampleFormat::Real, ..complex.clone() };
    assert_eq!(real.frame_bytes() * 2, complex.frame_bytes());
    assert_eq!(real.range_bins() * 2, complex.range_bins());
}

#[test]
fn every_rule_of_a_profile_refuses() {
    let refused = |change: fn(&mut RadarProfile)| {
        let mut profile = RadarProfile::bridge();
        change(&mut profile);
        profile.validate().expect_err("the changed profile is wrong")
    };
    assert_eq!(refused(|p| p.samples = 8), ProfileError::Samples(8));
    assert_eq!(refused(|p| p.samples = 2048), ProfileError::Samples(2048));
    assert_eq!(refused(|p| p.loops = 0), ProfileError::Loops(0));
    assert_eq!(refused(|p| p.loops = 512), ProfileError::Loops(512));
    assert_eq!(refused(|p| p.rx_mask = 0), ProfileError::RxMask(0));
    assert_eq!(refused(|p| p.rx_mask = 16), ProfileError::RxMask(16));
    assert_eq!(refused(|p| p.tx_order.clear()), ProfileError::TxOrder);
    assert_eq!(refused(|p| p.tx_order[1] = 0), ProfileError::TxOrder);
    assert_eq!(refused(|p| p.slope_khz_per_us = 0), ProfileError::ZeroParameter);
    assert_eq!(refused(|p| p.sample_rate_ksps = 0), ProfileError::ZeroParameter);
    assert_eq!(refused(|p| p.ramp_end_ns = 64_000), ProfileError::SamplingPastRamp(64_181, 64_000));
    assert_eq!(refused(|p| p.frame_period_us = 13_600), ProfileError::FrameTooLong(13_497, 13_600));
}

#[test]
fn fingerprints_differ_with_any_field() {
    let base = RadarProfile::bridge();
    assert_eq!(base.fingerprint(), RadarProfile::bridge().fingerprint());
    for changed in [
        RadarProfile { loops: 128, ..base.clone() },
        RadarProfile { idle_ns: base.idle_ns + 10, ..base.clone() },
        RadarProfile { rx_mask: 7, ..base.clone() },
        RadarProfile { format: SampleFormat::Real, ..base.clone() },
    ] {
        assert_ne!(base.fingerprint(), changed.fingerprint());
    }
}
