//! Vectors of the names of things, so that a network trained with some names works with names it never saw.
//!
//! In go the bytes of `models/names.bin`, which `models/names/make.py` writes and `models/names.md` describes, and a name as a
//! person wrote it beside a tag. Out comes a vector, and how the name was found: a name that is not known, or that was read as
//! another, is said to be so, and what was taken instead.

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;

use spelling::{forms, key, without_numbers, words};

mod spelling;

/// Begins the file; the last byte is the version.
const MAGIC: [u8; 8] = *b"RFHNAME\x01";
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
/// Names that a message suggests.
const SUGGESTIONS: usize = 3;

/// The body of the file, in postcard's encoding.
#[derive(Deserialize)]
struct Body<'a> {
    source: &'a str,
    dimensions: usize,
    /// What 1 of a vector's whole numbers is.
    scale: f32,
    /// Name and bits of [`Handling`].
    groups: Vec<(&'a str, u8)>,
    #[serde(borrow)]
    entries: Vec<Entry<'a>>,
}

#[derive(Deserialize)]
struct Entry<'a> {
    name: &'a str,
    /// Other words for the same thing.
    #[serde(borrow)]
    others: Vec<&'a str>,
    group: usize,
    /// One signed byte for each dimension.
    values: &'a [u8],
}

/// Why a file of names is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NamesError {
    /// It does not begin as one.
    #[error("not a file of names, or of another version: it does not begin with {:?}", MAGIC.escape_ascii().to_string())]
    Magic,
    /// It was changed or cut.
    #[error("the file of names is damaged: its checksum is wrong")]
    Checksum,
    /// Its checksum is right, yet its body cannot be read.
    #[error("the body of the file of names cannot be read")]
    Body,
    /// What it says cannot be.
    #[error("the file of names holds {0}")]
    Content(&'static str),
}

/// What people do to a thing, as far as its group of the list tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Handling(u8);

impl Handling {
    /// Whether it is picked up and put down.
    pub const fn carried(self) -> bool {
        self.0 & 1 != 0
    }

    /// Whether it is opened and closed.
    pub const fn opened(self) -> bool {
        self.0 & 2 != 0
    }

    /// Whether it is sat down on and stood up from.
    pub const fn sat_on(self) -> bool {
        self.0 & 4 != 0
    }

    /// Whether it is wiped.
    pub const fn wiped(self) -> bool {
        self.0 & 8 != 0
    }
}

/// How a name was found. `place` is that of [`Names::vector`], `used` the name of that place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Lookup {
    /// It is in the list, letter by letter.
    Exact {
        /// Place in the list.
        place: usize,
    },
    /// The same but for case, hyphens, spaces, an article, a plural or a number; or another word for the same thing.
    Normalised {
        /// Place in the list.
        place: usize,
        /// Name in the list.
        used: String,
    },
    /// A part of it is: "blue coffee mug" is a mug.
    HeadWord {
        /// Place in the list.
        place: usize,
        /// Name in the list.
        used: String,
    },
    /// It is spelled like one name in the list, and like no other.
    Similar {
        /// Place in the list.
        place: usize,
        /// Name in the list.
        used: String,
    },
    /// Nothing in the list fits. Its vector is the mean of all.
    Unknown {
        /// Names in the list that are spelled the least unlike it, the likest first; empty where none has a letter of it.
        closest: Vec<String>,
    },
}

impl Lookup {
    /// Place in the list, if it was found.
    pub fn place(&self) -> Option<usize> {
        match self {
            Self::Exact { place }
            | Self::Normalised { place, .. }
            | Self::HeadWord { place, .. }
            | Self::Similar { place, .. } => Some(*place),
            Self::Unknown { .. } => None,
        }
    }

    /// What to tell the person who gave `name`; nothing where it was found as it is meant.
    pub fn remark(&self, name: &str) -> Option<String> {
        match self {
            Self::Exact { .. } | Self::Normalised { .. } => None,
            Self::HeadWord { used, .. } | Self::Similar { used, .. } => {
                Some(format!("the name '{name}' is taken as '{used}'"))
            }
            Self::Unknown { closest } => {
                let closest = if closest.is_empty() {
                    String::new()
                } else {
                    format!("; closest: {}", closest.join(", "))
                };
                Some(format!(
                    "the name '{name}' is not known; its tag is followed all the same, but its name says nothing{closest}"
                ))
            }
        }
    }
}

