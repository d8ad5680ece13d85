//! The bodies of the tables: ellipsoid shells and truncated-ellipsoid ventricles.
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    BodySpec, Model, ModelSpec, PrescribedSpec, Region, Settings, Solid,
    contact::{Coupling, ToolShape, ToolSpec},
    material::{Convention, Lame, Law, Material, Viscosity},
};
use palpate_scene::shapes::{self, BoundaryRegion, Shape};

/// A material of density 1000 kg/m³ without viscosity.
pub fn material(law: Law, young_modulus_pa: f64, poisson_ratio: f64) -> Result<Material> {
    let lame = Lame::from_young_poisson(young_modulus_pa, poisson_ratio).into_diagnostic()?;
    Ok(Material::new(law, lame, Viscosity::default(), Convention::Consistent))
}

/// The ventricle with semi-axes 10 and 20 mm outside, 7 and 17 mm inside, cut at z = 5 mm, times `scale`.
pub fn ventricle(scale: f64, tets: u32) -> Result<Shape> {
    let mm = |short: f64, long: f64| (short * scale * 1e-3, long * scale * 1e-3);
    shapes::ventricle(mm(10.0, 20.0), mm(7.0, 17.0), 5e-3 * scale, tets).into_diagnostic()
}

/// A closed shell of semi-axes 30, 30, 45 mm and 8 mm wall.
pub fn ellipsoid(tets: u32) -> Result<Shape> {
    let outer = DVec3::new(30e-3, 30e-3, 45e-3);
    shapes::ellipsoid_shell(outer - DVec3::splat(8e-3), outer, tets).into_diagnostic()
}

/// A model of a shape held at its base, if it has one, with a rigid spherical tool beside it if `tool_radius_m` is given.
pub fn model(shape: &Shape, material: Material, tool: Option<ToolSpec>) -> Result<Model> {
    Model::build(spec(shape, material, tool)).into_diagnostic()
}

/// What [`model`] is built from.
pub fn spec(shape: &Shape, material: Material, tool: Option<ToolSpec>) -> ModelSpec {
    let base = shape.region("base").map(BoundaryRegion::nodes);
    ModelSpec {
        body: BodySpec::Tet(
            Solid {
                mesh: shape.mesh.clone(),
                regions: vec![Region { name: "body".into(), material, density_kg_per_m3: 1000.0 }],
                tet_region: vec![0; shape.mesh.tets().len()],
            }
            .into(),
        ),
        prescribed: base
            .map(|nodes| PrescribedSpec { name: "base".into(), nodes, axes: [true; 3], is_fixed: false })
            .into_iter()
            .collect(),
        loads: vec![],
        gravity_m_per_s2: DVec3::ZERO,
        tools: tool.into_iter().collect(),
        settings: Settings::default(),
    }
}

/// A rigid sphere of `radius_m`, touching the shape's widest side from +x.
pub fn tool_beside(shape: &Shape, radius_m: f64) -> ToolSpec {
    let widest = shape.mesh.positions_m().iter().copied().max_by(|a, b| a.x.total_cmp(&b.x)).unwrap_or_default();
    ToolSpec {
        name: "tool".into(),
        shape: ToolShape::Sphere,
        radius_m,
        coupling: Coupling::Rigid,
        friction_coefficient: 0.3,
        start_position_m: widest + DVec3::X * radius_m,
    }
}
