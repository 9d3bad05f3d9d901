//! The host's end of the wire: packets in, whole frames and tag reads out, with every loss counted.
//!
//! Transport is someone else's: [`Receiver::push`] takes the bytes of one packet, from a UDP datagram or out of a serial
//! frame. Frames that are given back with [`Receiver::recycle`] lend their memory to later ones; then nothing is allocated.

use std::collections::VecDeque;

use rfhoi_shared::radar::{MAX_SAMPLES, RangeGate};
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{
    Ack, Covariance, FrameInfo, Header, Hello, HopTable, LogScale, MAX_MAP_BYTES, MAX_READS, MapKind,
    MapRows, Message, Notice, Packet, Point, Stream, Telemetry, WireError,
};
use serde::Serialize;

/// A heatmap of one frame, as codes; rows that did not arrive are marked.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatMap {
    /// First range bin and rows.
    pub gate: RangeGate,
    /// Columns of a row.
    pub columns: usize,
    /// What the codes mean.
    pub scale: LogScale,
    /// `gate.bins x columns` codes, row by row.
    pub codes: Vec<u8>,
    /// Which rows arrived.
    pub arrived: Vec<bool>,
}

impl HeatMap {
    /// A map of which nothing has arrived, in the memory of `spare`; `None` where it is larger than a bridge sends, so that a
    /// packet of somebody else cannot ask for any amount of memory.
    fn new(rows: &MapRows<'_>, spare: Option<Self>) -> Option<Self> {
        let (bins, columns) = (usize::from(rows.gate.bins), usize::from(rows.columns));
        if bins > MAX_SAMPLES || columns > MAX_MAP_BYTES {
            return None;
        }
        let (mut codes, mut arrived) = spare.map(|s| (s.codes, s.arrived)).unwrap_or_default();
        codes.clear();
        codes.resize(bins * columns, 0);
        arrived.clear();
        arrived.resize(bins, false);
        Some(Self { gate: rows.gate, columns, scale: rows.scale, codes, arrived })
    }

    /// Puts rows in their place. Returns whether they belong to this map.
    fn put(&mut self, rows: &MapRows<'_>) -> bool {
        let columns = self.columns;
        if (self.gate, columns) != (rows.gate, usize::from(rows.columns)) || columns == 0 {
            return false;
        }
        let first = usize::from(rows.first_row);
        let count = rows.codes.len() / columns;
        let Some(place) = self.codes.get_mut(first * columns..(first + count) * columns) else {
            return false;
        };
        place.copy_from_slice(&rows.codes[..count * columns]);
        self.arrived[first..first + count].fill(true);
        true
    }

    /// Level in dB relative to a full-scale tone (maps of raw samples) or as the radar scales it (UART); NaN where the
    /// row did not arrive.
    pub fn level_db(&self, row: usize, column: usize) -> f32 {
        match (self.arrived.get(row), self.codes.get(row * self.columns + column)) {
            (Some(true), Some(&code)) => self.scale.level_db(code),
            _ => f32::NAN,
        }
    }

    /// Rows that did not arrive.
    pub fn rows_missing(&self) -> usize {
        self.arrived.iter().filter(|&&a| !a).count()
    }
}

/// A radar frame as it came over the wire; what did not come is `None` or marked.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RadarFrame {
    /// Number of the frame.
    pub frame: u32,
    /// When it began.
    pub time: BridgeTime,
    /// What the bridge knows of it.
    pub info: Option<FrameInfo>,
    /// Range x Doppler.
    pub range_doppler: Option<HeatMap>,
    /// Range x time within the frame.
    pub range_time: Option<HeatMap>,
    /// Spatial covariance of what moves.
    pub covariance: Option<Covariance>,
    /// Points that the radar detected itself.
    pub points: Vec<Point>,
}

/// What a packet led to.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "frames are few and handed on at once")]
pub enum Received {
    /// A radar frame is as complete as it will be.
    Frame(RadarFrame),
    /// Tag reads.
    Reads(heapless::Vec<TagRead, MAX_READS>),
    /// The reader's channels.
    HopTable(HopTable),
    /// Health of the bridge.
    Telemetry(Telemetry),
    /// Who the bridge is.
    Hello(Hello),
    /// The configuration in force.
    Config(rfhoi_shared::config::BridgeConfig),
    /// Outcome of a command.
    Ack(Ack),
    /// Something that a person should know.
    Notice(Notice),
    /// The bridge has started anew; counts of its streams begin again.
    Restarted,
}

