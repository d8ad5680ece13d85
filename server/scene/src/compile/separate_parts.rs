//! Says so when a body's mesh is in parts that are not joined: they move apart, and what is not held is gone.
use super::{
    body::{Body, BodyMesh},
    loads::Constraints,
};
use crate::{
    places::{first_at_each_place, same_place},
    wording::{counted, short},
};
use glam::DVec3;
use palpate_physics::mesh::connected_parts;

/// The warning, where there is something to warn of.
pub(super) fn warning(body: &Body, constraints: &Constraints) -> Option<String> {
    let positions_m = as_given_m(body);
    let part_of = part_of_nodes(body);
    let parts = part_of.iter().max().map_or(0, |last| last + 1);
    if parts < 2 {
        return None;
    }
    let coincident = coincident(positions_m, &part_of);
    let loose = if body.kind.holds_each_node() { Vec::new() } else { not_held(&part_of, parts, constraints) };
    if coincident.is_empty() && loose.is_empty() {
        return None;
    }
    let what = if body.mesh.tets().is_some() { "mesh" } else { "surface" };
    let apart = coincident.first().map_or_else(String::new, |&node| {
        let at = mm(positions_m[node]);
        format!(": nodes of different parts lie at one place, as at {at}, and do not move together")
    });
    let flies = loose.first().map_or_else(String::new, |&part| {
        let of_part = || (0..part_of.len()).filter(|&node| part_of[node] == part);
        let count = of_part().count();
        let middle_m = of_part().map(|node| positions_m[node]).sum::<DVec3>() / count as f64;
        let which = format!("part {} ({} about {})", part + 1, counted(count, "node"), mm(middle_m));
        let which = match loose.len() {
            1 => format!("{which} is not held"),
            more => format!("{more} parts are not held, the first of them {which}"),
        };
        format!("; {which}: what acts there moves it away, and `palpated static` refuses it")
    });
    let advice = if coincident.is_empty() {
        "hold each part with a [[fixed]] region, or join them"
    } else {
        "merge the coincident nodes in the program that made the file (in Gmsh: \"Coherence Mesh\")"
    };
    let nodes = counted(coincident.len(), "coincident node");
    Some(format!("the body's {what} is {parts} separate parts, {nodes}{apart}{flies}; {advice}"))
}

/// Positions (m) of the nodes before Loop's scheme smooths a surface: its parts then come away from each other.
fn as_given_m(body: &Body) -> &[DVec3] {
    match &body.mesh {
        BodyMesh::Surface { control: Some(surface), .. } => surface.positions_m(),
        mesh => mesh.positions_m(),
    }
}

/// The part of each node, joined through tets, or through the triangles of a surface without; where cells of a lattice reach from part to
/// part, also through nodes at one place.
fn part_of_nodes(body: &Body) -> Vec<usize> {
    let positions_m = as_given_m(body);
    let Some(mesh) = body.mesh.tets() else {
        let triangles = (0..body.surface.triangles.len()).map(|t| body.surface.triangle_nodes(t));
        let triangles: Vec<[u32; 3]> = triangles.collect();
        return connected_parts(positions_m.len(), triangles.iter().map(|corners| &corners[..]));
    };
    let tets = mesh.tets().iter().map(|tet| &tet[..]);
    if !body.kind.joins_what_touches() {
        return connected_parts(positions_m.len(), tets);
    }
    let first = first_at_each_place(positions_m, same_place(positions_m), |_| true);
    let touching: Vec<[u32; 2]> = first.into_iter().zip(0..).map(|(first, node)| [first, node]).collect();
    connected_parts(positions_m.len(), tets.chain(touching.iter().map(|pair| &pair[..])))
}

/// Nodes at whose place there is a node of another part, ascending.
fn coincident(positions_m: &[DVec3], part_of: &[usize]) -> Vec<usize> {
    let first = first_at_each_place(positions_m, same_place(positions_m), |_| true);
    let mut is_shared = vec![false; positions_m.len()];
    for (node, &first) in first.iter().enumerate() {
        is_shared[first as usize] |= part_of[node] != part_of[first as usize];
    }
    (0..positions_m.len()).filter(|&node| is_shared[first[node] as usize]).collect()
}

/// Parts without a node that is held; none where nothing of the body is held, which is told by itself.
fn not_held(part_of: &[usize], parts: usize, constraints: &Constraints) -> Vec<usize> {
    let mut is_held = vec![false; parts];
    for &node in constraints.specs.iter().flat_map(|set| &set.nodes) {
        is_held[part_of[node as usize]] = true;
    }
    if is_held.contains(&true) { (0..parts).filter(|&part| !is_held[part]).collect() } else { Vec::new() }
}

fn mm(at_m: DVec3) -> String {
    // Sums of positions round; no mesh is told finer than this.
    let short = |x: f64| short((x * 1e6).round() * 1e-3);
    format!("({}, {}, {}) mm", short(at_m.x), short(at_m.y), short(at_m.z))
}
