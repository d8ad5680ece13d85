//! The largest rate of damping of a body of tets.
use super::TetBody;
use crate::{
    elements::rest_stiffness::{RestStiffness, max_natural_frequency_with},
    material::Material,
};

impl TetBody {
    /// Returns the largest rate of damping (1/s) of viscous stress at rest, the largest eigenvalue of
    /// `M^{-½} C M^{-½}`; 0 where nothing is viscous. `progress` is told the fraction done.
    pub(crate) fn damping_per_s(&self, progress: &mut dyn FnMut(f64)) -> f64 {
        if self.materials().iter().all(|material| material.viscosity.is_zero()) {
            return 0.0;
        }
        let viscous = self.points().with_materials(Material::viscosity_as_stiffness);
        let viscous = RestStiffness { points: &viscous, springs_n_per_m: &[] };
        max_natural_frequency_with(&viscous, self.inverse_mass_per_kg(), progress).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Model, ModelSpec,
        bodies::{
            BodySpec,
            tet::{TetElements, TetSpec},
        },
        elements::solid::{Region, Solid},
        linalg::lanczos::lanczos,
        material::{Lame, Law, Viscosity},
        settings::Settings,
        testing::tet_box,
    };
    use glam::{DMat3, DVec3};

    fn block(elements: TetElements, [phi_pa_s, psi_pa_s]: [f64; 2]) -> Model {
        let mesh = tet_box(DVec3::ZERO, DVec3::new(0.03, 0.03, 0.02), [3, 3, 2]);
        let material = Material {
            law: Law::StableNeoHookean,
            lame: Lame::from_young_poisson(10e3, 0.45).unwrap(),
            viscosity: Viscosity::new(phi_pa_s, psi_pa_s).unwrap(),
            crushing_pa: 0.0,
        };
        let tet_region = vec![0; mesh.tets().len()];
        let regions = vec![Region { name: "all".into(), material, density_kg_per_m3: 1000.0 }];
        let solid = Solid { mesh, regions, tet_region };
        Model::build(ModelSpec {
            body: BodySpec::Tet(TetSpec { solid, elements }),
            prescribed: Vec::new(),
            loads: Vec::new(),
            gravity_m_per_s2: DVec3::ZERO,
            tools: Vec::new(),
            settings: Settings::default(),
        })
        .unwrap()
    }

    /// The largest rate of damping (1/s) of a body at these positions, of the forces that its points have.
    fn damping_at_per_s(body: &TetBody, x: &[DVec3]) -> f64 {
        let root: Vec<DVec3> = body.inverse_mass_per_kg().iter().map(|m| m.map(f64::sqrt)).collect();
        let mut apply = |a: &[DVec3], out: &mut [DVec3]| {
            out.fill(DVec3::ZERO);
            body.points().products_n([0.0, 1.0], x, a, out);
            for product in out {
                *product = -*product;
            }
        };
        let (theta, residual) = lanczos(&mut apply, &root);
        theta + residual
    }

    #[test]
    fn it_is_that_of_the_forces_and_grows_with_the_square_of_stretch() {
        let stretch: f64 = 1.2;
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 0.7);
        let along = |x: f64, y: f64, z: f64| turn * DMat3::from_diagonal(DVec3::new(x, y, z));
        for elements in [TetElements::Linear, TetElements::Smoothed] {
            for viscosity in [[0.0, 3.0], [4.0, 0.0], [2.0, 1.0]] {
                let model = block(elements, viscosity);
                let body = model.body().as_tet().unwrap();
                let rest = body.rest_positions_m();
                let expected = body.damping_per_s(&mut |_| {});
                let mapped = |f: DMat3| damping_at_per_s(body, &rest.iter().map(|p| f * *p).collect::<Vec<_>>());
                let found = damping_at_per_s(body, rest);
                assert!((found / expected - 1.0).abs() < 1e-3, "{elements:?} {viscosity:?}: {found} {expected}");
                for f in [along(1.0, 1.0, 1.0), along(stretch, stretch, stretch), along(stretch, 1.0, 0.8)] {
                    let most = f.x_axis.length().max(f.y_axis.length()).max(f.z_axis.length());
                    let growth = mapped(f) / expected;
                    println!("{elements:?} {viscosity:?}, stretched {most:.2}: {growth:.4}");
                    assert!(growth < 1.001 * most * most);
                }
                // Where the gradient is not the same all over: a wave, stretched by s at most.
                let bent: Vec<DVec3> = rest
                    .iter()
                    .map(|p| *p + DVec3::new((stretch - 1.0) / 300.0 * (300.0 * p.x).sin(), 0.0, 0.0))
                    .collect();
                let growth = damping_at_per_s(body, &bent) / expected;
                println!("{elements:?} {viscosity:?}, a wave: {growth:.4}");
                assert!(growth < stretch * stretch);
            }
        }
    }
}
