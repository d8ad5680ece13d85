//! Newton's method on a reference grid, with load stepping and a line search on the potential.
use super::{bodies::Body, matrix::System, ordering, solid::Solid, sphere::Sphere};
use glam::{BVec3, DVec3};
use miette::{Result, bail, miette};

/// Converged when `‖f_free‖ ≤ TOLERANCE · ‖f_elastic‖`.
const TOLERANCE: f64 = 1e-9;
/// Or when it is below this fraction and an iteration no longer halves it: rounding of the stress in large elements far from a
/// small load allows no better.
const ROUNDED_OFF: f64 = 1e-6;
const MAX_ITERATIONS: usize = 60;
/// Shares of the largest diagonal entry that are added, one after the other, to a tangent that is not positive definite.
const SHIFTS: [f64; 4] = [1e-4, 1e-3, 1e-2, 1e-1];
const MAX_BACKTRACKS: usize = 20;
/// The first load step over the smallest.
const MAX_HALVINGS: i32 = 8;
/// Spheres go this far (over their radius) at once, and deeper in such steps.
const AT_ONCE: f64 = 0.5;
const DEEP_STEP: f64 = 0.1;
/// What may press on the sphere's shaft, over the force on the sphere.
const ON_SHAFT: f64 = 1e-9;
/// At each load a sphere's penalty is raised in these shares of it: Newton finds the contact's rim from a soft one.
const PENALTIES: [f64; 3] = [0.01, 0.1, 1.0];
/// Sufficient decrease of the potential (Armijo).
const DECREASE: f64 = 1e-4;
/// Rounding of the potential over the body's largest energy scale, `(λ + 2µ) V`: a sum over points of differences of such numbers.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Largest motion of a node in one iteration, over the body's size.
const LARGEST_STEP: f64 = 0.1;

/// What acts on a reference body.
#[derive(Debug, Clone)]
pub enum Action {
    /// Dead forces on nodes (N).
    Forces(Vec<DVec3>),
    /// A sphere pressed in along the line of its touch, by a depth (m).
    Sphere {
        /// The sphere.
        sphere: Sphere,
        /// Its way (m) past first touch.
        depth_m: f64,
    },
}

impl Action {
    /// The largest step of the load, over all of it.
    fn longest_step(&self) -> f64 {
        match self {
            Self::Sphere { sphere, depth_m } if *depth_m > AT_ONCE * sphere.radius_m => {
                DEEP_STEP * sphere.radius_m / depth_m
            }
            _ => 1.0,
        }
    }
}

/// An equilibrium of a reference body.
#[derive(Debug, Clone)]
pub struct Equilibrium {
    /// Positions (m).
    pub x: Vec<DVec3>,
    /// Force of the whole body on the sphere along the outward normal (N); 0 without a sphere.
    pub sphere_n: f64,
    /// Newton iterations in all.
    pub iterations: usize,
}

struct Problem<'a> {
    solid: &'a Solid,
    body: &'a Body,
    action: Action,
    free: Vec<BVec3>,
    system: System,
    size_m: f64,
    /// What rounding alone may do to the potential (J).
    rounding_j: f64,
}

/// Finds the equilibrium, from rest. `tell` hears of every iteration.
///
/// # Errors
/// No convergence at the smallest load step.
pub fn solve(solid: &Solid, body: &Body, action: &Action, tell: &mut dyn FnMut(&str)) -> Result<Equilibrium> {
    let mut found = None;
    solve_through(solid, body, action, &[1.0], tell, &mut |_, equilibrium| found = Some(equilibrium))?;
    found.ok_or_else(|| miette!("there is no load to solve for"))
}

/// Finds equilibria at parts of the load that ascend to 1, from rest. `found` hears of each with its number as soon as it is found,
/// `tell` of every iteration.
///
/// # Errors
/// No convergence at the smallest load step.
pub fn solve_through(
    solid: &Solid,
    body: &Body,
    action: &Action,
    parts: &[f64],
    tell: &mut dyn FnMut(&str),
    found: &mut dyn FnMut(usize, Equilibrium),
) -> Result<()> {
    let mut problem = Problem::new(solid, body, action)?;
    let longest = action.longest_step();
    let mut path = Path { x: solid.grid.positions_m.clone(), reached: 0.0, before: None };
    let (mut step, mut iterations) = (longest, 0);
    for (number, &part) in parts.iter().enumerate() {
        while path.reached < part {
            let fraction = (path.reached + step).min(part);
            if let Some(x) = problem.next(fraction, &path, &mut iterations, tell) {
                path = Path { before: Some((path.x, path.reached)), x, reached: fraction };
                step = (2.0 * step).min(longest);
                continue;
            }
            step *= 0.5;
            if step < longest * 0.5_f64.powi(MAX_HALVINGS) {
                bail!("the reference does not converge past {:.1} % of the load", 100.0 * path.reached);
            }
        }
        let sphere_n = problem.sphere_n(part, &path.x)?;
        found(number, Equilibrium { x: path.x.clone(), sphere_n, iterations });
    }
    Ok(())
}

