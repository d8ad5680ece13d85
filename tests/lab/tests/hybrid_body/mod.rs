//! A hybrid body at rest under a load, against the lab's references.
#![allow(clippy::unwrap_used)] // helpers of tests
use glam::{BVec3, DVec3};
use palpate_lab::{
    problems::{
        self, Problem,
        body::Body,
        load,
        sample::{self, FieldError, Probe},
    },
    references::Reference,
};
use palpate_physics::{
    Surface,
    hybrid::{
        Skin,
        cage::{self, Cage},
        composite::Composite,
        equilibrium::equilibrium,
        moments::integrate,
        partition::Partition,
        patch::{Field, Materials, Patch},
        place::Place,
        points::Points,
        sites::Sites,
    },
};
use std::collections::BTreeSet;

/// A hybrid body whose skin is the boundary of a fine mesh.
pub(crate) struct Case {
    /// What is said of it.
    pub(crate) name: String,
    pub(crate) coarse_tets: u32,
    pub(crate) skin_tets: u32,
    pub(crate) spacing_m: f64,
    /// Active particles: those nearest to the touch.
    pub(crate) active: usize,
    /// What integrates the fine level in place of cells.
    pub(crate) points: Option<MakePoints>,
    /// What points of the skin move with, in place of the particles of their cell.
    pub(crate) places: Option<MakePlaces>,
}

/// Points over the active particles.
pub(crate) type MakePoints = Box<dyn Fn(&Partition, &BTreeSet<u32>) -> Points>;
/// What a point (m) moves with: the sum of these.
pub(crate) type MakePlaces = fn(&Partition, DVec3) -> Vec<Place>;

/// Relative error of the answer, and of the field in L2.
pub(crate) fn error(problem: &Problem, case: &Case) -> (f64, f64) {
    let coarse = problem.body.tets(case.coarse_tets).unwrap();
    let fine = problem.body.tets(case.skin_tets).unwrap();
    let rest = fine.mesh.positions_m();
    let on_skin: Vec<DVec3> = fine.surface.nodes.iter().map(|&n| rest[n as usize]).collect();
    let skin = Skin::new(on_skin, fine.surface.triangles.clone()).unwrap();
    // The planes that are held lie on the lattice.
    let on_m = DVec3::new(0.5, 0.5, 0.0) * case.spacing_m + DVec3::Z * skin.bounds_m().1.z;
    let on_m = if problem.body == Body::Block { DVec3::ZERO } else { on_m };
    let sites = Sites::covering(skin.bounds_m(), case.spacing_m, on_m);
    let moments = integrate(&skin, &sites, &mut |_| {});
    let points: Vec<DVec3> =
        moments.iter().flat_map(|m| sites.corners(m.cell)).map(|site| sites.site_m(site)).collect();
    let held: BTreeSet<u32> = coarse.prescribed.iter().flat_map(|set| set.nodes.clone()).collect();
    let Cage { mesh, moved_m, outside } = cage::cover(&coarse.mesh, &coarse.surface, &held, &points);
    let composite = Composite::new(&mesh);
    let free = free_axes(&composite, &held, &Surface::of(&mesh).unwrap());
    let partition = Partition::new(sites, composite, &moments);
    let mut near: Vec<u32> = (0..partition.particle_count() as u32).collect();
    near.retain(|&p| {
        let anchor = partition.anchor(p);
        let mut follows = anchor.nodes.iter().zip(anchor.weights).filter(|(_, w)| *w >= 1e-9);
        anchor.weights.iter().all(|&w| w > -1e-9) && follows.any(|(&n, _)| free[n as usize].all())
    });
    let distance = |p: &u32| partition.particle_m(*p).distance_squared(fine.touch_m);
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    let active = near.into_iter().take(case.active).collect();
    let patch = match &case.points {
        None => Patch::new(&partition, &active),
        Some(points) => Patch::with_points(&partition, &active, &points(&partition, &active)),
    };
    let at_rest = patch.at_rest(&partition);
    let load = load::on_tets(problem.action, &fine).unwrap();
    let places = |at: DVec3| match case.places {
        None => vec![Place::new(&partition, at)],
        Some(places) => places(&partition, at),
    };
    let zero = |list: &[DVec3]| vec![DVec3::ZERO; list.len()];
    let mut loads_n = Field { nodes: zero(&at_rest.nodes), particles: zero(&at_rest.particles) };
    for &(node, force_n) in &load.forces_n {
        for place in places(rest[node as usize]) {
            place.push(&partition, &patch, force_n, &mut loads_n);
        }
    }
    let material = problem.material().unwrap();
    let of_tet = vec![0; partition.shares().len()];
    let materials = Materials { materials: &[material], of_tet: &of_tet };
    let found = equilibrium(&partition, &patch, &materials, &free, &loads_n, 1e-6).unwrap();
    let mut x = rest.to_vec();
    for &node in &fine.surface.nodes {
        x[node as usize] = places(rest[node as usize]).iter().map(|p| p.of(&partition, &patch, &found)).sum();
    }
    let reference = Reference::of(problem).unwrap();
    let answer = load.displacement_m(rest, &x) / reference.value - 1.0;
    let samples = sample::points(problem.body);
    let displacements = Probe::new(&fine, &samples).displacements_m(rest, &x);
    let field = FieldError::of(&samples, &displacements, &reference.displacements_m()).unwrap();
    println!(
        "{}, {}: {} coarse tets (boundary moved by up to {:.1} mm, {outside} corners outside), {} particles, {} active, {} cells or points: \
         answer {:+.1} %, field {:.1} %",
        case.name,
        problem.name,
        coarse.mesh.tets().len(),
        moved_m * 1e3,
        partition.particle_count(),
        patch.active().len(),
        patch.cell_count(),
        100.0 * answer,
        100.0 * field.l2
    );
    (answer, field.l2)
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
        for (number, [a, b]) in palpate_physics::mesh::tet::EDGES.into_iter().enumerate() {
            if edges.contains(&[tet[a].min(tet[b]), tet[a].max(tet[b])]) {
                free[tet[4 + number] as usize] = BVec3::FALSE;
            }
        }
    }
    free
}

pub(crate) fn problem(name: &str) -> Problem {
    problems::all().into_iter().find(|p| p.name == name).unwrap()
}
