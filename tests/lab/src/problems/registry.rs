//! All problems. A new one is added here, and `palpate-lab references` makes its reference.
use super::{Action, Motion, Problem, body::Body, place::Place};
use palpate_physics::material::Law;

const YOUNG_PA: f64 = 10e3;
const BEAM_YOUNG_PA: f64 = 100e3;
const TOOL_RADIUS_M: f64 = 10e-3;
const PATCH_RADIUS_M: f64 = 7.5e-3;
const POISSON_RATIOS: [f64; 3] = [0.3, 0.45, 0.49];
/// Depths (m) of the sphere past first touch.
const SMALL: (&str, f64) = ("small", 0.5e-3);
const LARGE: (&str, f64) = ("large", 5e-3);
/// Sum (N) of the patch's pressure. A large one dents the block by some 1 mm, the ventricle by 2 mm.
const SMALL_PATCH: (&str, f64) = ("small", 0.02);
const LARGE_BLOCK_PATCH: (&str, f64) = ("large", 0.15);
const LARGE_VENTRICLE_PATCH: (&str, f64) = ("large", 0.1);
/// A press that comes in 10 ms, and one that swings up to where the block's own modes are.
const STEP: Motion = Motion::Step { rise_ticks: 10, ticks: 300 };
const SWEEP: Motion = Motion::Sweep { hz: [5.0, 60.0], ticks: 1000 };

/// Every problem.
pub fn all() -> Vec<Problem> {
    let mut problems = Vec::new();
    let default = Law::StableNeoHookean;
    for body in [Body::Block, Body::Ventricle(Place::Side)] {
        for nu in POISSON_RATIOS {
            problems.push(sphere(body, SMALL, nu, default));
            problems.push(patch(body, SMALL_PATCH, nu, default));
            // On the ventricle a deep sphere has a reference at ν = 0.3 alone.
            if body == Body::Block || nu == 0.3 {
                problems.push(sphere(body, LARGE, nu, default));
            }
            let large = if body == Body::Block { LARGE_BLOCK_PATCH } else { LARGE_VENTRICLE_PATCH };
            problems.push(patch(body, large, nu, default));
        }
    }
    let elsewhere = Place::ALL.into_iter().filter(|place| *place != Place::Side).map(Body::Ventricle);
    problems.extend(elsewhere.map(|body| patch(body, SMALL_PATCH, 0.45, default)));
    problems.push(sphere(Body::Block, SMALL, 0.45, Law::StVenantKirchhoff));
    problems.push(patch(Body::Block, SMALL_PATCH, 0.45, Law::StVenantKirchhoff));
    problems.push(sphere(Body::Block, LARGE, 0.45, Law::FixedCorotated));
    problems.extend([in_time("step", STEP), in_time("sweep", SWEEP)]);
    problems.extend(POISSON_RATIOS.map(lame));
    problems.extend([cantilever(), elastica()]);
    problems.push(small_ventricle());
    problems
}

fn sphere(body: Body, (size, depth_m): (&str, f64), nu: f64, law: Law) -> Problem {
    Problem {
        name: format!("{}-sphere-{size}-nu{nu:.2}{}", body.name(), suffix(law)),
        sentence: format!(
            "A rigid sphere of 10 mm radius, without friction, is pressed {} mm deep into {}; the answer is its force.",
            depth_m * 1e3,
            body.sentence()
        ),
        body,
        motion: Motion::ToRest,
        action: Action::Sphere { radius_m: TOOL_RADIUS_M, depth_m },
        law,
        young_modulus_pa: YOUNG_PA,
        poisson_ratio: nu,
    }
}

fn patch(body: Body, (size, force_n): (&str, f64), nu: f64, law: Law) -> Problem {
    Problem {
        name: format!("{}-patch-{size}-nu{nu:.2}{}", body.name(), suffix(law)),
        sentence: format!(
            "A smooth dead pressure of {force_n} N on a patch of 7.5 mm radius presses {}; the answer is the displacement \
             conjugate to it.",
            body.sentence()
        ),
        body,
        motion: Motion::ToRest,
        action: Action::Patch { radius_m: PATCH_RADIUS_M, force_n },
        law,
        young_modulus_pa: YOUNG_PA,
        poisson_ratio: nu,
    }
}

