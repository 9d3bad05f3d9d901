//! The rectangle of a panel: in, its axes, title and legend; out, where values lie on the paper, with grid, ticks and
//! labels around them.

use super::axis::{Axis, digits};
use super::canvas::{Anchor, Area, Canvas, Drawn, FRAME, GRID, INK, Point, Rgb, Trouble, WHITE};
use super::legend::Legend;

/// Free space about a panel, pixels.
pub(super) const MARGIN: i32 = 14;

/// Height of the letters of tick labels and axis titles, pixels.
pub(super) const TICK_LETTERS: f64 = 16.0;
pub(super) const LABEL_LETTERS: f64 = 18.0;
/// Height of the letters of a panel's title, pixels.
pub(super) const TITLE_LETTERS: f64 = 20.0;
/// Height of the title over a legend, pixels.
const HEAD: i32 = TITLE_LETTERS as i32 + 8;
const TICK: i32 = 5;
/// Length of ticks without labels.
const SMALL_TICK: f64 = 3.0;
/// From a tick to its label, pixels.
pub(super) const GAP: i32 = 5;
/// Room for the labels of an x axis and its title.
const BELOW: i32 = TICK + GAP + (TICK_LETTERS + LABEL_LETTERS) as i32 + 12;
/// Length of the dashes of marks, pixels.
const DASH: usize = 6;
/// Least room for the labels of a y axis, so that panels above each other line up.
const LEAST_LABEL: i32 = 44;

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

    /// Puts axes into `area` under a title and a legend.
    pub(super) fn under(
        canvas: &Canvas,
        area: Area,
        legend: &Legend<'_>,
        axes: (&Axis, &Axis),
        sides: Sides,
    ) -> Result<Self, Trouble> {
        Self::new(canvas, area.inside(0, HEAD + legend.height() + 4, 0, 0), axes, sides)
    }

    /// Draws the title and the legend that it is under.
    pub(super) fn draw_head(
        &self,
        canvas: &mut Canvas,
        area: Area,
        title: &str,
        legend: &Legend<'_>,
    ) -> Drawn {
        draw_title(canvas, title, area, self.plot)?;
        legend.draw(canvas, (self.plot.left, area.top + HEAD))
    }

    /// The frame without ticks along x.
    pub(super) fn without_x_ticks(self) -> Self {
        Self { x_ticks: Vec::new(), ..self }
    }

    /// Place on the paper of a point from 0 to 1 along both axes.
    pub(super) fn pixel(&self, (x, y): Point) -> Point {
        let plot = self.plot;
        (
            f64::from(plot.left) + x * f64::from(plot.width),
            f64::from(plot.bottom()) - y * f64::from(plot.height),
        )
    }

    /// Whether a point lies within both axes; what is no number does not.
    pub(super) fn holds(&self, (x, y): Point) -> bool {
        let unit = 0.0..=1.0;
        unit.contains(&self.x.place(x)) && unit.contains(&self.y.place(y))
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

    /// Rows of the upper and the lower end of an interval of y as far as it is inside, and whether these are its ends;
    /// nothing if an end is no number or none of it is inside.
    pub(super) fn rows_of(&self, interval: (f64, f64)) -> Option<[(f64, bool); 2]> {
        let (a, b) = (self.y.place(interval.0), self.y.place(interval.1));
        let (low, high) = (a.min(b), a.max(b));
        if a.is_nan() || b.is_nan() || high < 0.0 || low > 1.0 {
            return None;
        }
        let row = |place: f64| {
            let inside = (0.0..=1.0).contains(&place);
            (self.pixel((0.0, place.clamp(0.0, 1.0))).1, inside)
        };
        Some([row(high), row(low)])
    }

    /// Draws an interval of y as a thin upright line; ends that are inside have a cap, `cap` pixels to either side.
    pub(super) fn draw_whisker(
        &self,
        canvas: &mut Canvas,
        column: f64,
        interval: (f64, f64),
        (cap, colour): (f64, Rgb),
    ) -> Drawn {
        let Some([(top, top_inside), (bottom, bottom_inside)]) = self.rows_of(interval) else {
            return Ok(());
        };
        if bottom > top {
            canvas.line(&[(column, top), (column, bottom)], colour, 1)?;
        }
        for (row, inside) in [(top, top_inside), (bottom, bottom_inside)] {
            if inside {
                canvas.line(&[(column - cap, row), (column + cap, row)], colour, 1)?;
            }
        }
        Ok(())
    }

    /// Draws ticks without labels along a logarithmic x axis.
    pub(super) fn draw_small_ticks(&self, canvas: &mut Canvas) -> Drawn {
        let bottom = f64::from(self.plot.bottom());
        for value in digits(&self.x) {
            let column = self.column(value);
            canvas.line(&[(column, bottom), (column, bottom + SMALL_TICK)], FRAME, 1)?;
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
                let colour = if number % 2 == 0 { INK } else { WHITE };
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
