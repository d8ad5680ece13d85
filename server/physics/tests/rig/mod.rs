//! A body with its state and buffers, driven tick by tick: what the tests of contact, energy and snapshots share.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::expect_used, clippy::unwrap_used)]
use glam::DVec3;
use palpate_physics::{
    BodySpec, Model, ModelSpec, PointForce, Precision, PrescribedSpec, Region, Scratch, Settings, Solid, State,
    StepReport, Surface, TetMesh, TickInput,
    bodies::{
        hybrid::{HybridSpec, ParticleSpec, Skin, Waking},
        mass_spring::MassSpringSpec,
    },
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    material::{Lame, Law, Material, Viscosity},
    world::wake_only,
};

#[derive(Clone)]
pub struct Rig {
    pub spec: ModelSpec,
    pub model: Model,
    pub state: State,
    pub scratch: Scratch,
}

/// What a tick is given; what is left empty stands still.
#[derive(Default)]
pub struct Drive {
    pub tools: Vec<ToolTarget>,
    pub load_factors: Vec<f64>,
    pub prescribed: Vec<DVec3>,
    pub point_forces: Vec<PointForce>,
}

impl Rig {
    pub fn new(spec: ModelSpec) -> Self {
        let model = Model::build(spec.clone()).unwrap();
        let (state, scratch) = (State::at_rest(&model), Scratch::new(&model));
        Self { spec, model, state, scratch }
    }

    /// Inputs that hold everything where it is.
    pub fn still(&self) -> Drive {
        Drive {
            tools: self.state.mechanical.tools.iter().map(|t| at(t.target.position_m)).collect(),
            load_factors: vec![0.0; self.model.loads().len()],
            prescribed: vec![DVec3::ZERO; self.model.prescribed().len()],
            point_forces: Vec::new(),
        }
    }

    pub fn tick(&mut self, drive: &Drive) -> StepReport {
        let input = TickInput {
            tools: &drive.tools,
            load_factors: &drive.load_factors,
            prescribed_displacements_m: &drive.prescribed,
            point_forces: &drive.point_forces,
        };
        palpate_physics::step(&self.model, &mut self.state, &mut self.scratch, &input)
    }

    /// One tick with the only tool's device at a position.
    pub fn tick_at(&mut self, position_m: DVec3) -> StepReport {
        let drive = Drive { tools: vec![at(position_m)], ..self.still() };
        self.tick(&drive)
    }
}

pub fn at(position_m: DVec3) -> ToolTarget {
    ToolTarget::at(position_m)
}

pub fn material(law: Law, young_modulus_pa: f64, poisson_ratio: f64) -> Material {
    let lame = Lame::from_young_poisson(young_modulus_pa, poisson_ratio).unwrap();
    Material { law, lame, viscosity: Viscosity::default(), crushing_pa: 0.0 }
}

/// One material, 1000 kg/m³, f64, nothing held or loaded.
pub fn body(mesh: TetMesh, material: Material) -> ModelSpec {
    let tets = mesh.tets().len();
    ModelSpec {
        body: BodySpec::Tet(
            Solid {
                mesh,
                regions: vec![Region { name: "all".into(), material, density_kg_per_m3: 1000.0 }],
                tet_region: vec![0; tets],
            }
            .into(),
        ),
        prescribed: Vec::new(),
        loads: Vec::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: Vec::new(),
        settings: Settings { precision: Precision::Double, ..Settings::default() },
    }
}

pub fn sphere(radius_m: f64, start_position_m: DVec3, coupling: Coupling) -> ToolSpec {
    ToolSpec {
        name: "sphere".into(),
        shape: ToolShape::Sphere,
        radius_m,
        coupling,
        friction_coefficient: 0.0,
        start_position_m,
    }
}

/// Nodes that satisfy a condition on their rest position.
pub fn nodes_where(mesh: &TetMesh, wanted: impl Fn(DVec3) -> bool) -> Vec<u32> {
    (0..mesh.positions_m().len() as u32).filter(|&n| wanted(mesh.positions_m()[n as usize])).collect()
}

pub fn hold(name: &str, nodes: Vec<u32>, axes: [bool; 3]) -> PrescribedSpec {
    PrescribedSpec { name: name.into(), nodes, axes, is_fixed: false }
}

/// A block of `2a × 2a × a` whose upper face has the origin in its middle, a stable neo-Hookean solid of 10 kPa: 24 n³ coarse tets, and particles as
/// far apart as `cells` to the side `a` says, of which `most_active` may be awake.
pub fn hybrid_block(
    (a_m, n, cells): (f64, usize, usize),
    poisson_ratio: f64,
    most_active: usize,
    waking: Waking,
) -> ModelSpec {
    let block = |cells: usize| {
        let side = even(-a_m, a_m, 2 * cells);
        bricks(&side, &side, &even(-a_m, 0.0, cells))
    };
    let fine = block(cells);
    let surface = Surface::of(&fine).unwrap();
    let positions = surface.nodes.iter().map(|&n| fine.positions_m()[n as usize]).collect();
    let spec = body(block(n), material(Law::StableNeoHookean, 10e3, poisson_ratio));
    with_particles(
        spec,
        ParticleSpec {
            skin: Skin::new(positions, surface.triangles).unwrap(),
            spacing_m: a_m / cells as f64,
            fine_depth_m: None,
            smooth_skin: false,
            lattice_through_m: DVec3::ZERO,
            most_active,
            waking,
        },
    )
}

/// The tets of a body, of whatever level.
pub fn solid_mut(spec: &mut ModelSpec) -> &mut Solid {
    spec.body.solid_mut().unwrap()
}

/// The mesh of a body's tets.
pub fn mesh_of(spec: &ModelSpec) -> &TetMesh {
    &spec.body.solid().unwrap().mesh
}

