//! The bridge's signal processing on a simulated cube: the maps of a frame, as they would come over the wire.

use num_complex::Complex;
use rfhoi_firmware::dsp::{Cube, CubeShape, DopplerStage, level};
use rfhoi_shared::config::RadarConfig;

/// Maps of one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameMaps {
    /// Range bin x Doppler bin, codes on [`level::SCALE`].
    pub range_doppler: Vec<u8>,
    /// Range bin x group of loops, codes on [`level::SCALE`].
    pub range_time: Vec<u8>,
    /// Spatial covariance of the moving cells, packed as [`rfhoi_shared::wire::Covariance`].
    pub covariance: Vec<f32>,
    /// Cells that moved.
    pub moving_cells: u32,
}

/// From cube to maps, with memory for a cube.
pub(super) struct Mapper {
    doppler: Box<DopplerStage>,
    memory: Vec<Complex<i16>>,
    shape: CubeShape,
}

impl Mapper {
    pub(super) fn new(config: &RadarConfig) -> Self {
        let shape = CubeShape::of(config);
        let mut doppler = Box::new(DopplerStage::new());
        doppler.configure(config);
        Self { doppler, memory: vec![Complex::default(); shape.cells()], shape }
    }

    /// Forgets the frames before.
    pub(super) fn begin(&mut self, config: &RadarConfig) {
        self.doppler.configure(config);
    }

    /// The maps of the cube that `fill` makes.
    pub(super) fn frame(&mut self, fill: impl FnOnce(&mut Cube<'_>)) -> FrameMaps {
        let mut cube = Cube::new(&mut self.memory);
        cube.reshape(self.shape);
        fill(&mut cube);
        let mut maps = FrameMaps::default();
        self.doppler.begin(&cube);
        for bin in 0..self.shape.bins {
            let row = self.doppler.range_bin(&cube, bin);
            maps.range_doppler.extend(row.doppler().map(level::code));
            maps.range_time.extend(row.time.iter().copied().map(level::code));
        }
        let moving = self.doppler.finish();
        maps.covariance = moving.covariance().collect();
        maps.moving_cells = moving.cells();
        maps
    }
}
