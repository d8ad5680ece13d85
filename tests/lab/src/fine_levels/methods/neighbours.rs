//! What methods ask of the lattice that the server does not.
use glam::DVec3;
use palpate_physics::bodies::hybrid::partition::Partition;

/// Particles nearer than a radius to a point (both m, at rest), ascending.
pub fn particles_near(partition: &Partition, point_m: DVec3, radius_m: f64) -> Vec<u32> {
    let mut near = Vec::new();
    partition.particles_within(point_m, radius_m, |particle, distance_sq| {
        if distance_sq < radius_m * radius_m {
            near.push(particle);
        }
    });
    near
}

/// Volume (m³) of a particle: what of its cells' is its.
pub fn particle_m3(partition: &Partition, particle: u32) -> f64 {
    let of_cell = |cell: usize| {
        let own = partition.corners(cell).into_iter().zip(partition.particles_m3(cell)).find(|(p, _)| *p == particle);
        own.map_or(0.0, |(_, volume_m3)| volume_m3)
    };
    partition.cells_at(particle).map(of_cell).sum()
}
