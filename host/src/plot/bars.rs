//! Groups of bars: in, a value for each group and series, with or without intervals and reference values; out, a panel
//! of hatched bars with their values written above.

use super::axis::Axis;
use super::canvas::{Anchor, Area, Canvas, Drawn, FRAME, Hatch, INK, Marker, Trouble, WHITE, Weave};
use super::colour;
use super::frame::{Frame, GAP, MARGIN, Sides, TICK_LETTERS};
use super::legend::{Entry, Legend, Sign};

/// Share of a group's width that its bars take, and of a bar's that is drawn.
const GROUP: f64 = 0.8;
const BAR: f64 = 0.9;
/// Widest bar, pixels.
const WIDEST: f64 = 72.0;
/// Half length of the caps of whiskers, pixels.
const CAP: f64 = 4.0;
/// From the middle of a reference's marker to its edge, pixels.
const REFERENCE: f64 = 5.0;
/// Height of the letters of values where they are narrow, pixels.
const SMALL_LETTERS: f64 = 13.0;
/// Between a value and what is under it, and between two values side by side, pixels.
const ABOVE: f64 = 4.0;
const BESIDE: f64 = 8.0;
/// How often the axis is lengthened at most, and by how many pixels at least: its end stays apart from the last tick.
const ROUNDS: usize = 5;
const ROOM: f64 = 8.0;
/// Height of a line of a group's name, pixels.
const NAME_ROW: f64 = 18.0;
/// Stripes of series in turn: with the colours' lightness, they keep series apart in grey.
const WEAVES: [Weave; 6] =
    [Weave::Plain, Weave::Rising, Weave::Crossed, Weave::Level, Weave::Falling, Weave::Upright];

/// A bar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BarValue {
    /// Its value in the unit of the y axis; one that is no number has no bar.
    pub value: f64,
    /// Lower and upper end of an interval around it: a whisker.
    pub interval: Option<(f64, f64)>,
    /// A value to compare it with: a hollow marker.
    pub reference: Option<f64>,
}

impl BarValue {
    /// A bar alone.
    pub fn new(value: f64) -> Self {
        Self { value, interval: None, reference: None }
    }

    /// The bar with an interval.
    pub fn with_interval(self, low: f64, high: f64) -> Self {
        Self { interval: Some((low, high)), ..self }
    }

    /// The bar with a value to compare it with.
    pub fn with_reference(self, value: f64) -> Self {
        Self { reference: Some(value), ..self }
    }
}

/// A bar in each group.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BarSeries {
    /// Name in the legend; series without one are not in it.
    pub name: String,
    /// Its bar in each group; the last groups have none if there are fewer.
    pub bars: Vec<BarValue>,
}

/// Groups of bars.
///
/// ```
/// use rfhoi::plot::{Axis, BarSeries, BarValue, Bars, Figure, Panel};
///
/// let bars = Bars {
///     title: "Unseen people".into(),
///     groups: vec!["fusion".into(), "radar alone".into()],
///     y: Axis::new("macro F1", "%", 0.0, 100.0),
///     series: vec![BarSeries {
///         name: "float".into(),
///         bars: vec![
///             BarValue::new(93.4).with_interval(91.9, 94.6).with_reference(95.1),
///             BarValue::new(64.0).with_interval(61.0, 66.4),
///         ],
///     }],
///     decimals: 1,
///     reference: "paper's figure".into(),
/// };
/// let figure = Figure::new(vec![Panel::Bars(bars)]);
/// # let directory = tempfile::tempdir().unwrap();
/// # figure.save(directory.path().join("bars.svg"))?;
/// # Ok::<(), rfhoi::plot::PlotError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Bars {
    /// Title of the panel.
    pub title: String,
    /// Names of the groups, from left to right.
    pub groups: Vec<String>,
    /// Axis of the values. Bars begin at zero, or at the end of the axis that is nearest to it; it is lengthened where
    /// what is written beyond bars needs room.
    pub y: Axis,
    /// The bars, side by side in each group.
    pub series: Vec<BarSeries>,
    /// Decimals of the values that are written above the bars.
    pub decimals: usize,
    /// Name of the reference values in the legend.
    pub reference: String,
}

/// How values are written: height of their letters, pixels, and whether they run upwards.
type Writing = (f64, bool);

