//! A hybrid body: all that its rest state fixes.
use super::{
    cell::RestCell,
    clusters::SkinClusters,
    composite::{Composite, NO_WEIGHT},
    embedding_mesh::{self, EmbeddingMesh},
    held_edges,
    held_particles::{self, HeldParticles},
    masses::Masses,
    moments::{CellMoments, Moments, integrate},
    partition::Partition,
    patch::{KEPT, Materials},
    projection::Lumping,
    seen::demand_seen,
    sites::Sites,
    sizes::{self, Site},
    skin_carriers::SkinCarriers,
    skin_influence::SkinInfluence,
    spec::{HybridError, ParticleSpec},
    transition_force::is_free,
    trilinear_point::CellPoint,
};
use crate::{
    elements::{
        rigid_motion::{FreePart, HeldNodes, first_free_part},
        solid::Solid,
    },
    material::Material,
    mesh::{Surface, TetMesh},
    settings::PrescribedSpec,
    tick::PrescribedNodes,
};
use glam::{BVec3, DVec3};
use std::collections::BTreeSet;

/// Fractions of the time to build a body at which its cells are integrated, are counted to coarse tets, and it is
/// known which of its particles may wake.
const INTEGRATED: f64 = 0.15;
const COUNTED: f64 = 0.85;
const MAY_WAKE: f64 = 0.95;

/// All that the rest state of a hybrid body fixes. It does not change after loading.
#[derive(Debug, Clone)]
pub struct HybridBody {
    pub(super) partition: Partition,
    /// Rest data of a plain cell.
    full_cell: RestCell,
    pub(super) masses: Masses,
    /// The part of the mass matrix that lumping adds to the consistent one.
    pub(super) lumping: Lumping,
    pub(super) materials: Vec<Material>,
    pub(super) of_tet: Vec<u16>,
    /// Axes along which coarse nodes may move.
    pub(super) free: Vec<BVec3>,
    free_parts: Vec<DVec3>,
    /// Whether the body is held nowhere.
    pub(super) is_free: bool,
    /// Particles that are held by nodes of their own.
    held: HeldParticles,
    /// Whether each particle may wake: it has to follow some free node, to follow no node that is held along some axes
    /// only, and to lie within the coarse tets.
    pub(super) may_wake: Vec<bool>,
    /// The cell of each vertex of the skin, and the vertex's coordinates in it.
    pub(super) vertex_points: Vec<CellPoint>,
    /// The particles that carry these.
    pub(super) skin_carriers: SkinCarriers,
    /// How much coarse nodes move the skin.
    pub(super) skin_influence: SkinInfluence,
    /// Bounding boxes of the skin's triangles.
    pub(super) clusters: SkinClusters,
    /// The same in the order of walls that may meet; none where there are no walls.
    pub(super) wall_clusters: SkinClusters,
    pub(super) densities_kg_per_m3: Vec<f64>,
    embedding: EmbeddingSummary,
    /// The embedding mesh: the coarse mesh, its boundary moved so that it holds the particles.
    coarse: TetMesh,
    /// The specification that the particles were made from.
    pub(super) particles: ParticleSpec,
    /// `1/m` (1/kg) per coarse node and axis, zero where prescribed or without mass.
    pub(super) inverse_mass_per_kg: Vec<DVec3>,
    pub(super) max_natural_frequency_rad_per_s: f64,
}

/// A hybrid body that has been laid out.
#[derive(Debug)]
pub(crate) struct Built {
    /// The body; its frequencies are not known yet.
    pub(crate) body: HybridBody,
    /// The prescribed sets, extended by nodes in the middle of edges.
    pub(crate) prescribed: Vec<PrescribedSpec>,
}

/// How the coarse mesh's boundary was moved to hold the particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmbeddingSummary {
    /// Largest displacement (m) of a node of the boundary.
    pub moved_m: f64,
    /// Number of particles that the coarse tets do not hold even so; they never wake.
    pub outside: usize,
    /// The corners (m) of the smallest box around these particles, along the axes.
    pub outside_m: [DVec3; 2],
}

