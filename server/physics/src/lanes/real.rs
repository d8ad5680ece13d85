//! What passes compute with: scalars, and vectors of them.
use super::nodes::{Lanes, Node, Quad};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number, or a vector of numbers that all do the same. Every operation is one IEEE operation per lane, never
/// contracted, so that all instruction sets give the same bits.
pub(crate) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Binary digits of a number: 24 of f32, 53 of f64.
    const MANTISSA_DIGITS: u32;
    /// Rounded from f64, in every lane.
    fn of(value: f64) -> Self;
    /// `√`, correctly rounded.
    fn sqrt(self) -> Self;
    /// The larger one, for numbers that are not NaN.
    fn max(self, other: Self) -> Self;
    /// Whether any lane is above zero; a lane that is NaN is not.
    fn any_positive(self) -> bool;
}

/// f32 or f64: what is stored.
pub(crate) trait Scalar: Real + Default + PartialOrd + From<f32> + Into<f64> {
    /// Vectors of what every machine of the target has.
    type Baseline: Vector<Scalar = Self>;
    /// Vectors of AVX2.
    type Avx2: Vector<Scalar = Self>;
    /// Vectors of AVX-512.
    type Avx512: Vector<Scalar = Self>;
    /// Lanes `first..first + 4` back to rows: `[tet][i − 1]`.
    fn lanes_to_rows<const N: usize>(lanes: &Lanes<Self, N>, first: usize) -> [[Quad<Self>; 3]; 4];
}

/// A vector of scalars.
pub(crate) trait Vector: Real {
    /// Its lanes' type.
    type Scalar: Scalar;
    /// A vector for so few lanes that this one would be half empty; itself where there is none that is less work.
    type Narrow: Vector<Scalar = Self::Scalar>;
    /// Its number of lanes.
    const WIDTH: usize;
    /// Lanes from the start of a slice that has at least [`Self::WIDTH`].
    fn load(source: &[Self::Scalar]) -> Self;
    /// Lanes to the start of a slice that has at least [`Self::WIDTH`].
    fn store(self, target: &mut [Self::Scalar]);
    /// Rows `a_i − a_0` of four tets, taken in f64 and then rounded, to lanes `first..first + 4`:
    /// `edges[3(i − 1) + axis][first + tet]`.
    fn edges_to_lanes<const N: usize>(corners: &[[&Node; 4]; 4], edges: &mut Lanes<Self::Scalar, N>, first: usize);
}

macro_rules! scalar {
    ($scalar:ident) => {
        impl Real for $scalar {
            const MANTISSA_DIGITS: u32 = $scalar::MANTISSA_DIGITS;
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $scalar
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self > other { self } else { other }
            }
            #[inline(always)]
            fn any_positive(self) -> bool {
                self > 0.0
            }
        }

        impl Vector for $scalar {
            type Scalar = Self;
            type Narrow = Self;
            const WIDTH: usize = 1;
            #[inline(always)]
            fn load(source: &[Self]) -> Self {
                source[0]
            }
            #[inline(always)]
            fn store(self, target: &mut [Self]) {
                target[0] = self;
            }
            #[inline(always)]
            fn edges_to_lanes<const N: usize>(corners: &[[&Node; 4]; 4], edges: &mut Lanes<Self, N>, first: usize) {
                edges_to_lanes(corners, edges, first);
            }
        }
    };
}
scalar!(f32);
scalar!(f64);

/// [`Vector::edges_to_lanes`] in plain code.
#[inline(always)]
pub(crate) fn edges_to_lanes<T: Scalar, const N: usize>(
    corners: &[[&Node; 4]; 4],
    edges: &mut Lanes<T, N>,
    first: usize,
) {
    for tet in 0..4 {
        for edge in 0..3 {
            for axis in 0..3 {
                edges[3 * edge + axis][first + tet] = T::of(corners[tet][edge + 1].0[axis] - corners[tet][0].0[axis]);
            }
        }
    }
}

/// [`Scalar::lanes_to_rows`] in plain code.
#[inline(always)]
pub(crate) fn lanes_to_rows<T: Scalar, const N: usize>(lanes: &Lanes<T, N>, first: usize) -> [[Quad<T>; 3]; 4] {
    let mut rows = [[[T::of(0.0); 4]; 3]; 4];
    for tet in 0..4 {
        for corner in 0..3 {
            for axis in 0..3 {
                rows[tet][corner][axis] = lanes[3 * corner + axis][first + tet];
            }
        }
    }
    rows
}

#[cfg(not(target_arch = "x86_64"))]
mod elsewhere {
    //! One lane at a time: the compiler vectorises the loop over lanes where it can.
    use super::{Lanes, Quad, Scalar};

    macro_rules! plain {
        ($scalar:ident) => {
            impl Scalar for $scalar {
                type Baseline = Self;
                type Avx2 = Self;
                type Avx512 = Self;
                #[inline(always)]
                fn lanes_to_rows<const N: usize>(lanes: &Lanes<Self, N>, first: usize) -> [[Quad<Self>; 3]; 4] {
                    super::lanes_to_rows(lanes, first)
                }
            }
        };
    }
    plain!(f32);
    plain!(f64);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::dispatch::{self, Available, InstructionSet, Pass};

    /// Whether any lane of a vector is positive, and how many lanes it has.
    struct AnyPositive<'a, S>(&'a [S]);

    impl<S: Scalar> Pass for AnyPositive<'_, S> {
        type Scalar = S;
        type Found = (bool, usize);
        #[inline(always)]
        fn run<V: Vector<Scalar = S>>(self) -> (bool, usize) {
            (V::load(self.0).any_positive(), V::WIDTH)
        }
    }

    fn one_positive_lane_is_found<S: Scalar>() {
        for set in InstructionSet::available() {
            let set = Available::at_most(set);
            let mut lanes = [-1.0, 0.0, -0.0, f64::NAN, f64::NEG_INFINITY, -1e-30, 0.0, -7.0].repeat(2);
            let found = |lanes: &[f64]| {
                let lanes: Vec<S> = lanes.iter().map(|lane| S::of(*lane)).collect();
                dispatch::run(set, AnyPositive(&lanes))
            };
            assert!(!found(&lanes).0, "{set:?}");
            for lane in 0..lanes.len() {
                let before = std::mem::replace(&mut lanes[lane], 1e-30);
                let (any, width) = found(&lanes);
                assert_eq!(any, lane < width, "{set:?}, lane {lane}");
                lanes[lane] = before;
            }
        }
    }

    #[test]
    fn one_positive_lane_of_any_vector_is_found() {
        one_positive_lane_is_found::<f32>();
        one_positive_lane_is_found::<f64>();
    }
}
