//! The ledger of the energies that only time integration knows, and the energies of a state.
use serde::{Deserialize, Serialize};

/// Work and dissipation (J) since reset, which only time integration knows.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Ledger {
    /// Work done on the body by tools, loads, injected forces and prescribed motion (J).
    pub external_work_j: f64,
    /// Energy (J) taken by viscous stress, mass damping and other damping of a scheme, and dropped where a body falls
    /// asleep.
    pub dissipated_j: f64,
}

/// The power of viscous stress (W) at the last two substeps, from which leapfrog computes the rate at which its force
/// takes energy.
///
/// At step k the viscous force is `−C v_{k−½}`: the kernel reports `q_k = v_{k−½}ᵀ C v_{k−½}`, but the force works on
/// `½(v_{k−½} + v_{k+½})`. With the polarisation of the quadratic form the work is
/// `dt (¾ q_k + ¼ q_{k+1}) + O(dt³) = dt (q_k + ¼(q_k − q_{k−1})) + O(dt³)`, which needs no future. That holds while C
/// does; at large strain it turns with the body, and the sum keeps an error of first order, `¼ dt ∫ vᵀĊv dt`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ViscousPower {
    /// Power `q_k` (W).
    pub latest_w: f64,
    /// Power `q_{k−1}` (W).
    pub before_w: f64,
}

impl ViscousPower {
    /// Notes `q_k`. The first one after a start has no predecessor, and its velocity is not late.
    pub fn record(&mut self, power_w: f64, has_predecessor: bool) {
        self.before_w = if has_predecessor { self.latest_w } else { power_w };
        self.latest_w = power_w;
    }

    /// Returns `q_k + ¼(q_k − q_{k−1})` (W).
    pub fn work_rate_w(&self) -> f64 {
        self.latest_w + 0.25 * (self.latest_w - self.before_w)
    }
}

/// The energies of a state (J), with the ledger.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energies {
    /// Kinetic energy `Σ ½ m v²`.
    pub kinetic_j: f64,
    /// Elastic energy `Σ V Ψ(F)`.
    pub elastic_j: f64,
    /// Gravitational energy `−Σ m g·(x − X)`.
    pub gravitational_j: f64,
    /// Work done on the body ([`Ledger::external_work_j`]).
    pub external_work_j: f64,
    /// Dissipated energy ([`Ledger::dissipated_j`]).
    pub dissipated_j: f64,
}

impl Energies {
    /// Stands for the energies of a state that does not belong to the body.
    pub(crate) const NAN: Self = Self {
        kinetic_j: f64::NAN,
        elastic_j: f64::NAN,
        gravitational_j: f64::NAN,
        external_work_j: f64::NAN,
        dissipated_j: f64::NAN,
    };

    /// Returns the energy `K + U + G` (J) that the body holds.
    pub fn held_j(&self) -> f64 {
        self.kinetic_j + self.elastic_j + self.gravitational_j
    }

    /// Returns the balance `K + U + G − W + D` (J), which is constant in exact arithmetic and exact time integration.
    pub fn balance_j(&self) -> f64 {
        self.held_j() - self.external_work_j + self.dissipated_j
    }
}
