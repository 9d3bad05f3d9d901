//! temporary
use core::cell::UnsafeCell;
use rfhoi_shared::wire::RestartReason;
#[repr(C)]
struct Kept { magic: u32, count: u32, reason: u32, length: u32, bytes: [u8; 256] }
struct Place(UnsafeCell<core::mem::MaybeUninit<Kept>>);
unsafe impl Sync for Place {}
#[unsafe(link_section = ".uninit.kept")]
static PLACE: Place = Place(UnsafeCell::new(core::mem::MaybeUninit::uninit()));
fn kept() -> &'static mut Kept { unsafe { &mut *(PLACE.0.get() as *mut Kept) } }
pub struct Start { pub reason: RestartReason, pub count: u32 }
pub fn start() -> Start {
    let k = kept();
    let reason = if k.magic == 0x5246484f { if k.reason == 1 { RestartReason::Command } else { RestartReason::Panic } } else { k.magic = 0x5246484f; k.count = 0; k.length = 0; RestartReason::PowerOn };
    k.count += 1; k.reason = 0;
    Start { reason, count: k.count }
}
pub fn set_reason(_: RestartReason) { kept().reason = 1; }
pub fn configuration(b: &mut [u8]) -> Option<&[u8]> { let k = kept(); let n = k.length as usize; if n == 0 { return None } let b = b.get_mut(..n)?; b.copy_from_slice(k.bytes.get(..n)?); Some(b) }
pub fn keep_configuration(bytes: &[u8]) -> Result<(), ()> { let k = kept(); k.bytes.get_mut(..bytes.len()).ok_or(())?.copy_from_slice(bytes); k.length = bytes.len() as u32; Ok(()) }