/// The list of names and their vectors.
pub struct Names {
    source: String,
    fingerprint: u32,
    dimensions: usize,
    names: Vec<String>,
    /// `[names + 1][dimensions]`; the last is the mean of all others.
    vectors: Vec<f32>,
    groups: Vec<(String, Handling)>,
    group_of: Vec<usize>,
    /// Place of each name and each other word for it, by [`key`].
    places: BTreeMap<String, usize>,
}

impl Names {
    /// Reads the file.
    ///
    /// # Errors
    /// If it is no such file, damaged, or holds what cannot be.
    pub fn parse(bytes: &[u8]) -> Result<Self, NamesError> {
        let rest = bytes.strip_prefix(&MAGIC).ok_or(NamesError::Magic)?;
        let (body, checksum) = rest.split_last_chunk::<4>().ok_or(NamesError::Checksum)?;
        if CRC.checksum(&bytes[..bytes.len() - checksum.len()]) != u32::from_le_bytes(*checksum) {
            return Err(NamesError::Checksum);
        }
        let (body, rest) = postcard::take_from_bytes::<Body<'_>>(body).map_err(|_| NamesError::Body)?;
        if !rest.is_empty() {
            return Err(NamesError::Body);
        }
        Self::new(&body, u32::from_le_bytes(*checksum))
    }

    fn new(body: &Body<'_>, fingerprint: u32) -> Result<Self, NamesError> {
        let ensure =
            |right: bool, otherwise| if right { Ok(()) } else { Err(NamesError::Content(otherwise)) };
        ensure(body.dimensions > 0 && !body.entries.is_empty(), "no vectors")?;
        ensure(body.scale.is_finite() && body.scale > 0.0, "a scale that is none")?;
        let mut vectors = Vec::new();
        let mut places = BTreeMap::new();
        for (place, entry) in body.entries.iter().enumerate() {
            ensure(entry.values.len() == body.dimensions, "a vector of another length")?;
            ensure(entry.group < body.groups.len(), "a name of no group")?;
            vectors.extend(entry.values.iter().map(|v| f32::from(v.cast_signed()) * body.scale));
            for word in entry.others.iter().chain([&entry.name]) {
                let key = key(word);
                ensure(
                    !key.is_empty() && places.insert(key, place).is_none(),
                    "a name that is empty or there twice",
                )?;
            }
        }
        let count = body.entries.len();
        let mean =
            |dimension| vectors.iter().skip(dimension).step_by(body.dimensions).sum::<f32>() / count as f32;
        let mean: Vec<f32> = (0..body.dimensions).map(mean).collect();
        vectors.extend(mean);
        Ok(Self {
            source: body.source.to_owned(),
            fingerprint,
            dimensions: body.dimensions,
            names: body.entries.iter().map(|e| e.name.to_owned()).collect(),
            vectors,
            groups: body.groups.iter().map(|&(name, bits)| (name.to_owned(), Handling(bits))).collect(),
            group_of: body.entries.iter().map(|e| e.group).collect(),
            places,
        })
    }

    /// The model that the vectors are of, its licence, and how it was asked.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The file's checksum: a network knows the vectors that it was trained with by it.
    pub fn fingerprint(&self) -> u32 {
        self.fingerprint
    }

    /// Values of a vector.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Names.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there are none; a file without names is refused.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// The name of a place.
    ///
    /// # Panics
    /// If `place` is not less than [`Self::len`]; the same holds for the other methods that take one.
    pub fn name(&self, place: usize) -> &str {
        &self.names[place]
    }

    /// The vector of a place: `[dimensions]`, root mean square 1.
    pub fn vector(&self, place: usize) -> &[f32] {
        assert!(place < self.len(), "{place} is no name's place");
        self.row(place)
    }

    /// The mean of all names' vectors: `[dimensions]`, close to 0 and not 0.
    pub fn mean(&self) -> &[f32] {
        self.row(self.len())
    }

