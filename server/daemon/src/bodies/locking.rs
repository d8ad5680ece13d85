//! How much too stiff a body of tets answers, by how large they are under a tool and, of linear ones, by Poisson's ratio.
//!
//! Linear tets are too stiff where few of them are under what presses, and lock as ν → ½: each has one volume to keep. Measured
//! (`docs/measurements/locking.md`: spheres pressed into a block), the force is too large by about
//! ```text
//! e = 0.21 σ + 0.054 σ^1.3 ν/(1 − 2ν)        σ = h/a,  a = √(R δ)
//! ```
//! with the size of the surface's triangles h = √(2A) and the contact's radius a, of a sphere of radius R pressed δ deep. That is right
//! to a third for σ from 1/3 to 3 and ν from 0.4 to 0.49; at ν = 0.499 it is up to twice too much, and so it is of the little that is left
//! with fine tets and small ν. Smoothed tets do not lock, but are stiffer between nodes than at them where few are under the tool, by up to about
//! ```text
//! e = 0.1 σ^1.8
//! ```
//! (0.7 to 1.0 times the largest that was measured at ν = 0.45 and 0.49, on a block whose nodes join 8 or 24 tets by turns). Hybrid bodies' coarse tets keep
//! volume on the mean, and their particles do not lock.
use palpate_physics::{
    Model, Region,
    bodies::tet::{TetBody, TetElements},
    contact::ToolSpec,
};
use palpate_scene::wording::{short, two_digits};

/// Above this a hand feels another body: twice as stiff.
const MUCH: f64 = 1.0;
/// Below this other errors are as large.
const LITTLE: f64 = 0.05;
/// What is told without a tool is of a press with a radius of so many triangles.
const TRIANGLES: f64 = 3.0;
/// Above this Poisson's ratio ticks need many substeps, too.
const MANY_SUBSTEPS: f64 = 0.495;

/// What is to be expected of a body under a tool.
struct Expected<'m> {
    region: &'m Region,
    tool: &'m ToolSpec,
    elements: TetElements,
    /// Size (m) of the surface's triangles.
    size_m: f64,
    /// Force over what it should be, less one.
    error: f64,
}

/// Says how much too stiff the body answers, where that is at most twice as stiff as it should be.
pub(super) fn told(model: &Model) -> Option<String> {
    let expected = Expected::of(model).filter(|expected| (LITTLE..=MUCH).contains(&expected.error));
    expected.map(|expected| format!("limit      {}", expected.sentence()))
}

/// Warns of a body that answers more than twice as stiffly as it should: under its tool, or without one under anything.
pub(super) fn warning(model: &Model) -> Option<String> {
    match Expected::of(model) {
        Some(expected) => (expected.error > MUCH).then(|| expected.sentence()),
        None if elements_of(model) != Some(TetElements::Linear) => None,
        None => least_compressible(model).filter(|region| nu(region) > MANY_SUBSTEPS).map(|region| {
            format!(
                "the material \"{}\" has Poisson's ratio {}, at which linear tets lock: a press with a radius of {TRIANGLES} of the \
                 surface's triangles is answered {}, and the tick needs many substeps. Leave `elements` at \"smoothed\", or take [body.particles], \
                 which do not lock",
                region.name,
                short(nu(region)),
                too_stiffly(expected_error(1.0 / TRIANGLES, nu(region)))
            )
        }),
    }
}

/// What a body of tets is made of; `None` of other bodies.
fn elements_of(model: &Model) -> Option<TetElements> {
    model.body().as_tet().map(TetBody::elements)
}

fn nu(region: &Region) -> f64 {
    region.material.lame.poisson_ratio()
}

/// The material with the largest Poisson's ratio, of those that tets have.
fn least_compressible(model: &Model) -> Option<&Region> {
    let solid = model.body().filling_tets()?;
    let is_used = |number: usize| solid.tet_region.contains(&(number as u16));
    let used = solid.regions.iter().enumerate().filter(|(number, _)| is_used(*number)).map(|(_, region)| region);
    used.max_by(|a, b| nu(a).total_cmp(&nu(b)))
}

/// Returns how many times too large the force on linear tets is, less one, where the surface's triangles have this size over the
/// contact's radius.
fn expected_error(size_over_contact: f64, poisson_ratio: f64) -> f64 {
    let incompressibility = poisson_ratio.max(0.0) / (1.0 - 2.0 * poisson_ratio);
    0.21 * size_over_contact + 0.054 * size_over_contact.powf(1.3) * incompressibility
}

/// Returns the same of smoothed tets, between their nodes.
fn expected_between_nodes(size_over_contact: f64) -> f64 {
    0.1 * size_over_contact.powf(1.8)
}

