//! A mass-spring surface as a body of the loop: what tools touch, and how it is refined.
//!
//! Tools touch the surface refined everywhere, whatever its levels. Where an edge's middle has the level `s`, its own
//! node is at `x_e` and its ends are displaced by `u_a` and `u_b`, the middle is at
//! ```text
//! y_e = s x_e + (1 − s) (X_e + ½ (u_a + u_b)),   force on it: s f on its node, ½ (1 − s) f on either end
//! ```
//! so that the surface that a tool feels and a viewer sees always has the same triangles, and moves without a step when
//! it is refined.
use super::{
    SpringError, SpringModel, SpringSpec,
    calibration::{self, Calibration, CalibrationError, ConstantsTable},
    region::Constants,
    skin::SkinBoxes,
};
use crate::{
    contact::{SurfaceModuli, ToolSpec},
    hash::{FirstNames, Fnv, fnv},
    mesh::Surface,
    tick::EnvironmentError,
};
use glam::DVec3;
use std::{fmt::Write, ops::Range};
use thiserror::Error;

/// How the surface is refined where it is touched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refinement {
    /// Number of rings around the touched vertex; the largest number, where rings follow the dent.
    pub rings: u32,
    /// Whether there are only as many rings as the dent needs: those under its touched part, and one for each edge's
    /// length of its depth ([`rings_for`]).
    pub follows_dent: bool,
    /// Time (s) that a triangle takes from coarse to refined, and back. The longer it is, the less forces step.
    pub blend_s: f64,
    /// What determines where the surface is refined.
    pub by: Refining,
}

/// What determines where a surface is refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refining {
    /// The surface is refined where tools touch it or are about to.
    ByTools,
    /// The surface is refined where `world::refine_only` says, for experiments.
    ByHand,
}

/// What makes a body a mass-spring surface.
#[derive(Debug, Clone, PartialEq)]
pub struct MassSpringSpec {
    /// The springs. Vertices are held where the body's specification prescribes their displacement.
    pub springs: SpringSpec,
    /// How the surface is refined; `None` where it stays coarse.
    pub refinement: Option<Refinement>,
    /// Constants of the refined surface over the displacement of the touched vertex; `None` where they are constant.
    pub table: Option<ConstantsTable>,
}