/// What was received and lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct LinkCounts {
    /// Packets taken.
    pub packets: u64,
    /// Bytes of these packets.
    pub bytes: u64,
    /// Packets that never came, by their numbers.
    pub packets_lost: u64,
    /// Packets that came late or twice; they are not used.
    pub packets_late: u64,
    /// Packets that do not decode.
    pub packets_malformed: u64,
    /// Frames handed on.
    pub frames: u64,
    /// Frames handed on with rows, a map, the covariance or the last packet missing.
    pub frames_with_holes: u64,
    /// Restarts of the bridge.
    pub restarts: u64,
}

/// Memory of frames that were given back.
#[derive(Debug, Default)]
struct Spare {
    maps: Vec<HeatMap>,
    points: Vec<Vec<Point>>,
}

impl Spare {
    /// Frames of which memory is kept, at most.
    const FRAMES: usize = 4;

    fn keep(&mut self, frame: RadarFrame) {
        let maps = [frame.range_doppler, frame.range_time].into_iter().flatten();
        self.maps.extend(maps.take((2 * Self::FRAMES).saturating_sub(self.maps.len())));
        let mut points = frame.points;
        if points.capacity() > 0 && self.points.len() < Self::FRAMES {
            points.clear();
            self.points.push(points);
        }
    }

    /// A map whose memory is large enough for `cells`, or else any.
    fn map(&mut self, cells: usize) -> Option<HeatMap> {
        let place = self.maps.iter().position(|m| m.codes.capacity() >= cells);
        place.map(|place| self.maps.swap_remove(place)).or_else(|| self.maps.pop())
    }
}

/// Takes packets of one bridge.
#[derive(Debug, Default)]
pub struct Receiver {
    boot: Option<u16>,
    next: [Option<u32>; Stream::ALL.len()],
    frame: Option<RadarFrame>,
    spare: Spare,
    ready: VecDeque<Received>,
    counts: LinkCounts,
    time: BridgeTime,
}

impl Receiver {
    /// A receiver that has seen nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// What was received and lost so far.
    pub fn counts(&self) -> LinkCounts {
        self.counts
    }

    /// Time of the last packet taken.
    pub fn time(&self) -> BridgeTime {
        self.time
    }

