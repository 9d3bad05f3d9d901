//! The bridge's own tasks on a PC, with devices at a switch and on UARTs, in virtual time.
//!
//! ```text
//! console, data UART <--uart--> +--------+
//!                               | bridge | <--switch--> recorder, reader (llrp), hosts
//!            board <----------> +--------+
//! ```
//!
//! The bridge runs on Embassy's executor as on a board, everything else and the test's script on another. A round polls
//! both; it takes `ROUND_US`, or ends when something happens. When nothing has happened for `ROUNDS` rounds, the bridge
//! has nothing left to do, and time goes on to what happens next. So work costs time, chance comes from the seed, and
//! a run is the same each time.

mod board;
pub mod clock;
mod host;
mod llrp;
mod recorder;
mod station;
mod switch;
mod uart;

use std::cell::{Cell, RefCell};
use std::pin::Pin;
use std::rc::Rc;

use embassy_executor::{Executor, Spawner};
use embassy_futures::yield_now;
use embassy_net::StackResources;
use embassy_time::{Instant, Timer};
use futures_executor::{LocalPool, LocalSpawner};
use futures_util::task::LocalSpawnExt;
use num_complex::Complex;
use rfhoi_bridge::{Bridge, CUBE_CELLS, Handover, Parts, SOCKETS};
use rfhoi_firmware::dsp::DopplerStage;
use rfhoi_shared::config::{Address, BridgeConfig, Endpoint};
use rfhoi_shared::wire::BRIDGE_PORT;

pub use board::SimulatedBoard;
pub use host::NetworkHost;
pub use llrp::NetworkReader;
pub use recorder::Recorder;
pub use switch::{Arrival, Switch};
pub use uart::{ConsoleUart, DataUart};

use super::network::Conditions;
use super::radar::Measurement;
use super::reader::{self, SimulatedReader};

/// Time that a round of polling takes, us.
const ROUND_US: u64 = 10;
/// Rounds after which the bridge has nothing left to do: more than a frame's signal processing takes, one for a range
/// bin.
const ROUNDS: u32 = 160;
/// Time from a restart to the first task, us.
const BOOT_US: u64 = 100_000;
/// Delay of a frame on the network, us.
const DELAY_US: u64 = 40;
/// Futures of all bridges of a process that are none of the application's own tasks.
const FUTURES: usize = 512;

type Boxed = Pin<Box<dyn Future<Output = ()>>>;

/// What there is around a bridge.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Seed of all chance.
    pub seed: u64,
    /// The configuration kept on the board.
    pub config: BridgeConfig,
    /// What the radar sees, its times from the start of the sensor.
    pub measurement: Measurement,
    /// The reader.
    pub reader: reader::Setup,
    /// Whether signal processing starts with the bridge; else with [`Rig::start_dsp`].
    pub dsp: bool,
}

/// Outlets of the switch by what is plugged in.
#[derive(Debug, Clone, Copy)]
pub struct Outlets {
    /// The bridge.
    pub bridge: usize,
    /// The recorder.
    pub recorder: usize,
    /// The reader.
    pub reader: usize,
}

