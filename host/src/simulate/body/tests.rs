use glam::Vec3;

use super::{Body, Joint, Joints, Lengths, Side};

/// Standing upright with hanging arms, facing y.
fn standing(lengths: &Lengths) -> Joints {
    let mut joints = [Vec3::ZERO; Joint::COUNT];
    let mut put = |joint: Joint, place: Vec3| joints[joint.index()] = place;
    let waist = lengths.hip_height() + lengths.loins;
    let shoulders = waist + lengths.chest;
    put(Joint::HipCentre, Vec3::Z * lengths.hip_height());
    put(Joint::Spine, Vec3::Z * waist);
    put(Joint::ShoulderCentre, Vec3::Z * shoulders);
    put(Joint::Head, Vec3::Z * (shoulders + lengths.neck));
    for side in Side::BOTH {
        let x = side.sign() * lengths.shoulder;
        let arm = [0.0, lengths.upper_arm, lengths.upper_arm + lengths.forearm, lengths.arm()];
        side.arm().into_iter().zip(arm).for_each(|(j, down)| put(j, Vec3::new(x, 0.0, shoulders - down)));
        let x = side.sign() * lengths.hip;
        let leg = [lengths.hip_height(), lengths.ankle + lengths.shin, lengths.ankle];
        side.leg().into_iter().zip(leg).for_each(|(j, z)| put(j, Vec3::new(x, 0.0, z)));
        put(side.leg()[3], Vec3::new(x, lengths.foot, lengths.ankle - lengths.instep));
    }
    joints
}

#[test]
fn a_body_is_as_tall_as_its_person_and_closed() {
    for (height, build) in [(1.63, 0.85), (1.75, 1.0), (1.91, 1.25)] {
        let body = Body::new(height, build);
        let mut vertices = Vec::new();
        body.vertices(&standing(body.lengths()), 0.0, &mut vertices);
        assert_eq!(vertices.len(), body.vertex_count());
        let top = vertices.iter().map(|v| v.z).fold(0.0, f32::max);
        assert!((top - height).abs() < 0.01, "{top} of {height}");
        let low = vertices.iter().map(|v| v.z).fold(9.0, f32::min);
        assert!((0.0..0.005).contains(&low), "sole at {low}");
        let triangles = &body.surface().triangles;
        assert!((400..=900).contains(&triangles.len()), "{} triangles", triangles.len());
        assert_eq!(triangles.len(), body.surface().reflectivity.len());
        // Faces outward: the signed volume is that of a person, 0.98 kg a litre; segments overlap a little.
        let corners = triangles.iter().map(|t| t.map(|v| vertices[v as usize]));
        let volume: f32 = corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
        let litres = 1e3 * volume / (build * build);
        let expected = 24.0 * height * height;
        assert!((0.7..1.3).contains(&(litres / expected)), "{litres} l, not about {expected}");
    }
}

#[test]
fn every_segment_faces_outward() {
    let body = Body::new(1.75, 1.0);
    let mut vertices = Vec::new();
    body.vertices(&standing(body.lengths()), 0.0, &mut vertices);
    // Triangles of one tube come one after the other and share vertices with no other tube: their mean is inside.
    let mut tubes: Vec<Vec<[u32; 3]>> = Vec::new();
    let mut last = 0;
    for &triangle in &body.surface().triangles {
        if tubes.is_empty() || triangle.iter().all(|&v| v > last) {
            tubes.push(Vec::new());
        }
        last = triangle.into_iter().fold(last, u32::max);
        tubes.last_mut().unwrap().push(triangle);
    }
    assert_eq!(tubes.len(), 16);
    for tube in tubes {
        let corners = tube.iter().map(|t| t.map(|v| vertices[v as usize]));
        let middle = corners.clone().flatten().sum::<Vec3>() / (3 * tube.len()) as f32;
        for [a, b, c] in corners {
            let normal = (b - a).cross(c - a);
            assert!(normal.dot(a + b + c - 3.0 * middle) > 0.0, "{a} {b} {c} about {middle}");
        }
    }
}
