//! A study's table as a picture: lines over numbers, bars over names.

use rfhoi::plot::{Axis, BarSeries, BarValue, Bars, Figure, Lines, Panel, Series, Style};

use super::table::{At, Row, Table};

/// Of the picture, pixels.
const WIDTH: u32 = 900;
const HEIGHT: u32 = 480;
/// Name of the paper's values in legends.
const PAPER: &str = "paper, real data";

/// HOI accuracy of all rows.
pub(super) fn picture(table: &Table) -> Figure {
    let numbers = table.rows.iter().all(|row| matches!(row.at, At::Number(_)));
    let panel = if numbers { lines(table) } else { bars(table) };
    Figure { width: WIDTH, panel_height: HEIGHT, ..Figure::new(vec![panel]) }
}

/// Names of the series, in the order of the table.
fn series(table: &Table) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for row in &table.rows {
        if !names.contains(&row.series.as_str()) {
            names.push(&row.series);
        }
    }
    names
}

fn title(table: &Table) -> String {
    format!("HOI accuracy on the simulated site, {} of training each", runs(table))
}

fn runs(table: &Table) -> String {
    match table.rows.first().map_or(0, |row| row.hoi.runs) {
        1 => "one run".to_owned(),
        runs => format!("{runs} runs"),
    }
}

fn of<'a>(table: &'a Table, series: &'a str) -> impl Iterator<Item = &'a Row> {
    table.rows.iter().filter(move |row| row.series == series)
}

fn at(row: &Row) -> f64 {
    match row.at {
        At::Number(value) => value,
        At::Label(_) | At::Seconds => f64::NAN,
    }
}

fn lines(table: &Table) -> Panel {
    let mut all: Vec<Series> = series(table)
        .into_iter()
        .map(|name| {
            let points: Vec<(f64, f64)> = of(table, name).map(|row| (at(row), row.hoi.mean)).collect();
            let intervals = of(table, name).map(|row| (row.hoi.low, row.hoi.high));
            Series::new(name, points, Style::LineAndDots).with_intervals(intervals)
        })
        .collect();
    let paper: Vec<(f64, f64)> = table.rows.iter().filter_map(|row| Some((at(row), row.paper?))).collect();
    if !paper.is_empty() {
        all.push(Series::new(PAPER, paper, Style::Dots));
    }
    let ends =
        table.rows.iter().map(at).fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
    // Points at the frame's edge would be cut in half.
    let margin = 0.04 * (ends.1 - ends.0).max(1e-9);
    Panel::Lines(Lines {
        title: title(table),
        x: Axis::new(table.axis.clone(), "", ends.0 - margin, ends.1 + margin),
        y: Axis::new("HOI accuracy", "%", 0.0, 100.0),
        series: all,
        marks: None,
    })
}

fn bars(table: &Table) -> Panel {
    let mut groups: Vec<String> = Vec::new();
    for row in &table.rows {
        let name = row.at.to_string();
        if !groups.contains(&name) {
            groups.push(name);
        }
    }
    let bar = |series: &str, group: &String| match of(table, series).find(|row| row.at.to_string() == *group)
    {
        Some(row) => {
            let bar = BarValue::new(row.hoi.mean).with_interval(row.hoi.low, row.hoi.high);
            row.paper.map_or(bar, |paper| bar.with_reference(paper))
        }
        None => BarValue::new(f64::NAN),
    };
    let series = series(table)
        .into_iter()
        .map(|name| BarSeries {
            name: name.to_owned(),
            bars: groups.iter().map(|group| bar(name, group)).collect(),
        })
        .collect();
    Panel::Bars(Bars {
        title: title(table),
        groups: groups.clone(),
        y: Axis::new("HOI accuracy", "%", 0.0, 100.0),
        series,
        decimals: 1,
        reference: PAPER.to_owned(),
    })
}
