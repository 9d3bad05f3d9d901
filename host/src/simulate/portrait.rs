//! From a [`Take`] to the pictures of it: what the scene, the radar and the reader made of each frame.
//!
//! Maps are those of the bridge; angles of arrival are Bartlett's, from the covariance of what moves; phase differences are
//! those of [`phase`](crate::phase), corrected for hops by what the reader's lead-in taught.

use std::ops::Range;

use glam::Vec3;
use ndarray::Array2;
use rand_chacha::ChaCha8Rng;
use rfhoi_firmware::dsp::level;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::Kilohertz;
use rfhoi_shared::wire::{Covariance, HopTable};

use super::picture::{Differences, MapAxes, Moment, Sample, SignalPath, Thing};
use super::radar::{FrameMaps, Path, Radar, RadarError};
use super::sample::{Take, epoch};
use crate::aoa::{Estimator, Settings as AngleSettings};
use crate::phase::{ChannelPlan, Settings, analyse};

/// Points of the angle grid each way: 3 degrees apart.
const ANGLES: usize = 41;
/// Paths that are drawn of each moment, the strongest: straight ones, and ones by way of a wall.
const STRAIGHT_PATHS: usize = 12;
const WALL_PATHS: usize = 4;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PortraitError {
    /// The radar.
    #[error(transparent)]
    Radar(#[from] RadarError),
    /// The user stopped it.
    #[error("stopped; nothing was written")]
    Interrupted,
}

/// What the radios do not know.
#[derive(Debug, Clone, PartialEq)]
pub struct Caption {
    /// Title of the pictures; it must say that they are of a simulated sample.
    pub title: String,
    /// Number of the target's tag, if there is one.
    pub target: Option<usize>,
    /// When the interaction begins and ends, s, if that is known.
    pub interaction_s: Option<Range<f64>>,
}

/// Simulates `take` and gathers what is to be drawn; `radar_rng` and `reader_rng` seed each device's noise. `progress` is
/// told the share that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If the profile has no antenna geometry, or the user stops it.
pub fn portray(
    take: &Take<'_>,
    caption: Caption,
    radar_rng: &mut ChaCha8Rng,
    reader_rng: &mut ChaCha8Rng,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Sample, PortraitError> {
    let Take { scene, performance, tags, .. } = *take;
    let mut radar = Radar::new(scene, take.effects)?;
    radar.begin(take.fixtures, radar_rng);
    let profile = radar.config().profile.clone();
    let settings = AngleSettings::bartlett(ANGLES);
    let mut estimator = Estimator::new(&profile, settings).map_err(|_| RadarError::Geometry)?;
    let times = take.frame_times(&profile);
    let count = times.len();
    let mut moments = Vec::with_capacity(count);
    for (frame, time_s) in times.enumerate() {
        if !progress(frame as f64 / count as f64) {
            return Err(PortraitError::Interrupted);
        }
        let paths = radar.look(performance, time_s).to_vec();
        let maps = radar.maps();
        let mut vertices = Vec::new();
        performance.vertices(time_s, &mut vertices);
        let bins = radar.config().processing.gate.bins.into();
        moments.push(Moment {
            vertices,
            things: (0..tags.len()).map(|tag| performance.tag(tag, time_s)).collect(),
            paths: strongest(&radar, paths),
            range_doppler: levels(bins, &maps.range_doppler),
            range_time: levels(bins, &maps.range_time),
            angles: angles(&mut estimator, &maps),
        });
    }
    let (reads, channels) = take.reads(reader_rng);
    let things = tags.iter().enumerate().map(|(number, tag)| Thing {
        name: tag.object.name().to_owned(),
        target: caption.target == Some(number),
    });
    let (surface, vertices) = take.fixtures.unzip();
    Ok(Sample {
        title: caption.title,
        scene: scene.clone(),
        frame_s: profile.frame_period().0.into(),
        interaction_s: caption.interaction_s.map(|s| (s.start, s.end)),
        triangles: performance.surface().triangles.clone(),
        fixtures: (
            surface.map(|s| s.triangles.clone()).unwrap_or_default(),
            vertices.map(<[Vec3]>::to_vec).unwrap_or_default(),
        ),
        things: things.collect(),
        axes: axes(&radar, &estimator),
        moments,
        differences: differences(take, &reads, &channels),
    })
}

/// Outer edges of the maps.
fn axes(radar: &Radar, estimator: &Estimator) -> MapAxes {
    /// Edges of cells that are `step` apart from the first to the last.
    fn edges(first: f32, last: f32, step: f32) -> (f64, f64) {
        ((first - step / 2.0).into(), (last + step / 2.0).into())
    }
    let config = radar.config();
    let (gate, loops) = (config.processing.gate, f32::from(config.profile.loops));
    let (range_bin, velocity_bin) = (config.profile.range_bin().0, config.profile.velocity_bin().0);
    let first = f32::from(gate.first) * range_bin;
    let slowest = -(loops / 2.0).floor() * velocity_bin;
    let widest = estimator.azimuth_deg().last().copied().unwrap_or(0.0);
    let angle = |degrees: &[f32]| edges(-widest, widest, 2.0 * widest / (degrees.len().max(2) - 1) as f32);
    MapAxes {
        range_m: edges(first, first + f32::from(gate.bins - 1) * range_bin, range_bin),
        velocity_m_s: edges(slowest, slowest + (loops - 1.0) * velocity_bin, velocity_bin),
        azimuth_deg: angle(estimator.azimuth_deg()),
        elevation_deg: angle(estimator.elevation_deg()),
    }
}

/// A map of codes in `rows`, dB.
fn levels(rows: usize, codes: &[u8]) -> Array2<f32> {
    let levels = codes.iter().map(|&code| level::SCALE.level_db(code)).collect();
    Array2::from_shape_vec((rows, codes.len() / rows.max(1)), levels).unwrap_or_default()
}

/// Bartlett's spectrum, dB; missing where nothing moves.
fn angles(estimator: &mut Estimator, maps: &FrameMaps) -> Array2<f32> {
    let antennas = maps.covariance.len().isqrt() as u8;
    let packed = maps.covariance.iter().copied().collect();
    estimator.estimate(&Covariance { frame: 0, antennas, packed }, maps.moving_cells);
    let shape = (estimator.elevation_deg().len(), estimator.azimuth_deg().len());
    Array2::from_shape_vec(shape, estimator.map_db().to_vec()).unwrap_or_default()
}

/// The strongest of `paths`, of both kinds.
fn strongest(radar: &Radar, mut paths: Vec<Path>) -> Vec<SignalPath> {
    paths.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
    let (straight, by_wall): (Vec<Path>, Vec<Path>) =
        paths.into_iter().partition(|p| p.departure == p.arrival);
    // Each way by a wall is there and back.
    let by_wall = by_wall.into_iter().step_by(2).take(WALL_PATHS);
    let path = |p: Path| SignalPath { points: radar.way(&p), level_db: 20.0 * libm::log10f(p.amplitude) };
    straight.into_iter().take(STRAIGHT_PATHS).chain(by_wall).map(path).collect()
}

/// Differences of phase from read to read during the sample, by tag and antenna.
fn differences(take: &Take<'_>, reads: &[TagRead], channels: &[Kilohertz]) -> Vec<Differences> {
    let table = HopTable { table: 1, channels: channels.iter().copied().collect() };
    let settings =
        Settings { scene: take.scene.needs(), channels: ChannelPlan::from(&table), ..Settings::default() };
    let (samples, _) = analyse(reads, settings);
    let epoch_s = epoch(&take.effects).seconds();
    let tracks = take.tags.iter().enumerate().flat_map(|(thing, tag)| {
        (1..=take.scene.reader.antennas.len() as u16).map(move |antenna| (thing, tag, antenna))
    });
    let track = |(thing, tag, antenna): (usize, &super::scene::Tag, u16)| {
        let own = samples.iter().filter(|s| s.key.epc == tag.epc && s.key.antenna.0 == antenna);
        let points = own.filter_map(|s| {
            let time_s = s.time.seconds() - epoch_s;
            let step = s.step.filter(|_| time_s >= 0.0)?;
            Some((time_s, step.turned.ok()))
        });
        Differences { thing, antenna, points: points.collect() }
    };
    tracks.map(track).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hoi::{Action, CATEGORIES, Category, Object};
    use crate::simulate::draw::{Purpose, Wanted, draw, stream};
    use crate::simulate::effects::{Domain, Effects};
    use crate::simulate::sample::perform;
    use crate::simulate::scene::Scene;

    /// Somebody picks up a book, straight ahead of the radar, and looks at it.
    fn sample(seed: u64, go_on: bool) -> Result<Sample, PortraitError> {
        let domain = Domain::Site;
        // A weak tag's phase noise would hide what moves.
        let effects = Effects { phase_error: false, ..Effects::of(domain) };
        let mut scene = Scene::named("working-space").unwrap();
        scene.places.retain(|p| p.position.x == 0.0 && p.position.y == 2.4 && p.facing_rad == 0.0);
        let scenes = [scene];
        let book = [Category { action: Action::PickUp, object: Object::Book }];
        assert!(CATEGORIES.contains(&book[0]));
        let wanted = Wanted::one(domain, seed, &book);
        let mut drawn = draw(&wanted, &scenes).swap_remove(0);
        drawn.facing_deg = 0.0;
        let (performance, tags) = perform(domain, seed, &drawn, &scenes[0]).unwrap();
        let take = Take::of(&scenes[0], &performance, &tags, effects);
        let [mut radar, mut reader] = [Purpose::Radar, Purpose::Rfid].map(|p| stream(domain, seed, 0, p));
        let caption = Caption {
            title: "Simulated".to_owned(),
            target: performance.target(),
            interaction_s: Some(performance.interaction_s()),
        };
        portray(&take, caption, &mut radar, &mut reader, &mut |_| go_on)
    }

    /// Where the largest value of a map is, as shares of both axes, from the lower left corner.
    fn peak(map: &Array2<f32>) -> (f64, f64, f32) {
        let (rows, columns) = map.dim();
        let share = |n: usize, of: usize| (n as f64 + 0.5) / of as f64;
        let cells = map.indexed_iter().filter(|(_, v)| v.is_finite());
        let ((row, column), &top) = cells.max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
        (share(row, rows), share(column, columns), top)
    }

    fn place((from, to): (f64, f64), share: f64) -> f64 {
        from + (to - from) * share
    }

    #[test]
    fn maps_paths_and_phases_agree_with_the_scene() {
        let sample = sample(3, true).unwrap();
        let target = sample.things.iter().position(|t| t.target).unwrap();
        assert_eq!(sample.things[target].name, "book");
        let (begin_s, end_s) = sample.interaction_s.unwrap();
        let radar = sample.scene.radar.position;

        // The strongest cell of each frame is a part of the person, and moves as the range of the person's does.
        let (mut towards, mut away) = (0, 0);
        for (n, moment) in sample.moments.iter().enumerate() {
            assert_eq!(moment.things.len(), sample.things.len());
            assert!(moment.paths.iter().all(|p| p.points.len() > 2 && p.level_db.is_finite()), "frame {n}");
            let (range, velocity, level_db) = peak(&moment.range_doppler);
            let range_m = place(sample.axes.range_m, range);
            let distances = moment.vertices.iter().map(|v| f64::from(v.distance(radar)));
            let nearest = distances.fold(f64::INFINITY, f64::min);
            assert!((nearest - 0.1..nearest + 0.7).contains(&range_m), "frame {n}: {range_m} m, {nearest} m");
            let velocity_m_s = place(sample.axes.velocity_m_s, velocity);
            if level_db > -75.0 && velocity_m_s.abs() > 0.5 {
                if velocity_m_s < 0.0 {
                    towards += 1
                } else {
                    away += 1
                }
                let time_s = n as f64 * sample.frame_s;
                assert!((begin_s - 0.1..end_s + 0.1).contains(&time_s), "frame {n} is lively");
                let (elevation, azimuth, _) = peak(&moment.angles);
                let azimuth_deg = place(sample.axes.azimuth_deg, azimuth);
                let elevation_deg = place(sample.axes.elevation_deg, elevation);
                assert!(azimuth_deg.abs() < 20.0 && elevation_deg.abs() < 30.0, "frame {n}");
            }
        }
        assert!(towards > 0 && away > 0, "{towards} frames towards the radar, {away} away");

        // The tag's phase turns most on the thing that is picked up.
        let most_deg = |thing: usize| {
            let own = sample.differences.iter().filter(|d| d.thing == thing);
            let turned = own.flat_map(|d| d.points.iter().filter_map(|p| p.1));
            let mut turned: Vec<f64> = turned.map(|d| d.to_degrees().abs()).collect();
            turned.sort_by(f64::total_cmp);
            // The upper tenth: single differences may be wrong.
            turned[turned.len() - 1 - turned.len() / 10]
        };
        for other in (0..sample.things.len()).filter(|&n| n != target) {
            let (target, other) = (most_deg(target), most_deg(other));
            assert!(target > other, "{target} deg of the target, {other} deg of another");
        }
        let duration_s = sample.moments.len() as f64 * sample.frame_s;
        let times = sample.differences.iter().flat_map(|d| d.points.iter().map(|p| p.0));
        assert!(times.clone().all(|t| (0.0..duration_s).contains(&t)) && times.count() > 500);
    }

    #[test]
    fn the_same_seed_gives_the_same_picture_and_stopping_none() {
        let [a, b] = [3, 3].map(|seed| sample(seed, true).unwrap());
        assert_eq!(a.differences, b.differences);
        let maps = |s: &Sample| s.moments.iter().map(|m| m.range_doppler.clone()).collect::<Vec<_>>();
        assert_eq!(maps(&a), maps(&b));
        assert!(matches!(sample(3, false), Err(PortraitError::Interrupted)));
    }
}