/// Where the solve has come to.
struct Path {
    /// Positions (m) in the last equilibrium, and the part of the load there.
    x: Vec<DVec3>,
    reached: f64,
    /// The same of the one before.
    before: Option<(Vec<DVec3>, f64)>,
}

impl Path {
    /// Goes on straight from the last two equilibria.
    fn predicted(&self, fraction: f64) -> Option<Vec<DVec3>> {
        let (before, at) = self.before.as_ref()?;
        let ratio = (fraction - self.reached) / (self.reached - at);
        Some(self.x.iter().zip(before).map(|(x, before)| *x + (*x - *before) * ratio).collect())
    }
}

impl<'a> Problem<'a> {
    fn new(solid: &'a Solid, body: &'a Body, action: &'a Action) -> Result<Self> {
        let free = body.free_axes();
        let elements = solid.grid.elements.iter().map(|nodes| nodes.to_vec());
        let groups = match action {
            Action::Forces(_) => elements.collect(),
            Action::Sphere { sphere, .. } => elements.chain(sphere.groups()).collect(),
        };
        let system = System::new(&free, &ordering::nested_dissection(&solid.grid), groups)?;
        let low = solid.grid.positions_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = solid.grid.positions_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        Ok(Self {
            solid,
            body,
            action: action.clone(),
            free,
            system,
            size_m: (high - low).max_element(),
            rounding_j: ROUNDING * solid.stiffest_j(),
        })
    }

    fn centre_m(&self, fraction: f64) -> DVec3 {
        match &self.action {
            Action::Forces(_) => DVec3::ZERO,
            Action::Sphere { sphere, depth_m } => {
                self.body.touch_m + self.body.normal * (sphere.radius_m - depth_m * fraction)
            }
        }
    }

    fn potential_j(&self, fraction: f64, x: &[DVec3]) -> f64 {
        let load = match &self.action {
            Action::Forces(forces) => {
                let moved = x.iter().zip(&self.solid.grid.positions_m).map(|(x, rest)| *x - *rest);
                -fraction * forces.iter().zip(moved).map(|(f, u)| f.dot(u)).sum::<f64>()
            }
            Action::Sphere { sphere, .. } => sphere.energy_j(x, self.centre_m(fraction)),
        };
        self.solid.energy_j(x) + load
    }

    /// Total force on free axes (N), and the norm (N) it is measured by.
    fn residual_n(&self, fraction: f64, x: &[DVec3]) -> (Vec<DVec3>, f64) {
        let mut forces = self.solid.forces_n(x);
        let scale = forces.iter().map(|f| f.length_squared()).sum::<f64>().sqrt();
        let mut applied = 0.0;
        match &self.action {
            Action::Forces(loads) => {
                for (force, load) in forces.iter_mut().zip(loads) {
                    *force += *load * fraction;
                    applied += (*load * fraction).length_squared();
                }
            }
            Action::Sphere { sphere, .. } => {
                sphere.add_forces_n(x, self.centre_m(fraction), &mut forces);
            }
        }
        for (force, free) in forces.iter_mut().zip(&self.free) {
            *force = DVec3::select(*free, *force, DVec3::ZERO);
        }
        (forces, scale.max(applied.sqrt()))
    }

    /// The force (N) of the whole body on the sphere along the outward normal; 0 without a sphere.
    fn sphere_n(&self, fraction: f64, x: &[DVec3]) -> Result<f64> {
        let Action::Sphere { sphere, .. } = &self.action else { return Ok(0.0) };
        let centre_m = self.centre_m(fraction);
        let on_sphere = sphere.add_forces_n(x, centre_m, &mut vec![DVec3::ZERO; x.len()]);
        let on_shaft_n = sphere.on_shaft_n(x, centre_m);
        if on_shaft_n > ON_SHAFT * on_sphere.length() {
            bail!(
                "the body presses on the reference's shaft ({on_shaft_n:.2e} N), so that it is no sphere that presses"
            );
        }
        Ok(on_sphere.dot(self.body.normal) * self.body.multiplicity)
    }

