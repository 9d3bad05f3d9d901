use expect_test::expect_file;
use proptest::prelude::*;
use rfhoi_shared::units::{Metres, MetresPerSecond};

use super::limits::{Board, LEAST_SAMPLES, Link, SAMPLE_RATES_KSPS};
use super::space::profiles;
use super::*;
use crate::simulate::scene::{NAMES, SITE, Scene};

/// The needs of a shipped scene, changed.
fn kitchen(change: impl FnOnce(&mut Needs)) -> Needs {
    let mut needs = Needs::of(&Scene::named("kitchen").unwrap());
    change(&mut needs);
    needs
}

fn text(scene: &str, needs: Needs) -> String {
    let plan = plan(needs, Means::default()).unwrap_or_else(|e| panic!("{scene}: {e}"));
    Text { scene, plan: &plan, host: None, beside: None }.to_string()
}

#[test]
fn shipped_scenes() {
    for name in NAMES {
        let scene = Scene::named(name).unwrap();
        let planned = plan(Needs::of(&scene), Means::default()).unwrap();
        // What a room's file says is what it needs; of the paper's rooms it is what ships as the default.
        assert_eq!(planned.config.profile, scene.radar.profile, "{name}");
        assert!(!SITE.contains(&name) || planned.config.profile == RadarProfile::bridge());
        let paper = paper(&planned);
        let text = Text { scene: name, plan: &planned, host: None, beside: Some((&paper, None)) };
        expect_file![format!("snapshots/{name}.txt")].assert_eq(&text.to_string());
    }
}

#[test]
fn other_rooms() {
    let drawer = kitchen(|n| {
        (n.depth, n.tags, n.antennas) = (Metres(0.8), 3, Antennas::UpTo(1));
    });
    expect_file!["snapshots/drawer.txt"].assert_eq(&text("drawer", drawer));
    let table = kitchen(|n| {
        (n.elevation, n.elevation_because) = (false, "all lies on one table".to_owned());
    });
    expect_file!["snapshots/table.txt"].assert_eq(&text("table", table));
    let as_the_paper = kitchen(|n| (n.tags, n.antennas) = (6, Antennas::Exactly(4)));
    expect_file!["snapshots/four-antennas.txt"].assert_eq(&text("four antennas", as_the_paper));
}

#[test]
fn refusals() {
    let mut sentences = String::new();
    let mut add = |name: &str, needs: Needs, means: Means| {
        let refusal = plan(needs, means).expect_err(name);
        sentences += &format!("{name}: {refusal}\n\n");
    };
    let usual = Means::default();
    let hall = |n: &mut Needs| (n.depth, n.fastest_hand) = (Metres(15.0), MetresPerSecond(6.0));
    add("a hall with fast hands", kitchen(hall), usual);
    add("a hall", kitchen(|n| n.depth = Metres(15.0)), usual);
    add("a hand at 12 m/s", kitchen(|n| n.fastest_hand = MetresPerSecond(12.0)), usual);
    add("30 tags x 4 antennas", kitchen(|n| (n.tags, n.antennas) = (30, Antennas::Exactly(4))), usual);
    add("tags as fast as arrows", kitchen(|n| n.fastest_tag = MetresPerSecond(20.0)), usual);
    add("raw samples over a UART", kitchen(|_| ()), Means { link: Link::Uart, ..usual });
    add("raw samples over USB", kitchen(|_| ()), Means { link: Link::Usb, ..usual });
    add("a cube that does not fit", kitchen(|n| n.depth = Metres(9.0)), usual);
    add(
        "fine Doppler, deep room",
        kitchen(|n| {
            (n.depth, n.velocity_resolution) = (Metres(6.0), MetresPerSecond(0.07));
        }),
        usual,
    );
    let slow = Board { instructions_s: 48e6, ..Board::NUCLEO_H743ZI };
    add("a slow board", kitchen(|_| ()), Means { board: slow, ..usual });
    add("nothing", kitchen(|n| n.depth = Metres(f32::NAN)), usual);
    add("no tag", kitchen(|n| n.tags = 0), usual);
    add("five antennas", kitchen(|n| n.antennas = Antennas::Exactly(5)), usual);
    expect_file!["snapshots/refusals.txt"].assert_eq(&sentences);
}

#[test]
fn elevation_is_needed_where_things_are_at_different_heights() {
    let scene = Scene::named("open-room").unwrap();
    assert!(Needs::of(&scene).elevation);
    // Far away, with what is lifted from a table alone.
    let mut far = scene.clone();
    far.tags.retain(|tag| tag.object.is_carried());
    far.places.retain(|place| place.position.distance(far.radar.position.truncate()) > 1.9);
    let needs = Needs::of(&far);
    assert!(!needs.elevation, "{}", needs.elevation_because);
    // Its file has the last word.
    far.stated.elevation = Some(true);
    assert!(Needs::of(&far).elevation);
}

#[test]
fn a_single_row_keeps_its_doppler_bin_with_fewer_chirps() {
    let row = plan(kitchen(|n| n.elevation = false), Means::default()).unwrap().config.profile;
    assert_eq!((row.tx_slots(), row.rx_count(), row.loops, row.samples), (1, 4, 64, 128));
    assert!(row.velocity_span() >= MetresPerSecond(4.0) && row.velocity_bin() <= MetresPerSecond(0.141));
    let one = kitchen(|n| (n.elevation, n.azimuth) = (false, false));
    assert_eq!(plan(one, Means::default()).unwrap().config.profile.virtual_count(), 1);
}

