//! Static equilibrium of a net of springs some of whose nodes are held.
use super::net::Net;
use glam::DVec3;
use thiserror::Error;

/// A net of springs did not come to rest.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("the springs found no rest in {iterations} steps: a node is still pulled by {residual_n:e} N")]
pub struct NoRest {
    /// Number of Newton steps that were taken.
    pub iterations: usize,
    /// Largest force (N) left on a free node.
    pub residual_n: f64,
}

const MOST_STEPS: usize = 200;

/// Moves the free nodes of `x_m` (m) to rest, where the force on each is `tolerance_n` (N) or less. `external_n` (N)
/// acts on all nodes; it may be empty.
///
/// Newton's method is used. Its steps are found by conjugate gradients, which end where the stiffness proves not
/// positive, and a step is halved until the energy `U − Σ f·x` or the largest force decreases.
///
/// # Errors
/// [`NoRest`], where 200 steps or a very short one lead to no rest.
pub fn settle(
    net: &Net,
    is_held: &[bool],
    external_n: &[DVec3],
    x_m: &mut Vec<DVec3>,
    tolerance_n: f64,
) -> Result<(), NoRest> {
    let diagonal = net.diagonal_n_per_m();
    let residual = |x: &[DVec3]| -> Vec<DVec3> {
        let mut forces = net.forces_n(x);
        forces.iter_mut().zip(external_n).for_each(|(f, external)| *f += *external);
        forces.iter_mut().zip(is_held).filter(|(_, held)| **held).for_each(|(f, _)| *f = DVec3::ZERO);
        forces
    };
    let energy = |x: &[DVec3]| net.energy_j(x) - x.iter().zip(external_n).map(|(x, f)| x.dot(*f)).sum::<f64>();
    let largest = |f: &[DVec3]| f.iter().map(|f| f.length()).fold(0.0, f64::max);
    let mut forces = residual(x_m);
    for iterations in 0.. {
        let residual_n = largest(&forces);
        if residual_n <= tolerance_n {
            return Ok(());
        }
        if iterations == MOST_STEPS {
            return Err(NoRest { iterations, residual_n });
        }
        let step = direction(net, is_held, x_m, &forces, &diagonal);
        let before_j = energy(x_m);
        let mut length = 1.0;
        loop {
            let next: Vec<DVec3> = x_m.iter().zip(&step).map(|(x, d)| *x + *d * length).collect();
            let next_forces = residual(&next);
            if energy(&next) < before_j || largest(&next_forces) < residual_n {
                (*x_m, forces) = (next, next_forces);
                break;
            }
            length *= 0.5;
            if length < 1e-9 {
                return Err(NoRest { iterations, residual_n });
            }
        }
    }
    Ok(())
}

/// Returns a Newton step, the solution of `K p = f` by conjugate gradients that are preconditioned with the diagonal.
fn direction(net: &Net, is_held: &[bool], x_m: &[DVec3], forces: &[DVec3], diagonal: &[f64]) -> Vec<DVec3> {
    let dot = |a: &[DVec3], b: &[DVec3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
    let scaled = |r: &[DVec3]| -> Vec<DVec3> {
        r.iter().zip(diagonal).map(|(r, d)| if *d > 0.0 { *r / *d } else { *r }).collect()
    };
    let mut solution = vec![DVec3::ZERO; forces.len()];
    let mut r = forces.to_vec();
    let mut z = scaled(&r);
    let mut p = z.clone();
    let mut rz = dot(&r, &z);
    let (start, mut product) = (rz, Vec::new());
    for iteration in 0..3 * forces.len() {
        net.stiffness_times_n(x_m, &p, &mut product);
        product.iter_mut().zip(is_held).filter(|(_, held)| **held).for_each(|(q, _)| *q = DVec3::ZERO);
        let curvature = dot(&p, &product);
        if curvature <= 0.0 {
            return if iteration == 0 { p } else { solution };
        }
        let alpha = rz / curvature;
        for ((s, r), (p, q)) in solution.iter_mut().zip(&mut r).zip(p.iter().zip(&product)) {
            *s += *p * alpha;
            *r -= *q * alpha;
        }
        z = scaled(&r);
        let next = dot(&r, &z);
        if next <= 1e-20 * start {
            break;
        }
        let beta = next / rz;
        p.iter_mut().zip(&z).for_each(|(p, z)| *p = *z + *p * beta);
        rz = next;
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::testing::hexagon;

    #[test]
    fn at_rest_forces_balance_and_the_energy_is_least() {
        let net = Net::uniform(&hexagon(4, 0.03), 60.0, 20.0);
        let mut held = vec![false; net.rest_m.len()];
        held[0] = true;
        let mut x = net.rest_m.clone();
        x[0].z += 0.02;
        settle(&net, &held, &[], &mut x, 1e-12).unwrap();
        let forces = net.forces_n(&x);
        assert!(forces.iter().zip(&held).all(|(f, held)| *held || f.length() <= 1e-12));
        let least = net.energy_j(&x);
        for node in 1..x.len() {
            let mut other = x.clone();
            other[node] += DVec3::new(1e-5, -2e-5, 1e-5);
            assert!(net.energy_j(&other) > least, "{node}");
        }
    }

    /// What pushes a node to where it was held is the reaction that held it there.
    #[test]
    fn a_force_and_a_displacement_are_each_others_answer() {
        let net = Net::uniform(&hexagon(3, 0.03), 60.0, 60.0);
        let mut held = vec![false; net.rest_m.len()];
        held[0] = true;
        let mut x = net.rest_m.clone();
        x[0].z += 0.012;
        settle(&net, &held, &[], &mut x, 1e-12).unwrap();
        let mut push = vec![DVec3::ZERO; x.len()];
        push[0] = -net.forces_n(&x)[0];
        let mut free = net.rest_m.clone();
        settle(&net, &vec![false; x.len()], &push, &mut free, 1e-12).unwrap();
        assert!(free.iter().zip(&x).all(|(a, b)| a.distance(*b) < 1e-12));
    }

    #[test]
    fn a_net_that_nothing_holds_says_so() {
        let net = Net::uniform(&hexagon(1, 0.03), 60.0, 0.0);
        let push = vec![DVec3::Z; net.rest_m.len()];
        let mut x = net.rest_m.clone();
        let error = settle(&net, &vec![false; x.len()], &push, &mut x, 1e-9).unwrap_err();
        assert!(error.residual_n > 0.1, "{error}");
    }
}
