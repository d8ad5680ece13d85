//! What integrators do to positions and velocities, and what the ledger hears of it.
use crate::{
    lanes::vector_operations,
    world::{Model, State},
};
use glam::DVec3;

/// `x ← x + dt v`; returns a bound (m/s) of the largest speed of any node.
pub(super) fn drift(state: &mut State, dt_s: f64) -> f64 {
    vector_operations::drift(&mut state.x, &state.v, dt_s)
}

/// `v ← (v e^{−c h/2} + h f/m) e^{−c h/2}`, and the ledger's share of it: what damping takes, `½ (1 − e^{−c h}) m v²` of the velocity before and
/// of that after the force.
pub(super) fn kick(model: &Model, state: &mut State, h_s: f64) {
    let damping = model.spec().settings.mass_damping_per_s;
    let mut power_w = DVec3::ZERO;
    let nodes = state.v.iter_mut().zip(&state.force_n).zip(model.inverse_mass_per_kg()).zip(&state.external_n);
    if damping > 0.0 {
        let factor = (-0.5 * damping * h_s).exp();
        let mut twice_kinetic_j = [DVec3::ZERO; 2];
        for ((((v, force), inverse_mass), external), mass) in nodes.zip(model.mass_kg()) {
            let held = inverse_mass.cmpeq(DVec3::ZERO);
            let (factor, mass) = (
                DVec3::select(held, DVec3::ONE, DVec3::splat(factor)),
                DVec3::select(held, DVec3::ZERO, DVec3::splat(*mass)),
            );
            twice_kinetic_j[0] += *v * *v * mass;
            let damped = *v * factor;
            let change = *force * *inverse_mass * h_s;
            power_w += *external * (damped + change * 0.5);
            let kicked = damped + change;
            twice_kinetic_j[1] += kicked * kicked * mass;
            *v = kicked * factor;
        }
        let taken = -(-damping * h_s).exp_m1();
        state.ledger.dissipated_j += 0.5 * taken * (twice_kinetic_j[0] + twice_kinetic_j[1]).element_sum();
    } else {
        for (((v, force), inverse_mass), external) in nodes {
            let change = *force * *inverse_mass * h_s;
            power_w += *external * (*v + change * 0.5);
            *v += change;
        }
    }
    state.ledger.external_work_j += h_s * power_w.element_sum();
    state.ledger.dissipated_j += h_s * state.viscous.work_rate_w();
    state.ledger.external_work_j += h_s * holders_power_w(model, &state.force_n, &state.v);
}

/// Power (W) of the holders' reactions, `−f` on prescribed axes, whose velocity a kick leaves alone.
pub(super) fn holders_power_w(model: &Model, forces_n: &[DVec3], v: &[DVec3]) -> f64 {
    let mut power_w = 0.0;
    for set in &model.spec().prescribed {
        let held = DVec3::from(set.axes.map(|axis| f64::from(u8::from(axis))));
        for &node in &set.nodes {
            power_w -= forces_n[node as usize].dot(held * v[node as usize]);
        }
    }
    power_w
}

pub(super) fn damp(model: &Model, state: &mut State, factor: f64) {
    let mut taken_j = 0.0;
    for ((v, inverse_mass), mass) in state.v.iter_mut().zip(model.inverse_mass_per_kg()).zip(model.mass_kg()) {
        let damped = DVec3::select(inverse_mass.cmpeq(DVec3::ZERO), *v, *v * factor);
        taken_j += 0.5 * mass * (v.length_squared() - damped.length_squared());
        *v = damped;
    }
    state.ledger.dissipated_j += taken_j;
}