#[test]
fn the_bridge_takes_the_plan() {
    for needs in [kitchen(|_| ()), kitchen(|n| n.depth = Metres(6.0)), kitchen(|n| n.elevation = false)] {
        let plan = plan(needs, Means::default()).unwrap();
        let reader = rfhoi_shared::config::Endpoint { address: [192, 168, 33, 40], port: 5084 };
        let config = plan.bridge(Some(reader));
        config.validate(plan.means.board.cube_bytes).unwrap();
        assert_eq!(config.radar.profile, plan.config.profile);
        let antennas = config.reader.as_ref().unwrap().antennas.len();
        assert_eq!(antennas, usize::from(plan.config.antennas));
        let text = crate::bridge::settings::write(&config);
        let path = std::path::Path::new("bridge.toml");
        let again = crate::bridge::settings::Settings::parse(path, &text).unwrap().config(path).unwrap();
        assert_eq!(again, config);
    }
}

#[test]
fn the_uplink_is_what_the_image_sends() {
    let table = include_str!("../../../firmware/boards/qemu-an500/instructions.tsv");
    let kept = |name: &str| {
        let line = table.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        line.split_whitespace().next().unwrap().parse::<usize>().unwrap()
    };
    let uplink = plan(kitchen(|_| ()), Means::default()).unwrap().uplink;
    assert_eq!(uplink.frame_packets, kept("uplink_packets"));
    assert!(uplink.frame_bytes.abs_diff(kept("uplink_bytes")) <= 32, "numbers differ in length: {uplink:?}");
}

#[test]
fn this_computer_can_be_timed() {
    let plan = plan(kitchen(|n| n.depth = Metres(1.0)), Means::default()).unwrap();
    assert!(host_time(&plan) > std::time::Duration::ZERO);
}

/// Every configuration and what it breaks. Where a profile itself is at fault, with one size of maps and one antenna.
fn space(problem: &Problem) -> Vec<(Config, Result<Cost, Binding>)> {
    let mut all = Vec::new();
    for profile in profiles(&problem.needs) {
        'profile: for map_points in MAP_POINTS {
            for angle_points in MAP_POINTS {
                for antennas in 1..=4 {
                    let config = Config { profile: profile.clone(), map_points, angle_points, antennas };
                    let checked = problem.check(&config);
                    let radar = checked.as_ref().is_err_and(Binding::is_of_radar);
                    all.push((config, checked));
                    if radar {
                        break 'profile;
                    }
                }
            }
        }
    }
    all
}

fn needs() -> impl Strategy<Value = (Needs, Means)> {
    let radar = (0.3..20.0_f32, 0.3..15.0_f32, 0.02..0.4_f32, 0.03..1.0_f32, any::<[bool; 2]>());
    let reader = (1..60_u8, 0.2..8.0_f32, 1..=4_u8, any::<bool>());
    let link = prop_oneof![
        4 => Just(Link::FAST_ETHERNET),
        1 => Just(Link::Ethernet(1000.0)),
        1 => Just(Link::Usb),
        1 => Just(Link::Uart)
    ];
    (radar, reader, link).prop_map(|((depth, hand, range, velocity, [azimuth, elevation]), reader, link)| {
        let (tags, tag, antennas, exactly) = reader;
        let needs = Needs {
            depth: Metres(depth),
            fastest_hand: MetresPerSecond(hand),
            fastest_tag: MetresPerSecond(tag),
            tags,
            antennas: if exactly { Antennas::Exactly(antennas) } else { Antennas::UpTo(antennas) },
            range_resolution: Metres(range),
            velocity_resolution: MetresPerSecond(velocity),
            azimuth,
            elevation,
            ..Needs::default()
        };
        (needs, Means { link, ..Means::default() })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// A plan meets every need within every limit, and nothing smaller does; a refusal names what all that comes so far
    /// breaks.
    #[test]
    fn plans_are_right_and_smallest_or_refused_with_reason((needs, means) in needs()) {
        let problem = Problem::new(needs.clone(), means);
        match problem.search() {
            Ok((config, cost)) => {
                prop_assert_eq!(problem.check(&config), Ok(cost.clone()));
                let p = &config.profile;
                prop_assert!(p.range_bin() <= needs.range_resolution && p.range_span() >= needs.depth);
                prop_assert!(p.velocity_span() >= needs.fastest_hand);
                prop_assert!(p.velocity_bin() <= needs.velocity_resolution);
                prop_assert!(p.validate().is_ok() && p.fits_stock_firmware() && p.samples >= LEAST_SAMPLES);
                prop_assert!(SAMPLE_RATES_KSPS.contains(&p.sample_rate_ksps));
                prop_assert!(means.link.load_bit_s(p) <= means.link.capacity_bit_s());
                prop_assert!(cost.cubes >= 1 && cost.cube_bytes <= means.board.cube_bytes);
                prop_assert!(cost.instructions.total() <= cost.instructions_there);
                prop_assert_eq!(p.tx_slots(), if needs.elevation { 3 } else { 1 });
                prop_assert_eq!(p.rx_count(), if needs.azimuth { 4 } else { 1 });
                prop_assert!(cost.reading.interval <= p.frame_period());
                for (name, neighbour) in problem.neighbours(&config) {
                    prop_assert!(problem.check(&neighbour).is_err(), "{} would do", name);
                }
                let order = space::by_size(&needs);
                for (other, checked) in space(&problem) {
                    let smaller = order(&other.profile, p).is_lt()
                        || other.profile == *p
                            && (other.map_points < config.map_points
                                || other.angle_points < config.angle_points
                                || other.antennas > config.antennas);
                    prop_assert!(!smaller || checked.is_err(), "{:?} would do", other);
                }
            }
            Err(Refusal::Bound { binding, .. }) => {
                for (config, checked) in space(&problem) {
                    let broken = checked.err();
                    prop_assert!(broken.is_some_and(|b| b.stage() <= binding.stage()), "{:?}", config);
                }
            }
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}
