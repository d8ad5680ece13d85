//! The kinds of body that a document can describe: what each of them refuses, which surface it has, what it is made from.
//!
//! A kind is one file with one `impl BodyKind`, and one line of [`of`]; nothing else in this crate asks which kind a body is.
mod hybrid;
pub(super) mod mass_spring;
mod seed;
mod tet;

use super::{Files, body::Body, loads::Constraints, located::Located, material::Materials};
use crate::document::{
    Document,
    body::BodyTable,
    source::{Fault, Where},
};
use glam::DVec3;
use palpate_physics::{BodySpec, Settings, Solid, contact::ToolSpec};
use std::fmt::Debug;

pub(super) use hybrid::skin_around;

/// What a kind of body makes of a document.
pub(crate) trait BodyKind: Debug + Sync {
    /// Numerical settings where the document is silent.
    fn default_settings(&self) -> Settings {
        Settings::default()
    }

    /// Refuses what this kind has no use for, before anything is made.
    fn refuse(&self, document: &Document) -> Result<(), Fault> {
        if document.body.surface.is_some() { Err(nothing_inside()) } else { Ok(()) }
    }

    /// Gives the body, made from `at` in the document, the surface that loads and tools act on where that is not the tets' own.
    fn put_surface_on(
        &self,
        _body: &mut Body,
        _table: &BodyTable,
        _at: &Where,
        _files: &Files<'_>,
        _progress: &mut dyn FnMut(f64, &str),
    ) -> Result<(), Fault> {
        Ok(())
    }

    /// What the model is made from. Settings that belong to the body go into `settings`.
    fn compile(&self, ingredients: Ingredients<'_>, settings: &mut Settings) -> Result<Compiled, Fault>;

    /// The point of the body nearest to a position (m). Where there are no nodes around it, only its distance means something.
    fn locate(&self, body: &Body, point_m: DVec3) -> Located;

    /// The nodes whose reactions sum up to those of a region's nodes.
    fn reaction_nodes(&self, _body: &Body, nodes: Vec<u32>) -> Vec<u32> {
        nodes
    }

    /// Why no capsule presses this kind of body; `None` where one may.
    fn no_capsules(&self) -> Option<&'static str> {
        None
    }

    /// Whether each of its nodes is held by itself, as by a spring to where it is at rest.
    fn holds_each_node(&self) -> bool {
        false
    }

    /// Whether parts of its mesh that share no node move together all the same where they touch.
    fn joins_what_touches(&self) -> bool {
        false
    }

    /// Whether `elements` of `[body]` says what its energy is taken of.
    fn has_elements(&self) -> bool {
        false
    }

    /// What one would want to change.
    fn warnings(&self, _body: &Body, _tools: &[ToolSpec]) -> Vec<String> {
        Vec::new()
    }
}

/// What a body is made from, all of it checked.
pub(super) struct Ingredients<'a> {
    pub(super) document: &'a Document,
    pub(super) body: &'a Body,
    pub(super) materials: Materials,
    pub(super) constraints: &'a Constraints,
    pub(super) tools: &'a [ToolSpec],
    pub(super) files: &'a Files<'a>,
}

impl Ingredients<'_> {
    /// The body's tets with their materials.
    fn solid(&self) -> Result<Solid, Fault> {
        let mesh = self.body.tets()?.clone();
        let Materials { regions, tet_region, .. } = &self.materials;
        Ok(Solid { mesh, regions: regions.clone(), tet_region: tet_region.clone() })
    }
}

/// What came of it.
pub(super) struct Compiled {
    pub(super) spec: BodySpec,
    pub(super) volume_m3: f64,
    pub(super) mass_kg: f64,
    /// What one would want to know of what was made of the document.
    pub(super) warnings: Vec<String>,
}

/// Mass (kg) of a body whose surface encloses `volume_m3`, which its tets need not have.
fn mass_kg(solid: &Solid, volume_m3: f64) -> f64 {
    solid.mass_kg() * volume_m3 / solid.mesh.total_volume_m3()
}

/// A surface file is no body of tets.
pub(super) fn nothing_inside() -> Fault {
    let message = "a surface file has no inside to be filled with tets";
    Fault::value(Where::root("body").key("surface"), message).help(
        "make it a mass-spring surface with [body.springs], or give two surfaces whose volume between is filled: [body.surfaces]",
    )
}

/// The kind that a document's `[body]` describes, by the tables that it has.
pub(super) fn of(table: &BodyTable) -> &'static dyn BodyKind {
    match table {
        BodyTable { springs: Some(_), .. } => &mass_spring::MassSpring,
        BodyTable { seed: Some(_), .. } => &seed::Seed,
        BodyTable { particles: Some(_), .. } => &hybrid::Hybrid,
        _ => &tet::Tet,
    }
}
