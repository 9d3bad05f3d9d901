//! Axes: what they measure, where their ticks are, and how they are drawn.

use super::canvas::{Anchor, Area, Canvas, Drawn, FRAME, GRID, INK, Trouble};

/// Free space about a panel, pixels.
pub(super) const MARGIN: i32 = 14;

/// Height of the letters of tick labels and axis titles, pixels.
pub(super) const TICK_LETTERS: f64 = 16.0;
pub(super) const LABEL_LETTERS: f64 = 18.0;
/// Height of the letters of a panel's title, pixels.
pub(super) const TITLE_LETTERS: f64 = 20.0;
const TICK: i32 = 5;
/// From a tick to its label, pixels.
const GAP: i32 = 5;
/// Room for the labels of an x axis and its title.
const BELOW: i32 = TICK + GAP + (TICK_LETTERS + LABEL_LETTERS) as i32 + 12;
/// Length of the dashes of marks, pixels.
const DASH: usize = 6;
/// Least room for the labels of a y axis, so that panels above each other line up.
const LEAST_LABEL: i32 = 44;

/// What an axis measures and from where to where it runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What it measures.
    pub label: String,
    /// Its unit; empty for a bare number.
    pub unit: String,
    /// Value at the left or lower end.
    pub from: f64,
    /// Value at the right or upper end.
    pub to: f64,
    /// Values at which a dashed line crosses the panel; on x axes.
    pub marked: Vec<f64>,
    /// Whether equal factors are equally long, instead of equal differences.
    pub(super) logarithmic: bool,
}

impl Axis {
    /// An axis of `label` in `unit` from `from` to `to`.
    pub fn new(label: impl Into<String>, unit: impl Into<String>, from: f64, to: f64) -> Self {
        Self { label: label.into(), unit: unit.into(), from, to, marked: Vec::new(), logarithmic: false }
    }

    /// An axis on which equal factors are equally long. Both ends must be positive, else it is an ordinary one.
    pub fn logarithmic(label: impl Into<String>, unit: impl Into<String>, from: f64, to: f64) -> Self {
        Self { logarithmic: from > 0.0 && to > 0.0, ..Self::new(label, unit, from, to) }
    }

    /// The axis with these values marked.
    pub fn with_marks(self, values: impl IntoIterator<Item = f64>) -> Self {
        Self { marked: values.into_iter().collect(), ..self }
    }

    /// An axis that holds all finite `values`, with a little room at both ends.
    pub fn around(
        label: impl Into<String>,
        unit: impl Into<String>,
        values: impl IntoIterator<Item = f64>,
    ) -> Self {
        let extent = |(from, to): (f64, f64), v: f64| {
            if v.is_finite() { (from.min(v), to.max(v)) } else { (from, to) }
        };
        let (from, to) = values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), extent);
        let room = (to - from) * 0.03;
        Self::new(label, unit, from - room, to + room)
    }

    /// The axis, or one unit around it where its ends are the same or no numbers.
    pub(super) fn sound(&self) -> Self {
        let Self { from, to, .. } = *self;
        let (from, to) = match (from.is_finite(), to.is_finite()) {
            (true, true) if from != to => (from, to),
            (true, true) => (from - 0.5, from + 0.5),
            _ => (0.0, 1.0),
        };
        Self { from, to, ..self.clone() }
    }

    /// Label and unit, as `range (m)`.
    pub(super) fn title(&self) -> String {
        if self.unit.is_empty() { self.label.clone() } else { format!("{} ({})", self.label, self.unit) }
    }

    /// Where `value` lies, 0 at the start of the axis and 1 at its end.
    pub(super) fn place(&self, value: f64) -> f64 {
        if self.logarithmic {
            // What is not positive lies off the axis; what is no number stays none.
            let least = self.from.min(self.to) * 1e-3;
            let value = if value < least { least } else { value };
            return (value / self.from).ln() / (self.to / self.from).ln();
        }
        (value - self.from) / (self.to - self.from)
    }

    /// Round values along the axis with their labels, at most about `most`; steps are 1, 2 or 5 times a power of ten, and so
    /// are the values on a logarithmic axis.
    pub(super) fn ticks(&self, most: i32) -> Vec<(f64, String)> {
        let (low, high) = (self.from.min(self.to), self.from.max(self.to));
        if self.logarithmic {
            return decades(low, high, most);
        }
        let rough = (high - low) / f64::from(most.max(1));
        let power = 10_f64.powf(rough.log10().floor());
        let steps = [0.5, 1.0, 2.0, 5.0, 10.0].map(|m| m * power);
        let wanted = steps.iter().position(|&step| step >= rough * 0.999).unwrap_or(steps.len() - 1);
        // One tick tells no scale; then the next finer step has more.
        let several = (high / steps[wanted]).floor() > (low / steps[wanted]).ceil();
        let step = steps[if several { wanted } else { wanted.saturating_sub(1) }];
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
        if !(last - first).is_finite() || last - first > 1_000.0 {
            return Vec::new();
        }
        let count = (last - first).max(-1.0) as i64 + 1;
        let tick = |n: i64| {
            let value = (first + n as f64) * step;
            // Not "-0".
            let value = if value.abs() < step / 2.0 { 0.0 } else { value };
            (value, label(value, decimals))
        };
        (0..count).map(tick).collect()
    }
}

