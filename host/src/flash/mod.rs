//! Boards over their debug probes: an ELF file in; a programmed, verified and running board out, and its log.
//!
//! Needs the Cargo feature `probe`. On Linux probes are reached through usbfs and hidraw: no system library is needed,
//! only the right to open the device.

mod log;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Duration;

use defmt_decoder::Table;
use probe_rs::flashing::{
    DownloadOptions, ElfLoader, ElfOptions, FlashProgress, ProgressEvent, ProgressOperation, build_loader,
};
use probe_rs::probe::list::{Accessibility, Lister, ProbeListItem};
use probe_rs::rtt::{Rtt, ScanRegion, find_rtt_control_block_in_raw_file};
use probe_rs::{Permissions, Session};
use serde::Serialize;

pub use log::{LogLine, follow};

/// Longest wait for a core to halt.
const HALT: Duration = Duration::from_millis(500);

/// Why a board is not programmed, or its log not read.
#[derive(Debug, thiserror::Error)]
pub enum FlashError {
    /// The file cannot be read.
    #[error("cannot read the firmware {path}: {reason}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: std::io::Error,
    },
    /// The file is not what a linker makes.
    #[error("{path} is no ELF file: {reason}; give the file that `firmware/boards/build` names")]
    NotElf {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// No probe at all.
    #[error(
        "no debug probe found: check that the USB cable carries data and is in the probe's connector, that the probe's \
         lamp is lit, and that no virtual machine has taken it; on Linux, {}",
        udev_rule(ST_MICROELECTRONICS)
    )]
    NoProbe,
    /// None that is meant.
    #[error("no debug probe {wanted}: there is {present}")]
    NoSuchProbe {
        /// What was asked for.
        wanted: String,
        /// What is there.
        present: String,
    },
    /// Which of several?
    #[error("several debug probes: choose one with --probe, of {0}")]
    SeveralProbes(String),
    /// The user may not open it.
    #[error("no permission to open the probe {probe}: {}", udev_rule(*.vendor))]
    NoPermission {
        /// The probe.
        probe: String,
        /// Its USB vendor.
        vendor: u16,
    },
    /// The probe does not open.
    #[error(
        "cannot open the probe {probe}: {reason}; another program (a debugger, OpenOCD, a second rfhoi) may hold it, \
         or unplug it and plug it in again"
    )]
    Open {
        /// The probe.
        probe: String,
        /// What it said.
        reason: String,
    },
    /// No such chip, or another one.
    #[error(
        "cannot attach to the chip as {chip}: {reason}; check that the board has power and that --chip is its chip"
    )]
    Attach {
        /// The chip.
        chip: String,
        /// What the probe said.
        reason: String,
    },
    /// Programming or verifying failed.
    #[error(
        "cannot program {chip}: {reason}; check that --chip is the board's chip and that the firmware was linked for it"
    )]
    Program {
        /// The chip.
        chip: String,
        /// What went wrong.
        reason: String,
    },
    /// It is programmed, but does not start.
    #[error("the board is programmed but cannot be started over the probe: {0}; press its reset button")]
    Start(String),
    /// Its log ended.
    #[error("the log ends: {0}; is the probe still plugged in and the board powered?")]
    Log(String),
    /// The user stopped it.
    #[error("stopped")]
    Interrupted,
}

/// USB vendor of the ST-LINK on every NUCLEO board.
const ST_MICROELECTRONICS: u16 = 0x0483;

/// What lets users on Linux open a probe of `vendor`.
fn udev_rule(vendor: u16) -> String {
    format!(
        "install the udev rule with `echo 'SUBSYSTEM==\"usb\", ATTR{{idVendor}}==\"{vendor:04x}\", TAG+=\"uaccess\"' | sudo \
         tee /etc/udev/rules.d/69-rfhoi-probe.rules && sudo udevadm control --reload`, then plug the probe in again"
    )
}

/// An error and its causes in one sentence.
fn sentence(error: &(dyn Error + 'static)) -> String {
    let chain = std::iter::successors(Some(error), |&e| e.source());
    let mut parts: Vec<String> = chain.map(|e| e.to_string().replace('\n', " ")).collect();
    parts.iter_mut().for_each(|p| p.truncate(p.trim_end_matches('.').len()));
    parts.dedup();
    parts.join(": ")
}

/// A debug probe.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Probe {
    /// What it is.
    pub name: String,
    /// USB vendor and product, and its serial number where it has one: what `--probe` takes.
    pub selector: String,
    /// Whether this user may open it.
    pub accessible: bool,
}

