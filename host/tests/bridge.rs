//! `rfhoi bridge` as a user meets it, against a simulated bridge on a UDP socket of this computer.

use std::net::{SocketAddr, UdpSocket};
use std::path::Path;
use std::process::{Command as Process, Output};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rfhoi_shared::config::BridgeConfig;
use rfhoi_shared::radar::RangeGate;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, PhaseCode};
use rfhoi_shared::wire::{
    Ack, Command, FrameInfo, Hello, LogScale, MAX_PACKET, MapKind, MapRows, Message, Notice, Packet,
    RadarState, Refusal, Request, RestartReason, Sequencer, Telemetry,
};
use serde_json::Value;

/// Enough for the default configuration's cube of 221 184 bytes, not for twice that.
const CUBE_BYTES: u32 = 256 * 1024;
/// From one radar frame, or telemetry, to the next.
const PERIOD: Duration = Duration::from_millis(50);
const TAG: &str = "e2806995000050182224441d";

/// What a test makes the bridge do, and what it did.
#[derive(Debug, Default)]
struct Behaviour {
    /// Datagrams from the host that get lost before one is heard.
    deaf: u32,
    /// Commands that are carried out but whose answer gets lost.
    mute: u32,
    /// Configurations are refused with this.
    refusal: Option<Refusal>,
    /// Says on every hello.
    notice: Option<&'static str>,
    /// Requests in the order in which they were carried out.
    done: Vec<&'static str>,
}

/// A simulated bridge: the commands of the contract, frames of one map row, reads of one tag.
struct Bridge {
    address: SocketAddr,
    behaviour: Arc<Mutex<Behaviour>>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Bridge {
    fn start(behaviour: Behaviour) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(PERIOD / 5)).unwrap();
        let (behaviour, end) = (Arc::new(Mutex::new(behaviour)), Arc::new(AtomicBool::new(false)));
        let address = socket.local_addr().unwrap();
        let mut firmware = Firmware {
            socket,
            behaviour: Arc::clone(&behaviour),
            config: BridgeConfig::default(),
            boot: 7,
            running: true,
            began: Instant::now(),
            sequencer: Sequencer::new(7),
            host: None,
            last: None,
            frame: 0,
        };
        let ended = Arc::clone(&end);
        let thread = std::thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                firmware.turn();
            }
        });
        Self { address, behaviour, end, thread: Some(thread) }
    }

    fn address(&self) -> String {
        self.address.to_string()
    }

    fn done(&self) -> Vec<&'static str> {
        self.behaviour.lock().unwrap().done.clone()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

struct Firmware {
    socket: UdpSocket,
    behaviour: Arc<Mutex<Behaviour>>,
    config: BridgeConfig,
    boot: u16,
    running: bool,
    began: Instant,
    sequencer: Sequencer,
    host: Option<SocketAddr>,
    /// The last command and its outcome.
    last: Option<(u16, Result<(), Refusal>)>,
    frame: u32,
}

impl Firmware {
    fn now(&self) -> BridgeTime {
        BridgeTime(self.began.elapsed().as_micros() as u64)
    }

    fn say(&mut self, to: SocketAddr, message: Message<'_>) {
        self.say_at(self.now(), to, message);
    }

    fn say_at(&mut self, time: BridgeTime, to: SocketAddr, message: Message<'_>) {
        let packet = self.sequencer.wrap(time, message);
        self.socket.send_to(packet.encode(&mut [0; MAX_PACKET]).unwrap(), to).unwrap();
    }

    fn turn(&mut self) {
        let mut buffer = [0; MAX_PACKET];
        if let Ok((bytes, from)) = self.socket.recv_from(&mut buffer)
            && let Ok(Packet { message: Message::Command(command), .. }) = Packet::decode(&buffer[..bytes])
        {
            self.command(from, command);
        }
        if let Some(host) = self.host.filter(|_| self.began.elapsed() > PERIOD * (self.frame + 1)) {
            self.data(host);
            self.frame += 1;
        }
    }

