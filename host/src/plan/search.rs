//! The search: the smallest configuration that [`Problem::check`] passes, or what keeps all from it.

use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::{Metres, MetresPerSecond};

use super::check::{Binding, Cost, Problem, counted};
use super::needs::{Antennas, Needs};
use super::space::{Config, MAP_POINTS, profiles};

/// No configuration works.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The needs mean nothing.
    #[error("{0}")]
    Nonsense(String),
    /// Of all configurations, those that meet everything that is checked before `binding` break it.
    #[error("no configuration works: {binding}{}", would(.remedies))]
    Bound {
        /// What they break, with the numbers of the one that misses by least.
        binding: Binding,
        /// Needs that could be met, each with all others as they are.
        remedies: Vec<String>,
    },
}

fn would(remedies: &[String]) -> String {
    if remedies.is_empty() { String::new() } else { format!("; it would with {}", remedies.join(", or ")) }
}

impl Problem {
    /// The smallest configuration that works, and its cost. Radar profiles are tried in the order of
    /// [`by_size`](super::space::by_size), then maps from small to large; of antennas as many as are read often enough, since
    /// each sees the tags from elsewhere (the paper, with 1, 2, 3 and 4: 74.9, 85.7, 87.2 and 87.9 %).
    ///
    /// # Errors
    /// What keeps all from working.
    pub fn search(&self) -> Result<(Config, Cost), Refusal> {
        if let Some(sentence) = self.needs.nonsense() {
            return Err(Refusal::Nonsense(sentence));
        }
        let (found, binding) = self.first(profiles(&self.needs));
        found.ok_or_else(|| {
            // A search that tries anything has something in its way if nothing is found.
            let binding = binding.unwrap_or(Binding::RangeBin(Metres(0.0), self.needs.range_resolution));
            Refusal::Bound { binding, remedies: self.remedies(&binding) }
        })
    }

    /// The first configuration that works, and what kept those that came farthest.
    fn first(&self, profiles: Vec<RadarProfile>) -> (Option<(Config, Cost)>, Option<Binding>) {
        let mut farthest: Option<Binding> = None;
        for profile in profiles {
            match self.with_profile(profile) {
                Ok(found) => return (Some(found), farthest),
                Err(binding) => farthest = Some(farthest.map_or(binding, |f| f.nearer(binding))),
            }
        }
        (None, farthest)
    }

    /// The smallest maps and the most antennas with this profile; each of the three is checked without the others.
    fn with_profile(&self, profile: RadarProfile) -> Result<(Config, Cost), Binding> {
        self.check_radar(&profile)?;
        let sides = MAP_POINTS.into_iter();
        let map_points = first_of(sides.clone(), |&points| self.check_map(&profile, points))?;
        let angle_points = first_of(sides, |&points| self.check_angle_map(&profile, points))?;
        let antennas = first_of(self.needs.antennas.choices(), |&antennas| self.check_reader(antennas))?;
        let config = Config { profile, map_points, angle_points, antennas };
        let cost = self.cost(&config);
        Ok((config, cost))
    }

    /// Whether a radar can be found for another set of needs.
    fn radar_works(&self, change: impl FnOnce(&mut Needs)) -> bool {
        let mut problem = self.clone();
        change(&mut problem.needs);
        profiles(&problem.needs).iter().any(|profile| problem.check_radar(profile).is_ok())
    }

    /// Whether the reader can do with another set of needs.
    fn reader_works(&self, change: impl FnOnce(&mut Needs)) -> bool {
        let mut needs = self.needs.clone();
        change(&mut needs);
        let problem = Self::new(needs, self.means);
        problem.needs.antennas.choices().any(|antennas| problem.check_reader(antennas).is_ok())
    }

    /// The most of the antennas asked for that are read often enough.
    pub(super) fn most_antennas(&self) -> Option<u8> {
        let mut problem = self.clone();
        problem.needs.antennas = Antennas::UpTo(self.needs.antennas.most());
        problem.needs.antennas.choices().find(|&antennas| problem.check_reader(antennas).is_ok())
    }

    /// What would work, need by need.
    fn remedies(&self, binding: &Binding) -> Vec<String> {
        let needs = &self.needs;
        let mut remedies = Vec::new();
        if binding.is_of_radar() {
            let depth = nearest(needs.depth.0, 0.5, 0.1, |v| self.radar_works(|n| n.depth = Metres(v)));
            remedies.extend(depth.map(|v| format!("a depth of {v:.1} m")));
            let hand = nearest(needs.fastest_hand.0, 0.5, 0.1, |v| {
                self.radar_works(|n| n.fastest_hand = MetresPerSecond(v))
            });
            remedies.extend(hand.map(|v| format!("hands of {v:.1} m/s")));
            let range = nearest(needs.range_resolution.0, 1.0, 0.01, |v| {
                self.radar_works(|n| n.range_resolution = Metres(v))
            });
            remedies.extend(range.map(|v| format!("a range resolution of {:.0} cm", v * 100.0)));
            let velocity = nearest(needs.velocity_resolution.0, 2.0, 0.01, |v| {
                self.radar_works(|n| n.velocity_resolution = MetresPerSecond(v))
            });
            remedies.extend(velocity.map(|v| format!("a velocity resolution of {:.0} cm/s", v * 100.0)));
            if needs.elevation && self.radar_works(|n| n.elevation = false) {
                remedies.push("no elevation".to_owned());
            }
        } else {
            remedies.extend(self.most_antennas().map(|most| counted(most, "antenna")));
            let tags = nearest(f32::from(needs.tags), 1.0, 1.0, |v| self.reader_works(|n| n.tags = v as u8));
            remedies.extend(tags.map(|t| counted(t as u8, "tag")));
            let tag = nearest(needs.fastest_tag.0, 0.1, 0.1, |v| {
                self.reader_works(|n| n.fastest_tag = MetresPerSecond(v))
            });
            remedies.extend(tag.map(|v| format!("tags of {v:.1} m/s")));
        }
        remedies
    }
}

/// The first of `choices` that passes; else what the last one breaks.
fn first_of<T>(
    choices: impl Iterator<Item = T>,
    check: impl Fn(&T) -> Result<(), Binding>,
) -> Result<T, Binding> {
    let mut broken = None;
    for choice in choices {
        match check(&choice) {
            Ok(()) => return Ok(choice),
            Err(binding) => broken = Some(binding),
        }
    }
    Err(broken.unwrap_or(Binding::NoSuchAntenna(0, 0)))
}

/// The multiple of `unit` nearest to `from`, on the way to `to`, that works. What works once works beyond.
fn nearest(from: f32, to: f32, unit: f32, works: impl Fn(f32) -> bool) -> Option<f32> {
    let steps = ((to - from).abs() / unit).round() as u32;
    let start = if to < from { (from / unit).ceil() } else { (from / unit).floor() };
    let at = |step: u32| (start + step as f32 * (to - from).signum()) * unit;
    if steps == 0 || !works(at(steps)) {
        return None;
    }
    let (mut fails, mut holds) = (0, steps);
    while holds - fails > 1 {
        let middle = (fails + holds) / 2;
        if works(at(middle)) { holds = middle } else { fails = middle }
    }
    Some(at(holds))
}
