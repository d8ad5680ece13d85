//! A mass-spring surface as a body of the loop: what tools touch, and what they may do to it.
//!
//! Tools touch the surface refined everywhere, coarse or not. Where an edge's middle has the level `s`, with its own node at `x_e` and its ends displaced by `u_a` and `u_b`, it is at
//! ```text
//! y_e = s x_e + (1 − s) (X_e + ½ (u_a + u_b)),   force on it: s f on its node, ½ (1 − s) f on either end
//! ```
//! so the surface that a tool feels and a viewer sees has the same triangles always, and moves without a step when it is refined.
use super::{
    SpringError, SpringModel, SpringSpec,
    calibration::{self, Calibration, CalibrationError, ConstantsTable},
    region::Constants,
    skin::SkinBoxes,
};
use crate::{
    contact::{SurfaceModuli, ToolSpec},
    hash::{Fnv, fnv},
    mesh::Surface,
    tick::EnvironmentError,
};
use glam::DVec3;
use std::{fmt::Write, ops::Range};
use thiserror::Error;

/// How the surface is refined where it is touched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refinement {
    /// Rings around the vertex that is touched; the most, where they follow the dent.
    pub rings: u32,
    /// As many rings as the dent needs: those of its touched part, and one for each edge's length of its depth ([`rings_for`]).
    pub follows_dent: bool,
    /// How long (s) a triangle takes from coarse to refined, and back. Forces step the less the longer it is.
    pub fade_s: f64,
    /// Who says where.
    pub by: Refining,
}

/// Who says where a surface is refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refining {
    /// Tools that touch it, or are about to.
    ByTools,
    /// [`super::refine_only`] alone: for experiments.
    ByHand,
}

/// What makes a body a mass-spring surface.
#[derive(Debug, Clone, PartialEq)]
pub struct MassSpringSpec {
    /// The springs. What is held is what the body's specification prescribes.
    pub springs: SpringSpec,
    /// `None`: coarse everywhere.
    pub refinement: Option<Refinement>,
    /// Constants where it is refined, over how far the vertex that a tool touches is from home; `None`: those of the springs.
    pub table: Option<ConstantsTable>,
}

