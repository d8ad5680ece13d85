//! Hybrid bodies as the server runs them: coarse tets, and particles that tools and loads wake.
use super::{Method, Pace, Running, driven::Driven, subject::Tool};
use crate::problems::{
    Action, Problem,
    body::{Body, TetBody},
    load::{self, NodalLoad},
    sample::{self, Probe},
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result, miette};
use palpate_physics::{
    BodySpec, LoadSpec, Model, ModelSpec, Settings,
    bodies::hybrid::{HybridSpec, ParticleSpec, Skin, Waking},
};

/// So many particles awake.
pub(super) struct Hybrid {
    name: String,
    what: String,
    lattice: Lattice,
    active: usize,
}

/// Cells of the lattice.
#[derive(Debug, Clone, Copy)]
enum Lattice {
    /// All of one size.
    Same,
    /// The same beneath a smooth skin.
    Smooth,
    /// Beneath the first layer of twice the size.
    Doubled,
    /// In the first layer, and wherever eight make no whole one, of half the size; the skin is as fine.
    Halved,
}

/// What a body's particles are made of.
struct Fineness {
    /// Spacing of the lattice (m).
    spacing_m: f64,
    fine_depth_m: Option<f64>,
    /// Resolution of the mesh whose boundary is the skin.
    skin: u32,
}

impl Hybrid {
    pub(super) fn variants() -> Vec<Self> {
        let of = |(lattice, active): (Lattice, usize)| {
            let (name, cells) = match lattice {
                Lattice::Same => ("", "cells"),
                Lattice::Smooth => (" smooth skin", "cells, a skin that follows means of particles"),
                Lattice::Doubled => (" doubled below", "cells, deeper down twice as large"),
                Lattice::Halved => (" halved above", "cells, at the surface half as large"),
            };
            Self {
                name: format!("hybrid {active} awake{name}"),
                what: format!(
                    "Composite coarse tets and {active} active particles at most on a lattice ({cells}), as tools and loads wake them, explicit leapfrog, forces in f32."
                ),
                lattice,
                active,
            }
        };
        let same = [50, 200, 600, 1400].map(|active| (Lattice::Same, active));
        let lattices = [Lattice::Smooth, Lattice::Doubled, Lattice::Halved];
        let others = [200, 600].into_iter().flat_map(|n| lattices.map(|lattice| (lattice, n)));
        same.into_iter().chain(others).map(of).collect()
    }

    fn fineness(&self, problem: &Problem) -> Option<Fineness> {
        // Of the block cells along an edge, of the ventricle tets.
        let (spacing_m, skin, finer) = match problem.body {
            Body::Block => (2.5e-3, 32, 64),
            Body::Ventricle(_) => (3.2e-3, 150_000, 1_200_000),
            Body::SmallVentricle => (0.9e-3, 150_000, 1_200_000),
            Body::Octant | Body::Beam { .. } => return None,
        };
        // Triangles as large as what a sphere touches are as a flat surface to it, whose middle lies too deep.
        let is_round = problem.body != Body::Block && matches!(problem.action, Action::Sphere { .. });
        let skin = if is_round { finer } else { skin };
        Some(match self.lattice {
            Lattice::Same | Lattice::Smooth => Fineness { spacing_m, fine_depth_m: None, skin },
            Lattice::Doubled => Fineness { spacing_m, fine_depth_m: Some(spacing_m), skin },
            Lattice::Halved => {
                Fineness { spacing_m: 0.5 * spacing_m, fine_depth_m: Some(0.5 * spacing_m), skin: finer }
            }
        })
    }
}

impl Method for Hybrid {
    fn name(&self) -> &str {
        &self.name
    }

    fn what(&self) -> &str {
        &self.what
    }

    fn resolutions(&self, body: Body, full: bool) -> Vec<u32> {
        match (body, full) {
            (Body::Block, false) => vec![4],
            (Body::Block, true) => vec![4, 8],
            (Body::Ventricle(_) | Body::SmallVentricle, false) => vec![188, 400],
            (Body::Ventricle(_) | Body::SmallVentricle, true) => vec![188, 300, 400, 800],
            (Body::Octant | Body::Beam { .. }, _) => vec![],
        }
    }

    fn build(&self, problem: &Problem, resolution: u32, pace: &Pace) -> Result<Box<dyn Running>> {
        let HybridSubject { model, tool, load, fine } = self.subject(problem, resolution, pace.damping_per_s)?;
        let probe = Probe::new(&fine, &sample::points(problem.body));
        Ok(Box::new(Pressed::new(model, tool, load, (fine, probe))))
    }
}

/// A hybrid body, what acts on it, and the fine mesh whose boundary is its skin.
struct HybridSubject {
    model: Model,
    tool: Option<Tool>,
    load: Option<NodalLoad>,
    fine: TetBody,
}