/// Returns the size (m) of the surface's triangles, `Σ A √(2A) / Σ A`.
fn triangle_size_m(model: &Model) -> f64 {
    let (surface, rest_m) = (model.surface(), model.surface_rest_positions_m());
    let (mut sum_m3, mut area_m2) = (0.0, 0.0);
    for triangle in 0..surface.triangles.len() {
        let [a, b, c] = surface.triangle_nodes(triangle).map(|node| rest_m[node as usize]);
        let doubled_m2 = (b - a).cross(c - a).length();
        sum_m3 += 0.5 * doubled_m2 * doubled_m2.sqrt();
        area_m2 += 0.5 * doubled_m2;
    }
    sum_m3 / area_m2
}

/// Returns `√(R δ)` (m) of a tool that is pressed half of its radius deep.
fn contact_radius_m(tool: &ToolSpec) -> f64 {
    tool.radius_m * 0.5_f64.sqrt()
}

impl<'m> Expected<'m> {
    /// Of the material that is the least compressible, under the smallest tool; `None` without tets or tools.
    fn of(model: &'m Model) -> Option<Self> {
        let elements = elements_of(model)?;
        let region = least_compressible(model)?;
        let tool = model.tools().iter().min_by(|a, b| a.radius_m.total_cmp(&b.radius_m))?;
        let size_m = triangle_size_m(model);
        let size_over_contact = size_m / contact_radius_m(tool);
        let error = match elements {
            TetElements::Linear => expected_error(size_over_contact, nu(region)),
            TetElements::Smoothed => expected_between_nodes(size_over_contact),
        };
        Some(Self { region, tool, elements, size_m, error })
    }

    fn sentence(&self) -> String {
        let Self { region, tool, elements, size_m, error } = self;
        let nu = nu(region);
        let (name, radius_mm, size_mm) = (&tool.name, short(tool.radius_m * 1e3), two_digits(size_m * 1e3));
        let pressed =
            format!("pressed by the tool \"{name}\", {radius_mm} mm in radius, half of that deep, the body answers");
        if *elements == TetElements::Smoothed {
            return format!(
                "{pressed} up to {} between the corners of its triangles, since few tets are under the tool: its surface's triangles are {size_mm} mm \
                 in size. Take smaller tets, or [body.particles]",
                too_stiffly(*error)
            );
        }
        let of_size = expected_error(size_m / contact_radius_m(tool), 0.0);
        let why = if *error > 2.0 * of_size {
            "mostly since linear tets lock when they are hardly compressible"
        } else {
            "mostly since so few tets are under the tool"
        };
        let substeps = if nu > MANY_SUBSTEPS { ", and the tick needs many substeps" } else { "" };
        format!(
            "{pressed} {}, {why}: its surface's triangles are {size_mm} mm in size, and the material \"{}\" has Poisson's ratio {}{substeps}. Leave \
             `elements` at \"smoothed\", or take [body.particles], which do not lock",
            too_stiffly(*error),
            region.name,
            short(nu),
        )
    }
}

fn too_stiffly(error: f64) -> String {
    if error < 2.0 {
        format!("about {} % too stiffly", two_digits(100.0 * error))
    } else {
        format!("about {} times as stiffly as it should", two_digits(error + 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest errors measured between the nodes of smoothed tets, under a sphere of 10 mm (`docs/measurements/locking.md`).
    #[test]
    fn the_rule_of_smoothed_tets_is_what_was_measured() {
        for (size_mm, depth_mm, error) in
            [(10.0, 5.0, 0.258), (10.0, 5.0, 0.192), (10.0, 1.0, 0.791), (5.0, 1.0, 0.261)]
        {
            let told = expected_between_nodes(size_mm / f64::sqrt(10.0 * depth_mm));
            assert!((0.7..1.01).contains(&(told / error)), "{size_mm} mm, {depth_mm} mm deep: {told} of {error}");
        }
    }

    /// Errors measured on the block under spheres of 10 and 20 mm, 5 mm deep, with triangles of 20, 10, 5 and 10/3 mm
    /// (`docs/measurements/locking.md`).
    #[test]
    fn the_rule_is_what_was_measured() {
        let measured = [
            (10.0, 0.4, [0.843, 0.539, 0.232, 0.111]),
            (10.0, 0.45, [1.493, 0.831, 0.367, 0.177]),
            (10.0, 0.49, [5.388, 2.325, 0.935, 0.481]),
            (20.0, 0.4, [0.738, 0.419, 0.125, 0.071]),
            (20.0, 0.45, [1.222, 0.626, 0.194, 0.113]),
            (20.0, 0.49, [4.203, 1.733, 0.534, 0.305]),
        ];
        for (radius_mm, nu, errors) in measured {
            for (size_mm, error) in [20.0, 10.0, 5.0, 10.0 / 3.0].into_iter().zip(errors) {
                let told = expected_error(size_mm / f64::sqrt(radius_mm * 5.0), nu);
                assert!(
                    (told / error - 1.0).abs() < 0.36,
                    "nu {nu}, {size_mm} mm under {radius_mm} mm: {told} of {error}"
                );
            }
        }
    }
}
