//! Texts of radar profiles: CLI profiles and mmWave Studio's log, arbitrary or edited from ones that are right.
#![no_main]

use std::fmt::Write as _;

use libfuzzer_sys::fuzz_target;
use rfhoi_firmware::mmwave::cfg::{self, Board, CliProfile, DemoOptions};
use rfhoi_firmware::mmwave::studio::StudioProfile;
use rfhoi_shared::array::{AntennaArray, Mounting};
use rfhoi_shared::radar::{IqOrder, RadarProfile, SampleFormat};

const LOG: &str = "\
t: API:select_chip_version,XWR1843,0,
t: API:ChannelConfig,7,15,0,
t: API:AdcOutConfig,2,1,0,
t: API:DataFmtConfig,15,2,1,1,1,0,
t: API:DataPathConfig,1,1,0,2,0,
t: API:ProfileConfig,0,1435384036,10000,600,13000,0,0,621,0,256,10000,0,0,30,0,
t: API:ChirpConfig,0,0,0,0,0,0,0,1,0,
t: API:ChirpConfig,1,1,0,0,0,0,0,2,0,
t: API:ChirpConfig,2,2,0,0,0,0,0,4,0,
t: API:FrameConfig,0,2,8,16,20000000,0,512,0,
";

const ARRAYS: [AntennaArray; 4] = [
    AntennaArray::Awr1843Aop,
    AntennaArray::Xwr1843Boost,
    AntennaArray::Xwr1642Boost,
    AntennaArray::Iwr6843Aop,
];
const FORMATS: [SampleFormat; 3] =
    [SampleFormat::Complex(IqOrder::IFirst), SampleFormat::Complex(IqOrder::QFirst), SampleFormat::Real];

/// Takes numbers off the front of the data, zeros after its end.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn u8(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes([self.u8(), self.u8(), self.u8(), self.u8()])
    }

    fn below(&mut self, end: usize) -> usize {
        let number = usize::from(self.u8()) | usize::from(self.u8()) << 8;
        number % end.max(1)
    }
}

fn board(numbers: &mut Numbers<'_>) -> Board {
    Board { array: ARRAYS[numbers.below(ARRAYS.len())], mounting: Mounting::default() }
}

/// A profile that may break any rule, but often none.
fn profile(numbers: &mut Numbers<'_>) -> RadarProfile {
    let chosen = numbers.u8();
    let mut pick = |bit: u8, usual: u32| if chosen & 1 << bit == 0 { usual } else { numbers.u32() };
    let usual = RadarProfile::bridge();
    let mut profile = RadarProfile {
        start_khz: pick(0, usual.start_khz),
        slope_khz_per_us: pick(1, usual.slope_khz_per_us),
        idle_ns: pick(2, usual.idle_ns),
        adc_start_ns: pick(3, usual.adc_start_ns),
        ramp_end_ns: pick(4, usual.ramp_end_ns),
        sample_rate_ksps: pick(5, usual.sample_rate_ksps),
        frame_period_us: pick(6, usual.frame_period_us),
        ..usual
    };
    profile.samples = 16 << numbers.below(7);
    profile.loops = 1 << numbers.below(9);
    profile.format = FORMATS[numbers.below(FORMATS.len())];
    profile.rx_mask = numbers.u8() % 17;
    profile.tx_order = (0..numbers.below(4)).map(|_| numbers.u8()).collect();
    profile.array = ARRAYS[numbers.below(ARRAYS.len())];
    profile
}

/// Written and read, a profile is itself.
fn survives(profile: &RadarProfile, demo: &DemoOptions) -> String {
    let mut text = String::new();
    cfg::write(profile, demo, &mut text).expect("a string takes all");
    if profile.validate().is_ok() {
        assert!(text.len() <= cfg::TEXT_CAPACITY, "{} bytes", text.len());
        let board = Board { array: profile.array, mounting: profile.mounting };
        let read = CliProfile::parse(&text, board);
        assert_eq!(read, Ok(CliProfile { radar: profile.clone(), demo: *demo }), "{text}");
    }
    text
}

fn parse(text: &str, board: Board) {
    match CliProfile::parse(text, board) {
        Ok(read) => {
            assert_eq!(read.radar.validate(), Ok(()));
            survives(&read.radar, &read.demo);
        }
        Err(error) => {
            assert!(error.line as usize <= text.lines().count());
            let _ = error.to_string();
        }
    }
    match StudioProfile::parse(text, board) {
        Ok(read) => {
            assert_eq!(read.radar.validate(), Ok(()));
            survives(&read.radar, &DemoOptions { frames: read.frames, ..DemoOptions::default() });
        }
        Err(error) => assert!(error.line as usize <= text.lines().count()),
    }
}

/// Changes lines and arguments of a text.
fn edited(text: &str, numbers: &mut Numbers<'_>) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    while !numbers.0.is_empty() && !lines.is_empty() {
        let kind = numbers.u8();
        let (at, other) = (numbers.below(lines.len()), numbers.below(lines.len()));
        match kind % 6 {
            0 => drop(lines.remove(at)),
            1 => lines.insert(at, lines[other].clone()),
            2 => lines.swap(at, other),
            kind => {
                let separator = if lines[at].contains(',') { ',' } else { ' ' };
                let mut arguments: Vec<String> = lines[at].split(separator).map(str::to_owned).collect();
                let argument = numbers.below(arguments.len());
                arguments[argument].clear();
                let _ = match kind {
                    3 => write!(arguments[argument], "{}", numbers.u8()),
                    4 => write!(arguments[argument], "{}.{}", numbers.u8() as i8, numbers.u32()),
                    _ => write!(arguments[argument], "{}", char::from(numbers.u8())),
                };
                lines[at] = arguments.join(&separator.to_string());
            }
        }
    }
    lines.join("\n")
}

fuzz_target!(|data: &[u8]| {
    let Some((&kind, data)) = data.split_first() else { return };
    let mut numbers = Numbers(data);
    let board = board(&mut numbers);
    match kind % 4 {
        0 => parse(&String::from_utf8_lossy(numbers.0), board),
        1 => {
            let profile = profile(&mut numbers);
            let demo = DemoOptions { frames: numbers.u32() as u16, ..DemoOptions::default() };
            survives(&profile, &demo);
        }
        2 => {
            let text = survives(&profile(&mut numbers), &DemoOptions::default());
            parse(&edited(&text, &mut numbers), board);
        }
        _ => parse(&edited(LOG, &mut numbers), board),
    }
});
