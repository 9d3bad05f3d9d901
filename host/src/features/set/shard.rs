//! A shard of a set: what was measured, and how it becomes features.

use std::fs::File;
use std::io::BufReader;
use std::ops::Range;
use std::path::{Path, PathBuf};

use ndarray::{Array2, Array3, ArrayBase, ArrayView2, Axis, Dimension, Ix1, OwnedRepr};
use ndarray_npy::{NpzReader, ReadableElement};
use rfhoi_network::sample::Frames;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::RangeGate;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{
    AntennaPort, BridgeTime, CentiDbm, ChannelIndex, DopplerCode, Kilohertz, PhaseCode,
};

use super::manifest::{Manifest, Maps};
use super::{Measured, SetError};
use crate::align;
use crate::features::Settings;
use crate::features::passage::{Passage, put_map, put_moving};
use crate::jobs::Jobs;
use crate::receive::{HeatMap, RadarFrame};

/// Arrays of a shard.
pub(super) struct Shard<'a> {
    path: PathBuf,
    manifest: &'a Manifest,
    frame_first: Vec<u32>,
    read_first: Vec<u32>,
    range_doppler: Array3<u8>,
    range_time: Array3<u8>,
    covariance: Array2<f32>,
    moving_cells: Vec<u32>,
    read_time_us: Vec<i32>,
    read_tag: Vec<u8>,
    read_antenna: Vec<u8>,
    read_channel: Vec<u8>,
    read_phase: Vec<u16>,
    read_rssi: Vec<i16>,
    read_doppler: Vec<i16>,
    channel_khz: Array2<u32>,
    interaction_s: Array2<f32>,
}

/// Arrays of a file.
struct Arrays<'a> {
    path: &'a Path,
    npz: NpzReader<BufReader<File>>,
}

impl Arrays<'_> {
    fn array<A: ReadableElement, D: Dimension>(
        &mut self,
        name: &'static str,
    ) -> Result<ArrayBase<OwnedRepr<A>, D>, SetError> {
        self.npz.by_name(name).map_err(|source| SetError::Array {
            path: self.path.to_path_buf(),
            name,
            source,
        })
    }

    fn list<A: ReadableElement + Clone>(&mut self, name: &'static str) -> Result<Vec<A>, SetError> {
        Ok(self.array::<A, Ix1>(name)?.into_raw_vec_and_offset().0)
    }
}

impl<'a> Shard<'a> {
    /// Reads the shard of `samples` samples at `path`.
    pub(super) fn read(path: &Path, manifest: &'a Manifest, samples: usize) -> Result<Self, SetError> {
        let file = File::open(path).map_err(|source| SetError::Read { path: path.to_path_buf(), source })?;
        let npz = NpzReader::new(BufReader::new(file)).map_err(|source| SetError::Array {
            path: path.to_path_buf(),
            name: "frame_first",
            source,
        })?;
        let mut arrays = Arrays { path, npz };
        let shard = Self {
            path: path.to_path_buf(),
            manifest,
            frame_first: arrays.list("frame_first")?,
            read_first: arrays.list("read_first")?,
            range_doppler: arrays.array("range_doppler")?,
            range_time: arrays.array("range_time")?,
            covariance: arrays.array("covariance")?,
            moving_cells: arrays.list("moving_cells")?,
            read_time_us: arrays.list("read_time_us")?,
            read_tag: arrays.list("read_tag")?,
            read_antenna: arrays.list("read_antenna")?,
            read_channel: arrays.list("read_channel")?,
            read_phase: arrays.list("read_phase")?,
            read_rssi: arrays.list("read_rssi")?,
            read_doppler: arrays.list("read_doppler")?,
            channel_khz: arrays.array("channel_khz")?,
            interaction_s: arrays.array("interaction_s")?,
        };
        shard.fits(samples)?;
        Ok(shard)
    }

