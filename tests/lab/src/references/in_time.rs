//! Makes the references of dynamic problems: the same elements with lumped mass, in time.
use super::{Grid, Provenance, Reference, make::GRIDS, richardson, series};
use crate::{
    problems::{
        Action, Problem,
        body::{BLOCK_M, Body},
        load,
        motion::{RATE_HZ, RINGING_DAMPING_PER_S},
    },
    reference::{
        bodies,
        dynamics::{Clock, Dynamics},
        solid::Solid,
    },
};
use miette::{Result, bail};

const DENSITY_KG_PER_M3: f64 = 1000.0;

struct Series {
    unknowns: usize,
    values_m: Vec<f64>,
}

/// On a grid, with so many substeps a tick, or as many as are stable on it if there are none; and how many there were.
fn on_grid(
    problem: &Problem,
    n: usize,
    substeps: Option<usize>,
    tell: &mut dyn FnMut(&str),
) -> Result<(Series, usize)> {
    let (Body::Block, Action::Patch { radius_m, force_n }, Some(ticks)) =
        (problem.body, problem.action, problem.motion.ticks())
    else {
        bail!("{}: only patches on the block have references in time", problem.name)
    };
    let body = bodies::block(BLOCK_M[0], BLOCK_M[1], problem.contact_radius_m(), n);
    let solid = Solid::new(body.grid.clone(), problem.material()?)?;
    let load = load::patch_on_hexahedra(&solid.grid, &body, radius_m, force_n);
    let mut dynamics = Dynamics::new(&solid, &body, DENSITY_KG_PER_M3)?;
    let tick_s = 1.0 / RATE_HZ;
    let substeps = substeps.unwrap_or_else(|| (tick_s / dynamics.stable_step_s()).ceil() as usize);
    let clock = Clock { dt_s: tick_s / substeps as f64, damping_per_s: RINGING_DAMPING_PER_S };
    let forces = load.dense(solid.grid.positions_m.len());
    let mut now = forces.clone();
    let mut values_m = Vec::with_capacity(ticks);
    for tick in 1..=ticks {
        tell(&format!("n = {n}, {substeps} substeps: tick {tick} of {ticks}"));
        let [from, to] = [tick - 1, tick].map(|tick| problem.motion.fraction(tick));
        for substep in 0..substeps {
            // At the middle of the step, where leapfrog's force acts.
            let fraction = from + (to - from) * (substep as f64 + 0.5) / substeps as f64;
            now.iter_mut().zip(&forces).for_each(|(now, full)| *now = *full * fraction);
            dynamics.step(&now, &clock);
        }
        values_m.push(load.displacement_m(&solid.grid.positions_m, &dynamics.x));
    }
    Ok((Series { unknowns: 3 * solid.grid.positions_m.len(), values_m }, substeps))
}

/// Three grids at the finest's time step, and the coarsest at half of it. The order is that of the L2 norms in time of the differences.
pub(super) fn remake(problem: &Problem, tell: &mut dyn FnMut(&str)) -> Result<Reference> {
    let (third, substeps) = on_grid(problem, GRIDS[2], None, tell)?;
    let (second, _) = on_grid(problem, GRIDS[1], Some(substeps), tell)?;
    let (first, _) = on_grid(problem, GRIDS[0], Some(substeps), tell)?;
    let (halved, _) = on_grid(problem, GRIDS[0], Some(2 * substeps), tell)?;
    let by_time_step = series::relative_difference(&first.values_m, &halved.values_m);
    let difference = |a: &Series, b: &Series| {
        series::rms(&a.values_m.iter().zip(&b.values_m).map(|(a, b)| a - b).collect::<Vec<_>>())
    };
    let (before, last) = (difference(&first, &second), difference(&second, &third));
    let sizes = GRIDS.map(|n| 1.0 / n as f64);
    let order = richardson::order(before / last, sizes);
    let beyond = order.map_or(0.0, |order| richardson::beyond(order, sizes));
    let values_m: Vec<f64> =
        third.values_m.iter().zip(&second.values_m).map(|(third, second)| third + beyond * (third - second)).collect();
    let whole = series::rms(&values_m);
    let in_space = if order.is_some() { beyond * last } else { last };
    let grid = |(n, s): (usize, &Series)| Grid {
        elements_over_contact: n,
        unknowns: s.unknowns,
        value: series::rms(&s.values_m),
        iterations: substeps,
    };
    Ok(Reference {
        problem: problem.name.clone(),
        sentence: problem.sentence.clone(),
        unit: problem.quantity().unit().into(),
        value: whole,
        // Halving the step takes off three quarters of a second-order error.
        uncertainty: in_space + 4.0 / 3.0 * by_time_step * whole,
        method: match order {
            Some(_) => "Richardson's limit of three grids at every tick; the value is the root mean square".into(),
            None => "the finest grid: the three show no credible order; the value is the root mean square".into(),
        },
        observed_order: order,
        field_difference: 0.0,
        provenance: Provenance {
            date: crate::machine::today_utc(),
            command: format!("cargo run --release -p palpate-lab -- references --remake {}", problem.name),
            discretisation: format!(
                "triquadratic hexahedra with linear pressure (Q2/P1) graded to the contact, symmetric part, mass lumped by Gauss and \
                 Lobatto, leapfrog of {substeps} substeps a tick, f64; half of that step moves the coarsest grid's answer by {by_time_step:.1e}"
            ),
            law: format!("{:?}", problem.law),
            young_modulus_pa: problem.young_modulus_pa,
            poisson_ratio: problem.poisson_ratio,
            action: format!("{:?}, {:?}, damping {RINGING_DAMPING_PER_S} 1/s", problem.action, problem.motion),
        },
        grids: GRIDS.into_iter().zip([&first, &second, &third]).map(grid).collect(),
        displacements_um: vec![],
        series_um: values_m.iter().map(|u| (u * 1e10).round() * 1e-4).collect(),
    })
}