    /// Takes one packet. What it led to is fetched with [`Self::next`].
    ///
    /// # Errors
    /// If it is no packet, or of another version of the wire.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), WireError> {
        let Packet { header, message } = Packet::decode(bytes).inspect_err(|_| {
            self.counts.packets_malformed += 1;
        })?;
        if self.in_order(&header) {
            self.counts.packets += 1;
            self.counts.bytes += bytes.len() as u64;
            self.time = header.time;
            self.take(header, message);
        } else {
            self.counts.packets_late += 1;
        }
        Ok(())
    }

    /// The next thing that packets led to.
    #[allow(clippy::should_implement_trait, reason = "more may follow after None")]
    pub fn next(&mut self) -> Option<Received> {
        self.ready.pop_front()
    }

    /// Takes back a frame that is no longer needed, for its memory.
    pub fn recycle(&mut self, frame: RadarFrame) {
        self.spare.keep(frame);
    }

    /// Hands on the frame under way, as at the end of a recording.
    pub fn finish(&mut self) {
        if let Some(frame) = self.frame.take() {
            self.hand_on(frame);
        }
    }

    fn in_order(&mut self, header: &Header) -> bool {
        if self.boot.replace(header.boot).is_some_and(|boot| boot != header.boot) {
            self.counts.restarts += 1;
            self.finish();
            self.next = Default::default();
            self.ready.push_back(Received::Restarted);
        }
        let next = &mut self.next[header.stream as usize];
        let ahead = header.sequence.wrapping_sub(next.unwrap_or(header.sequence));
        // Half of the numbers are ahead, the others behind.
        if ahead > u32::MAX / 2 {
            return false;
        }
        self.counts.packets_lost += u64::from(ahead);
        *next = Some(header.sequence.wrapping_add(1));
        true
    }

    fn take(&mut self, header: Header, message: Message<'_>) {
        match message {
            Message::Frame(info) => {
                let frame = self.frame_of(info.frame, header.time);
                frame.info = Some(info);
                // The bridge sends it last.
                self.finish();
            }
            Message::MapRows(rows) => {
                self.frame_of(rows.frame, header.time);
                let Self { frame: Some(frame), spare, .. } = self else { return };
                let map = match rows.map {
                    MapKind::RangeDoppler => &mut frame.range_doppler,
                    MapKind::RangeTime => &mut frame.range_time,
                };
                let cells = usize::from(rows.gate.bins) * usize::from(rows.columns);
                *map = map.take().or_else(|| HeatMap::new(&rows, spare.map(cells)));
                if !map.as_mut().is_some_and(|map| map.put(&rows)) {
                    self.counts.packets_malformed += 1;
                }
            }
            Message::Covariance(covariance) => {
                let frame = self.frame_of(covariance.frame, header.time);
                frame.covariance = Some(covariance);
            }
            Message::Points(points) => {
                self.frame_of(points.frame, header.time).points.extend(points.points);
            }
            Message::Tags(reads) => self.ready.push_back(Received::Reads(reads)),
            Message::HopTable(table) => self.ready.push_back(Received::HopTable(table)),
            Message::Telemetry(telemetry) => self.ready.push_back(Received::Telemetry(telemetry)),
            Message::Hello(hello) => self.ready.push_back(Received::Hello(hello)),
            Message::Config(config) => self.ready.push_back(Received::Config(config)),
            Message::Ack(ack) => self.ready.push_back(Received::Ack(ack)),
            Message::Notice(notice) => self.ready.push_back(Received::Notice(notice)),
            // Only hosts send these.
            Message::Command(_) => self.counts.packets_malformed += 1,
        }
    }

    /// The frame under way, after handing on an older one.
    fn frame_of(&mut self, number: u32, time: BridgeTime) -> &mut RadarFrame {
        if let Some(old) = self.frame.take_if(|f| f.frame != number) {
            self.hand_on(old);
        }
        let points = &mut self.spare.points;
        self.frame.get_or_insert_with(|| RadarFrame {
            frame: number,
            time,
            points: points.pop().unwrap_or_default(),
            ..RadarFrame::default()
        })
    }

    fn hand_on(&mut self, frame: RadarFrame) {
        self.counts.frames += 1;
        let maps = [&frame.range_doppler, &frame.range_time];
        let rows_missing = maps.iter().any(|m| m.as_ref().is_some_and(|m| m.rows_missing() > 0));
        // A frame of raw samples has both maps and a covariance; what the radar's UART sends is its own affair.
        let raw = frame.info.is_some_and(|i| i.chirps > 0);
        let part_missing = raw && (maps.contains(&&None) || frame.covariance.is_none());
        let holes = rows_missing || part_missing || frame.info.is_none();
        self.counts.frames_with_holes += u64::from(holes);
        self.ready.push_back(Received::Frame(frame));
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::wire::{MAX_PACKET, Sequencer};

    use super::*;

    fn rows(frame: u32, first_row: u16, codes: &[u8]) -> Message<'_> {
        Message::MapRows(MapRows {
            map: MapKind::RangeDoppler,
            frame,
            gate: RangeGate { first: 0, bins: 4 },
            first_row,
            columns: 2,
            scale: LogScale { floor_db: -100.0, step_db: 0.5 },
            codes,
        })
    }

    fn info(frame: u32) -> Message<'static> {
        Message::Frame(FrameInfo { frame, ..FrameInfo::default() })
    }

    fn push(receiver: &mut Receiver, packet: &Packet<'_>) {
        receiver.push(packet.encode(&mut [0; MAX_PACKET]).unwrap()).unwrap();
    }

    fn frames(receiver: &mut Receiver) -> Vec<RadarFrame> {
        std::iter::from_fn(|| receiver.next())
            .filter_map(|r| if let Received::Frame(f) = r { Some(f) } else { None })
            .collect()
    }

    #[test]
    fn a_lost_packet_costs_its_rows() {
        let (mut sequencer, mut receiver) = (Sequencer::new(1), Receiver::new());
        let mut send = |message, arrives| {
            let packet = sequencer.wrap(BridgeTime(9), message);
            if arrives {
                push(&mut receiver, &packet);
            }
        };
        send(rows(5, 0, &[1, 2, 3, 4]), true);
        send(rows(5, 2, &[5, 6]), false);
        send(rows(5, 3, &[7, 8]), true);
        send(info(5), true);
        let frames = frames(&mut receiver);
        let map = frames[0].range_doppler.as_ref().unwrap();
        assert_eq!(map.arrived, [true, true, false, true]);
        assert_eq!(map.codes, [1, 2, 3, 4, 0, 0, 7, 8]);
        assert_eq!(map.level_db(3, 1), -96.0);
        assert!(map.level_db(2, 0).is_nan());
        let counts = receiver.counts();
        assert_eq!((counts.packets, counts.packets_lost, counts.frames_with_holes), (3, 1, 1));
    }

    #[test]
    fn a_frame_whose_last_packet_is_lost_comes_with_the_next() {
        let (mut sequencer, mut receiver) = (Sequencer::new(1), Receiver::new());
        push(&mut receiver, &sequencer.wrap(BridgeTime(1), rows(1, 0, &[1; 8])));
        sequencer.wrap(BridgeTime(1), info(1));
        push(&mut receiver, &sequencer.wrap(BridgeTime(2), rows(2, 0, &[2; 8])));
        let frames = frames(&mut receiver);
        assert_eq!((frames.len(), frames[0].frame, frames[0].info), (1, 1, None));
    }

    #[test]
    fn a_frame_of_raw_samples_without_a_map_or_covariance_has_a_hole() {
        let (mut sequencer, mut receiver) = (Sequencer::new(1), Receiver::new());
        let raw = |frame| Message::Frame(FrameInfo { frame, chirps: 192, ..FrameInfo::default() });
        for message in [rows(1, 0, &[1; 8]), raw(1), rows(2, 0, &[1; 8]), info(2)] {
            push(&mut receiver, &sequencer.wrap(BridgeTime(1), message));
        }
        assert_eq!(receiver.counts().frames_with_holes, 1, "the second frame is of a UART");
    }

    #[test]
    fn a_frame_that_is_given_back_lends_its_memory_and_nothing_else() {
        let (mut sequencer, mut receiver) = (Sequencer::new(1), Receiver::new());
        let mut frame = |frame_number: u32, codes: &[u8]| {
            push(&mut receiver, &sequencer.wrap(BridgeTime(1), rows(frame_number, 0, codes)));
            push(&mut receiver, &sequencer.wrap(BridgeTime(1), info(frame_number)));
            let frame = frames(&mut receiver).remove(0);
            let map = frame.range_doppler.clone().unwrap();
            let memory = frame.range_doppler.as_ref().unwrap().codes.as_ptr();
            receiver.recycle(frame);
            (map, memory)
        };
        let (_, first) = frame(1, &[9; 8]);
        let (map, second) = frame(2, &[1, 2]);
        assert_eq!((map.codes.as_slice(), map.rows_missing()), (&[1, 2, 0, 0, 0, 0, 0, 0][..], 3));
        assert_eq!(first, second);
    }

    #[test]
    fn restarts_are_not_losses_and_late_packets_not_used() {
        let (mut old, mut new, mut receiver) = (Sequencer::new(1), Sequencer::new(2), Receiver::new());
        for _ in 0..1000 {
            push(&mut receiver, &old.wrap(BridgeTime(1), info(1)));
        }
        let early = new.wrap(BridgeTime(1), info(0));
        push(&mut receiver, &early);
        push(&mut receiver, &new.wrap(BridgeTime(1), info(1)));
        push(&mut receiver, &early);
        let counts = receiver.counts();
        assert_eq!((counts.restarts, counts.packets_lost, counts.packets_late), (1, 0, 1));
        assert_eq!(frames(&mut receiver).len(), 1002);
    }

    #[test]
    fn rows_that_do_not_fit_their_map_are_refused() {
        let (mut sequencer, mut receiver) = (Sequencer::new(1), Receiver::new());
        push(&mut receiver, &sequencer.wrap(BridgeTime(1), rows(1, 3, &[1; 8])));
        push(&mut receiver, &sequencer.wrap(BridgeTime(1), rows(1, u16::MAX, &[1; 2])));
        assert_eq!(receiver.counts().packets_malformed, 2);
        let Message::MapRows(huge) = rows(2, 0, &[1; 2]) else { unreachable!("it is one") };
        let gate = RangeGate { first: 0, bins: u16::MAX };
        let huge = MapRows { columns: u16::MAX, gate, ..huge };
        push(&mut receiver, &sequencer.wrap(BridgeTime(1), Message::MapRows(huge)));
        assert_eq!(receiver.counts().packets_malformed, 3);
        assert!(matches!(receiver.push(b"x"), Err(WireError::NotRfHoi)));
    }
}
