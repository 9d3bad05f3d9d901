//! The SDK demo's data UART to packets.

use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::{MAX_VIRTUAL, RangeGate};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{
    Covariance, FrameCounts, FrameInfo, LogScale, MAX_MAP_BYTES, MAX_POINTS, MapKind, Message, Points, Stream,
};

use crate::mmwave::tlv::{
    Elements, Frame, HeaderFormat, HeatMap, LevelScale, RangeDoppler, StreamParser, Tlv,
};
use crate::uplink::{MapPacker, Uplink};

/// Scale of maps that the radar computed: its own dB, which compare within a device, from 0 to 127.5.
pub const UART_SCALE: LogScale = LogScale { floor_db: 0.0, step_db: 0.5 };
/// Full scale of the samples in the heat maps of antennas.
const FULL_SCALE: f32 = 32768.0;

/// TLV frames in, packets out. `N` bounds the bytes of a frame.
///
/// The range profile becomes a range-time map of one column, the range-Doppler heat map its map, the heat map of all
/// antennas (AOP boards) the covariance of what does not move, detected points are handed on.
#[derive(Debug)]
pub struct UartPath<const N: usize> {
    parser: StreamParser<N>,
    forward: Forward,
}

#[derive(Debug)]
struct Forward {
    map: MapPacker,
    config: RadarConfig,
    profile: u32,
    radar_celsius: Option<i16>,
    last: Option<u32>,
    lost: u32,
}

impl<const N: usize> UartPath<N> {
    /// A path with a configuration that is valid.
    pub fn new(config: &RadarConfig) -> Self {
        Self {
            parser: StreamParser::new(HeaderFormat::Subframe),
            forward: Forward {
                map: MapPacker::new(MapKind::RangeTime),
                profile: config.profile.fingerprint(),
                config: config.clone(),
                radar_celsius: None,
                last: None,
                lost: 0,
            },
        }
    }

    /// Takes bytes of the UART that arrived at `now` and sends the packets of the frames that they complete.
    pub fn push(
        &mut self,
        now: BridgeTime,
        mut bytes: &[u8],
        uplink: &mut Uplink,
        mut send: impl FnMut(Stream, &[u8]) -> bool,
    ) {
        while let Some(frame) = self.parser.next(&mut bytes) {
            self.forward.frame(now, &frame, uplink, &mut send);
        }
    }

    /// Ends the stream, as when the radar stops.
    pub fn finish(
        &mut self,
        now: BridgeTime,
        uplink: &mut Uplink,
        mut send: impl FnMut(Stream, &[u8]) -> bool,
    ) {
        while let Some(frame) = self.parser.finish() {
            self.forward.frame(now, &frame, uplink, &mut send);
        }
    }

    /// Counts of frames; lost are those whose numbers are missing.
    pub fn frames(&self) -> FrameCounts {
        let counts = self.parser.counts();
        FrameCounts { complete: counts.complete, incomplete: counts.truncated, lost: self.forward.lost }
    }

    /// The radar's hottest sensor, degrees Celsius, where it reports temperatures.
    pub fn radar_celsius(&self) -> Option<i16> {
        self.forward.radar_celsius
    }
}

impl Forward {
    fn frame(
        &mut self,
        now: BridgeTime,
        frame: &Frame<'_>,
        uplink: &mut Uplink,
        send: &mut impl FnMut(Stream, &[u8]) -> bool,
    ) {
        let number = frame.header.number;
        if let Some(last) = self.last.replace(number) {
            self.lost = self.lost.wrapping_add(number.saturating_sub(last).saturating_sub(1));
        }
        let mut emit = |message: Message<'_>| uplink.send(now, message, &mut *send);
        self.points(frame, &mut emit);
        let levels = LevelScale::new(
            frame.header.version,
            self.config.profile.virtual_count() as u16,
            self.config.profile.range_bins(),
        );
        // A TLV of a wrong length is left out: the others are whole.
        for view in frame.views().flatten() {
            match (view, levels) {
                (Tlv::RangeProfile(profile), Some(levels)) => {
                    self.range_profile(number, profile, levels, &mut emit);
                }
                (Tlv::RangeDopplerHeatmap(cells), Some(levels)) => {
                    self.range_doppler(number, cells, levels, &mut emit);
                }
                (Tlv::AzimuthElevationHeatmap(cells), _) => {
                    let map = HeatMap::new(cells, self.config.profile.range_bins());
                    if let Some(covariance) = map.and_then(|m| self.covariance(number, &m)) {
                        emit(Message::Covariance(covariance));
                    }
                }
                (Tlv::Temperatures(temperatures), _) => self.radar_celsius = temperatures.hottest(),
                _ => {}
            }
        }
        // What the radar keeps to itself (its chirps, clipping, moving cells) stays zero.
        emit(Message::Frame(FrameInfo { frame: number, profile: self.profile, ..FrameInfo::default() }));
    }

