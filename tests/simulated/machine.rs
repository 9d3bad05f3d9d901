//! The bridge's image in QEMU, and around it the devices as this process plays them, on loopback sockets.
//!
//! ```text
//! recorder: UDP 4096 (answers), UDP to 4098 --+
//! console: the demo's command line, UART0 ----+-- QEMU mps2-an500: the image -- UDP 4780 --> host
//! reader: `llrpkit emulate`, TCP -------------+
//! ```
//!
//! QEMU's user network gives the image one host, at the recorder's factory address, which stands for all devices. QEMU
//! counts one instruction as a nanosecond, and lets time go on as outside while the processor sleeps.

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, UdpSocket};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use rfhoi_firmware::dca1000::command::{self, Answer};
use rfhoi_firmware::dca1000::{CONFIG_PORT, DATA_PORT};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{self, Ack, BRIDGE_PORT, Hello, MAX_PACKET, Message, Request, Sequencer, Telemetry};

use super::console::Console;
use super::world::Host;
use rfhoi::receive::Received;

/// The address of the image: the default configuration's.
const BRIDGE: &str = "192.168.33.30";
/// The address under which the image sees this machine: the recorder's by default.
pub const DEVICES: [u8; 4] = [192, 168, 33, 180];
/// Longest wait for anything that the image does by itself; it comes up in less than a second.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// Wait before a command is sent again.
const AGAIN: Duration = Duration::from_millis(500);
/// Pause where nothing has happened.
const PAUSE: Duration = Duration::from_micros(50);

/// The folder of the workspace.
fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Whether something that is missing here (QEMU, a toolchain, the emulator) is a failure: continuous integration sets
/// `RFHOI_REQUIRE`.
pub fn missing(what: &str) {
    assert!(std::env::var_os("RFHOI_REQUIRE").is_none(), "needed here: {what}");
    let _ = writeln!(std::io::stderr(), "SKIPPED: {what}");
}

/// Builds an image of `board`; `None` where a toolchain is missing, which is told.
///
/// # Panics
/// If it does not build.
pub fn image(board: &str, binary: &str) -> Option<PathBuf> {
    let script = workspace().join("firmware/boards/build");
    let output =
        Command::new(script).args([board, "build", "--bin", binary]).output().expect("the script runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    if let Some(line) = errors.lines().find(|line| line.starts_with("missing:")) {
        missing(line);
        return None;
    }
    assert!(output.status.success(), "{errors}");
    let target = std::env::var_os("RFHOI_BOARD_TARGET").map(PathBuf::from);
    let target = target.unwrap_or_else(|| workspace().join("target/boards"));
    Some(target.join("thumbv7em-none-eabihf/release").join(binary))
}

/// Runs the image that measures stages; what it prints.
///
/// # Panics
/// If it fails.
pub fn run_stages(image: &Path) -> String {
    let mut qemu = Command::new("qemu-system-arm");
    qemu.args(["-M", "mps2-an500", "-nographic", "-monitor", "none", "-serial", "none"]);
    // Nothing waits for the time outside.
    qemu.args(["-icount", "shift=0,sleep=off", "-semihosting-config", "enable=on,target=native"]);
    let output = qemu.arg("-kernel").arg(image).output().expect("QEMU was there before");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    text
}

fn free_udp_port() -> u16 {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback has a free port");
    socket.local_addr().expect("it is bound").port()
}

/// A TCP port of loopback that is free now.
///
/// # Panics
/// If there is none.
pub fn free_tcp_port() -> u16 {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback has a free port");
    listener.local_addr().expect("it is bound").port()
}

/// The host's end of the line. A thread of its own takes packets off the socket at once: what a test does meanwhile must
/// not lose any.
#[derive(Debug)]
struct HostEnd {
    socket: UdpSocket,
    packets: Receiver<Vec<u8>>,
    _open: Arc<()>,
}

