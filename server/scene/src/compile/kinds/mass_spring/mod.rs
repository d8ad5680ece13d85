//! `[body.springs]`: the body's surface, or a part of it, becomes a mass-spring surface.
mod constants;

use super::{BodyKind, Compiled, Ingredients};
use crate::{
    compile::{
        Files,
        body::{Body, BodyMesh},
        check,
        located::Located,
    },
    document::{
        Document,
        body::BodyTable,
        source::{Fault, Where},
        springs::{RefineTable, SpringsTable},
        words::did_you_mean,
    },
    error::Stage,
    scene::ToCalibrate,
    skin::FineSurface,
};
use glam::DVec3;
use palpate_physics::{
    BodySpec, Settings, Surface,
    bodies::mass_spring::{MassSpringSpec, Refinement, Refining, SpringSpec, body::triangles_about, loop_scheme},
    contact::ToolSpec,
    mesh::{Triangulation, TriangulationError},
};
use std::collections::BTreeSet;

/// How a table comes to be there.
const AGAIN: &str = "make it with `palpated calibrate`, whose argument is this scene";
/// More vertices than this are awake only where a scene asks for it, or where something moves all of them.
const MANY_VERTICES: usize = 20_000;

fn at() -> Where {
    Where::root("body").key("springs")
}

/// A surface of masses on springs.
#[derive(Debug)]
pub(super) struct MassSpring;

impl BodyKind for MassSpring {
    fn refuse(&self, document: &Document) -> Result<(), Fault> {
        let refuse = |at: Where, message: &str, help: &str| Err(Fault::value(at, message).help(help));
        if document.body.particles.is_some() || document.body.seed.is_some() {
            return refuse(at(), "a body is of springs or of particles, not both", "remove one of the two tables");
        }
        if !document.material.is_empty() {
            let message = "a body of springs has no material: its constants are those of its springs";
            return refuse(Where::root("material").index(0), message, "remove it");
        }
        if !document.prescribed.is_empty() {
            let message = "what holds a body of springs does not move";
            return refuse(Where::root("prescribed").index(0), message, "use [[fixed]]");
        }
        Ok(())
    }

    fn put_surface_on(
        &self,
        body: &mut Body,
        table: &BodyTable,
        _: &Where,
        _: &Files<'_>,
        progress: &mut dyn FnMut(f64, &str),
    ) -> Result<(), Fault> {
        let Some(wanted) = &table.springs else { return Ok(()) };
        progress(0.75, "making the surface of springs");
        put_on(body, wanted)
    }

    fn compile(&self, ingredients: Ingredients<'_>, settings: &mut Settings) -> Result<Compiled, Fault> {
        let Ingredients { document, body, tools, files, .. } = ingredients;
        let spec = spec(document, body, tools, files, settings)?;
        let mass_kg = spec.springs.mass_kg.iter().sum();
        Ok(Compiled { mass_kg, volume_m3: 0.0, spec: BodySpec::MassSpring(spec), warnings: Vec::new() })
    }

    /// On the surface refined everywhere: there is nothing inside.
    fn locate(&self, body: &Body, point_m: DVec3) -> Located {
        Located::nearest(body.surface_positions_m(), body.triangles(), point_m)
    }

    /// By anchor springs, whose stiffness is never zero.
    fn holds_each_node(&self) -> bool {
        true
    }

    /// Says so when a tool would pass between the vertices: contact presses it no harder than the springs behind can bear.
    fn warnings(&self, body: &Body, tools: &[ToolSpec]) -> Vec<String> {
        /// Of the mean edge's length.
        const SMALL: f64 = 0.25;
        let Ok(surface) = control(body) else { return Vec::new() };
        let mean_m = mean_edge_m(surface);
        let small = tools.iter().filter(|tool| tool.radius_m < SMALL * mean_m);
        let warning = |tool: &ToolSpec| {
            format!(
                "the tool \"{}\" (radius {:.3} mm) is small beside the surface's edges ({:.3} mm in the mean): pressed hard, it slips through; take a larger tool or a finer surface",
                tool.name,
                tool.radius_m * 1e3,
                mean_m * 1e3
            )
        };
        small.map(warning).collect()
    }
}

