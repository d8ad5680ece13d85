//! The book of energy that only time integration can keep.
use serde::{Deserialize, Serialize};

/// What only time integration knows: work and dissipation since reset (J).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Ledger {
    /// Work done on the body by tools, loads, injected forces and prescribed motion (J).
    pub external_work_j: f64,
    /// Energy taken by viscous stress, mass damping and what else a scheme damps, and dropped where a body falls asleep (J).
    pub dissipated_j: f64,
}

/// Power of viscous stress (W), as the leapfrog knows it, and the rate at which its force takes energy.
///
/// At step k the viscous force is `−C v_{k−½}`: the kernel reports `q_k = v_{k−½}ᵀ C v_{k−½}`, but the force works on
/// `½(v_{k−½} + v_{k+½})`. With the polarisation of the quadratic form the work is
/// `dt (¾ q_k + ¼ q_{k+1}) + O(dt³) = dt (q_k + ¼(q_k − q_{k−1})) + O(dt³)`, which needs no future. That holds while C does;
/// at large strain it turns with the body, and the sum keeps an error of first order, `¼ dt ∫ vᵀĊv dt`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ViscousPower {
    /// `q_k` (W).
    pub latest_w: f64,
    /// `q_{k−1}` (W).
    pub before_w: f64,
}

impl ViscousPower {
    /// Takes `q_k`; the first one after a start has no predecessor, and its velocity is not late.
    pub fn record(&mut self, power_w: f64, has_predecessor: bool) {
        self.before_w = if has_predecessor { self.latest_w } else { power_w };
        self.latest_w = power_w;
    }

    /// `q_k + ¼(q_k − q_{k−1})` (W).
    pub fn work_rate_w(&self) -> f64 {
        self.latest_w + 0.25 * (self.latest_w - self.before_w)
    }
}

/// The ledger with the energies of a state (J).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energies {
    /// `Σ ½ m v²`.
    pub kinetic_j: f64,
    /// `Σ V Ψ(F)`.
    pub elastic_j: f64,
    /// `−Σ m g·(x − X)`.
    pub gravitational_j: f64,
    /// See [`Ledger::external_work_j`].
    pub external_work_j: f64,
    /// See [`Ledger::dissipated_j`].
    pub dissipated_j: f64,
}

impl Energies {
    /// Of a state that does not belong to the body it is asked of.
    pub(crate) const NAN: Self = Self {
        kinetic_j: f64::NAN,
        elastic_j: f64::NAN,
        gravitational_j: f64::NAN,
        external_work_j: f64::NAN,
        dissipated_j: f64::NAN,
    };

    /// `K + U + G`: what the body holds (J).
    pub fn held_j(&self) -> f64 {
        self.kinetic_j + self.elastic_j + self.gravitational_j
    }

    /// `K + U + G − W + D` (J): constant in exact arithmetic and exact time.
    pub fn balance_j(&self) -> f64 {
        self.held_j() - self.external_work_j + self.dissipated_j
    }
}