impl EmbeddingSummary {
    fn new(moved_m: f64, outside_m: &[DVec3]) -> Self {
        let low_m = outside_m.iter().copied().reduce(DVec3::min).unwrap_or_default();
        let high_m = outside_m.iter().copied().reduce(DVec3::max).unwrap_or_default();
        Self { moved_m, outside: outside_m.len(), outside_m: [low_m, high_m] }
    }
}

impl HybridBody {
    /// Lays the lattice of particles over coarse tets, whose boundary is given. `progress` is told the fraction done.
    ///
    /// # Errors
    /// Fails for a specification outside its range, or a lattice that does not fit the body.
    pub(crate) fn lay_out(
        coarse: &Solid,
        boundary: &Surface,
        spec: ParticleSpec,
        prescribed: &[PrescribedSpec],
        progress: &mut dyn FnMut(f64),
    ) -> Result<Built, HybridError> {
        let (mesh, surface, of_tet) = (&coarse.mesh, boundary, &coarse.tet_region[..]);
        let (materials, densities_kg_per_m3) = (coarse.materials(), coarse.densities_kg_per_m3());
        spec.check()?;
        let spacing_m = spec.spacing_m;
        let sites = Sites::covering(spec.skin.bounds_m(), spacing_m, spec.lattice_through_m);
        let moments = integrate(&spec.skin, &sites, &mut |part| progress(INTEGRATED * part));
        if moments.is_empty() {
            return Err(HybridError::Nothing { spacing_m });
        }
        let EmbeddingMesh { mesh, moved_m, outside_m } = covering(mesh, surface, prescribed, &sites, &moments);
        let mut composite = Composite::new(&mesh);
        let mut prescribed = held_edges::with_edges(&mesh, surface, &composite, prescribed);
        let moments = match spec.fine_layers() {
            Some(layers) => merged(&sites, &composite, moments, layers, of_tet),
            None => moments,
        };
        let marks = sizes::mark(&sites, &moments);
        let particles = (0..marks.len()).filter(|&site| marks[site] == Site::Particle);
        let held = held_particles::hold(&mesh, surface, &sites, particles, &mut composite, &mut prescribed);
        let is_held = |at_m: &DVec3| held.node_at.keys().any(|&site| sites.site_m(site) == *at_m);
        let outside_m: Vec<DVec3> = outside_m.into_iter().filter(|at_m| !is_held(at_m)).collect();
        let embedding = EmbeddingSummary::new(moved_m, &outside_m);
        let partition = Partition::new_with(sites, composite, &moments, &held.node_at, &mut |part| {
            progress(INTEGRATED + (COUNTED - INTEGRATED) * part);
        });
        progress(COUNTED);
        let masses = Masses::new(&partition, |tet| densities_kg_per_m3[of_tet[tet] as usize]);
        let mut free: Vec<BVec3> = masses.node_kg.iter().map(|&mass| BVec3::splat(mass > 0.0)).collect();
        for set in &prescribed {
            for &node in &set.nodes {
                for axis in (0..3).filter(|&axis| set.axes[axis]) {
                    free[node as usize].set(axis, false);
                }
            }
        }
        demand_seen(&partition, &mesh, &free)?;
        let may_wake = (0..partition.particle_count() as u32).map(|p| may_wake(&partition, &free, p)).collect();
        progress(MAY_WAKE);
        let vertex_points: Vec<CellPoint> =
            spec.skin.positions_m().iter().map(|&point| CellPoint::new(&partition, point)).collect();
        let skin_carriers = SkinCarriers::new(&partition, &vertex_points, spec.smooth_skin);
        let hybrid = Self {
            lumping: Lumping::new(&partition, &masses),
            full_cell: RestCell::new(spacing_m, 1.0 - KEPT, &Moments::full(spacing_m)),
            materials,
            densities_kg_per_m3,
            of_tet: of_tet.to_vec(),
            is_free: is_free(&masses.node_kg, &free),
            free_parts: free.iter().map(|free| DVec3::select(*free, DVec3::ONE, DVec3::ZERO)).collect(),
            free,
            may_wake,
            held,
            skin_influence: SkinInfluence::new(&skin_carriers, masses.node_kg.len(), spec.fine_depth_m.is_none()),
            skin_carriers,
            vertex_points,
            clusters: SkinClusters::default(),
            wall_clusters: SkinClusters::default(),
            embedding,
            partition,
            masses,
            coarse: mesh,
            particles: spec,
            inverse_mass_per_kg: Vec::new(),
            max_natural_frequency_rad_per_s: 0.0,
        };
        progress(1.0);
        Ok(Built { body: hybrid, prescribed })
    }

