//! Rate of the frame search on simulated streams: the data UART carries 0.09 MB/s, a replayed file has no limit.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rfhoi_firmware::mmwave::tlv::{
    DetectedPoint, FrameHeader, FrameWriter, HeaderFormat, SideInfo, Statistics, StreamParser, TlvKind,
    WriteError,
};

/// A stream of `frames` frames of 12 points, range profile and statistics, with a 256 x `doppler` heat map.
fn simulated(frames: u32, doppler: usize) -> Result<Vec<u8>, WriteError> {
    let mut stream = Vec::new();
    let mut buffer = vec![0; 1 << 15];
    for number in 0..frames {
        let mut writer = FrameWriter::new(&mut buffer, HeaderFormat::Subframe)?;
        let point = DetectedPoint { x_m: 0.1, y_m: 1.5, z_m: -0.2, velocity_m_s: 0.4 };
        writer.points(&[point; 12], &[SideInfo { snr_decidb: 180, noise_decidb: 600 }; 12])?;
        let level = |cell: usize| (cell.wrapping_mul(2_654_435_761) >> 16) as u16;
        writer.elements(TlvKind::RangeProfile, &(0..256).map(level).collect::<Vec<_>>())?;
        if doppler > 0 {
            writer
                .elements(TlvKind::RangeDopplerHeatmap, &(0..256 * doppler).map(level).collect::<Vec<_>>())?;
        }
        writer.statistics(Statistics::default())?;
        stream.extend_from_slice(writer.finish(FrameHeader {
            number,
            points: 12,
            ..FrameHeader::default()
        })?);
    }
    Ok(stream)
}

fn search(c: &mut Criterion) {
    let mut group = c.benchmark_group("tlv");
    for (name, doppler) in [("points", 0), ("heatmap", 16)] {
        let frames = 100;
        let stream = simulated(frames, doppler).expect("the buffer holds the frames");
        group.throughput(Throughput::Bytes(stream.len() as u64));
        for chunk in [64, 512, stream.len()] {
            let label = if chunk == stream.len() { "whole".into() } else { chunk.to_string() };
            group.bench_function(BenchmarkId::new(name, label), |b| {
                let mut parser = Box::new(StreamParser::<{ 1 << 15 }>::new(HeaderFormat::Subframe));
                b.iter(|| {
                    let before = parser.counts().complete;
                    for mut input in stream.chunks(chunk) {
                        while parser.next(&mut input).is_some() {}
                    }
                    assert_eq!(parser.counts().complete - before, frames);
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, search);
criterion_main!(benches);
