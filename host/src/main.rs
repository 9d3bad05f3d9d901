//! The `rfhoi` command.

mod commands;

use std::process::ExitCode;

use clap::Parser;
use commands::Cli;

fn main() -> ExitCode {
    let cli = Cli::parse();
    commands::run(&cli)
}
