//! LLRP messages.

use std::collections::{BTreeMap, BTreeSet};

use rfhoi_firmware::llrp::decode::Incoming;
use rfhoi_firmware::llrp::frame::{FrameError, Framer, HEADER_BYTES};
use rfhoi_firmware::llrp::message::Message;
use rfhoi_firmware::llrp::param::Fields;
use rfhoi_firmware::llrp::report::{TagReport, TagReports};
use rfhoi_shared::tag::Epc;
use serde::Serialize;

use super::{Builder, InspectError, Report};

/// Longest message that is kept whole; longer ones are skipped and counted.
pub(crate) const MAX_MESSAGE: usize = 1 << 20;

/// What messages of one direction hold.
#[derive(Debug, Default, Serialize)]
pub(super) struct Figures {
    messages: u64,
    message_types: BTreeMap<String, u64>,
    tag_reads: u64,
    reads_with_phase: u64,
    tags: usize,
    antennas: usize,
    channels: usize,
    unknown_messages: u64,
    unknown_parameters: u64,
    malformed: u64,
    messages_too_long: u32,
    #[serde(skip)]
    message_bytes: u64,
    #[serde(skip)]
    seen: Seen,
}

#[derive(Debug, Default)]
struct Seen {
    tags: BTreeSet<String>,
    antennas: BTreeSet<u16>,
    channels: BTreeSet<u16>,
}

#[derive(Debug, Serialize)]
struct MessagePart {
    offset: u64,
    message: String,
    id: u32,
    bytes: usize,
    tag_reads: u64,
}

impl Figures {
    fn report(&mut self, report: &TagReport<'_>) {
        self.tag_reads += 1;
        self.reads_with_phase += u64::from(report.phase.is_some());
        self.unknown_parameters += u64::from(report.unknown);
        let epc = Epc::new(report.epc).map_or_else(|| "longer than an EPC".to_owned(), |e| e.to_string());
        self.seen.tags.insert(epc);
        self.seen.antennas.extend(report.antenna.map(|a| a.0));
        self.seen.channels.extend(report.channel.map(|c| c.0));
    }

    fn reports(&mut self, mut reports: TagReports<'_>) {
        for report in reports.by_ref() {
            match report {
                Ok(report) => self.report(&report),
                Err(_) => self.malformed += 1,
            }
        }
        self.unknown_parameters += u64::from(reports.others());
    }

    /// Takes a message. Returns how many tag reads it holds.
    pub(super) fn message(&mut self, message: &Message<'_>) -> u64 {
        let before = self.tag_reads;
        self.messages += 1;
        self.message_bytes += (HEADER_BYTES + message.body.len()) as u64;
        *self.message_types.entry(message.kind.to_string()).or_default() += 1;
        self.unknown_messages += u64::from(message.kind.name().is_none());
        match Incoming::decode(message) {
            Ok(Incoming::Reports(reports)) => self.reports(reports),
            Ok(_) => {}
            Err(_) => self.malformed += 1,
        }
        self.tag_reads - before
    }

    pub(super) fn messages(&self) -> u64 {
        self.messages
    }

    pub(super) fn finish(mut self) -> Self {
        self.tags = self.seen.tags.len();
        self.antennas = self.seen.antennas.len();
        self.channels = self.seen.channels.len();
        self
    }
}

/// A stream of messages that is cut as it comes.
#[derive(Debug)]
pub(super) struct Stream {
    framer: Box<Framer<MAX_MESSAGE>>,
    pub(super) figures: Figures,
}

impl Stream {
    pub(super) fn new() -> Self {
        Self { framer: Box::new(Framer::new()), figures: Figures::default() }
    }

    /// Forgets a message under way, as when bytes are missing.
    pub(super) fn reset(&mut self) {
        self.framer.reset();
    }

    pub(super) fn push(
        &mut self,
        mut bytes: &[u8],
        mut on_message: impl FnMut(&Message<'_>, u64),
    ) -> Result<(), FrameError> {
        while let Some(message) = self.framer.next(&mut bytes)? {
            let reads = self.figures.message(&message);
            on_message(&message, reads);
        }
        self.figures.messages_too_long = self.framer.oversized();
        Ok(())
    }
}

#[derive(Debug, Serialize)]
struct FileFigures {
    bytes: usize,
    headers: bool,
    leftover_bytes: u64,
    #[serde(flatten)]
    llrp: Figures,
}

pub(super) fn inspect(mut builder: Builder<'_>, bytes: &[u8]) -> Result<Report, InspectError> {
    let mut stream = Stream::new();
    let mut offset = 0;
    let framing = stream.push(bytes, |message, tag_reads| {
        let part = MessagePart {
            offset,
            message: message.kind.to_string(),
            id: message.id,
            bytes: HEADER_BYTES + message.body.len(),
            tag_reads,
        };
        offset += part.bytes as u64;
        builder.part(part);
    });
    if let Err(error) = framing {
        builder.note(format!("the messages end before the file does: {error}"));
    }
    let llrp = stream.figures.finish();
    if llrp.messages == 0 {
        return Err(builder.too_little(format!(
            "{} bytes hold no complete LLRP message: is the file cut, or a length field wrong?",
            bytes.len()
        )));
    }
    if llrp.messages_too_long > 0 {
        builder.note(format!(
            "{} messages longer than {MAX_MESSAGE} bytes were skipped",
            llrp.messages_too_long
        ));
    }
    let leftover_bytes = bytes.len() as u64 - llrp.message_bytes;
    if leftover_bytes > 0 {
        builder.note(format!("{leftover_bytes} bytes belong to no complete message"));
    }
    Ok(builder.finish("llrp", FileFigures { bytes: bytes.len(), headers: true, leftover_bytes, llrp }))
}

#[derive(Debug, Serialize)]
struct ParameterPart {
    parameter: String,
    bytes: usize,
}

/// A message without its header: the type is not known, but tag reports say what they are.
pub(super) fn inspect_body(mut builder: Builder<'_>, bytes: &[u8]) -> Result<Report, InspectError> {
    let mut llrp = Figures { messages: 1, ..Figures::default() };
    let mut leftover_bytes = 0;
    for parameter in Fields::new(bytes).parameters() {
        match parameter {
            Ok(p) => builder
                .part(ParameterPart { parameter: format!("{:?}", p.kind), bytes: p.fields.rest().len() }),
            Err(error) => {
                leftover_bytes = (bytes.len() as u64).saturating_sub(error.offset as u64);
                builder.note(format!("the parameters end before the file does: {error}"));
            }
        }
    }
    llrp.reports(TagReports::new(bytes));
    let llrp = llrp.finish();
    builder.note("a body without the 10-byte message header");
    Ok(builder.finish("llrp_body", FileFigures { bytes: bytes.len(), headers: false, leftover_bytes, llrp }))
}
