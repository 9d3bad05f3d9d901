//! A simulated room at the level of the wire: the samples of a person who acts, as a DCA1000 sends them, through the bridge's
//! logic and over its wire, are at the host what computing them directly gives, but for what 16-bit words round away.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rfhoi::datagrams::Cutter;
use rfhoi::hoi::CATEGORIES;
use rfhoi::simulate::draw::{Purpose, Wanted, draw, stream};
use rfhoi::simulate::effects::{Domain, Effects};
use rfhoi::simulate::radar::Radar;
use rfhoi::simulate::sample::{Take, perform};
use rfhoi::simulate::scene::Scene;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::BridgeTime;
use rfhoi_tests::simulated::path::run;

/// Power by range and signed Doppler bin of one frame's samples, by the transforms' definitions in double precision.
struct Direct {
    /// Relative to a full-scale tone; range bin by range bin, Doppler from the lowest.
    range_doppler: Vec<f64>,
}

/// A periodic Hann window, shifted by half a sample, of sum 1 (F. J. Harris, eq. 23b).
fn hann(length: usize) -> Vec<f64> {
    let n = length as f64;
    (0..length).map(|i| (1.0 - (TAU * (i as f64 + 0.5) / n).cos()) / n).collect()
}

/// `exp(-j 2 pi i / n)` for all i.
fn roots(n: usize) -> Vec<Complex64> {
    (0..n).map(|i| Complex64::from_polar(1.0, -TAU * i as f64 / n as f64)).collect()
}

impl Direct {
    /// `chirps` are samples relative to full scale: chirp by chirp, receiver by receiver.
    fn new(config: &RadarConfig, chirps: &[Vec<Complex64>]) -> Self {
        let profile = &config.profile;
        let (samples, loops) = (usize::from(profile.samples), usize::from(profile.loops));
        let (slots, receivers) = (profile.tx_slots(), profile.rx_count());
        let (range_window, doppler_window) = (hann(samples), hann(loops));
        let (range_roots, doppler_roots) = (roots(samples), roots(loops));
        let gate = config.processing.gate;
        let mut range_doppler = Vec::new();
        for bin in usize::from(gate.first)..usize::from(gate.first + gate.bins) {
            let mut power = vec![0.0; loops];
            for antenna in 0..slots * receivers {
                let (slot, rx) = (antenna / receivers, antenna % receivers);
                let row: Vec<Complex64> = (0..loops)
                    .map(|l| {
                        let chirp = &chirps[l * slots + slot][rx * samples..][..samples];
                        let terms = chirp.iter().zip(&range_window).enumerate();
                        terms.map(|(n, (x, w))| x * *w * range_roots[n * bin % samples]).sum()
                    })
                    .collect();
                // Static clutter is the mean, weighted by the window.
                let mean: Complex64 = row.iter().zip(&doppler_window).map(|(x, w)| x * *w).sum();
                for (d, power) in power.iter_mut().enumerate() {
                    let bin = (d + loops - loops / 2) % loops;
                    let terms = row.iter().zip(&doppler_window).enumerate();
                    let cell: Complex64 =
                        terms.map(|(l, (x, w))| (x - mean) * *w * doppler_roots[l * bin % loops]).sum();
                    *power += cell.norm_sqr() / (slots * receivers) as f64;
                }
            }
            range_doppler.extend(power);
        }
        Self { range_doppler }
    }
}

