//! Which bits of equilibria a hash is of ([`Chain`]).
use super::{StaticSolution, ToolAtRest};
use crate::{elements::natural_modes::Mode, hash::Chain};

impl Chain {
    /// Adds an equilibrium, but not the way there.
    pub fn solution(&mut self, solution: &StaticSolution) {
        self.vectors(&solution.x);
        self.wholes(&solution.awake.ids);
        self.whole(u64::from(solution.awake.spread_loads));
        self.vectors(&solution.reactions_n);
        self.vectors(&solution.node_reactions_n);
        self.list(&solution.tools, |chain, tool: &ToolAtRest| {
            for vector in [tool.device_m, tool.centre_m, tool.contact_force_n, tool.device_force_n] {
                chain.vector(vector);
            }
            chain.whole(u64::from(tool.contacts));
            chain.real(tool.penetration_m);
            chain.real(tool.contact_energy_j);
        });
        for count in [solution.iterations, solution.factorisations, solution.load_steps, solution.inverted_tets] {
            self.whole(u64::from(count));
        }
        for number in [solution.residual_n, solution.relative_residual, solution.reference_n, solution.rounding_n] {
            self.real(number);
        }
        self.flag(solution.stable);
    }

    /// Adds natural modes.
    pub fn modes(&mut self, modes: &[Mode]) {
        self.list(modes, |chain, mode| {
            chain.real(mode.frequency_hz);
            chain.vectors(&mode.shape_per_sqrt_kg);
            chain.real(mode.relative_residual);
        });
    }
}
