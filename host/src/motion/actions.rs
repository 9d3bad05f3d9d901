//! Which frames of a motion hold which action: `ACTION_INDEX.tsv`, beside the motion or in a folder above it.
//!
//! Tab-separated, a row for each action, with the columns `file` (its last part is the motion's file name), `action`,
//! `start` and `end` (numbers of frames as in the file, both included); further columns are passed over.

use std::path::{Path, PathBuf};

use super::lines::{Fault, short};
use super::{MotionError, read};

/// Name of the table.
pub const NAME: &str = "ACTION_INDEX.tsv";
/// Folders that are looked into: the motion's own, and the one that it is in.
const FOLDERS: usize = 2;
const COLUMNS: [&str; 4] = ["file", "action", "start", "end"];

/// A stretch of a motion.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Action {
    /// What is done.
    pub name: String,
    /// Number of its first frame.
    pub start: u32,
    /// Number of its last frame.
    pub end: u32,
}

/// The actions of the motion at `path` and the table that they are from; `None` without a table.
///
/// # Errors
/// [`MotionError::Open`], [`MotionError::TooLong`], [`MotionError::Line`] of the table.
pub fn beside(path: &Path) -> Result<Option<(PathBuf, Vec<Action>)>, MotionError> {
    let tables = path.ancestors().skip(1).take(FOLDERS).map(|folder| folder.join(NAME));
    let Some(table) = tables.into_iter().find(|t| t.is_file()) else { return Ok(None) };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    match parse(&read(&table)?, &name) {
        Ok(actions) => Ok(Some((table, actions))),
        Err(fault) => Err(MotionError::Line { path: table, fault }),
    }
}

/// All actions of the table at `path`, in its order, each with the last part of its motion's file name.
///
/// # Errors
/// [`MotionError::Open`], [`MotionError::TooLong`], [`MotionError::Line`] of the table.
pub fn all(path: &Path) -> Result<Vec<(String, Action)>, MotionError> {
    let table = read(path)?;
    let listed = rows(&table).and_then(|rows| {
        let named = rows.filter(|(_, [file, ..])| !last_part(file).is_empty());
        named.map(|(line, cells)| Ok((last_part(cells[0]).to_owned(), action(line, cells)?))).collect()
    });
    listed.map_err(|fault| MotionError::Line { path: path.to_path_buf(), fault })
}

/// The actions of the motion named `name` in a table, in the order of their beginnings.
///
/// # Errors
/// The first line that breaks the format.
pub fn parse(table: &str, name: &str) -> Result<Vec<Action>, Fault> {
    let named = rows(table)?.filter(|(_, [file, ..])| last_part(file) == name);
    let mut actions = named.map(|(line, cells)| action(line, cells)).collect::<Result<Vec<_>, _>>()?;
    actions.sort_by_key(|action| action.start);
    Ok(actions)
}

/// The cells of [`COLUMNS`] of each row, with the row's line.
fn rows(table: &str) -> Result<impl Iterator<Item = (usize, [&str; COLUMNS.len()])>, Fault> {
    let mut lines = table.lines().enumerate().map(|(i, line)| (i + 1, line.split('\t').collect::<Vec<_>>()));
    let header = lines.next().map(|(_, cells)| cells).unwrap_or_default();
    let mut columns = [0; COLUMNS.len()];
    for (column, wanted) in columns.iter_mut().zip(COLUMNS) {
        *column = header
            .iter()
            .position(|cell| cell.trim() == wanted)
            .ok_or_else(|| Fault::new(1, format!("there is no column `{wanted}`")))?;
    }
    Ok(lines.map(move |(line, cells)| {
        (line, columns.map(|column| cells.get(column).copied().unwrap_or_default().trim()))
    }))
}

fn last_part(file: &str) -> &str {
    file.rsplit(['/', '\\']).next().unwrap_or_default()
}

fn action(line: usize, [_, name, start, end]: [&str; COLUMNS.len()]) -> Result<Action, Fault> {
    let frame = |text: &str| {
        text.parse::<u32>()
            .map_err(|_| Fault::new(line, format!("`{}` is no number of a frame", short(text))))
    };
    let (start, end) = (frame(start)?, frame(end)?);
    if end < start {
        return Err(Fault::new(line, format!("the action ends at frame {end}, before it starts at {start}")));
    }
    Ok(Action { name: name.to_owned(), start, end })
}