    fn data(&mut self, host: SocketAddr) {
        // Of one moment, however long this thread waits for its turn: the load is a ratio of two times.
        let now = self.now();
        let telemetry = Telemetry {
            radar: if self.running { RadarState::Streaming } else { RadarState::Stopped },
            restart: if self.boot == 7 { RestartReason::PowerOn } else { RestartReason::Command },
            busy_us: now.0 / 4,
            bridge_decicelsius: Some(412),
            ..Telemetry::default()
        };
        if self.running {
            let gate = RangeGate { first: 0, bins: 1 };
            let scale = LogScale { floor_db: -100.0, step_db: 0.5 };
            let map = MapKind::RangeDoppler;
            let rows =
                MapRows { map, frame: self.frame, gate, first_row: 0, columns: 4, scale, codes: &[1; 4] };
            self.say(host, Message::MapRows(rows));
            let info = FrameInfo { frame: self.frame, latency_us: 12_500, ..FrameInfo::default() };
            self.say(host, Message::Frame(info));
            let read = TagRead {
                time: self.now(),
                epc: Epc::from_hex(TAG).unwrap(),
                antenna: AntennaPort(1),
                channel: ChannelIndex(1),
                phase: Some(PhaseCode(1)),
                rssi: CentiDbm(-5000),
                doppler: None,
            };
            self.say(host, Message::Tags([read].into_iter().collect()));
        }
        self.say_at(now, host, Message::Telemetry(telemetry));
    }

    fn command(&mut self, from: SocketAddr, Command { id, request }: Command) {
        let behaviour = Arc::clone(&self.behaviour);
        let mut behaviour = behaviour.lock().unwrap();
        if behaviour.deaf > 0 {
            behaviour.deaf -= 1;
            return;
        }
        let repeated = self.last.filter(|(last, _)| *last == id).map(|(_, outcome)| outcome);
        let outcome = match (repeated, &request) {
            (Some(outcome), _) => outcome,
            (None, Request::Configure(_)) if self.running => Err(Refusal::Busy),
            (None, Request::Configure(config)) => match behaviour.refusal {
                Some(refusal) => Err(refusal),
                None => config.validate(CUBE_BYTES).map_err(Refusal::Config),
            },
            (None, _) => Ok(()),
        };
        self.last = Some((id, outcome));
        if repeated.is_none() && outcome.is_ok() {
            behaviour.done.push(match &request {
                Request::Hello => "hello",
                Request::Identify => "identify",
                Request::GetConfig => "get",
                Request::Configure(_) => "configure",
                Request::Start => "start",
                Request::Stop => "stop",
                Request::Restart => "restart",
            });
            match &request {
                Request::Hello => self.host = Some(from),
                Request::Start => self.running = true,
                Request::Stop => self.running = false,
                Request::Configure(config) => self.config = config.clone(),
                Request::GetConfig | Request::Restart | Request::Identify => {}
            }
        }
        let lost =
            behaviour.mute > 0 && !matches!(request, Request::Hello | Request::Identify | Request::GetConfig);
        behaviour.mute -= u32::from(lost);
        if !lost {
            self.answer(from, id, &request, outcome, behaviour.notice);
        }
        if matches!(request, Request::Restart | Request::Configure(_))
            && repeated.is_none()
            && outcome.is_ok()
        {
            self.restart();
        }
    }

    fn answer(
        &mut self,
        to: SocketAddr,
        id: u16,
        request: &Request,
        outcome: Result<(), Refusal>,
        notice: Option<&str>,
    ) {
        match request {
            Request::Hello | Request::Identify => {
                let hello = Hello {
                    board: "simulated".try_into().unwrap(),
                    id: [2, 0, 0, 0, 0, 9],
                    firmware: [0, 1, 0],
                    cube_bytes: CUBE_BYTES,
                    profile: self.config.radar.profile.fingerprint(),
                };
                self.say(to, Message::Hello(hello));
                if let Some(text) = notice {
                    self.say(to, Message::Notice(Notice { text: text.try_into().unwrap() }));
                }
            }
            Request::GetConfig => self.say(to, Message::Config(self.config.clone())),
            _ => {}
        }
        let at = self.now();
        self.say(to, Message::Ack(Ack { id, at, outcome }));
    }

