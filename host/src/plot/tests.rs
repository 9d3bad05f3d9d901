//! Whole figures: in, panels; out, files that are as they should be. [`results`] has the panels of results, [`vectors`]
//! SVG files.

mod results;
mod vectors;

use ndarray::Array2;

use super::*;

fn map(values: Array2<f32>) -> Heatmap {
    Heatmap {
        title: "Range-Doppler".into(),
        values,
        x: Axis::new("velocity", "m/s", -4.5, 4.5),
        y: Axis::new("range", "m", 0.0, 3.1),
        scale: ColourScale::new("power", "dB"),
        reduce: Reduce::Max,
    }
}

fn lines(series: Vec<Series>) -> Lines {
    Lines {
        title: "Phase".into(),
        x: Axis::new("time", "s", 0.0, 1.0),
        y: Axis::new("phase", "rad", 0.0, 6.3),
        series,
        marks: Some(Marks { label: "invalid".into(), spans: vec![(0.2, 0.4)] }),
    }
}

fn saved(figure: &Figure) -> Vec<u8> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("picture.png");
    figure.save(&path).unwrap();
    std::fs::read(path).unwrap()
}

#[test]
fn a_picture_has_its_size_and_repeats_byte_for_byte() {
    let values = Array2::from_shape_fn((72, 64), |(r, d)| (r * d) as f32);
    let dots = Series::new("tag 1", vec![(0.1, 1.0), (0.5, 9.0)], Style::Dots);
    let panels = vec![Panel::Heatmap(map(values)), Panel::Lines(lines(vec![dots]))];
    let figure = Figure { title: Some("Frame 7".into()), ..Figure::new(panels) };
    let png = saved(&figure);
    assert_eq!(&png[1..4], b"PNG");
    // IHDR: width and height follow its length and type.
    assert_eq!(png[16..24], [1_200_u32.to_be_bytes(), (460 + TITLE as u32).to_be_bytes()].concat());
    assert_eq!(png, saved(&figure));
}

#[test]
fn what_has_no_extent_is_drawn_all_the_same() {
    let nothing = f64::NAN;
    let panels = vec![
        Panel::Heatmap(map(Array2::zeros((0, 5)))),
        Panel::Heatmap(map(Array2::from_elem((4, 4), f32::NAN))),
        Panel::Heatmap(Heatmap {
            x: Axis::new("x", "", 3.0, 3.0),
            y: Axis::new("y", "", f64::INFINITY, 0.0),
            ..map(Array2::from_elem((1, 1), f32::INFINITY))
        }),
        Panel::Lines(lines(vec![Series::new("", vec![(nothing, 1.0), (0.0, nothing)], Style::Line)])),
        Panel::Lines(Lines { y: Axis::around("y", "", []), ..lines(vec![]) }),
        Panel::Lines(Lines {
            x: Axis::new("t", "s", -1e300, 1e300),
            y: Axis::new("y", "", 0.0, 1e-300),
            ..lines(vec![])
        }),
    ];
    saved(&Figure { columns: 3, width: 900, ..Figure::new(panels) });
}

#[test]
fn figures_that_cannot_be_drawn_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("no.png");
    let panel = || Panel::Lines(lines(vec![]));
    for figure in [
        Figure::new(vec![]),
        Figure { width: 200, ..Figure::new(vec![panel()]) },
        Figure { panel_height: 20_000, ..Figure::new(vec![panel()]) },
    ] {
        let error = figure.save(&path).unwrap_err();
        assert!(matches!(error, PlotError::Size { .. }), "{error}");
        assert!(!path.exists());
    }
    assert!(matches!(
        Figure::new(vec![panel()]).save(directory.path().join("a.tga")),
        Err(PlotError::Draw { .. })
    ));
}

#[test]
fn ticks_are_round_and_labelled_without_surplus() {
    let labels = |from, to, most| -> Vec<String> {
        Axis::new("", "", from, to).ticks(most).into_iter().map(|(_, label)| label).collect()
    };
    assert_eq!(labels(0.0, 3.1, 7), ["0.0", "0.5", "1.0", "1.5", "2.0", "2.5", "3.0"]);
    assert_eq!(labels(-4.5, 4.5, 5), ["\u{2212}4", "\u{2212}2", "0", "2", "4"]);
    assert_eq!(labels(10.0, 0.0, 2), ["0", "5", "10"], "an axis may run down");
    assert_eq!(labels(0.0, 0.3, 3), ["0.0", "0.1", "0.2", "0.3"]);
    assert_eq!(labels(0.0, 2e7, 2), ["0", "1.00e7", "2.00e7"]);
}

#[test]
fn narrow_axes_have_more_than_one_tick() {
    let ticks = Axis::new("", "", -4.5, 4.5).ticks(4);
    assert_eq!(ticks.iter().map(|t| t.0).collect::<Vec<_>>(), [-4.0, -2.0, 0.0, 2.0, 4.0]);
    assert_eq!(Axis::new("", "", -170.0, 170.0).ticks(3).len(), 3);
}

#[test]
fn a_logarithmic_axis_has_equal_factors_equally_long_and_round_ticks() {
    let axis = Axis::logarithmic("", "", 0.1, 1_000.0);
    assert!((axis.place(10.0) - 0.5).abs() < 1e-12 && axis.place(0.0) < 0.0 && axis.place(-1.0) < 0.0);
    assert!(axis.place(f64::NAN).is_nan());
    let labels = |from, to, most| {
        Axis::logarithmic("", "", from, to).ticks(most).into_iter().map(|t| t.1).collect::<Vec<_>>()
    };
    assert_eq!(labels(1.0, 256.0, 9), ["1", "2", "5", "10", "20", "50", "100", "200"]);
    assert_eq!(labels(0.1, 1_000.0, 6), ["0.1", "1", "10", "100", "1000"]);
    assert_eq!(labels(1e3, 1e7, 6), ["1000", "1e4", "1e5", "1e6", "1e7"]);
    assert!(!Axis::logarithmic("", "", 0.0, 5.0).ticks(5).is_empty(), "no logarithm of zero");
}

#[test]
fn an_axis_around_values_holds_those_that_it_can() {
    let axis = Axis::logarithmic_around("", "", [0.2, 30.0, 0.0, -1.0, f64::NAN, f64::INFINITY]);
    assert!(
        axis.place(0.2) > 0.0 && axis.place(30.0) < 1.0 && axis.place(0.1) < 0.0 && axis.place(60.0) > 1.0
    );
    for values in [vec![], vec![5.0], vec![0.2, 0.2], vec![f64::NAN]] {
        for axis in [Axis::around("", "", values.clone()), Axis::logarithmic_around("", "", values)] {
            let axis = axis.sound();
            assert!(axis.from < axis.to && !axis.ticks(5).is_empty(), "{axis:?}");
        }
    }
    let one = Axis::logarithmic("", "", 0.2, 0.2).sound();
    assert_eq!((one.from, one.to), (0.1, 0.4));
}

#[test]
fn a_point_alone_between_gaps_is_seen() {
    let gap = f64::NAN;
    let series = |middle: f64| Series::new("", vec![(0.6, gap), (0.7, middle), (0.8, gap)], Style::Line);
    let picture = |middle| saved(&Figure::new(vec![Panel::Lines(lines(vec![series(middle)]))]));
    assert_ne!(picture(3.0), picture(gap));
}
