//! Time-domain passivity: an observer counts the energy the virtual world has given, a controller takes the surplus back.
use crate::parameter::{ParameterError, not_negative, positive};
use glam::DVec3;

/// Settings of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassivitySettings {
    /// Largest damping the controller may add (N s/m): what the arm can render stably, less than its mass over the sample
    /// time. A deficit that this leaves is paid in later ticks.
    pub max_damping_n_s_per_m: f64,
    /// Energy (J) the observer remembers at most. Without a bound, a long dissipative contact would excuse a later active
    /// one.
    pub max_stored_j: f64,
    /// Mass (kg) of the arm at the tool, or less: how far a force moves it within a sample time.
    pub arm_mass_kg: f64,
    /// [`PassivityController::cap`] shortens forces; else it leaves them as they are.
    pub strict: bool,
}

/// Times what the force alone moves the arm by, for the hand pulls too.
const HAND_MARGIN: f64 = 4.0;

impl Default for PassivitySettings {
    fn default() -> Self {
        Self { max_damping_n_s_per_m: 20.0, max_stored_j: 0.05, arm_mass_kg: 0.05, strict: true }
    }
}

impl PassivitySettings {
    /// Checks both.
    ///
    /// # Errors
    /// [`ParameterError`] when the damping is not positive or the energy negative.
    pub fn checked(self) -> Result<Self, ParameterError> {
        positive("max_damping_n_s_per_m", self.max_damping_n_s_per_m)?;
        not_negative("max_stored_j", self.max_stored_j)?;
        positive("arm_mass_kg", self.arm_mass_kg)?;
        Ok(self)
    }
}

/// One tick of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PassivityStep {
    /// Force to apply (N).
    pub force_n: DVec3,
    /// Damping added (N s/m).
    pub damping_n_s_per_m: f64,
    /// Energy (J) the arm has put into the virtual world so far; negative: the world has been active.
    pub energy_j: f64,
}

/// Observer and controller of Hannaford and Ryu (Time-domain passivity control of haptic interfaces, IEEE Trans. Robotics and
/// Automation 18, 2002), for an arm that holds a force over each sample time.
///
/// A held force does exactly `F_{k−1}·(x_k − x_{k−1})` on the arm, so the observer uses displacements, which also see the energy
/// that sampling itself makes (`F·v·T` at the sample instants does not):
///
/// `E_k = E_{k−1} − F_{k−1}·(x_k − x_{k−1})`.
///
/// The controller looks one sample time ahead, and when `E_k − T F_k·v_k < 0` adds the damping that pays:
///
/// `α_k = −(E_k − T F_k·v_k) / (T v_k²)`, `F_k ← F_k − α_k v_k`, bounded by what the arm can render.
///
/// With `x_{k+1} = x_k + T v_k` this is the published scheme, and E never falls below zero.
///
/// *No more than there is.* That damping is bounded, a limiter follows, and an arm does not keep its velocity over a sample time: on a delayed wall the published scheme lets
/// the hand have millijoules (`device-bridge/tests/network_passivity.rs`). So [`PassivityController::cap`], which comes last, shortens what is left until it can do no more work
/// than the energy at hand, with the way that the force itself makes of the arm:
///
/// `T F·v + γ ½ F² T²/m ≤ max(E, 0)`, `γ` = 4:
///
/// first its part along v, as far as that is positive, then all of it. It only ever shortens. A force that nobody worked for, on an arm at rest, is none then: so is the
/// force after an arm was attached in the middle of a contact, until it is pressed. Hence [`PassivitySettings::strict`].
#[derive(Debug, Clone)]
pub struct PassivityController {
    settings: PassivitySettings,
    energy_j: f64,
    held: Option<(DVec3, DVec3)>,
    added_j: f64,
    actions: u64,
}

/// Below this speed (m/s) damping has no effect and its formula no meaning.
const SLOWEST_M_PER_S: f64 = 1e-9;

impl PassivityController {
    /// With no energy stored.
    pub fn new(settings: PassivitySettings) -> Self {
        Self { settings, energy_j: 0.0, held: None, added_j: 0.0, actions: 0 }
    }