impl Hybrid {
    fn subject(&self, problem: &Problem, resolution: u32, mass_damping_per_s: f64) -> Result<HybridSubject> {
        let Fineness { spacing_m, fine_depth_m, skin } =
            self.fineness(problem).ok_or_else(|| miette!("the {} has no particles", problem.body.name()))?;
        let (coarse, fine) = (problem.body.tets(resolution)?, problem.body.tets(skin)?);
        let settings = Settings { mass_damping_per_s, ..Settings::for_particles() };
        let smooth_skin = matches!(self.lattice, Lattice::Smooth);
        let particles = ParticleSpec {
            fine_depth_m,
            smooth_skin,
            waking: Waking::in_half_ball(spacing_m, fine_depth_m, self.active),
            ..particles(problem.body, &fine, spacing_m, self.active)?
        };
        let hybrid = HybridSpec { coarse: super::subject::solid(problem.material()?, &coarse), particles };
        let mut spec = ModelSpec {
            body: BodySpec::Hybrid(hybrid),
            ..super::subject::spec(problem.material()?, &coarse, settings)
        };
        let load = load::on_tets(problem.action, &fine);
        let vertex = |node: u32| fine.surface.vertex_of_node[node as usize];
        let on_skin = |load: &NodalLoad| load.forces_n.iter().map(|&(node, force)| (vertex(node), force)).collect();
        spec.loads = load.iter().map(|load| LoadSpec::NodalForces(on_skin(load))).collect();
        let tool = match problem.action {
            Action::Sphere { radius_m, depth_m } => Some(Tool {
                touch_m: fine.first_touch_m(radius_m),
                way_m: fine.normal * -depth_m,
                normal: fine.normal,
                radius_m,
            }),
            _ => None,
        };
        spec.tools = tool.iter().map(Tool::spec).collect();
        Ok(HybridSubject { model: Model::build(spec).into_diagnostic()?, tool, load, fine })
    }
}

/// Returns a problem's body with particles, of which none is awake.
pub(crate) fn asleep(problem: &Problem, resolution: u32) -> Result<Model> {
    let hybrid = Hybrid::variants().into_iter().next().ok_or_else(|| miette!("there is no method with particles"))?;
    Ok(hybrid.subject(problem, resolution, 0.0)?.model)
}

/// Particles in a body whose skin is the boundary of a fine mesh, woken by hand.
pub(crate) fn particles(body: Body, fine: &TetBody, spacing_m: f64, most_active: usize) -> Result<ParticleSpec> {
    let rest = fine.mesh.positions_m();
    let on_skin = fine.surface.nodes.iter().map(|&node| rest[node as usize]).collect();
    let skin = Skin::new(on_skin, fine.surface.triangles.clone()).into_diagnostic()?;
    // The planes that are held lie on the lattice.
    let off_axis = DVec3::new(0.5, 0.5, 0.0) * spacing_m + DVec3::Z * skin.bounds_m().1.z;
    let lattice_through_m = if body == Body::Block { DVec3::ZERO } else { off_axis };
    Ok(ParticleSpec {
        skin,
        spacing_m,
        fine_depth_m: None,
        smooth_skin: false,
        lattice_through_m,
        most_active,
        waking: Waking::ByHand,
    })
}

/// The particles nearest to a point that may wake.
pub(crate) fn nearest(model: &Model, point_m: DVec3, count: usize) -> Vec<u32> {
    let Some(body) = model.body().as_hybrid() else { return vec![] };
    let partition = body.partition();
    let mut near: Vec<u32> = (0..partition.particle_count() as u32).filter(|&p| body.may_wake(p)).collect();
    let distance = |p: &u32| partition.particle_m(*p).distance_squared(point_m);
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    near.truncate(count);
    near
}

/// A body whose surface is the boundary of a fine mesh.
pub(super) struct Pressed {
    model: Model,
    driven: Driven,
    tool: Option<Tool>,
    load: Option<NodalLoad>,
    fine: TetBody,
    probe: Probe,
}

impl Pressed {
    /// At rest; with the fine mesh and where it is looked at.
    pub(super) fn new(
        model: Model,
        tool: Option<Tool>,
        load: Option<NodalLoad>,
        (fine, probe): (TetBody, Probe),
    ) -> Self {
        Self { driven: Driven::at_rest(&model, tool.as_ref()), model, tool, load, fine, probe }
    }

    /// Of a seed body that no tool touches, but a load: its particles under this triangle are awake.
    pub(super) fn touch(&mut self, triangle: Option<u32>) {
        if let (Some(seed), true) = (self.driven.state.body.as_seed_mut(), self.load.is_some()) {
            seed.touched = triangle;
        }
    }

    /// Positions (m) of the fine mesh's nodes; those within stay at rest.
    fn positions_m(&self) -> Vec<DVec3> {
        let (mut x, mut skin) = (self.fine.mesh.positions_m().to_vec(), Vec::new());
        self.model.surface_positions_m(&self.driven.state, &mut skin);
        for (&node, position) in self.fine.surface.nodes.iter().zip(skin) {
            x[node as usize] = position;
        }
        x
    }
}

impl Running for Pressed {
    fn tick(&mut self, fraction: f64) {
        self.driven.tick(&self.model, self.tool.as_ref(), fraction);
    }

    fn answer(&self) -> f64 {
        match (&self.tool, &self.load) {
            (Some(tool), _) => self.driven.tool_force_n().dot(tool.normal),
            (None, Some(load)) => load.displacement_m(self.fine.mesh.positions_m(), &self.positions_m()),
            (None, None) => 0.0,
        }
    }

    fn displacements_m(&self) -> Vec<DVec3> {
        self.probe.displacements_m(self.fine.mesh.positions_m(), &self.positions_m())
    }

    fn energy_error(&self) -> Option<f64> {
        if self.model.body().as_seed().is_some() {
            return None;
        }
        self.driven.energy_error(&self.model)
    }

    fn size(&self) -> [usize; 3] {
        let awake = self.driven.state.body.as_seed().map_or(0, |_| self.model.body().most_awake_particles());
        [
            self.model.body().tets().map_or(0, |mesh| mesh.tets().len()),
            self.driven.state.mechanical.x.len() + awake,
            self.model.substeps() as usize,
        ]
    }

    fn failure(&self) -> Option<String> {
        self.driven.failure()
    }
}