/// Makes the body's surface, or a part of it, the coarse surface of springs. Nodes are its vertices then, tools and
/// loads act on the surface refined everywhere.
fn put_on(body: &mut Body, table: &SpringsTable) -> Result<(), Fault> {
    let chosen: Vec<u32> = match &table.part {
        None => (0..body.surface.triangles.len() as u32).collect(),
        Some(name) => {
            let names: Vec<&str> = body.parts.iter().map(|part| part.name.as_str()).collect();
            let part = body.parts.iter().find(|part| part.name == *name).ok_or_else(|| {
                let message = format!("the body has no part \"{name}\"");
                let help = if names.is_empty() { "leave it out".into() } else { did_you_mean(name, &names) };
                Fault::value(at().key("part"), message).help(help)
            })?;
            part.triangles.clone()
        }
    };
    let corners: Vec<[u32; 3]> = chosen.iter().map(|&t| body.surface.triangle_nodes(t as usize)).collect();
    let used: BTreeSet<u32> = corners.iter().flatten().copied().collect();
    let used: Vec<u32> = used.into_iter().collect();
    let number = |node: &u32| used.binary_search(node).ok().map(|number| number as u32);
    let triangles = corners.iter().map(|t| t.map(|node| number(&node).unwrap_or_default())).collect();
    let positions_m = used.iter().map(|&node| body.mesh.positions_m()[node as usize]).collect();
    let surface = Triangulation::new(positions_m, triangles).map_err(refused)?;
    let (rest_m, fine_triangles) = loop_scheme::refined(&surface);
    // Each coarse triangle becomes four, in its place.
    let origins = (0..fine_triangles.len() as u32).map(|fine| fine / 4).collect();
    let skin = FineSurface { positions_m: rest_m, triangles: fine_triangles, origins };
    for part in &mut body.parts {
        let of_part: BTreeSet<u32> =
            part.triangles.iter().filter_map(|t| chosen.binary_search(t).ok()).map(|t| t as u32).collect();
        part.nodes = part.nodes.iter().filter_map(number).collect();
        part.tets.clear();
        part.go_over_to(&skin, |origin| of_part.contains(&origin));
    }
    body.parts.retain(|part| !part.nodes.is_empty());
    let vertices = surface.positions_m().len();
    body.surface = Surface::alone(vertices, surface.triangles().to_vec());
    body.report.push(format!(
        "mass-spring surface of {vertices} vertices, {} edges and {} triangles",
        surface.edges().len(),
        surface.triangles().len()
    ));
    body.mesh = BodyMesh::Surface { positions_m: skin.positions_m[..vertices].to_vec(), control: Some(surface) };
    body.skin = Some(skin);
    Ok(())
}

fn refused(error: TriangulationError) -> Fault {
    Fault::value(at(), format!("the body's surface cannot be one of springs: {error}")).of(Stage::Body).cause(error)
}

/// What the table that it asks for is made from.
pub(in crate::compile) fn to_calibrate(
    document: &Document,
    body: &Body,
    files: &Files<'_>,
) -> Result<ToCalibrate, Fault> {
    let Some(table) = &document.body.springs else {
        let message = "this body is not of springs: there is nothing to calibrate";
        return Err(Fault::value(Where::root("body"), message).help("spring constants belong to [body.springs]"));
    };
    let surface = control(body)?.clone();
    let at = at().key("refine");
    let refine = table.refine.as_ref().and_then(|refine| Some((refine, refine.table_file.as_ref()?)));
    let (refine, file) = refine.ok_or_else(|| {
        Fault::value(at.clone(), format!("[{at}] names no table"))
            .help("write table_file = \"springs-table.json\" in place of other constants there")
    })?;
    let coarse = constants::coarse(table, &surface.vertex_areas_m2())?;
    let table = files.place(file);
    Ok(ToCalibrate { surface, coarse, rings: refine.rings, table })
}

