//! One of the papers' steps Δt. The papers do not print the order of its parts; here it is:
//!
//! 1. The touched point: its region wakes, and another one falls asleep (section 6).
//! 2. Forces at time t: of the core (22), the surface's links, particles (29) and their interface, and external ones
//!    (28).
//! 3. Motion: of particles and surface by Verlet (33), of the core by the semi-implicit scheme (34).
//! 4. Vertices that the user displaces are brought to where they are held.
//! 5. Exchange between particles and core.
//! 6. The surface over awake particles follows them (25).
//!
//! Everything runs in the order of its numbers, so that the same inputs give the same bits. Steps allocate nothing, and
//! their cost is that of the core, the surface and the awake particles.
use super::{
    Exchange, SeedContact, SeedModel, SeedReport, SeedScratch, SeedState, exchange,
    layer::Holds,
    model::Hull,
    region::{CarriedVertex, Region},
    sph,
    state::AtVertex,
};
use glam::DVec3;

impl SeedModel {
    /// Advances a state of this model by Δt.
    pub fn step(&self, state: &mut SeedState, scratch: &mut SeedScratch, contact: &SeedContact<'_>) -> SeedReport {
        let dt_s = self.parameters().dt_s;
        let mut report =
            SeedReport { reaction_n: DVec3::ZERO, particles_touched: 0, inputs_rejected: 0, is_finite: true };
        let touched = contact.triangle.filter(|&triangle| (triangle as usize) < self.surface_triangles().len());
        report.inputs_rejected += u32::from(touched != contact.triangle);
        self.wake(touched, state, scratch);
        let awake = self.awake(state);

        self.core().forces_n(&state.core.x, &state.core.v, &mut scratch.core_force_n);
        if let Some(hull) = self.hull() {
            hull.link_forces(awake, state, scratch);
            if let Some(region) = awake {
                self.particle_forces(hull, region, state, scratch);
                report.particles_touched = region.len() as u32;
            }
        }
        for push in contact.forces_n {
            report.inputs_rejected += u32::from(!self.push(awake, push, scratch));
        }

        scratch.core_before_m.copy_from_slice(&state.core.x);
        self.core().advance(dt_s, &scratch.core_force_n, &mut state.core.x, &mut state.core.v);
        if let Some(hull) = self.hull() {
            for (vertex, force) in scratch.skin_force_n.iter().enumerate() {
                state.skin.verlet(vertex, *force, hull.links.mass_kg[vertex], dt_s);
            }
            for (slot, force) in scratch.force_n.iter().enumerate().take(awake.map_or(0, Region::len)) {
                state.particles.verlet(slot, *force, hull.layer.mass_kg, dt_s);
            }
        }

        let (holder_n, rejected) = self.displace(awake, contact.displaced_m, state, scratch);
        report.reaction_n = -holder_n;
        report.inputs_rejected += rejected;

        if let (Some(hull), Some(region)) = (self.hull(), awake) {
            self.exchange(hull, region, state, scratch);
            for carried in &region.carried {
                let (by, speed) = region.carried_motion(carried, &state.particles.x, &state.particles.v);
                let vertex = carried.vertex as usize;
                state.skin.x[vertex] = self.surface_rest_m()[vertex] + by;
                state.skin.v[vertex] = speed;
            }
        }
        state.step += 1;
        report.is_finite = state.core.is_finite(state.core.x.len())
            && state.skin.is_finite(state.skin.x.len())
            && state.particles.is_finite(awake.map_or(0, Region::len));
        report
    }

    /// Returns the region that is awake, if one is.
    pub fn awake(&self, state: &SeedState) -> Option<&Region> {
        self.regions().get(state.touched? as usize)
    }

    /// Returns the position (m) of a vertex of the touchable surface.
    pub fn surface_m(&self, state: &SeedState, vertex: u32) -> DVec3 {
        if self.hull().is_some() { state.skin.x[vertex as usize] } else { state.core.x[self.node_of(vertex)] }
    }

    /// Returns the linear momentum (kg m/s) of core, surface and awake particles. Vertices over awake particles have
    /// none of their own.
    pub fn momentum_kg_m_per_s(&self, state: &SeedState) -> DVec3 {
        let sum = |masses: &[f64], v: &[DVec3]| masses.iter().zip(v).map(|(m, v)| *v * *m).sum::<DVec3>();
        let mut total = sum(self.core().mass_kg(), &state.core.v);
        if let Some(hull) = self.hull() {
            total += sum(&hull.links.mass_kg, &state.skin.v);
            if let Some(region) = self.awake(state) {
                for carried in &region.carried {
                    let vertex = carried.vertex as usize;
                    total -= state.skin.v[vertex] * hull.links.mass_kg[vertex];
                }
                total += state.particles.v[..region.len()].iter().sum::<DVec3>() * hull.layer.mass_kg;
            }
        }
        total
    }

