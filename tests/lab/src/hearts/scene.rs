//! A heart as a scene: its surfaces in files, as from a segmentation, and the tissue and particles of the wall between them.
use super::{
    anatomy::Anatomy,
    isosurface::{Isosurface, Voxels},
};
use crate::random::Random;
use glam::{DQuat, DVec3};
use miette::{IntoDiagnostic, Result};
use palpate_physics::ModelSpec;
use palpate_scene::Limits;
use std::{f64::consts::TAU, fmt::Write, fs, path::Path};

/// How much (in voxels) a segmentation is off at most.
const NOISE: f64 = 0.15;

/// A heart.
pub(crate) struct Heart {
    /// What its model is built from, particles in 400 coarse tets; no tool is in it.
    pub(crate) spec: ModelSpec,
    /// What is special about it, in words.
    pub(crate) told: String,
}

impl Heart {
    /// Makes the heart of a seed.
    ///
    /// # Errors
    /// The folder for its files cannot be written, or the scene is refused.
    pub(crate) fn random(seed: u64) -> Result<Self> {
        Self::of_tets(seed, 400, true)
    }

    /// Makes the heart of a seed in so many tets, which are all there is of it unless it has particles.
    ///
    /// # Errors
    /// As of [`Self::random`].
    pub(super) fn of_tets(seed: u64, target_tets: u32, has_particles: bool) -> Result<Self> {
        let mut random = Random::new(seed);
        let heart = Anatomy::random(&mut random);
        let voxel_m = random.within(2.1e-3, 2.4e-3);
        let turned = turn(&mut random);
        let [epicardium, endocardium] = [false, true].map(|is_inner| {
            let field = |p: DVec3| if is_inner { heart.cavity_m(p) } else { heart.outside_m(p) };
            let noise_seed = seed.wrapping_mul(2).wrapping_add(u64::from(is_inner));
            surface(&heart, voxel_m, noise_seed, field, turned)
        });
        let folder = tempfile::tempdir().into_diagnostic()?;
        write_obj(&folder.path().join("outer.obj"), &epicardium)?;
        write_obj(&folder.path().join("inner.obj"), &endocardium)?;
        let (spacing_m, poisson_ratio) = (random.within(3e-3, 3.6e-3), random.within(0.3, 0.49));
        let young_modulus_pa = random.log_within(8e3, 40e3);
        let particles =
            if has_particles { format!("[body.particles]\nspacing_m = {spacing_m}\n") } else { String::new() };
        let text = format!(
            "[scene]\nname = \"heart\"\n[body.surfaces]\ninner_file = \"inner.obj\"\nouter_file = \"outer.obj\"\nunit = \"mm\"\n\
             target_tets = {target_tets}\n{particles}[[material]]\nlaw = \"stable-neo-hookean\"\n\
             young_modulus_pa = {young_modulus_pa}\npoisson_ratio = {poisson_ratio}\ndensity_kg_per_m3 = 1060\n\
             viscosity_psi_pa_s = 0.3\n[[fixed]]\nregion = \"base\"\n[numerics]\nmass_damping_per_s = 20\n"
        );
        let scene = palpate_scene::parse(&text, "heart", Some(folder.path()), &Limits::local(), &mut |_, _| {})?;
        let triangles = epicardium.triangles.len() + endocardium.triangles.len();
        let told = format!("heart of {triangles} triangles, nu {poisson_ratio:.2}, {:.0} kPa", young_modulus_pa * 1e-3);
        Ok(Self { spec: scene.model, told })
    }
}

/// Returns a rotation to anywhere.
fn turn(random: &mut Random) -> DQuat {
    DQuat::from_axis_angle(random.vector().normalize_or(DVec3::Z), random.within(0.0, TAU))
}

/// Returns the zero surface of a noisy field below the base, on the base's saddle and turned.
fn surface(heart: &Anatomy, voxel_m: f64, noise_seed: u64, field: impl Fn(DVec3) -> f64, turned: DQuat) -> Isosurface {
    let bounds_m = heart.bounds_m();
    let voxels = ((bounds_m[1] - bounds_m[0]) / voxel_m).ceil().to_array().map(|count| count as usize);
    let noise_m = |corner: usize| {
        let mut random = Random::new(noise_seed.rotate_left(32) ^ corner as u64);
        NOISE * voxel_m * random.within(-1.0, 1.0)
    };
    let mut found = Voxels::new(bounds_m, voxels, |p, corner| field(p) + noise_m(corner)).zero_surface();
    found.vertices_m.iter_mut().for_each(|p| *p = turned * heart.on_saddle(*p));
    found
}

/// Writes a surface in millimetres.
fn write_obj(path: &Path, surface: &Isosurface) -> Result<()> {
    let mut text = String::new();
    for p in surface.vertices_m.iter().map(|p| *p * 1e3) {
        writeln!(text, "v {} {} {}", p.x, p.y, p.z).into_diagnostic()?;
    }
    for [a, b, c] in surface.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + 1)) {
        writeln!(text, "f {a} {b} {c}").into_diagnostic()?;
    }
    fs::write(path, text).into_diagnostic()
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_physics::Model;

    /// Each of them builds, as large as it is meant to be.
    #[test]
    fn hearts_become_bodies() {
        for seed in [1, 2, 3] {
            let heart = Heart::random(seed).unwrap();
            let model = Model::build(heart.spec).unwrap();
            let (triangles, volume_m3) = (
                model.surface().triangles.len(),
                model.body().as_hybrid().map_or(0.0, |hybrid| hybrid.particles().skin.volume_m3()),
            );
            println!("{seed}: {triangles} triangles, {volume_m3:e} m3, {}", heart.told);
            assert!((25_000..45_000).contains(&triangles), "seed {seed}: {triangles}");
            assert!((5e-5..2e-4).contains(&volume_m3), "seed {seed}: {volume_m3:e}");
        }
    }
}
