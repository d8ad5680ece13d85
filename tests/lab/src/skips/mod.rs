//! What is skipped because a scene does not need it: the time saved by each skip, and that it changes nothing.
//!
//! - `pair.rs`: one scene twice, with the skip and without, tick by tick in turns
//! - `sleep.rs`: a body at rest, left alone or not
//! - `heart.rs`: what is skipped of a body with particles
//! - `rest_data.rs`: what follows from the rest state, at load instead of in every substep
//! - `table.rs`: `skips.csv`
mod heart;
mod pair;
mod rest_data;
mod sleep;
mod table;

use crate::timing::Summary;
use miette::Result;
pub use table::{csv, print};

/// A skip.
#[derive(Debug, Clone, Copy)]
pub struct Skip {
    /// Name.
    pub name: &'static str,
    /// What is left out, and when.
    pub what: &'static str,
    /// In which scene it is measured.
    pub scene: &'static str,
    /// How far (m) the body may be from where it would be without the skip; `None`: the same bits are demanded.
    pub tolerance_m: Option<f64>,
    /// Measures it over so many timed ticks.
    pub run: fn(usize) -> Result<Found>,
}

/// What was found of a skip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Time per tick with the skip.
    pub with: Summary,
    /// Time per tick with it switched off.
    pub without: Summary,
    /// Whether both end in the same state, bit for bit.
    pub same_bits: bool,
    /// How far (m) at most a node is from where it is without the skip.
    pub farthest_m: f64,
}

impl Found {
    /// Part of the time without the skip that it saves.
    pub fn saved(&self) -> f64 {
        1.0 - self.with.median_s / self.without.median_s
    }
}

impl Skip {
    /// Whether what was found is what is promised of it.
    pub fn is_kept(&self, found: &Found) -> bool {
        self.tolerance_m.map_or(found.same_bits, |tolerance_m| found.farthest_m <= tolerance_m)
    }

    /// Tells whether both ended in the same state, or how far from each other.
    pub fn sameness(&self, found: &Found) -> String {
        match self.tolerance_m {
            None if found.same_bits => "bit for bit".to_owned(),
            None => format!("no, {:.1e} m apart", found.farthest_m),
            Some(tolerance_m) => format!("within {:.1e} m (allowed {tolerance_m:.0e} m)", found.farthest_m),
        }
    }
}

/// Every skip that there is.
pub const ALL: [Skip; 10] = [
    Skip {
        name: "viscous terms",
        what: "strain rates and viscous stress of materials with phi = psi = 0",
        scene: "ventricle of about 1 352 tets, ringing, a sphere pressed in",
        tolerance_m: None,
        run: pair::viscous_terms,
    },
    Skip {
        name: "distant contact, tool away",
        what: "contact tests of triangles that a tool cannot have reached since they were last looked at",
        scene: "ventricle of about 10 000 tets, ringing, a sphere 20 mm away",
        tolerance_m: None,
        run: pair::distant_contact_away,
    },
    Skip {
        name: "distant contact, tool pressed in",
        what: "the same",
        scene: "the same ventricle, the sphere pressed in",
        tolerance_m: None,
        run: pair::distant_contact_pressed,
    },
    Skip {
        name: "rest data",
        what: "inverse edge matrices, shape gradients and volumes: computed at load, not in every substep",
        scene: "ventricle of about 1 352 tets; off: the tick and all rest data once a substep",
        tolerance_m: None,
        run: rest_data::run,
    },
    Skip {
        name: "sleep",
        what: "all of a body that is at rest, while no tool is near and nothing acts on it that did not before",
        scene: "ventricle of about 1 352 tets, damped, come to rest, a sphere 20 mm away",
        // Twice the body's distance from rest when it is left: it would go to the other side.
        tolerance_m: Some(2.0 * sleep::TOLERANCE_M),
        run: sleep::run,
    },
    Skip {
        name: "coarse tets, long steps",
        what: "forces of coarse tets in every other substep; where the tick then takes one more, nothing is saved",
        scene: HEART,
        tolerance_m: Some(1e-5),
        run: heart::long_steps,
    },
    Skip {
        name: "sleeping particles",
        what: "all particles but the 200 nearest to the finger, which the coarse tets move",
        scene: HEART,
        tolerance_m: Some(1e-3),
        run: heart::sleeping_particles,
    },
    Skip {
        name: "distant contact, a heart's skin",
        what: "contact tests of triangles that the finger cannot have reached since they were last looked at",
        scene: "the same, without self-contact",
        tolerance_m: None,
        run: heart::distant_contact,
    },
    Skip {
        name: "skin nobody watches",
        what: "vertices of the skin that contact does not ask for",
        scene: "the same heart; off: all of them in every tick, as files of frames have them",
        tolerance_m: None,
        run: heart::unwatched_skin,
    },
    Skip {
        name: "sleep of a heart",
        what: "all of it, once it has come to rest after a press",
        scene: "the heart that is served by default, left by the finger",
        tolerance_m: Some(2.0 * heart::TOLERANCE_M),
        run: heart::sleep,
    },
];

const HEART: &str =
    "the heart that is served by default, 200 particles awake, a finger pressed in and dragged at 100 mm/s";

/// What is skipped and is not the lab's to measure: name and reason.
pub const ELSEWHERE: [(&str, &str); 2] = [
    (
        "frames for nobody",
        "surfaces are encoded by palpated, outside its loop; its tests count that nothing is made for nobody",
    ),
    (
        "sleeping particles, by their number",
        "cargo bench -p palpate-physics --bench sleeping: ticks, load and memory beside 26 thousand and 2.8 million of them",
    ),
];
