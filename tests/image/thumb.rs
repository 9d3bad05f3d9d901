//! The few Thumb-2 instructions that a look at an image needs: branches, and what takes stack.
//!
//! Encodings by number are those of the ARMv7-M Architecture Reference Manual, section A7.7.

/// Where an instruction may go besides the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flow {
    /// Calls the function at this address.
    Call(u32),
    /// Jumps to this address.
    Jump(u32),
    /// Calls or jumps where a register says.
    Indirect,
}

/// What an instruction does to the stack pointer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stack {
    /// Takes this many bytes.
    Takes(u32),
    /// Puts the stack pointer less this many bytes into a register.
    Below(u8, u32),
    /// Sets the stack pointer from a register.
    From(u8),
    /// Takes as many bytes as a register says.
    Unknown,
}

/// One instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Instruction {
    /// Bytes: 2 or 4.
    pub size: u32,
    /// Where it may go.
    pub flow: Option<Flow>,
    /// What it does to the stack.
    pub stack: Option<Stack>,
}

const SP: u32 = 13;

/// The instruction at `address`, where `code` begins.
pub(crate) fn decode(address: u32, code: &[u8]) -> Option<Instruction> {
    let half = |i: usize| Some(u32::from(u16::from_le_bytes(code.get(i..i + 2)?.try_into().ok()?)));
    let first = half(0)?;
    // A5.1: these three prefixes begin an instruction of 32 bits.
    if first >> 11 < 0b11101 {
        return Some(Instruction { size: 2, flow: flow_16(address, first), stack: stack_16(first) });
    }
    let second = half(2)?;
    Some(Instruction { size: 4, flow: flow_32(address, first, second), stack: stack_32(first, second) })
}

/// `value`'s low `bits` as a signed number, from the program counter of an instruction at `address`.
fn target(address: u32, value: u32, bits: u32) -> u32 {
    let shift = 32 - bits;
    let offset = ((value << shift) as i32) >> shift;
    (address + 4).wrapping_add_signed(offset)
}

fn flow_16(address: u32, first: u32) -> Option<Flow> {
    const LR: u32 = 14;
    match first {
        // B, T1; the last two conditions are other instructions.
        0xd000..=0xddff => Some(Flow::Jump(target(address, (first & 0xff) << 1, 9))),
        // B, T2.
        0xe000..=0xe7ff => Some(Flow::Jump(target(address, (first & 0x7ff) << 1, 12))),
        // BX and BLX of a register; BX of LR returns.
        _ if first & 0xff87 == 0x4780 => Some(Flow::Indirect),
        _ if first & 0xff87 == 0x4700 && (first >> 3) & 0xf != LR => Some(Flow::Indirect),
        _ => None,
    }
}

fn flow_32(address: u32, first: u32, second: u32) -> Option<Flow> {
    if first & 0xf800 != 0xf000 {
        return None;
    }
    let sign = (first >> 10) & 1;
    let [j1, j2] = [13, 11].map(|bit| (second >> bit) & 1);
    let far = || {
        let [i1, i2] = [j1, j2].map(|j| 1 ^ j ^ sign);
        let value = sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3ff) << 12 | (second & 0x7ff) << 1;
        target(address, value, 25)
    };
    match second & 0xd000 {
        // BL, T1.
        0xd000 => Some(Flow::Call(far())),
        // B, T4.
        0x9000 => Some(Flow::Jump(far())),
        // B, T3; the last two conditions are other instructions.
        0x8000 if (first >> 6) & 0xe != 0xe => {
            let value = sign << 20 | j2 << 19 | j1 << 18 | (first & 0x3f) << 12 | (second & 0x7ff) << 1;
            Some(Flow::Jump(target(address, value, 21)))
        }
        _ => None,
    }
}

