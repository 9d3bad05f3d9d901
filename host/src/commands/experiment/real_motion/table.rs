//! What was reached, as numbers for scripts and tables for people.

use std::collections::BTreeMap;

use rfhoi::hoi::Action;
use rfhoi_network::metrics::{Metrics, Share, median};
use serde::Serialize;

use super::{Compared, Pair, is_right};

/// A share with its interval.
#[derive(Debug, Clone, Copy, Serialize)]
struct Reached {
    #[serde(flatten)]
    share: Share,
    /// Where the true share lies 19 times of 20, as if samples were independent.
    low: f64,
    high: f64,
}

impl From<Share> for Reached {
    fn from(share: Share) -> Self {
        let (low, high) = share.interval();
        Self { share, low, high }
    }
}

/// What was reached of one kind of motion.
#[derive(Debug, Serialize)]
struct OfKind {
    action: Reached,
    object: Reached,
    tuple: Reached,
    told: Reached,
    right_of_told: Reached,
    /// How often each action was said, and last nothing.
    said: Vec<u32>,
    /// Medians of what tells motions apart.
    medians: BTreeMap<&'static str, f64>,
}

/// Recorded and generated motion side by side.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    /// What is done.
    action: String,
    /// By whom, if not by all.
    #[serde(skip_serializing_if = "Option::is_none")]
    person: Option<String>,
    recorded: OfKind,
    generated: OfKind,
    /// Pairs whose tuple is right of both, of the recorded one alone, of the generated one alone, of neither.
    pairs: [u32; 4],
}

