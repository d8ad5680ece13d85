//! Contact's part of a tick: its beginning, its substeps, its end.
use super::{
    BodyMotion, ContactModel, ContactScratch, ContactState, Coupling, SubstepTime, SurfaceNow, ToolScratch, ToolState,
    axis::Axis,
    broad::{ListReach, Skin},
    local_model::{self, MeanContact},
    narrow::{self, Meeting, Pressed},
    proxy,
    state::ToolContact,
    tool_pairs::Push,
};
use glam::DVec3;

/// Where tools are after they moved past a body that stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Drifted {
    /// One is pushed by another.
    Pushed,
    /// None can be near, by the lists that there are.
    Away,
    /// It has to be looked.
    PerhapsNear,
}

impl ContactModel {
    /// Begins a tick, before its first substep.
    pub fn begin_tick(&self, tools: &mut [ToolState], scratch: &mut ContactScratch, tick_period_s: f64) {
        let time = SubstepTime { fraction: 1.0, dt_s: 0.0, tick_period_s };
        scratch.walls.most_frequency_sq = 0.0;
        for (tool, scratch) in tools.iter_mut().zip(&mut scratch.tools) {
            time.smooth(tool);
            tool.penetration_m = 0.0;
            scratch.sum = Pressed::default();
            scratch.coupling_sum_n = DVec3::ZERO;
            scratch.coupling_sum_nm = DVec3::ZERO;
        }
    }

    /// Does a substep, after the body drifted: moves the tools, and adds contact forces (N) on nodes to `forces_n`.
    pub fn substep(
        &self,
        body: &BodyMotion<'_>,
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        forces_n: &mut [DVec3],
        scratch: &mut ContactScratch,
    ) {
        self.move_tools(body.fastest_m_per_s, time, tools, contact);
        for (index, tool) in tools.iter().enumerate() {
            self.list_candidates(index, &self.tools[index].axis(tool), body.x, contact, scratch.exhaustive);
        }
        let surface = SurfaceNow { x: body.x, velocity_m_per_s: &|node| body.v[node as usize] };
        self.press_tools(&surface, time, tools, contact, forces_n, scratch);
    }

    /// Does the first part of a substep: the tools move after the body, which drifted with up to `fastest_m_per_s`.
    pub(crate) fn move_tools(
        &self,
        fastest_m_per_s: f64,
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
    ) {
        contact.travelled(fastest_m_per_s * time.dt_s);
        for (index, tool) in tools.iter_mut().enumerate() {
            self.drift(index, tool, time, contact);
        }
    }

    /// Does the second part, on a skin: renews the lists that are out of date. Returns whether any was. `x` has room
    /// for the positions (m) of all vertices.
    pub(crate) fn list_on_skin(
        &self,
        skin: &mut impl Skin,
        x: &mut [DVec3],
        tools: &[ToolState],
        contact: &mut ContactState,
        scratch: &ContactScratch,
    ) -> bool {
        let mut renewed = false;
        for (index, tool) in tools.iter().enumerate() {
            let axis = self.tools[index].axis(tool);
            renewed |= self.list_candidates_on_skin(index, &axis, skin, x, contact, scratch.exhaustive);
        }
        renewed
    }

    fn list_candidates_on_skin(
        &self,
        tool: usize,
        axis: &Axis,
        skin: &mut impl Skin,
        x: &mut [DVec3],
        contact: &mut ContactState,
        exhaustive: bool,
    ) -> bool {
        let (part, fitted) = contact.split(tool);
        let candidates = &mut part.candidates;
        if exhaustive {
            let renewed = candidates.triangles().len() != self.triangles.len();
            self.triangles.list_all(candidates);
            return renewed;
        }
        let renewed = candidates.slack_m <= 0.0;
        if renewed {
            self.triangles.query_skin(skin, x, fitted, axis, self.reach(tool), candidates);
        }
        renewed
    }

    /// Returns the nodes of the triangles that any tool may touch, some of them several times.
    pub(crate) fn listed_nodes<'a>(&'a self, contact: &'a ContactState) -> impl Iterator<Item = u32> + 'a {
        contact.listed().flat_map(|triangle| self.triangles.nodes[triangle as usize])
    }

