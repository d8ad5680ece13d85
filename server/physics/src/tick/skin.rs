//! Contact, loads and injected forces on a surface whose vertices are carried by nodes: the skin of a hybrid body, or a
//! refined surface of springs.
use super::{Evaluation, MechanicalState, Tick};
use crate::contact::{ContactModel, ContactScratch, ContactState, Skin, SurfaceNow, ToolState};
use glam::DVec3;

/// A surface whose vertices are carried by nodes, at one instant.
pub(crate) trait CarriedSkin: Skin {
    /// The nodes that carry a vertex; they do not change before [`Self::layout`] does.
    type Carriers: Clone;
    /// Returns a number that changes whenever the carriers of vertices do.
    fn layout(&self) -> u64;
    /// Returns the carriers of a vertex.
    fn carriers(&self, vertex: u32) -> Self::Carriers;
    /// Returns the position (m) of a vertex from its carriers.
    fn carried_m(&self, carriers: &Self::Carriers) -> DVec3;
    /// Returns the velocity (m/s) of a vertex.
    fn velocity_m_per_s(&self, vertex: u32) -> DVec3;
    /// Adds a force (N) on a vertex to the forces on its carriers.
    fn push(&self, carriers: &Self::Carriers, force_n: DVec3, forces_n: &mut [DVec3]);
}

/// The vertices of a skin whose positions are kept up to date, because tools, loads or injected forces are at them.
#[derive(Debug, Clone)]
pub(crate) struct ListedVertices<C> {
    /// Positions (m) of all vertices, which are up to date only at listed ones.
    x: Vec<DVec3>,
    /// Forces (N) on all vertices, which are zero except at listed ones.
    forces_n: Vec<DVec3>,
    listed: Vec<ListedVertex<C>>,
    /// The listed vertices, while they are listed.
    numbers: Vec<u32>,
    is_listed: Vec<bool>,
    /// Layout to which the carriers belong.
    layout: u64,
}

#[derive(Debug, Clone)]
struct ListedVertex<C> {
    vertex: u32,
    carriers: C,
}

impl<C> ListedVertices<C> {
    /// Returns an empty list for a skin with so many vertices.
    pub(crate) fn new(vertices: usize) -> Self {
        Self {
            x: vec![DVec3::ZERO; vertices],
            forces_n: vec![DVec3::ZERO; vertices],
            listed: Vec::with_capacity(vertices),
            numbers: Vec::with_capacity(vertices),
            is_listed: vec![false; vertices],
            layout: u64::MAX,
        }
    }

    fn is_listed(&self, vertex: u32) -> bool {
        self.is_listed[vertex as usize]
    }

    /// Empties the list, so that vertices can be listed anew.
    fn start(&mut self, layout: u64) {
        for listed in &self.listed {
            self.is_listed[listed.vertex as usize] = false;
        }
        self.listed.clear();
        self.layout = layout;
    }

    /// Lists a vertex. Nothing is allocated.
    fn list(&mut self, vertex: u32) {
        if !std::mem::replace(&mut self.is_listed[vertex as usize], true) {
            self.numbers.push(vertex);
        }
    }

    /// Ends the listing. Vertices are sorted, so that sums have the same bits whenever and for whatever reason the
    /// vertices were listed.
    fn finish<S: CarriedSkin<Carriers = C>>(&mut self, skin: &S) {
        self.numbers.sort_unstable();
        let listed = self.numbers.drain(..).map(|vertex| ListedVertex { vertex, carriers: skin.carriers(vertex) });
        self.listed.extend(listed);
    }

    /// Computes the positions of the listed vertices, and sets the forces on them to zero.
    fn refresh<S: CarriedSkin<Carriers = C>>(&mut self, skin: &S) {
        for ListedVertex { vertex, carriers } in &self.listed {
            self.x[*vertex as usize] = skin.carried_m(carriers);
            self.forces_n[*vertex as usize] = DVec3::ZERO;
        }
    }

    /// Adds the forces on the listed vertices to the forces on their carriers.
    fn push<S: CarriedSkin<Carriers = C>>(&self, skin: &S, forces_n: &mut [DVec3]) {
        for ListedVertex { vertex, carriers } in &self.listed {
            let force_n = self.forces_n[*vertex as usize];
            if force_n != DVec3::ZERO {
                skin.push(carriers, force_n, forces_n);
            }
        }
    }
}

/// Returns whether any tool is near a skin that stands still.
pub(crate) fn any_tool_is_near<S: CarriedSkin>(
    model: &ContactModel,
    skin: &mut S,
    listed: &mut ListedVertices<S::Carriers>,
    state: &mut MechanicalState,
    scratch: &ContactScratch,
) -> bool {
    // Contact may list other triangles, whose vertices are not those that were listed.
    listed.layout = u64::MAX;
    model.any_is_near(skin, &mut listed.x, &state.tools, &mut state.contact, scratch)
}

/// What touches a skin: the parts of a [`super::MechanicalState`] that the skin itself does not read.
pub(crate) struct Touch<'a> {
    pub(crate) tools: &'a mut [ToolState],
    pub(crate) contact: &'a mut ContactState,
    pub(crate) load_factors: &'a [f64],
    /// Forces (N) of tools, loads and injections on the nodes, which are overwritten.
    pub(crate) external_n: &'a mut [DVec3],
    pub(crate) scratch: &'a mut ContactScratch,
    /// Upper bound (m/s) of the speed with which any vertex came here.
    pub(crate) fastest_m_per_s: f64,
}

/// Moves the tools, lists the vertices that they may touch, and evaluates contact, loads and injected forces on a skin
/// whose vertices are at `rest_m` (m) at rest.
pub(crate) fn touch_skin<S: CarriedSkin>(
    tick: &Tick<'_>,
    now: &Evaluation,
    rest_m: &[DVec3],
    skin: &mut S,
    listed: &mut ListedVertices<S::Carriers>,
    touch: Touch<'_>,
) {
    let Touch { tools, contact, load_factors, external_n, scratch, fastest_m_per_s } = touch;
    let (model, time) = (&tick.environment.contact, tick.substep_time(now));
    model.move_tools(fastest_m_per_s, &time, tools, contact);
    let mut renewed = model.list_on_skin(skin, &mut listed.x, tools, contact, scratch);
    renewed |= model.list_walls_on_skin(skin, contact, scratch);
    renewed |= listed.layout != skin.layout();
    renewed |= tick.usable_points().any(|point| !listed.is_listed(point.node));
    if renewed {
        listed.start(skin.layout());
        tick.list_touched(contact, |vertex| listed.list(vertex));
        listed.finish(skin);
    }
    listed.refresh(skin);
    tick.add_given_n(load_factors, now, rest_m, &listed.x, &mut listed.forces_n);
    let velocity = |vertex: u32| skin.velocity_m_per_s(vertex);
    let surface = SurfaceNow { x: &listed.x, velocity_m_per_s: &velocity };
    model.press_tools(&surface, &time, tools, contact, &mut listed.forces_n, scratch);
    model.press_walls_on_skin(&listed.x, contact, &mut listed.forces_n, scratch);
    external_n.fill(DVec3::ZERO);
    listed.push(skin, external_n);
}
