//! Panels of results: in, values; out, bars, markers, whiskers and labels where the values say.

use super::vectors::{Element, document, elements};
use super::*;
use crate::plot::canvas::FRAME;

const NOTHING: f64 = f64::NAN;

pub(super) fn bars() -> Bars {
    let series = |name: &str, bars: &[BarValue]| BarSeries { name: name.into(), bars: bars.to_vec() };
    Bars {
        title: "Unseen people".into(),
        groups: ["fusion", "no fusion", "RFID alone"].map(String::from).to_vec(),
        y: Axis::new("macro F1", "%", 0.0, 100.0),
        series: vec![
            series("float", &[BarValue::new(80.0).with_interval(75.0, 82.0), BarValue::new(50.0)]),
            series(
                "8-bit",
                &[BarValue::new(40.0), BarValue::new(NOTHING), BarValue::new(20.0).with_reference(60.0)],
            ),
        ],
        decimals: 1,
        reference: "paper's figure".into(),
    }
}

pub(super) fn scatter() -> Scatter {
    let series = |name: &str, marker, hollow, points: &[ScatterPoint]| ScatterSeries {
        name: name.into(),
        marker,
        hollow,
        points: points.to_vec(),
    };
    let places = [(1.0, 40.0), (10.0, 70.0), (100.0, 90.0), (300.0, 60.0)];
    let [a, b, c, d] = places.map(|at| ScatterPoint::new(at, format!("at {}", at.0)));
    Scatter {
        title: "Speed against accuracy".into(),
        x: Axis::logarithmic("time", "ms", 0.1, 1_000.0),
        y: Axis::new("macro F1", "%", 0.0, 100.0),
        series: vec![
            series("float", Marker::Circle, true, &[c.with_interval(85.0, 95.0), d]),
            series("8-bit", Marker::Square, false, &[a, b.as_default()]),
        ],
        front: Some(Front::of("Pareto front", places, Better::Larger)),
    }
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn drawn(panel: Panel) -> Vec<Element> {
    elements(&document(&Figure::new(vec![panel])))
}

/// Left, top, right and bottom of the last closed path in the colour of frames: that of the axes.
fn frame(all: &[Element]) -> [f64; 4] {
    let closed = |e: &&Element| e.get("stroke") == hex(FRAME) && e.path().len() == 5;
    let path = all.iter().rfind(closed).unwrap().path();
    [path[0].0, path[0].1, path[2].0, path[2].1]
}

/// Paths in a stroke's colour.
fn strokes<'a>(all: &'a [Element], colour: &str) -> impl Iterator<Item = Vec<(f64, f64)>> + use<'a> {
    let colour = colour.to_owned();
    all.iter().filter(move |e| e.name == "path" && e.get("stroke") == colour).map(Element::path)
}

fn near(a: f64, b: f64, by: f64) -> bool {
    (a - b).abs() <= by
}

/// What a label covers, as its width and height say: left, top, right, bottom.
fn covered(text: &Element) -> [f64; 4] {
    let (width, height) = (text.number("textLength"), text.number("font-size"));
    let left = text.number("x")
        - match text.get("text-anchor") {
            "start" => 0.0,
            "middle" => width / 2.0,
            _ => width,
        };
    [left, text.number("y") - 0.8 * height, left + width, text.number("y") + 0.2 * height]
}

fn apart(a: [f64; 4], b: [f64; 4]) -> bool {
    a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1]
}