impl From<&ProbeListItem> for Probe {
    fn from(item: &ProbeListItem) -> Self {
        let info = &item.info;
        let serial = info.serial_number.as_ref().map_or(String::new(), |s| format!(":{s}"));
        Self {
            name: info.identifier.clone(),
            selector: format!("{:04x}:{:04x}{serial}", info.vendor_id, info.product_id),
            accessible: item.accessibility == Accessibility::Accessible,
        }
    }
}

/// The probes of this computer.
pub fn probes() -> Vec<Probe> {
    Lister::new().list_all_with_access().iter().map(Probe::from).collect()
}

/// Which of `probes` is meant: by its serial number, by vendor and product, by all of them, or because it is the only one.
fn choose(probes: &[Probe], wanted: Option<&str>) -> Result<usize, FlashError> {
    let names = |probes: &[&Probe]| {
        probes.iter().map(|p| format!("{} ({})", p.selector, p.name)).collect::<Vec<_>>().join(", ")
    };
    let is_wanted = |probe: &Probe| {
        wanted.is_none_or(|wanted| {
            let wanted = wanted.to_lowercase();
            let selector = probe.selector.to_lowercase();
            let mut parts = selector.splitn(3, ':').skip(2);
            selector == wanted
                || selector.starts_with(&format!("{wanted}:"))
                || parts.next().is_some_and(|serial| serial == wanted)
        })
    };
    let meant: Vec<usize> = (0..probes.len()).filter(|&i| is_wanted(&probes[i])).collect();
    match (&meant[..], wanted) {
        ([one], _) => Ok(*one),
        ([], Some(wanted)) if !probes.is_empty() => Err(FlashError::NoSuchProbe {
            wanted: wanted.to_owned(),
            present: names(&probes.iter().collect::<Vec<_>>()),
        }),
        ([], _) => Err(FlashError::NoProbe),
        (several, _) => {
            Err(FlashError::SeveralProbes(names(&several.iter().map(|&i| &probes[i]).collect::<Vec<_>>())))
        }
    }
}

/// Firmware for a board.
#[derive(Debug)]
pub struct Firmware {
    path: PathBuf,
    /// Address of the RTT control block, through which the log comes.
    rtt: Option<u64>,
    /// What the log's numbers mean.
    table: Option<Table>,
    /// Why there is no log, in a sentence.
    pub no_log: Option<String>,
}

impl Firmware {
    /// The firmware in the ELF file at `path`.
    ///
    /// # Errors
    /// [`FlashError::Read`] or [`FlashError::NotElf`]. Firmware without a log is no error.
    pub fn read(path: &Path) -> Result<Self, FlashError> {
        let elf =
            std::fs::read(path).map_err(|reason| FlashError::Read { path: path.to_path_buf(), reason })?;
        let rtt = find_rtt_control_block_in_raw_file(&elf)
            .map_err(|e| FlashError::NotElf { path: path.to_path_buf(), reason: e.to_string() })?;
        let (table, no_log) = match (Table::parse(&elf), rtt) {
            (Ok(Some(table)), Some(_)) => (Some(table), None),
            (Ok(Some(_)), None) => (None, Some("it has defmt data but no RTT control block".to_owned())),
            (Ok(None), _) => (None, Some("it was built without defmt, or stripped".to_owned())),
            (Err(error), _) => {
                (None, Some(format!("its defmt data is not understood: {error:#}").replace('\n', " ")))
            }
        };
        Ok(Self { path: path.to_path_buf(), rtt, table, no_log })
    }
}

/// What is being done to a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Erasing.
    Erase,
    /// Writing.
    Program,
    /// Reading back.
    Verify,
}

/// A board that was programmed.
pub struct Board {
    session: Session,
    /// The probe.
    pub probe: Probe,
}

