//! Pictures of maps, of series, of results and of scenes, as PNG, SVG and GIF files.
//!
//! In: a [`Figure`] of panels in a grid. Out: a PNG or SVG file that appears whole, or an animated GIF of several figures
//! ([`save_film`]). Every axis and colour bar has its unit; missing values are hatched; a map with more cells than pixels
//! is reduced by maximum or mean, so that nothing is left out by chance; series differ in more than colour where they are
//! printed. Fonts come with the program, so that PNG files look the same everywhere; in SVG files text stays text, fitted
//! to the room it has, and they have no [`Heatmap`].
//!
//! Panels:
//!
//! - [`Heatmap`]: values over two axes, with a colour bar.
//! - [`Lines`]: series over one axis, with or without intervals.
//! - [`Bars`]: a value for each group and series, with intervals and reference values.
//! - [`Scatter`]: labelled points of a trade, as speed against accuracy, with the Pareto [`Front`].
//! - [`View`]: shapes of a scene, to scale.
//!
//! Parts: `axis` (ends and ticks), `frame` (axes on the paper), `legend`, `labels` (their places beside points), `bar`
//! (colour bars), `colour`, `canvas` (paper of pixels or vectors), `film`, and a file for each panel.

mod axis;
mod bar;
mod bars;
mod canvas;
mod colour;
mod film;
mod frame;
mod front;
mod heatmap;
mod labels;
mod legend;
mod lines;
mod scatter;
mod view;

use std::path::{Path, PathBuf};

pub use axis::Axis;
pub use bar::ColourScale;
pub use bars::{BarSeries, BarValue, Bars};
pub use canvas::Marker;
pub use film::save_film;
pub use front::{Better, Front};
pub use heatmap::{Heatmap, Reduce};
pub use lines::{Lines, Marks, Points, Series, Style};
pub use scatter::{Scatter, ScatterPoint, ScatterSeries};
pub use view::{Paint, Shape, View};

use crate::atomic::{AtomicFile, WriteError};
use canvas::{Anchor, Area, Canvas, Drawn, INK};
use frame::Sides;

/// Height of the figure's title and the size of its letters, pixels.
const TITLE: i32 = 46;
const TITLE_LETTERS: f64 = 25.0;
/// Largest width or height of a picture, pixels.
const LARGEST: u32 = 4_096;
/// Room beside a strip's panels for the labels of the first and the colour bar of the last, pixels.
const STRIP_LEFT: i32 = 96;
const STRIP_RIGHT: i32 = 92;
/// Series whose colour frames the panel that stands out.
pub const HIGHLIGHT: usize = 1;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The file.
    #[error(transparent)]
    File(#[from] WriteError),
    /// Drawing or encoding.
    #[error("cannot draw {path}: {reason}")]
    Draw {
        /// The file.
        path: PathBuf,
        /// What the drawing library said.
        reason: String,
    },
    /// No panel, or a size that cannot be drawn.
    #[error(
        "{path}: {panels} panels of {width} x {height} pixels cannot be drawn: \
         need one panel or more, each 240 x 160 or more, and a picture of at most {LARGEST} pixels either way"
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Number of panels.
        panels: usize,
        /// Width of a panel.
        width: u32,
        /// Height of a panel.
        height: u32,
    },
}

/// One picture in a figure.
#[derive(Debug, Clone)]
pub enum Panel {
    /// Values over two axes.
    Heatmap(Heatmap),
    /// Series over one axis.
    Lines(Lines),
    /// Groups of bars.
    Bars(Bars),
    /// Points of a trade.
    Scatter(Scatter),
    /// Shapes of a scene.
    View(View),
}

/// Panels in a grid.
///
/// ```
/// # let directory = tempfile::tempdir().unwrap();
/// # let path = directory.path().join("map.png");
/// use ndarray::Array2;
/// use rfhoi::plot::{Axis, ColourScale, Figure, Heatmap, Panel, Reduce};
///
/// let map = Heatmap {
///     title: "Range-Doppler, frame 7".into(),
///     values: Array2::from_shape_fn((72, 64), |(range, doppler)| (range + doppler) as f32),
///     x: Axis::new("velocity", "m/s", -4.5, 4.5),
///     y: Axis::new("range", "m", 0.0, 3.1),
///     scale: ColourScale::new("power", "dB"),
///     reduce: Reduce::Max,
/// };
/// Figure::new(vec![Panel::Heatmap(map)]).save(&path)?;
/// # Ok::<(), rfhoi::plot::PlotError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Figure {
    /// Title above all panels.
    pub title: Option<String>,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
    /// Panels in a row.
    pub columns: usize,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of each panel, pixels.
    pub panel_height: u32,
    /// Whether the panels of a row have one y axis and one colour scale, which are drawn once.
    pub strip: bool,
    /// Number of a panel that stands out, with a frame around it.
    pub highlighted: Option<usize>,
}

