use proptest::prelude::*;
use rfhoi_shared::units::{AntennaPort, ChannelIndex};

use super::*;

const SLLURP: &str = "\
timestamp,reader,antenna,rssi,epc,phase_angle,channel_index,doppler_frequency
1747162820.246058,192.168.0.219:5084,1,-68,b'303435fc8803d056d15b963f',756,12,-158
1747162820.134773,192.168.0.219:5084,2,-66,b'303435fc8803d056d15b963f',1516,12,-1328
1747162820.246058,192.168.0.219:5084,1,-68,b'303435fc8803d056d15b963f',756,12,-158
";
const RDA: &str = "\
0000 0011 1655628368535098 48.0 -61.0 4.405592822807561 0 \n\
0000 0000 1655628368537155 -316.5 -68.5 3.4913402732277192 0 \n";

fn read(time: u64) -> TagRead {
    TagRead {
        time: BridgeTime(time),
        epc: Epc::from_hex("303435fc8803d056d15b963f").unwrap(),
        antenna: AntennaPort(1),
        channel: ChannelIndex(12),
        phase: Some(PhaseCode(756)),
        rssi: CentiDbm(-6_800),
        doppler: Some(DopplerCode(-158)),
    }
}

fn round_trip(reads: &[TagRead]) -> ReadTable {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("reads.csv");
    write_csv(&path, reads).unwrap();
    ReadTable::open(path).unwrap()
}

fn error(contents: &str) -> String {
    ReadTable::parse("bad.csv", contents).unwrap_err().to_string()
}

#[test]
fn sllurp_rows_are_sorted_and_exact_duplicates_dropped() {
    let table = ReadTable::parse("t.csv", SLLURP).unwrap();
    assert_eq!(table.epoch, Some(ReaderTime(1_747_162_820_134_773)));
    assert_eq!(table.duplicates, 1);
    let first = TagRead {
        antenna: AntennaPort(2),
        phase: Some(PhaseCode(1_516)),
        rssi: CentiDbm(-6_600),
        doppler: Some(DopplerCode(-1_328)),
        ..read(0)
    };
    assert_eq!(table.reads, [first, read(111_285)]);
}

#[test]
fn rda_samples_give_codes_and_their_label() {
    let table = ReadTable::parse("0_0.txt", RDA).unwrap();
    assert_eq!(table.annotation, Some(Annotation { person: 0, activity: 0 }));
    assert_eq!(table.epoch, Some(ReaderTime(1_655_628_368_535_098)));
    let [first, second] = &table.reads[..] else { panic!("two reads") };
    assert_eq!((first.phase, first.doppler), (Some(PhaseCode(2_872)), Some(DopplerCode(768))));
    assert_eq!(second.rssi, CentiDbm(-6_850));
    assert_eq!(second.time, BridgeTime(2_057));
    assert_eq!(second.channel, ChannelIndex(0), "not recorded");
    assert_eq!(ReadTable::parse("c.txt", &RDA.replace(' ', ",")).unwrap(), table);
}

#[test]
fn our_table_keeps_the_bridges_time_and_what_was_not_reported() {
    let reads = [read(5), TagRead { phase: None, doppler: None, ..read(9) }];
    let table = round_trip(&reads);
    assert_eq!((table.reads.as_slice(), table.epoch, table.duplicates), (&reads[..], None, 0));
}

#[test]
fn bad_rows_are_named_by_file_line_and_field() {
    for (from, to, expected) in [
        ("1516", "4096", "bad.csv, line 3: phase_angle is `4096`, expected a 12-bit code"),
        ("b'303435fc8803d056d15b963f',1516", "b'xyz',1516", "line 3: epc is `xyz`"),
        ("1747162820.134773", "yesterday", "line 3: timestamp is `yesterday`"),
        (",12,-1328", ",12", "line 3: 7 fields where the header has 8"),
        (",2,-66", ",two,-66", "line 3: antenna is `two`"),
        (",2,-66", ",2,", "line 3: rssi is ``"),
        ("antenna,rssi", "port,rssi", "no column `antenna`; its header is `timestamp,reader,port"),
    ] {
        assert_ne!(SLLURP.replacen(from, to, 1), SLLURP);
        let error = error(&SLLURP.replacen(from, to, 1));
        assert!(error.contains(expected), "{error}");
    }
    let error = error(&RDA.replace("-68.5 3.49", "-68.5 13.49"));
    assert!(error.contains("bad.csv, line 2: phase is `13.49"), "{error}");
}

#[test]
fn empty_and_foreign_files_are_errors() {
    let header = SLLURP.lines().next().unwrap();
    for empty in ["", "\n \n", header, &COLUMNS.join(",")] {
        assert!(error(empty).contains("bad.csv holds no tag reads"), "{empty:?}");
    }
    assert!(error("x,y\n1,2\n").contains("neither the column"));
    assert!(ReadTable::open("/nonexistent.csv").unwrap_err().to_string().contains("/nonexistent.csv"));
    assert!(error(&RDA.replacen(" 0 \n", " 1 \n", 1)).contains("line 2: person or activity differs"));
}

prop_compose! {
    fn any_read()(
        time in any::<u64>(),
        epc in prop::collection::vec(any::<u8>(), 1..=62),
        antenna in any::<u16>(),
        channel in any::<u16>(),
        phase in prop::option::of(0..PhaseCode::CODES_PER_TURN),
        rssi in any::<i16>(),
        doppler in prop::option::of(any::<i16>()),
    ) -> TagRead {
        TagRead {
            time: BridgeTime(time),
            epc: Epc::new(&epc).unwrap(),
            antenna: AntennaPort(antenna),
            channel: ChannelIndex(channel),
            phase: phase.map(PhaseCode),
            rssi: CentiDbm(rssi),
            doppler: doppler.map(DopplerCode),
        }
    }
}

proptest! {
    #[test]
    fn tables_round_trip(mut reads in prop::collection::vec(any_read(), 1..30)) {
        reads.sort_by_key(|r| r.time);
        reads.dedup_by_key(|r| r.time);
        prop_assert_eq!(round_trip(&reads).reads, reads);
    }

    #[test]
    fn arbitrary_text_never_panics(
        start in prop::sample::select(vec!["", SLLURP, RDA, "time_us,epc,antenna,channel,phase_code,rssi_centidbm\n"]),
        text in "[-0-9a-fb',. \n\"\u{e9}]{0,80}",
        cut in any::<prop::sample::Index>(),
    ) {
        let start = &start[..cut.index(start.len() + 1)];
        let _ = ReadTable::parse("fuzz.csv", &format!("{start}{text}"));
    }
}