fn stack_16(first: u32) -> Option<Stack> {
    match first {
        // PUSH, T1.
        0xb400..=0xb5ff => Some(Stack::Takes(4 * (first & 0x1ff).count_ones())),
        // SUB (SP minus immediate), T1.
        0xb080..=0xb0ff => Some(Stack::Takes(4 * (first & 0x7f))),
        // MOV (register), T1, into SP.
        _ if first & 0xff87 == 0x4685 => Some(Stack::From((first >> 3) as u8 & 0xf)),
        _ => None,
    }
}

fn stack_32(first: u32, second: u32) -> Option<Stack> {
    let to = (second >> 8) & 0xf;
    let immediate_12 = (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xff;
    let lowered = |bytes| match to {
        SP => Stack::Takes(bytes),
        register => Stack::Below(register as u8, bytes),
    };
    match first {
        // PUSH, T2.
        0xe92d => Some(Stack::Takes(4 * second.count_ones())),
        // STR (immediate), T4, before SP with writeback; PUSH, T3, is one.
        0xf84d if second & 0x0f00 == 0x0d00 => Some(Stack::Takes(second & 0xff)),
        // STRD (immediate), T1, before SP with writeback.
        0xe96d => Some(Stack::Takes(4 * (second & 0xff))),
        // VPUSH, T1 and T2.
        0xed2d | 0xed6d if second & 0x0e00 == 0x0a00 => Some(Stack::Takes(4 * (second & 0xff))),
        // SUB (SP minus immediate), T2.
        _ if first & 0xfbef == 0xf1ad && second & 0x8000 == 0 => Some(lowered(expand(immediate_12))),
        // SUB (SP minus immediate), T3.
        _ if first & 0xfbff == 0xf2ad && second & 0x8000 == 0 => Some(lowered(immediate_12)),
        // SUB (SP minus register), T1.
        _ if first & 0xffef == 0xebad && to == SP => Some(Stack::Unknown),
        _ => None,
    }
}

/// ThumbExpandImm (A5.3.2).
fn expand(immediate: u32) -> u32 {
    let byte = immediate & 0xff;
    match immediate >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (0x80 | byte & 0x7f).rotate_right(immediate >> 7),
    }
}

#[test]
fn decodes_what_the_assembler_encodes() {
    let at = |code: &[u8]| decode(0x0800_0000, code).unwrap();
    let flow = |code: &[u8]| at(code).flow;
    // As GNU as 2.40 encodes: bl and b.w 0x100 ahead, beq.w 0x100 back, b over one instruction, blx r3, bx lr.
    assert_eq!(flow(&[0x00, 0xf0, 0x7e, 0xf8]), Some(Flow::Call(0x0800_0100)));
    assert_eq!(flow(&[0x00, 0xf0, 0x7e, 0xb8]), Some(Flow::Jump(0x0800_0100)));
    assert_eq!(flow(&[0x3f, 0xf4, 0x7e, 0xaf]), Some(Flow::Jump(0x07ff_ff00)));
    assert_eq!(flow(&[0x00, 0xe0]), Some(Flow::Jump(0x0800_0004)));
    assert_eq!(flow(&[0x98, 0x47]), Some(Flow::Indirect));
    assert_eq!(flow(&[0x70, 0x47]), None);
    let stack = |code: &[u8]| at(code).stack;
    // push {r4, r5, r7, lr}; push.w {r8, r9, r11}; vpush {d8, d9}; sub sp, #16; sub.w sp, sp, #1024; subw r4, sp, #2060.
    assert_eq!(stack(&[0xb0, 0xb5]), Some(Stack::Takes(16)));
    assert_eq!(stack(&[0x2d, 0xe9, 0x00, 0x0b]), Some(Stack::Takes(12)));
    assert_eq!(stack(&[0x2d, 0xed, 0x04, 0x8b]), Some(Stack::Takes(16)));
    assert_eq!(stack(&[0x84, 0xb0]), Some(Stack::Takes(16)));
    assert_eq!(stack(&[0xad, 0xf5, 0x80, 0x6d]), Some(Stack::Takes(1024)));
    assert_eq!(stack(&[0xad, 0xf6, 0x0c, 0x04]), Some(Stack::Below(4, 2060)));
}
