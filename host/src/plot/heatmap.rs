//! Values over two axes: in, a map; out, a panel of coloured pixels with a colour bar. It has no form of vectors.

use ndarray::{Array2, ArrayView2, Slice};

use super::axis::Axis;
use super::bar::{Bar, ColourScale};
use super::canvas::{Anchor, Area, Canvas, Drawn, FRAME, Hatch, INK, WHITE, Weave};
use super::colour;
use super::frame::{Frame, Sides, TICK_LETTERS, draw_title, title_room};

/// Width of the swatch that explains the hatching.
const SWATCH: i32 = 26;
/// Hatching of missing values.
const MISSING: Hatch =
    Hatch { weave: Weave::Rising, stripe: [176; 3], ground: [236; 3], period: 7, width: 2 };

/// How cells that share a pixel become one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Reduce {
    /// The largest: keeps targets of one cell. For powers and magnitudes.
    #[default]
    Max,
    /// The mean: keeps the level of noise.
    Mean,
}

/// A map: values over two axes.
#[derive(Debug, Clone)]
pub struct Heatmap {
    /// Title of the panel.
    pub title: String,
    /// Values, shape (rows, columns): row 0 at the lower end of `y`, column 0 at the left end of `x`. Not-a-number is
    /// missing and hatched.
    pub values: Array2<f32>,
    /// Axis of the columns; its ends are the outer edges of the first and last column.
    pub x: Axis,
    /// Axis of the rows; its ends are the outer edges of the first and last row.
    pub y: Axis,
    /// What the colours mean.
    pub scale: ColourScale,
    /// How cells that share a pixel become one value.
    pub reduce: Reduce,
}

impl Heatmap {
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area, sides: Sides) -> Drawn {
        let area = sides.inside(area);
        let scale = self.scale.axis(self.values.iter().copied());
        let title = title_room(&self.title);
        let bar = if sides.bar { Some(Bar::new(canvas, scale.clone(), area.height - title)?) } else { None };
        let room = bar.as_ref().map_or(0, Bar::width);
        let frame = Frame::new(canvas, area.inside(0, title, room, 0), (&self.x, &self.y), sides)?;
        let plot = frame.plot;
        draw_title(canvas, &self.title, area, plot)?;

        let cells = reduced(self.values.view(), plot.height as usize, plot.width as usize, self.reduce);
        let (rows, columns) = cells.dim();
        let cell_of = |pixel: i32, pixels: i32, cells: usize| {
            (pixel as usize * cells / pixels.max(1) as usize).min(cells - 1)
        };
        if rows == 0 || columns == 0 {
            canvas.hatch(plot, &MISSING);
        } else {
            canvas.paint(plot, |x, y| {
                let row = cell_of(plot.height - 1 - y, plot.height, rows);
                let value = cells[(row, cell_of(x, plot.width, columns))];
                if value.is_nan() {
                    MISSING.colour(x, y)
                } else {
                    colour::of_value(scale.place(f64::from(value)))
                }
            })?;
        }
        frame.draw(canvas)?;
        if let Some(bar) = bar {
            bar.draw(canvas, area, plot, colour::of_value)?;
        }
        // There is room for it beside a title only.
        if title > 0 { self.draw_missing(canvas, area) } else { Ok(()) }
    }

    /// Explains the hatching, if there is any.
    fn draw_missing(&self, canvas: &mut Canvas, area: Area) -> Drawn {
        if self.values.iter().any(|v| v.is_nan()) {
            let text = "missing";
            let width = canvas.text_width(text, TICK_LETTERS)?;
            let top = area.top + 3;
            let swatch = Area { left: area.right() - width - SWATCH - 8, top, width: SWATCH, height: 14 };
            // The title may have come this far.
            canvas.fill(
                Area {
                    left: swatch.left - 12,
                    width: area.right() - swatch.left + 12,
                    top: area.top - 2,
                    height: 24,
                },
                WHITE,
            );
            canvas.hatch(swatch, &MISSING);
            canvas.frame(swatch, FRAME)?;
            let at = (f64::from(swatch.right() + 8), f64::from(top) + 7.0);
            canvas.text(text, TICK_LETTERS, at, Anchor::Left, INK)?;
        }
        Ok(())
    }
}

/// `values` with at most `rows` x `columns` cells, each made of all the values that fall into it. Missing values count
/// only where they are the half of a cell or more.
fn reduced(values: ArrayView2<'_, f32>, rows: usize, columns: usize, reduce: Reduce) -> Array2<f32> {
    let (have_rows, have_columns) = values.dim();
    let (rows, columns) = (rows.min(have_rows), columns.min(have_columns));
    let part = |n: usize, have: usize, want: usize| Slice::from(n * have / want..(n + 1) * have / want);
    Array2::from_shape_fn((rows, columns), |(row, column)| {
        let cell = values.slice_each_axis(|axis| match axis.axis.index() {
            0 => part(row, have_rows, rows),
            _ => part(column, have_columns, columns),
        });
        let present = || cell.iter().copied().filter(|v| !v.is_nan());
        let count = present().count();
        if 2 * count <= cell.len() && count < cell.len() {
            return f32::NAN;
        }
        match reduce {
            Reduce::Max => present().fold(f32::NEG_INFINITY, f32::max),
            Reduce::Mean => (present().map(f64::from).sum::<f64>() / count as f64) as f32,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_of_one_cell_survives_any_reduction_by_maximum() {
        let mut values = Array2::zeros((1_000, 777));
        for (row, column) in [(0, 0), (999, 776), (501, 333)] {
            values.fill(0.0);
            values[(row, column)] = 7.0;
            let small = reduced(values.view(), 300, 100, Reduce::Max);
            assert_eq!(small.dim(), (300, 100));
            assert_eq!(small.iter().filter(|&&v| v == 7.0).count(), 1);
        }
    }

    #[test]
    fn mean_keeps_the_level() {
        let values = Array2::from_shape_fn((640, 480), |(r, c)| (r % 2 + c % 2) as f32);
        let small = reduced(values.view(), 64, 48, Reduce::Mean);
        assert!(small.iter().all(|v| (v - 1.0).abs() < 1e-6));
    }

    #[test]
    fn missing_values_show_where_they_are_the_half_of_a_cell() {
        let mut values = Array2::zeros((1, 8));
        values[(0, 0)] = f32::NAN;
        values[(0, 4)] = f32::NAN;
        values[(0, 5)] = f32::NAN;
        let small = reduced(values.view(), 1, 2, Reduce::Max);
        assert!(!small[(0, 0)].is_nan() && small[(0, 1)].is_nan());
    }

    #[test]
    fn small_maps_stay_as_they_are() {
        let values = Array2::from_shape_fn((3, 2), |(r, c)| (10 * r + c) as f32);
        assert_eq!(reduced(values.view(), 400, 400, Reduce::Mean), values);
    }
}
