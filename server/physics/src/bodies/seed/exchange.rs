//! The exchange of displacements or momentum between the particles and the core's faces (2006, section 6.1).
//!
//! *As printed*: "the displacement of MFM particles that cross a boundary voxel through a tetrahedron face is averaged
//! by using their barycentric coordinates and applied to the FEM nodes in this face. Analogously, the displacement of
//! the faces of the tetrahedra moves all the activated MFM particles that are in the boundary voxels using the normal
//! face direction." ([`nodes_follow`], [`particles_follow`].) A displacement without its mass is no momentum: a node of
//! mass M that takes over the step Δ of a particle of mass m changes the momentum by MΔ/dt where the particle had
//! mΔ/dt, and the opposite way leaves out the tangential part.
//!
//! *Repaired* ([`tie`]), "from conservation of Linear Momentum" as the paper announces: every particle of the interface
//! beside the core is tied to its attachment point on the face below it. With the face's normal n and weights ζ, the
//! gap that a step opens
//! ```text
//! g = n·(d_p − Σ_i ζ_i d_i)        µ = g/(1/m_p + Σ_i ζ_i²/m_i)        d_p ← d_p − µ n/m_p        d_i ← d_i + ζ_i µ n/m_i
//! ```
//! is closed by the impulse µ/dt, which the particle loses and the nodes get. As Σζ = 1, linear momentum is conserved
//! exactly. This includes both of the printed directions of the exchange, along the normal. A heavy node hardly moves,
//! and a light particle follows it.
use super::{SeedState, core::Core, region::Region};
use glam::DVec3;

/// Returns the outward unit normal of a face, which is zero where the face has no area.
fn normal(corners: [DVec3; 3]) -> DVec3 {
    (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero()
}

/// Ties every particle of the interface beside the core to its face: the repaired exchange.
pub fn tie(core: &Core, region: &Region, particle_mass_kg: f64, dt_s: f64, state: &mut SeedState) {
    let per_mass = 1.0 / particle_mass_kg;
    for on_core in &region.on_core {
        let slot = on_core.slot as usize;
        let nodes = core.outer_triangles()[on_core.attachment.triangle as usize].map(|n| n as usize);
        let weights = on_core.attachment.weights;
        let face_normal = normal(nodes.map(|n| state.core.x[n]));
        let mut opened = state.particles.x[slot] - region.rest_m(slot);
        let mut compliance = per_mass;
        for (&node, weight) in nodes.iter().zip(weights) {
            opened -= (state.core.x[node] - core.rest_m()[node]) * weight;
            compliance += weight * weight * core.inverse_mass_per_kg()[node];
        }
        // µ n (kg m).
        let shift = face_normal * (opened.dot(face_normal) / compliance);
        state.particles.shift(slot, shift * -per_mass, dt_s);
        for (&node, weight) in nodes.iter().zip(weights) {
            state.core.shift(node, shift * (weight * core.inverse_mass_per_kg()[node]), dt_s);
        }
    }
}

/// Moves the core's nodes with the particles, as printed: the nodes of a face move by the barycentric mean of the step
/// (m) of the particles that crossed it, `Δ_i = Σ_p ζ_pi Δ_p / Σ_p ζ_pi`. `crossed` returns the step of each slot's
/// particle, if it crossed. Held nodes stay. `sums` is a buffer.
pub fn nodes_follow(
    core: &Core,
    region: &Region,
    crossed: impl Fn(usize) -> Option<DVec3>,
    sums: &mut [(DVec3, f64)],
    x: &mut [DVec3],
) {
    let nodes_of = |triangle: u32| core.outer_triangles()[triangle as usize].map(|n| n as usize);
    for on_core in &region.on_core {
        for node in nodes_of(on_core.attachment.triangle) {
            sums[node] = (DVec3::ZERO, 0.0);
        }
    }
    for on_core in &region.on_core {
        let Some(step) = crossed(on_core.slot as usize) else { continue };
        for (node, weight) in nodes_of(on_core.attachment.triangle).into_iter().zip(on_core.attachment.weights) {
            sums[node].0 += step * weight;
            sums[node].1 += weight;
        }
    }
    for on_core in &region.on_core {
        for node in nodes_of(on_core.attachment.triangle) {
            let (sum, weight) = std::mem::take(&mut sums[node]);
            if weight > 0.0 && core.inverse_mass_per_kg()[node] > 0.0 {
                x[node] += sum / weight;
            }
        }
    }
}

/// Moves the particles with the core, as printed: every particle of the interface beside the core moves by the normal
/// part of its face's step (m), which is the mean of its corners' steps. `before` and `now` are the nodes' positions
/// (m) before and after the step.
pub fn particles_follow(core: &Core, region: &Region, before: &[DVec3], now: &[DVec3], particles: &mut [DVec3]) {
    for on_core in &region.on_core {
        let nodes = core.outer_triangles()[on_core.attachment.triangle as usize].map(|n| n as usize);
        let face_normal = normal(nodes.map(|n| now[n]));
        let step: DVec3 = nodes.into_iter().map(|n| now[n] - before[n]).sum::<DVec3>() / 3.0;
        particles[on_core.slot as usize] += face_normal * step.dot(face_normal);
    }
}
