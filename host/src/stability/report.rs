//! Results as text, tables and pictures.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::sweep::{CaseResult, Curve, Point};
use crate::atomic::{self, WriteError};
use crate::plot::{Axis, Figure, Lines, Panel, PlotError, Series, Style};

/// Why the results were not written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder.
    #[error("cannot make the folder {path}: {source}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A table.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A picture.
    #[error(transparent)]
    Plot(#[from] PlotError),
}

/// Writes `stability.json`, `stability.csv`, `stability.txt` and a picture of each case to `folder`. Returns the files.
///
/// # Errors
/// If one of them cannot be written.
pub fn write(results: &[CaseResult], folder: &Path) -> Result<Vec<PathBuf>, ReportError> {
    std::fs::create_dir_all(folder)
        .map_err(|source| ReportError::Folder { path: folder.to_path_buf(), source })?;
    let json = serde_json::to_vec_pretty(results).unwrap_or_default();
    let tables: [(&str, Vec<u8>); 3] = [
        ("stability.json", json),
        ("stability.csv", csv(results).into_bytes()),
        ("stability.txt", table(results).into_bytes()),
    ];
    let mut files = Vec::new();
    for (name, contents) in tables {
        let path = folder.join(name);
        atomic::write(&path, &contents)?;
        files.push(path);
    }
    for result in results {
        let path = folder.join(format!("{}.png", result.name));
        picture(result).save(&path)?;
        files.push(path);
    }
    Ok(files)
}

/// Share of `count` in the trials, whole percent; but nothing that is there is 0, and nothing that is not all is 100.
fn percent(count: u32, point: &Point) -> String {
    let share = f64::from(count) / f64::from(point.trials.max(1)) * 100.0;
    match count {
        0 => "-".into(),
        n if n < point.trials => format!("{:.0}", share.clamp(1.0, 99.0)),
        _ => "100".into(),
    }
}

fn error_text(error: Option<f64>) -> String {
    error.map_or_else(|| "-".into(), significant)
}

/// Two significant digits.
fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (1 - value.abs().log10().floor() as i32).max(0) as usize;
    let unit = 10_f64.powi(1 - value.abs().log10().floor() as i32);
    format!("{:.*}", digits.min(12), (value * unit).round() / unit)
}

/// The results as text: for each case a table with a line for each stress, shares in percent.
pub fn table(results: &[CaseResult]) -> String {
    let mut out = String::new();
    for result in results {
        let unit = |unit: &str| if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let _ = writeln!(
            out,
            "{}: {}\n  error: {}; wrong above {}{}",
            result.name,
            result.about,
            result.error,
            significant(result.tolerance),
            unit(result.error_unit)
        );
        let mut rows = vec![
            ["", "", "unguarded", "", "guarded", "", "", "", "", ""].map(String::from),
            [
                result.stress,
                result.stress_unit,
                "right",
                "silent",
                "right",
                "announced",
                "needless",
                "silent",
                "rms",
                "bound",
            ]
            .map(String::from),
        ];
        let [plain, guarded] = &result.curves;
        for (without, with) in plain.points.iter().zip(&guarded.points) {
            let shares = [
                (without.right, without),
                (without.silent, without),
                (with.right, with),
                (with.announced, with),
                (with.needless, with),
                (with.silent, with),
            ];
            let mut row = vec![format!("{}", without.stress), String::new()];
            row.extend(shares.map(|(count, point)| percent(count, point)));
            row.push(error_text(with.rms_error));
            row.push(error_text(with.bound));
            rows.push(row.try_into().unwrap_or_default());
        }
        let widths: Vec<usize> = (0..10)
            .map(|column| {
                // The heading of the groups may reach over its neighbours.
                rows.iter().skip(1).map(|row| row[column].chars().count()).max().unwrap_or(0)
            })
            .collect();
        for row in &rows {
            let mut line = String::from(" ");
            for (cell, &width) in row.iter().zip(&widths).filter(|(_, width)| **width > 0) {
                let _ = write!(line, " {cell:>width$}");
            }
            let _ = writeln!(out, "{}", line.trim_end());
        }
        let reasons = reasons(guarded);
        if !reasons.is_empty() {
            let _ = writeln!(out, "  announced as: {}", reasons.join(", "));
        }
        out.push('\n');
    }
    out
}