    /// Ticks in which damping was added.
    pub fn actions(&self) -> u64 {
        self.actions
    }

    /// Energy (J) taken out by added damping, as planned.
    pub fn dissipated_j(&self) -> f64 {
        self.added_j
    }

    /// Observed energy (J).
    pub fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// Forgets the energy and the force held: out of contact, or after a fault.
    pub fn reset(&mut self) {
        self.energy_j = 0.0;
        self.held = None;
    }

    /// What was held over the interval that ends now did so much less work (J) on the arm than a constant force: a plane that the arm renders by itself ([`crate::ContactPlane::spared_j`]).
    pub fn spared(&mut self, work_j: f64) {
        if work_j.is_finite() {
            self.energy_j = (self.energy_j + work_j).min(self.settings.max_stored_j);
        }
    }

    /// Damps `force_n` (N, on the arm) as far as the energy demands. `position_m` and `velocity_m_per_s` are the arm's now;
    /// the force will be held for `dt_s`. Anything not finite gives zero force and forgets the interval.
    ///
    /// What is really held after this (a limiter may follow) is told by [`PassivityController::held`].
    pub fn step(&mut self, force_n: DVec3, position_m: DVec3, velocity_m_per_s: DVec3, dt_s: f64) -> PassivityStep {
        let finite = force_n.is_finite() && position_m.is_finite() && velocity_m_per_s.is_finite();
        if !(finite && dt_s.is_finite() && dt_s > 0.0) {
            self.held = None;
            return PassivityStep { energy_j: self.energy_j, ..PassivityStep::default() };
        }
        if let Some((held_n, from_m)) = self.held {
            // E_k = E_{k−1} − F_{k−1}·(x_k − x_{k−1})
            let energy_j = (self.energy_j - held_n.dot(position_m - from_m)).min(self.settings.max_stored_j);
            self.energy_j = if energy_j.is_finite() { energy_j } else { 0.0 };
        }
        let damping_n_s_per_m = self.damping(force_n, velocity_m_per_s, dt_s);
        let out_n = force_n - damping_n_s_per_m * velocity_m_per_s;
        if damping_n_s_per_m > 0.0 {
            self.actions += 1;
            self.added_j += damping_n_s_per_m * velocity_m_per_s.length_squared() * dt_s;
        }
        self.held = Some((out_n, position_m));
        PassivityStep { force_n: out_n, damping_n_s_per_m, energy_j: self.energy_j }
    }

    /// The longest part of a force (N) that can do no more work than there is energy, for the interval that [`PassivityController::step`] opened: what is to be held over it.
    pub fn cap(&mut self, force_n: DVec3, velocity_m_per_s: DVec3, dt_s: f64) -> DVec3 {
        let capped_n = if self.settings.strict { self.capped_n(force_n, velocity_m_per_s, dt_s) } else { force_n };
        self.actions += u64::from(capped_n != force_n);
        self.held(capped_n);
        capped_n
    }

    fn capped_n(&self, force_n: DVec3, velocity_m_per_s: DVec3, dt_s: f64) -> DVec3 {
        if !(force_n.is_finite() && velocity_m_per_s.is_finite() && self.held.is_some()) {
            return DVec3::ZERO;
        }
        let at_hand_j = self.energy_j.max(0.0);
        // T F·v ≤ E: F ← F − β (F·v) v/v², β = 1 − E/(T F·v)
        let given_j = dt_s * force_n.dot(velocity_m_per_s);
        let left_n = if given_j > at_hand_j {
            force_n - force_n.project_onto(velocity_m_per_s) * (1.0 - at_hand_j / given_j)
        } else {
            force_n
        };
        // a s² + b s ≤ E for s F
        let a_j = HAND_MARGIN * 0.5 * left_n.length_squared() * dt_s * dt_s / self.settings.arm_mass_kg;
        let b_j = dt_s * left_n.dot(velocity_m_per_s);
        if a_j + b_j <= at_hand_j {
            return left_n;
        }
        let s = (-b_j + (b_j * b_j + 4.0 * a_j * at_hand_j).sqrt()) / (2.0 * a_j);
        // Speeds and energies beyond all sense overflow.
        if s.is_finite() { left_n * s.clamp(0.0, 1.0) } else { DVec3::ZERO }
    }