impl Bars {
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area, sides: Sides) -> Drawn {
        let area = area.inside(if sides.y { MARGIN } else { 0 }, MARGIN, MARGIN, MARGIN / 2);
        let series = self
            .series
            .iter()
            .enumerate()
            .map(|(n, s)| Entry { name: &s.name, sign: Sign::Swatch(hatch(n), colour::of_series(n)) });
        let compared = self.series.iter().flat_map(|s| &s.bars).any(|b| b.reference.is_some());
        let sign = Sign::Marker(Marker::Diamond, true, REFERENCE, INK);
        let reference = compared.then_some(Entry { name: &self.reference, sign });
        let legend = Legend::new(canvas, series.chain(reference), area.width)?;
        let (frame, writing) = self.frame(canvas, area, &legend, sides)?;
        frame.draw_head(canvas, area, &self.title, &legend)?;
        frame.draw_grid(canvas)?;
        self.draw_bars(canvas, &frame, writing)?;
        self.draw_names(canvas, &frame)?;
        frame.draw(canvas)
    }

    /// The axes, that of the values lengthened so that there is room for what is written beyond bars, and how it is.
    fn frame(
        &self,
        canvas: &Canvas,
        area: Area,
        legend: &Legend<'_>,
        sides: Sides,
    ) -> Result<(Frame, Option<Writing>), Trouble> {
        let x = Axis::new("", "", 0.0, self.groups.len().max(1) as f64);
        let mut y = self.y.sound();
        y.ticked = Some((y.from, y.to));
        let mut round = 0;
        loop {
            let frame = Frame::under(canvas, area, legend, (&x, &y), sides)?.without_x_ticks();
            let writing = self.writing(canvas, self.pitch(&frame))?;
            let (mut above, mut below) = (0.0_f64, 0.0_f64);
            for bar in self.series.iter().flat_map(|s| s.bars.iter().take(self.groups.len())) {
                if let Some((row, half)) =
                    writing.map_or(Ok(None), |w| self.value_row(canvas, &frame, bar, w))?
                {
                    above = above.max(f64::from(frame.plot.top) + half + 1.0 - row);
                    below = below.max(row + half + 1.0 - f64::from(frame.plot.bottom()));
                }
            }
            round += 1;
            // Bars beyond the axis would need more room in each round.
            if above + below < 0.5 || round == ROUNDS || y.logarithmic {
                return Ok((frame, writing));
            }
            let pixel = (y.to - y.from) / f64::from(frame.plot.height);
            // The longer the axis, the shorter a unit of it, so that a little more is needed.
            let room = |needed: f64| if needed > 0.0 { 1.1 * needed.max(ROOM) * pixel } else { 0.0 };
            y.to += room(above);
            y.from -= room(below);
        }
    }

    /// From the middle of a bar to that of the next, pixels.
    fn pitch(&self, frame: &Frame) -> f64 {
        let group = f64::from(frame.plot.width) / self.groups.len().max(1) as f64;
        (group * GROUP / self.series.len().max(1) as f64).min(WIDEST / BAR)
    }

    fn draw_bars(&self, canvas: &mut Canvas, frame: &Frame, writing: Option<Writing>) -> Drawn {
        let pitch = self.pitch(frame);
        // All bars first, so that none covers its neighbour's whisker or value.
        let mut all = Vec::new();
        for (number, series) in self.series.iter().enumerate() {
            let beside = number as f64 - (self.series.len() as f64 - 1.0) / 2.0;
            for (place, bar) in series.bars.iter().take(self.groups.len()).enumerate() {
                let column = frame.column(place as f64 + 0.5) + beside * pitch;
                all.push((column, bar));
                draw_bar(canvas, frame, (column, pitch * BAR), bar.value, number)?;
            }
        }
        for &(column, bar) in &all {
            if let Some(interval) = bar.interval {
                frame.draw_whisker(canvas, column, interval, (CAP, INK))?;
            }
            if let Some(value) = bar.reference.filter(|v| (0.0..=1.0).contains(&frame.y.place(*v))) {
                canvas.point(Marker::Diamond, true, (column, frame.row(value)), REFERENCE, INK)?;
            }
        }
        let Some(writing) = writing else { return Ok(()) };
        let anchor = if writing.1 { Anchor::MiddleUpwards } else { Anchor::Middle };
        for (column, bar) in all {
            if let Some((row, half)) = self.value_row(canvas, frame, bar, writing)? {
                let (top, bottom) = (f64::from(frame.plot.top), f64::from(frame.plot.bottom()));
                let row = row.min(bottom - half - 1.0).max(top + half + 1.0);
                canvas.label(&self.written(bar.value), writing.0, (column, row), anchor, false)?;
            }
        }
        Ok(())
    }

    /// How values fit over bars `pitch` pixels apart; `None` if not at all.
    fn writing(&self, canvas: &Canvas, pitch: f64) -> Result<Option<Writing>, Trouble> {
        for letters in [TICK_LETTERS, SMALL_LETTERS] {
            let mut widest = 0;
            for bar in self.series.iter().flat_map(|s| &s.bars).filter(|b| b.value.is_finite()) {
                widest = widest.max(canvas.text_width(&self.written(bar.value), letters)?);
            }
            if f64::from(widest) + BESIDE <= pitch {
                return Ok(Some((letters, false)));
            }
        }
        Ok((pitch >= SMALL_LETTERS).then_some((SMALL_LETTERS, true)))
    }

    fn written(&self, value: f64) -> String {
        let least = 0.5 * 0.1_f64.powi(i32::try_from(self.decimals).unwrap_or(i32::MAX));
        // Not "-0.0".
        let value = if value.abs() < least { 0.0 } else { value };
        format!("{value:.*}", self.decimals).replace('-', "\u{2212}")
    }

    /// Row of the middle of a bar's value and half its height: beyond all that is drawn of the bar; none without a bar.
    fn value_row(
        &self,
        canvas: &Canvas,
        frame: &Frame,
        bar: &BarValue,
        (letters, upwards): Writing,
    ) -> Result<Option<(f64, f64)>, Trouble> {
        let place = frame.y.place(bar.value);
        if !bar.value.is_finite() || place.is_nan() {
            return Ok(None);
        }
        let width = canvas.text_width(&self.written(bar.value), letters)?;
        let half = if upwards { f64::from(width) } else { letters } / 2.0;
        // For bars that run down, rows are counted the other way.
        let sign = if place >= frame.y.place(0.0) { 1.0 } else { -1.0 };
        let mut row = sign * frame.pixel((0.0, place.clamp(0.0, 1.0))).1;
        if let Some(ends) = bar.interval.and_then(|i| frame.rows_of(i)) {
            row = ends.iter().map(|(end, _)| sign * end).fold(row, f64::min);
        }
        row -= ABOVE + half;
        if let Some(marker) = bar.reference.map(|v| sign * frame.row(v)) {
            let clear = half + 1.3 * REFERENCE;
            if (marker - row).abs() < clear {
                row = marker - clear - 1.0;
            }
        }
        Ok(Some((sign * row, half)))
    }

    /// Writes the groups' names under the axis, on two lines where one is too short.
    fn draw_names(&self, canvas: &mut Canvas, frame: &Frame) -> Drawn {
        let room = frame.plot.width / self.groups.len().max(1) as i32 - 8;
        let first = f64::from(frame.plot.bottom() + GAP) + TICK_LETTERS / 2.0;
        for (number, name) in self.groups.iter().enumerate() {
            let column = frame.column(number as f64 + 0.5);
            for (line, text) in folded(canvas, name, room)?.iter().enumerate() {
                let at = (column, first + line as f64 * NAME_ROW);
                canvas.text(text, TICK_LETTERS, at, Anchor::Middle, INK)?;
            }
        }
        Ok(())
    }
}