/// Why no body of the loop can be made of it.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MassSpringError {
    /// The springs.
    #[error(transparent)]
    Springs(#[from] SpringError),
    /// Settings, constraints, loads or tools.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// A number outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// The table of constants.
    #[error(transparent)]
    Table(#[from] CalibrationError),
    /// Something it cannot have.
    #[error("a body of springs cannot have {what}: {instead}")]
    NotForSprings {
        /// What.
        what: &'static str,
        /// What to do.
        instead: &'static str,
    },
}

/// A mass-spring surface in the loop. Constant after load.
#[derive(Debug, Clone)]
pub struct MassSpringBody {
    model: SpringModel,
    refinement: Option<Refinement>,
    pub(super) boxes: SkinBoxes,
    /// Mean length (m) of the coarse surface's edges, its vertices at home.
    edge_m: f64,
    /// How many places each tool has about which it may be refined.
    places: Vec<usize>,
    /// About how far (m) from a tool vertices are awake, where not all are.
    awake_reach_m: f64,
    table: Option<ConstantsTable>,
    fingerprint: u64,
}

impl MassSpringBody {
    /// Checks and builds, for these tools.
    ///
    /// # Errors
    /// [`MassSpringError`].
    pub fn of(spec: MassSpringSpec, tools: &[ToolSpec]) -> Result<Self, MassSpringError> {
        let MassSpringSpec { mut springs, refinement, table } = spec;
        if let Some(Refinement { rings, fade_s, .. }) = refinement {
            let setting =
                |name, value, ok, rule| if ok { Ok(()) } else { Err(MassSpringError::Setting { name, value, rule }) };
            setting("rings", f64::from(rings), (1..=MOST_RINGS).contains(&rings), "must be 1 to 16")?;
            setting("fade_s", fade_s, fade_s > 0.0 && fade_s.is_finite(), "must be finite and larger than 0")?;
        } else {
            springs.most_refined = 0;
        }
        if refinement.is_some_and(|refinement| refinement.follows_dent) && table.is_some() {
            let what = "rings that follow the dent, with a table of constants";
            return Err(MassSpringError::NotForSprings { what, instead: "a table is for its number of rings" });
        }
        if let Some(table) = &table {
            let rings = refinement.map_or(0, |refinement| refinement.rings);
            table.fits(&springs.surface, &Calibration { coarse: springs.coarse, rings, ..table.of })?;
            // The largest: what the step has to be stable with.
            springs.fine = table.largest();
        }
        let model = SpringModel::build(springs)?;
        let lengths = model.surface().edges().iter().map(|edge| {
            let [a, b] = edge.nodes.map(|node| model.rest_m()[node as usize]);
            a.distance(b)
        });
        let edge_m = lengths.sum::<f64>() / model.surface().edges().len() as f64;
        let rings = refinement.map_or(1, |refinement| if refinement.follows_dent { 1 } else { refinement.rings });
        // The regions about two of them overlap by half.
        let places: Vec<usize> = tools.iter().map(|tool| tool.axis_sample_count(f64::from(rings) * edge_m)).collect();
        // A disc for each, of vertices with √3/2 l² each.
        let each = model.spec().most_awake as f64 / places.iter().sum::<usize>().max(1) as f64;
        let awake_reach_m = edge_m * (each * 3.0_f64.sqrt() / (2.0 * std::f64::consts::PI)).sqrt();
        let fingerprint = fingerprint(model.spec(), (refinement, &table));
        Ok(Self { model, refinement, boxes: SkinBoxes::default(), edge_m, places, awake_reach_m, table, fingerprint })
    }

    /// Its springs.
    pub fn model(&self) -> &SpringModel {
        &self.model
    }

    /// Rest positions (m) of the coarse vertices.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        &self.model.rest_m()[..self.model.vertices() as usize]
    }

    /// Hash of all that it was built from.
    pub(crate) fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// How it is refined.
    pub fn refinement(&self) -> Option<Refinement> {
        self.refinement
    }

    /// Constants where it is refined, while what tools touch is so far (m) from home.
    pub(crate) fn fine_at(&self, displacement_m: f64) -> Constants {
        self.table.as_ref().map_or(self.model.spec().fine, |table| table.at(displacement_m / self.edge_m))
    }

    /// Mean length (m) of the coarse edges.
    pub fn edge_m(&self) -> f64 {
        self.edge_m
    }

    /// The places of each tool, numbered one after another.
    pub(crate) fn places(&self) -> impl Iterator<Item = Range<usize>> {
        self.places.iter().scan(0, |next, count| {
            *next += count;
            Some(*next - count..*next)
        })
    }

    /// All of them.
    pub(crate) fn place_count(&self) -> usize {
        self.places.iter().sum()
    }

    /// About how far (m) from a tool vertices are awake, where not all are.
    pub(crate) fn awake_reach_m(&self) -> f64 {
        self.awake_reach_m
    }

    /// The coarse vertices that carry a vertex of the skin where it is coarse.
    pub(crate) fn ends(&self, vertex: u32) -> [u32; 2] {
        match vertex.checked_sub(self.model.vertices()) {
            None => [vertex; 2],
            Some(edge) => self.model.surface().edges()[edge as usize].nodes,
        }
    }

    /// Whether all coarse vertices are awake always.
    pub fn is_all_awake(&self) -> bool {
        self.model.spec().most_awake >= self.model.vertices() as usize
    }

    /// What tools touch: the surface refined everywhere, its vertices numbered as its nodes.
    pub fn skin(&self) -> Surface {
        Surface::alone(self.model.rest_m().len(), self.model.fine_triangles().to_vec())
    }

    /// Takes the skin's triangles in the order of contact's broad phase.
    pub(crate) fn cluster(&mut self, triangles: &[[u32; 3]]) {
        self.boxes = SkinBoxes::new(self.model.rest_m(), triangles);
    }

    /// What (kg) answers contact at each vertex of the skin, of the mass refined all around; nothing where it is held.
    pub(crate) fn contact_mass_kg(&self) -> Vec<f64> {
        let model = &self.model;
        let of_vertices = (0..model.vertices()).map(|v| 0.25 * model.spec().mass_kg[v as usize]);
        of_vertices.chain((0..model.surface().edges().len() as u32).map(|edge| model.edge_kg(edge))).collect()
    }

    /// Moduli of what lies behind each triangle of the skin, for contact's foundation: those of a solid one coarse edge `l` thick with the springs' stiffness across and along,
    /// ```text
    /// (2/√3) (K_m + K_h)/l
    /// ```
    /// as a vertex of a regular surface has the area `(√3/2) l²`, and springs along its edges the modulus `(2/√3) K_m` (N/m).
    pub(crate) fn moduli(&self) -> Vec<SurfaceModuli> {
        let spec = self.model.spec();
        let stiffest = |of: fn(&Constants) -> f64| of(&spec.coarse).max(of(&spec.fine));
        let sum_n_per_m = stiffest(|of| of.mesh_n_per_m) + stiffest(|of| of.home_n_per_m);
        let modulus_pa = 2.0 / 3.0_f64.sqrt() * sum_n_per_m / self.edge_m;
        vec![SurfaceModuli { p_wave_pa: modulus_pa, indentation_pa: modulus_pa }; self.model.fine_triangles().len()]
    }
}

fn fingerprint(spec: &SpringSpec, how: (Option<Refinement>, &Option<ConstantsTable>)) -> u64 {
    let SpringSpec { surface, coarse, fine, home_law, mass_kg, held, most_awake, most_refined } = spec;
    let masses = mass_kg.iter().flat_map(|mass| mass.to_bits().to_le_bytes());
    let mut hash = Fnv(fnv(calibration::fingerprint(surface), masses));
    // Writing to the hash cannot fail.
    let _ = write!(hash, "{:?}", (coarse, fine, home_law, held, most_awake, most_refined, how));
    hash.0
}

/// How many rings of edges `l` (m) hold the dent that a sphere of radius `R` (m) makes, `d` (m) deep: the radius of the cap that touches, and as far beyond as it is deep.
/// ```text
/// (√(d (2 R − d)) + d)/l,   of a sphere in over its middle (R + d)/l
/// ```
pub fn rings_for(depth_m: f64, radius_m: f64, edge_m: f64) -> f64 {
    let touched_m = if depth_m < radius_m { (depth_m * (2.0 * radius_m - depth_m)).sqrt() } else { radius_m };
    (touched_m + depth_m) / edge_m
}

/// Triangles of a regular surface, with edges `l` (m), in `n` rings about a line of length `L` (m) along its edges.
/// ```text
/// 6 n² + 4 n ⌈L/l⌉
/// ```
pub fn triangles_about(rings: u32, length_m: f64, edge_m: f64) -> usize {
    let rings = rings as usize;
    (6 * rings * rings).saturating_add((4 * rings).saturating_mul((length_m / edge_m).ceil() as usize))
}

/// More rings would be most of any surface.
pub(super) const MOST_RINGS: u32 = 16;