    /// As after a reset: with another boot number, running, and without a memory of commands or hosts.
    fn restart(&mut self) {
        self.boot += 1;
        self.sequencer = Sequencer::new(self.boot);
        self.running = true;
        self.began = Instant::now();
        (self.host, self.last, self.frame) = (None, None, 0);
    }
}

fn rfhoi(arguments: &[&str]) -> Output {
    Process::new(env!("CARGO_BIN_EXE_rfhoi")).arg("bridge").args(arguments).output().unwrap()
}

fn printed(arguments: &[&str]) -> String {
    let output = rfhoi(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&printed(&[arguments, &["--json"]].concat())).unwrap()
}

/// Runs a command that must fail, and returns its one sentence.
fn refused(arguments: &[&str]) -> String {
    let output = rfhoi(arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?} went through");
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.starts_with("rfhoi: ") && text.trim_end().lines().count() == 1, "{text}");
    text
}

/// A file with this configuration, in a folder that goes with it.
fn file(text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bridge.toml");
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap().to_owned();
    (folder, path)
}

#[test]
fn list_says_who_answers() {
    let bridge = Bridge::start(Behaviour { deaf: 1, ..Behaviour::default() });
    let found = json(&["list", "--address", &bridge.address()]);
    let one = &found["bridges"][0];
    assert_eq!(found["bridges"].as_array().unwrap().len(), 1, "{found}");
    assert_eq!((&one["board"], &one["id"]), (&"simulated".into(), &"02:00:00:00:00:09".into()));
    assert_eq!((&one["firmware"], &one["profile"]), (&"0.1.0".into(), &"bridge".into()));
    assert_eq!(
        (one["cube_bytes"].as_u64(), &one["address"]),
        (Some(CUBE_BYTES.into()), &bridge.address().into())
    );
}

#[test]
fn show_tells_identity_configuration_and_health() {
    let bridge = Bridge::start(Behaviour { notice: Some("no reader is configured"), ..Behaviour::default() });
    let shown = json(&["show", &bridge.address(), "--seconds", "0.5"]);
    assert_eq!(shown["board"], "simulated");
    assert_eq!(shown["configuration"]["network"]["address"], "192.168.33.30/24");
    assert_eq!(shown["configuration"]["processing"]["gate_bins"], 72);
    assert_eq!(shown["reach"]["cube_bytes"], 221_184);
    let telemetry = shown["telemetry"].as_array().unwrap();
    let last = telemetry.last().expect("telemetry came");
    assert_eq!((&last["radar"], &last["restart_reason"]), (&"streaming".into(), &"power on".into()));
    assert!((last["load"].as_f64().unwrap() - 0.25).abs() < 0.01, "{last}");
    assert_eq!(last["bridge_celsius"], 41.2);
    assert!(shown["notices"].to_string().contains("no reader is configured"), "{shown}");

    let text = printed(&["show", &bridge.address(), "--seconds", "0.3"]);
    for words in ["gate_bins", "started by: power on", "radar streaming, reader not configured, load 25 %"] {
        assert!(text.contains(words), "{words} is not in: {text}");
    }
}

