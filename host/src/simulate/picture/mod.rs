//! Pictures of a simulated sample, so that someone can see what it is of.
//!
//! In: a [`Sample`], what the simulator knows of it frame by frame. Out: a figure (`sample.png`) with the scene from
//! three sides, the maps of the frame with most motion and all maps over time, and the tags' phase differences; a film strip
//! (`strip.png`) of a few moments side by side; and an animated GIF (`film.gif`) at the true frame rate.

mod maps;
mod tags;
mod views;

use std::path::{Path, PathBuf};

use glam::Vec3;
use ndarray::Array2;

use super::scene::Scene;
use crate::plot::{Figure, Panel, PlotError, save_film};
use maps::Maps;
use views::{Eye, Scope, Views};

/// Moments of the film strip.
const STRIP_MOMENTS: usize = 8;
/// What the film strip shows before and after the interaction, s.
const STRIP_AROUND_S: f64 = 0.3;

/// A sample, as it is drawn.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Title of all pictures; says that it is simulated, and what is done by whom and where.
    pub title: String,
    /// Where it happens.
    pub scene: Scene,
    /// From moment to moment, s.
    pub frame_s: f64,
    /// When the interaction begins and ends, s.
    pub interaction_s: Option<(f64, f64)>,
    /// Triangles of what moves, over the vertices of each moment; counter-clockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles of what stands at the place besides the scene's furniture, and their vertices, m.
    pub fixtures: (Vec<[u32; 3]>, Vec<Vec3>),
    /// Tagged things.
    pub things: Vec<Thing>,
    /// What the maps' rows and columns are.
    pub axes: MapAxes,
    /// The radar's frames; all maps of a kind have one shape.
    pub moments: Vec<Moment>,
    /// Phase differences, by thing and antenna.
    pub differences: Vec<Differences>,
}

/// A tagged thing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Thing {
    /// What it is called.
    pub name: String,
    /// Whether the interaction is with it.
    pub target: bool,
}

/// Outer edges of the maps' first and last rows and columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapAxes {
    /// Range, m.
    pub range_m: (f64, f64),
    /// Radial velocity, positive recedes, m/s.
    pub velocity_m_s: (f64, f64),
    /// Azimuth, to the right, degrees.
    pub azimuth_deg: (f64, f64),
    /// Elevation, upwards, degrees.
    pub elevation_deg: (f64, f64),
}

/// What is there, and what the radar makes of it, in one frame.
#[derive(Debug, Clone)]
pub struct Moment {
    /// Vertices of what moves, m.
    pub vertices: Vec<Vec3>,
    /// Where each thing's tag is, m.
    pub things: Vec<Vec3>,
    /// Ways of the radar's signal that are to be drawn.
    pub paths: Vec<SignalPath>,
    /// Levels by range and Doppler, dB.
    pub range_doppler: Array2<f32>,
    /// Levels by range and time within the frame, dB.
    pub range_time: Array2<f32>,
    /// Levels by elevation and azimuth, dB.
    pub angles: Array2<f32>,
}

/// A way from the radar to a scatterer and back.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalPath {
    /// Where it begins, turns and ends, m.
    pub points: Vec<Vec3>,
    /// Level of what comes back, dB.
    pub level_db: f32,
}

/// Phase differences of one tag at one antenna.
#[derive(Debug, Clone, PartialEq)]
pub struct Differences {
    /// Number of the thing.
    pub thing: usize,
    /// Port of the antenna.
    pub antenna: u16,
    /// Time, s, and difference to the read before, rad; `None` where it means nothing.
    pub points: Vec<(f64, Option<f64>)>,
}

impl Sample {
    /// Writes `sample.png`, `strip.png` and `film.gif` to the folder `out`.
    ///
    /// # Errors
    /// If a picture cannot be drawn or written; a sample without moments cannot be drawn.
    pub fn write(&self, out: &Path) -> Result<Vec<PathBuf>, PlotError> {
        let [sample, strip, film] = ["sample.png", "strip.png", "film.gif"].map(|name| out.join(name));
        self.figure().save(&sample)?;
        self.strip().save(&strip)?;
        save_film(&film, self.film(), self.frame_s)?;
        Ok(vec![sample, strip, film])
    }

