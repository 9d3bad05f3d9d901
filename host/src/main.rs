//! The `rfhoi` command.

mod commands;

use std::panic::{self, PanicHookInfo};
use std::process::{ExitCode, exit};

use clap::Parser;
use commands::Cli;

/// As a shell tells of a program that SIGPIPE ended, which Rust's programs ignore.
const READER_GONE: i32 = 128 + 13;

/// Whether somebody who read what is printed, as `head`, has read enough: `println!` panics then.
fn reader_is_gone(panic: &PanicHookInfo<'_>) -> bool {
    let said = panic.payload_as_str().unwrap_or_default();
    said.starts_with("failed printing to stdout") && said.contains("Broken pipe")
}

fn main() -> ExitCode {
    let usual = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        if reader_is_gone(panic) {
            exit(READER_GONE);
        }
        usual(panic);
    }));
    let cli = Cli::parse();
    commands::run(&cli)
}
