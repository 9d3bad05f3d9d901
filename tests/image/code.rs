//! An image's functions: instructions, who calls whom, and the stack that each takes.

use std::collections::BTreeMap;

use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

use crate::thumb::{Flow, Stack, decode};

/// A function.
#[derive(Debug, Default)]
pub(crate) struct Function {
    /// Demangled name, without hashes.
    pub name: String,
    /// First address after it.
    pub end: u32,
    /// Addresses of instructions that leave it, and where they go.
    pub leaves: Vec<(u32, u32)>,
    /// It calls what a register says.
    pub indirect: bool,
    /// Bytes of stack: all that its instructions take together, so not less than it can take at once. `None` if a register
    /// says how many.
    pub frame: Option<u32>,
}

/// Functions by address.
pub(crate) type Functions = BTreeMap<u32, Function>;

/// The functions of `image`.
pub(crate) fn functions(image: &object::File<'_>) -> Functions {
    let mut functions = Functions::new();
    // `$t` and `$d` tell code from tables in it (AAELF32, section 5.5.5).
    let mut code_begins: BTreeMap<u32, bool> = BTreeMap::new();
    for symbol in image.symbols() {
        let (Ok(name), address) = (symbol.name(), symbol.address() as u32) else { continue };
        match name.get(..2) {
            Some("$t") => drop(code_begins.insert(address, true)),
            Some("$d") => drop(code_begins.entry(address).or_insert(false)),
            _ if symbol.kind() == SymbolKind::Text && symbol.size() > 0 => {
                // Bit 0 says Thumb.
                let begin = address & !1;
                let name = format!("{:#}", rustc_demangle::demangle(name));
                let function = Function { name, end: begin + symbol.size() as u32, ..Function::default() };
                functions.entry(begin).or_insert(function);
            }
            _ => {}
        }
    }
    for section in image.sections().filter(|s| s.kind() == object::SectionKind::Text) {
        let (from, data) = (section.address() as u32, section.data().unwrap_or(&[]));
        for (begin, function) in functions.range_mut(from..from + data.len() as u32) {
            read(*begin, function, from, data, &code_begins);
        }
    }
    functions
}

fn read(begin: u32, function: &mut Function, from: u32, data: &[u8], code_begins: &BTreeMap<u32, bool>) {
    /// Over-alignment of a frame, at most.
    const ALIGNMENT: u32 = 64;
    let mut frame = Some(0u32);
    let mut below = BTreeMap::new();
    let mut at = begin;
    while at < function.end {
        let is_code = code_begins.range(..=at).next_back().is_none_or(|(_, code)| *code);
        let code = data.get((at - from) as usize..(function.end - from) as usize).unwrap_or(&[]);
        let Some(instruction) = is_code.then(|| decode(at, code)).flatten() else {
            at += 2;
            continue;
        };
        match instruction.flow {
            Some(Flow::Call(to) | Flow::Jump(to)) if !(begin..function.end).contains(&to) => {
                function.leaves.push((at, to));
            }
            // Recursion.
            Some(Flow::Call(to)) if to == begin => function.leaves.push((at, to)),
            Some(Flow::Indirect) => function.indirect = true,
            _ => {}
        }
        match instruction.stack {
            Some(Stack::Takes(bytes)) => frame = frame.map(|f| f + bytes),
            Some(Stack::Below(register, bytes)) => drop(below.insert(register, bytes)),
            // A copy of SP that was lowered and aligned; else an epilogue.
            Some(Stack::From(register)) => {
                frame = frame.map(|f| f + below.remove(&register).map_or(0, |b| b + ALIGNMENT));
            }
            Some(Stack::Unknown) => frame = None,
            None => {}
        }
        at += instruction.size;
    }
    function.frame = frame;
}

/// The deepest chain of direct calls from the function at `address`: bytes, and names with frames.
pub(crate) struct Chain {
    /// Bytes of stack.
    pub bytes: u32,
    /// Functions with their frames, outermost first.
    pub calls: Vec<(String, u32)>,
}

/// See [`Chain`]. Calls into `left_out` do not count. Calls through registers are not followed, recursion is counted once.
pub(crate) fn deepest(functions: &Functions, address: u32, left_out: &dyn Fn(&str) -> bool) -> Chain {
    let mut known = BTreeMap::new();
    let mut open = Vec::new();
    depth(functions, address, left_out, &mut known, &mut open);
    let mut calls = Vec::new();
    let mut next = Some(address);
    while let Some((at, function)) = next.and_then(|at| Some((at, functions.get(&at)?))) {
        calls.push((function.name.clone(), function.frame.unwrap_or(0)));
        next = known.get(&at).and_then(|(_, next)| *next);
    }
    Chain { bytes: known.get(&address).map_or(0, |(bytes, _)| *bytes), calls }
}

type Known = BTreeMap<u32, (u32, Option<u32>)>;

fn depth(
    functions: &Functions,
    address: u32,
    left_out: &dyn Fn(&str) -> bool,
    known: &mut Known,
    open: &mut Vec<u32>,
) -> u32 {
    if let Some((bytes, _)) = known.get(&address) {
        return *bytes;
    }
    let Some(function) = functions.get(&address) else { return 0 };
    if open.contains(&address) || left_out(&function.name) {
        return 0;
    }
    open.push(address);
    let below =
        function.leaves.iter().map(|(_, to)| (depth(functions, *to, left_out, known, open), *to)).max();
    open.pop();
    let bytes = function.frame.unwrap_or(0) + below.map_or(0, |(bytes, _)| bytes);
    known.insert(address, (bytes, below.filter(|(bytes, _)| *bytes > 0).map(|(_, to)| to)));
    bytes
}
