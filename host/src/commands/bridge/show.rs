//! `rfhoi bridge show`.

use std::net::SocketAddrV4;
use std::time::Instant;

use clap::Args;
use rfhoi::bridge::health::{Health, Identity};
use rfhoi::bridge::live::Live;
use rfhoi::bridge::settings::Settings;
use rfhoi_shared::config::BridgeConfig;
use serde::Serialize;

use super::super::stopped;
use super::{Local, Progress, Target, report, seconds};

#[derive(Debug, Args)]
pub(super) struct Show {
    #[command(flatten)]
    target: Target,
    /// How long to listen to its telemetry, s.
    #[arg(long, value_name = "S", default_value_t = 3.0)]
    seconds: f64,
}

/// What the radar sees with its profile, and what that costs.
#[derive(Debug, Serialize)]
struct Reach {
    range_bin_m: f32,
    range_span_m: f32,
    velocity_bin_m_per_s: f32,
    velocity_span_m_per_s: f32,
    frames_per_s: f32,
    cube_bytes: u32,
}

#[derive(Debug, Serialize)]
struct Shown {
    address: SocketAddrV4,
    #[serde(flatten)]
    identity: Identity,
    configuration: Settings,
    reach: Reach,
    telemetry: Vec<Health>,
    notices: Vec<String>,
}

impl Show {
    pub(super) fn run(&self, local: &Local, json: bool) -> anyhow::Result<()> {
        let length = seconds(self.seconds)?;
        let progress = Progress::waiting("asking the bridge")?;
        let mut go_on = |share| progress.show(share);
        let mut client = self.target.client(local, &progress)?;
        let identity = Identity::from(&client.hello(&mut go_on)?);
        let config = client.config(&mut go_on)?;
        drop(progress);
        let mut shown = Shown {
            address: client.peer(),
            identity,
            configuration: Settings::of(&config),
            reach: Reach::of(&config),
            telemetry: Vec::new(),
            notices: client.take_notices(),
        };
        if !json {
            report::print(&shown, false)?;
            println!("telemetry");
        }
        let mut live = Live::default();
        let end = Instant::now() + length;
        while Instant::now() < end && !stopped() {
            let Some(bytes) = client.receive(end)? else { continue };
            live.push(bytes);
            let (health, notices) = (live.take_health(), live.take_notices());
            if !json {
                if let Some(health) = &health {
                    if shown.telemetry.is_empty() {
                        println!("  started by: {}", health.restart_reason);
                    }
                    println!("  {:.1} s: {health}", health.up_s);
                }
                notices.iter().for_each(|n| println!("  notice: {n}"));
            }
            shown.telemetry.extend(health);
            shown.notices.extend(notices);
        }
        if json {
            report::print(&shown, true)?;
        } else if shown.telemetry.is_empty() {
            println!("  none came in {:.1} s", length.as_secs_f64());
        }
        Ok(())
    }
}

impl Reach {
    fn of(config: &BridgeConfig) -> Self {
        let profile = &config.radar.profile;
        Self {
            range_bin_m: profile.range_bin().0,
            range_span_m: profile.range_span().0,
            velocity_bin_m_per_s: profile.velocity_bin().0,
            velocity_span_m_per_s: profile.velocity_span().0,
            frames_per_s: 1.0 / profile.frame_period().0,
            cube_bytes: profile.cube_bytes(config.radar.processing.gate),
        }
    }
}
