//! Tetrahedra throughout.
use super::{BodyKind, Compiled, Ingredients, mass_kg};
use crate::{
    compile::{body::Body, located::Located},
    document::{body::ElementsName, source::Fault},
};
use glam::DVec3;
use palpate_physics::{
    BodySpec, Settings,
    bodies::tet::{TetElements, TetSpec},
};

/// Tetrahedra throughout.
#[derive(Debug)]
pub(super) struct Tet;

impl BodyKind for Tet {
    fn compile(&self, ingredients: Ingredients<'_>, _: &mut Settings) -> Result<Compiled, Fault> {
        let solid = ingredients.solid()?;
        let volume_m3 = solid.mesh.total_volume_m3();
        let elements = match ingredients.document.body.elements {
            None | Some(ElementsName::Smoothed) => TetElements::Smoothed,
            Some(ElementsName::Linear) => TetElements::Linear,
        };
        let mass_kg = mass_kg(&solid, volume_m3);
        Ok(Compiled { mass_kg, volume_m3, spec: BodySpec::Tet(TetSpec { solid, elements }), warnings: Vec::new() })
    }

    fn has_elements(&self) -> bool {
        true
    }

    fn locate(&self, body: &Body, point_m: DVec3) -> Located {
        body.mesh.locate(body.triangles(), point_m)
    }
}
