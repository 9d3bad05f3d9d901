//! The recorder's datagrams: reassembly and range FFT as they arrive, complete cubes to signal processing.

use core::mem;

use num_complex::Complex;
use rfhoi_firmware::bridge::{Capture, FrameDone};
use rfhoi_firmware::dsp::{Cube, CubeShape};
use rfhoi_shared::config::{Ipv4, RadarConfig, RadarInput};
use rfhoi_shared::radar::MAX_SAMPLES;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{DatagramCounts, FrameCounts};

use crate::bridge::Bridge;
use crate::handover::Handover;
use crate::tap::Datagrams;
use crate::{CUBE_CELLS, now};

/// Bytes of a chirp of one receiver, at most: complex samples of 16 bits.
const ROW: usize = 4 * MAX_SAMPLES;
/// Reassembly, range stage, and the cube being filled.
pub(crate) struct Intake {
    capture: Option<Capture<ROW>>,
    /// Of no size while signal processing has the only one.
    cube: Cube<'static>,
    /// There is memory for one cube only: of two frames that follow each other closely the second is lost.
    single: bool,
    handover: &'static Handover,
    overruns: u32,
}

impl Intake {
    /// Takes a valid configuration; puts a second cube aside where there is memory for it.
    pub(crate) fn new(
        config: &RadarConfig,
        memory: &'static mut [Complex<i16>; CUBE_CELLS],
        handover: &'static Handover,
    ) -> Self {
        let shape = CubeShape::of(config);
        // The first fits, or the configuration would not be valid.
        let (memory, rest) = memory.split_at_mut(shape.cells().min(CUBE_CELLS));
        let single = rest.len() < shape.cells();
        let shaped = |memory| {
            let mut cube = Cube::new(memory);
            cube.reshape(shape);
            cube
        };
        if !single {
            // The channel is empty: there is room.
            let _ = handover.spare.try_send(shaped(rest));
        }
        let raw = matches!(config.input, RadarInput::Dca1000 { .. });
        let capture = if raw { Capture::new(config) } else { None };
        Self { capture, cube: shaped(memory), single, handover, overruns: 0 }
    }

    /// Takes a UDP payload of the recorder.
    pub(crate) fn datagram(&mut self, now: BridgeTime, bytes: &[u8]) {
        let Self { capture: Some(capture), cube, single, handover, overruns } = self else { return };
        if cube.is_nothing()
            && capture.is_between_frames()
            && let Ok(spare) = handover.spare.try_receive()
        {
            *cube = spare;
        }
        capture.push(now, bytes, cube, |cube, done: FrameDone| {
            let spare = handover.spare.try_receive().ok();
            if cube.is_nothing() {
                // Nothing of this frame was kept; the next one may be.
                *overruns = overruns.wrapping_add(1);
                *cube = spare.unwrap_or(Cube::nothing());
                return;
            }
            let next = match spare {
                Some(next) => next,
                None if *single => Cube::nothing(),
                None => {
                    *overruns = overruns.wrapping_add(1);
                    return;
                }
            };
            let full = mem::replace(cube, next);
            // Both cubes are accounted for: there is room.
            let _ = handover.frames.try_send((full, done));
        });
    }

    /// Whether raw samples are taken.
    pub(crate) fn is_raw(&self) -> bool {
        self.capture.is_some()
    }

    /// Counts of datagrams.
    pub(crate) fn datagrams(&self) -> DatagramCounts {
        self.capture.as_ref().map(Capture::datagrams).unwrap_or_default()
    }

    /// Counts of frames.
    pub(crate) fn frames(&self) -> FrameCounts {
        self.capture.as_ref().map(Capture::frames).unwrap_or_default()
    }

    /// Frames for which signal processing was too slow.
    pub(crate) fn overruns(&self) -> u32 {
        self.overruns
    }
}

/// The recorder's datagrams, where they lie in the driver's buffer ([`crate::Tap`]).
impl Datagrams for &'static Bridge {
    fn datagram(&mut self, sender: Ipv4, payload: &[u8]) {
        match self.config.radar.input {
            RadarInput::Dca1000 { address, .. } if address == sender => {
                if let Ok(mut intake) = self.intake.try_borrow_mut() {
                    intake.datagram(now(), payload);
                }
            }
            _ => self.stray(),
        }
    }
}