impl HostEnd {
    fn open() -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback has a free port");
        socket.set_read_timeout(Some(Duration::from_millis(100))).expect("a socket can wait for a while");
        let (sender, packets) = mpsc::channel();
        let open = Arc::new(());
        let (still_open, end) = (Arc::downgrade(&open), socket.try_clone().expect("a socket can be shared"));
        std::thread::spawn(move || {
            let mut buffer = [0; 2048];
            while still_open.strong_count() > 0 {
                if let Ok(length) = end.recv(&mut buffer)
                    && sender.send(buffer[..length].to_vec()).is_err()
                {
                    return;
                }
            }
        });
        Self { socket, packets, _open: open }
    }
}

fn socket() -> UdpSocket {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback has a free port");
    socket.set_nonblocking(true).expect("a socket can be made so");
    socket
}

/// A process that ends with its owner.
#[derive(Debug)]
pub struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// llrpkit, where `.ci/run` installs it or on the path.
pub fn llrpkit() -> Command {
    let installed = workspace().join("target/venv/bin/llrpkit");
    Command::new(if installed.exists() { installed } else { PathBuf::from("llrpkit") })
}

/// The Python of the workspace's virtual environment, or else the system's.
pub fn python() -> Command {
    let installed = workspace().join("target/venv/bin/python");
    Command::new(if installed.exists() { installed } else { PathBuf::from("python3") })
}

/// llrpkit's emulator of an Impinj reader, reading this many tags a second; `None` where it is not installed, which is
/// told.
///
/// # Panics
/// If it is there and cannot be started.
pub fn reader_emulator(port: u16, rate: u32, seed: u32) -> Option<Process> {
    let mut command = llrpkit();
    command.args(["emulate", "--tags", "6", "--antennas", "4"]);
    command.args(["--port", &port.to_string(), "--rate", &rate.to_string(), "--seed", &seed.to_string()]);
    match command.stdout(Stdio::null()).stderr(Stdio::null()).spawn() {
        Ok(child) => Some(Process(child)),
        Err(error) if error.kind() == ErrorKind::NotFound => {
            missing("llrpkit (a reader's emulator, from PyPI)");
            None
        }
        Err(error) => panic!("llrpkit: {error}"),
    }
}

/// The image at work and its devices.
#[derive(Debug)]
pub struct Machine {
    _qemu: Process,
    _folder: tempfile::TempDir,
    start: Instant,
    bridge: SocketAddr,
    data: SocketAddr,
    recorder: UdpSocket,
    recorder_data: UdpSocket,
    host_end: HostEnd,
    sequencer: Sequencer,
    commands: u16,
    console_line: UnixStream,
    said: Vec<(BridgeTime, String)>,
    /// The demo's command line.
    pub console: Console,
    /// Commands that the recorder took.
    pub recorder_commands: Vec<command::Command>,
    /// What the host received.
    pub host: Host,
    /// Answers to commands, until they are looked at.
    acks: Vec<Ack>,
    /// Boot number of the last packet.
    boot: Option<u16>,
}

