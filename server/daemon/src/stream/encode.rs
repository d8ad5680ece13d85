//! The shape of the surface as 16-bit displacements, and what changed of it since any earlier frame.
//!
//! **Quantum.** A component `d` (m) is sent as `n = round(d/q)` with `q = 2^k` m. The smallest `k` is taken for which the largest
//! component fits 15 bits, but never less than [`FLOOR_EXPONENT`] below the body's size; it grows at once and shrinks only
//! when the largest component has become [`SHRINK_RATIO`] times too small for it, so that a body which breathes does not resend
//! everything. Powers of two are exact in f32, so the viewer's `X + q n` has no error of its own: the error of a component is at
//! most `q/2 ≤ max(size · 2⁻²¹, SHRINK_RATIO · max|d| / 32767)`.
//!
//! **Changes.** For every vertex the shape keeps the number of the frame that last changed its triple. What a viewer that holds
//! frame `s` needs to hold frame `f` is therefore exactly the vertices whose number is larger than `s`, whatever frames it
//! missed in between: dropping frames loses nothing.
use bytes::{BufMut, Bytes, BytesMut};

/// The quantum is at least the body's size times `2^-FLOOR_EXPONENT`.
pub const FLOOR_EXPONENT: i32 = 20;
/// The quantum shrinks when it is this many times larger than needed.
pub const SHRINK_RATIO: f64 = 16.0;

/// A quantised shape, as of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Metres per unit: a power of two.
    pub quantum_m: f32,
    /// Displacement of each surface vertex from its (f32) rest position, in quanta.
    pub quanta: Vec<[i16; 3]>,
    /// Number of the frame that last changed each vertex.
    pub changed_in_frame: Vec<u64>,
}

/// The payload of one update.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Delta {
    /// Indices of changed vertices (little-endian u32), ascending; empty beside displacements: all of them.
    pub changed_u32le: Bytes,
    /// Their displacements (little-endian i16, x y z), in quanta.
    pub displacements_i16le: Bytes,
}

/// Turns displacements into [`Shape`]s, frame by frame.
#[derive(Debug)]
pub struct Quantiser {
    floor_exponent: i32,
    exponent: i32,
    shape: Shape,
}

impl Quantiser {
    /// For a body of so many surface vertices and a size (m), the diagonal of its rest bounding box.
    pub fn new(vertices: usize, size_m: f64) -> Self {
        let size_exponent = if size_m > 0.0 && size_m.is_finite() { size_m.log2().floor() as i32 } else { 0 };
        let floor_exponent = (size_exponent - FLOOR_EXPONENT).clamp(-100, 100);
        let shape = Shape {
            quantum_m: power_of_two(floor_exponent),
            quanta: vec![[0; 3]; vertices],
            changed_in_frame: vec![0; vertices],
        };
        Self { floor_exponent, exponent: floor_exponent, shape }
    }

    /// Takes the displacements (m) of frame number `frame`, which must increase from 1.
    pub fn advance(&mut self, frame: u64, displacements_m: &[[f32; 3]]) -> Shape {
        let largest = displacements_m.iter().flatten().fold(0.0_f32, |m, d| m.max(d.abs()));
        let rescaled = self.choose_exponent(f64::from(largest));
        let quantum = f64::from(self.shape.quantum_m);
        let Shape { quanta, changed_in_frame, .. } = &mut self.shape;
        for ((held, changed), displacement) in quanta.iter_mut().zip(changed_in_frame).zip(displacements_m) {
            let fresh = displacement.map(|d| (f64::from(d) / quantum).round() as i16);
            if rescaled || fresh != *held {
                *held = fresh;
                *changed = frame;
            }
        }
        self.shape.clone()
    }

    /// Chooses the quantum; true when it is another one, and every vertex must be named anew.
    fn choose_exponent(&mut self, largest_m: f64) -> bool {
        let wanted = quantum_exponent(largest_m).max(self.floor_exponent);
        let shrink_by = SHRINK_RATIO.log2() as i32;
        if wanted <= self.exponent && wanted > self.exponent - shrink_by {
            return false;
        }
        self.exponent = wanted;
        self.shape.quantum_m = power_of_two(wanted);
        true
    }
}

impl Shape {
    /// What a viewer that holds frame `since` (`None`: nothing yet) needs to hold this one.
    pub fn delta(&self, since: Option<u64>) -> Delta {
        let Some(since) = since else { return self.everything() };
        let changed = self.changed_in_frame.iter().filter(|&&frame| frame > since).count();
        // An index costs 4 bytes beside the 6 of the displacement.
        if changed * 10 >= self.quanta.len() * 6 {
            return self.everything();
        }
        let mut indices = BytesMut::with_capacity(changed * 4);
        let mut displacements = BytesMut::with_capacity(changed * 6);
        for (vertex, (quanta, frame)) in self.quanta.iter().zip(&self.changed_in_frame).enumerate() {
            if *frame > since {
                indices.put_u32_le(vertex as u32);
                put(&mut displacements, *quanta);
            }
        }
        Delta { changed_u32le: indices.freeze(), displacements_i16le: displacements.freeze() }
    }

    fn everything(&self) -> Delta {
        let mut displacements = BytesMut::with_capacity(self.quanta.len() * 6);
        for quanta in &self.quanta {
            put(&mut displacements, *quanta);
        }
        Delta { changed_u32le: Bytes::new(), displacements_i16le: displacements.freeze() }
    }
}