#[test]
fn whiskers_of_a_series_are_at_their_values() {
    let series = Series::new("", vec![(0.25, 3.0), (0.5, 4.0), (0.75, 4.0)], Style::Line).with_intervals([
        (2.1, 4.2),
        (NOTHING, 5.0),
        (5.0, f64::INFINITY),
        (0.0, 1.0),
    ]);
    let all = drawn(Panel::Lines(lines(vec![series.clone()])));
    let [left, top, right, bottom] = frame(&all);
    let column = |x: f64| left + x * (right - left);
    let row = |y: f64| bottom - y / 6.3 * (bottom - top);
    let colour = hex(colour::of_series(0));
    let upright: Vec<_> = strokes(&all, &colour).filter(|p| p.len() == 2 && p[0].0 == p[1].0).collect();
    let wanted = [(column(0.25), row(4.2), row(2.1)), (column(0.75), top, row(5.0))];
    assert_eq!(upright.len(), wanted.len());
    for (path, (x, from, to)) in upright.iter().zip(wanted) {
        assert!(
            near(path[0].0, x, 0.01) && near(path[0].1, from, 0.01) && near(path[1].1, to, 0.01),
            "{path:?}"
        );
    }
    // Three caps: an end at infinity has none.
    let level = strokes(&all, &colour).filter(|p| p.len() == 2 && p[0].1 == p[1].1 && p[1].0 - p[0].0 < 9.0);
    assert_eq!(level.count(), 3);
    // Without intervals nothing else changes, in pixels as in vectors.
    let plain = Series { points: series.points.at().to_vec().into(), ..series.clone() };
    let small = |panel| Figure { width: 400, panel_height: 200, ..Figure::new(vec![panel]) };
    let picture = |series: &Series| saved(&small(Panel::Lines(lines(vec![series.clone()]))));
    assert_ne!(picture(&series), picture(&plain));
    assert_eq!(picture(&plain), picture(&plain.clone().with_intervals([])));
}

#[test]
fn markers_on_lines_differ_from_series_to_series() {
    let shape = |number: usize| {
        let mut series = vec![Series::default(); number];
        series.push(Series::new("", vec![(0.5, 3.0)], Style::LineAndDots));
        let all = drawn(Panel::Lines(Lines { marks: None, ..lines(series) }));
        let marker = |e: &&Element| ["circle", "path"].contains(&e.name.as_str()) && e.name != "text";
        let filled = all.iter().filter(marker).filter(|e| e.get("stroke").is_empty());
        let shapes: Vec<String> =
            filled.map(|e| format!("{} {} {}", e.name, e.get("d"), e.get("r"))).collect();
        // One alone between gaps has a small dot under its marker.
        assert!((2..=3).contains(&shapes.len()), "{shapes:?}");
        shapes
    };
    let shapes: Vec<_> = (0..8).map(shape).collect();
    for (n, a) in shapes.iter().enumerate() {
        assert!(shapes[..n].iter().all(|b| a != b), "{n}: {a:?}");
    }
}

#[test]
fn bars_have_the_heights_of_their_values() {
    let all = drawn(Panel::Bars(bars()));
    let [left, top, right, bottom] = frame(&all);
    let unit = (bottom - top) / 100.0;
    let of = |number: usize| -> Vec<&Element> {
        let fill = hex(colour::of_series(number));
        // The first is in the legend.
        all.iter().filter(|e| e.name == "rect" && e.get("fill") == fill).skip(1).collect()
    };
    let third = (right - left) / 3.0;
    for (number, values) in [(0, vec![(0, 80.0), (1, 50.0)]), (1, vec![(0, 40.0), (2, 20.0)])] {
        let bars = of(number);
        assert_eq!(bars.len(), values.len(), "a value that is no number has no bar");
        for (bar, (group, value)) in bars.into_iter().zip(values) {
            assert!(near(bar.number("height"), value * unit, 1.0), "{bar:?}");
            assert!(near(bar.number("y") + bar.number("height"), bottom, 1.0), "{bar:?}");
            let from = left + third * f64::from(group);
            assert!(bar.number("x") > from && bar.number("x") + bar.number("width") < from + third);
        }
    }
    let texts: Vec<&str> = all.iter().filter(|e| e.name == "text").map(|e| e.text.as_str()).collect();
    for wanted in ["80.0", "50.0", "40.0", "20.0", "no fusion", "paper's figure", "macro F1 (%)", "float"] {
        assert!(texts.contains(&wanted), "{wanted} in {texts:?}");
    }
    assert!(!texts.contains(&"NaN"));
    let ink = hex(INK);
    let whisker = strokes(&all, &ink).find(|p| p[0].0 == p[1].0).unwrap();
    assert!(near(whisker[0].1, bottom - 82.0 * unit, 0.1) && near(whisker[1].1, bottom - 75.0 * unit, 0.1));
    // The last diamond in ink is the reference's; the first is in the legend.
    let marker = all.iter().rfind(|e| e.get("fill") == ink && e.path().len() == 4).unwrap().path();
    assert!(near((marker[0].1 + marker[2].1) / 2.0, bottom - 60.0 * unit, 0.1), "{marker:?}");
}