fn hatch(number: usize) -> Hatch {
    let weave = WEAVES[number % WEAVES.len()];
    Hatch { weave, stripe: WHITE, ground: colour::of_series(number), period: 8, width: 2 }
}

fn draw_bar(
    canvas: &mut Canvas,
    frame: &Frame,
    (column, width): (f64, f64),
    value: f64,
    number: usize,
) -> Drawn {
    let place = frame.y.place(value);
    if place.is_nan() {
        return Ok(());
    }
    let row = |place: f64| frame.pixel((0.0, place.clamp(0.0, 1.0))).1.round() as i32;
    let (end, start) = (row(place), row(frame.y.place(0.0)));
    let (left, right) = ((column - width / 2.0).round() as i32, (column + width / 2.0).round() as i32);
    let area = Area { left, top: end.min(start), width: (right - left).max(1), height: (end - start).abs() };
    if area.height > 0 {
        canvas.hatch(area, &hatch(number));
        canvas.frame(area, colour::of_series(number))?;
    }
    // The line from which bars rise shows also under those of no height.
    let (from, to) = (f64::from(area.left), f64::from(area.right()));
    canvas.line(&[(from, f64::from(start)), (to, f64::from(start))], FRAME, 1)
}

/// `name` in one line, or in two that are about as long, cut where they are wider than `room`.
fn folded(canvas: &Canvas, name: &str, room: i32) -> Result<Vec<String>, Trouble> {
    let width = |text: &str| canvas.text_width(text, TICK_LETTERS);
    if width(name)? <= room {
        return Ok(vec![name.to_owned()]);
    }
    let mut best: Option<(i32, [&str; 2])> = None;
    for (at, _) in name.match_indices(' ') {
        let lines = [&name[..at], &name[at + 1..]];
        let widest = width(lines[0])?.max(width(lines[1])?);
        if best.is_none_or(|(least, _)| widest < least) {
            best = Some((widest, lines));
        }
    }
    let lines = best.map_or(vec![name], |(_, lines)| lines.to_vec());
    lines.into_iter().map(|line| canvas.shortened(line, TICK_LETTERS, room)).collect()
}
