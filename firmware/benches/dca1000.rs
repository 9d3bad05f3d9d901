//! Raw samples of the simulated `bridge` profile, a frame at a time: reassembly of datagrams alone, and all of the path
//! from datagrams to uplink packets (range FFTs, Doppler stage, maps, covariance).
//!
//! Every frame begins as after the recorder's start, which reassembly takes as a restart.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use num_complex::Complex;
use rfhoi_firmware::bridge::RadarPath;
use rfhoi_firmware::dca1000::{Datagram, Event, Reassembly};
use rfhoi_firmware::dsp::CubeShape;
use rfhoi_firmware::simulated::{Noise, Scatterer, SimulatedRadar};
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::BridgeConfig;
use rfhoi_shared::radar::{DCA1000_PAYLOAD, RadarProfile};
use rfhoi_shared::units::BridgeTime;

/// Bytes of a receiver's row that a board collects.
const ROW: usize = 2048;

/// The datagrams of one frame of a hand before a wall.
fn datagrams(profile: &RadarProfile) -> Vec<Vec<u8>> {
    let point = |range_m, velocity_m_s, amplitude| Scatterer {
        range_m,
        velocity_m_s,
        azimuth_rad: 0.2,
        elevation_rad: 0.1,
        amplitude,
    };
    let scatterers = [point(1.0, 1.0, 0.05), point(2.5, 0.0, 0.3)];
    let mut radar = SimulatedRadar::new(profile).expect("the profile is valid");
    let mut noise = Noise::new(1, 10.0);
    let mut stream = vec![0; profile.frame_bytes() as usize];
    for (index, chirp) in (0..).zip(stream.chunks_exact_mut(profile.chirp_bytes() as usize)) {
        radar.chirp(&scatterers, &mut noise, 0, index, chirp);
    }
    let payloads = stream.chunks(DCA1000_PAYLOAD as usize);
    let numbered = (0..).zip(payloads).map(|(i, payload)| {
        [&Datagram::header(i + 1, u64::from(i) * u64::from(DCA1000_PAYLOAD)), payload].concat()
    });
    numbered.collect()
}

fn bench(criterion: &mut Criterion) {
    let config = BridgeConfig::default().radar;
    let datagrams = datagrams(&config.profile);
    let mut group = criterion.benchmark_group("dca1000");

    group.throughput(Throughput::Bytes(config.profile.frame_bytes().into()));
    group.bench_function("reassembly", |b| {
        let mut reassembly = Reassembly::<ROW>::new(&config.profile).expect("rows fit");
        b.iter(|| {
            let mut rows = 0;
            for datagram in black_box(&datagrams) {
                reassembly.push(datagram, |event| {
                    rows += u32::from(matches!(black_box(event), Event::Row { intact: true, .. }));
                });
            }
            assert_eq!(rows, config.profile.chirps_per_frame() * config.profile.rx_count() as u32);
        });
    });

    group.throughput(Throughput::Elements(1));
    group.bench_function("frame_to_packets", |b| {
        let mut memory = vec![Complex::default(); CubeShape::of(&config).cells()];
        let mut path = RadarPath::<ROW>::new(&config, &mut memory).expect("the configuration is valid");
        let mut uplink = Uplink::new(1);
        b.iter(|| {
            let mut packets = 0;
            for datagram in black_box(&datagrams) {
                path.push(BridgeTime(0), datagram, &mut uplink, |_, bytes| {
                    packets += u32::from(!black_box(bytes).is_empty());
                    true
                });
            }
            assert!(packets > 0, "the frame is complete");
        });
        assert_eq!(path.frames().incomplete, 0);
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
