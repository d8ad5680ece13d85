//! Points of the wire: 16-bit places in the box that holds them.
use crate::ViewError;
use glam::DVec3;
use palpate_proto::v1::Places;

/// Positions (m).
///
/// # Errors
/// An array cut short.
pub fn positions_m(places: &Places) -> Result<Vec<DVec3>, ViewError> {
    let (points, rest) = places.positions_u16le.as_chunks::<6>();
    if !rest.is_empty() {
        return Err(ViewError::Stream("has an array of places cut short".into()));
    }
    let corner = places.corner_m.map_or(DVec3::ZERO, |c| DVec3::new(c.x, c.y, c.z));
    let place = |b: &[u8; 6]| DVec3::from([0, 2, 4].map(|at| f64::from(u16::from_le_bytes([b[at], b[at + 1]]))));
    Ok(points.iter().map(|b| corner + f64::from(places.quantum_m) * place(b)).collect())
}
