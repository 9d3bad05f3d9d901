//! The link map: regions by name, and how much of each an image takes.

use object::{Object, ObjectSection, SectionFlags, elf};

/// A region of the link map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Region {
    /// Its name.
    pub name: String,
    /// First address.
    pub origin: u64,
    /// Bytes.
    pub length: u64,
}

/// The regions of a linker script's `MEMORY`.
pub(crate) fn regions(script: &str) -> Vec<Region> {
    script.lines().filter_map(region).collect()
}

/// `NAME : ORIGIN = 0x..., LENGTH = ...K`.
fn region(line: &str) -> Option<Region> {
    let (name, rest) = line.split_once(':')?;
    let (origin, rest) = rest.split_once("ORIGIN =")?.1.split_once(',')?;
    let length = rest.split_once("LENGTH =")?.1.split_whitespace().next()?.strip_suffix('K')?;
    Some(Region {
        name: name.trim().to_owned(),
        origin: u64::from_str_radix(origin.trim().strip_prefix("0x")?, 16).ok()?,
        length: length.parse::<u64>().ok()? * 1024,
    })
}

/// Bytes of each region that `image` takes, in the regions' order: sections that lie there, and what is loaded from there.
///
/// # Errors
/// The name of a section that lies in no region, or reaches past one's end.
pub(crate) fn use_by_region(image: &object::File<'_>, regions: &[Region]) -> Result<Vec<u64>, String> {
    let mut used = vec![0; regions.len()];
    let mut add = |name: &str, from: u64, size: u64| {
        let place = regions.iter().position(|r| from >= r.origin && from + size <= r.origin + r.length);
        let Some((region, used)) = place.and_then(|i| Some((regions.get(i)?, used.get_mut(i)?))) else {
            return Err(format!("{name}: {size} bytes at {from:#x} are in no region"));
        };
        // Up to the end of the section, so that gaps count.
        *used = (*used).max(from + size - region.origin);
        Ok(())
    };
    for section in image.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        if section.size() == 0 || sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
            continue;
        }
        add(section.name().unwrap_or("?"), section.address(), section.size())?;
    }
    if let object::File::Elf32(elf) = image {
        use object::read::elf::ProgramHeader;
        for segment in elf.elf_program_headers() {
            let (kind, loaded) = (segment.p_type(elf.endian()), segment.p_filesz(elf.endian()));
            if kind == elf::PT_LOAD && loaded > 0 {
                add("a segment's load", segment.p_paddr(elf.endian()).into(), loaded.into())?;
            }
        }
    }
    Ok(used)
}

#[test]
fn reads_a_region() {
    let script = "MEMORY\n{\n    FLASH  : ORIGIN = 0x08000000, LENGTH = 1792K\n RAM: ORIGIN = 0x20000000, LENGTH = 96K /* x */\n}\n";
    let names: Vec<_> = regions(script).iter().map(|r| (r.name.clone(), r.origin, r.length)).collect();
    assert_eq!(names, [("FLASH".into(), 0x0800_0000, 1_835_008), ("RAM".into(), 0x2000_0000, 98_304)]);
}