#[test]
fn bars_of_pixels_are_where_those_of_vectors_are() {
    let figure = Figure::new(vec![Panel::Bars(bars())]);
    let all = elements(&document(&figure));
    let fill = hex(colour::of_series(0));
    let bar = all.iter().filter(|e| e.name == "rect" && e.get("fill") == fill).nth(1).unwrap();
    let canvas = figure.canvas(Path::new("bars.png"), Canvas::of_pixels).unwrap();
    let ((width, _), pixels) = canvas.pixels().unwrap();
    let at = |x: f64, y: f64| {
        let start = (y as usize * width as usize + x as usize) * 3;
        <[u8; 3]>::try_from(&pixels[start..start + 3]).unwrap()
    };
    // Beside the whisker in the middle.
    let column = bar.number("x") + bar.number("width") / 4.0;
    assert_eq!(at(column, bar.number("y") + 4.0), colour::of_series(0));
    assert_eq!(at(column, bar.number("y") + bar.number("height") - 4.0), colour::of_series(0));
    assert_eq!(at(column, bar.number("y") - 4.0), [255; 3]);
}

#[test]
fn values_of_bars_as_long_as_the_axis_have_room_beyond_it() {
    let full = |value| BarSeries { name: String::new(), bars: vec![BarValue::new(value); 3] };
    for series in [vec![full(100.0)], vec![full(-100.0), full(100.0)], vec![full(1e9)]] {
        let y = Axis::new("gain", "dB", -100.0, 100.0);
        let all = drawn(Panel::Bars(Bars { series, y, ..bars() }));
        let [_, top, _, bottom] = frame(&all);
        let values = ["100.0", "\u{2212}100.0", "1000000000.0"];
        let labels: Vec<_> = all.iter().filter(|e| values.contains(&e.text.as_str())).collect();
        assert!(labels.len() >= 6);
        for label in labels {
            let [_, above, _, below] = covered(label);
            assert!(above >= top && below <= bottom, "{label:?}");
        }
        assert!(all.iter().all(|e| e.text != "150"), "no ticks beyond the axis");
    }
}

#[test]
fn points_and_steps_are_at_their_values_on_a_logarithmic_axis() {
    let all = drawn(Panel::Scatter(scatter()));
    let [left, top, right, bottom] = frame(&all);
    let column = |x: f64| left + (x / 0.1).log10() / 4.0 * (right - left);
    let row = |y: f64| bottom - y / 100.0 * (bottom - top);
    for decade in ["0.1", "1", "10", "100", "1000"] {
        let label =
            all.iter().find(|e| e.name == "text" && e.text == decade && e.number("y") > bottom).unwrap();
        assert!(near(label.number("x"), column(decade.parse().unwrap()), 0.01), "{label:?}");
    }
    let circles: Vec<_> = all.iter().filter(|e| e.name == "circle").collect();
    let at = |x: f64, y: f64, fill: [u8; 3]| {
        let same = |e: &&&Element| {
            near(e.number("cx"), column(x), 0.01)
                && near(e.number("cy"), row(y), 0.01)
                && e.get("fill") == hex(fill)
        };
        circles.iter().filter(same).count()
    };
    // Hollow: a disc in the series' colour and a white one in it; the default has a ring.
    assert_eq!((at(100.0, 90.0, colour::of_series(0)), at(100.0, 90.0, [255; 3])), (1, 1));
    assert_eq!((at(300.0, 60.0, colour::of_series(0)), at(10.0, 70.0, INK)), (1, 1));
    let bold: Vec<_> = all.iter().filter(|e| e.get("font-weight") == "bold").map(|e| &e.text).collect();
    assert_eq!(bold, ["at 10"]);
    let front = strokes(&all, &hex(FRAME)).find(|p| p.len() == 6).unwrap();
    let wanted = [(1.0, 40.0), (10.0, 40.0), (10.0, 70.0), (100.0, 70.0), (100.0, 90.0), (1_000.0, 90.0)];
    for (place, (x, y)) in front.iter().zip(wanted) {
        assert!(near(place.0, column(x), 0.01) && near(place.1, row(y), 0.01), "{front:?}");
    }
    let whisker = strokes(&all, &hex(colour::of_series(0))).find(|p| p[0].0 == p[1].0).unwrap();
    assert!(near(whisker[0].1, row(95.0), 0.01) && near(whisker[1].1, row(85.0), 0.01));
}