impl Figure {
    /// A figure 1200 pixels wide: one panel to a row, or two if there are more than one.
    pub fn new(panels: Vec<Panel>) -> Self {
        let columns = panels.len().clamp(1, 2);
        Self {
            title: None,
            panels,
            columns,
            width: 1_200,
            panel_height: if columns == 1 { 600 } else { 460 },
            strip: false,
            highlighted: None,
        }
    }

    /// Draws the figure and puts it at `path`: as pixels if that ends in `.png`, as vectors if in `.svg`.
    ///
    /// # Errors
    /// Any [`PlotError`]. A [`Heatmap`] is made of pixels and refused as vectors.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), PlotError> {
        let path = path.as_ref();
        let vectors = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg"));
        let canvas = self.canvas(path, if vectors { Canvas::of_vectors } else { Canvas::of_pixels })?;
        let file = AtomicFile::create(path)?;
        let trouble = |reason: String| PlotError::Draw { path: path.to_path_buf(), reason };
        canvas.save(file.temporary()).map_err(|e| trouble(e.to_string()))?;
        Ok(file.commit()?)
    }

    /// The figure, drawn on `paper` of a width and a height; `path` is where it is to go.
    fn canvas(&self, path: &Path, paper: fn(i32, i32) -> Canvas) -> Result<Canvas, PlotError> {
        let columns = self.columns.clamp(1, self.panels.len().max(1)) as u32;
        let rows = self.panels.len().div_ceil(columns as usize) as u32;
        let (width, height) = (self.width / columns, self.panel_height);
        let title = if self.title.is_some() { TITLE } else { 0 };
        let total = u64::from(rows) * u64::from(height) + title as u64;
        if rows == 0 || width < 240 || height < 160 || self.width > LARGEST || total > u64::from(LARGEST) {
            return Err(PlotError::Size {
                path: path.to_path_buf(),
                panels: self.panels.len(),
                width,
                height,
            });
        }
        let mut canvas = paper(self.width as i32, total as i32);
        self.draw(&mut canvas, columns as i32, title)
            .map_err(|e| PlotError::Draw { path: path.to_path_buf(), reason: e.to_string() })?;
        Ok(canvas)
    }

    fn draw(&self, canvas: &mut Canvas, columns: i32, title: i32) -> Drawn {
        if let Some(text) = &self.title {
            let text = canvas.shortened(text, TITLE_LETTERS, self.width as i32 - 40)?;
            let middle = (f64::from(self.width) / 2.0, f64::from(title) / 2.0 + 4.0);
            canvas.text(&text, TITLE_LETTERS, middle, Anchor::Middle, INK)?;
        }
        let height = self.panel_height as i32;
        for (number, panel) in (0..).zip(&self.panels) {
            let (row, column) = (number / columns, number % columns);
            let ((left, width), sides) = self.column(column, columns);
            let area = Area { left, top: title + row * height, width, height };
            match panel {
                Panel::Heatmap(map) => map.draw(canvas, area, sides)?,
                Panel::Lines(lines) => lines.draw(canvas, area, sides)?,
                Panel::Bars(bars) => bars.draw(canvas, area, sides)?,
                Panel::Scatter(scatter) => scatter.draw(canvas, area, sides)?,
                Panel::View(view) => view.draw(canvas, area, sides)?,
            }
            if self.highlighted == usize::try_from(number).ok() {
                let frame = area.inside(4, 4, 4, 4);
                canvas.outline(frame, colour::of_series(HIGHLIGHT), 3)?;
            }
        }
        Ok(())
    }

    /// Left edge and width of a column, and what is drawn at the sides of its panels.
    fn column(&self, column: i32, columns: i32) -> ((i32, i32), Sides) {
        let width = self.width as i32;
        if !self.strip {
            return ((column * (width / columns), width / columns), Sides::ALL);
        }
        let (first, last) = (column == 0, column == columns - 1);
        let each = (width - STRIP_LEFT - STRIP_RIGHT) / columns;
        let left = if first { 0 } else { STRIP_LEFT + column * each };
        let more = if first { STRIP_LEFT } else { 0 } + if last { STRIP_RIGHT } else { 0 };
        ((left, each + more), Sides { y: first, bar: last })
    }
}

#[cfg(test)]
mod tests;