/// Why no body of the loop can be made from a specification.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MassSpringError {
    /// The springs are wrong.
    #[error(transparent)]
    Springs(#[from] SpringError),
    /// Settings, constraints, loads or tools are wrong.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// A number is outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name of the number.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// The table of constants is wrong.
    #[error(transparent)]
    Table(#[from] CalibrationError),
    /// A body of springs cannot have something.
    #[error("a body of springs cannot have {what}: {instead}")]
    NotForSprings {
        /// What it cannot have.
        what: &'static str,
        /// What to do instead.
        instead: &'static str,
    },
}

/// A mass-spring surface in the loop. It does not change after it is loaded.
#[derive(Debug, Clone)]
pub struct MassSpringBody {
    model: SpringModel,
    refinement: Option<Refinement>,
    pub(super) boxes: SkinBoxes,
    /// Mean length (m) of the coarse surface's edges at rest.
    edge_m: f64,
    /// Number of samples along each tool's axis; the surface may be refined about each.
    axis_samples: Vec<usize>,
    /// Approximate distance (m) from a tool up to which vertices are awake, where not all are.
    awake_reach_m: f64,
    table: Option<ConstantsTable>,
    fingerprint: u64,
}

impl MassSpringBody {
    /// Checks a specification and builds a surface for the given tools.
    ///
    /// # Errors
    /// [`MassSpringError`].
    pub fn of(spec: MassSpringSpec, tools: &[ToolSpec]) -> Result<Self, MassSpringError> {
        let MassSpringSpec { mut springs, refinement, table } = spec;
        if let Some(Refinement { rings, blend_s, .. }) = refinement {
            let setting =
                |name, value, ok, rule| if ok { Ok(()) } else { Err(MassSpringError::Setting { name, value, rule }) };
            setting("rings", f64::from(rings), (1..=MOST_RINGS).contains(&rings), "must be 1 to 16")?;
            setting("blend_s", blend_s, blend_s > 0.0 && blend_s.is_finite(), "must be finite and larger than 0")?;
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
            // The step must be stable with the largest constants.
            springs.fine = table.largest();
        }
        let model = SpringModel::build(springs)?;
        let lengths = model.surface().edges().iter().map(|edge| {
            let [a, b] = edge.nodes.map(|node| model.rest_m()[node as usize]);
            a.distance(b)
        });
        let edge_m = lengths.sum::<f64>() / model.surface().edges().len() as f64;
        let rings = refinement.map_or(1, |refinement| if refinement.follows_dent { 1 } else { refinement.rings });
        // The regions about two neighbouring samples overlap by half.
        let axis_samples: Vec<usize> = tools.iter().map(|tool| tool.place_count(f64::from(rings) * edge_m)).collect();
        // Vertices in a disc about each sample are awake; each vertex has the area √3/2 l².
        let each = model.spec().most_awake as f64 / axis_samples.iter().sum::<usize>().max(1) as f64;
        let awake_reach_m = edge_m * (each * 3.0_f64.sqrt() / (2.0 * std::f64::consts::PI)).sqrt();
        let fingerprint = fingerprint(model.spec(), refinement, table.as_ref());
        let boxes = SkinBoxes::default();
        Ok(Self { model, refinement, boxes, edge_m, axis_samples, awake_reach_m, table, fingerprint })
    }

    /// Returns the springs.
    pub fn model(&self) -> &SpringModel {
        &self.model
    }

    /// Returns the rest positions (m) of the coarse vertices.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        &self.model.rest_m()[..self.model.vertices() as usize]
    }

    /// Returns a hash of everything that the body was built from.
    pub(crate) fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Returns how the surface is refined, if it is.
    pub fn refinement(&self) -> Option<Refinement> {
        self.refinement
    }

    /// Returns the constants of the refined surface while the touched vertices are displaced by `displacement_m` (m).
    pub(crate) fn fine_at(&self, displacement_m: f64) -> Constants {
        self.table.as_ref().map_or(self.model.spec().fine, |table| table.at(displacement_m / self.edge_m))
    }

    /// Returns the mean length (m) of the coarse edges at rest.
    pub fn edge_m(&self) -> f64 {
        self.edge_m
    }

    /// Returns the range of every tool's axis samples, where the samples of all tools are numbered one after another.
    pub(crate) fn axis_samples(&self) -> impl Iterator<Item = Range<usize>> {
        self.axis_samples.iter().scan(0, |next, count| {
            *next += count;
            Some(*next - count..*next)
        })
    }

    /// Returns the number of axis samples of all tools.
    pub(crate) fn axis_sample_count(&self) -> usize {
        self.axis_samples.iter().sum()
    }

    /// Returns the approximate distance (m) from a tool up to which vertices are awake, where not all are.
    pub(crate) fn awake_reach_m(&self) -> f64 {
        self.awake_reach_m
    }

    /// Returns the coarse vertices that carry a vertex of the skin where the surface is coarse.
    pub(crate) fn ends(&self, vertex: u32) -> [u32; 2] {
        match vertex.checked_sub(self.model.vertices()) {
            None => [vertex; 2],
            Some(edge) => self.model.surface().edges()[edge as usize].nodes,
        }
    }

    /// Returns whether all coarse vertices are always awake.
    pub fn is_all_awake(&self) -> bool {
        self.model.spec().most_awake >= self.model.vertices() as usize
    }

    /// Returns the surface that tools touch: the one refined everywhere, with vertices numbered as nodes.
    pub fn skin(&self) -> Surface {
        Surface::alone(self.model.rest_m().len(), self.model.fine_triangles().to_vec())
    }

    /// Makes boxes of the skin's triangles, which are given in the order of contact's broad phase.
    pub(crate) fn cluster(&mut self, triangles: &[[u32; 3]]) {
        self.boxes = SkinBoxes::new(self.model.rest_m(), triangles);
    }

    /// Returns the mass (kg) that answers contact at each vertex of the skin: the one that the vertex has where the
    /// surface is refined all around it.
    pub(crate) fn contact_mass_kg(&self) -> Vec<f64> {
        let model = &self.model;
        let of_vertices = (0..model.vertices()).map(|v| 0.25 * model.spec().mass_kg[v as usize]);
        of_vertices.chain((0..model.surface().edges().len() as u32).map(|edge| model.edge_kg(edge))).collect()
    }

    /// Returns the moduli behind each triangle of the skin, for contact's foundation: those of a solid that is one
    /// coarse edge `l` thick and as stiff as the springs, across and along,
    /// ```text
    /// (2/√3) (K_m + K_h)/l
    /// ```
    /// because a vertex of a regular surface has the area `(√3/2) l²`, and mesh springs have the modulus `(2/√3) K_m`
    /// (N/m).
    pub(crate) fn moduli(&self) -> Vec<SurfaceModuli> {
        let spec = self.model.spec();
        let stiffest = |of: fn(&Constants) -> f64| of(&spec.coarse).max(of(&spec.fine));
        let sum_n_per_m = stiffest(|of| of.mesh_n_per_m) + stiffest(|of| of.anchor_n_per_m);
        let modulus_pa = 2.0 / 3.0_f64.sqrt() * sum_n_per_m / self.edge_m;
        vec![SurfaceModuli { p_wave_pa: modulus_pa, indentation_pa: modulus_pa }; self.model.fine_triangles().len()]
    }
}

