//! The keyframe of a session: topology and rest shape, in chunks well below the message limit.
use bytes::{BufMut, Bytes, BytesMut};
use glam::DVec3;
use palpate_physics::Model;
use palpate_proto::v1;

/// Largest payload of one chunk (bytes): what a viewer that does not read makes the daemon hold.
pub const CHUNK_BYTES: usize = 64 * 1024;

/// Rest positions of surface vertices as the viewer has them (f32, m): displacements are taken from these.
pub fn rest_positions_f32(model: &Model) -> Vec<[f32; 3]> {
    let rest = model.surface_rest_positions_m();
    model.surface().nodes.iter().map(|&node| rest[node as usize].to_array().map(|c| c as f32)).collect()
}

/// Corners of the rest bounding box (m).
pub fn bounds_m(model: &Model) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    model.surface_rest_positions_m().iter().fold(start, |(low, high), x| (low.min(*x), high.max(*x)))
}

/// All chunks of a session's keyframe, in order.
pub fn chunks(session_id: &str, scene_name: &str, model: &Model, epoch: u32) -> Vec<v1::KeyframeChunk> {
    let mut positions = BytesMut::new();
    for component in rest_positions_f32(model).iter().flatten() {
        positions.put_f32_le(*component);
    }
    let mut triangles = BytesMut::new();
    for vertex in model.surface().triangles.iter().flatten() {
        triangles.put_u32_le(*vertex);
    }
    let mut parts = split(positions.freeze(), triangles.freeze());
    let chunk_count = parts.len() as u32;
    let mut header = Some(header(session_id, scene_name, model));
    parts
        .drain(..)
        .enumerate()
        .map(|(chunk, (rest_positions_m_f32le, triangles_u32le))| v1::KeyframeChunk {
            epoch,
            chunk: chunk as u32,
            chunk_count,
            header: header.take(),
            rest_positions_m_f32le,
            triangles_u32le,
        })
        .collect()
}

fn header(session_id: &str, scene_name: &str, model: &Model) -> v1::KeyframeHeader {
    let (low, high) = bounds_m(model);
    let vec3 = |v: DVec3| Some(v1::Vec3 { x: v.x, y: v.y, z: v.z });
    v1::KeyframeHeader {
        session_id: session_id.to_owned(),
        scene_name: scene_name.to_owned(),
        vertex_count: model.surface().nodes.len() as u32,
        triangle_count: model.surface().triangles.len() as u32,
        tick_period_s: model.settings().tick_period_s,
        bounds_min_m: vec3(low),
        bounds_max_m: vec3(high),
        tools: model
            .tools()
            .iter()
            .map(|tool| v1::ToolShape {
                name: tool.name.clone(),
                radius_m: tool.radius_m,
                half_length_m: tool.shape.half_length_m(),
            })
            .collect(),
        particle_spacing_m: model.body().particle_spacing_m(),
    }
}

/// Cuts positions, then triangles, at multiples of 12 bytes: no vertex or triangle is torn.
fn split(mut positions: Bytes, mut triangles: Bytes) -> Vec<(Bytes, Bytes)> {
    let room = CHUNK_BYTES / 12 * 12;
    let mut parts = Vec::new();
    loop {
        let some = positions.split_to(positions.len().min(room));
        let left = room - some.len();
        let others = if positions.is_empty() { triangles.split_to(triangles.len().min(left)) } else { Bytes::new() };
        parts.push((some, others));
        if positions.is_empty() && triangles.is_empty() {
            return parts;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_small_whole_and_in_order() {
        for (positions, triangles) in [(0, 0), (12, 12), (CHUNK_BYTES * 2 + 36, CHUNK_BYTES + 24), (CHUNK_BYTES, 12)] {
            let (positions, triangles) = (positions / 12 * 12, triangles / 12 * 12);
            let source = |n: usize, seed: usize| (0..n).map(|i| ((i * 7 + seed) % 251) as u8).collect::<Bytes>();
            let (p, t) = (source(positions, 1), source(triangles, 2));
            let parts = split(p.clone(), t.clone());
            assert!(
                parts.iter().all(|(a, b)| a.len() + b.len() <= CHUNK_BYTES && a.len() % 12 == 0 && b.len() % 12 == 0)
            );
            assert_eq!(parts.iter().flat_map(|(a, _)| a.to_vec()).collect::<Vec<_>>(), p.to_vec());
            assert_eq!(parts.iter().flat_map(|(_, b)| b.to_vec()).collect::<Vec<_>>(), t.to_vec());
        }
    }
}
