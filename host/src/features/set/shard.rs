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
use rfhoi_shared::wire::{Covariance, FrameInfo, HopTable};

use super::manifest::{Manifest, Maps};
use super::{Measured, SetError};
use crate::align::{self, FrameStream};
use crate::features::{FrameFeatures, Settings};
use crate::jobs::Jobs;
use crate::receive::{HeatMap, RadarFrame};

/// From a read to the packet that carries it, us.
const REPORTED_US: u64 = 4_000;

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
        let radar = &stream.radar;
        let mut run = Run {
            epoch: self.manifest.epoch,
            features: settings.frame_features(radar),
            frames: Frames::new(settings.points, self.manifest.tags(), settings.antennas),
            stream: FrameStream::new(align::Settings { tags, ..stream.clone() })?,
        };
        let channels = self.channel_khz.row(sample).iter().map(|&khz| Kilohertz(khz)).collect();
        run.stream.push_hop_table(&HopTable { table: 1, channels });
        let mut reads = span(&self.read_first, sample).map(|place| self.read_at(place)).peekable();
        let mut frame = RadarFrame::default();
        let places = span(&self.frame_first, sample);
        let count = places.len();
        let period_us = u64::from(radar.profile.frame_period_us);
        for (number, place) in places.enumerate() {
            let begin = self.manifest.epoch.after(number as u64 * period_us);
            while let Some(read) = reads.next_if(|read| read.time.after(REPORTED_US) <= begin) {
                run.read(read);
            }
            self.frame_at(place, &stream.radar, &mut frame);
            (frame.frame, frame.time) = (number as u32, begin);
            run.stream.push_frame(&frame);
        }
        reads.for_each(|read| run.read(read));
        run.stream.finish();
        run.collect();
        if run.frames.len() == count {
            Ok(run.frames)
        } else {
            Err(self
                .wrong(format!("sample {sample} has {count} frames, of which {} came out", run.frames.len())))
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
            let map = map.get_or_insert_with(|| HeatMap {
                gate: RangeGate { bins: rows as u16, ..processing.gate },
                columns,
                scale: self.manifest.maps.scale,
                codes: Vec::new(),
                arrived: vec![true; rows],
            });
            map.codes.clear();
            map.codes.extend(codes);
        };
        put(&mut frame.range_doppler, self.range_doppler.index_axis(Axis(0), place));
        put(&mut frame.range_time, self.range_time.index_axis(Axis(0), place));
        let packed = self.covariance.row(place).iter().copied().collect();
        frame.covariance = Some(Covariance { frame: 0, antennas: profile.virtual_count() as u8, packed });
        frame.info = Some(FrameInfo {
            profile: profile.fingerprint(),
            chirps: profile.chirps_per_frame(),
            moving_cells: self.moving_cells[place],
            ..FrameInfo::default()
        });
    }
}

/// A sample on its way through the stream.
struct Run {
    epoch: BridgeTime,
    stream: FrameStream,
    features: FrameFeatures,
    frames: Frames,
}

impl Run {
    fn read(&mut self, read: TagRead) {
        let sent = read.time.after(REPORTED_US);
        self.stream.push_reads(&[read], sent);
        self.stream.advance(sent);
        self.collect();
    }

    /// Takes the frames that are complete. Those of the lead-in only tell how strong the tags usually are.
    fn collect(&mut self) {
        while let Some(frame) = self.stream.next() {
            if frame.begin >= self.epoch {
                self.frames.push(self.features.frame(&frame));
            } else {
                self.features.watch(&frame);
            }
            self.stream.recycle(frame);
        }
    }
}

/// The EPC of tag `number`: shards have numbers only.
fn epc(number: usize) -> Option<Epc> {
    Epc::new(&[u8::try_from(number).ok()?])
}

fn span(firsts: &[u32], sample: usize) -> Range<usize> {
    firsts[sample] as usize..firsts[sample + 1] as usize
}
