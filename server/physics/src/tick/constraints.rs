//! Nodes whose displacement is prescribed.
use super::EnvironmentError;
use crate::settings::PrescribedSpec;
use glam::DVec3;

/// Returns the inverse mass `1/m` (1/kg) of every node and axis, which is zero where the displacement is prescribed.
///
/// # Errors
/// Two sets prescribe one node along one axis.
pub(crate) fn free_inverse_mass(
    mass_kg: &[f64],
    prescribed: &[PrescribedSpec],
) -> Result<Vec<DVec3>, EnvironmentError> {
    let mut inverse: Vec<DVec3> = mass_kg.iter().map(|m| DVec3::splat(1.0 / m)).collect();
    let mut owner: Vec<[Option<usize>; 3]> = vec![[None; 3]; mass_kg.len()];
    for (set, spec) in prescribed.iter().enumerate() {
        for &node in &spec.nodes {
            for axis in (0..3).filter(|&axis| spec.axes[axis]) {
                let slot = &mut owner[node as usize][axis];
                if let Some(first) = slot.replace(set) {
                    return Err(EnvironmentError::PrescribedTwice {
                        node,
                        axis: ['x', 'y', 'z'][axis],
                        first: prescribed[first].name.clone(),
                        second: spec.name.clone(),
                    });
                }
                inverse[node as usize][axis] = 0.0;
            }
        }
    }
    Ok(inverse)
}