#[test]
fn get_change_and_set() {
    let bridge = Bridge::start(Behaviour::default());
    let (_folder, path) = file("");
    let address = bridge.address();
    printed(&["get", &address, "--out", &path]);
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(text, printed(&["get", &address]), "to the file as to the screen");
    assert_eq!(text, printed(&["config"]), "the bridge has the default configuration");

    let unchanged = json(&["set", &address, &path]);
    assert_eq!(unchanged["changed"], false);
    assert!(!bridge.done().contains(&"configure"));

    std::fs::write(&path, text.replace("depth_m = 3.05", "depth_m = 2.0")).unwrap();
    let changed = json(&["set", &address, &path]);
    assert_eq!((&changed["changed"], &changed["board"]), (&true.into(), &"simulated".into()));
    let done = bridge.done();
    let end: Vec<_> = done.iter().skip_while(|d| **d != "stop").collect();
    assert_eq!(end, [&"stop", &"configure", &"identify", &"get"]);
    assert_eq!(json(&["get", &address])["scene"]["depth_m"], 2.0);
}

#[test]
fn lost_answers_do_not_do_things_twice() {
    let bridge = Bridge::start(Behaviour { mute: 2, ..Behaviour::default() });
    let (_folder, path) = file("[scene]\ndepth_m = 2.5\n");
    let changed = json(&["set", &bridge.address(), &path]);
    assert_eq!(changed["changed"], true);
    let done = bridge.done();
    assert_eq!(done.iter().filter(|d| **d == "stop").count(), 1, "the repetition was answered: {done:?}");
    // Here it is the first configuration whose answer is lost, and with it the bridge's memory of it.
    let bridge = Bridge::start(Behaviour { mute: 1, ..Behaviour::default() });
    assert_eq!(json(&["restart", &bridge.address()])["done"], "restart");
    assert_eq!(bridge.done().iter().filter(|d| **d == "restart").count(), 2, "it cannot know");
}

#[test]
fn start_stop_and_restart() {
    let bridge = Bridge::start(Behaviour { deaf: 2, ..Behaviour::default() });
    let address = bridge.address();
    assert_eq!(json(&["stop", &address])["done"], "stop");
    let shown = json(&["show", &address, "--seconds", "0.3"]);
    assert_eq!(shown["telemetry"][0]["radar"], "stopped");
    assert_eq!(json(&["start", &address])["done"], "start");
    assert_eq!(json(&["restart", &address])["board"], "simulated");
    let shown = json(&["show", &address, "--seconds", "0.3"]);
    assert_eq!(shown["telemetry"][0]["restart_reason"], "command or new configuration");
    assert_eq!(bridge.done()[..2], ["stop", "hello"]);
}

#[test]
fn refusals_are_told_in_full() {
    let bridge = Bridge::start(Behaviour { refusal: Some(Refusal::NotKept), ..Behaviour::default() });
    let address = bridge.address();
    // Refused here, before the bridge is disturbed.
    let (_folder, path) = file("[profile]\nbase = \"fine\"\n");
    let sentence = refused(&["set", &address, &path]);
    assert!(sentence.contains("442368 bytes, the bridge has 262144"), "{sentence}");
    assert!(sentence.contains(&path) && sentence.contains("depth_m of [scene]"), "{sentence}");
    let (_folder, path) = file("[scene]\ndepht_m = 2.0\n");
    let sentence = refused(&["set", &address, &path]);
    assert!(sentence.contains("line 2") && sentence.contains("depht_m"), "{sentence}");
    assert!(!bridge.done().contains(&"stop"));
    // Refused by the bridge.
    let (_folder, path) = file("[scene]\ndepth_m = 2.0\n");
    let sentence = refused(&["set", &address, &path]);
    for words in ["nothing has changed", "`rfhoi bridge start`", &address, "memory did not take"] {
        assert!(sentence.contains(words), "{words} is not in: {sentence}");
    }
}