impl Machine {
    /// Starts the image; `None` where QEMU is missing, which is told.
    ///
    /// # Panics
    /// If UDP port 4096 of loopback, to which the image sends the recorder's commands, is taken.
    pub fn start(image: &Path) -> Option<Self> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let console_path = folder.path().join("console");
        let (data, bridge) = (free_udp_port(), free_udp_port());
        let network = format!(
            "user,model=lan9118,net=192.168.33.0/24,host={},hostfwd=udp:127.0.0.1:{data}-{BRIDGE}:{DATA_PORT},\
             hostfwd=udp:127.0.0.1:{bridge}-{BRIDGE}:{BRIDGE_PORT}",
            Ipv4Addr::from(DEVICES)
        );
        let mut qemu = Command::new("qemu-system-arm");
        qemu.args(["-M", "mps2-an500", "-display", "none", "-monitor", "none", "-icount", "shift=0"]);
        qemu.args(["-semihosting-config", "enable=on,target=native"]);
        qemu.arg("-chardev");
        qemu.arg(format!("socket,id=console,path={},server=on,wait=off", console_path.display()));
        qemu.args(["-serial", "chardev:console", "-nic", &network, "-kernel"]).arg(image);
        qemu.stdin(Stdio::null()).stdout(Stdio::null());
        let qemu = match qemu.spawn() {
            Ok(child) => Process(child),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                missing("qemu-system-arm");
                return None;
            }
            Err(error) => panic!("qemu-system-arm: {error}"),
        };
        let recorder = UdpSocket::bind((Ipv4Addr::LOCALHOST, CONFIG_PORT)).expect("UDP 4096 is free");
        recorder.set_nonblocking(true).expect("a socket can be made so");
        let start = Instant::now();
        let console_line = loop {
            match UnixStream::connect(&console_path) {
                Ok(stream) => break stream,
                Err(error) => assert!(start.elapsed() < PATIENCE, "QEMU's console: {error}"),
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        console_line.set_nonblocking(true).expect("a socket can be made so");
        Some(Self {
            _qemu: qemu,
            _folder: folder,
            start,
            bridge: (Ipv4Addr::LOCALHOST, bridge).into(),
            data: (Ipv4Addr::LOCALHOST, data).into(),
            recorder,
            recorder_data: socket(),
            host_end: HostEnd::open(),
            sequencer: Sequencer::new(0),
            commands: 0,
            console_line,
            said: Vec::new(),
            console: Console::default(),
            recorder_commands: Vec::new(),
            host: Host::default(),
            acks: Vec::new(),
            boot: None,
        })
    }

    fn now(&self) -> BridgeTime {
        BridgeTime(self.start.elapsed().as_micros() as u64)
    }

    /// Lets the devices do what is due. Returns whether anything happened.
    pub fn step(&mut self) -> bool {
        let mut happened = false;
        let mut buffer = [0; 2048];
        while let Ok((length, from)) = self.recorder.recv_from(&mut buffer) {
            happened = true;
            if let Ok(command) = command::Command::decode(&buffer[..length]) {
                self.recorder_commands.push(command);
                let answer = Answer { code: command.code(), status: 0 };
                let _ = self.recorder.send_to(&answer.encode(), from);
            }
        }
        while let Ok(length @ 1..) = self.console_line.read(&mut buffer) {
            happened = true;
            // Line by line, as the demo hears them.
            for line in String::from_utf8_lossy(&buffer[..length]).split_inclusive('\n') {
                let now = self.now();
                self.said.extend(self.console.hear(now, line));
            }
        }
        let now = self.now();
        while self.said.first().is_some_and(|(time, _)| *time <= now) {
            let (_, words) = self.said.remove(0);
            let _ = self.console_line.write_all(words.as_bytes());
        }
        while let Ok(packet) = self.host_end.packets.try_recv() {
            happened = true;
            self.take(&packet);
        }
        happened
    }

    fn take(&mut self, packet: &[u8]) {
        if let Ok(wire::Packet { header, .. }) = wire::Packet::decode(packet) {
            self.boot = Some(header.boot);
        }
        let before = self.host.received.len();
        self.host.take(packet);
        let acks = self.host.received[before..].iter();
        self.acks.extend(acks.filter_map(|r| if let Received::Ack(ack) = r { Some(*ack) } else { None }));
    }

    /// Lets the devices work until `done`. Returns how long that took.
    ///
    /// # Panics
    /// If it takes longer than [`PATIENCE`].
    pub fn wait(&mut self, what: &str, mut done: impl FnMut(&Self) -> bool) -> Duration {
        let start = Instant::now();
        while !done(self) {
            assert!(
                start.elapsed() < PATIENCE,
                "waited in vain for {what}: {:?}",
                self.host.telemetry().last()
            );
            if !self.step() {
                std::thread::sleep(PAUSE);
            }
        }
        start.elapsed()
    }

    /// Lets the devices work for this long.
    pub fn run(&mut self, time: Duration) {
        let start = Instant::now();
        self.wait("time", |_| start.elapsed() >= time);
    }

    /// Sends a command until it is answered.
    ///
    /// # Panics
    /// If there is no answer.
    pub fn ask(&mut self, request: Request) -> Ack {
        self.commands = self.commands.wrapping_add(1);
        let id = self.commands;
        let message = Message::Command(wire::Command { id, request });
        let packet = self.sequencer.wrap(self.now(), message);
        let mut buffer = [0; MAX_PACKET];
        let bytes = packet.encode(&mut buffer).expect("commands fit").to_vec();
        self.acks.clear();
        let mut sent = None::<Instant>;
        let start = Instant::now();
        loop {
            if let Some(ack) = self.acks.iter().find(|ack| ack.id == id) {
                return *ack;
            }
            assert!(start.elapsed() < PATIENCE, "no answer to {:?}", packet.message);
            if sent.is_none_or(|sent| sent.elapsed() > AGAIN) {
                sent = Some(Instant::now());
                // The port may not be open yet.
                let _ = self.host_end.socket.send_to(&bytes, self.bridge);
            }
            if !self.step() {
                std::thread::sleep(PAUSE);
            }
        }
    }

    /// Configures the bridge, which then restarts, and says hello to it.
    ///
    /// # Panics
    /// If it refuses.
    pub fn configure(&mut self, config: &rfhoi_shared::config::BridgeConfig) {
        self.ask(Request::Stop).outcome.expect("stopping is never refused");
        loop {
            match self.ask(Request::Configure(config.clone())).outcome {
                Ok(()) => break,
                Err(wire::Refusal::Busy) => self.run(AGAIN),
                Err(refusal) => panic!("{refusal}"),
            }
        }
        let boot = self.boot;
        let start = Instant::now();
        while self.boot == boot {
            assert!(start.elapsed() < PATIENCE, "the bridge did not restart");
            self.ask(Request::Hello);
        }
    }

    /// Another host takes over: a new port of this machine.
    pub fn new_host(&mut self) {
        self.host_end = HostEnd::open();
    }

    /// Who the bridge last said it was.
    pub fn hello(&self) -> Option<&Hello> {
        let hellos = self.host.received.iter().rev();
        hellos.filter_map(|r| if let Received::Hello(h) = r { Some(h) } else { None }).next()
    }

    /// Telemetry made after everything that has happened so far.
    pub fn telemetry(&mut self) -> Telemetry {
        let seen = self.host.telemetry().count();
        // The next one may have been made before.
        self.wait("telemetry", |m| m.host.telemetry().count() > seen + 1);
        *self.host.telemetry().last().expect("it was waited for")
    }

    /// Sends a datagram of the recorder.
    ///
    /// # Panics
    /// If the network of this machine does not take it.
    pub fn send_data(&self, datagram: &[u8]) {
        self.recorder_data.send_to(datagram, self.data).expect("loopback takes it");
    }

    /// Waits until QEMU has taken all datagrams sent so far; they are then in the device, in their order.
    ///
    /// # Panics
    /// If it does not take them.
    pub fn wait_for_qemu(&self) {
        // The kernel's table of sockets (proc_pid_net(5)): local address and port, then the queues' lengths.
        let local = format!(" 0100007F:{:04X} ", self.data.port());
        let start = Instant::now();
        loop {
            let table = std::fs::read_to_string("/proc/net/udp").expect("the kernel lists its sockets");
            // A table that changes while it is read may lack a line.
            let line = table.lines().find(|line| line.contains(&local)).unwrap_or_default();
            if line.split_whitespace().nth(4).is_some_and(|queues| queues.ends_with(":00000000")) {
                return;
            }
            assert!(start.elapsed() < PATIENCE, "QEMU takes no datagrams");
            std::thread::sleep(PAUSE);
        }
    }

    /// Sends `bytes` to the bridge's port for commands.
    pub fn send_to_bridge(&self, bytes: &[u8]) {
        let _ = self.host_end.socket.send_to(bytes, self.bridge);
    }

    /// Says `bytes` on the console's line.
    pub fn say(&mut self, bytes: &[u8]) {
        let _ = self.console_line.write_all(bytes);
    }
}