fn fingerprint(spec: &SpringSpec, refinement: Option<Refinement>, table: Option<&ConstantsTable>) -> u64 {
    let SpringSpec { surface, coarse, fine, anchor_law, mass_kg, held, most_awake, most_refined } = spec;
    let masses = mass_kg.iter().flat_map(|mass| mass.to_bits().to_le_bytes());
    let mut hash = Fnv(fnv(calibration::fingerprint(surface), masses));
    let how = (refinement, table);
    // Writing to the hash cannot fail.
    let _ = write!(FirstNames(&mut hash), "{:?}", (coarse, fine, anchor_law, held, most_awake, most_refined, how));
    hash.0
}

/// Returns how many rings of edges `l` (m) hold the dent that a sphere of radius `R` (m) makes at the depth `d` (m):
/// the radius of the cap that touches, and the depth once more beyond it.
/// ```text
/// (√(d (2 R − d)) + d)/l,   where the sphere is deeper than its radius (R + d)/l
/// ```
pub fn rings_for(depth_m: f64, radius_m: f64, edge_m: f64) -> f64 {
    let touched_m = if depth_m < radius_m { (depth_m * (2.0 * radius_m - depth_m)).sqrt() } else { radius_m };
    (touched_m + depth_m) / edge_m
}

/// Returns the number of triangles of a regular surface with edges `l` (m) in `n` rings about a line of length `L` (m)
/// along its edges.
/// ```text
/// 6 n² + 4 n ⌈L/l⌉
/// ```
pub fn triangles_about(rings: u32, length_m: f64, edge_m: f64) -> usize {
    let rings = rings as usize;
    (6 * rings * rings).saturating_add((4 * rings).saturating_mul((length_m / edge_m).ceil() as usize))
}

/// Largest number of rings, which is most of any surface.
pub(super) const MOST_RINGS: u32 = 16;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bodies::mass_spring::calibration::TableRow, hash::OFFSET};

    /// Snapshots hold this hash.
    #[test]
    fn renamed_fields_are_hashed_by_their_first_names() {
        let springs = (
            Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 12.5 },
            Some(Refinement { rings: 2, follows_dent: false, blend_s: 0.1, by: Refining::ByTools }),
            TableRow { xi: 0.5, anchor_ratio: 0.25, spread: 0.0, energy_ratio: 1.0 },
        );
        let mut hash = Fnv(OFFSET);
        write!(FirstNames(&mut hash), "{springs:?}").unwrap();
        let expected = "(Constants { mesh_n_per_m: 60.0, home_n_per_m: 12.5 }, \
             Some(Refinement { rings: 2, follows_dent: false, fade_s: 0.1, by: ByTools }), \
             TableRow { xi: 0.5, home_ratio: 0.25, spread: 0.0, energy_ratio: 1.0 })";
        assert_eq!(hash.0, fnv(OFFSET, expected.bytes()));
    }
}