/// Programs `firmware` into the `chip` at the probe that `wanted` names, verifies it and starts it. `progress` is called
/// with the share of each stage that is done; programming is not broken off in the middle.
///
/// # Errors
/// Any [`FlashError`].
pub fn program(
    firmware: &Firmware,
    wanted: Option<&str>,
    chip: &str,
    mut progress: impl FnMut(Stage, f64),
) -> Result<Board, FlashError> {
    let items = Lister::new().list_all_with_access();
    let mut probes: Vec<Probe> = items.iter().map(Probe::from).collect();
    let index = choose(&probes, wanted)?;
    let (item, probe) = (&items[index], probes.swap_remove(index));
    if !probe.accessible {
        return Err(FlashError::NoPermission { probe: probe.selector, vendor: item.info.vendor_id });
    }
    let opened = item
        .info
        .open()
        .map_err(|e| FlashError::Open { probe: probe.selector.clone(), reason: sentence(&e) })?;
    let mut session = opened
        .attach(chip, Permissions::default())
        .map_err(|e| FlashError::Attach { chip: chip.to_owned(), reason: sentence(&e) })?;
    let failed =
        |e: &(dyn Error + 'static)| FlashError::Program { chip: chip.to_owned(), reason: sentence(e) };
    let loader = build_loader(&mut session, &firmware.path, ElfLoader(ElfOptions::default()), None)
        .map_err(|e| failed(&e))?;
    let mut stages = Stages::default();
    let mut options = DownloadOptions::default();
    options.verify = true;
    options.progress = FlashProgress::new(|event| {
        if let Some((stage, share)) = stages.take(&event) {
            progress(stage, share);
        }
    });
    loader.commit(&mut session, options).map_err(|e| failed(&e))?;
    start(&mut session, firmware.rtt).map_err(|e| FlashError::Start(sentence(&e)))?;
    Ok(Board { session, probe })
}

/// Starts the board anew. What an older firmware left in memory must not be taken for the log.
fn start(session: &mut Session, rtt: Option<u64>) -> Result<(), probe_rs::rtt::Error> {
    let mut core = session.core(0)?;
    core.reset_and_halt(HALT)?;
    if let Some(address) = rtt {
        Rtt::clear_control_block(&mut core, &ScanRegion::Exact(address))?;
    }
    Ok(core.run()?)
}

/// Bytes of each stage, done and in all.
#[derive(Debug, Default)]
struct Stages {
    bytes: [(u64, u64); 3],
}

impl Stages {
    /// The stage that goes on, and how much of it is done.
    fn take(&mut self, event: &ProgressEvent) -> Option<(Stage, f64)> {
        let (operation, done, more) = match event {
            ProgressEvent::AddProgressBar { operation, total } => (*operation, 0, total.unwrap_or(0)),
            ProgressEvent::Progress { operation, size, .. } => (*operation, *size, 0),
            _ => return None,
        };
        let stage = match operation {
            ProgressOperation::Erase => Stage::Erase,
            ProgressOperation::Program => Stage::Program,
            ProgressOperation::Verify => Stage::Verify,
            ProgressOperation::Fill => return None,
        };
        let (so_far, total) = &mut self.bytes[stage as usize];
        *so_far += done;
        *total += more;
        Some((stage, *so_far as f64 / (*total).max(1) as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn probe(selector: &str) -> Probe {
        Probe { name: "STLink V2-1".into(), selector: selector.into(), accessible: true }
    }

    #[test]
    fn probes_are_chosen_by_serial_number_or_usb_numbers() {
        let two = [probe("0483:374b:0669FF30"), probe("0483:374e:0011ABCD")];
        assert_eq!(choose(&two, Some("0011abcd")).unwrap(), 1);
        assert_eq!(choose(&two, Some("0483:374B")).unwrap(), 0);
        assert_eq!(choose(&two, Some("0483:374b:0669FF30")).unwrap(), 0);
        assert_eq!(choose(&two[..1], None).unwrap(), 0);
        let several = choose(&two, None).unwrap_err().to_string();
        assert!(several.contains("--probe") && several.contains("0483:374e:0011ABCD (STLink"), "{several}");
        let other = choose(&two, Some("1234")).unwrap_err().to_string();
        assert!(other.contains("no debug probe 1234") && other.contains("0669FF30"), "{other}");
        let none = choose(&[], None).unwrap_err().to_string();
        assert!(none.contains("cable") && none.contains("ATTR{idVendor}==\"0483\""), "{none}");
    }

    #[test]
    fn progress_is_of_all_regions_of_a_stage() {
        let mut stages = Stages::default();
        let add =
            |total| ProgressEvent::AddProgressBar { operation: ProgressOperation::Erase, total: Some(total) };
        let done = |size| ProgressEvent::Progress {
            operation: ProgressOperation::Erase,
            size,
            time: Duration::ZERO,
        };
        stages.take(&add(100));
        stages.take(&add(300));
        assert_eq!(stages.take(&done(100)), Some((Stage::Erase, 0.25)));
        assert_eq!(stages.take(&done(300)), Some((Stage::Erase, 1.0)));
    }

    #[test]
    fn files_that_are_no_firmware_are_told() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "not an ELF file").unwrap();
        let error = Firmware::read(file.path()).unwrap_err().to_string();
        assert!(error.contains("is no ELF file"), "{error}");
        let error = Firmware::read(Path::new("nowhere.elf")).unwrap_err().to_string();
        assert!(error.contains("nowhere.elf"), "{error}");
    }

    #[test]
    fn a_program_of_this_computer_has_no_log() {
        let firmware = Firmware::read(&std::env::current_exe().unwrap()).unwrap();
        assert!(firmware.table.is_none());
        assert!(firmware.no_log.unwrap().contains("without defmt"));
    }
}