    /// The vector of what was found; of an unknown name, the mean.
    pub fn vector_of(&self, lookup: &Lookup) -> &[f32] {
        lookup.place().map_or(self.mean(), |place| self.vector(place))
    }

    /// What people do to the thing of a place.
    pub fn handling(&self, place: usize) -> Handling {
        self.groups[self.group_of[place]].1
    }

    /// The group of the list that a place is in, as "cups and glasses".
    pub fn group(&self, place: usize) -> &str {
        &self.groups[self.group_of[place]].0
    }

    /// Finds a name.
    pub fn lookup(&self, name: &str) -> Lookup {
        let used = |place: usize| self.names[place].clone();
        if let Some(place) = self.places.get(&key(name)).copied().filter(|&place| self.names[place] == name) {
            return Lookup::Exact { place };
        }
        let words = words(name);
        if let Some(place) = self.place_of(&words) {
            return Lookup::Normalised { place, used: used(place) };
        }
        let numberless = without_numbers(&words);
        if let Some(place) = self.place_of(&numberless) {
            return Lookup::Normalised { place, used: used(place) };
        }
        let head = spelling::head(&numberless);
        if let Some(place) = (0..head.len()).find_map(|from| self.place_of(&head[from..])) {
            return Lookup::HeadWord { place, used: used(place) };
        }
        // Only now, or a plastic bowl would be a misspelled plastic box.
        if let Some(place) = (0..head.len()).find_map(|from| self.similar(&head[from..].concat())) {
            return Lookup::Similar { place, used: used(place) };
        }
        let mut runs = (1..=numberless.len()).rev().flat_map(|to| (0..to).map(move |from| from..to));
        if let Some(place) = runs.find_map(|run| self.place_of(&numberless[run])) {
            return Lookup::HeadWord { place, used: used(place) };
        }
        Lookup::Unknown { closest: self.closest(&key(name)) }
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.vectors[row * self.dimensions..(row + 1) * self.dimensions]
    }

    /// The place of these words together, as they are, or the last of them made singular or plural.
    fn place_of(&self, words: &[String]) -> Option<usize> {
        let (last, rest) = words.split_last()?;
        let rest = rest.concat();
        forms(last).find_map(|form| self.places.get(&(rest.clone() + &form)).copied())
    }

    /// The place that a misspelled key is of; none if two places are as near.
    fn similar(&self, key: &str) -> Option<usize> {
        let errors = |(known, &place): (&String, &usize)| Some((spelling::errors(key, known)?, place));
        let near: Vec<_> = self.places.iter().filter_map(errors).collect();
        let &(least, place) = near.iter().min()?;
        near.iter().all(|&(errors, other)| errors > least || other == place).then_some(place)
    }

    fn closest(&self, key: &str) -> Vec<String> {
        let likeness = |(known, &place): (&String, &usize)| (strsim::jaro_winkler(key, known), place);
        let mut all: Vec<_> =
            self.places.iter().map(likeness).filter(|&(likeness, _)| likeness > 0.0).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut closest: Vec<usize> = Vec::with_capacity(SUGGESTIONS);
        for (_, place) in all {
            if closest.len() == SUGGESTIONS {
                break;
            }
            if !closest.contains(&place) {
                closest.push(place);
            }
        }
        closest.into_iter().map(|place| self.names[place].clone()).collect()
    }
}

