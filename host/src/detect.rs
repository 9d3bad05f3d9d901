//! What a file is, from its first bytes.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use rfhoi_firmware::llrp::message::MessageType;
use rfhoi_firmware::llrp::param::Fields;
use rfhoi_firmware::mmwave;

use crate::motion;

/// Kinds of file that are recognised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Raw ADC words as a DCA1000EVM's recorder writes them.
    AdcBin,
    /// Raw ADC samples as a NumPy array.
    AdcNpy,
    /// Packets of radar, reader or bridge (pcap, pcapng, also gzip-compressed).
    Packets,
    /// The SDK demo's data UART.
    Tlv,
    /// The SDK demo's data UART as a table with a host time and decimal bytes in each row.
    TlvCsv,
    /// LLRP messages, one after the other.
    Llrp,
    /// The body of one LLRP message.
    LlrpBody,
    /// Tag reads as a table.
    Reads,
    /// Recorded human motion.
    Motion,
}

/// Why a file is not recognised.
#[derive(Debug, thiserror::Error)]
pub enum DetectError {
    /// It cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// It has no bytes.
    #[error("{path} is empty (0 bytes): was the recording stopped before it began?")]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// It is a radar profile.
    #[error("{path} is a radar profile, not a recording; give it with --profile beside a recording")]
    Profile {
        /// The file.
        path: PathBuf,
    },
    /// It is nothing known.
    #[error(
        "{path} is none of: DCA1000 samples (.bin, .npy), packets (.pcap), SDK demo UART (.dat, .csv), LLRP messages, \
         tag reads (.csv), human motion (.amc, .bvh); from offset 0 no known structure begins. If it is raw samples, name it .bin"
    )]
    Unknown {
        /// The file.
        path: PathBuf,
    },
}

/// Bytes that are looked at.
const HEAD: usize = 64 * 1024;

/// Tells what the file at `path` is.
///
/// # Errors
/// If it cannot be read, is empty or is not recognised.
pub fn detect(path: &Path) -> Result<Format, DetectError> {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD as u64).read_to_end(&mut head));
    read.map_err(|source| DetectError::Read { path: path.to_path_buf(), source })?;
    if head.is_empty() {
        return Err(DetectError::Empty { path: path.to_path_buf() });
    }
    if let Some(format) = by_magic(&head).or_else(|| by_motion(&head)).or_else(|| by_text(&head)) {
        return Ok(format);
    }
    if is_profile(&head) {
        return Err(DetectError::Profile { path: path.to_path_buf() });
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let whole = head.len() < HEAD;
    if is_llrp_stream(&head) {
        Ok(Format::Llrp)
    } else if contains(&head, &mmwave::MAGIC) && extension != "bin" {
        Ok(Format::Tlv)
    } else if whole && is_llrp_body(&head) {
        Ok(Format::LlrpBody)
    } else if extension == "bin" {
        Ok(Format::AdcBin)
    } else {
        Err(DetectError::Unknown { path: path.to_path_buf() })
    }
}

fn contains(bytes: &[u8], pattern: &[u8]) -> bool {
    bytes.windows(pattern.len()).any(|w| w == pattern)
}

fn by_magic(head: &[u8]) -> Option<Format> {
    const PCAP: [[u8; 4]; 5] = [
        [0xd4, 0xc3, 0xb2, 0xa1],
        [0xa1, 0xb2, 0xc3, 0xd4],
        [0x4d, 0x3c, 0xb2, 0xa1],
        [0xa1, 0xb2, 0x3c, 0x4d],
        [0x0a, 0x0d, 0x0d, 0x0a],
    ];
    const GZIP: [u8; 2] = [0x1f, 0x8b];
    if head.starts_with(b"\x93NUMPY") {
        Some(Format::AdcNpy)
    } else if PCAP.iter().any(|magic| head.starts_with(magic)) || head.starts_with(&GZIP) {
        Some(Format::Packets)
    } else if head.starts_with(&mmwave::MAGIC) {
        Some(Format::Tlv)
    } else {
        None
    }
}

/// The text at the beginning of `head`, if it is text: what a cut character at its end breaks is left out.
fn text(head: &[u8]) -> Option<&str> {
    let text = match std::str::from_utf8(head) {
        Ok(text) => text,
        Err(error) if head.len() == HEAD && head.len() - error.valid_up_to() < 4 => {
            std::str::from_utf8(&head[..error.valid_up_to()]).ok()?
        }
        Err(_) => return None,
    };
    let binary = |c: char| c.is_control() && !c.is_whitespace();
    (!text.contains(binary)).then_some(text)
}

/// Looked for before text, as AMC files hold comments in any encoding.
fn by_motion(head: &[u8]) -> Option<Format> {
    motion::Kind::of(head).map(|_| Format::Motion)
}

fn by_text(head: &[u8]) -> Option<Format> {
    let line = text(head)?.trim_start_matches('\u{feff}').lines().find(|l| !l.trim().is_empty())?;
    let cells: Vec<&str> = line.split(',').map(str::trim).collect();
    let named = |name: &str| cells.iter().any(|c| c.eq_ignore_ascii_case(name));
    let numbers =
        cells.len() >= 7 && cells.iter().filter(|c| c.parse::<f64>().is_ok()).count() >= cells.len() - 1;
    if named("RawData") {
        Some(Format::TlvCsv)
    } else if named("epc") || numbers {
        Some(Format::Reads)
    } else {
        None
    }
}

fn is_profile(head: &[u8]) -> bool {
    text(head).is_some_and(|t| t.contains("profileCfg") || t.contains("API:ProfileConfig"))
}

/// Whether `head` is cut into LLRP messages of known types without a gap.
fn is_llrp_stream(head: &[u8]) -> bool {
    let mut rest = head;
    let mut messages = 0;
    while let Some((&[v, t, l0, l1, l2, l3, _, _, _, _], _)) = rest.split_first_chunk::<10>() {
        let kind = MessageType(u16::from_be_bytes([v & 0b11, t]));
        let length = u32::from_be_bytes([l0, l1, l2, l3]) as usize;
        if v >> 2 != 1 || kind.name().is_none() || length < 10 {
            return false;
        }
        messages += 1;
        match rest.get(length..) {
            Some(after) => rest = after,
            // The last message is cut: by the end of what was looked at, or of the file.
            None => break,
        }
    }
    messages > 0
}

/// Whether `bytes` are parameters and nothing else.
fn is_llrp_body(bytes: &[u8]) -> bool {
    let mut parameters = Fields::new(bytes).parameters().peekable();
    parameters.peek().is_some() && parameters.all(|p| p.is_ok())
}
