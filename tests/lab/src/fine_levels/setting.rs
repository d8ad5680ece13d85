//! A hybrid body at rest under a load, built once for many methods and numbers of particles.
use super::{
    equilibrium::equilibrium,
    level::{FineLevel, still},
    methods::{PointPatch, Points},
    places,
};
use crate::random::Random;
use crate::{
    problems::{
        Problem,
        body::{Body, TetBody},
        load::{self, NodalLoad},
        sample::{self, FieldError, Probe, Sample},
    },
    references::Reference,
};
use glam::{BVec3, DVec3};
use miette::{IntoDiagnostic, Result, miette};
use palpate_physics::{
    Surface, TetMesh,
    bodies::hybrid::{
        Skin,
        composite::Composite,
        embedding_mesh::{self, EmbeddingMesh},
        moments::integrate,
        partition::Partition,
        patch::{Materials, Patch},
        sites::Sites,
        trilinear_point::TrilinearPoint,
    },
    mesh::tet::EDGES,
};
use std::collections::BTreeSet;

/// Points over the active particles, in place of cells.
pub type PointsOf<'a> = &'a dyn Fn(&Partition, &BTreeSet<u32>) -> Points;
/// What a point (m) of the skin moves with, in place of the particles of its cell: the sum of these.
pub type PlacesOf = fn(&Partition, DVec3) -> Vec<TrilinearPoint>;

/// The coarse tets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CoarseMesh {
    /// As the body makes them at a resolution.
    Made(u32),
    /// The same with nodes moved: those on flat sides within them.
    Shaken(u32),
}

/// How far a shaken node goes along each axis, over the shortest edge.
const SHAKEN: f64 = 0.15;

/// A body with its coarse tets, lattice and load.
pub struct Setting {
    problem: Problem,
    coarse_tets: usize,
    outside: usize,
    partition: Partition,
    free: Vec<BVec3>,
    fine: TetBody,
    load: NodalLoad,
    reference: Reference,
    samples: Vec<Sample>,
    /// Particles that may wake, the nearest to the touch first.
    near: Vec<u32>,
}

/// What a method gets wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Of the displacement conjugate to the load, relative.
    pub answer: f64,
    /// Of the field around the touch.
    pub field: FieldError,
    /// Cells or points of the patch.
    pub points: usize,
}

impl Setting {
    /// A problem with a load, on coarse tets of that mesh; the skin is the boundary of the body at the resolution `skin_tets`, the lattice of this spacing (m).
    ///
    /// # Errors
    /// A resolution that no mesh has, a problem without load or reference.
    pub fn new(problem: Problem, mesh: CoarseMesh, skin_tets: u32, spacing_m: f64) -> Result<Self> {
        let coarse = match mesh {
            CoarseMesh::Made(tets) => problem.body.tets(tets)?,
            CoarseMesh::Shaken(tets) => shaken(problem.body.tets(tets)?)?,
        };
        let fine = problem.body.tets(skin_tets)?;
        let rest = fine.mesh.positions_m();
        let on_skin: Vec<DVec3> = fine.surface.nodes.iter().map(|&n| rest[n as usize]).collect();
        let skin = Skin::new(on_skin, fine.surface.triangles.clone()).into_diagnostic()?;
        // The planes that are held lie on the lattice.
        let on_m = DVec3::new(0.5, 0.5, 0.0) * spacing_m + DVec3::Z * skin.bounds_m().1.z;
        let on_m = if problem.body == Body::Block { DVec3::ZERO } else { on_m };
        let sites = Sites::covering(skin.bounds_m(), spacing_m, on_m);
        let moments = integrate(&skin, &sites, &mut |_| {});
        let points: Vec<DVec3> =
            moments.iter().flat_map(|m| sites.corners(m.cell)).map(|site| sites.site_m(site)).collect();
        let held: BTreeSet<u32> = coarse.prescribed.iter().flat_map(|set| set.nodes.clone()).collect();
        let EmbeddingMesh { mesh, outside_m, .. } =
            embedding_mesh::cover(&coarse.mesh, &coarse.surface, &held, &points);
        let composite = Composite::new(&mesh);
        let free = free_axes(&composite, &held, &Surface::of(&mesh).into_diagnostic()?);
        let partition = Partition::new(sites, composite, &moments);
        let load = load::on_tets(problem.action, &fine).ok_or_else(|| miette!("{} has no load", problem.name))?;
        Ok(Self {
            coarse_tets: coarse.mesh.tets().len(),
            outside: outside_m.len(),
            near: near(&partition, &free, fine.touch_m),
            samples: sample::points(problem.body),
            reference: Reference::of(&problem)?,
            problem,
            partition,
            free,
            fine,
            load,
        })
    }

    /// The problem.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Number of coarse tets.
    pub fn coarse_tets(&self) -> usize {
        self.coarse_tets
    }

    /// What of the lattice's corners the coarse tets do not hold.
    pub fn outside(&self) -> usize {
        self.outside
    }

