//! Axes: in, what they measure and from where to where; out, where values lie and where the ticks are.

/// From here on, labels have a power of ten.
const LARGE: f64 = 1e6;

/// What an axis measures and from where to where it runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What it measures.
    pub label: String,
    /// Its unit; empty for a bare number.
    pub unit: String,
    /// Value at the left or lower end.
    pub from: f64,
    /// Value at the right or upper end.
    pub to: f64,
    /// Values at which a dashed line crosses the panel; on x axes.
    pub marked: Vec<f64>,
    /// Whether equal factors are equally long, instead of equal differences.
    pub(super) logarithmic: bool,
    /// From where to where there are ticks, if not all along the axis.
    pub(super) ticked: Option<(f64, f64)>,
}

impl Axis {
    /// An axis of `label` in `unit` from `from` to `to`.
    pub fn new(label: impl Into<String>, unit: impl Into<String>, from: f64, to: f64) -> Self {
        let (label, unit) = (label.into(), unit.into());
        Self { label, unit, from, to, marked: Vec::new(), logarithmic: false, ticked: None }
    }

    /// An axis on which equal factors are equally long. Both ends must be positive, else it is an ordinary one.
    pub fn logarithmic(label: impl Into<String>, unit: impl Into<String>, from: f64, to: f64) -> Self {
        Self { logarithmic: from > 0.0 && to > 0.0, ..Self::new(label, unit, from, to) }
    }

    /// The axis with these values marked.
    pub fn with_marks(self, values: impl IntoIterator<Item = f64>) -> Self {
        Self { marked: values.into_iter().collect(), ..self }
    }

    /// An axis that holds all finite `values`, with a little room at both ends.
    pub fn around(
        label: impl Into<String>,
        unit: impl Into<String>,
        values: impl IntoIterator<Item = f64>,
    ) -> Self {
        let extent = |(from, to): (f64, f64), v: f64| {
            if v.is_finite() { (from.min(v), to.max(v)) } else { (from, to) }
        };
        let (from, to) = values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), extent);
        let room = (to - from) * 0.03;
        Self::new(label, unit, from - room, to + room)
    }

    /// An axis on which equal factors are equally long, which holds all finite positive `values` with room at both ends.
    pub fn logarithmic_around(
        label: impl Into<String>,
        unit: impl Into<String>,
        values: impl IntoIterator<Item = f64>,
    ) -> Self {
        let logarithms = values.into_iter().filter(|v| *v > 0.0).map(f64::ln);
        let Self { label, unit, from, to, .. } = Self::around(label, unit, logarithms).sound();
        // Room for markers and what is written beside them.
        let room = 0.05 * (to - from);
        Self::logarithmic(label, unit, (from - room).exp(), (to + room).exp())
    }

    /// The axis, or one unit around it where its ends are the same or no numbers; twice and half on a logarithmic one.
    pub(super) fn sound(&self) -> Self {
        let Self { from, to, .. } = *self;
        let logarithmic = self.logarithmic && from > 0.0 && to > 0.0;
        let (from, to) = match (from.is_finite(), to.is_finite()) {
            (true, true) if from != to => (from, to),
            (true, true) if logarithmic => (from / 2.0, from * 2.0),
            (true, true) => (from - 0.5, from + 0.5),
            _ if logarithmic => (1.0, 10.0),
            _ => (0.0, 1.0),
        };
        Self { from, to, logarithmic, ..self.clone() }
    }

    /// Label and unit, as `range (m)`.
    pub(super) fn title(&self) -> String {
        if self.unit.is_empty() { self.label.clone() } else { format!("{} ({})", self.label, self.unit) }
    }

    /// Where `value` lies, 0 at the start of the axis and 1 at its end.
    pub(super) fn place(&self, value: f64) -> f64 {
        if self.logarithmic {
            // What is not positive lies off the axis; what is no number stays none.
            let least = self.from.min(self.to) * 1e-3;
            let value = if value < least { least } else { value };
            return (value / self.from).ln() / (self.to / self.from).ln();
        }
        (value - self.from) / (self.to - self.from)
    }

    /// Round values along the axis with their labels, at most about `most`; steps are 1, 2 or 5 times a power of ten, and so
    /// are the values on a logarithmic axis.
    pub(super) fn ticks(&self, most: i32) -> Vec<(f64, String)> {
        let (from, to) = self.ticked.unwrap_or((self.from, self.to));
        let (low, high) = (from.min(to), from.max(to));
        if self.logarithmic {
            return decades(low, high, most);
        }
        let rough = (high - low) / f64::from(most.max(1));
        let power = 10_f64.powf(rough.log10().floor());
        let steps = [0.5, 1.0, 2.0, 5.0, 10.0].map(|m| m * power);
        let wanted = steps.iter().position(|&step| step >= rough * 0.999).unwrap_or(steps.len() - 1);
        // One tick tells no scale; then the next finer step has more.
        let several = (high / steps[wanted]).floor() > (low / steps[wanted]).ceil();
        let step = steps[if several { wanted } else { wanted.saturating_sub(1) }];
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
        if !(last - first).is_finite() || last - first > 1_000.0 {
            return Vec::new();
        }
        let count = (last - first).max(-1.0) as i64 + 1;
        let tick = |n: i64| {
            let value = (first + n as f64) * step;
            // Not "-0".
            let value = if value.abs() < step / 2.0 { 0.0 } else { value };
            (value, label(value, decimals))
        };
        (0..count).map(tick).collect()
    }
}

/// Values with one digit on a logarithmic axis, for ticks without labels.
pub(super) fn digits(axis: &Axis) -> Vec<f64> {
    let (low, high) = (axis.from.min(axis.to), axis.from.max(axis.to));
    // Over more powers than that, they would run together.
    if !axis.logarithmic || high / low > 1e7 {
        return Vec::new();
    }
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let all = powers.flat_map(|power| (1..10).map(move |f| f64::from(f) * 10_f64.powi(power)));
    all.filter(|v| (low..=high).contains(v)).collect()
}

/// 1, 2 and 5 times each power of ten from `low` to `high`, or 1 alone, or every few powers where `most` are fewer.
fn decades(low: f64, high: f64, most: i32) -> Vec<(f64, String)> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let values = |factors: &'static [f64], step: usize| {
        let powers = (first..=last).step_by(step);
        let all = powers.flat_map(move |power| factors.iter().map(move |f| (f * 10_f64.powi(power), power)));
        let inside = all.filter(move |&(v, _)| v >= low * 0.999_999 && v <= high * 1.000_001);
        let label = |(v, power)| (v, factor_label(v, power, high >= LARGE));
        inside.map(label).collect::<Vec<_>>()
    };
    let choices = [(&[1.0, 2.0, 5.0][..], 1), (&[1.0, 3.0], 1), (&[1.0], 1), (&[1.0], 2), (&[1.0], 4)];
    let mut ticks = Vec::new();
    for (factors, step) in choices {
        ticks = values(factors, step);
        if ticks.len() as i32 <= most.max(2) {
            break;
        }
    }
    ticks
}

/// A tick's label on a logarithmic axis, where `value` is one digit times a power of ten. From ten thousand on they are
/// without zeros if there are `large` ones.
fn factor_label(value: f64, power: i32, large: bool) -> String {
    if !large || power < 4 {
        return label(value, (-power).max(0) as usize);
    }
    format!("{:.0}e{power}", value / 10_f64.powi(power))
}

/// A tick's label: plain for usual sizes, with a power of ten for others.
fn label(value: f64, decimals: usize) -> String {
    if decimals > 4 || value.abs() >= LARGE {
        return format!("{value:.2e}");
    }
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}