    /// Returns the lattice's cells and particles on the coarse tets.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// Returns the masses while all particles sleep.
    pub fn masses(&self) -> &Masses {
        &self.masses
    }

    /// Returns the embedding mesh: the coarse mesh, its boundary moved so that it holds the particles.
    pub fn coarse(&self) -> &TetMesh {
        &self.coarse
    }

    /// Returns the specification that the particles were made from.
    pub fn particles(&self) -> &ParticleSpec {
        &self.particles
    }

    /// Returns the rest positions (m) of the skin's vertices.
    pub fn skin_rest_m(&self) -> &[DVec3] {
        self.particles.skin.positions_m()
    }

    /// Returns the rest positions (m) of the coarse nodes.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        self.partition.coarse().positions_m()
    }

    /// Returns `1/m` (1/kg) per coarse node and axis, zero where prescribed or without mass.
    pub fn inverse_mass_per_kg(&self) -> &[DVec3] {
        &self.inverse_mass_per_kg
    }

    /// Returns the largest natural frequency (rad/s) at rest.
    pub fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.max_natural_frequency_rad_per_s
    }

    /// Returns the number of coarse nodes plus that of the particles that may be active at once.
    pub(crate) fn most_positions(&self) -> usize {
        self.node_count() + self.particles.most_active
    }

    /// Returns the first part of the coarse level that is not held.
    pub(crate) fn first_free_part(&self) -> Option<FreePart> {
        let nodes = HeldNodes {
            rest_m: self.rest_positions_m(),
            mass_kg: &self.masses.node_kg,
            inverse_mass_per_kg: &self.inverse_mass_per_kg,
        };
        first_free_part(&nodes, self.partition.residual_elements().iter().map(|residual| &residual.nodes[..]))
    }

    /// Returns what prescribed sets need of the coarse nodes.
    pub(crate) fn prescribed_nodes(&self) -> PrescribedNodes<'_> {
        PrescribedNodes { rest_m: self.rest_positions_m(), mass_kg: &self.masses.node_kg }
    }

    /// Returns the materials of the coarse tets.
    pub fn materials(&self) -> Materials<'_> {
        Materials { materials: &self.materials, of_tet: &self.of_tet }
    }

    /// Returns the number of coarse nodes; their positions are the first of a state's.
    pub fn node_count(&self) -> usize {
        self.free.len()
    }

    /// Returns the axes along which coarse nodes may move.
    pub fn free(&self) -> &[BVec3] {
        &self.free
    }

    /// Moves the reactions (N) of held particles to corners of their held faces.
    pub(crate) fn move_reactions_to_faces(&self, reactions_n: &mut [DVec3]) {
        self.held.move_to_faces(reactions_n);
    }

    /// Returns whether a particle may wake.
    pub fn may_wake(&self, particle: u32) -> bool {
        self.may_wake.get(particle as usize).copied().unwrap_or(false)
    }

    /// Returns the rest data of a cell that is awake.
    pub(super) fn awake_cell(&self, cell: usize) -> RestCell {
        if self.partition.is_plain(cell) { self.full_cell } else { self.partition.rest_cell(cell, 1.0 - KEPT) }
    }

    /// Returns the same as [`Self::free`] in numbers: 1 along an axis on which a coarse node may move, 0 along others.
    pub(crate) fn free_parts(&self) -> &[DVec3] {
        &self.free_parts
    }

    /// Returns the material of a coarse tet.
    pub(super) fn material_of_tet(&self, tet: u32) -> &Material {
        &self.materials[self.of_tet[tet as usize] as usize]
    }

    /// Returns the material of a cell.
    pub(super) fn material_of_cell(&self, cell: usize) -> &Material {
        self.material_of_tet(self.partition.cells()[cell].tet)
    }

    /// Returns the cell of a vertex of the skin, and the vertex's coordinates in it.
    pub fn vertex_point(&self, vertex: u32) -> CellPoint {
        self.vertex_points[vertex as usize]
    }

    /// Returns a bound of the speed of any vertex of the skin over that of the fastest node or particle.
    pub(crate) fn amplification(&self) -> f64 {
        self.skin_influence.largest_amplification()
    }

    /// Computes the bounding boxes of the skin's triangles, given in the order of contact's broad phase.
    pub(crate) fn cluster(&mut self, triangles: &[[u32; 3]]) {
        self.clusters = SkinClusters::new(self, self.skin_rest_m(), triangles);
    }

    /// Finds what clusters of walls follow, given their triangles in the order of self-contact. Returns how many nodes they follow, each counted
    /// with each of its clusters.
    pub(crate) fn cluster_walls(&mut self, triangles: &[[u32; 3]]) -> usize {
        self.wall_clusters = SkinClusters::new(self, self.skin_rest_m(), triangles);
        self.wall_clusters.followed()
    }

    /// Returns the particles that carry a vertex of the skin, with their weights, of which none is zero.
    pub fn carriers_of_vertex(&self, vertex: u32) -> &[(u32, f64)] {
        self.skin_carriers.of_vertex(vertex)
    }

    /// Returns the material of the tet that a vertex of the skin is in.
    pub(crate) fn material_at(&self, vertex: u32) -> &Material {
        let cell = self.partition.cells()[self.vertex_point(vertex).cell as usize];
        &self.materials[self.of_tet[cell.tet as usize] as usize]
    }

    /// Returns how the coarse mesh's boundary was moved to hold the particles.
    pub fn embedding(&self) -> EmbeddingSummary {
        self.embedding
    }
}