/// The peers' problem: small enough that every law of theirs is Hooke's to first order.
pub const OF_PEERS: &str = "ventricle-20mm-patch-nu0.40";

fn small_ventricle() -> Problem {
    let (radius_m, force_n) = (4e-3, 0.01);
    Problem {
        name: OF_PEERS.into(),
        sentence: format!(
            "A smooth dead pressure of {force_n} N on a patch of 4 mm radius presses {}; the answer is the displacement conjugate to it.",
            Body::SmallVentricle.sentence()
        ),
        action: Action::Patch { radius_m, force_n },
        young_modulus_pa: 30e3,
        ..patch(Body::SmallVentricle, SMALL_PATCH, 0.4, Law::StableNeoHookean)
    }
}

/// The small patch on the block, in time.
fn in_time(name: &str, motion: Motion) -> Problem {
    let how = match motion {
        Motion::Step { rise_ticks, ticks } => {
            format!("comes within {rise_ticks} ms and stays; the block rings for {ticks} ms")
        }
        Motion::Sweep { hz: [from, to], ticks } => {
            format!("swings as a sine, pressing and pulling, from {from} to {to} Hz within {ticks} ms")
        }
        Motion::ToRest => "comes to rest".into(),
    };
    let still = patch(Body::Block, SMALL_PATCH, 0.45, Law::StableNeoHookean);
    Problem {
        name: format!("block-{name}-nu0.45"),
        sentence: format!(
            "A smooth dead load of {} N on a patch of 7.5 mm radius in {} {how}. Mass damping is {} 1/s. The answer is the displacement \
             conjugate to the load at every millisecond; its error is the L2 norm in time of the difference over that of the reference.",
            SMALL_PATCH.1,
            Body::Block.sentence(),
            super::motion::RINGING_DAMPING_PER_S
        ),
        motion,
        ..still
    }
}

/// What names the law of a problem.
fn suffix(law: Law) -> String {
    match law {
        Law::StableNeoHookean => String::new(),
        Law::FixedCorotated => "-corotated".to_owned(),
        Law::StVenantKirchhoff => format!("-{}", law.name()),
    }
}

fn lame(nu: f64) -> Problem {
    Problem {
        name: format!("lame-nu{nu:.2}"),
        sentence: "A thick sphere (50 to 100 mm) under a small pressure inside, one octant of it; the answer is how far the inner \
                   surface moves, which Lamé's formula gives."
            .into(),
        body: Body::Octant,
        motion: Motion::ToRest,
        action: Action::Pressure { pressure_pa: 1.0 },
        law: Law::StableNeoHookean,
        young_modulus_pa: YOUNG_PA,
        poisson_ratio: nu,
    }
}

fn cantilever() -> Problem {
    Problem {
        name: "cantilever".into(),
        sentence: "A beam of 100 × 10 × 10 mm, clamped at one end, with a small force across the other; the answer is the deflection \
                   there, which Timoshenko's theory gives."
            .into(),
        body: Body::Beam { slenderness: 10 },
        motion: Motion::ToRest,
        action: Action::Shear { force_n: 1e-5 },
        law: Law::StableNeoHookean,
        young_modulus_pa: BEAM_YOUNG_PA,
        poisson_ratio: 0.0,
    }
}

fn elastica() -> Problem {
    let body = Body::Beam { slenderness: 20 };
    Problem {
        name: "elastica".into(),
        sentence: "A beam twenty times as long as it is thick, bent by half its length by a dead force with PL²/EI = 2; the answer is \
                   the deflection of its end, which Reissner's beam (the elastica with stretch and shear) gives."
            .into(),
        body,
        motion: Motion::ToRest,
        action: Action::Shear { force_n: super::exact::elastica_force_n(2.0, BEAM_YOUNG_PA, 20.0) },
        law: Law::FixedCorotated,
        young_modulus_pa: BEAM_YOUNG_PA,
        poisson_ratio: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique() {
        let mut names: Vec<String> = all().into_iter().map(|p| p.name).collect();
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
    }
}
