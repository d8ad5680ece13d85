//! Points as 16-bit places in the box that holds them: the active particles of a hybrid or seed body, the vertices of a refined surface.
//!
//! `x = corner + q n` with `q = 2^k` m, the smallest for which the longest side of the box fits 16 bits: the error of a component is at
//! most `q/2 ≤ side/65535`. Those near a contact move in every tick and come and go, so each update has all of them: 6 bytes a
//! point, where naming what changed would cost 10.
use bytes::{BufMut, BytesMut};
use glam::DVec3;
use palpate_proto::v1;

/// The points of a frame, by their positions (m).
pub fn encode(positions_m: &[DVec3]) -> v1::Places {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = positions_m.iter().fold(start, |(low, high), x| (low.min(*x), high.max(*x)));
    let (corner_m, side_m) =
        if positions_m.is_empty() { (DVec3::ZERO, 0.0) } else { (low, (high - low).max_element()) };
    // Below some picometres nothing is seen; above, only a body that is lost.
    let exponent = (side_m / f64::from(u16::MAX)).log2().ceil().clamp(-40.0, 100.0) as i32;
    let quantum_m = 2.0_f32.powi(exponent);
    let mut positions = BytesMut::with_capacity(positions_m.len() * 6);
    for x in positions_m {
        for component in ((*x - corner_m) / f64::from(quantum_m)).to_array() {
            positions.put_u16_le(component.round() as u16);
        }
    }
    v1::Places {
        corner_m: Some(v1::Vec3 { x: corner_m.x, y: corner_m.y, z: corner_m.z }),
        quantum_m,
        positions_u16le: positions.freeze(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What a viewer does.
    fn decode(message: &v1::Places) -> Vec<DVec3> {
        let corner = message.corner_m.unwrap();
        let place = |b: &[u8]| {
            DVec3::from([0, 2, 4].map(|at| f64::from(u16::from_le_bytes([b[at], b[at + 1]]))))
                * f64::from(message.quantum_m)
                + DVec3::new(corner.x, corner.y, corner.z)
        };
        message.positions_u16le.chunks_exact(6).map(place).collect()
    }

    proptest! {
        #[test]
        fn points_come_back_within_half_a_quantum(
            points in prop::collection::vec(prop::array::uniform3(-0.2_f64..0.3), 0..60),
            scale in prop_oneof![Just(1.0), Just(1e-6), Just(0.0)],
        ) {
            let points: Vec<DVec3> = points.iter().map(|p| DVec3::from(*p) * scale).collect();
            let message = encode(&points);
            let seen = decode(&message);
            prop_assert_eq!(seen.len(), points.len());
            let quantum_m = f64::from(message.quantum_m);
            prop_assert!(quantum_m <= 2.0_f64.powi(-40) || quantum_m <= 2.0 * 0.5 * scale / 65535.0);
            for (seen, exact) in seen.iter().zip(&points) {
                prop_assert!((*seen - *exact).abs().max_element() <= quantum_m / 2.0 + 1e-15, "{} {}", seen, exact);
            }
        }
    }

    #[test]
    fn absurd_places_saturate_and_do_not_panic() {
        let far = [DVec3::ZERO, DVec3::new(f64::INFINITY, f64::NAN, 1e300)];
        let message = encode(&far);
        assert_eq!(message.positions_u16le.len(), 12);
        assert!(message.quantum_m.is_finite());
    }
}