/// 1, 2 and 5 times each power of ten from `low` to `high`, or 1 alone, or every few powers where `most` are fewer.
fn decades(low: f64, high: f64, most: i32) -> Vec<(f64, String)> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let values = |factors: &'static [f64], step: usize| {
        let powers = (first..=last).step_by(step);
        let all = powers.flat_map(move |power| factors.iter().map(move |f| (f * 10_f64.powi(power), power)));
        let inside = all.filter(move |&(v, _)| v >= low * 0.999_999 && v <= high * 1.000_001);
        inside.map(|(v, power)| (v, label(v, (-power).max(0) as usize))).collect::<Vec<_>>()
    };
    let choices = [(&[1.0, 2.0, 5.0][..], 1), (&[1.0, 3.0], 1), (&[1.0], 1), (&[1.0], 2), (&[1.0], 4)];
    let mut ticks = Vec::new();
    for (factors, step) in choices {
        ticks = values(factors, step);
        if ticks.len() as i32 <= most.max(2) {
            break;
        }
    }
    ticks
}

/// A tick's label: plain for usual sizes, with a power of ten for others.
fn label(value: f64, decimals: usize) -> String {
    if decimals > 4 || value.abs() >= 1e6 {
        return format!("{value:.2e}");
    }
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}

/// Which sides of a panel are drawn; the others are those of its neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sides {
    /// Labels of the y axis.
    pub(super) y: bool,
    /// The colour bar.
    pub(super) bar: bool,
}

impl Sides {
    pub(super) const ALL: Self = Self { y: true, bar: true };

    /// What a panel with a colour bar keeps of `area`.
    pub(super) fn inside(self, area: Area) -> Area {
        let margin = |shown| if shown { MARGIN } else { 0 };
        area.inside(margin(self.y), MARGIN, margin(self.bar), MARGIN / 2)
    }
}

/// The axes around a rectangle.
pub(super) struct Frame {
    /// The rectangle in which values are drawn.
    pub(super) plot: Area,
    pub(super) x: Axis,
    pub(super) y: Axis,
    x_ticks: Vec<(f64, String)>,
    y_ticks: Vec<(f64, String)>,
    sides: Sides,
    /// Where the y axis' title is.
    y_title: f64,
}

impl Frame {
    /// Puts axes into `area`, so that the labels of both just fit.
    pub(super) fn new(
        canvas: &Canvas,
        area: Area,
        (x, y): (&Axis, &Axis),
        sides: Sides,
    ) -> Result<Self, Trouble> {
        let (x, y) = (x.sound(), y.sound());
        let height = area.inside(0, 0, 0, BELOW).height;
        let y_ticks = y.ticks(height / 44);
        let mut widest = LEAST_LABEL;
        for (_, label) in &y_ticks {
            widest = widest.max(canvas.text_width(label, TICK_LETTERS)?);
        }
        let left = if sides.y { LABEL_LETTERS as i32 + 10 + widest + GAP + TICK } else { 0 };
        // Half a label may reach over the right end.
        let plot = area.inside(left, 0, 14, BELOW);
        let mut most = plot.width / 50;
        let x_ticks = loop {
            let ticks = x.ticks(most);
            let mut needed = 0;
            for (_, label) in &ticks {
                needed += canvas.text_width(label, TICK_LETTERS)? + 16;
            }
            if needed <= plot.width || most <= 2 {
                break ticks;
            }
            most -= 1;
        };
        // Beside neighbours, labels keep to their own panel.
        let mut own_ticks = Vec::new();
        for (value, label) in x_ticks {
            let half = f64::from(canvas.text_width(&label, TICK_LETTERS)?) / 2.0;
            let column = x.place(value) * f64::from(plot.width);
            if sides == Sides::ALL || (half..=f64::from(plot.width) - half).contains(&column) {
                own_ticks.push((value, label));
            }
        }
        let x_ticks = own_ticks;
        let y_title = f64::from(area.left) + LABEL_LETTERS / 2.0 + 2.0;
        Ok(Self { plot, x, y, x_ticks, y_ticks, sides, y_title })
    }

