//! Natural modes of a body of tetrahedra.
use super::{
    TetBody,
    stiffness::{Definiteness, Stiffness},
};
use crate::{
    elements::natural_modes::{Mode, ModesError, lowest_modes},
    mesh::Surface,
};

/// The `count` lowest modes, ascending.
///
/// # Errors
/// [`ModesError`].
pub fn natural_modes(body: &TetBody, surface: &Surface, count: usize) -> Result<Vec<Mode>, ModesError> {
    if let Some(part) = body.first_free_part() {
        return Err(ModesError::UnderConstrained(part));
    }
    let axes = body.free_axes();
    let mut stiffness = Stiffness::pattern(body, surface, &axes);
    stiffness.assemble(body, body.rest_positions_m(), Definiteness::Exact);
    lowest_modes(&stiffness.matrix, &axes, body.mass_kg(), count)
}
