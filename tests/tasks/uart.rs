//! The SDK demo's own frames over its data UART.

use rfhoi_firmware::mmwave::tlv::{DetectedPoint, FrameHeader, FrameWriter, HeaderFormat, SideInfo};
use rfhoi_shared::config::{BridgeConfig, RadarConfig, RadarInput};
use rfhoi_shared::wire::{FrameCounts, RadarState, Request};
use rfhoi_tests::simulated::rig::{Setup, run_script};

use crate::{HOST, setup};

fn point(frame: u32) -> (DetectedPoint, SideInfo) {
    let point = DetectedPoint { x_m: 0.1, y_m: 1.0, z_m: -0.5, velocity_m_s: 0.25 * frame as f32 };
    (point, SideInfo { snr_decidb: 100, noise_decidb: 300 })
}

fn frame(number: u32) -> Vec<u8> {
    let mut buffer = vec![0; 1_024];
    let mut writer = FrameWriter::new(&mut buffer, HeaderFormat::Subframe).expect("room");
    let (point, side) = point(number);
    writer.points(&[point], &[side]).expect("room");
    writer.finish(FrameHeader { number, ..FrameHeader::default() }).expect("room").to_vec()
}

#[test]
fn frames_of_the_uart_arrive() {
    const FRAMES: u32 = 60;
    let usual = setup(0).config;
    let radar = RadarConfig { input: RadarInput::Uart, ..usual.radar };
    run_script(Setup { config: BridgeConfig { radar, ..usual }, ..setup(0) }, |rig| async move {
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.data.say(b"not a frame").await;
        while !rig.console.with(|console| console.is_started()) {
            rig.pass(0.1).await;
        }
        for number in 0..FRAMES {
            if number % 10 == 5 {
                rig.data.say(&[0x5a; 300]).await;
            }
            rig.data.say(&frame(number)).await;
            rig.pass(0.05).await;
        }
        rig.pass(1.1).await;
        let telemetry = host.telemetry();
        assert_eq!(telemetry.frames, FrameCounts { complete: FRAMES, ..FrameCounts::default() });
        assert_eq!(telemetry.radar, RadarState::Streaming);
        assert_eq!(rig.recorder.taken(), [], "there is no recorder");
        let host = host.host();
        let numbers: Vec<u32> = host.frames().map(|f| f.frame).collect();
        assert!(numbers.iter().copied().eq(0..FRAMES), "{numbers:?}");
        assert!(host.frames().all(|f| f.points == [point(f.frame).0.to_wire(Some(point(f.frame).1))]));
        assert_eq!(host.receiver.counts().packets_lost, 0);
    });
}