    /// Wakes the region of a triangle. Particles that were awake keep their positions and velocities. The others start
    /// where the core has moved them, so that there is no jump; at rest this is the papers' "active particles start in
    /// these voxels".
    fn wake(&self, touched: Option<u32>, state: &mut SeedState, scratch: &mut SeedScratch) {
        let Some(hull) = self.hull() else { return };
        if touched == state.touched {
            return;
        }
        let old = self.awake(state);
        let old_particles = old.map_or(&[][..], |region| &region.particles);
        scratch.before.x.copy_from_slice(&state.particles.x);
        scratch.before.v.copy_from_slice(&state.particles.v);
        state.touched = touched;
        let awake = self.awake(state).map_or(&[][..], |region| &region.particles);
        let mut was = 0;
        for (slot, &particle) in awake.iter().enumerate() {
            while was < old_particles.len() && old_particles[was] < particle {
                was += 1;
            }
            let (x, v) = if old_particles.get(was) == Some(&particle) {
                (scratch.before.x[was], scratch.before.v[was])
            } else {
                hull.asleep(self, particle, state)
            };
            (state.particles.x[slot], state.particles.v[slot]) = (x, v);
        }
        state.particles.x[awake.len()..].fill(DVec3::ZERO);
        state.particles.v[awake.len()..].fill(DVec3::ZERO);
    }

    fn particle_forces(&self, hull: &Hull, region: &Region, state: &SeedState, scratch: &mut SeedScratch) {
        let stencil = &hull.layer.stencil;
        for slot in 0..region.len() {
            scratch.displacement_m[slot] = state.particles.x[slot] - region.rest_m(slot);
        }
        let (displacements_m, v) = (&scratch.displacement_m, &state.particles.v);
        sph::stresses_pa(region, stencil, &hull.stress, displacements_m, v, &mut scratch.stress_pa);
        let pair_stress = self.parameters().pair_stress;
        let forces = &mut scratch.force_n;
        sph::forces_n(region, stencil, hull.layer.volume_m3, pair_stress, &scratch.stress_pa, forces);
        for (slot, force) in forces.iter_mut().enumerate().take(region.len()) {
            let (law, stiffness) = (self.parameters().interface_force, hull.interface_stiffness_n_per_m);
            *force += region.interface_force_n(law, stiffness, slot, state.particles.x[slot]);
        }
    }

    /// Adds an external force on a vertex to the node, the particles or the vertex itself that carries it. Returns
    /// whether there is such a vertex and the force is finite.
    fn push(&self, awake: Option<&Region>, push: &AtVertex, scratch: &mut SeedScratch) -> bool {
        if push.vertex as usize >= self.surface_rest_m().len() || !push.value.is_finite() {
            return false;
        }
        if self.hull().is_none() {
            scratch.core_force_n[self.node_of(push.vertex)] += push.value;
        } else if let Some((region, carried)) = carried_by(awake, push.vertex) {
            // The transpose of eq. 25's interpolation: the same weights.
            for &(slot, weight) in region.terms_of(carried) {
                scratch.force_n[slot as usize] += push.value * weight;
            }
        } else {
            scratch.skin_force_n[push.vertex as usize] += push.value;
        }
        true
    }