    /// Whether all arrays have the shapes that they should have.
    fn fits(&self, samples: usize) -> Result<(), SetError> {
        let ends = |firsts: &[u32]| {
            let good = firsts.is_sorted() && firsts.len() == samples + 1;
            if good { Some(*firsts.last()? as usize) } else { None }
        };
        let sides = ends(&self.frame_first).zip(ends(&self.read_first));
        let (frames, reads) =
            sides.ok_or_else(|| self.wrong("its samples do not follow each other".to_owned()))?;
        let Maps { range_bins, doppler_bins, range_time_columns, virtual_antennas, .. } = self.manifest.maps;
        let [bins, dopplers, columns] = [range_bins, doppler_bins, range_time_columns].map(usize::from);
        let of_reads = [
            self.read_time_us.len(),
            self.read_tag.len(),
            self.read_antenna.len(),
            self.read_channel.len(),
            self.read_phase.len(),
            self.read_rssi.len(),
            self.read_doppler.len(),
        ];
        let good = self.range_doppler.dim() == (frames, bins, dopplers)
            && self.range_time.dim() == (frames, bins, columns)
            && self.covariance.dim() == (frames, virtual_antennas * virtual_antennas)
            && self.moving_cells.len() == frames
            && of_reads.iter().all(|count| *count == reads)
            && self.channel_khz.dim().0 == samples
            && self.interaction_s.dim() == (samples, 2);
        if good { Ok(()) } else { Err(self.wrong("the shapes of its arrays do not fit together".to_owned())) }
    }

    fn wrong(&self, what: String) -> SetError {
        SetError::Shard { path: self.path.clone(), what }
    }

    /// What is measured in each sample, by streams of these settings.
    pub(super) fn measure(
        &self,
        stream: &align::Settings,
        settings: &Settings,
        jobs: &Jobs,
    ) -> Result<Measured, SetError> {
        let samples = self.frame_first.len() - 1;
        let mut measured = Measured { frames: Vec::with_capacity(samples), interactions_s: Vec::new() };
        for sample in 0..samples {
            if jobs.stopped() {
                return Err(SetError::Interrupted);
            }
            measured.frames.push(self.sample(sample, stream, settings)?);
            measured.interactions_s.push([0, 1].map(|end| self.interaction_s[(sample, end)]));
            jobs.done(1);
        }
        Ok(measured)
    }

    fn sample(
        &self,
        sample: usize,
        stream: &align::Settings,
        settings: &Settings,
    ) -> Result<Frames, SetError> {
        let epcs = (0..self.manifest.tags()).map(epc).collect::<Option<_>>();
        let tags = epcs.ok_or_else(|| self.wrong("it has too many tags".to_owned()))?;
        let passage =
            Passage::new(self.manifest.epoch, align::Settings { tags, ..stream.clone() }, settings)?;
        let channels = self.channel_khz.row(sample);
        let reads = span(&self.read_first, sample).map(|place| self.read_at(place));
        let places = span(&self.frame_first, sample);
        let (first, count) = (places.start, places.len());
        let fill = |number, frame: &mut RadarFrame| self.frame_at(first + number, &stream.radar, frame);
        let frames = passage.pass(channels.iter().map(|&khz| Kilohertz(khz)), reads, count, fill);
        if frames.len() == count {
            Ok(frames)
        } else {
            Err(self.wrong(format!("sample {sample} has {count} frames, of which {} came out", frames.len())))
        }
    }

    fn read_at(&self, place: usize) -> TagRead {
        let time = i64::from(self.read_time_us[place]);
        TagRead {
            time: BridgeTime(self.manifest.epoch.0.saturating_add_signed(time)),
            epc: epc(self.read_tag[place].into()).unwrap_or_default(),
            antenna: AntennaPort(self.read_antenna[place].into()),
            channel: ChannelIndex(self.read_channel[place].into()),
            phase: Some(PhaseCode(self.read_phase[place])),
            rssi: CentiDbm(self.read_rssi[place]),
            doppler: Some(DopplerCode(self.read_doppler[place])),
        }
    }

    /// Makes `frame` the frame at `place`, in its own memory.
    fn frame_at(&self, place: usize, radar: &RadarConfig, frame: &mut RadarFrame) {
        let RadarConfig { profile, processing, .. } = radar;
        let put = |map: &mut Option<HeatMap>, codes: ArrayView2<'_, u8>| {
            let (rows, columns) = codes.dim();
            let gate = RangeGate { bins: rows as u16, ..processing.gate };
            put_map(map, gate, columns, self.manifest.maps.scale, codes.iter().copied());
        };
        put(&mut frame.range_doppler, self.range_doppler.index_axis(Axis(0), place));
        put(&mut frame.range_time, self.range_time.index_axis(Axis(0), place));
        let packed = self.covariance.row(place);
        put_moving(frame, profile, self.moving_cells[place], packed.iter().copied());
    }
}

/// The EPC of tag `number`: shards have numbers only.
fn epc(number: usize) -> Option<Epc> {
    Epc::new(&[u8::try_from(number).ok()?])
}

fn span(firsts: &[u32], sample: usize) -> Range<usize> {
    firsts[sample] as usize..firsts[sample + 1] as usize
}
