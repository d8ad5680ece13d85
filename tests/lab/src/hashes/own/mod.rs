//! Small scenes of what the shipped ones do not have, as text: what a model is built from may be laid out anew, the scene format stays.
mod blocks;
mod contact;
mod grid;
mod hybrids;
mod refused;
mod seeds;
mod sleeping;
mod springs;

use super::case::Case;
use glam::DVec3;
use palpate_physics::Model;

/// All of them.
pub(super) fn cases() -> Vec<Case> {
    [
        grid::cases(),
        blocks::cases(),
        contact::cases(),
        sleeping::cases(),
        refused::cases(),
        hybrids::cases(),
        seeds::cases(),
        springs::cases(),
    ]
    .concat()
}

const HEAD: &str = "[scene]\nname = \"own\"\n";
const GRAVITY: &str = "gravity_m_per_s2 = [1, 0, -9.81]\n";

/// A block on a table, 40 mm wide and 20 mm high, of 192 tets.
const BLOCK: &str = "\
[body.box]
size_mm = [40, 40, 20]
cells = [4, 4, 2]
[[fixed]]
region = \"z_min\"
";

/// Its material: law, Poisson's ratio, and how viscous it is.
fn material(law: &str, poisson_ratio: f64, viscosity_pa_s: f64) -> String {
    format!(
        "[[material]]\nlaw = \"{law}\"\nyoung_modulus_pa = 10e3\npoisson_ratio = {poisson_ratio}\ndensity_kg_per_m3 = 1000\n\
        viscosity_phi_pa_s = {viscosity_pa_s}\nviscosity_psi_pa_s = {viscosity_pa_s}\n"
    )
}

fn tissue() -> String {
    material("stable-neo-hookean", 0.4, 0.1)
}

const SPRING: &str = "coupling = \"spring\"\nstiffness_n_per_m = 400\ndamping_n_s_per_m = 2\nmass_kg = 0.02\n";
const RIGID: &str = "coupling = \"rigid\"\n";

/// A sphere 6 mm above the block's middle, so far that it leaves it asleep; moved by what a case does.
fn sphere(name: &str, coupling: &str) -> String {
    format!(
        "[[tool]]\nname = \"{name}\"\nradius_mm = 6\nfriction_coefficient = 0.3\ndriver = \"device\"\nstart_mm = [20, 20, 32]\n{coupling}"
    )
}

/// A capsule that lies above the block's middle.
fn capsule(name: &str, coupling: &str) -> String {
    format!("{}shape = \"capsule\"\nhalf_length_mm = 8\naxis = [1, 0.2, 0]\n", sphere(name, coupling))
}

/// A sphere that presses the block 5 mm deep in 40 ms, goes along, and leaves.
fn pressing(coupling: &str) -> String {
    format!(
        "[[tool]]\nname = \"sphere\"\nradius_mm = 6\nfriction_coefficient = 0.3\n{coupling}driver = \"script\"\nkeyframe = [\n\
        {{ time_s = 0, position_mm = [20, 20, 27] }},\n{{ time_s = 0.04, position_mm = [20, 20, 21] }},\n\
        {{ time_s = 0.08, position_mm = [25, 21, 21] }},\n{{ time_s = 0.12, position_mm = [25, 21, 36] }},\n]\n"
    )
}

/// The surface's node that is farthest in a direction at rest.
fn farthest_node(model: &Model, direction: DVec3) -> u32 {
    let along = |node: u32| model.surface_rest_positions_m()[node as usize].dot(direction);
    let nodes = model.surface().nodes.iter().copied();
    nodes.reduce(|farthest, node| if along(node) > along(farthest) { node } else { farthest }).unwrap_or_default()
}