/// Merges the cells beneath so many layers, eight to one, where they are of one material.
fn merged(
    sites: &Sites,
    composite: &Composite,
    moments: Vec<CellMoments>,
    layers: usize,
    of_tet: &[u16],
) -> Vec<CellMoments> {
    let half = DVec3::splat(0.5 * sites.spacing_m());
    let material = |cell: usize| of_tet[composite.anchor(sites.cell_m(cell) + half).tet as usize];
    let is_one = of_tet.iter().all(|one| *one == of_tet[0]);
    sizes::merge(sites, moments, layers, |block| {
        is_one || block.iter().all(|&cell| material(cell) == material(block[0]))
    })
}

fn covering(
    mesh: &TetMesh,
    surface: &Surface,
    prescribed: &[PrescribedSpec],
    sites: &Sites,
    moments: &[CellMoments],
) -> EmbeddingMesh {
    let mut is_corner = vec![false; sites.site_count()];
    moments.iter().flat_map(|m| sites.corners(m.cell)).for_each(|site| is_corner[site] = true);
    let points: Vec<DVec3> =
        (0..is_corner.len()).filter(|&site| is_corner[site]).map(|site| sites.site_m(site)).collect();
    let held: BTreeSet<u32> = prescribed.iter().flat_map(|set| &set.nodes).copied().collect();
    embedding_mesh::cover(mesh, surface, &held, &points)
}

fn may_wake(partition: &Partition, free: &[BVec3], particle: u32) -> bool {
    let anchor = partition.anchor(particle);
    let mut follows = anchor.nodes.iter().zip(anchor.weights).filter(|(_, weight)| *weight >= NO_WEIGHT);
    anchor.is_inside()
        && follows.clone().all(|(&node, _)| free[node as usize].all() || !free[node as usize].any())
        && follows.any(|(&node, _)| free[node as usize].all())
}
