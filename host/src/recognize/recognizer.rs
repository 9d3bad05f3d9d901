//! The recognizer.

use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::ops::Range;

use rfhoi_int8::Kernels;
use rfhoi_network::metrics::tuple_probability;
use rfhoi_network::model::{Description, Model};
use rfhoi_network::names::Names;
use rfhoi_network::sample::{Answer, InputError, Runner};
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::tag::Epc;
use rfhoi_shared::units::BridgeTime;

use super::RecognizeError;
use super::model::{runner, settings};
use super::outcome::{Guess, Outcome, Recognition, Why};
use super::radar::Maps;
use super::segment::{BEGIN_CELLS, Ended, STAY_CELLS, Segment, Segmenter};
use super::tags::TagNames;
use super::window::Window;
use crate::align::{self, AlignedFrame, FrameStream, StreamCounts};
use crate::features::FrameFeatures;
use crate::receive::{Received, Receiver};

/// A tag that was not read for so long is taken for gone, s: a reader comes round to each in far less, and people come back to
/// things within it.
const GONE_S: f64 = 60.0;
/// Share of a segment's frames without a read, without the radar, or with a range-Doppler map that cannot be trusted, above
/// which nothing is told. In simulated samples of the training set no more than 0.46 of the frames have an empty map, those in
/// which the person rests; a read is in all but 0.002.
const MOST_UNREAD: f32 = 0.5;
const MOST_MISSING: f32 = 0.25;
const MOST_INVALID: f32 = 0.5;
/// Turn of a tag's phase in a frame that a hand makes, radians: 0.1 s at 0.3 m/s, and five times the noise of a tag at rest.
const TURN: f32 = 1.0;

/// What a recognizer is made of.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The radar's profile; `None` where it is one that has a name, which the model then tells.
    pub profile: Option<RadarProfile>,
    /// Which tag is on which thing.
    pub tags: TagNames,
    /// A tuple less probable than this is not told; `None` for what the model says.
    pub least: Option<f32>,
    /// Threads that share an answer.
    pub threads: NonZeroUsize,
}

/// Takes packets of one bridge, tells what was done.
pub struct Recognizer {
    runner: Box<dyn Runner>,
    description: Description,
    maps: Maps,
    radar: RadarConfig,
    tag_names: TagNames,
    names: Vec<(Epc, Vec<f32>)>,
    mean_name: Vec<f32>,
    remarks: Vec<String>,
    least: f32,
    antennas: usize,
    receiver: Receiver,
    stream: FrameStream,
    features: FrameFeatures,
    pub(super) segmenter: Segmenter,
    pub(super) window: Window,
    /// Number of the frame that is the runner's first.
    base: usize,
    /// When each tag of the stream was last read, s.
    last_read_s: Vec<Option<f64>>,
    /// The stream's tags that the network is asked about, and the vectors of their names.
    present: Vec<usize>,
    vectors: Vec<f32>,
    reads: Vec<f32>,
    clock: Clock,
    ready: VecDeque<Recognition>,
}

/// From the bridge's clock, which begins anew with each of its starts, to time since the first packet.
#[derive(Debug, Clone, Copy, Default)]
struct Clock {
    /// The bridge's time of the first packet since its start, and what that is since the very first.
    origin: Option<(BridgeTime, f64)>,
    /// End of the last frame.
    last_s: f64,
}

impl Clock {
    fn seconds(&self, time: BridgeTime) -> f64 {
        self.origin.map_or(0.0, |(origin, s)| s + (time.0 as f64 - origin.0 as f64) * 1e-6)
    }
}

impl Recognizer {
    /// A recognizer that has seen nothing yet.
    ///
    /// # Errors
    /// If the model cannot run here, or is for another radar or other names.
    pub fn new(model: &Model, names: &Names, settings: Settings) -> Result<Self, RecognizeError> {
        let runner = runner(model, Kernels::best().with_threads(settings.threads.get()))?;
        Self::with_runner(runner, &model.description, names, settings)
    }