/// What a script can see and do.
pub struct Rig {
    /// The switch.
    pub switch: Switch,
    /// Its outlets.
    pub outlets: Outlets,
    /// The bridge's board.
    pub board: SimulatedBoard,
    /// The radar's command line.
    pub console: ConsoleUart,
    /// The radar's data.
    pub data: DataUart,
    /// The recorder.
    pub recorder: Recorder,
    /// The reader.
    pub reader: NetworkReader,
    address: [u8; 4],
    spawner: LocalSpawner,
    stations: RefCell<Vec<([u8; 4], embassy_net::Stack<'static>, usize)>>,
    life: Cell<Option<Life>>,
    dsp: bool,
}

/// What signal processing of the present bridge needs.
struct Life {
    spawner: Spawner,
    handover: &'static Handover,
    config: BridgeConfig,
    boot: u16,
}

impl Rig {
    fn new(setup: Setup, spawner: LocalSpawner) -> Self {
        let Setup { seed, config, measurement, reader, dsp } = setup;
        let usual = Conditions { delay_us: DELAY_US, ..Conditions::default() };
        let switch = Switch::new(usual, seed);
        let mut board = SimulatedBoard::new(seed);
        rfhoi_bridge::keep_configuration(&mut board, &config).expect("a new board keeps it");
        let Address::Static { address, .. } = config.address else { panic!("the bridge's address is fixed") };
        let bridge = switch.outlet();
        let run = |future: Boxed| spawner.spawn_local(future).expect("the pool is there");
        let plug = |address| {
            let (outlet, stack, mut runner) = station::station(&switch, address);
            run(Box::pin(async move {
                runner.run().await;
            }));
            (outlet, stack)
        };
        let (recorder_outlet, stack) = plug(RECORDER);
        let console = ConsoleUart::default();
        let recorder = Recorder::new(stack, address, console.clone(), measurement);
        run(Box::pin(recorder.clone().answer()));
        run(Box::pin(recorder.clone().stream()));
        let (reader_outlet, stack) = plug(READER);
        let reader = NetworkReader::new(SimulatedReader::new(reader));
        run(Box::pin(reader.clone().serve(stack)));
        let outlets = Outlets { bridge, recorder: recorder_outlet, reader: reader_outlet };
        Self {
            switch,
            outlets,
            board,
            console,
            data: DataUart::default(),
            recorder,
            reader,
            address,
            spawner,
            stations: RefCell::default(),
            life: Cell::default(),
            dsp,
        }
    }

    /// Seconds since the beginning.
    pub fn seconds(&self) -> f64 {
        clock::now().seconds()
    }

    /// Waits until so many seconds from the beginning.
    pub async fn until(&self, seconds: f64) {
        Timer::at(Instant::from_micros((seconds * 1e6) as u64)).await;
    }

    /// Waits so many seconds.
    pub async fn pass(&self, seconds: f64) {
        self.until(self.seconds() + seconds).await;
    }

    /// A host at this endpoint, with the others at its address in one station.
    pub fn host(&self, endpoint: Endpoint) -> NetworkHost {
        let known = self.stations.borrow().iter().find(|s| s.0 == endpoint.address).map(|s| s.1);
        let stack = known.unwrap_or_else(|| {
            let (outlet, stack, mut runner) = station::station(&self.switch, endpoint.address);
            self.spawn(async move {
                runner.run().await;
            });
            self.stations.borrow_mut().push((endpoint.address, stack, outlet));
            stack
        });
        let socket = station::udp_socket(stack, endpoint.port);
        let host = NetworkHost::new(socket, Endpoint { address: self.address, port: BRIDGE_PORT });
        self.spawn(host.clone().receive());
        host
    }

    /// Pulls the cable of the station with this address, or puts it in again.
    pub fn set_plugged(&self, address: [u8; 4], plugged: bool) {
        for (.., outlet) in self.stations.borrow().iter().filter(|s| s.0 == address) {
            self.switch.set_plugged(*outlet, plugged);
        }
    }

    /// Runs something beside the script.
    pub fn spawn(&self, future: impl Future<Output = ()> + 'static) {
        self.spawner.spawn_local(future).expect("the pool is there");
    }

    /// Starts signal processing of the bridge, if it does not run.
    pub fn start_dsp(&self) {
        if let Some(Life { spawner, handover, config, boot }) = self.life.take() {
            let stage = Box::leak(Box::new(DopplerStage::new()));
            rfhoi_bridge::spawn_dsp(spawner, handover, config.radar, boot, stage).expect("there is room");
        }
    }

