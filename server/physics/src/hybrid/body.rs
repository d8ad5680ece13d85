//! A hybrid body: all that its rest state fixes.
use super::{
    cage::{self, Cage},
    cell::{HOURGLASS, MODE_WEIGHTS, RestCell},
    composite::Composite,
    metric::Masses,
    moments::{CellMoments, integrate},
    partition::Partition,
    patch::{KEPT, Materials},
    place::SkinPlace,
    sites::Sites,
    spec::{HybridError, ParticleSpec},
};
use crate::{
    fem::element::outer,
    integrate::spectrum::largest_eigenvalue,
    material::Material,
    mesh::{Surface, TetMesh, tet::EDGES},
    world::PrescribedSpec,
};
use glam::{BVec3, DMat3, DVec3};
use std::collections::BTreeSet;

/// A particle follows no coarse node with less than this.
pub(super) const NO_WEIGHT: f64 = 1e-9;

/// What a hybrid body is made of. Constant after load.
#[derive(Debug, Clone)]
pub struct Hybrid {
    pub(super) partition: Partition,
    pub(super) masses: Masses,
    pub(super) materials: Vec<Material>,
    pub(super) of_tet: Vec<u16>,
    /// Axes along which coarse nodes may move.
    pub(super) free: Vec<BVec3>,
    /// Which particles may wake: those that follow only free nodes, and lie within the coarse tets.
    pub(super) may_wake: Vec<bool>,
    /// Where the skin's vertices are.
    pub(super) places: Vec<SkinPlace>,
    /// How much faster than the fastest node or particle a vertex of the skin can be.
    pub(super) amplification: f64,
    frequency_rad_per_s: f64,
    cage: CageSummary,
}

/// A hybrid body and what of its model it changed.
#[derive(Debug)]
pub struct Built {
    /// The body.
    pub hybrid: Hybrid,
    /// The coarse mesh, its boundary moved.
    pub mesh: TetMesh,
    /// What is prescribed, with nodes in the middle of edges.
    pub prescribed: Vec<PrescribedSpec>,
}

/// What became of the coarse mesh's boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CageSummary {
    /// How far it was moved at most (m), so that the coarse tets hold the particles.
    pub moved_m: f64,
    /// Particles that they do not hold even so, which never wake.
    pub outside: usize,
}

impl Hybrid {
    /// Lays the lattice over a body. `of_tet` indexes `materials` and densities; `progress` is told the part done.
    ///
    /// # Errors
    /// A specification outside its range, or a lattice that does not fit the body.
    pub fn build(
        spec: &ParticleSpec,
        (mesh, surface): (&TetMesh, &Surface),
        prescribed: &[PrescribedSpec],
        (materials, densities_kg_per_m3): (&[Material], &[f64]),
        of_tet: &[u16],
        progress: &mut dyn FnMut(f64),
    ) -> Result<Built, HybridError> {
        spec.check()?;
        let spacing_m = spec.spacing_m;
        let sites = Sites::covering(spec.skin.bounds_m(), spacing_m, spec.lattice_through_m);
        let moments = integrate(&spec.skin, &sites, progress);
        if moments.is_empty() {
            return Err(HybridError::Nothing { spacing_m });
        }
        let Cage { mesh, moved_m, outside } = covering((mesh, surface), prescribed, &sites, &moments);
        let cage = CageSummary { moved_m, outside };
        let composite = Composite::new(&mesh);
        let prescribed = with_edges(&mesh, surface, &composite, prescribed);
        let partition = Partition::new(sites, composite, &moments);
        let masses = Masses::new(&partition, |tet| densities_kg_per_m3[of_tet[tet] as usize]);
        let mut free: Vec<BVec3> = masses.node_kg.iter().map(|&mass| BVec3::splat(mass > 0.0)).collect();
        for set in &prescribed {
            for &node in &set.nodes {
                for axis in (0..3).filter(|&axis| set.axes[axis]) {
                    free[node as usize].set(axis, false);
                }
            }
        }
        let may_wake = (0..partition.particle_count() as u32).map(|p| may_wake(&partition, &free, p)).collect();
        let places: Vec<SkinPlace> =
            spec.skin.positions_m().iter().map(|&point| SkinPlace::new(&partition, point)).collect();
        let of_places = places.iter().map(SkinPlace::amplification).fold(1.0, f64::max);
        let of_anchors = (0..partition.particle_count() as u32)
            .map(|p| partition.anchor(p).weights.iter().map(|w| w.abs()).sum())
            .fold(1.0, f64::max);
        let frequency = cells_frequency_rad_per_s(&partition, of_tet, materials, densities_kg_per_m3);
        let hybrid = Self {
            masses,
            materials: materials.to_vec(),
            of_tet: of_tet.to_vec(),
            free,
            may_wake,
            places,
            amplification: of_places * of_anchors,
            frequency_rad_per_s: frequency / (1.0 - KEPT).sqrt(),
            cage,
            partition,
        };
        Ok(Built { hybrid, mesh, prescribed })
    }

    /// The lattice on the coarse tets.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// Masses while all sleep.
    pub fn masses(&self) -> &Masses {
        &self.masses
    }

