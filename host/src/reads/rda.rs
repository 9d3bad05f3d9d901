//! Samples of the RDA data set (cwnuiot/sphar2): labelled reads of tags that people wear.
//!
//! No header; one read a line, fields between spaces or commas: person, tag (hexadecimal digits), reader's time
//! (microseconds since 1970), Doppler (Hz), RSSI (dBm), phase (radians, a multiple of 2 pi / 4096), activity. One
//! antenna; the channel was not recorded and is 0. Person and activity are the same in all lines of a sample.

use std::path::Path;

use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{AntennaPort, BridgeTime, ChannelIndex, DopplerCode, PhaseCode};

use super::{Annotation, ReadsError, RowError, dbm, epc, field_error};

const FIELDS: usize = 7;

fn fields(line: &str) -> Option<[&str; FIELDS]> {
    let separators = |c: char| c == ',' || c.is_whitespace();
    let fields: Vec<_> = line.split(separators).filter(|field| !field.is_empty()).collect();
    fields.try_into().ok()
}

/// Whether a line looks like a read.
pub(super) fn is_row(line: &str) -> bool {
    fields(line).is_some_and(|fields| fields.iter().all(|f| f.parse::<f64>().is_ok() || epc("", f).is_ok()))
}

/// All reads, their times still the reader's, and what they are labelled with.
pub(super) fn reads(path: &Path, contents: &str) -> Result<(Vec<TagRead>, Annotation), ReadsError> {
    let mut reads = Vec::new();
    let mut label = None;
    for (number, line) in (1..).zip(contents.lines()) {
        if line.trim().is_empty() {
            continue;
        }
        let error = |reason| ReadsError::Row { path: path.to_path_buf(), line: number, reason };
        let (read, annotation) = row(line).map_err(|e| match e {
            RowError::Field(reason) => error(reason),
            RowError::MissingColumn(column) => error(format!("no {column}")),
        })?;
        if *label.get_or_insert(annotation) != annotation {
            return Err(error("person or activity differs from the lines before: split the file".to_owned()));
        }
        reads.push(read);
    }
    label.map(|label| (reads, label)).ok_or_else(|| ReadsError::Empty { path: path.to_path_buf() })
}

fn row(line: &str) -> Result<(TagRead, Annotation), RowError> {
    let [person, tag, time, doppler, rssi, phase, activity] = fields(line).ok_or_else(|| {
        RowError::Field("expected person, tag, time, Doppler, RSSI, phase and activity".to_owned())
    })?;
    let whole = |name: &str, text: &str| text.parse().map_err(|_| field_error(name, text, "a whole number"));
    let radians = match phase.parse::<f32>() {
        Ok(radians) if (0.0..=std::f32::consts::TAU).contains(&radians) => radians,
        _ => return Err(field_error("phase", phase, "radians, 0 to 2 pi")),
    };
    let sixteenths = doppler.parse::<f32>().map(|hz| (hz * 16.0).round()).unwrap_or(f32::NAN);
    if !(f32::from(i16::MIN)..=f32::from(i16::MAX)).contains(&sixteenths) {
        return Err(field_error("Doppler", doppler, "hertz, -2048 to 2048"));
    }
    let read = TagRead {
        time: BridgeTime(time.parse().map_err(|_| field_error("time", time, "microseconds since 1970"))?),
        epc: epc("tag", tag)?,
        antenna: AntennaPort(1),
        channel: ChannelIndex(0),
        phase: Some(PhaseCode::from_radians(radians)),
        rssi: dbm("RSSI", rssi)?,
        doppler: Some(DopplerCode(sixteenths as i16)),
    };
    Ok((read, Annotation { person: whole("person", person)?, activity: whole("activity", activity)? }))
}