    /// The same with a runner of a model that is described so.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_runner(
        runner: Box<dyn Runner>,
        description: &Description,
        names: &Names,
        given: Settings,
    ) -> Result<Self, RecognizeError> {
        if description.names != names.fingerprint() {
            let (trained, here) = (description.names, names.fingerprint());
            return Err(RecognizeError::OtherNames { trained, here });
        }
        let maps = Maps::of(description)?;
        let radar = maps.config(given.profile.as_ref())?;
        let settings = settings(description)?;
        let stream = settings.stream(&radar).map_err(align::AlignError::from)?;
        let stream = FrameStream::new(align::Settings { tags: given.tags.list(), ..stream })?;
        let frame_s = f64::from(radar.profile.frame_period_us) * 1e-6;
        let segmenter = Segmenter::new(frame_s);
        let lookups = given.tags.iter().map(|(epc, name)| (epc, name, names.lookup(name)));
        let mut vectors = Vec::new();
        let mut remarks = Vec::new();
        for (epc, name, lookup) in lookups {
            remarks.extend(lookup.remark(name));
            vectors.push((epc.clone(), names.vector_of(&lookup).to_vec()));
        }
        remarks.dedup();
        Ok(Self {
            runner,
            maps,
            tag_names: given.tags,
            names: vectors,
            mean_name: names.mean().to_vec(),
            remarks,
            least: given.least.unwrap_or(description.least_probability),
            antennas: settings.antennas,
            receiver: Receiver::new(),
            stream,
            features: settings.frame_features(&radar),
            window: Window::new(segmenter.reach()),
            segmenter,
            base: 0,
            last_read_s: Vec::new(),
            present: Vec::new(),
            vectors: Vec::new(),
            reads: Vec::new(),
            clock: Clock::default(),
            ready: VecDeque::new(),
            description: description.clone(),
            radar,
        })
    }

    /// What the radar must be configured for.
    pub fn radar(&self) -> &RadarConfig {
        &self.radar
    }

    /// What people should know of the names that they gave.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Tuples less probable than this are not told.
    pub fn least(&self) -> f32 {
        self.least
    }

    /// What was received and lost.
    pub fn counts(&self) -> StreamCounts {
        StreamCounts { link: self.receiver.counts(), ..self.stream.counts() }
    }

    /// Tags that were read, and what they are on as far as somebody has said so.
    pub fn tags(&self) -> impl Iterator<Item = (&Epc, Option<&str>)> {
        let read = self.stream.epcs().zip(&self.last_read_s).filter(|(_, last_s)| last_s.is_some());
        read.map(|(epc, _)| (epc, self.tag_names.get(epc)))
    }

    /// Takes one packet of the bridge; one that is none, or comes late, is counted.
    ///
    /// # Errors
    /// If the radar is configured for something else.
    pub fn push(&mut self, packet: &[u8]) -> Result<(), RecognizeError> {
        // What is wrong is counted.
        let _ = self.receiver.push(packet);
        self.collect()
    }

    /// Ends the stream: what is under way is told.
    ///
    /// # Errors
    /// As [`Self::push`].
    pub fn finish(&mut self) -> Result<(), RecognizeError> {
        self.receiver.finish();
        self.collect()?;
        self.stream.finish();
        self.frames()?;
        let segment = self.segmenter.interrupt();
        self.tell(segment)
    }

    /// The next thing that is told.
    #[allow(clippy::should_implement_trait, reason = "more may follow after None")]
    pub fn next(&mut self) -> Option<Recognition> {
        self.ready.pop_front()
    }

    fn collect(&mut self) -> Result<(), RecognizeError> {
        let now = self.receiver.time();
        while let Some(received) = self.receiver.next() {
            self.take(&received, now)?;
            if let Received::Frame(frame) = received {
                self.receiver.recycle(frame);
            }
        }
        Ok(())
    }

    /// Takes what a packet of the bridge's time `sent` has led to, for those who have a [`Receiver`] of their own.
    ///
    /// # Errors
    /// As [`Self::push`].
    pub fn take(&mut self, received: &Received, sent: BridgeTime) -> Result<(), RecognizeError> {
        if matches!(received, Received::Restarted) {
            // The stream hands on what it has, by the old clock.
            self.stream.take(received, sent);
            self.frames()?;
            let segment = self.segmenter.interrupt();
            self.tell(segment)?;
            self.clock.origin = None;
            return Ok(());
        }
        if let Received::Frame(frame) = received {
            self.maps.check(frame)?;
        }
        self.clock.origin.get_or_insert((sent, self.clock.last_s));
        self.stream.take(received, sent);
        self.frames()
    }

    fn frames(&mut self) -> Result<(), RecognizeError> {
        while let Some(aligned) = self.stream.next() {
            let told = self.frame(&aligned);
            self.stream.recycle(aligned);
            told?;
        }
        Ok(())
    }

    fn frame(&mut self, aligned: &AlignedFrame) -> Result<(), RecognizeError> {
        let span_s = [aligned.begin, aligned.end].map(|time| self.clock.seconds(time));
        // Frames that do not follow each other are of two times.
        let half_s = (span_s[1] - span_s[0]) / 2.0;
        if (span_s[0] - self.clock.last_s).abs() > half_s {
            let segment = self.segmenter.interrupt();
            self.tell(segment)?;
        }
        self.clock.last_s = span_s[1];
        let frame = self.features.frame(aligned);
        self.window.push(|kept| kept.set(frame, aligned, span_s));
        if self.tags_changed(span_s[1]) {
            self.begin_anew()?;
        } else {
            let last = self.window.numbers().end - 1;
            self.hand_on(last..last + 1)?;
        }
        let segment = self.segmenter.push(activity(aligned, self.antennas));
        self.tell(segment)
    }

    /// Hands frames to the network.
    fn hand_on(&mut self, numbers: Range<usize>) -> Result<(), InputError> {
        for kept in self.window.range(numbers) {
            self.runner.push(kept.frame(&self.present, self.antennas, &mut self.reads))?;
        }
        Ok(())
    }

    /// Lets the network begin anew, with the tags that are present, at the first frame that may still matter.
    fn begin_anew(&mut self) -> Result<(), InputError> {
        self.runner.clear();
        self.base = self.window.numbers().start;
        self.vectors.clear();
        let epcs: Vec<&Epc> = self.stream.epcs().collect();
        for &tag in &self.present {
            let known = self.names.iter().find(|(epc, _)| epc == epcs[tag]);
            self.vectors.extend_from_slice(known.map_or(&self.mean_name, |(_, vector)| vector));
        }
        self.hand_on(self.window.numbers())
    }

    /// Looks which tags are read at `now_s`, and whether others are present than before. The network takes all tags at once, so
    /// each that appears or leaves costs the work of the window again.
    fn tags_changed(&mut self, now_s: f64) -> bool {
        let last = self.window.numbers().end - 1;
        self.last_read_s.resize(self.stream.epcs().len(), None);
        for kept in self.window.range(last..last + 1) {
            for (tag, last_s) in self.last_read_s.iter_mut().enumerate() {
                if kept.is_read(tag, self.antennas) {
                    *last_s = Some(now_s);
                }
            }
        }
        let is_present = |last_s: &Option<f64>| last_s.is_some_and(|last_s| now_s - last_s < GONE_S);
        let present =
            || self.last_read_s.iter().enumerate().filter(|(_, s)| is_present(s)).map(|(tag, _)| tag);
        let changed = !present().eq(self.present.iter().copied());
        if changed {
            self.present = present().collect();
        }
        changed
    }

    fn tell(&mut self, segment: Option<Segment>) -> Result<(), RecognizeError> {
        let Some(Segment { frames, moved, ended }) = segment else { return Ok(()) };
        let spans: Vec<[f64; 2]> = self.window.range(frames.clone()).map(|kept| kept.span_s).collect();
        let (Some([begin_s, _]), Some([_, end_s])) = (spans.first(), spans.last()) else { return Ok(()) };
        let outcome = if ended == Ended::Stream && moved < self.segmenter.shortest() {
            let frame_s = f64::from(self.radar.profile.frame_period_us) * 1e-6;
            Outcome::CannotTell {
                why: Why::TooShort { moved_s: (moved as f64 * frame_s) as f32 },
                guess: None,
            }
        } else {
            self.outcome(frames)?
        };
        self.ready.push_back(Recognition { begin_s: *begin_s, end_s: *end_s, outcome });
        Ok(())
    }

    fn outcome(&mut self, frames: Range<usize>) -> Result<Outcome, RecognizeError> {
        if let Some(why) = self.nothing_measured(frames.clone()) {
            return Ok(Outcome::CannotTell { why, guess: None });
        }
        let answer = self.runner.answer(frames.start - self.base..frames.end - self.base, &self.vectors)?;
        if answer.actions.len() != self.description.actions.len() + 1 {
            let (says, lists) = (answer.actions.len(), self.description.actions.len());
            return Err(RecognizeError::Description(format!(
                "network tells {says} actions, it lists {lists} and none"
            )));
        }
        let Some((action, target, p)) = tuple_probability(&answer) else {
            let p = answer.actions.last().copied().unwrap_or(0.0);
            return Ok(Outcome::Nothing { p });
        };
        let guess = self.guess(&answer, action, target, p);
        let tag = self.present[target];
        let why = if !self.window.range(frames).any(|kept| kept.is_read(tag, self.antennas)) {
            Why::TargetUnread
        } else if p >= self.least {
            return Ok(Outcome::Tuple(guess));
        } else {
            Why::LowProbability { p, least: self.least }
        };
        Ok(Outcome::CannotTell { why, guess: Some(guess) })
    }

    fn guess(&self, answer: &Answer, action: usize, target: usize, p: f32) -> Guess {
        let epc = self.stream.epcs().nth(self.present[target]).cloned().unwrap_or_default();
        Guess {
            action: self.description.actions[action].clone(),
            object: self.tag_names.get(&epc).map(str::to_owned),
            epc,
            p_action: answer.actions[action],
            p_target: answer.targets[target],
            p,
        }
    }

    /// Why the network need not be asked.
    fn nothing_measured(&self, frames: Range<usize>) -> Option<Why> {
        let measured = self.window.measured(frames, &self.present, self.antennas);
        let fusion = self.description.config.fusion;
        if self.present.is_empty() {
            Some(Why::NoTags)
        } else if measured.unread > MOST_UNREAD {
            Some(Why::ReaderSilent { share: measured.unread })
        } else if fusion.has_radar() && measured.missing > MOST_MISSING {
            Some(Why::RadarMissing { share: measured.missing })
        } else if fusion.has_radar() && measured.invalid > MOST_INVALID {
            Some(Why::MapsInvalid { reason: measured.reason, share: measured.invalid })
        } else {
            None
        }
    }
}

/// Moving cells of a frame; where the radar did not send it, what stands for them in the tags' turns.
fn activity(aligned: &AlignedFrame, antennas: usize) -> u32 {
    if let (true, Some(cells)) = (aligned.sent, aligned.moving_cells) {
        return cells;
    }
    let tags = aligned.phases().tags();
    let turns =
        (0..tags).flat_map(|tag| (0..antennas).map(move |antenna| aligned.sighting(tag, antenna).turn));
    // One alone may be half a turn off.
    match turns.flatten().filter(|turn| turn.abs() > TURN).count() {
        0 => 0,
        1 => STAY_CELLS,
        _ => BEGIN_CELLS,
    }
}