    /// Returns the nodes of all triangles, in the order of the broad phase.
    pub(crate) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles.nodes
    }

    /// Does the last part: presses the tools on the listed triangles, and adds the forces (N) on nodes.
    pub(crate) fn press_tools(
        &self,
        SurfaceNow { x, velocity_m_per_s }: &SurfaceNow<'_>,
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        forces_n: &mut [DVec3],
        scratch: &mut ContactScratch,
    ) {
        for (index, scratch) in scratch.tools.iter_mut().enumerate() {
            scratch.push = self.push_of_others(index, tools);
        }
        for (index, (tool, scratch)) in tools.iter_mut().zip(&mut scratch.tools).enumerate() {
            let model = &self.tools[index];
            let pressed = self.press(index, tool, x, contact, forces_n, scratch);
            let surface_m_per_s = self.surface_m_per_s(&pressed, scratch.push, *velocity_m_per_s);
            let coupling = proxy::finish(model, tool, &pressed, surface_m_per_s, time);
            scratch.nearest = pressed.nearest.0;
            tool.friction_heat_j += pressed.heat_j;
            tool.contacts = pressed.contacts;
            tool.contact_energy_j = pressed.energy_j;
            tool.penetration_m = tool.penetration_m.max(pressed.penetration_m);
            if time.dt_s > 0.0 {
                scratch.sum.add(&pressed);
                scratch.coupling_sum_n += coupling.force_n;
                scratch.coupling_sum_nm += coupling.torque_nm;
            }
        }
    }

    /// Does a [`Self::substep`] in which the body does not move and no tool is near it, so that only the tools move.
    /// Stops and returns false as soon as a tool is near.
    pub fn substep_apart(
        &self,
        x: &[DVec3],
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        scratch: &mut ContactScratch,
    ) -> bool {
        let apart = match self.drift_apart(time, tools, contact, scratch) {
            Drifted::Pushed => false,
            Drifted::Away => true,
            Drifted::PerhapsNear => !tools.iter().enumerate().any(|(index, tool)| {
                let axis = self.tools[index].axis(tool);
                self.list_candidates(index, &axis, x, contact, scratch.exhaustive);
                self.is_near(index, &axis, &|node| x[node as usize], contact)
            }),
        };
        if apart {
            self.finish_apart(time, tools, contact, scratch);
        }
        apart
    }

    /// Does the first part of [`Self::substep_apart`]: the tools move.
    pub(crate) fn drift_apart(
        &self,
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        scratch: &ContactScratch,
    ) -> Drifted {
        if (0..tools.len()).any(|index| self.push_of_others(index, tools).is_some()) {
            return Drifted::Pushed;
        }
        for (index, tool) in tools.iter_mut().enumerate() {
            self.drift(index, tool, time, contact);
        }
        let is_away = |part: &ToolContact| part.candidates.slack_m > 0.0 && part.candidates.triangles().is_empty();
        if !scratch.exhaustive && contact.tools.iter().all(is_away) { Drifted::Away } else { Drifted::PerhapsNear }
    }

    /// Does the second part, on a skin: returns whether any tool is near it. `x` has room for the positions (m) of all vertices.
    pub(crate) fn any_is_near(
        &self,
        skin: &mut impl Skin,
        x: &mut [DVec3],
        tools: &[ToolState],
        contact: &mut ContactState,
        scratch: &ContactScratch,
    ) -> bool {
        tools.iter().enumerate().any(|(index, tool)| {
            let axis = self.tools[index].axis(tool);
            self.list_candidates_on_skin(index, &axis, skin, x, contact, scratch.exhaustive);
            self.is_near(index, &axis, &|vertex| skin.position_m(vertex), contact)
        })
    }

    /// Does the last part: nothing but their couplings pulls the tools.
    pub(crate) fn finish_apart(
        &self,
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        scratch: &mut ContactScratch,
    ) {
        for (index, (tool, scratch)) in tools.iter_mut().zip(&mut scratch.tools).enumerate() {
            let nothing = Pressed { to_surface_m: DVec3::INFINITY, ..Pressed::default() };
            contact.tools[index].is_clear = true;
            let coupling = proxy::finish(&self.tools[index], tool, &nothing, DVec3::ZERO, time);
            scratch.coupling_sum_n += coupling.force_n;
            scratch.coupling_sum_nm += coupling.torque_nm;
        }
    }

    /// Returns whether no tool is within a quarter of its radius of the surface. The lists must be of the present
    /// positions.
    pub fn is_apart(&self, x: &[DVec3], tools: &[ToolState], contact: &ContactState) -> bool {
        self.is_apart_at(&|node| x[node as usize], tools, contact)
    }

    /// Does the same with a surface whose vertices' positions (m) are asked for.
    pub(crate) fn is_apart_at(
        &self,
        position_m: &dyn Fn(u32) -> DVec3,
        tools: &[ToolState],
        contact: &ContactState,
    ) -> bool {
        let is_near = |(index, tool)| self.is_near(index, &self.tools[index].axis(tool), position_m, contact);
        !tools.iter().enumerate().any(is_near)
    }

    /// Returns whether a tool is near the surface. It measures distances, since which triangles beyond the zone are
    /// listed depends on when the list was made.
    fn is_near(&self, tool: usize, axis: &Axis, position_m: &dyn Fn(u32) -> DVec3, contact: &ContactState) -> bool {
        let zone_m = (1.0 + proxy::NEAR) * self.tools[tool].spec.radius_m;
        let listed = contact.tools[tool].candidates.triangles();
        listed.iter().any(|&triangle| axis.distance_m(self.triangles.nodes[triangle as usize].map(position_m)) < zone_m)
    }

    fn drift(&self, index: usize, tool: &mut ToolState, time: &SubstepTime, contact: &mut ContactState) {
        let moved_m = proxy::drift(&self.tools[index], tool, &contact.tools[index], time);
        contact.tools[index].candidates.slack_m -= moved_m;
    }

    fn list_candidates(&self, tool: usize, axis: &Axis, x: &[DVec3], contact: &mut ContactState, exhaustive: bool) {
        let (part, fitted) = contact.split(tool);
        if exhaustive {
            self.triangles.list_all(&mut part.candidates);
        } else if part.candidates.slack_m <= 0.0 {
            self.triangles.query(x, fitted, axis, self.reach(tool), &mut part.candidates);
        }
    }

    /// Returns how far from a tool's axis triangles are listed.
    fn reach(&self, tool: usize) -> ListReach {
        let radius_m = self.tools[tool].spec.radius_m;
        ListReach { listed_m: (1.0 + 2.0 * proxy::NEAR) * radius_m, complete_m: (1.0 + proxy::NEAR) * radius_m }
    }

    fn press(
        &self,
        index: usize,
        tool: &ToolState,
        x: &[DVec3],
        contact: &mut ContactState,
        forces_n: &mut [DVec3],
        scratch: &mut ToolScratch,
    ) -> Pressed {
        let (model, part) = (&self.tools[index], &mut contact.tools[index]);
        let meeting = Meeting {
            triangles: &self.triangles,
            foundation: &model.foundation,
            tables: &self.tables,
            x,
            axis: model.axis(tool),
            orientation: model.spec.shape.as_capsule().map(|_| tool.orientation),
            radius_m: model.spec.radius_m,
            friction_coefficient: model.spec.friction_coefficient,
            put_into: std::mem::take(&mut part.just_put) || part.touching.tells_it_was_put(),
            meets_from_behind: self.is_hollow && part.touching.presses_a_wall(),
        };
        let mut pressed =
            narrow::press(&meeting, &mut part.candidates, &mut part.touching, &mut scratch.next, forces_n);
        if let Some(push) = scratch.push {
            push.add_to(&mut pressed);
        }
        (part.force_n, part.torque_nm) = (pressed.force_n, pressed.torque_nm);
        (part.deepest_m, part.apart_sq_m2) = (pressed.deepest_m, pressed.apart_sq_m2);
        part.is_clear = proxy::is_clear(model, &pressed);
        pressed
    }

    /// Returns the velocity (m/s) of the point nearest to a tool, of the surface or of another tool.
    fn surface_m_per_s(&self, pressed: &Pressed, push: Option<Push>, velocity_m_per_s: &dyn Fn(u32) -> DVec3) -> DVec3 {
        let (triangle, weights) = pressed.nearest;
        if weights == [0.0; 3] {
            return push.map_or(DVec3::ZERO, |push| push.other_m_per_s);
        }
        let corners = self.triangles.nodes[triangle];
        corners.into_iter().zip(weights).map(|(node, weight)| velocity_m_per_s(node) * weight).sum()
    }

    /// Ends a tick: computes means over it, and the local models.
    pub fn end_tick(
        &self,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        substeps: u32,
        scratch: &mut ContactScratch,
    ) {
        let fraction = 1.0 / f64::from(substeps);
        for (index, (tool, scratch)) in tools.iter_mut().zip(&scratch.tools).enumerate() {
            let model = &self.tools[index];
            let pressed = scratch.sum.scaled(fraction);
            (tool.contact_force_n, tool.contact_torque_nm) = (pressed.force_n, pressed.torque_nm);
            (tool.device_force_n, tool.device_torque_nm) = match model.spec.coupling {
                Coupling::Rigid => (pressed.force_n, pressed.torque_nm),
                Coupling::Spring { .. } => (-scratch.coupling_sum_n * fraction, -scratch.coupling_sum_nm * fraction),
            };
            let mean =
                MeanContact { pressed, device_force_n: tool.device_force_n, device_torque_nm: tool.device_torque_nm };
            tool.local_model = local_model::update(model, tool, &mut contact.tools[index].estimate, &mean);
        }
    }
}
