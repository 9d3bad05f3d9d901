//! A scene file as sections, keys and values with their lines; what is not as [`keys`](super::keys) say is complained of.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::Complaint;
use super::keys::{Count, Key, TOP, Value};

/// A value and the line where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct At<T> {
    pub(super) line: usize,
    pub(super) value: T,
}

/// A section: the document before its first header, a `[table]`, or one of the tables of a `[[list]]`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section<'d> {
    /// Header as it is written.
    pub(super) header: &'static str,
    /// Line of the header.
    pub(super) line: usize,
    pub(super) table: &'d DeTable<'d>,
}

/// Reads values and collects complaints.
pub(super) struct Document<'t> {
    text: &'t str,
    pub(super) complaints: Vec<Complaint>,
}

impl<'t> Document<'t> {
    /// A document of this text. Where the text is no TOML the table holds what could be read.
    pub(super) fn parse(text: &'t str) -> (Self, DeTable<'t>) {
        let (table, errors) = DeTable::parse_recoverable(text);
        let mut document = Self { text, complaints: Vec::new() };
        for error in errors {
            document.complain_of(&error);
        }
        (document, table.into_inner())
    }

    pub(super) fn complain(&mut self, line: usize, sentence: impl Into<String>) {
        self.complaints.push(Complaint { line, sentence: sentence.into() });
    }

    /// Complains of what the TOML parser found.
    pub(super) fn complain_of(&mut self, error: &toml::de::Error) {
        let line = self.line(&error.span().unwrap_or(0..0));
        let message = error.message().replace('\n', ", ").replace("unknown field", "unknown key");
        self.complain(line, message);
    }

    /// Line of a part of the text.
    pub(super) fn line(&self, span: &Range<usize>) -> usize {
        let before = &self.text.as_bytes()[..span.start.min(self.text.len())];
        1 + before.iter().filter(|&&b| b == b'\n').count()
    }