/// The surface whose vertices the springs are between.
fn control(body: &Body) -> Result<&Triangulation, Fault> {
    match &body.mesh {
        BodyMesh::Surface { control: Some(surface), .. } => Ok(surface),
        _ => Err(Fault::value(at(), "springs need a surface".to_owned())),
    }
}

/// What the springs are made from. Their damping goes into the settings.
fn spec(
    document: &Document,
    body: &Body,
    tools: &[ToolSpec],
    files: &Files<'_>,
    settings: &mut Settings,
) -> Result<MassSpringSpec, Fault> {
    let Some(table) = &document.body.springs else {
        return Err(Fault::value(at(), "there is no [body.springs]".to_owned()));
    };
    let surface = control(body)?;
    let areas_m2 = surface.vertex_areas_m2();
    let coarse = constants::coarse(table, &areas_m2)?;
    let mass_kg = constants::masses(table, &areas_m2)?;
    constants::damping(table, &mass_kg, settings)?;
    let vertices = mass_kg.len();
    let is_moved = document.scene.gravity_m_per_s2 != [0.0; 3] || !document.load.is_empty();
    let most_awake = match table.most_awake {
        Some(most) => {
            check(&at().key("most_awake"), most, most > 0, "must be 1 or larger")?;
            (most as usize).min(vertices)
        }
        None if is_moved => vertices,
        None => vertices.min(MANY_VERTICES),
    };
    let mut springs = SpringSpec {
        coarse,
        fine: coarse,
        anchor_law: constants::anchor_law(table)?,
        mass_kg,
        held: Vec::new(),
        most_awake,
        most_refined: 0,
        surface: surface.clone(),
    };
    let Some(refine) = &table.refine else {
        return Ok(MassSpringSpec { springs, refinement: None, table: None });
    };
    let (fine, constants_table) = constants::fine(refine, (&coarse, surface), files)?;
    springs.fine = fine;
    let at = at().key("refine");
    check(&at.key("rings"), refine.rings, (1..=16).contains(&refine.rings), "must be 1 to 16")?;
    let blend_ok = refine.blend_s > 0.0 && refine.blend_s.is_finite();
    check(&at.key("blend_s"), refine.blend_s, blend_ok, "must be finite and larger than 0")?;
    if refine.follows_dent && constants_table.is_some() {
        let message = "a table of constants is for one number of rings";
        return Err(Fault::value(at.key("follows_dent"), message).help("leave it out, or give other constants"));
    }
    springs.most_refined = most_refined(refine, surface, tools)?;
    let refinement = Refinement {
        rings: refine.rings,
        follows_dent: refine.follows_dent,
        blend_s: refine.blend_s,
        by: Refining::ByTools,
    };
    Ok(MassSpringSpec { springs, refinement: Some(refinement), table: constants_table })
}

/// Room for the region of every tool, and five times as much that is on its way behind tools that move.
fn most_refined(refine: &RefineTable, surface: &Triangulation, tools: &[ToolSpec]) -> Result<usize, Fault> {
    const MOST: u32 = 100_000;
    let cap = surface.triangles().len().min(MOST as usize);
    let edge_m = mean_edge_m(surface);
    let region = |tool: &ToolSpec| triangles_about(refine.rings, 2.0 * tool.shape.half_length_m(), edge_m);
    let smallest = triangles_about(refine.rings, 0.0, edge_m);
    let Some(most) = refine.most_triangles else {
        let all = tools.iter().map(region).fold(0, usize::saturating_add).max(smallest);
        return Ok(all.saturating_mul(6).min(cap));
    };
    let largest = tools.iter().map(region).fold(smallest, usize::max).min(cap);
    let rule = format!("must hold the region of each tool, {largest} triangles, and be {MOST} or less");
    let ok = most as usize >= largest && most <= MOST;
    check(&at().key("refine").key("most_triangles"), most, ok, &rule)?;
    Ok(most as usize)
}

fn mean_edge_m(surface: &Triangulation) -> f64 {
    let edges = surface.edges().len();
    (0..edges as u32).map(|edge| surface.length_m(edge)).sum::<f64>() / edges as f64
}
