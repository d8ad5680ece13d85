//! Makes references on triquadratic hexahedra.
use super::{Grid, Provenance, Reference, in_time, limit};
use crate::{
    problems::{
        Action, Problem,
        body::{BLOCK_M, Body, SMALL_VENTRICLE_M, VENTRICLE_M},
        load,
        sample::{self, FieldError},
    },
    reference::{
        bodies::{self, Body as HexBody},
        newton::{self, solve},
        solid::Solid,
        sphere::Sphere,
    },
};
use glam::DVec3;
use miette::{Context, Result, bail, miette};

/// Elements over one and a half radii of the contact (`n` of `reference::bodies`) of the three grids.
pub(super) const GRIDS: [usize; 3] = [2, 3, 4];
/// κ of the sphere's penalty over `E/((1 − ν²)√(Rδ))`: the first lets in some 1e-4 of the depth. Deep presses on coarse grids may
/// need a softer one, since Newton's method then sees points enter and leave; its error goes as its inverse.
pub(super) const PENALTIES: [f64; 3] = [4e3, 1e3, 2.5e2];

/// A problem solved on one grid.
#[derive(Debug, Clone)]
pub struct Solved {
    /// What is stored of it.
    pub grid: Grid,
    /// Displacements (m) of the problem's material points.
    pub displacements_m: Vec<DVec3>,
}

/// Solves a problem on a grid with `n` elements over one and a half radii of the contact, a sphere pressing with `penalty`; `tell` hears how it goes.
///
/// # Errors
/// A problem that has no such grid, or no convergence.
pub fn on_grid(problem: &Problem, n: usize, penalty: f64, tell: &mut dyn FnMut(&str)) -> Result<Solved> {
    let contact_m = problem.contact_radius_m();
    let body = match problem.body {
        Body::Block => bodies::block(BLOCK_M[0], BLOCK_M[1], contact_m, n),
        Body::Ventricle(place) => bodies::ventricle(VENTRICLE_M, place.latitude_rad(), contact_m, n),
        Body::SmallVentricle => bodies::ventricle(SMALL_VENTRICLE_M, 0.0, contact_m, n),
        Body::Octant | Body::Beam { .. } => bail!("{} has an answer by formula", problem.name),
    };
    let solid = Solid::new(body.grid.clone(), problem.material()?)?;
    let (action, load) = match problem.action {
        Action::Sphere { radius_m, depth_m } => {
            let modulus = problem.young_modulus_pa / (1.0 - problem.poisson_ratio.powi(2));
            let faces = solid.grid.faces(body.touched);
            let sphere = Sphere::new(&solid.grid, faces, body.normal, radius_m, penalty * modulus / contact_m);
            (newton::Action::Sphere { sphere, depth_m }, None)
        }
        Action::Patch { radius_m, force_n } => {
            let load = load::patch_on_hexahedra(&solid.grid, &body, radius_m, force_n);
            (newton::Action::Forces(load.dense(solid.grid.positions_m.len())), Some(load))
        }
        Action::Pressure { .. } | Action::Shear { .. } => bail!("{} has an answer by formula", problem.name),
    };
    let found = solve(&solid, &body, &action, tell)
        .wrap_err_with(|| format!("{n} elements over the contact, penalty {penalty}"))?;
    let value = load.map_or(found.sphere_n, |load| load.displacement_m(&solid.grid.positions_m, &found.x));
    let unknowns = 3 * solid.grid.positions_m.len();
    Ok(Solved {
        grid: Grid { elements_over_contact: n, unknowns, value, iterations: found.iterations },
        displacements_m: field_m(problem, &solid, &body, &found.x),
    })
}

fn field_m(problem: &Problem, solid: &Solid, body: &HexBody, x: &[DVec3]) -> Vec<DVec3> {
    let of_node = |n: u32| x[n as usize] - solid.grid.positions_m[n as usize];
    let at = |sample: &sample::Sample| {
        let nodes = solid.grid.on_side(body.touched, sample.parameters);
        sample.frame * nodes.iter().map(|&(n, w)| of_node(n) * w).sum::<DVec3>()
    };
    sample::points(problem.body).iter().map(at).collect()
}

/// All grids with the stiffest penalty that all of them bear.
fn on_all_grids(problem: &Problem, tell: &mut dyn FnMut(&str)) -> Result<(Vec<Solved>, f64)> {
    let mut last = Err(miette!("no penalty"));
    for penalty in PENALTIES {
        let mut grid = |n| on_grid(problem, n, penalty, &mut |text| tell(&format!("n = {n}: {text}")));
        last = GRIDS.into_iter().map(&mut grid).collect::<Result<Vec<_>>>().map(|solved| (solved, penalty));
        if last.is_ok() || !matches!(problem.action, Action::Sphere { .. }) {
            return last;
        }
    }
    last
}

/// Makes a problem's reference anew.
///
/// # Errors
/// A grid that is not solved.
pub fn remake(problem: &Problem, tell: &mut dyn FnMut(&str)) -> Result<Reference> {
    if problem.motion.ticks().is_some() {
        return in_time::remake(problem, tell);
    }
    let (solved, penalty) = on_all_grids(problem, tell)?;
    let [first, second, third] = &solved[..] else { return Err(miette!("three grids are needed")) };
    let sizes = GRIDS.map(|n| 1.0 / n as f64);
    let limit = limit([first, second, third].map(|s| s.grid.value), sizes);
    let samples = sample::points(problem.body);
    let difference = FieldError::of(&samples, &second.displacements_m, &third.displacements_m);
    let in_um = |u: &DVec3| (*u * 1e9).round().to_array().map(|nm| nm * 1e-3);
    Ok(Reference {
        problem: problem.name.clone(),
        sentence: problem.sentence.clone(),
        unit: problem.quantity().unit().into(),
        value: limit.value,
        uncertainty: limit.uncertainty,
        method: match limit.order {
            Some(_) => "Richardson's limit of the three grids".into(),
            None => "the finest grid: the three show no credible order".into(),
        },
        observed_order: limit.order,
        field_difference: difference.map_or(0.0, |error| error.l2),
        provenance: Provenance {
            date: crate::machine::today_utc(),
            command: format!("cargo run --release -p palpate-lab -- references --remake {}", problem.name),
            discretisation: format!(
                "triquadratic hexahedra (27 nodes, 27 Gauss points){} graded to the contact, symmetric part, f64, Newton to a relative \
                 residual of 1e-9; displacements of the finest grid",
                if problem.law == palpate_physics::material::Law::StVenantKirchhoff {
                    ""
                } else {
                    " with linear pressure (Q2/P1)"
                }
            ),
            law: format!("{:?}", problem.law),
            young_modulus_pa: problem.young_modulus_pa,
            poisson_ratio: problem.poisson_ratio,
            action: match problem.action {
                Action::Sphere { .. } => format!("{:?}, penalty {penalty} E/((1 − ν²)√(Rδ))", problem.action),
                _ => format!("{:?}", problem.action),
            },
        },
        displacements_um: third.displacements_m.iter().map(in_um).collect(),
        series_um: vec![],
        grids: solved.into_iter().map(|s| s.grid).collect(),
    })
}