    /// The document before its first header; `sections` are the keys that name sections.
    pub(super) fn top<'d>(&mut self, table: &'d DeTable<'d>, sections: &[&'static str]) -> Section<'d> {
        let top = Section { header: TOP, line: 1, table };
        self.check_keys(&top, sections);
        top
    }

    /// The section under `key` of `parent`; complains if it is not there, and of keys that it should not have.
    pub(super) fn section<'d>(
        &mut self,
        parent: &Section<'d>,
        (key, header): (&str, &'static str),
        inner: &[&'static str],
    ) -> Option<Section<'d>> {
        let Some(value) = parent.table.get(key) else {
            let example = Key::of(header).next().map_or_else(String::new, assignment);
            self.complain(parent.line, format!("there is no section {header}; add it, with {example}"));
            return None;
        };
        let line = self.line(&value.span());
        let Some(table) = value.get_ref().as_table() else {
            self.complain(line, format!("{key} must be a section {header}, not {}", shown(value)));
            return None;
        };
        let section = Section { header, line, table };
        self.check_keys(&section, inner);
        Some(section)
    }

    /// The section under `key` of `parent`, which may be left away.
    pub(super) fn optional_section<'d>(
        &mut self,
        parent: &Section<'d>,
        (key, header): (&str, &'static str),
    ) -> Option<Section<'d>> {
        parent.table.contains_key(key).then(|| self.section(parent, (key, header), &[]))?
    }

    /// The sections under `key` of `parent`; none is no complaint.
    pub(super) fn sections<'d>(
        &mut self,
        parent: &Section<'d>,
        (key, header): (&str, &'static str),
    ) -> Vec<Section<'d>> {
        let Some(value) = parent.table.get(key) else { return Vec::new() };
        let items = value.get_ref().as_array();
        let tables = items.and_then(|items| {
            items.iter().map(|i| Some((i.span(), i.get_ref().as_table()?))).collect::<Option<Vec<_>>>()
        });
        let Some(tables) = tables else {
            let line = self.line(&value.span());
            self.complain(line, format!("{key} must be sections {header} with double brackets"));
            return Vec::new();
        };
        let mut sections = Vec::new();
        for (span, table) in tables {
            let section = Section { header, line: self.line(&span), table };
            self.check_keys(&section, &[]);
            sections.push(section);
        }
        sections
    }

    /// Complains of keys that are not known.
    fn check_keys(&mut self, section: &Section<'_>, sections: &[&'static str]) {
        let known: Vec<&str> =
            Key::of(section.header).map(|k| k.name).chain(sections.iter().copied()).collect();
        for key in section.table.keys() {
            let name = key.get_ref().as_ref();
            if !known.contains(&name) {
                let place =
                    if section.header.is_empty() { "a scene".to_owned() } else { section.header.to_owned() };
                let sentence =
                    format!("{place} has no key {name}{}: it has {}", hint(name, &known), known.join(", "));
                self.complain(self.line(&key.span()), sentence);
            }
        }
    }

    /// The text of a key that must be given.
    pub(super) fn text(&mut self, section: &Section<'_>, key: &Key) -> Option<At<String>> {
        let Some(value) = section.table.get(key.name) else {
            self.complain_missing(section, key);
            return None;
        };
        let line = self.line(&value.span());
        match value.get_ref().as_str().map(str::trim) {
            Some("") => self.complain(line, format!("{} is empty; write {}", key.name, assignment(key))),
            Some(text) => return Some(At { line, value: text.to_owned() }),
            None => self.complain_type(line, value, key),
        }
        None
    }

    /// The `N` numbers of a key, or its default, which stands in the section's line.
    pub(super) fn numbers<const N: usize>(
        &mut self,
        section: &Section<'_>,
        key: &Key,
    ) -> Option<At<[f32; N]>> {
        let At { line, value } = self.list(section, key)?;
        Some(At { line, value: value.try_into().ok()? })
    }

    /// Whether a key says so, or its default.
    pub(super) fn flag(&mut self, section: &Section<'_>, key: &Key) -> Option<bool> {
        let Value::Flag { default } = key.value else { return None };
        let Some(value) = section.table.get(key.name) else { return default };
        let flag = value.get_ref().as_bool();
        if flag.is_none() {
            let line = self.line(&value.span());
            self.complain_type(line, value, key);
        }
        flag
    }

    /// The number of a key.
    pub(super) fn number(&mut self, section: &Section<'_>, key: &Key) -> Option<f32> {
        self.numbers::<1>(section, key).map(|at| at.value[0])
    }

    /// The numbers of a key, as many as it says.
    pub(super) fn list(&mut self, section: &Section<'_>, key: &Key) -> Option<At<Vec<f32>>> {
        let Value::Numbers { count, unit, least, most, default } = key.value else { return None };
        let Some(value) = section.table.get(key.name) else {
            if default.is_none() {
                self.complain_missing(section, key);
            }
            let numbers = default?.iter().map(|&v| v as f32).collect();
            return Some(At { line: section.line, value: numbers });
        };
        let line = self.line(&value.span());
        let items = match (value.get_ref().as_array(), count) {
            (Some(items), Count::List(_) | Count::UpTo(_)) => items.iter().map(number).collect(),
            (None, Count::One | Count::UpTo(_)) => number(value).map(|v| vec![v]),
            _ => None,
        };
        let fits = |n: usize| match count {
            Count::One => n == 1,
            Count::List(want) => n == want,
            Count::UpTo(want) => (1..=want).contains(&n),
        };
        let Some(numbers) = items.filter(|items: &Vec<f64>| fits(items.len())) else {
            self.complain_type(line, value, key);
            return None;
        };
        if let Some(wrong) = numbers.iter().find(|v| !(least..=most).contains(*v)) {
            let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
            let sentence =
                format!("{} of {wrong}{unit} is out of bounds: it may be {least} to {most}{unit}", key.name);
            self.complain(line, sentence);
            return None;
        }
        Some(At { line, value: numbers.into_iter().map(|v| v as f32).collect() })
    }

    fn complain_missing(&mut self, section: &Section<'_>, key: &Key) {
        let place = if section.header.is_empty() { "the scene" } else { section.header };
        let sentence = format!("{place} has no {} ({}); add {}", key.name, key.text, assignment(key));
        self.complain(section.line, sentence);
    }

    fn complain_type(&mut self, line: usize, value: &Spanned<DeValue<'_>>, key: &Key) {
        let want = match key.value {
            Value::Text => "a text in quotes".to_owned(),
            Value::Flag { .. } => "true or false".to_owned(),
            Value::Numbers { count: Count::One, .. } => "a number".to_owned(),
            Value::Numbers { count: Count::List(n), .. } => format!("a list of {n} numbers"),
            Value::Numbers { count: Count::UpTo(n), .. } => {
                format!("a number or a list of 1 to {n} numbers")
            }
        };
        let sentence =
            format!("{} must be {want}, not {}; write {}", key.name, shown(value), assignment(key));
        self.complain(line, sentence);
    }
}

/// `, did you mean ...?`, or nothing if no name of `known` is near.
pub(super) fn hint(name: &str, known: &[&str]) -> String {
    let distance = |k: &str| strsim::damerau_levenshtein(&name.to_lowercase(), k);
    let nearest = known.iter().map(|k| (distance(k), *k)).min();
    // One letter in three may be wrong.
    let near = nearest.filter(|(distance, k)| 3 * distance <= k.len().max(4));
    near.map_or_else(String::new, |(_, k)| format!(" (did you mean {k}?)"))
}

fn assignment(key: &Key) -> String {
    format!("{} = {}", key.name, key.example)
}

fn number(value: &Spanned<DeValue<'_>>) -> Option<f64> {
    match value.get_ref() {
        DeValue::Integer(digits) => {
            i64::from_str_radix(digits.as_str(), digits.radix()).ok().map(|v| v as f64)
        }
        DeValue::Float(digits) => digits.as_str().parse().ok(),
        _ => None,
    }
}

/// A wrong value as a complaint names it.
fn shown(value: &Spanned<DeValue<'_>>) -> String {
    match value.get_ref() {
        DeValue::String(text) if text.chars().count() <= 40 => format!("the text {text:?}"),
        DeValue::String(_) => "a text".to_owned(),
        DeValue::Integer(digits) => digits.to_string(),
        DeValue::Float(digits) => digits.to_string(),
        DeValue::Boolean(is) => is.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(items) => match items.len() {
            1 => "a list of one".to_owned(),
            n if items.iter().all(|i| number(i).is_some()) => format!("{n} numbers"),
            n => format!("a list of {n}"),
        },
        DeValue::Table(_) => "a section".to_owned(),
    }
}