    /// One figure of all.
    pub fn figure(&self) -> Figure {
        let (views, maps) = (Views::new(self), Maps::new(self));
        let shown = maps.liveliest();
        let mut panels: Vec<Panel> = Eye::ALL
            .iter()
            .map(|&eye| views.panel(eye, shown, Scope::Whole, format!("{eye}, at {}", self.time(shown))))
            .collect();
        let at = format!("frame {shown} at {}", self.time(shown));
        panels.extend([
            maps.range_doppler(shown, format!("Range-Doppler, {at}")),
            maps.range_time(shown, format!("Range-time, {at}")),
            maps.angles(shown, format!("Angles of arrival, {at}")),
            maps.range_over_time(None),
            maps.velocity_over_time(),
            maps.azimuth_over_time(),
        ]);
        let tags = tags::panels(self);
        // Those of the target come first.
        let target = self.things.iter().any(|t| t.target) && !tags.is_empty();
        let highlighted = target.then_some(panels.len());
        panels.extend(tags);
        Figure {
            highlighted,
            title: Some(self.title.clone()),
            columns: 3,
            width: 1_860,
            panel_height: 400,
            ..Figure::new(panels)
        }
    }

    /// A few moments of the interaction side by side.
    pub fn strip(&self) -> Figure {
        let (views, maps) = (Views::new(self), Maps::new(self));
        let end = self.moments.len().saturating_sub(1) as f64 * self.frame_s;
        let (from, to) = self.interaction_s.map_or((0.0, end), |(from, to)| {
            ((from - STRIP_AROUND_S).clamp(0.0, end), (to + STRIP_AROUND_S).clamp(0.0, end))
        });
        let shown: Vec<usize> = (0..STRIP_MOMENTS)
            .map(|n| from + (to - from) * n as f64 / (STRIP_MOMENTS - 1) as f64)
            .map(|time_s| (time_s / self.frame_s).round() as usize)
            .filter(|&n| n < self.moments.len())
            .collect();
        let row = |panel: &dyn Fn(usize) -> Panel| shown.iter().map(|&n| panel(n)).collect::<Vec<_>>();
        let panels = [
            row(&|n| views.panel(Eye::Side, n, Scope::Near, self.time(n))),
            row(&|n| views.panel(Eye::Above, n, Scope::Near, String::new())),
            row(&|n| maps.range_doppler(n, String::new())),
            row(&|n| maps.angles(n, String::new())),
        ];
        Figure {
            title: Some(self.title.clone()),
            columns: STRIP_MOMENTS,
            width: 2_400,
            panel_height: 330,
            strip: true,
            ..Figure::new(panels.concat())
        }
    }

    /// Pictures of all moments.
    pub fn film(&self) -> impl Iterator<Item = Figure> {
        let (views, maps) = (Views::new(self), Maps::new(self));
        (0..self.moments.len()).map(move |n| {
            let now_s = n as f64 * self.frame_s;
            let mut panels = vec![
                views.panel(Eye::Above, n, Scope::Whole, "From above".into()),
                views.panel(Eye::Side, n, Scope::Near, "From the right".into()),
                maps.range_doppler(n, "Range-Doppler".into()),
                maps.range_over_time(Some(now_s)),
                maps.angles(n, "Angles of arrival".into()),
            ];
            panels.extend(tags::target(self, now_s));
            let acting = self.interaction_s.is_some_and(|(from, to)| (from..=to).contains(&now_s));
            let doing = if acting { ", interaction" } else { "" };
            Figure {
                title: Some(format!("{}, t = {}{doing}", self.title, self.time(n))),
                columns: 3,
                width: 1_320,
                panel_height: 330,
                ..Figure::new(panels)
            }
        })
    }

    /// Time of a moment, to be read.
    fn time(&self, moment: usize) -> String {
        format!("{:.1} s", moment as f64 * self.frame_s)
    }

    fn duration_s(&self) -> f64 {
        self.moments.len().max(1) as f64 * self.frame_s
    }
}

#[cfg(test)]
mod tests;
