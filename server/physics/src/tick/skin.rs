//! Contact, loads and injected forces on a surface whose vertices are carried by nodes: a hybrid body's skin, a refined surface of
//! springs.
use super::{Evaluation, Tick};
use crate::contact::{ContactScratch, ContactState, Skin, SurfaceNow, ToolState};
use glam::DVec3;

/// A surface whose vertices are carried by nodes, at one instant.
pub(crate) trait CarriedSkin: Skin {
    /// What carries a vertex: it does not change before [`Self::layout`] does.
    type Carriers: Clone;
    /// A number that changes where what carries vertices does.
    fn layout(&self) -> u64;
    /// What carries a vertex.
    fn carriers(&self, vertex: u32) -> Self::Carriers;
    /// Where a vertex is (m).
    fn carried_m(&self, carriers: &Self::Carriers) -> DVec3;
    /// Velocity (m/s) of a vertex.
    fn velocity_m_per_s(&self, vertex: u32) -> DVec3;
    /// Gives a force (N) on a vertex to the nodes that carry it.
    fn push(&self, carriers: &Self::Carriers, force_n: DVec3, forces_n: &mut [DVec3]);
}

/// Vertices of a skin whose positions are kept up to date, because tools, loads or injected forces are at them.
#[derive(Debug, Clone)]
pub(crate) struct ListedVertices<C> {
    /// Positions (m) of all vertices, of use at the listed ones.
    x: Vec<DVec3>,
    /// Forces (N) on all vertices, zero but at the listed ones.
    forces_n: Vec<DVec3>,
    listed: Vec<ListedVertex<C>>,
    is_listed: Vec<bool>,
    /// The layout that the carriers are of.
    layout: u64,
}

#[derive(Debug, Clone)]
struct ListedVertex<C> {
    vertex: u32,
    carriers: C,
}

impl<C> ListedVertices<C> {
    /// For a skin of so many vertices.
    pub(crate) fn new(vertices: usize) -> Self {
        Self {
            x: vec![DVec3::ZERO; vertices],
            forces_n: vec![DVec3::ZERO; vertices],
            listed: Vec::with_capacity(vertices),
            is_listed: vec![false; vertices],
            layout: u64::MAX,
        }
    }

    fn is_listed(&self, vertex: u32) -> bool {
        self.is_listed[vertex as usize]
    }

    /// Leaves all vertices, to be listed anew.
    fn start(&mut self, layout: u64) {
        for listed in &self.listed {
            self.is_listed[listed.vertex as usize] = false;
        }
        self.listed.clear();
        self.layout = layout;
    }

    /// Lists a vertex. Allocates nothing.
    fn list<S: CarriedSkin<Carriers = C>>(&mut self, skin: &S, vertex: u32) {
        if !std::mem::replace(&mut self.is_listed[vertex as usize], true) {
            self.listed.push(ListedVertex { vertex, carriers: skin.carriers(vertex) });
        }
    }

    /// Nothing more is listed. Vertices go in their order, so that sums have the same bits whenever and wherefore they were listed.
    fn finish(&mut self) {
        self.listed.sort_unstable_by_key(|listed| listed.vertex);
    }

    /// Positions and no forces at the listed vertices.
    fn refresh<S: CarriedSkin<Carriers = C>>(&mut self, skin: &S) {
        for ListedVertex { vertex, carriers } in &self.listed {
            self.x[*vertex as usize] = skin.carried_m(carriers);
            self.forces_n[*vertex as usize] = DVec3::ZERO;
        }
    }

    /// Hands the forces on vertices to the nodes that carry them.
    fn push<S: CarriedSkin<Carriers = C>>(&self, skin: &S, forces_n: &mut [DVec3]) {
        for ListedVertex { vertex, carriers } in &self.listed {
            let force_n = self.forces_n[*vertex as usize];
            if force_n != DVec3::ZERO {
                skin.push(carriers, force_n, forces_n);
            }
        }
    }
}

/// What a skin is touched with, of a [`super::MechanicalState`]: all but what the skin itself reads.
pub(crate) struct Touch<'a> {
    pub(crate) tools: &'a mut [ToolState],
    pub(crate) contact: &'a mut ContactState,
    pub(crate) load_factors: &'a [f64],
    /// Overwritten with what tools, loads and injected forces give the nodes (N).
    pub(crate) external_n: &'a mut [DVec3],
    pub(crate) scratch: &'a mut ContactScratch,
    /// Bound of the speed (m/s) with which any vertex came here.
    pub(crate) fastest_m_per_s: f64,
}

/// Moves the tools, lists what they may touch, and evaluates contact, loads and injected forces on a skin that is at `rest_m` (m) at
/// rest.
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
    renewed |= listed.layout != skin.layout();
    renewed |= tick.usable_points().any(|point| !listed.is_listed(point.node));
    if renewed {
        listed.start(skin.layout());
        tick.list_touched(contact, |vertex| listed.list(skin, vertex));
        listed.finish();
    }
    listed.refresh(skin);
    tick.add_given_n(load_factors, now, rest_m, &listed.x, &mut listed.forces_n);
    let velocity = |vertex: u32| skin.velocity_m_per_s(vertex);
    let surface = SurfaceNow { x: &listed.x, velocity_m_per_s: &velocity };
    model.press_tools(&surface, &time, tools, contact, &mut listed.forces_n, scratch);
    external_n.fill(DVec3::ZERO);
    listed.push(skin, external_n);
}
