//! What colours mean: a scale of values, and the bar that shows it.

use super::axis::Axis;
use super::canvas::{Anchor, Area, Canvas, Drawn, FRAME, INK, Rgb, Trouble};
use super::frame::{LABEL_LETTERS, TICK_LETTERS};

/// Width of the bar, and from the panel to it, pixels.
const BAR: i32 = 18;
const GAP: i32 = 12;
/// From the bar to its labels, pixels.
const LABEL: i32 = 9;

/// What the colours mean.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourScale {
    /// What is shown.
    pub label: String,
    /// Its unit; empty for a bare number.
    pub unit: String,
    /// Values of the darkest and the lightest colour; those of the map if `None`.
    pub range: Option<(f32, f32)>,
}

impl ColourScale {
    /// A scale over the values of the map.
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), unit: unit.into(), range: None }
    }

    /// A scale from `from` to `to`.
    pub fn with_range(self, from: f32, to: f32) -> Self {
        Self { range: Some((from, to)), ..self }
    }

    /// The scale as an axis; `values` are those that it must hold if it has no range.
    pub(super) fn axis(&self, values: impl Iterator<Item = f32>) -> Axis {
        let extent = |(from, to): (f32, f32), v: f32| {
            if v.is_finite() { (from.min(v), to.max(v)) } else { (from, to) }
        };
        let whole = || values.fold((f32::INFINITY, f32::NEG_INFINITY), extent);
        let (from, to) = self.range.unwrap_or_else(whole);
        Axis::new(&*self.label, &*self.unit, from.into(), to.into()).sound()
    }
}

/// A bar to the right of a panel.
pub(super) struct Bar {
    scale: Axis,
    ticks: Vec<(f64, String)>,
    width: i32,
}

impl Bar {
    /// A bar of `scale` about `height` pixels high.
    pub(super) fn new(canvas: &Canvas, scale: Axis, height: i32) -> Result<Self, Trouble> {
        let ticks = scale.ticks(height / 60);
        let mut widest = 0;
        for (_, label) in &ticks {
            widest = widest.max(canvas.text_width(label, TICK_LETTERS)?);
        }
        let width = GAP + BAR + LABEL + widest + LABEL_LETTERS as i32 - 5;
        Ok(Self { scale, ticks, width })
    }

    /// Room that it takes to the right of a panel's frame, pixels.
    pub(super) fn width(&self) -> i32 {
        self.width
    }

    /// Draws it beside `plot`, up to the right side of `area`; `colour` has that of a value from 0 to 1.
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area, plot: Area, colour: fn(f64) -> Rgb) -> Drawn {
        let bar = Area { left: plot.right() + GAP, width: BAR, ..plot };
        canvas.ramp(bar, colour);
        canvas.frame(bar, FRAME)?;
        let edge = f64::from(bar.right());
        for (value, label) in &self.ticks {
            let row = f64::from(bar.bottom()) - self.scale.place(*value) * f64::from(bar.height);
            canvas.line(&[(edge, row), (edge + 4.0, row)], FRAME, 1)?;
            canvas.text(label, TICK_LETTERS, (edge + f64::from(LABEL), row), Anchor::Left, INK)?;
        }
        let title = canvas.shortened(&self.scale.title(), LABEL_LETTERS, plot.height)?;
        let right = f64::from(area.right()) - LABEL_LETTERS / 2.0 + 2.0;
        canvas.text(&title, LABEL_LETTERS, (right, plot.middle().1), Anchor::MiddleUpwards, INK)
    }
}