    fn points(&self, frame: &Frame<'_>, emit: &mut impl FnMut(Message<'_>)) {
        let mut points = heapless::Vec::<_, MAX_POINTS>::new();
        let mut flush = |points: &mut heapless::Vec<_, MAX_POINTS>| {
            if !points.is_empty() {
                let points = core::mem::take(points);
                emit(Message::Points(Points { frame: frame.header.number, points }));
            }
        };
        for (point, side) in frame.points() {
            if points.is_full() {
                flush(&mut points);
            }
            // Never full here.
            let _ = points.push(point.to_wire(side));
        }
        flush(&mut points);
    }

    /// The bins of the configured gate that a row of `bins` has.
    fn gate(&self, bins: usize) -> RangeGate {
        let RangeGate { first, bins: wanted } = self.config.processing.gate;
        RangeGate { first, bins: wanted.min((bins as u16).saturating_sub(first)) }
    }

    fn range_profile(
        &mut self,
        frame: u32,
        profile: Elements<'_, u16>,
        levels: LevelScale,
        emit: &mut impl FnMut(Message<'_>),
    ) {
        let gate = self.gate(profile.len());
        self.map = MapPacker::new(MapKind::RangeTime);
        self.map.begin(frame, gate, 1, UART_SCALE);
        for code in profile.iter().skip(gate.first.into()).take(gate.bins.into()) {
            self.map.row(core::iter::once(map_code(levels, code)), &mut *emit);
        }
        self.map.flush(emit);
    }

    fn range_doppler(
        &mut self,
        frame: u32,
        cells: Elements<'_, u16>,
        levels: LevelScale,
        emit: &mut impl FnMut(Message<'_>),
    ) {
        let bins = self.config.profile.range_bins();
        let Some(map) = RangeDoppler::new(cells, bins) else { return };
        let columns = map.doppler_bins();
        if columns > MAX_MAP_BYTES {
            return;
        }
        let gate = self.gate(bins.into());
        let half = (columns / 2) as i16;
        self.map = MapPacker::new(MapKind::RangeDoppler);
        self.map.begin(frame, gate, columns as u16, UART_SCALE);
        for bin in usize::from(gate.first)..usize::from(gate.first) + usize::from(gate.bins) {
            let row = (-half..columns as i16 - half).map(|d| map_code(levels, map.get(bin, d).unwrap_or(0)));
            self.map.row(row, &mut *emit);
        }
        self.map.flush(emit);
    }

    fn covariance(&self, frame: u32, map: &HeatMap<'_>) -> Option<Covariance> {
        let antennas = map.antennas();
        if antennas != self.config.profile.virtual_count() || antennas > MAX_VIRTUAL {
            return None;
        }
        let gate = self.gate(self.config.profile.range_bins().into());
        let scale = 1.0 / (FULL_SCALE * FULL_SCALE * f32::from(gate.bins.max(1)));
        let mut packed = heapless::Vec::new();
        packed.resize(antennas * antennas, 0.0).ok()?;
        for bin in usize::from(gate.first)..usize::from(gate.first) + usize::from(gate.bins) {
            let row = map.row(bin)?;
            let mut sums = packed.iter_mut();
            let mut add = |term: f32| {
                if let Some(sum) = sums.next() {
                    *sum += term * scale;
                }
            };
            for (i, x) in row.iter().enumerate() {
                let (xr, xi) = (f32::from(x.re), f32::from(x.im));
                add(xr * xr + xi * xi);
                for y in row.iter().skip(i + 1) {
                    let (yr, yi) = (f32::from(y.re), f32::from(y.im));
                    add(xr * yr + xi * yi);
                    add(xi * yr - xr * yi);
                }
            }
        }
        Some(Covariance { frame, antennas: antennas as u8, packed })
    }
}

/// A level of the radar on [`UART_SCALE`].
fn map_code(levels: LevelScale, code: u16) -> u8 {
    ((levels.level(code).0 - UART_SCALE.floor_db) / UART_SCALE.step_db + 0.5) as u8
}
