//! The search: the smallest configuration that [`Problem::check`] passes, or what keeps all from it.

use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::{Metres, MetresPerSecond};

use super::check::{Binding, Cost, Problem};
use super::needs::{Antennas, Needs};
use super::space::{Config, MAP_POINTS, profiles};

/// No configuration works.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The needs mean nothing.
    #[error("{0}")]
    Nonsense(String),
    /// Of all configurations, those that meet everything that is checked before `binding` break it.
    #[error("no configuration works: {binding}{}", remedies(.remedies))]
    Bound {
        /// What they break, with the numbers of the smallest that comes so far.
        binding: Binding,
        /// Needs that could be met, each with all others as they are.
        remedies: Vec<String>,
    },
}

fn remedies(remedies: &[String]) -> String {
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

    /// The first configuration that works, and what kept those before it that came farthest.
    fn first(&self, profiles: Vec<RadarProfile>) -> (Option<(Config, Cost)>, Option<Binding>) {
        let mut farthest: Option<Binding> = None;
        let mut note = |binding: Binding| {
            if farthest.is_none_or(|f| f.stage() < binding.stage()) {
                farthest = Some(binding);
            }
        };
        let antennas = self.needs.antennas.most();
        for profile in profiles {
            let mut config = Config { profile, map_points: 0, angle_points: 0, antennas };
            'maps: for points in MAP_POINTS {
                for angle in MAP_POINTS {
                    for antennas in (1..=antennas).rev() {
                        (config.map_points, config.angle_points, config.antennas) = (points, angle, antennas);
                        match self.check(&config) {
                            Ok(cost) => return (Some((config, cost)), farthest),
                            Err(binding) => {
                                note(binding);
                                // Nothing inside of these loops changes that.
                                if binding.is_of_radar() {
                                    break 'maps;
                                }
                            }
                        }
                    }
                }
            }
        }
        (None, farthest)
    }

    /// Whether another set of needs can be met.
    fn works(&self, change: impl FnOnce(&mut Needs)) -> bool {
        let mut problem = self.clone();
        change(&mut problem.needs);
        if problem.needs.tags != self.needs.tags {
            problem = Self::new(problem.needs, self.means);
        }
        problem.first(profiles(&problem.needs)).0.is_some()
    }

    /// What would work, need by need.
    fn remedies(&self, binding: &Binding) -> Vec<String> {
        let needs = &self.needs;
        let mut remedies = Vec::new();
        if binding.is_of_radar() {
            let depth = nearest(needs.depth.0, 0.5, |v| self.works(|n| n.depth = Metres(v)));
            remedies.extend(depth.map(|v| format!("a depth of {v:.1} m")));
            let hand =
                nearest(needs.fastest_hand.0, 0.5, |v| self.works(|n| n.fastest_hand = MetresPerSecond(v)));
            remedies.extend(hand.map(|v| format!("hands of {v:.1} m/s")));
            let range = nearest(needs.range_resolution.0, 1.0, |v| {
                self.works(|n| n.range_resolution = Metres(v))
            });
            remedies.extend(range.map(|v| format!("a range resolution of {:.0} cm", v * 100.0)));
            let velocity = nearest(needs.velocity_resolution.0, 2.0, |v| {
                self.works(|n| n.velocity_resolution = MetresPerSecond(v))
            });
            remedies.extend(velocity.map(|v| format!("a velocity resolution of {:.0} cm/s", v * 100.0)));
            if needs.elevation && self.works(|n| n.elevation = false) {
                remedies.push("no elevation".to_owned());
            }
        } else {
            let most = needs.antennas.most();
            let antennas = (1..most).rev().find(|&a| self.works(|n| n.antennas = Antennas::Exactly(a)));
            remedies.extend(antennas.map(|a| super::check::counted(a, "antenna")));
            let tags = (1..needs.tags).rev().find(|&t| self.works(|n| n.tags = t));
            remedies.extend(tags.map(|t| super::check::counted(t, "tag")));
            let tag =
                nearest(needs.fastest_tag.0, 0.05, |v| self.works(|n| n.fastest_tag = MetresPerSecond(v)));
            remedies.extend(tag.map(|v| format!("tags of {v:.1} m/s")));
        }
        remedies
    }
}

/// The value nearest to `from`, on the way to `to`, that works; to a hundredth of the way. What works once works beyond.
fn nearest(from: f32, to: f32, works: impl Fn(f32) -> bool) -> Option<f32> {
    const STEPS: u32 = 100;
    let at = |step: u32| from + (to - from) * step as f32 / STEPS as f32;
    if (to - from).abs() < f32::EPSILON || !works(to) {
        return None;
    }
    let (mut fails, mut holds) = (0, STEPS);
    while holds - fails > 1 {
        let middle = (fails + holds) / 2;
        if works(at(middle)) { holds = middle } else { fails = middle }
    }
    Some(at(holds))
}