impl OfKind {
    fn of(pairs: &[Pair<'_>], kind: usize, least: f32) -> Self {
        let metrics = Metrics::of(pairs.iter().map(|pair| (pair[kind].1, &pair[kind].0.sample)), least);
        let classes = metrics.confusion.len();
        let said = |class: usize| metrics.confusion.iter().map(|row| row[class]).sum::<u32>();
        let mut values: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
        for (name, value) in pairs.iter().flat_map(|pair| pair[kind].0.figures.named()) {
            values.entry(name).or_default().push(value);
        }
        let medians = values.into_iter().filter_map(|(name, values)| Some((name, median(values)?)));
        Self {
            action: metrics.action.into(),
            object: metrics.object.into(),
            tuple: metrics.hoi.into(),
            told: metrics.told.into(),
            right_of_told: metrics.right_of_told.into(),
            said: (0..classes).map(said).collect(),
            medians: medians.collect(),
        }
    }
}

impl Row {
    /// Of pairs, of which there is at least one.
    pub(super) fn of(action: &str, person: Option<&str>, pairs: &[Pair<'_>], least: f32) -> Self {
        let mut outcomes = [0; 4];
        for pair in pairs {
            let [recorded, generated] = pair.map(|(seen, answer)| is_right(answer, &seen.sample));
            outcomes[2 * usize::from(!recorded) + usize::from(!generated)] += 1;
        }
        Self {
            action: action.to_owned(),
            person: person.map(str::to_owned),
            recorded: OfKind::of(pairs, 0, least),
            generated: OfKind::of(pairs, 1, least),
            pairs: outcomes,
        }
    }

    fn kinds(&self) -> [(&'static str, &OfKind); 2] {
        [("recorded", &self.recorded), ("generated", &self.generated)]
    }
}

/// Figures of motions, with the heads of their columns and digits.
const MEDIANS: [(&str, &str, usize); 10] = [
    ("movement_s", "movement, s", 1),
    ("hand_m_s", "hand, m/s", 2),
    ("hips_m", "hips, m", 2),
    ("doppler_m_s", "Doppler, m/s", 2),
    ("moving_percent", "moving, %", 0),
    ("moving_cells", "cells", 0),
    ("tag_cm", "tag goes, cm", 0),
    ("lies_m", "lies at, m", 2),
    ("reads_per_s", "reads/s", 1),
    ("past_edge_cm", "in table, cm", 0),
];

impl Compared<'_> {
    /// Tables of it all.
    pub(super) fn text(&self) -> String {
        let Self { model, setups, seed, motions, least_probability: least, .. } = self;
        let performed = motions.len() - self.left_out.len();
        let mut text = format!(
            "Recorded motion in simulated rooms, beside generated motion. Radar and reader are simulated.\n\
             model {model}; {performed} motions, {setups} setups of each, seed {seed}; tuples of at least {least:.2} are told\n\
             95 % intervals (Wilson) over samples; samples of one motion or one setup are alike, so the true ones are wider\n\n"
        );
        self.shares(&mut text);
        self.confusion(&mut text);
        self.medians(&mut text);
        self.people(&mut text);
        for left_out in &self.left_out {
            text.push_str(&format!("left out: {}: {}\n", left_out.file, left_out.why));
        }
        text
    }

    fn shares(&self, text: &mut String) {
        let heads = ["action right", "object right", "tuple right", "told", "right of told"];
        text.push_str(&format!("{:<10} {:<10}{:>8}", "", "motion", "samples"));
        heads.iter().for_each(|head| text.push_str(&format!("  {head:<21}")));
        end_line(text);
        for row in &self.actions {
            for (name, kind) in row.kinds() {
                text.push_str(&format!("{:<10} {name:<10}{:>8}", row.action, kind.tuple.share.of));
                let OfKind { action, object, tuple, told, right_of_told, .. } = kind;
                for reached in [action, object, tuple, told, right_of_told] {
                    text.push_str(&format!("  {:<21}", reached.share.to_string()));
                }
                end_line(text);
            }
            let [both, recorded, generated, neither] = row.pairs;
            text.push_str(&format!(
                "{:<10} tuples of a pair right: both {both}, recorded alone {recorded}, generated alone {generated}, neither {neither}\n",
                ""
            ));
        }
    }

    fn confusion(&self, text: &mut String) {
        text.push_str(&format!("\n{:<21}", "done \\ said"));
        let names = Action::ALL.iter().map(|action| action.name()).chain(["nothing"]);
        names.for_each(|name| text.push_str(&format!("{name:>10}")));
        end_line(text);
        for row in self.actions.iter().filter(|row| row.action != "all") {
            for (name, kind) in row.kinds() {
                text.push_str(&format!("{:<10} {name:<10}", row.action));
                kind.said.iter().for_each(|count| text.push_str(&format!("{count:>10}")));
                end_line(text);
            }
        }
    }

    fn medians(&self, text: &mut String) {
        text.push_str(&format!("\n{:<21}", "medians"));
        MEDIANS.iter().for_each(|(_, head, _)| text.push_str(&format!("{head:>14}")));
        end_line(text);
        for row in self.actions.iter().filter(|row| row.action != "all") {
            for (name, kind) in row.kinds() {
                text.push_str(&format!("{:<10} {name:<10}", row.action));
                for (key, _, digits) in MEDIANS {
                    let value = kind.medians.get(key).copied().unwrap_or(f64::NAN);
                    text.push_str(&format!("{value:>14.digits$}"));
                }
                end_line(text);
            }
        }
    }

    fn people(&self, text: &mut String) {
        let person = |row: &Row| row.person.clone().unwrap_or_default();
        let width = self.people.iter().map(|row| person(row).chars().count()).max().unwrap_or(0).max(8);
        let cells = |text: &mut String, cells: [&str; 6]| {
            let [who, action, samples, recorded, action_right, generated] = cells;
            text.push_str(&format!(
                "{who:<width$}  {action:<10}{samples:>8}  {recorded:<22}{action_right:<22}{generated:<22}"
            ));
            end_line(text);
        };
        text.push('\n');
        cells(text, ["person", "", "samples", "tuple right", "action right", "tuple right, generated"]);
        for row in &self.people {
            let OfKind { tuple, action, .. } = &row.recorded;
            let [tuple, action, generated] =
                [tuple, action, &row.generated.tuple].map(|reached| reached.share.to_string());
            let samples = row.recorded.tuple.share.of.to_string();
            cells(text, [&person(row), &row.action, &samples, &tuple, &action, &generated]);
        }
    }
}

/// Ends a line without spaces before its end.
fn end_line(text: &mut String) {
    text.truncate(text.trim_end_matches(' ').len());
    text.push('\n');
}