    /// The force (N) really held over the interval that [`PassivityController::step`] opened.
    pub fn held(&mut self, force_n: DVec3) {
        if let Some((held_n, _)) = &mut self.held {
            *held_n = force_n;
        }
    }

    fn damping(&self, force_n: DVec3, velocity_m_per_s: DVec3, dt_s: f64) -> f64 {
        let speed_sq = velocity_m_per_s.length_squared();
        // α = −(E − T F·v) / (T v²)
        let ahead_j = self.energy_j - dt_s * force_n.dot(velocity_m_per_s);
        if ahead_j >= 0.0 || speed_sq < SLOWEST_M_PER_S * SLOWEST_M_PER_S {
            return 0.0;
        }
        (-ahead_j / (dt_s * speed_sq)).min(self.settings.max_damping_n_s_per_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const UNBOUNDED: PassivitySettings =
        PassivitySettings { max_damping_n_s_per_m: 1e12, max_stored_j: 1e9, arm_mass_kg: 0.1, strict: true };
    const DT_S: f64 = 1e-3;

    fn vector(range: f64) -> impl Strategy<Value = DVec3> {
        (-range..range, -range..range, -range..range).prop_map(DVec3::from)
    }

    #[test]
    fn a_damper_passes_unchanged() {
        let mut controller = PassivityController::new(PassivitySettings::default());
        let mut x = DVec3::ZERO;
        for _ in 0..100 {
            let v = DVec3::new(0.1, 0.0, -0.2);
            let step = controller.step(-2.0 * v, x, v, DT_S);
            assert_eq!((step.force_n, step.damping_n_s_per_m), (-2.0 * v, 0.0));
            x += v * DT_S;
        }
        // 2 N s/m at 0.05 m²/s² for 99 ms
        assert!((controller.energy_j() - 2.0 * 0.05 * 0.099).abs() < 1e-12);
    }

    #[test]
    fn a_pure_source_is_cancelled() {
        let mut controller = PassivityController::new(UNBOUNDED);
        let v = DVec3::new(0.0, 0.3, 0.0);
        let step = controller.step(DVec3::new(0.0, 1.0, 0.0), DVec3::ZERO, v, DT_S);
        assert!(step.force_n.length() < 1e-12, "a force that only gives energy leaves nothing: {:?}", step.force_n);
        assert_eq!(controller.actions(), 1);
    }

    #[test]
    fn damping_is_bounded_and_the_deficit_is_paid_later() {
        let mut controller = PassivityController::new(PassivitySettings { max_damping_n_s_per_m: 1.0, ..UNBOUNDED });
        let v = DVec3::X;
        assert_eq!(controller.step(DVec3::X * 5.0, DVec3::ZERO, v, DT_S).damping_n_s_per_m, 1.0);
        let mut x = v * DT_S;
        let mut ticks = 0;
        while controller.step(DVec3::ZERO, x, v, DT_S).damping_n_s_per_m > 0.0 {
            x += v * DT_S;
            ticks += 1;
        }
        // 4 mJ given, 1 mJ a tick taken back.
        assert_eq!(ticks, 4);
        assert!(controller.energy_j().abs() < 1e-12);
    }

    #[test]
    fn stored_energy_is_capped() {
        let mut controller = PassivityController::new(PassivitySettings { max_stored_j: 1e-3, ..UNBOUNDED });
        for k in 0..10 {
            controller.step(-DVec3::X, DVec3::X * f64::from(k), DVec3::X, DT_S);
        }
        assert_eq!(controller.energy_j(), 1e-3);
    }

    #[test]
    fn not_finite_means_zero_force() {
        let mut controller = PassivityController::new(UNBOUNDED);
        let bad = DVec3::new(f64::NAN, 0.0, 0.0);
        assert_eq!(controller.step(bad, DVec3::ZERO, DVec3::X, DT_S).force_n, DVec3::ZERO);
        assert_eq!(controller.step(DVec3::X, bad, DVec3::X, DT_S).force_n, DVec3::ZERO);
        assert_eq!(controller.step(DVec3::X, DVec3::ZERO, bad, DT_S).force_n, DVec3::ZERO);
        assert!(controller.energy_j().is_finite());
    }

    /// A force that pulls an arm at rest has no velocity to be damped by: it is let through as far as energy was stored before.
    #[test]
    fn a_cap_counts_the_way_that_the_force_makes() {
        let mut controller = PassivityController::new(UNBOUNDED);
        controller.step(DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, DT_S);
        assert_eq!(controller.cap(DVec3::X, DVec3::ZERO, DT_S), DVec3::ZERO, "nothing stored, nothing given");
        controller.held(-DVec3::X);
        // 1 N against a way of 20 um.
        controller.step(DVec3::X, DVec3::X * 2e-5, DVec3::ZERO, DT_S);
        assert_eq!(controller.cap(DVec3::X, DVec3::ZERO, DT_S), DVec3::X, "2e-5 J of 2e-5");
        assert!((controller.cap(DVec3::X * 5.0, DVec3::ZERO, DT_S).x - 1.0).abs() < 1e-9);
        // A force that brakes goes through, and one across the motion.
        assert_eq!(controller.cap(-DVec3::X * 0.5, DVec3::X, DT_S), -DVec3::X * 0.5);
        assert_eq!(controller.cap(DVec3::Y, DVec3::X, DT_S), DVec3::Y);
        assert_eq!(controller.cap(DVec3::NAN, DVec3::X, DT_S), DVec3::ZERO);
    }

    proptest! {
        /// On a mass, which does not keep its velocity, that a hand pulls three times as hard as the force: not a nanojoule.
        #[test]
        fn a_capped_force_gives_nothing_it_does_not_have(
            ticks in prop::collection::vec((vector(5.0), vector(3.0)), 1..300), mass_kg in 0.1_f64..1.0,
        ) {
            let mut controller = PassivityController::new(UNBOUNDED);
            let (mut x, mut v, mut true_j) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for (force_n, pull) in ticks {
                let step = controller.step(force_n, x, v, DT_S);
                let capped_n = controller.cap(step.force_n, v, DT_S);
                prop_assert!(capped_n.length() <= step.force_n.length() * (1.0 + 1e-12));
                let acceleration = (capped_n + pull.clamp_length_max(1.0) * 3.0 * capped_n.length()) / mass_kg;
                let moved_m = v * DT_S + acceleration * (0.5 * DT_S * DT_S);
                true_j -= capped_n.dot(moved_m);
                (x, v) = (x + moved_m, (v + acceleration * DT_S).clamp_length_max(1.0));
                prop_assert!(true_j >= -1e-9, "{true_j}");
            }
        }

        /// Random forces on random motion that keeps its velocity over a sample: the observed energy never falls below zero.
        #[test]
        fn energy_is_never_negative(ticks in prop::collection::vec((vector(5.0), vector(0.5)), 1..300)) {
            let mut controller = PassivityController::new(UNBOUNDED);
            let (mut x, mut true_j) = (DVec3::ZERO, 0.0);
            for (force_n, v) in ticks {
                let step = controller.step(force_n, x, v, DT_S);
                // The added damping never exceeds what cancels the force along v: it brakes, it does not push.
                prop_assert!(step.damping_n_s_per_m * v.length() <= force_n.length() * (1.0 + 1e-6) + 1e-9);
                true_j -= step.force_n.dot(v) * DT_S;
                x += v * DT_S;
                prop_assert!(true_j >= -1e-12, "{true_j}");
            }
        }

        /// With a bounded damping the deficit is never more than what the bound could not pay.
        #[test]
        fn bounded_damping_never_adds_energy(ticks in prop::collection::vec((vector(5.0), vector(0.5)), 1..300)) {
            let mut controller = PassivityController::new(PassivitySettings::default());
            let mut x = DVec3::ZERO;
            for (force_n, v) in ticks {
                let step = controller.step(force_n, x, v, DT_S);
                prop_assert!(step.force_n.dot(v) <= force_n.dot(v) + 1e-12);
                prop_assert!(step.damping_n_s_per_m <= PassivitySettings::default().max_damping_n_s_per_m);
                x += v * DT_S;
            }
        }
    }
}