/// The reasons that were told, the most frequent first.
fn reasons(curve: &Curve) -> Vec<&'static str> {
    let mut counts = std::collections::BTreeMap::<&str, u32>::new();
    for (reason, count) in curve.points.iter().flat_map(|p| &p.reasons) {
        *counts.entry(reason).or_default() += count;
    }
    let mut all: Vec<_> = counts.into_iter().collect();
    all.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    all.into_iter().map(|(reason, _)| reason).collect()
}

/// All points, a line each.
fn csv(results: &[CaseResult]) -> String {
    let mut out = String::from(
        "case,stress,stress_unit,guard,trials,right,announced,needless,silent,rms_error,bound,error_unit,tolerance,reasons\n",
    );
    for result in results {
        for curve in &result.curves {
            for p in &curve.points {
                let number = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.6}"));
                let reasons: Vec<_> = p.reasons.iter().map(|(reason, n)| format!("{reason} {n}")).collect();
                let _ = writeln!(
                    out,
                    "{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                    result.name,
                    p.stress,
                    result.stress_unit,
                    curve.guard,
                    p.trials,
                    p.right,
                    p.announced,
                    p.needless,
                    p.silent,
                    number(p.rms_error),
                    number(p.bound),
                    result.error_unit,
                    result.tolerance,
                    reasons.join("; ")
                );
            }
        }
    }
    out
}

/// Errors and verdicts of a case over its stress.
fn picture(result: &CaseResult) -> Figure {
    let [plain, guarded] = &result.curves;
    let stresses: Vec<f64> = guarded.points.iter().map(|p| p.stress).collect();
    let x = || axis(result.stress, result.stress_unit, &stresses);
    let series = |name: &str, curve: &Curve, value: &dyn Fn(&Point) -> f64| Series {
        name: name.into(),
        points: curve.points.iter().map(|p| (p.stress, value(p))).collect(),
        style: Style::Line,
    };
    let mut errors = vec![
        series("without guard", plain, &|p| p.rms_error.unwrap_or(f64::NAN)),
        series("with guard", guarded, &|p| p.rms_error.unwrap_or(f64::NAN)),
        series("wrong above", guarded, &|_| result.tolerance),
    ];
    if guarded.points.iter().any(|p| p.bound.is_some()) {
        errors.push(series("Cramer-Rao bound", guarded, &|p| p.bound.unwrap_or(f64::NAN)));
    }
    let shown: Vec<f64> =
        errors.iter().flat_map(|s| s.points.at().iter().map(|p| p.1)).filter(|v| v.is_finite()).collect();
    let share = |count: u32, p: &Point| f64::from(count) / f64::from(p.trials.max(1)) * 100.0;
    let verdicts = vec![
        series("silently wrong, without guard", plain, &|p| share(p.silent, p)),
        series("silently wrong, with guard", guarded, &|p| share(p.silent, p)),
        series("right", guarded, &|p| share(p.right, p)),
        series("announced", guarded, &|p| share(p.announced, p)),
        series("announced without need", guarded, &|p| share(p.needless, p)),
    ];
    let panel = |title: &str, y: Axis, series: Vec<Series>| {
        Panel::Lines(Lines { title: title.into(), x: x(), y, series, marks: None })
    };
    let of_answers = format!("Answers that were given: {}", result.error);
    let panels = vec![
        panel(&of_answers, axis("root mean square", result.error_unit, &shown), errors),
        panel("How answers end", Axis::new("share of the trials", "%", -3.0, 103.0), verdicts),
    ];
    let title = format!("{} (simulated)", result.name);
    Figure { title: Some(title), columns: 1, panel_height: 440, ..Figure::new(panels) }
}

/// An axis that holds all `values`; logarithmic where they span several octaves.
fn axis(label: &str, unit: &str, values: &[f64]) -> Axis {
    const OCTAVES: f64 = 30.0;
    let positive = values.iter().copied().filter(|&v| v > 0.0);
    let (low, high) = positive.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    if values.iter().all(|&v| v > 0.0) && high / low >= OCTAVES {
        let room = (high / low).powf(0.03);
        Axis::logarithmic(label, unit, low / room, high * room)
    } else {
        Axis::around(label, unit, values.iter().copied())
    }
}