#[test]
fn what_went_over_both_wires_is_what_direct_computing_gives() {
    let mut scene = Scene::named("kitchen").unwrap();
    scene.radar.profile = RadarProfile { loops: 32, ..RadarProfile::bridge() };
    // Near enough for an echo far above the rounding.
    let radar_at = scene.radar.position.truncate();
    scene.places.retain(|place| place.position.distance(radar_at) < 1.7 && place.facing_rad.abs() < 0.1);
    let scenes = [scene];
    let wanted = Wanted::one(Domain::Site, 3, &CATEGORIES[1..2]);
    let mut drawn = draw(&wanted, &scenes).swap_remove(0);
    drawn.facing_deg = 0.0;
    let (performance, tags) = perform(wanted.domain, wanted.seed, &drawn, &scenes[0]).unwrap();
    // Noise would differ; all else is there.
    let effects = Effects { thermal_noise: false, phase_noise: false, ..Effects::of(Domain::Site) };
    let take = Take::of(&scenes[0], &performance, &tags, effects);
    let mut radar = Radar::new(take.scene, effects).unwrap();
    radar.begin(take.fixtures, &mut stream(wanted.domain, wanted.seed, 0, Purpose::Radar));
    let config = radar.config().clone();
    // The liveliest frame: its first and last chirp from the first transmitter differ most.
    let last = config.profile.chirps_per_frame() - config.profile.tx_slots() as u32;
    let mut liveliness = |time_s: &f64| {
        radar.look(&performance, *time_s);
        let first = radar.chirp_samples(0).to_vec();
        first.iter().zip(radar.chirp_samples(last)).map(|(a, b)| (a - b).norm_sqr()).sum::<f32>()
    };
    let times = take.frame_times(&config.profile).map(|time_s| (liveliness(&time_s), time_s));
    let (_, lively_s) = times.max_by(|a, b| a.0.total_cmp(&b.0)).expect("a sample has frames");

    let (mut cutter, mut datagrams, mut chirps) = (Cutter::default(), Vec::new(), Vec::new());
    radar.look(&performance, lively_s);
    let mut bytes = vec![0; config.profile.chirp_bytes() as usize];
    for index in 0..config.profile.chirps_per_frame() {
        let wide = |z: &num_complex::Complex32| Complex64::new(z.re.into(), z.im.into());
        chirps.push(radar.chirp_samples(index).iter().map(wide).collect::<Vec<_>>());
        radar.chirp(index, &mut bytes);
        let cut = cutter.push(&bytes).into_iter().map(|d| (BridgeTime(u64::from(index)), d.bytes));
        datagrams.extend(cut);
    }
    datagrams
        .extend(cutter.finish().map(|d| (BridgeTime(u64::from(config.profile.chirps_per_frame())), d.bytes)));
    let outcome = run(&config, datagrams);
    let frame = &outcome.frames[0];
    assert_eq!(frame.info.expect("the frame's end arrived").chirps_lost, 0);
    let map = frame.range_doppler.as_ref().expect("the map arrived");
    let direct = Direct::new(&config, &chirps).range_doppler;
    assert_eq!(direct.len(), map.codes.len());

    // Rounding to words is noise of 1/12 of a word's square for I and Q each. Two Hann windows keep 1.5 times their share of it,
    // each; the strongest of some thousand cells is at most 10 times the mean.
    let cells = f64::from(config.profile.samples) * f64::from(config.profile.loops);
    let rounding = 2.0 / 12.0 / 32768f64.powi(2) * 1.5f64.powi(2) / cells;
    let half_step = f64::from(map.scale.step_db) / 2.0 + 0.01;
    let db = |power: f64| 10.0 * power.max(1e-30).log10();
    let floor_db = f64::from(map.scale.level_db(0));
    let (mut compared, mut strongest) = (0, f64::MIN);
    for (cell, &expected) in direct.iter().enumerate() {
        let found = f64::from(map.level_db(cell / map.columns, cell % map.columns));
        // Amplitudes add at worst; the cube's block floating point is as fine as the words.
        let error = 2.0 * (10.0 * rounding).sqrt();
        let (low, high) = ((expected.sqrt() - error).max(0.0).powi(2), (expected.sqrt() + error).powi(2));
        assert!(
            found <= db(high).max(floor_db) + half_step && found >= db(low).max(floor_db) - half_step,
            "cell {cell}: {found} dB for {:.2} dB",
            db(expected)
        );
        compared += usize::from(expected > 100.0 * rounding);
        strongest = strongest.max(db(expected));
    }
    // Enough of the map is far above the rounding for this to mean something.
    assert!(compared > 100 && strongest > db(rounding) + 40.0, "{compared} cells, {strongest:.1} dB");
    println!(
        "{compared} cells more than 20 dB above the rounding ({:.1} dB), the strongest {strongest:.1} dB",
        db(rounding)
    );
}