#[test]
fn silence_is_told_with_what_to_check() {
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = silent.local_addr().unwrap().to_string();
    for arguments in [&["get", &address][..], &["list", "--address", &address, "--seconds", "0.2"]] {
        let sentence = refused(arguments);
        for words in [&address, "does not answer", "cable", "firewall", "rfhoi bridge list"] {
            assert!(sentence.contains(words), "{words} is not in: {sentence}");
        }
    }
    let taken = silent.local_addr().unwrap().port().to_string();
    let sentence = refused(&["get", &address, "--port", &taken]);
    // The socket here has this port of 127.0.0.1, so that all of it cannot be had.
    assert!(sentence.contains(&taken) && sentence.contains("another program"), "{sentence}");
    let sentence = refused(&["get", "no-such-host.invalid"]);
    assert!(sentence.contains("no-such-host.invalid") && sentence.contains("IP:PORT"), "{sentence}");
}

#[test]
fn watch_shows_and_records() {
    let bridge = Bridge::start(Behaviour::default());
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("session.pcap.gz");
    let record = record.to_str().unwrap();
    let printed = printed(&["watch", &bridge.address(), "--seconds", "2.2", "--record", record, "--json"]);
    let lines: Vec<Value> = printed.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let (summary, seconds) = lines.split_last().unwrap();
    assert_eq!(seconds.len(), 3, "two whole seconds and a rest");
    for line in seconds {
        let rate = line["frames_per_s"].as_f64().unwrap();
        // 20 a second, but for what a busy machine puts off, and the last line has but a few frames.
        assert!((2.0..60.0).contains(&rate), "{line}");
        assert_eq!((&line["latency_max_ms"], line["packets_lost"].as_u64()), (&12.5.into(), Some(0)));
        assert!(line["tags_reads_per_s"][TAG].as_f64().unwrap() > 2.0, "{line}");
        assert_eq!(line["health"]["radar"], "streaming");
    }
    assert_eq!((summary["packets_lost"].as_u64(), summary["tags"].as_u64()), (Some(0), Some(1)));
    assert_eq!(summary["recording"], record);

    let inspected =
        Process::new(env!("CARGO_BIN_EXE_rfhoi")).args(["inspect", "--json", record]).output().unwrap();
    let inspected: Value = serde_json::from_slice(&inspected.stdout).unwrap();
    for figure in ["packets", "frames", "packets_lost"] {
        assert_eq!(inspected["uplink"][figure], summary[figure], "{figure}");
    }
    let out = folder.path().join("out");
    let replay = ["replay", record, "--profile", "bridge", "--out", out.to_str().unwrap(), "--json"];
    let replayed = Process::new(env!("CARGO_BIN_EXE_rfhoi")).args(replay).output().unwrap();
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
    let replayed: Value = serde_json::from_slice(&replayed.stdout).unwrap();
    // The end may have cut a frame.
    let cut = replayed["radar_frames"].as_u64().unwrap() - summary["frames"].as_u64().unwrap();
    assert!(cut <= 1, "{replayed}");
}

#[test]
#[cfg(unix)]
fn ctrl_c_leaves_a_whole_recording() {
    let bridge = Bridge::start(Behaviour::default());
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("session.pcap");
    let watch = |more: &[&str]| {
        let process = Process::new(env!("CARGO_BIN_EXE_rfhoi"))
            .args(["bridge", "watch", &bridge.address(), "--record", record.to_str().unwrap()])
            .args(more)
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(1500));
        let interrupted = Process::new("kill").args(["-INT", &process.id().to_string()]).status().unwrap();
        assert!(interrupted.success());
        process.wait_with_output().unwrap()
    };
    let output = watch(&[]);
    assert_eq!(output.status.code(), Some(0), "Ctrl-C is how it ends: {output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("frames/s") && text.contains("..441d"), "{text}");
    assert!(whole(&record) > 10);
    std::fs::remove_file(&record).unwrap();
    let output = watch(&["--seconds", "60"]);
    assert_eq!(output.status.code(), Some(130), "it was asked for a minute: {output:?}");
    assert!(whole(&record) > 10);
}

/// Packets of a recording that is whole.
fn whole(path: &Path) -> usize {
    rfhoi::recording::Recording::open(path).unwrap().collect::<Result<Vec<_>, _>>().unwrap().len()
}