/// Makes tets the coarse level of a hybrid body.
pub fn with_particles(spec: ModelSpec, particles: ParticleSpec) -> ModelSpec {
    let coarse = spec.body.solid().unwrap().clone();
    ModelSpec { body: BodySpec::Hybrid(HybridSpec { coarse, particles }), ..spec }
}

/// The particles of a hybrid body.
pub fn particles(spec: &ModelSpec) -> &ParticleSpec {
    let BodySpec::Hybrid(hybrid) = &spec.body else { panic!("no hybrid body") };
    &hybrid.particles
}

/// The particles of a hybrid body.
pub fn particles_mut(spec: &mut ModelSpec) -> &mut ParticleSpec {
    let BodySpec::Hybrid(hybrid) = &mut spec.body else { panic!("no hybrid body") };
    &mut hybrid.particles
}

/// What a mass-spring surface is made from.
pub fn springs_mut(spec: &mut ModelSpec) -> &mut MassSpringSpec {
    let BodySpec::MassSpring(springs) = &mut spec.body else { panic!("no springs") };
    springs
}

/// Holds the lowest nodes of a body.
pub fn held_below(mut spec: ModelSpec) -> ModelSpec {
    let low_m = mesh_of(&spec).positions_m().iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    spec.prescribed = vec![hold("bottom", nodes_where(mesh_of(&spec), |p| p.z < low_m + 1e-4), [true; 3])];
    spec
}

/// A sphere above a weighing block of 40 × 40 × 20 mm in 24 coarse tets, particles 2.5 mm apart, its lower face held.
pub fn pressed_block(precision: Precision, fine_depth_m: Option<f64>) -> ModelSpec {
    let mut spec = held_below(hybrid_block((0.02, 1, 8), 0.45, 400, Waking::ByHand));
    particles_mut(&mut spec).fine_depth_m = fine_depth_m;
    spec.settings = Settings { precision, mass_damping_per_s: 20.0, ..spec.settings };
    spec.tools = vec![sphere(6e-3, DVec3::Z * 7e-3, Coupling::Rigid)];
    spec.tools[0].friction_coefficient = 0.3;
    spec.gravity_m_per_s2 = DVec3::Z * -9.81;
    spec
}

/// The same body with a skin that follows means of particles.
pub fn smooth(mut spec: ModelSpec) -> ModelSpec {
    particles_mut(&mut spec).smooth_skin = true;
    spec
}

/// Particles within a distance of a point, at rest.
pub fn near(rig: &Rig, point: DVec3, distance_m: f64) -> Vec<u32> {
    let partition = rig.model.body().as_hybrid().unwrap().partition();
    (0..partition.particle_count() as u32).filter(|&p| partition.particle_m(p).distance(point) < distance_m).collect()
}

/// Wakes the particles nearest to the origin.
pub fn wake_nearest(rig: &mut Rig, count: usize) {
    let partition = rig.model.body().as_hybrid().unwrap().partition();
    let mut near: Vec<u32> = (0..partition.particle_count() as u32).collect();
    let distance_sq = |particle: u32| partition.particle_m(particle).length_squared();
    near.sort_by(|&a, &b| distance_sq(a).total_cmp(&distance_sq(b)));
    near.truncate(count);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, near);
}

/// Evenly spaced coordinates.
pub fn even(from_m: f64, to_m: f64, cells: usize) -> Vec<f64> {
    (0..=cells).map(|i| from_m + (to_m - from_m) * i as f64 / cells as f64).collect()
}

/// Coordinates from 0: cells of `h_m` up to `fine_m`, then growing by `growth` to exactly `to_m`.
pub fn graded(h_m: f64, fine_m: f64, growth: f64, to_m: f64) -> Vec<f64> {
    let cells = (fine_m / h_m).round() as usize;
    let mut coordinates = even(0.0, h_m * cells as f64, cells);
    let (mut size, mut last) = (h_m, h_m * cells as f64);
    while last + 1.5 * size * growth < to_m {
        size *= growth;
        last += size;
        coordinates.push(last);
    }
    coordinates.push(to_m);
    coordinates
}

/// A box of bricks between the given coordinates, six tets each, neighbours mirrored so that no direction is preferred.
pub fn bricks(xs: &[f64], ys: &[f64], zs: &[f64]) -> TetMesh {
    let (nx, ny) = (xs.len(), ys.len());
    let id = |c: [usize; 3]| (c[0] + nx * (c[1] + ny * c[2])) as u32;
    let mut positions = Vec::new();
    for &z in zs {
        for &y in ys {
            positions.extend(xs.iter().map(|&x| DVec3::new(x, y, z)));
        }
    }
    let mut tets = Vec::new();
    for k in 0..zs.len() - 1 {
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                // Kuhn's six tets around the diagonal; odd cells are mirrored, which keeps shared faces alike.
                let cell = [i, j, k];
                let corner = |c: [usize; 3]| id(std::array::from_fn(|a| cell[a] + (c[a] ^ (cell[a] & 1))));
                for path in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                    let mut c = [0; 3];
                    let mut tet = [corner(c); 4];
                    for (step, axis) in path.into_iter().enumerate() {
                        c[axis] = 1;
                        tet[step + 1] = corner(c);
                    }
                    tets.push(oriented(tet, &positions));
                }
            }
        }
    }
    TetMesh::new(positions, tets).unwrap()
}

fn oriented(mut tet: [u32; 4], positions: &[DVec3]) -> [u32; 4] {
    let [a, b, c, d] = tet.map(|n| positions[n as usize]);
    if (b - a).cross(c - a).dot(d - a) < 0.0 {
        tet.swap(2, 3);
    }
    tet
}