/// `k` of the smallest quantum `2^k` m for which a component of `largest_m` fits 15 bits.
pub(super) fn quantum_exponent(largest_m: f64) -> i32 {
    let finite = if largest_m.is_finite() { largest_m } else { f64::from(f32::MAX) };
    ((finite / f64::from(i16::MAX)).log2().ceil() as i32).clamp(-100, 120)
}

pub(super) fn put(into: &mut BytesMut, quanta: [i16; 3]) {
    for component in quanta {
        into.put_i16_le(component);
    }
}

pub(super) fn power_of_two(exponent: i32) -> f32 {
    2.0_f32.powi(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What a viewer does with an update.
    fn apply(held: &mut Vec<[i16; 3]>, delta: &Delta) {
        let triples: Vec<[i16; 3]> = delta
            .displacements_i16le
            .chunks_exact(6)
            .map(|b| [0, 2, 4].map(|at| i16::from_le_bytes([b[at], b[at + 1]])))
            .collect();
        if delta.changed_u32le.is_empty() && !triples.is_empty() {
            *held = triples;
            return;
        }
        for (index, triple) in delta.changed_u32le.chunks_exact(4).zip(triples) {
            held[u32::from_le_bytes([index[0], index[1], index[2], index[3]]) as usize] = triple;
        }
    }

    /// Whether a frame is received, and which vertices change in it.
    type Frame = (bool, Vec<(usize, [f32; 3])>);

    fn frames() -> impl Strategy<Value = Vec<Frame>> {
        let component = prop_oneof![4 => -1e-3_f32..1e-3, 1 => -0.2_f32..0.2, 1 => Just(0.0_f32)];
        let change = (0..40_usize, [component.clone(), component.clone(), component]);
        prop::collection::vec((any::<bool>(), prop::collection::vec(change, 0..40)), 1..30)
    }

    proptest! {
        #[test]
        fn any_dropped_frames_still_give_the_exact_shape_within_half_a_quantum(frames in frames()) {
            let mut quantiser = Quantiser::new(40, 0.1);
            let mut truth = vec![[0.0_f32; 3]; 40];
            let (mut held, mut since) = (vec![[i16::MAX; 3]; 40], None);
            for (number, (received, changes)) in frames.iter().enumerate() {
                for (vertex, displacement) in changes {
                    truth[*vertex] = *displacement;
                }
                let shape = quantiser.advance(number as u64 + 1, &truth);
                if !received {
                    continue;
                }
                apply(&mut held, &shape.delta(since));
                since = Some(number as u64 + 1);
                prop_assert_eq!(&held, &shape.quanta);
                let largest = truth.iter().flatten().fold(0.0_f64, |m, d| m.max(f64::from(d.abs())));
                let bound = (0.1 * 2.0_f64.powi(-21)).max(SHRINK_RATIO * largest / 32767.0);
                prop_assert!(f64::from(shape.quantum_m) / 2.0 <= bound);
                for (quanta, exact) in held.iter().zip(&truth) {
                    for axis in 0..3 {
                        let error = f64::from(shape.quantum_m) * f64::from(quanta[axis]) - f64::from(exact[axis]);
                        prop_assert!(error.abs() <= f64::from(shape.quantum_m) / 2.0);
                    }
                }
            }
        }
    }

    #[test]
    fn nothing_changed_is_nothing_sent_and_little_is_indexed() {
        let mut quantiser = Quantiser::new(100, 0.1);
        let mut d = vec![[0.0_f32; 3]; 100];
        d[7] = [1e-3, 0.0, -2e-3];
        assert_eq!(quantiser.advance(1, &d).delta(None).displacements_i16le.len(), 600);
        let same = quantiser.advance(2, &d).delta(Some(1));
        assert!(same.changed_u32le.is_empty() && same.displacements_i16le.is_empty());
        d[9] = [0.0, 1e-3, 0.0];
        let one = quantiser.advance(3, &d);
        assert_eq!(one.delta(Some(2)).changed_u32le.as_ref(), 9_u32.to_le_bytes());
        assert_eq!(one.delta(Some(2)).displacements_i16le.len(), 6);
        assert_eq!(one.delta(None).displacements_i16le.len(), 600);
    }

    #[test]
    fn the_quantum_follows_the_largest_displacement_with_hysteresis() {
        let mut quantiser = Quantiser::new(1, 0.1);
        let at_rest = quantiser.advance(1, &[[0.0; 3]]).quantum_m;
        let pressed = quantiser.advance(2, &[[0.02, 0.0, 0.0]]).quantum_m;
        assert!(pressed > at_rest);
        assert_eq!(quantiser.advance(3, &[[0.005, 0.0, 0.0]]).quantum_m, pressed, "no resend for a small release");
        assert_eq!(quantiser.advance(4, &[[0.0; 3]]).quantum_m, at_rest);
    }

    #[test]
    fn absurd_displacements_saturate_and_do_not_panic() {
        let mut quantiser = Quantiser::new(2, 0.0);
        let shape = quantiser.advance(1, &[[f32::INFINITY, f32::MAX, -f32::MAX], [f32::NAN, 0.0, 0.0]]);
        assert_eq!(shape.quanta[1], [0; 3]);
        assert!(shape.quantum_m.is_finite());
    }
}