    /// Finds the equilibrium at a part of the load. Deep in the body it looks first where the last two lead to.
    fn next(
        &mut self,
        fraction: f64,
        path: &Path,
        iterations: &mut usize,
        tell: &mut dyn FnMut(&str),
    ) -> Option<Vec<DVec3>> {
        let is_deep = self.action.longest_step() < 1.0;
        let predicted = path.predicted(fraction).filter(|_| is_deep);
        let near = predicted.and_then(|x| self.equilibrate(fraction, x, iterations, tell));
        near.or_else(|| self.through_penalties(fraction, &path.x, iterations, tell))
    }

    fn through_penalties(
        &mut self,
        fraction: f64,
        x: &[DVec3],
        iterations: &mut usize,
        tell: &mut dyn FnMut(&str),
    ) -> Option<Vec<DVec3>> {
        let Action::Sphere { sphere, .. } = &self.action else {
            return self.equilibrate(fraction, x.to_vec(), iterations, tell);
        };
        let wanted = sphere.penalty_pa_per_m;
        let mut found = Some(x.to_vec());
        for share in PENALTIES {
            if let Action::Sphere { sphere, .. } = &mut self.action {
                sphere.penalty_pa_per_m = share * wanted;
            }
            found = found.and_then(|x| self.equilibrate(fraction, x, iterations, tell));
        }
        found
    }

    fn equilibrate(
        &mut self,
        fraction: f64,
        mut x: Vec<DVec3>,
        iterations: &mut usize,
        tell: &mut dyn FnMut(&str),
    ) -> Option<Vec<DVec3>> {
        let mut before = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            let (force, scale) = self.residual_n(fraction, &x);
            let norm = force.iter().map(|f| f.length_squared()).sum::<f64>().sqrt();
            tell(&format!(
                "load {fraction:.3}, iteration {iterations}: residual {:.1e}",
                norm / scale.max(f64::MIN_POSITIVE)
            ));
            if norm <= TOLERANCE * scale || (norm <= ROUNDED_OFF * scale && norm > 0.5 * before) {
                return Some(x);
            }
            before = norm;
            *iterations += 1;
            let mut blocks = self.solid.stiffness(&x);
            if let Action::Sphere { sphere, .. } = &self.action {
                blocks.extend(sphere.stiffness(&x, self.centre_m(fraction)));
            }
            let direction = self.direction(&mut blocks, &force)?;
            x = self.search(fraction, &x, &force, &direction)?;
        }
        None
    }

    /// Newton's direction; where the tangent is not positive definite, one of descent, with so much added to its diagonal that it is.
    fn direction(&mut self, blocks: &mut [Vec<f64>], force: &[DVec3]) -> Option<Vec<DVec3>> {
        if let Some(direction) = self.system.solve(blocks, force) {
            return Some(direction);
        }
        let elements = &mut blocks[..self.solid.grid.elements.len()];
        let diagonal = |index: usize| index.is_multiple_of(81 + 1);
        let entries = elements.iter().flat_map(|b| b.iter().enumerate().filter(|(i, _)| diagonal(*i)));
        let largest = entries.map(|(_, k)| *k).fold(0.0, f64::max);
        for shift in SHIFTS {
            for block in &mut blocks[..self.solid.grid.elements.len()] {
                block.iter_mut().step_by(81 + 1).for_each(|k| *k += shift * largest);
            }
            if let Some(direction) = self.system.solve(blocks, force) {
                return Some(direction);
            }
        }
        None
    }

    /// Backtracks until the potential falls enough, or, where rounding hides that, the residual does.
    fn search(&self, fraction: f64, x: &[DVec3], force: &[DVec3], direction: &[DVec3]) -> Option<Vec<DVec3>> {
        let slope: f64 = force.iter().zip(direction).map(|(f, d)| f.dot(*d)).sum();
        let longest = direction.iter().map(|d| d.length()).fold(0.0, f64::max);
        let norm = |f: &[DVec3]| f.iter().map(|f| f.length_squared()).sum::<f64>();
        let before_j = self.potential_j(fraction, x);
        let mut alpha = (LARGEST_STEP * self.size_m / longest).min(1.0);
        for _ in 0..MAX_BACKTRACKS {
            let next: Vec<DVec3> = x.iter().zip(direction).map(|(x, d)| *x + *d * alpha).collect();
            let change_j = self.potential_j(fraction, &next) - before_j;
            let hidden = change_j.abs() <= self.rounding_j;
            if change_j <= -DECREASE * alpha * slope
                || (hidden && norm(&self.residual_n(fraction, &next).0) < norm(force))
            {
                return Some(next);
            }
            alpha *= 0.5;
        }
        None
    }
}
