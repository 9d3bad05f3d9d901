//! SVG files: in, figures; out, elements as a reader of XML sees them.

use std::collections::BTreeMap;

use super::results::{bars, scatter};
use super::*;

/// An element, with the text directly in it.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) attributes: BTreeMap<String, String>,
    pub(super) text: String,
}

impl Element {
    pub(super) fn get(&self, attribute: &str) -> &str {
        self.attributes.get(attribute).map_or("", String::as_str)
    }

    pub(super) fn number(&self, attribute: &str) -> f64 {
        self.get(attribute).parse().unwrap_or_else(|_| panic!("{attribute} of {self:?}"))
    }

    /// The points of a path of straight lines; none of the stripes of hatchings.
    pub(super) fn path(&self) -> Vec<(f64, f64)> {
        if self.get("d").contains('h') {
            return Vec::new();
        }
        let points = self.get("d").trim_end_matches('z').split(['M', 'L']).skip(1);
        points
            .map(|p| p.split_once(' ').map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap())).unwrap())
            .collect()
    }
}

fn unescaped(text: &str) -> String {
    let mut parts = text.split('&');
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (entity, rest) = part.split_once(';').expect("a bare ampersand");
        plain.push(match entity {
            "amp" => '&',
            "lt" => '<',
            "gt" => '>',
            "quot" => '"',
            "apos" => '\'',
            other => panic!("unknown entity {other}"),
        });
        plain.push_str(rest);
    }
    plain
}

/// All elements of a document, in the order in which they begin; panics where it is not well formed.
pub(super) fn elements(document: &str) -> Vec<Element> {
    let body = document.strip_prefix("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n").expect("a declaration");
    let (mut all, mut open): (Vec<Element>, Vec<usize>) = (Vec::new(), Vec::new());
    for part in body.split('<').skip(1) {
        let (tag, text) = part.split_once('>').expect("a tag has an end");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().map(|n| all[n].name.as_str()), Some(name), "tags are balanced");
        } else {
            let (tag, alone) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
            let (name, mut rest) = tag.split_once(' ').unwrap_or((tag, ""));
            let mut element = Element { name: name.into(), ..Element::default() };
            while !rest.is_empty() {
                let (key, after) = rest.split_once("=\"").expect("an attribute has a value");
                let (value, after) = after.split_once('"').expect("a value has an end");
                let twice = element.attributes.insert(key.into(), unescaped(value));
                assert!(twice.is_none(), "{key} of {tag} stands twice");
                rest = after.trim_start();
            }
            if !alone {
                open.push(all.len());
            }
            all.push(element);
        }
        match open.last() {
            Some(&n) => all[n].text.push_str(&unescaped(text)),
            None => assert!(text.trim().is_empty(), "text after the end"),
        }
    }
    assert!(open.is_empty(), "tags are balanced");
    all
}

/// The text of a figure saved as SVG.
pub(super) fn document(figure: &Figure) -> String {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("picture.SVG");
    figure.save(&path).unwrap();
    std::fs::read_to_string(path).unwrap()
}

fn view() -> View {
    View {
        title: "Room".into(),
        x: Axis::new("x", "m", -2.0, 2.0).with_marks([1.0]),
        y: Axis::new("y", "m", 0.0, 3.0),
        shapes: vec![
            Shape::Polygon { corners: vec![(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], paint: Paint::Grey(200) },
            Shape::Line { points: vec![(-1.0, 0.0), (9.0, 2.0)], paint: Paint::Level(0.4), width: 3 },
            Shape::Mark {
                at: (0.5, 1.0),
                radius: 6.0,
                square: true,
                paint: Paint::Series(1),
                name: "r<1>".into(),
            },
        ],
        scale: Some(ColourScale::new("strength", "dB").with_range(0.0, 1.0)),
    }
}

#[test]
fn all_but_heatmaps_become_vectors_with_text_that_is_text() {
    let nasty = "a<b> & \"c\" 'd'\u{7}";
    let series = Series::new(nasty, vec![(0.1, 1.0), (0.5, 5.0)], Style::LineAndDots);
    let panels = vec![
        Panel::Lines(Lines { title: "<&\"".into(), ..lines(vec![series]) }),
        Panel::View(view()),
        Panel::Bars(bars()),
        Panel::Scatter(scatter()),
    ];
    let figure = Figure { title: Some("R&D <now>".into()), highlighted: Some(1), ..Figure::new(panels) };
    let text = document(&figure);
    assert_eq!(text, document(&figure), "the same figure has the same bytes");
    assert!(text.len() < 60_000, "{} bytes", text.len());
    let all = elements(&text);
    assert_eq!((all[0].name.as_str(), all[0].get("width"), all[0].get("height")), ("svg", "1200", "966"));
    let known = ["svg", "rect", "path", "circle", "text", "pattern", "linearGradient", "stop"];
    assert!(all.iter().all(|e| known.contains(&e.name.as_str())));
    let texts: Vec<&str> = all.iter().filter(|e| e.name == "text").map(|e| e.text.as_str()).collect();
    for wanted in ["R&D <now>", "<&\"", "a<b> & \"c\" 'd'\u{fffd}", "r<1>", "phase (rad)", "strength (dB)"] {
        assert!(texts.contains(&wanted), "{wanted} in {texts:?}");
    }
    for used in all.iter().filter_map(|e| e.get("fill").strip_prefix("url(#")) {
        assert!(all.iter().any(|e| !e.get("id").is_empty() && used == format!("{})", e.get("id"))), "{used}");
    }
}

#[test]
fn heatmaps_have_no_vectors() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("map.svg");
    let figure = Figure::new(vec![Panel::Heatmap(map(Array2::zeros((4, 4))))]);
    let error = figure.save(&path).unwrap_err();
    assert!(matches!(&error, PlotError::Draw { reason, .. } if reason.contains(".png")), "{error}");
    assert!(!path.exists());
}

#[test]
fn a_long_series_is_one_path() {
    let points: Vec<_> =
        (0..5_000).map(|n| (f64::from(n) / 5_000.0, 3.0 + (f64::from(n) / 99.0).sin())).collect();
    let figure = Figure::new(vec![Panel::Lines(lines(vec![Series::new("", points, Style::Line)]))]);
    let text = document(&figure);
    assert!(text.len() < 100_000, "{} bytes", text.len());
    let longest = elements(&text).iter().filter(|e| e.name == "path").map(|e| e.path().len()).max();
    assert_eq!(longest, Some(5_000));
}
