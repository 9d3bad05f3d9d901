//! Which tag is on which thing.
//!
//! In: a file of EPCs and names, as TOML or CSV:
//!
//! ```text
//! e28069950000501800000002 = "cookery book"          epc,name
//! e28069950000501800000005 = "microwave"             e28069950000501800000002,cookery book
//! ```
//!
//! or, without one, the tags of the simulated rooms. Out: names, by EPC.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rfhoi_shared::tag::Epc;

use crate::phase::MAX_TAGS;
use crate::simulate::scene::{NAMES, Scene};

/// Names of things by their tags.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TagNames {
    names: BTreeMap<Epc, String>,
    listed: bool,
}

/// Why a file of tags is refused.
#[derive(Debug, thiserror::Error)]
pub enum TagsError {
    /// It cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// What it says cannot be.
    #[error("{path}: {what}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

impl TagNames {
    /// The tags of the simulated rooms; others may be read too, and have no name.
    pub fn simulated() -> Self {
        let tags = NAMES.into_iter().filter_map(Scene::named).flat_map(|scene| scene.tags);
        Self { names: tags.map(|tag| (tag.epc, tag.object.name().to_owned())).collect(), listed: false }
    }

    /// Reads a file: CSV where its name ends so, else TOML. No other tags count.
    ///
    /// # Errors
    /// What is wrong, and where.
    pub fn read(path: &Path) -> Result<Self, TagsError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| TagsError::Read { path: path.to_path_buf(), source })?;
        let is_csv = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv"));
        let pairs = if is_csv { of_csv(&text) } else { of_toml(&text) };
        let names = pairs.and_then(Self::of_pairs);
        let wrong = |what| TagsError::Content { path: path.to_path_buf(), what };
        Ok(Self { names: names.map_err(wrong)?, listed: true })
    }

    fn of_pairs(pairs: Vec<(String, String)>) -> Result<BTreeMap<Epc, String>, String> {
        let mut names = BTreeMap::new();
        for (hex, name) in pairs {
            let digits: String = hex.chars().filter(|c| !c.is_whitespace() && *c != '-').collect();
            let epc = Epc::from_hex(&digits).filter(|epc| !epc.bytes().is_empty());
            let epc = epc.ok_or_else(|| {
                format!("`{hex}` is no EPC: give an even number of hexadecimal digits, mostly 24, as `rfhoi inspect` lists them")
            })?;
            let name = name.trim();
            if name.is_empty() {
                return Err(format!("the tag {hex} has no name: say what it is on, as \"cup\""));
            }
            if names.insert(epc, name.to_owned()).is_some() {
                return Err(format!("the tag {hex} is there twice"));
            }
        }
        match names.len() {
            0 => Err("it lists no tag: give lines of EPC = \"name\" (TOML) or EPC,name (CSV)".to_owned()),
            tags if tags > MAX_TAGS => {
                Err(format!("it lists {tags} tags, {MAX_TAGS} at most are followed at once"))
            }
            _ => Ok(names),
        }
    }

    /// Whether they are a list: other tags do not count.
    pub fn is_list(&self) -> bool {
        self.listed
    }

    /// The tags of the list, if they are one.
    pub fn list(&self) -> Vec<Epc> {
        if self.listed { self.names.keys().cloned().collect() } else { Vec::new() }
    }

    /// The name of the thing that a tag is on.
    pub fn get(&self, epc: &Epc) -> Option<&str> {
        self.names.get(epc).map(String::as_str)
    }

    /// All names, by EPC.
    pub fn iter(&self) -> impl Iterator<Item = (&Epc, &str)> {
        self.names.iter().map(|(epc, name)| (epc, name.as_str()))
    }
}

fn of_toml(text: &str) -> Result<Vec<(String, String)>, String> {
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    // A heading above the lines is as good as none.
    let mut pairs = Vec::new();
    for (key, value) in table {
        match value {
            toml::Value::String(name) => pairs.push((key, name)),
            toml::Value::Table(inner) => {
                for (key, value) in inner {
                    let name = value.as_str().ok_or_else(|| not_a_name(&key))?;
                    pairs.push((key, name.to_owned()));
                }
            }
            _ => return Err(not_a_name(&key)),
        }
    }
    Ok(pairs)
}

fn not_a_name(key: &str) -> String {
    format!("`{key}` is not a name in quotes, as {key} = \"cup\"")
}

fn of_csv(text: &str) -> Result<Vec<(String, String)>, String> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(text.as_bytes());
    let mut pairs = Vec::new();
    for (number, row) in reader.records().enumerate() {
        let row = row.map_err(|error| error.to_string())?;
        match (row.get(0), row.get(1), row.len()) {
            (Some(epc), Some(_), _) if number == 0 && epc.eq_ignore_ascii_case("epc") => {}
            (Some(epc), Some(name), 2) => pairs.push((epc.to_owned(), name.to_owned())),
            _ => {
                return Err(format!(
                    "line {}: give an EPC and a name, as e28069950000501800000005,microwave",
                    number + 1
                ));
            }
        }
    }
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, text: &str) -> Result<TagNames, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        TagNames::read(&path).map_err(|error| error.to_string().replace(path.to_str().unwrap(), "F"))
    }

    #[test]
    fn both_forms_say_the_same() {
        let toml = read("tags.toml", "E2-80 = \"cup\"\n[kitchen]\ne281 = \"blue mug\"\n");
        let csv = read("tags.csv", "epc,name\ne280,cup\nE2 81, blue mug\n");
        let (toml, csv) = (toml.unwrap(), csv.unwrap());
        assert_eq!(toml, csv);
        assert_eq!(toml.get(&Epc::new(&[0xe2, 0x81]).unwrap()), Some("blue mug"));
        assert_eq!((toml.list().len(), toml.is_list()), (2, true));
    }

    #[test]
    fn what_is_wrong_is_told() {
        for (name, text, want) in [
            ("a.csv", "e280;cup\n", "F: line 1: give an EPC and a name"),
            ("a.csv", "epc,name\n", "F: it lists no tag"),
            ("a.csv", "e28,cup\n", "F: `e28` is no EPC"),
            ("a.csv", "e280,cup\nE280,mug\n", "F: the tag E280 is there twice"),
            ("a.toml", "e280 = 7\n", "F: `e280` is not a name in quotes"),
            ("a.toml", "e280 = \"  \"\n", "F: the tag e280 has no name"),
            ("a.toml", "= =", "F: "),
        ] {
            let error = read(name, text).unwrap_err();
            assert!(error.starts_with(want), "{error}");
        }
        let many: String = (0..=MAX_TAGS).map(|n| format!("{n:04x} = \"cup\"\n")).collect();
        assert!(read("a.toml", &many).unwrap_err().contains("65 tags, 64 at most"));
    }

    #[test]
    fn the_simulated_rooms_agree_on_their_tags() {
        let tags = TagNames::simulated();
        assert_eq!((tags.iter().count(), tags.list().len()), (13, 0));
        for scene in NAMES.into_iter().filter_map(Scene::named) {
            assert!(scene.tags.iter().all(|tag| tags.get(&tag.epc) == Some(tag.object.name())));
        }
    }
}
