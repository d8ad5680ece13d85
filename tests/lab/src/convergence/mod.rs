//! Convergence orders, found in every run: that linear tetrahedra and leapfrog approach the right answer as fast as theory says.
//!
//! - `manufactured.rs`: linear tetrahedra against a solution that is known everywhere
//! - `in_time.rs`: leapfrog against itself at half the time step
mod in_time;
mod manufactured;

use miette::Result;
use palpate_physics::material::Law;
use std::fmt::Write as _;

/// Errors of one quantity over successive refinements, each of half the size of the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Convergence {
    /// What converges.
    pub quantity: &'static str,
    /// What is refined.
    pub refined: &'static str,
    /// How fine.
    pub sizes: Vec<u32>,
    /// Errors, one per size, or one less where each is a difference of two sizes.
    pub errors: Vec<f64>,
    /// The order that is demanded.
    pub demand: f64,
}

impl Convergence {
    /// Order seen in the last refinement: `log₂(e_{n−1}/e_n)`.
    pub fn order(&self) -> f64 {
        match self.errors[..] {
            [.., before, last] => (before / last).log2(),
            _ => f64::NAN,
        }
    }

    /// Whether it is what is demanded.
    pub fn is_met(&self) -> bool {
        self.order() >= self.demand
    }
}

/// All studies, in some seconds.
///
/// # Errors
/// A body that cannot be built or an equilibrium that is not found.
pub fn all() -> Result<Vec<Convergence>> {
    let [l2, h1] = manufactured::study(Law::StableNeoHookean)?;
    Ok(vec![l2, h1, in_time::study()?])
}

/// As CSV.
pub fn csv(studies: &[Convergence]) -> String {
    let list = |values: Vec<String>| values.join(" ");
    let mut text = String::from("quantity,refined,sizes,errors,order,demand\n");
    for c in studies {
        let sizes = list(c.sizes.iter().map(u32::to_string).collect());
        let errors = list(c.errors.iter().map(|e| format!("{e:.6e}")).collect());
        let _ = writeln!(text, "{},{},{sizes},{errors},{:.4},{}", c.quantity, c.refined, c.order(), c.demand);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_what_theory_says() {
        let other_laws = [Law::StVenantKirchhoff, Law::FixedCorotated].map(|law| manufactured::study(law).unwrap());
        for study in all().unwrap().into_iter().chain(other_laws.into_iter().flatten()) {
            println!("{}: {:?}, order {:.3}", study.quantity, study.errors, study.order());
            assert!(study.is_met(), "{study:?}");
        }
    }

    #[test]
    fn first_order_does_not_pass_for_second() {
        let errors = vec![4.0, 2.0, 1.0];
        let study = Convergence { quantity: "q", refined: "r", sizes: vec![1, 2, 4], errors, demand: 1.9 };
        assert!(!study.is_met() && (study.order() - 1.0).abs() < 1e-12);
        assert_eq!(csv(&[study]).lines().nth(1), Some("q,r,1 2 4,4.000000e0 2.000000e0 1.000000e0,1.0000,1.9"));
    }
}
