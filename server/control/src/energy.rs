//! What the hand gave and got: counted at the arm, and by nobody who acts on it.
use glam::DVec3;

/// The energy that the arm put into the virtual world, from the forces really held and the ways really measured:
///
/// `E_k = E_{k−1} − F_{k−1}·(x_k − x_{k−1})`.
///
/// Unlike the passivity observer's it has no bound, is never reset, and knows nothing of what was planned: it is there to judge the controller by.
#[derive(Debug, Clone, Default)]
pub struct EnergyMeter {
    energy_j: f64,
    least_j: f64,
    held: Option<(DVec3, DVec3)>,
}

impl EnergyMeter {
    /// The arm is at `position_m` (m), and holds `force_n` (N) from now on. What is not finite ends the interval uncounted.
    pub fn step(&mut self, position_m: DVec3, force_n: DVec3) {
        if let Some((held_n, from_m)) = self.held.take() {
            let energy_j = self.energy_j - held_n.dot(position_m - from_m);
            if energy_j.is_finite() {
                self.energy_j = energy_j;
                self.least_j = self.least_j.min(energy_j);
            }
        }
        self.held = (position_m.is_finite() && force_n.is_finite()).then_some((force_n, position_m));
    }

    /// Energy (J) put in so far; negative: the hand has got some.
    pub fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// The least it ever was (J), at most 0: −1 µJ is the most energy that the hand had ever got.
    pub fn least_j(&self) -> f64 {
        self.least_j
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spring_gives_back_what_it_got_and_a_push_is_remembered() {
        let mut meter = EnergyMeter::default();
        // Trapezoids of a spring of 100 N/m over 10 mm: 5 mJ, but for the sampling.
        let spring_n = |x: f64| DVec3::X * (-100.0 * x);
        let way = |n: i32| 1e-5 * f64::from(if n <= 1000 { n } else { 2000 - n });
        for n in 0..=2000 {
            meter.step(DVec3::X * way(n), spring_n(way(n)));
        }
        // Held forces lag by a sample: 100 N/m · (10 mm) · 10 um, as much on the way in as on the way out.
        assert!((meter.energy_j() + 100.0 * 0.01 * 1e-5).abs() < 1e-9, "{}", meter.energy_j());
        assert!((meter.least_j() - meter.energy_j()).abs() < 1e-12);
        meter.step(DVec3::ZERO, DVec3::X);
        meter.step(DVec3::X * 0.1, -DVec3::X);
        meter.step(DVec3::X * 0.3, DVec3::ZERO);
        assert!(meter.energy_j() > 0.09 && (meter.least_j() + 0.1).abs() < 1e-4);
    }

    #[test]
    fn what_is_no_number_is_not_counted() {
        let mut meter = EnergyMeter::default();
        for (x, f) in
            [(DVec3::ZERO, DVec3::X), (DVec3::NAN, DVec3::X), (DVec3::X, DVec3::INFINITY), (DVec3::X, DVec3::X)]
        {
            meter.step(x, f);
        }
        assert_eq!((meter.energy_j(), meter.least_j()), (0.0, 0.0));
    }
}
