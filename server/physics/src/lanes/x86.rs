//! Vectors of x86-64: SSE2, AVX2 and AVX-512, in f32 and f64.
//!
//! The wrappers are `#[inline(always)]` and hold no state; the instructions they name run only below a function of
//! `dispatch.rs` that was compiled for their instruction set and is called where the machine has it.
#![allow(unsafe_code)] // intrinsics: what the compiler makes of plain loops changed with every setting of LTO (docs/adr)
use super::nodes::{Lanes, Node, Quad};
use super::real::{self, Real, Scalar, Vector};
#[allow(clippy::wildcard_imports)] // sixty intrinsics
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Neg, Sub};

macro_rules! vector {
    ($name:ident, $narrow:ident, $register:ident, $scalar:ident, $width:expr,
     $add:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $max:ident, $splat:ident, $load:ident, $store:ident,
     $any_positive:ident, $edges:path) => {
        #[derive(Clone, Copy)]
        pub(crate) struct $name($register);

        vector!(@operator $name, Add, add, $add);
        vector!(@operator $name, Sub, sub, $sub);
        vector!(@operator $name, Mul, mul, $mul);
        vector!(@operator $name, Div, div, $div);

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self::of(-0.0) - self
            }
        }

        impl Real for $name {
            const MANTISSA_DIGITS: u32 = $scalar::MANTISSA_DIGITS;
            #[inline(always)]
            fn of(value: f64) -> Self {
                // SAFETY: see the module: the machine has the instruction.
                Self(unsafe { $splat(value as $scalar) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: see the module: the machine has the instruction.
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: see the module: the machine has the instruction.
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn any_positive(self) -> bool {
                $any_positive(self)
            }
        }

        impl Vector for $name {
            type Scalar = $scalar;
            type Narrow = $narrow;
            const WIDTH: usize = $width;
            #[inline(always)]
            fn load(source: &[$scalar]) -> Self {
                assert!(source.len() >= $width);
                // SAFETY: the slice has `WIDTH` elements; an unaligned load; the machine has the instruction.
                Self(unsafe { $load(source.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, target: &mut [$scalar]) {
                assert!(target.len() >= $width);
                // SAFETY: the slice has `WIDTH` elements; an unaligned store; the machine has the instruction.
                unsafe { $store(target.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn edges_to_lanes<const N: usize>(corners: &[[&Node; 4]; 4], edges: &mut Lanes<$scalar, N>, first: usize) {
                $edges(corners, edges, first);
            }
        }
    };
    (@operator $name:ident, $trait:ident, $method:ident, $instruction:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: see the module: the machine has the instruction.
                Self(unsafe { $instruction(self.0, other.0) })
            }
        }
    };
}

vector!(
    F32x4,
    F32x4,
    __m128,
    f32,
    4,
    _mm_add_ps,
    _mm_sub_ps,
    _mm_mul_ps,
    _mm_div_ps,
    _mm_sqrt_ps,
    _mm_max_ps,
    _mm_set1_ps,
    _mm_loadu_ps,
    _mm_storeu_ps,
    any_positive_f32x4,
    edges_f32_sse
);
vector!(
    F64x2,
    F64x2,
    __m128d,
    f64,
    2,
    _mm_add_pd,
    _mm_sub_pd,
    _mm_mul_pd,
    _mm_div_pd,
    _mm_sqrt_pd,
    _mm_max_pd,
    _mm_set1_pd,
    _mm_loadu_pd,
    _mm_storeu_pd,
    any_positive_f64x2,
    real::edges_to_lanes
);
vector!(
    F32x8,
    F32x8,
    __m256,
    f32,
    8,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_sqrt_ps,
    _mm256_max_ps,
    _mm256_set1_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    any_positive_f32x8,
    edges_f32_avx
);
vector!(
    F64x4,
    F64x4,
    __m256d,
    f64,
    4,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_sqrt_pd,
    _mm256_max_pd,
    _mm256_set1_pd,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
    any_positive_f64x4,
    edges_f64_avx
);
vector!(
    F32x16,
    F32x8,
    __m512,
    f32,
    16,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_sqrt_ps,
    _mm512_max_ps,
    _mm512_set1_ps,
    _mm512_loadu_ps,
    _mm512_storeu_ps,
    any_positive_f32x16,
    edges_f32_avx
);
vector!(
    F64x8,
    F64x4,
    __m512d,
    f64,
    8,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_sqrt_pd,
    _mm512_max_pd,
    _mm512_set1_pd,
    _mm512_loadu_pd,
    _mm512_storeu_pd,
    any_positive_f64x8,
    edges_f64_avx
);

/// [`Real::any_positive`]: whether a comparison with zero is true in any lane.
macro_rules! any_positive {
    ($name:ident, $vector:ident, $lanes:ident => $mask:expr) => {
        #[inline(always)]
        fn $name($lanes: $vector) -> bool {
            // SAFETY: see the module: the machine has the instructions.
            (unsafe { $mask }) != 0
        }
    };
}
any_positive!(any_positive_f32x4, F32x4, v => _mm_movemask_ps(_mm_cmpgt_ps(v.0, _mm_setzero_ps())));
any_positive!(any_positive_f64x2, F64x2, v => _mm_movemask_pd(_mm_cmpgt_pd(v.0, _mm_setzero_pd())));
any_positive!(any_positive_f32x8, F32x8, v =>
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(v.0, _mm256_setzero_ps())));
any_positive!(any_positive_f64x4, F64x4, v =>
    _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(v.0, _mm256_setzero_pd())));
any_positive!(any_positive_f32x16, F32x16, v => _mm512_cmp_ps_mask::<_CMP_GT_OQ>(v.0, _mm512_setzero_ps()));
any_positive!(any_positive_f64x8, F64x8, v => _mm512_cmp_pd_mask::<_CMP_GT_OQ>(v.0, _mm512_setzero_pd()));

impl Scalar for f32 {
    type Baseline = F32x4;
    type Avx2 = F32x8;
    type Avx512 = F32x16;

    #[inline(always)]
    fn lanes_to_rows<const N: usize>(lanes: &Lanes<Self, N>, first: usize) -> [[Quad<Self>; 3]; 4] {
        let mut rows = [[[0.0; 4]; 3]; 4];
        for corner in 0..3 {
            let component = |axis: usize| F32x4::load(&lanes[3 * corner + axis][first..first + 4]);
            let tets = transposed([component(0), component(1), component(2), F32x4::of(0.0)]);
            for (row, tet) in rows.iter_mut().zip(tets) {
                tet.store(&mut row[corner]);
            }
        }
        rows
    }
}

#[inline(always)]
fn edges_f32_sse<const N: usize>(corners: &[[&Node; 4]; 4], edges: &mut Lanes<f32, N>, first: usize) {
    for edge in 0..3 {
        let mut rows = [F32x4::of(0.0); 4];
        for tet in 0..4 {
            let mut row = [0.0; 4];
            for axis in 0..4 {
                row[axis] = (corners[tet][edge + 1].0[axis] - corners[tet][0].0[axis]) as f32;
            }
            rows[tet] = F32x4::load(&row);
        }
        store_axes(transposed(rows), edges, edge, first);
    }
}

/// With a node in one register of AVX.
#[inline(always)]
fn edges_f32_avx<const N: usize>(corners: &[[&Node; 4]; 4], edges: &mut Lanes<f32, N>, first: usize) {
    for edge in 0..3 {
        let mut rows = [F32x4::of(0.0); 4];
        for tet in 0..4 {
            let difference = F64x4::load(&corners[tet][edge + 1].0) - F64x4::load(&corners[tet][0].0);
            // SAFETY: see the module: the machine has the instruction.
            rows[tet] = F32x4(unsafe { _mm256_cvtpd_ps(difference.0) });
        }
        store_axes(transposed(rows), edges, edge, first);
    }
}

#[inline(always)]
fn edges_f64_avx<const N: usize>(corners: &[[&Node; 4]; 4], edges: &mut Lanes<f64, N>, first: usize) {
    for edge in 0..3 {
        let mut rows = [F64x4::of(0.0); 4];
        for tet in 0..4 {
            rows[tet] = F64x4::load(&corners[tet][edge + 1].0) - F64x4::load(&corners[tet][0].0);
        }
        store_axes(transposed_f64(rows), edges, edge, first);
    }
}

#[inline(always)]
fn store_axes<V: Vector, const N: usize>(axes: [V; 4], edges: &mut Lanes<V::Scalar, N>, edge: usize, first: usize) {
    for (axis, lanes) in axes.into_iter().take(3).enumerate() {
        lanes.store(&mut edges[3 * edge + axis][first..first + 4]);
    }
}

/// As [`transposed`], in f64.
#[inline(always)]
fn transposed_f64([a, b, c, d]: [F64x4; 4]) -> [F64x4; 4] {
    // SAFETY: see the module: the machine has the instructions.
    unsafe {
        let (ab_even, ab_odd) = (_mm256_unpacklo_pd(a.0, b.0), _mm256_unpackhi_pd(a.0, b.0));
        let (cd_even, cd_odd) = (_mm256_unpacklo_pd(c.0, d.0), _mm256_unpackhi_pd(c.0, d.0));
        [
            F64x4(_mm256_permute2f128_pd::<0x20>(ab_even, cd_even)),
            F64x4(_mm256_permute2f128_pd::<0x20>(ab_odd, cd_odd)),
            F64x4(_mm256_permute2f128_pd::<0x31>(ab_even, cd_even)),
            F64x4(_mm256_permute2f128_pd::<0x31>(ab_odd, cd_odd)),
        ]
    }
}

/// Columns of a 4×4 matrix from its rows.
#[inline(always)]
fn transposed([a, b, c, d]: [F32x4; 4]) -> [F32x4; 4] {
    // SAFETY: SSE is part of every x86-64.
    unsafe {
        let (ab_low, ab_high) = (_mm_unpacklo_ps(a.0, b.0), _mm_unpackhi_ps(a.0, b.0));
        let (cd_low, cd_high) = (_mm_unpacklo_ps(c.0, d.0), _mm_unpackhi_ps(c.0, d.0));
        [
            F32x4(_mm_movelh_ps(ab_low, cd_low)),
            F32x4(_mm_movehl_ps(cd_low, ab_low)),
            F32x4(_mm_movelh_ps(ab_high, cd_high)),
            F32x4(_mm_movehl_ps(cd_high, ab_high)),
        ]
    }
}

impl Scalar for f64 {
    type Baseline = F64x2;
    type Avx2 = F64x4;
    type Avx512 = F64x8;

    #[inline(always)]
    fn lanes_to_rows<const N: usize>(lanes: &Lanes<Self, N>, first: usize) -> [[Quad<Self>; 3]; 4] {
        real::lanes_to_rows(lanes, first)
    }
}
