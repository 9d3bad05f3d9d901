//! The chart as a picture: accuracy against the host's time, the bridge's instructions, and the link's bytes.

use rfhoi::plot::{Axis, Better, Figure, Front, Marker, Panel, Scatter, ScatterPoint, ScatterSeries};

use super::Way;
use super::points::Varied;
use super::table::{Chart, Row};

/// Of the picture, pixels.
const WIDTH: u32 = 1_200;
const HEIGHT: u32 = 640;

/// What is to the right.
struct Speed {
    title: &'static str,
    axis: &'static str,
    unit: &'static str,
    /// Whether equal factors are equally long: where it spans some.
    logarithmic: bool,
    of: fn(&Row) -> f64,
    /// Which rows differ in it.
    shown: fn(&Row) -> bool,
}

const SPEEDS: [Speed; 3] = [
    Speed {
        title: "From the last packet to the answer",
        axis: "host, one thread",
        unit: "ms",
        logarithmic: true,
        of: |row| row.host_ms,
        shown: |_| true,
    },
    Speed {
        title: "On the bridge",
        axis: "instructions a frame",
        unit: "million",
        logarithmic: false,
        of: |row| row.cost.mcu_instructions / 1e6,
        shown: |row| is_int8(row) && matches!(row.varied, None | Some(Varied::Radar)),
    },
    Speed {
        title: "From the bridge to the host",
        axis: "maps and reads",
        unit: "kB/s",
        logarithmic: false,
        of: |row| row.cost.host_link_bytes_s / 1e3,
        shown: |row| is_int8(row) && matches!(row.varied, None | Some(Varied::Radar | Varied::Antennas)),
    },
];

/// Its marker; f32 is hollow.
fn marker(way: Way) -> Marker {
    match way {
        Way::Int8 => Marker::Circle,
        Way::Flex => Marker::Square,
        Way::Ndarray => Marker::Triangle,
    }
}

fn is_int8(row: &Row) -> bool {
    row.precision == Way::Int8.precision()
}

pub(super) fn picture(chart: &Chart) -> Figure {
    let title = "Speed against accuracy, on the simulated site".to_owned();
    let panels: Vec<Panel> = SPEEDS.iter().map(|speed| panel(chart, speed)).collect();
    Figure { title: Some(title), columns: 1, width: WIDTH, panel_height: HEIGHT, ..Figure::new(panels) }
}

fn panel(chart: &Chart, speed: &Speed) -> Panel {
    let rows: Vec<&Row> = chart.rows.iter().filter(|row| (speed.shown)(row)).collect();
    let at = |row: &Row| ((speed.of)(row), row.hoi.mean);
    let point = |row: &&Row| {
        // The others are at the same height.
        let label = if is_int8(row) { row.name.clone() } else { String::new() };
        let point = ScatterPoint::new(at(row), label).with_interval(row.hoi.low, row.hoi.high);
        if row.default { point.as_default() } else { point }
    };
    let series = Way::ALL.map(|way| ScatterSeries {
        name: format!("{}, {}", way.precision(), way.backend()),
        marker: marker(way),
        hollow: way != Way::Int8,
        points: rows.iter().filter(|row| row.backend == way.backend()).map(point).collect(),
    });
    let lows = rows.iter().map(|row| row.hoi.low);
    let highs = rows.iter().map(|row| row.hoi.high);
    let speeds = rows.iter().map(|row| (speed.of)(row));
    let x = match speed.logarithmic {
        true => Axis::logarithmic_around(speed.axis, speed.unit, speeds),
        false => Axis::around(speed.axis, speed.unit, speeds),
    };
    Panel::Scatter(Scatter {
        title: speed.title.into(),
        x,
        y: Axis::around("HOI accuracy", "%", lows.chain(highs)),
        series: series.into_iter().filter(|series| !series.points.is_empty()).collect(),
        front: Some(Front::of("Pareto front", rows.iter().map(|row| at(row)), Better::Larger)),
    })
}