    /// Column of an x value.
    pub(super) fn column(&self, value: f64) -> f64 {
        f64::from(self.plot.left) + self.x.place(value) * f64::from(self.plot.width)
    }

    /// Row of a y value.
    pub(super) fn row(&self, value: f64) -> f64 {
        f64::from(self.plot.bottom()) - self.y.place(value) * f64::from(self.plot.height)
    }

    /// Draws grid lines at the ticks.
    pub(super) fn draw_grid(&self, canvas: &mut Canvas) -> Drawn {
        let Area { left, top, .. } = self.plot;
        let (right, bottom) = (f64::from(self.plot.right()), f64::from(self.plot.bottom()));
        for (value, _) in &self.x_ticks {
            let column = self.column(*value);
            canvas.line(&[(column, f64::from(top)), (column, bottom)], GRID, 1)?;
        }
        for (value, _) in &self.y_ticks {
            let row = self.row(*value);
            canvas.line(&[(f64::from(left), row), (right, row)], GRID, 1)?;
        }
        Ok(())
    }

    /// Draws the frame, its ticks, their labels and the axes' titles.
    pub(super) fn draw(&self, canvas: &mut Canvas) -> Drawn {
        canvas.frame(self.plot, FRAME)?;
        self.draw_marks(canvas)?;
        let (left, bottom) = (f64::from(self.plot.left), f64::from(self.plot.bottom()));
        let (tick, gap) = (f64::from(TICK), f64::from(TICK + GAP));
        for (value, label) in &self.x_ticks {
            let column = self.column(*value);
            canvas.line(&[(column, bottom), (column, bottom + tick)], FRAME, 1)?;
            let below = bottom + gap + TICK_LETTERS / 2.0 - 3.0;
            canvas.text(label, TICK_LETTERS, (column, below), Anchor::Middle, INK)?;
        }
        for (value, label) in &self.y_ticks {
            let row = self.row(*value);
            canvas.line(&[(left - tick, row), (left, row)], FRAME, 1)?;
            if !self.sides.y {
                continue;
            }
            canvas.text(label, TICK_LETTERS, (left - gap, row), Anchor::Right, INK)?;
        }
        let (middle_x, middle_y) = self.plot.middle();
        let below = bottom + gap + TICK_LETTERS + LABEL_LETTERS / 2.0 + 3.0;
        let title = canvas.shortened(&self.x.title(), LABEL_LETTERS, self.plot.width)?;
        canvas.text(&title, LABEL_LETTERS, (middle_x, below), Anchor::Middle, INK)?;
        if self.sides.y {
            let title = canvas.shortened(&self.y.title(), LABEL_LETTERS, self.plot.height)?;
            canvas.text(&title, LABEL_LETTERS, (self.y_title, middle_y), Anchor::MiddleUpwards, INK)?;
        }
        Ok(())
    }

    /// Dashes across the panel, dark and light in turn, so that they show on any ground.
    fn draw_marks(&self, canvas: &mut Canvas) -> Drawn {
        let (top, bottom) = (self.plot.top, self.plot.bottom());
        let inside = |v: &&f64| (0.0..=1.0).contains(&self.x.place(**v));
        for &value in self.x.marked.iter().filter(inside) {
            let column = self.column(value);
            for (number, from) in (top..bottom).step_by(DASH).enumerate() {
                let colour = if number % 2 == 0 { INK } else { [255; 3] };
                let to = (from + DASH as i32).min(bottom);
                canvas.line(&[(column, f64::from(from)), (column, f64::from(to))], colour, 2)?;
            }
        }
        Ok(())
    }
}

/// Room of a panel's title, pixels.
pub(super) fn title_room(title: &str) -> i32 {
    if title.is_empty() { 0 } else { TITLE_LETTERS as i32 + 10 }
}

/// Draws a panel's title over `plot`.
pub(super) fn draw_title(canvas: &mut Canvas, title: &str, area: Area, plot: Area) -> Drawn {
    if title.is_empty() {
        return Ok(());
    }
    let width = area.right() - plot.left;
    let title = canvas.shortened(title, TITLE_LETTERS, width)?;
    let row = f64::from(area.top) + TITLE_LETTERS / 2.0;
    canvas.text(&title, TITLE_LETTERS, (f64::from(plot.left), row), Anchor::Left, INK)
}