    /// Starts a bridge, as a board's `main` does.
    fn boot(&self, spawner: Spawner) {
        self.board.start();
        let board = Box::leak(Box::new(self.board.clone()));
        let config = rfhoi_bridge::boot_configuration(board);
        let handover: &'static Handover = Box::leak(Box::default());
        let boot = board.state().starts;
        let seed = rfhoi_bridge::Board::seed(board);
        let resources = Box::leak(Box::new(StackResources::<SOCKETS>::new()));
        let port = self.switch.plug(self.outlets.bridge, board::MAC);
        let cubes = vec![Complex::default(); CUBE_CELLS].leak();
        let cubes = cubes.try_into().expect("it has this length");
        let parts = Parts { board, config: config.clone(), boot, handover, cubes };
        let bridge: &'static Bridge = Box::leak(Box::new(Bridge::new(parts)));
        let (stack, mut runner) =
            embassy_net::new(bridge.tap(port), rfhoi_bridge::ip_configuration(&config), resources, seed);
        let run = |future| spawner.spawn(run(future).expect("there is room"));
        run(Box::pin(async move {
            runner.run().await;
        }));
        run(Box::pin(rfhoi_bridge::radar_control(bridge, stack, self.console.clone(), self.console.clone())));
        run(Box::pin(rfhoi_bridge::radar_uart(bridge, self.data.clone())));
        // Embassy's executor sleeps, and its thread with it, when no task is awake.
        run(Box::pin(async {
            loop {
                yield_now().await;
            }
        }));
        bridge.spawn(spawner, stack).expect("there is room");
        self.life.set(Some(Life { spawner, handover, config, boot }));
        if self.dsp {
            self.start_dsp();
        }
    }
}

/// Address of the recorder.
pub const RECORDER: [u8; 4] = [192, 168, 33, 180];
/// Address of the reader.
pub const READER: [u8; 4] = [192, 168, 33, 40];

#[embassy_executor::task(pool_size = FUTURES)]
async fn run(future: Boxed) {
    future.await;
}

/// Everything but the bridge, and time.
struct World {
    pool: LocalPool,
    rig: Rc<Rig>,
    quiet: u32,
}

impl World {
    /// Polls everything but the bridge, and lets time go on.
    fn round(&mut self) {
        self.pool.run_until_stalled();
        let now = clock::now();
        let events = [clock::wake(), self.rig.switch.next_arrival()];
        let next = events.into_iter().flatten().min().expect("something happens next").max(now);
        self.quiet += 1;
        let time = if self.quiet < ROUNDS { now.after(ROUND_US).min(next) } else { next };
        if time == next {
            self.quiet = 0;
        }
        clock::set(time);
        self.rig.switch.deliver(time);
        clock::wake();
    }
}

/// Runs `script` beside a bridge, which restarts when its board does; what the script gives.
///
/// # Panics
/// If the script does, or if nothing is left to happen.
pub fn run_script<T, F>(setup: Setup, script: impl FnOnce(Rc<Rig>) -> F) -> T
where
    T: 'static,
    F: Future<Output = T> + 'static,
{
    clock::reset();
    let pool = LocalPool::new();
    let rig = Rc::new(Rig::new(setup, pool.spawner()));
    let result = Rc::new(RefCell::new(None));
    let script = script(Rc::clone(&rig));
    let place = Rc::clone(&result);
    rig.spawn(async move {
        let outcome = script.await;
        *place.borrow_mut() = Some(outcome);
    });
    let mut world = World { pool, rig: Rc::clone(&rig), quiet: 0 };
    while result.borrow().is_none() {
        let executor = Box::leak(Box::new(Executor::new()));
        executor.run_until(
            |spawner| rig.boot(spawner),
            || {
                world.round();
                result.borrow().is_some() || rig.board.state().restart
            },
        );
        // What the bridge was is left as it is and never polled again.
        rig.switch.set_plugged(rig.outlets.bridge, false);
        let booted = clock::now().after(BOOT_US);
        let alarm = Timer::at(Instant::from_micros(booted.0));
        rig.spawn(alarm);
        while clock::now() < booted && result.borrow().is_none() {
            world.round();
        }
    }
    let outcome = result.borrow_mut().take();
    outcome.expect("the loop ends with it")
}