#[test]
fn labels_of_a_crowd_overlap_neither_each_other_nor_markers() {
    let place = |n: u32| (3.0 * 1.05_f64.powf(n.into()), 50.0 + 4.0 * (f64::from(n) * 1.7).sin());
    let points: Vec<_> = (0..60).map(|n| ScatterPoint::new(place(n), format!("candidate {n}"))).collect();
    let series = vec![ScatterSeries { points, ..ScatterSeries::default() }];
    let all = drawn(Panel::Scatter(Scatter { series, front: None, ..scatter() }));
    let labels: Vec<_> = all
        .iter()
        .filter(|e| e.text.starts_with("candidate") && e.get("stroke").is_empty())
        .map(covered)
        .collect();
    assert!((5..60).contains(&labels.len()), "{} labels", labels.len());
    for (n, label) in labels.iter().enumerate() {
        assert!(labels[..n].iter().all(|other| apart(*label, *other)), "{label:?}");
        for marker in all.iter().filter(|e| e.name == "circle") {
            let (x, y, r) = (marker.number("cx"), marker.number("cy"), marker.number("r"));
            assert!(apart(*label, [x - r, y - r, x + r, y + r]), "{label:?} and {marker:?}");
        }
    }
}

#[test]
fn results_without_extent_are_drawn_all_the_same() {
    let infinity = f64::INFINITY;
    let odd = [NOTHING, infinity, -infinity, 0.0, -1.0, 1e300];
    let values = odd.map(|v| BarValue::new(v).with_interval(NOTHING, v).with_reference(v)).to_vec();
    let wide = odd.map(|v| BarValue::new(v).with_interval(-infinity, infinity)).to_vec();
    let series = |bars: &[BarValue]| BarSeries { name: String::new(), bars: bars.to_vec() };
    let points: Vec<_> = odd
        .iter()
        .flat_map(|&x| odd.map(|y| ScatterPoint::new((x, y), "p").with_interval(y, NOTHING).as_default()))
        .collect();
    let same = vec![ScatterPoint::new((1.0, 1.0), "same").as_default(); 30];
    let group = |names: &[&str]| names.iter().map(|n| n.to_string()).collect::<Vec<_>>();
    let none = Bars { groups: vec![], series: vec![], ..bars() };
    let long = "a name that is much longer than its group is wide and has no end";
    let panels = vec![
        Panel::Bars(none.clone()),
        Panel::Bars(Bars { series: vec![series(&values)], ..none }),
        Panel::Bars(Bars {
            series: vec![series(&values), series(&wide)],
            groups: group(&[long; 6]),
            ..bars()
        }),
        Panel::Bars(Bars {
            series: vec![series(&values); 40],
            groups: group(&[""; 6]),
            decimals: 200,
            ..bars()
        }),
        Panel::Bars(Bars { y: Axis::logarithmic("", "", 1.0, 100.0), ..bars() }),
        Panel::Bars(Bars { y: Axis::new("", "", 100.0, 0.0), ..bars() }),
        Panel::Bars(Bars { y: Axis::new("", "", NOTHING, NOTHING), ..bars() }),
        Panel::Scatter(Scatter { series: vec![], front: None, ..scatter() }),
        Panel::Scatter(Scatter {
            series: vec![ScatterSeries { points, ..ScatterSeries::default() }],
            x: Axis::logarithmic_around("", "", []),
            front: Some(Front { name: long.into(), points: odd.map(|v| (v, v)).to_vec() }),
            ..scatter()
        }),
        Panel::Scatter(Scatter {
            x: Axis::logarithmic_around("", "", [1.0, 1.0]),
            y: Axis::around("", "", [1.0, 1.0]),
            series: vec![ScatterSeries { points: same, ..ScatterSeries::default() }],
            front: Some(Front::of("", [(1.0, 1.0); 3], Better::Smaller)),
            ..scatter()
        }),
        Panel::Lines(lines(vec![
            Series::new("one", vec![(0.5, 1.0)], Style::LineAndDots).with_intervals([(1.0, 1.0)]),
            Series::new("none", vec![], Style::LineAndDots).with_intervals([(1.0, 1.0)]),
        ])),
    ];
    let figure = Figure { columns: 3, width: 900, panel_height: 240, ..Figure::new(panels) };
    saved(&figure);
    let all = elements(&document(&figure));
    for (key, value) in all.iter().flat_map(|e| &e.attributes) {
        assert!(!value.contains("NaN") && !value.contains("inf"), "{key}={value}");
    }
}
