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
    input: Option<Input>,
    handover: &'static Handover,
    overruns: u32,
}

struct Input {
    capture: Capture<ROW>,
    /// Holds nothing while signal processing has the only one.
    cube: &'static mut Cube<'static>,
    /// What takes its place then, where there is memory for one cube only: of two frames that follow each other closely
    /// the second is lost.
    nothing: Option<&'static mut Cube<'static>>,
}

impl Intake {
    /// Takes a valid configuration; puts a second cube aside where there is memory for it.
    pub(crate) fn new(
        config: &RadarConfig,
        memory: &'static mut [Complex<i16>; CUBE_CELLS],
        handover: &'static Handover,
    ) -> Self {
        let raw = matches!(config.input, RadarInput::Dca1000 { .. });
        let input = if raw { Input::new(config, memory, handover) } else { None };
        Self { input, handover, overruns: 0 }
    }

    /// Takes a UDP payload of the recorder.
    pub(crate) fn datagram(&mut self, now: BridgeTime, bytes: &[u8]) {
        let Self { input: Some(Input { capture, cube, nothing }), handover, overruns } = self else { return };
        if cube.is_nothing()
            && capture.is_between_frames()
            && let Ok(spare) = handover.spare.try_receive()
        {
            *nothing = Some(mem::replace(cube, spare));
        }
        capture.push(now, bytes, cube, |cube, done: FrameDone| {
            let spare = handover.spare.try_receive().ok();
            if cube.is_nothing() {
                // Nothing of this frame was kept; the next one may be.
                *overruns = overruns.wrapping_add(1);
                *nothing = spare.map(|spare| mem::replace(cube, spare)).or(nothing.take());
                return;
            }
            match spare.or_else(|| nothing.take()) {
                Some(next) => {
                    let full = mem::replace(cube, next);
                    // All cubes are accounted for: there is room.
                    let _ = handover.frames.try_send((full, done));
                }
                None => *overruns = overruns.wrapping_add(1),
            }
        });
    }

    /// Whether raw samples are taken.
    pub(crate) fn is_raw(&self) -> bool {
        self.input.is_some()
    }

    /// Counts of datagrams.
    pub(crate) fn datagrams(&self) -> DatagramCounts {
        self.input.as_ref().map(|input| input.capture.datagrams()).unwrap_or_default()
    }

    /// Counts of frames.
    pub(crate) fn frames(&self) -> FrameCounts {
        self.input.as_ref().map(|input| input.capture.frames()).unwrap_or_default()
    }

    /// Frames for which signal processing was too slow.
    pub(crate) fn overruns(&self) -> u32 {
        self.overruns
    }
}

impl Input {
    /// `None` where the cubes are in use already, as only a second call finds them.
    fn new(
        config: &RadarConfig,
        memory: &'static mut [Complex<i16>; CUBE_CELLS],
        handover: &'static Handover,
    ) -> Option<Self> {
        let shape = CubeShape::of(config);
        // The first fits, or the configuration would not be valid.
        let (memory, rest) = memory.split_at_mut(shape.cells().min(CUBE_CELLS));
        let [first, second, none] = &handover.cubes;
        let cube = first.try_init(Cube::new(memory))?;
        cube.reshape(shape);
        let second = second.try_init(Cube::new(rest))?;
        let nothing = if second.reshape(shape) {
            // The channel is empty: there is room.
            let _ = handover.spare.try_send(second);
            None
        } else {
            Some(none.try_init(Cube::nothing())?)
        };
        Some(Self { capture: Capture::new(config)?, cube, nothing })
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
