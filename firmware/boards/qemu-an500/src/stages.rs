//! Times the stages of the radar's path, one after the other, on a frame of the reference.

use core::fmt;
use core::hint::black_box;

use cortex_m::peripheral::SYST;
use num_complex::{Complex, Complex32};
use rfhoi_firmware::bridge::{FrameDone, Mapping};
use rfhoi_firmware::dca1000::{Datagram, Event, HEADER_BYTES, Reassembly, samples};
use rfhoi_firmware::dsp::{Cube, CubeShape, DopplerStage, RangeStage, fft};
use rfhoi_firmware::reference::ReferenceRadar;
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::DCA1000_PAYLOAD;
use rfhoi_shared::units::{BridgeTime, Decibels};

/// Cells of the largest cube: 72 bins, 12 antennas, 128 loops.
pub const CUBE_CELLS: usize = 72 * 12 * 128;
/// Bytes of the largest frame.
const FRAME_BYTES: usize = 786_432;
/// Longest range FFT.
const SAMPLES: usize = 128;
/// SysTick counts down from here.
pub const WRAP: u32 = 0xff_ffff;
/// Instructions to a tick: 25 MHz against one nanosecond each.
const INSTRUCTIONS: u32 = 40;

/// Instructions of each stage for one frame.
#[derive(Debug, Default)]
pub struct Table {
    reassembly: u32,
    unpack_window: u32,
    range_fft: u32,
    store: u32,
    doppler_fft: u32,
    clutter_maps: u32,
    covariance: u32,
    packets: u32,
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stages = [
            ("reassembly", self.reassembly),
            ("unpack_window", self.unpack_window),
            ("range_fft", self.range_fft),
            ("store", self.store),
            ("doppler_fft", self.doppler_fft),
            ("clutter_maps", self.clutter_maps),
            ("covariance", self.covariance),
            ("packets", self.packets),
        ];
        for (name, count) in stages {
            write!(f, "{name}={count} ")?;
        }
        write!(f, "all={}", stages.iter().map(|s| s.1).sum::<u32>())
    }
}

/// A datagram as it lies in a network driver's buffer: behind 14 + 20 + 8 bytes of headers, so that its samples begin at
/// a whole word.
#[repr(align(4))]
struct Packet([u8; DATAGRAM_AT + HEADER_BYTES + DCA1000_PAYLOAD as usize]);

/// Where the datagram begins in [`Packet`]; as 42, two bytes past a whole word.
const DATAGRAM_AT: usize = 2;

/// Memory of the measurement.
pub struct Bench {
    packet: Packet,
    frame: [u8; FRAME_BYTES],
    range: RangeStage,
    doppler: DopplerStage,
    work: [Complex32; SAMPLES],
}

/// Instructions that `work` takes; less than [`WRAP`] ticks.
fn measure(work: impl FnOnce()) -> u32 {
    let from = SYST::get_current();
    work();
    (from.wrapping_sub(SYST::get_current()) & WRAP) * INSTRUCTIONS
}

impl Bench {
    pub const fn new() -> Self {
        Self {
            packet: Packet([0; DATAGRAM_AT + HEADER_BYTES + DCA1000_PAYLOAD as usize]),
            frame: [0; FRAME_BYTES],
            range: RangeStage::new(),
            doppler: DopplerStage::new(),
            work: [Complex32::new(0.0, 0.0); SAMPLES],
        }
    }

    /// The table of `config`, or `None` where its frame or cube is too large.
    pub fn run(&mut self, config: &RadarConfig, memory: &mut [Complex<i16>]) -> Option<Table> {
        let profile = &config.profile;
        let Self { packet, frame, range, doppler, work } = self;
        let frame = frame.get_mut(..profile.frame_bytes() as usize)?;
        let work = work.get_mut(..usize::from(profile.samples))?;
        let chirp_bytes = profile.chirp_bytes() as usize;
        let mut radar = ReferenceRadar::new(config)?;
        for (index, chirp) in (0..).zip(frame.chunks_exact_mut(chirp_bytes)) {
            radar.chirp(0, index, chirp);
        }
        let mut table = Table::default();

        let mut reassembly = Reassembly::<4096>::new(profile)?;
        for (i, payload) in frame.chunks(DCA1000_PAYLOAD as usize).enumerate() {
            let datagram = packet.0.get_mut(DATAGRAM_AT..)?.get_mut(..HEADER_BYTES + payload.len())?;
            let (header, samples) = datagram.split_at_mut(HEADER_BYTES);
            header.copy_from_slice(&Datagram::header(i as u32 + 1, i as u64 * u64::from(DCA1000_PAYLOAD)));
            samples.copy_from_slice(payload);
            table.reassembly += measure(|| {
                reassembly.push(datagram, |event: Event<'_>| {
                    black_box(event);
                });
            });
        }

        let receiver_bytes = chirp_bytes / profile.rx_count();
        let window = [1.0 / 32768.0; SAMPLES];
        table.unpack_window = measure(|| {
            for receiver in frame.chunks_exact(receiver_bytes) {
                black_box(samples::unpack(receiver, profile.format, &window, work));
            }
        });
        table.range_fft = measure(|| {
            for _ in frame.chunks_exact(receiver_bytes) {
                black_box(fft::forward(work));
            }
        });
        let mut cube = Cube::new(memory);
        cube.reshape(CubeShape::of(config)).then_some(())?;
        range.configure(profile, config.processing.gate);
        let range_stage = measure(|| {
            for (index, chirp) in (0..).zip(frame.chunks_exact(chirp_bytes)) {
                black_box(range.chirp(index, chirp, &mut cube));
            }
        });
        table.store = range_stage.saturating_sub(table.unpack_window + table.range_fft);

        let mut doppler_stage = |config: &RadarConfig| {
            doppler.configure(config);
            measure(|| {
                doppler.begin(&cube);
                for bin in 0..cube.shape().bins {
                    black_box(doppler.range_bin(&cube, bin));
                }
            })
        };
        let whole = doppler_stage(config);
        // Nothing rises so far over the noise: no cell enters the covariance.
        let mut still = config.clone();
        still.processing.detection = Decibels(200.0);
        let without_covariance = doppler_stage(&still);
        let row = work.get_mut(..usize::from(profile.loops))?;
        table.doppler_fft = measure(|| {
            for _ in 0..cube.shape().bins * cube.shape().virtuals {
                black_box(fft::forward(row));
            }
        });
        table.clutter_maps = without_covariance.saturating_sub(table.doppler_fft);
        table.covariance = whole.saturating_sub(without_covariance);

        let mut mapping = Mapping::new(config, &mut *doppler);
        let mut uplink = Uplink::new(0);
        let done = FrameDone::default();
        let mapped = measure(|| {
            mapping.frame(BridgeTime(0), &cube, done, &mut uplink, &mut |_, packet| {
                black_box(packet);
                true
            });
        });
        table.packets = mapped.saturating_sub(whole);
        Some(table)
    }
}
