//! The methods that are judged. A new model registers itself in [`all`], by a [`Method`] that builds a [`Running`].
//!
//! - `subject.rs`: a problem on linear tetrahedra, which all of these share
//! - `tetrahedra.rs`: as the server runs them, in all variants
//! - `hybrid.rs`: coarse tets and particles
//! - `seed.rs`: the papers' own hybrid
//! - `quasi_newton/`: backward Euler as a minimisation, prefactored, with L-BFGS
//! - `xpbd/`: position-based dynamics with small steps
//! - `pace.rs`: how fast a problem is gone through
mod driven;
mod hybrid;
mod pace;
mod quasi_newton;
mod seed;
mod subject;
#[cfg(test)]
mod testing;
mod tetrahedra;
mod xpbd;

pub(crate) use hybrid::{asleep, nearest, particles};
pub use pace::{Pace, tremor};
pub(crate) use subject::Subject;
pub(crate) use subject::tet_body;

use crate::problems::{Problem, body::Body};
use glam::DVec3;
use hybrid::Hybrid;
use miette::Result;
use quasi_newton::QuasiNewton;
use seed::SeedHybrid;
use tetrahedra::Tetrahedra;
use xpbd::Xpbd;

/// A way to solve problems in real time.
pub trait Method {
    /// Short name, without commas.
    fn name(&self) -> &str;
    /// What it is, in a sentence.
    fn what(&self) -> &str;
    /// Whether its material is the problem's. Where it is not, errors may cancel: the method is shown out of competition.
    fn competes(&self, _problem: &Problem) -> bool {
        true
    }
    /// Resolutions it is run at, in the unit of [`Body::resolution_unit`], ascending.
    fn resolutions(&self, body: Body, full: bool) -> Vec<u32> {
        body.resolutions(full).to_vec()
    }
    /// Builds it for a problem.
    ///
    /// # Errors
    /// A body or model that cannot be built.
    fn build(&self, problem: &Problem, resolution: u32, pace: &Pace) -> Result<Box<dyn Running>>;
}

/// A problem under way.
pub trait Running {
    /// One tick of 1 ms, at whose end the tool's way or the load is at this fraction. Nothing else may be done in it: it is timed.
    fn tick(&mut self, fraction: f64);
    /// The problem's answer now (N or m).
    fn answer(&self) -> f64;
    /// Displacements (m) of the problem's material points now.
    fn displacements_m(&self) -> Vec<DVec3>;
    /// Energy that came from nowhere or went there since the start, over the work done; `None` if it keeps no ledger.
    fn energy_error(&self) -> Option<f64>;
    /// Elements, nodes and substeps per tick.
    fn size(&self) -> [usize; 3];
    /// Why it is not running any more.
    fn failure(&self) -> Option<String>;
}

/// Linear tetrahedra, whose equilibrium on a mesh is what peers are held against.
pub const LINEAR_TETS: &str = "linear tets";
/// What a scene of tetrahedra alone gets when it does not ask for another.
pub const SMOOTHED_TETS: &str = "smoothed tets";
/// What the default scene is.
pub const SERVED: &str = "hybrid 200 awake smooth skin";

/// Every method.
pub fn all() -> Vec<Box<dyn Method>> {
    let mut methods: Vec<Box<dyn Method>> = Vec::new();
    methods.extend(Tetrahedra::variants().into_iter().map(|method| Box::new(method) as Box<dyn Method>));
    methods.extend(Hybrid::variants().into_iter().map(|method| Box::new(method) as Box<dyn Method>));
    methods.extend(SeedHybrid::variants().into_iter().map(|method| Box::new(method) as Box<dyn Method>));
    methods.extend(QuasiNewton::variants().into_iter().map(|method| Box::new(method) as Box<dyn Method>));
    methods.extend(Xpbd::variants().into_iter().map(|method| Box::new(method) as Box<dyn Method>));
    methods
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
    use super::*;

    #[test]
    fn names_are_unique_and_the_default_is_one() {
        let methods = all();
        let mut names: Vec<&str> = methods.iter().map(|m| m.name()).collect();
        assert!([LINEAR_TETS, SMOOTHED_TETS, SERVED].iter().all(|name| names.contains(name)));
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), methods.len());
        assert!(names.iter().all(|name| !name.contains(',')));
    }

    /// Of every kind of problem: a tool, a load, and each law. The size of hybrid bodies was asked for as of bodies of tets alone, and
    /// the bench ended in a panic at the first of them.
    #[test]
    fn no_tick_allocates_and_every_method_tells_its_size() {
        for name in
            ["block-sphere-large-nu0.45", "block-patch-small-nu0.45-stvk", "block-sphere-large-nu0.45-corotated"]
        {
            let problem = testing::problem(name);
            let pace = Pace::of(&problem).unwrap();
            for method in all() {
                let Ok(mut running) = method.build(&problem, 4, &pace) else { continue };
                assert_no_alloc::assert_no_alloc(|| {
                    for tick in 1..=20 {
                        running.tick(f64::from(tick) / 20.0);
                    }
                });
                let answer = running.answer();
                assert!(running.size().iter().all(|&count| count > 0), "{}: {:?}", method.name(), running.size());
                assert!(answer > 0.0, "{name} by {}: {answer} {:?}", method.name(), running.failure());
            }
        }
    }
}
