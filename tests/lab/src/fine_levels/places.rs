//! Points of a skin on what is awake of a body: where they go, and what a force on them does.
use glam::DVec3;
use palpate_physics::bodies::hybrid::{partition::Partition, patch::Field, trilinear_point::TrilinearPoint};

/// What a place has of anything with three components, where these particles (ascending) are active.
pub(super) fn value(place: &TrilinearPoint, partition: &Partition, active: &[u32], a: &Field) -> DVec3 {
    let of_particle = |particle: u32| match active.binary_search(&particle) {
        Ok(index) => a.particles[index],
        Err(_) => partition.anchor(particle).of(&a.nodes),
    };
    place.particles.iter().zip(place.weights).map(|(&particle, weight)| of_particle(particle) * weight).sum()
}

/// Adds a force (N) at a place to what it moves with, where these particles (ascending) are active.
pub(super) fn push(
    place: &TrilinearPoint,
    partition: &Partition,
    active: &[u32],
    force_n: DVec3,
    forces_n: &mut Field,
) {
    for (&particle, weight) in place.particles.iter().zip(place.weights) {
        if let Ok(index) = active.binary_search(&particle) {
            forces_n.particles[index] += force_n * weight;
            continue;
        }
        let anchor = partition.anchor(particle);
        for (&node, share) in anchor.nodes.iter().zip(anchor.weights) {
            forces_n.nodes[node as usize] += force_n * (weight * share);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fine_levels::{
        level::{FineLevel, still},
        testing::{Random, ball, ball_in_cage},
    };
    use palpate_physics::bodies::hybrid::patch::Patch;

    #[test]
    fn points_of_the_skin_move_affinely_and_hand_over_all_of_a_force() {
        let partition = ball_in_cage();
        let active = (0..partition.particle_count() as u32).filter(|&p| partition.particle_m(p).z > 3e-3).collect();
        let patch = Patch::new(&partition, &active);
        let rest = FineLevel::at_rest(&patch, &partition);
        let mut random = Random(31);
        // Some lie deep in the body.
        for (number, &point) in ball().positions_m().iter().enumerate() {
            let point = point * if number % 3 == 0 { 0.1 * (number % 10) as f64 } else { 1.0 };
            let place = TrilinearPoint::new(&partition, point);
            assert!((value(&place, &partition, patch.active(), &rest) - point).length() < 1e-15);
            let force = random.vector();
            let mut forces = still(&rest);
            push(&place, &partition, patch.active(), force, &mut forces);
            let all = || forces.nodes.iter().zip(&rest.nodes).chain(forces.particles.iter().zip(&rest.particles));
            let total: DVec3 = all().map(|(f, _)| *f).sum();
            let torque: DVec3 = all().map(|(f, x)| x.cross(*f)).sum();
            assert!((total - force).length() < 1e-14 && (torque - point.cross(force)).length() < 1e-16);
        }
    }
}