impl fmt::Debug for Names {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} names in {} dimensions, {}", self.len(), self.dimensions, self.source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &[u8] = include_bytes!("../../../models/names.bin");

    fn names() -> Names {
        Names::parse(FILE).unwrap()
    }

    /// Cosine of the angle between two names.
    fn likeness(names: &Names, a: &str, b: &str) -> f32 {
        let (a, b) = (names.lookup(a).place().unwrap(), names.lookup(b).place().unwrap());
        let products = names.vector(a).iter().zip(names.vector(b)).map(|(a, b)| a * b);
        products.sum::<f32>() / names.dimensions() as f32
    }

    /// What a name is read as, with a letter for how.
    fn read(names: &Names, name: &str) -> String {
        match names.lookup(name) {
            Lookup::Exact { place } => format!("= {}", names.name(place)),
            Lookup::Normalised { used, .. } => format!("n {used}"),
            Lookup::HeadWord { used, .. } => format!("h {used}"),
            Lookup::Similar { used, .. } => format!("s {used}"),
            Lookup::Unknown { .. } => "?".to_owned(),
        }
    }

    #[test]
    fn objects_of_the_paper_are_there() {
        let names = names();
        let objects = [
            "phone",
            "book",
            "pen",
            "bottle",
            "microwave",
            "cabinet",
            "table",
            "chair",
            "jar",
            "lunchbox",
            "bowl",
            "cup",
            "eyeglass case",
        ];
        for object in objects {
            assert!(
                matches!(names.lookup(object), Lookup::Exact { place } if names.name(place) == object),
                "{object}"
            );
        }
        assert!((600..=900).contains(&names.len()));
        for place in 0..names.len() {
            assert_eq!(names.lookup(names.name(place)), Lookup::Exact { place });
        }
    }

    #[test]
    fn vectors_are_of_root_mean_square_one() {
        let names = names();
        assert_eq!(names.dimensions(), 32);
        for place in 0..names.len() {
            let power = names.vector(place).iter().map(|v| v * v).sum::<f32>() / 32.0;
            assert!((power - 1.0).abs() < 0.02, "{}: {power}", names.name(place));
        }
    }

    #[test]
    fn names_are_read_as_people_write_them() {
        let names = names();
        let cases = [
            // Case, articles, plurals, hyphens, numbers, possessives.
            ("Cup", "n cup"),
            ("the cups", "n cup"),
            ("My Lunch-Box", "n lunchbox"),
            ("lunch boxes", "n lunchbox"),
            ("eyeglass cases", "n eyeglass case"),
            ("batteries", "n battery"),
            ("bread knives", "n bread knife"),
            ("bookshelves", "n bookshelf"),
            ("mice", "n computer mouse"),
            ("headphone", "n headphones"),
            ("chair_2", "n chair"),
            ("Bottle #1", "n bottle"),
            ("cup3", "n cup"),
            // Other words for it, British and American.
            ("colour pencil", "h pencil"),
            ("coloured pencils", "n colored pencil"),
            ("tap", "n faucet"),
            ("torch", "n flashlight"),
            ("jewellery box", "n jewelry box"),
            ("spectacles case", "n eyeglass case"),
            ("dustbin", "n trash can"),
            ("mp3 player", "n media player"),
            // Head words.
            ("blue coffee mug", "h mug"),
            ("Anna's big red phone", "h phone"),
            ("mug with a broken handle", "h mug"),
            ("box of old photos", "h box"),
            ("IKEA chairs", "h chair"),
            ("plastic bowl", "h bowl"),
            ("table leg", "h table"),
            // Misspellings.
            ("botle", "s bottle"),
            ("mircowave", "s microwave"),
            ("cabinnet", "s cabinet"),
            ("eyeglas case", "s eyeglass case"),
            ("blue botle", "s bottle"),
            // What is not known: too short to guess, near two names at once, or a word of its own a letter away.
            ("locked", "?"),
            ("couth", "?"),
            ("xyzzy", "?"),
            ("boik", "?"),
            ("17", "?"),
            ("", "?"),
            ("Стул", "?"),
        ];
        for (name, wanted) in cases {
            assert_eq!(read(&names, name), wanted, "{name}");
        }
    }

    #[test]
    fn an_unknown_name_is_said_to_be_unknown() {
        let names = names();
        let lookup = names.lookup("xyzzy");
        let Lookup::Unknown { closest } = &lookup else { panic!("{lookup:?}") };
        assert_eq!(closest.len(), SUGGESTIONS);
        let remark = lookup.remark("xyzzy").unwrap();
        assert!(
            remark.starts_with("the name 'xyzzy' is not known") && remark.contains(&closest[0]),
            "{remark}"
        );
        assert_eq!(names.vector_of(&lookup), names.mean());
        assert!(names.mean().iter().all(|v| v.is_finite()) && names.mean().iter().any(|&v| v != 0.0));
        assert_eq!(
            names
                .lookup("phne")
                .remark("phne")
                .unwrap()
                .split("closest: ")
                .nth(1)
                .unwrap()
                .split(", ")
                .next(),
            Some("phone")
        );
        assert_eq!(names.lookup(""), Lookup::Unknown { closest: Vec::new() });
        assert_eq!(names.lookup("cups").remark("cups"), None);
        assert_eq!(names.lookup("botle").remark("botle").unwrap(), "the name 'botle' is taken as 'bottle'");
    }

    #[test]
    fn similar_things_are_closer_than_others() {
        let names = names();
        let triples = [
            ("cup", "mug", "chair"),
            ("chair", "armchair", "bottle"),
            ("phone", "tablet", "bowl"),
            ("book", "notebook", "stool"),
            ("cabinet", "cupboard", "pen"),
            ("pen", "pencil", "oven"),
            ("microwave", "oven", "book"),
            ("lunchbox", "food container", "desk"),
            ("eyeglass case", "sunglasses", "sofa"),
            ("table", "desk", "jar"),
        ];
        for (name, near, far) in triples {
            let (near, far) = (likeness(&names, name, near), likeness(&names, name, far));
            assert!(near > far + 0.2, "{name}: {near} and {far}");
        }
    }

    #[test]
    fn groups_tell_how_things_are_handled() {
        let names = names();
        let of = |name| names.handling(names.lookup(name).place().unwrap());
        assert!(of("book").carried() && of("book").opened() && !of("book").sat_on());
        assert!(of("microwave").opened() && !of("microwave").carried());
        assert!(of("chair").sat_on() && of("table").wiped());
        assert_eq!(names.group(names.lookup("mug").place().unwrap()), "cups and glasses");
    }

    #[test]
    fn a_damaged_file_is_refused() {
        assert_eq!(Names::parse(b"").unwrap_err(), NamesError::Magic);
        let mut version = FILE.to_vec();
        version[7] += 1;
        assert_eq!(Names::parse(&version).unwrap_err(), NamesError::Magic);
        for place in (8..FILE.len()).step_by(97) {
            let mut damaged = FILE.to_vec();
            damaged[place] ^= 1 << (place % 8);
            assert_eq!(Names::parse(&damaged).unwrap_err(), NamesError::Checksum, "bit of byte {place}");
            assert_eq!(Names::parse(&FILE[..place]).unwrap_err(), NamesError::Checksum, "cut at {place}");
        }
    }

    /// A file of this body, with its checksum.
    fn file(body: &[u8]) -> Vec<u8> {
        let mut file = [&MAGIC, body].concat();
        let checksum = CRC.checksum(&file);
        file.extend(checksum.to_le_bytes());
        file
    }

    #[test]
    fn a_file_that_cannot_be_is_refused_though_its_checksum_is_right() {
        // No source, 1 dimension, scale 1, the group "g" of things carried; then names of one byte each.
        let start = [0, 1, 0, 0, 0x80, 0x3f, 1, 1, b'g', 1];
        let body = |entries: &[u8]| file(&[&start, entries].concat());
        let cup = [3, b'c', b'u', b'p', 0, 0, 1, 0xfe];
        let one = Names::parse(&body(&[&[1], &cup[..]].concat())).unwrap();
        assert_eq!((one.len(), one.vector(0), one.mean()), (1, &[-2.0][..], &[-2.0][..]));
        let refused = |entries: &[u8]| Names::parse(&body(entries)).unwrap_err();
        assert_eq!(refused(&[0]), NamesError::Content("no vectors"));
        assert_eq!(
            refused(&[&[2], &cup[..], &cup[..]].concat()),
            NamesError::Content("a name that is empty or there twice")
        );
        assert_eq!(refused(&[1, 1, b'c', 0, 1, 1, 0]), NamesError::Content("a name of no group"));
        assert_eq!(refused(&[1, 1, b'c', 0, 0, 2, 0, 0]), NamesError::Content("a vector of another length"));
        assert_eq!(refused(&[&[1], &cup[..], &[0]].concat()), NamesError::Body);
        assert_eq!(refused(&[255, 255, 255, 255, 15]), NamesError::Body);
    }
}