    /// Materials of the coarse tets.
    pub fn materials(&self) -> Materials<'_> {
        Materials { materials: &self.materials, of_tet: &self.of_tet }
    }

    /// Number of coarse nodes: the first of a state's positions.
    pub fn node_count(&self) -> usize {
        self.free.len()
    }

    /// Axes along which coarse nodes may move.
    pub fn free(&self) -> &[BVec3] {
        &self.free
    }

    /// Whether a particle may wake.
    pub fn may_wake(&self, particle: u32) -> bool {
        self.may_wake.get(particle as usize).copied().unwrap_or(false)
    }

    /// What became of the coarse mesh's boundary.
    pub fn cage(&self) -> CageSummary {
        self.cage
    }

    /// Bound (rad/s) of the body's natural frequencies at rest, whichever particles are awake.
    ///
    /// No assembly of cells is faster than the fastest of them with its share of the particles' masses, `ρV_c/8` each: by Rayleigh's quotient. The
    /// full cell's bound is reached, `ω² = 4 (3λ + 2µ)/(ρh²)`, where neighbours swell and shrink in turn. No set of active particles is
    /// faster than all of them, over √(1 − ε) (`docs/adr/hybrid.md`).
    pub fn frequency_rad_per_s(&self) -> f64 {
        self.frequency_rad_per_s
    }
}

/// Nodes in the middle of an edge whose surface is held along an axis are held along it, too: the sets with them.
fn with_edges(
    mesh: &TetMesh,
    surface: &Surface,
    composite: &Composite,
    prescribed: &[PrescribedSpec],
) -> Vec<PrescribedSpec> {
    let extended = |set: &PrescribedSpec| {
        let held: BTreeSet<u32> = set.nodes.iter().copied().collect();
        let mut edges = BTreeSet::new();
        for triangle in (0..surface.triangles.len()).map(|t| surface.triangle_nodes(t)) {
            if triangle.iter().all(|n| held.contains(n)) {
                let [a, b, c] = triangle;
                edges.extend([[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]]);
            }
        }
        let mut middles = BTreeSet::new();
        for (corners, nodes) in mesh.tets().iter().zip(composite.tets()) {
            for (number, [a, b]) in EDGES.into_iter().enumerate() {
                let edge = [corners[a].min(corners[b]), corners[a].max(corners[b])];
                if edges.contains(&edge) {
                    middles.insert(nodes[4 + number]);
                }
            }
        }
        PrescribedSpec { nodes: set.nodes.iter().copied().chain(middles).collect(), ..set.clone() }
    };
    prescribed.iter().map(extended).collect()
}

fn covering(
    (mesh, surface): (&TetMesh, &Surface),
    prescribed: &[PrescribedSpec],
    sites: &Sites,
    moments: &[CellMoments],
) -> Cage {
    let corners: BTreeSet<usize> = moments.iter().flat_map(|m| sites.corners(m.cell)).collect();
    let points: Vec<DVec3> = corners.into_iter().map(|site| sites.site_m(site)).collect();
    let held: BTreeSet<u32> = prescribed.iter().flat_map(|set| &set.nodes).copied().collect();
    cage::cover(mesh, surface, &held, &points)
}

fn may_wake(partition: &Partition, free: &[BVec3], particle: u32) -> bool {
    let anchor = partition.anchor(particle);
    anchor.nodes.iter().zip(anchor.weights).all(|(&node, weight)| {
        weight > -NO_WEIGHT && (weight < NO_WEIGHT || free[node as usize] == BVec3::TRUE)
    })
}

/// `max_c ω_c` with `ω_c² ≤ 8/ρ ((3λ⁺ + 2µ) λ_max(Σ_p b_p b_pᵀ) + κ/V Σ_k w_k Σ_p γ_kp²)`.
fn cells_frequency_rad_per_s(
    partition: &Partition,
    of_tet: &[u16],
    materials: &[Material],
    densities_kg_per_m3: &[f64],
) -> f64 {
    let spacing_m = partition.sites().spacing_m();
    // Of what a cell's shape contributes, only the largest of each material counts.
    let mut largest = vec![[0.0_f64; 2]; materials.len()];
    for (number, cell) in partition.cells().iter().enumerate() {
        let rest = RestCell::new(spacing_m, 1.0, &partition.moments(number));
        let gram = rest.gradients_per_m.iter().fold(DMat3::ZERO, |sum, b| sum + outer(*b, *b));
        let modes = rest.modes.iter().zip(MODE_WEIGHTS);
        let modes: f64 = modes.map(|(mode, w)| w * mode.iter().map(|g| g * g).sum::<f64>()).fold(0.0, f64::max);
        let of = &mut largest[of_tet[cell.tet as usize] as usize];
        *of = [of[0].max(largest_eigenvalue(&gram)), of[1].max(modes)];
    }
    let hourglass_per_m2 = HOURGLASS * 4.0 / 3.0 / (spacing_m * spacing_m);
    let squares = largest.iter().zip(materials).zip(densities_kg_per_m3).map(|(([gram, modes], material), density)| {
        let (lambda_pa, mu_pa) = (material.lame.lambda_pa.max(0.0), material.lame.mu_pa);
        8.0 / density * ((3.0 * lambda_pa + 2.0 * mu_pa) * gram + hourglass_per_m2 * mu_pa * modes)
    });
    squares.fold(0.0, f64::max).sqrt()
}