    /// With so many particles awake, those nearest to the touch, and points in place of cells, places in place of cells' where given.
    ///
    /// # Errors
    /// No equilibrium.
    pub fn errors(&self, active: usize, points: Option<PointsOf<'_>>, places: Option<PlacesOf>) -> Result<Errors> {
        let partition = &self.partition;
        let active: BTreeSet<u32> = self.near.iter().copied().take(active).collect();
        let level: Box<dyn FineLevel> = match points {
            None => Box::new(Patch::new(partition, &active)),
            Some(points) => Box::new(PointPatch::new(partition, &active, &points(partition, &active))),
        };
        let level = level.as_ref();
        let places_of =
            |at: DVec3| places.map_or_else(|| vec![TrilinearPoint::new(partition, at)], |places| places(partition, at));
        let mut loads_n = still(&level.at_rest(partition));
        let rest = self.fine.mesh.positions_m();
        for &(node, force_n) in &self.load.forces_n {
            for place in places_of(rest[node as usize]) {
                places::push(&place, partition, level.active(), force_n, &mut loads_n);
            }
        }
        let of_tet = vec![0; partition.residual_elements().len()];
        let materials = Materials { materials: &[self.problem.material()?], of_tet: &of_tet };
        let found = equilibrium(partition, level, &materials, &self.free, &loads_n, 1e-6).into_diagnostic()?;
        let mut x = rest.to_vec();
        for &node in &self.fine.surface.nodes {
            let value = |place: &TrilinearPoint| places::value(place, partition, level.active(), &found);
            x[node as usize] = places_of(rest[node as usize]).iter().map(value).sum();
        }
        let displacements = Probe::new(&self.fine, &self.samples).displacements_m(rest, &x);
        let field = FieldError::of(&self.samples, &displacements, &self.reference.displacements_m())
            .ok_or_else(|| miette!("the reference of {} has no field", self.problem.name))?;
        let answer = self.load.displacement_m(rest, &x) / self.reference.value - 1.0;
        Ok(Errors { answer, field, points: level.point_count(partition) })
    }
}

/// Particles that follow some free node and none with a negative weight, the nearest first.
fn near(partition: &Partition, free: &[BVec3], touch_m: DVec3) -> Vec<u32> {
    let mut near: Vec<u32> = (0..partition.particle_count() as u32).collect();
    near.retain(|&p| {
        let anchor = partition.anchor(p);
        let mut follows = anchor.nodes.iter().zip(anchor.weights).filter(|(_, w)| *w >= 1e-9);
        anchor.weights.iter().all(|&w| w > -1e-9) && follows.any(|(&n, _)| free[n as usize].all())
    });
    let distance = |p: &u32| partition.particle_m(*p).distance_squared(touch_m);
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    near
}

/// A node on an edge of the held boundary is held, too.
fn free_axes(composite: &Composite, held: &BTreeSet<u32>, surface: &Surface) -> Vec<BVec3> {
    let mut edges = BTreeSet::new();
    for triangle in (0..surface.triangles.len()).map(|t| surface.triangle_nodes(t)) {
        if triangle.iter().all(|n| held.contains(n)) {
            let [a, b, c] = triangle;
            edges.extend([[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]]);
        }
    }
    let mut free = vec![BVec3::TRUE; composite.positions_m().len()];
    for &node in held {
        free[node as usize] = BVec3::FALSE;
    }
    for tet in composite.tets() {
        for (number, [a, b]) in EDGES.into_iter().enumerate() {
            if edges.contains(&[tet[a].min(tet[b]), tet[a].max(tet[b])]) {
                free[tet[4 + number] as usize] = BVec3::FALSE;
            }
        }
    }
    free
}

/// Moves the nodes of a box at random, always the same way: inside along all axes, on a side along it, edges and corners not at all.
fn shaken(body: TetBody) -> Result<TetBody> {
    let rest = body.mesh.positions_m();
    let (low, high) = rest.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |b, p| (b.0.min(*p), b.1.max(*p)));
    let edges = || body.mesh.tets().iter().flat_map(|tet| EDGES.map(|[a, b]| [tet[a], tet[b]]));
    let length_m = |[a, b]: [u32; 2]| rest[a as usize].distance(rest[b as usize]);
    let shortest_m = edges().map(length_m).fold(f64::INFINITY, f64::min);
    let mut random = Random::new(1);
    let moved = |p: &DVec3| {
        let offset = random.vector() * (SHAKEN * shortest_m);
        let on_side = |axis: usize| (p[axis] - low[axis]).min(high[axis] - p[axis]) < 1e-9;
        let free = (0..3).filter(|&axis| !on_side(axis)).count();
        let along = |axis: usize| if free < 2 || on_side(axis) { 0.0 } else { offset[axis] };
        *p + DVec3::new(along(0), along(1), along(2))
    };
    let positions_m: Vec<DVec3> = rest.iter().map(moved).collect();
    let mesh = TetMesh::new(positions_m, body.mesh.tets().to_vec()).into_diagnostic()?;
    Ok(TetBody { mesh, ..body })
}