    /// Brings displaced vertices to where they are held. Returns the holder's force (N), `m Δ/dt²` over all points that
    /// it moves by Δ beyond their own motion, and how many vertices cannot be displaced.
    ///
    /// Particles in the support of displaced vertices move with them, each by the mean of their displacements with the
    /// weights of eq. 25. If they moved only as far as the vertices need, `Σ_j w_j d_j`, patterns would remain that raw
    /// SPH does not resist: a particle would then go four times as far as its vertex.
    fn displace(
        &self,
        awake: Option<&Region>,
        goals: &[AtVertex],
        state: &mut SeedState,
        scratch: &mut SeedScratch,
    ) -> (DVec3, u32) {
        let dt_s = self.parameters().dt_s;
        let (mut holder_n, mut rejected) = (DVec3::ZERO, 0);
        for goal in goals {
            let vertex = goal.vertex as usize;
            let Some(rest) = self.surface_rest_m().get(vertex).filter(|_| goal.value.is_finite()) else {
                rejected += 1;
                continue;
            };
            if let Some((region, carried)) = carried_by(awake, goal.vertex) {
                for &(slot, weight) in region.terms_of(carried) {
                    let (sum, weights) = &mut scratch.goal_sums[slot as usize];
                    *sum += (goal.value - *rest) * weight;
                    *weights += weight;
                }
            } else if let Some(hull) = self.hull() {
                let by = goal.value - state.skin.x[vertex];
                state.skin.shift(vertex, by, dt_s);
                holder_n += by * (hull.links.mass_kg[vertex] / (dt_s * dt_s));
            } else {
                let node = self.node_of(goal.vertex);
                if self.core().inverse_mass_per_kg()[node] == 0.0 {
                    rejected += 1;
                    continue;
                }
                let by = goal.value - state.core.x[node];
                state.core.shift(node, by, dt_s);
                holder_n += self.core().force_for_n(node, by, dt_s);
            }
        }
        if let (Some(hull), Some(region)) = (self.hull(), awake) {
            for slot in 0..region.len() {
                let (sum, weights) = std::mem::take(&mut scratch.goal_sums[slot]);
                if weights > 0.0 {
                    let by = region.rest_m(slot) + sum / weights - state.particles.x[slot];
                    state.particles.shift(slot, by, dt_s);
                    holder_n += by * (hull.layer.mass_kg / (dt_s * dt_s));
                }
            }
        }
        (holder_n, rejected)
    }

    fn exchange(&self, hull: &Hull, region: &Region, state: &mut SeedState, scratch: &mut SeedScratch) {
        let dt_s = self.parameters().dt_s;
        match self.parameters().exchange {
            Exchange::Impulses => exchange::tie(self.core(), region, hull.layer.mass_kg, dt_s, state),
            Exchange::Displacements => {
                let SeedState { core, particles, .. } = state;
                let crossed = |slot: usize| {
                    let voxel = hull.layer.voxels.holding(particles.x[slot])?;
                    (hull.layer.holds[voxel] == Holds::Core).then(|| particles.v[slot] * dt_s)
                };
                exchange::nodes_follow(self.core(), region, crossed, &mut scratch.node_sums, &mut core.x);
                exchange::particles_follow(self.core(), region, &scratch.core_before_m, &core.x, &mut particles.x);
            }
        }
    }
}

/// Returns the carried vertex with this number in the awake region, and the region.
fn carried_by(awake: Option<&Region>, vertex: u32) -> Option<(&Region, &CarriedVertex)> {
    awake.and_then(|region| Some((region, region.carried_vertex(vertex)?)))
}

impl Hull {
    /// Computes the forces (N) of links on vertices, which are zero over awake particles, and adds their reactions to
    /// the core's forces.
    fn link_forces(&self, awake: Option<&Region>, state: &SeedState, scratch: &mut SeedScratch) {
        for (vertex, force) in scratch.skin_force_n.iter_mut().enumerate() {
            *force = self.links.force_n(vertex, state.skin.x[vertex], state.skin.v[vertex], &state.core);
        }
        for carried in awake.map_or(&[][..], |region| &region.carried) {
            scratch.skin_force_n[carried.vertex as usize] = DVec3::ZERO;
        }
        for (vertex, force) in scratch.skin_force_n.iter().enumerate() {
            for (&node, weight) in self.links.nodes[vertex].iter().zip(self.links.weights[vertex]) {
                scratch.core_force_n[node as usize] -= *force * weight;
            }
        }
    }

    /// Returns the position (m) and velocity (m/s) of a sleeping particle, which moves with its attachment point on the
    /// core.
    fn asleep(&self, model: &SeedModel, particle: u32, state: &SeedState) -> (DVec3, DVec3) {
        let attachment = self.layer.core_attachment[particle as usize];
        let nodes = model.core().outer_triangles()[attachment.triangle as usize].map(|n| n as usize);
        let (mut x, mut v) = (self.layer.rest_m(particle), DVec3::ZERO);
        for (node, weight) in nodes.into_iter().zip(attachment.weights) {
            x += (state.core.x[node] - model.core().rest_m()[node]) * weight;
            v += state.core.v[node] * weight;
        }
        (x, v)
    }
}

impl Region {
    /// Returns the displacement `Σ w_j (x_j − u_j)` (m) and the velocity `Σ w_j v_j` (m/s) of a carried vertex.
    fn carried_motion(&self, carried: &CarriedVertex, x: &[DVec3], v: &[DVec3]) -> (DVec3, DVec3) {
        let (mut by, mut speed) = (DVec3::ZERO, DVec3::ZERO);
        for &(slot, weight) in self.terms_of(carried) {
            by += (x[slot as usize] - self.rest_m(slot as usize)) * weight;
            speed += v[slot as usize] * weight;
        }
        (by, speed)
    }
}
