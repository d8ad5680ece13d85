//! `[body.particles]`: the skin and the lattice of a hybrid body.
use super::{BodyKind, Compiled, Ingredients, mass_kg};
use crate::{
    compile::{
        Files,
        body::{Body, implausible_size, shape_fault},
        check,
        loads::Constraints,
        located::Located,
    },
    document::{
        Document, IntegratorName,
        body::{BodyTable, ParticlesTable},
        source::{Fault, Where},
    },
    error::Stage,
    limits::Limits,
    shapes::{self, ShapeError},
    skin::{FineSurface, refine},
    wording::short,
};
use glam::DVec3;
use palpate_physics::{
    BodySpec, Region, Settings, TetMesh,
    bodies::hybrid::{HybridSpec, ParticleSpec, Skin, Waking, composite::Composite, spec::MOST_ACTIVE},
    contact::{ToolSpec, is_inside},
    mesh::tet::EDGES,
};
use std::collections::BTreeSet;

/// Cells of the lattice's box for each tet that is allowed: a body fills little of the box around it.
const CELLS_PER_TET: f64 = 50.0;
/// Held nodes lie in a plane when they are no further from it than this part of the body's size.
const FLAT: f64 = 1e-9;

fn at() -> Where {
    Where::root("body").key("particles")
}

/// Coarse tetrahedra, and particles of which those near a contact are awake.
#[derive(Debug)]
pub(super) struct Hybrid;

impl BodyKind for Hybrid {
    fn default_settings(&self) -> Settings {
        Settings::for_particles()
    }

    fn put_surface_on(
        &self,
        body: &mut Body,
        table: &BodyTable,
        at: &Where,
        files: &Files<'_>,
        progress: &mut dyn FnMut(f64, &str),
    ) -> Result<(), Fault> {
        let Some(wanted) = &table.particles else { return Ok(()) };
        progress(0.75, "making the skin");
        let skin = if let Some(skin) = body.skin.take() {
            skin
        } else {
            demand(wanted, table, body, files.limits)?;
            skin_of(table, body, wanted.longest_edge_m()).map_err(|error| shape_fault(at, error))?
        };
        put_on(body, table, skin);
        Ok(())
    }

    fn compile(&self, ingredients: Ingredients<'_>, _: &mut Settings) -> Result<Compiled, Fault> {
        let mut coarse = ingredients.solid()?;
        let Ingredients { document, body, constraints, files, .. } = ingredients;
        let (Some(table), Some(fine)) = (&document.body.particles, &body.skin) else {
            return Err(Fault::value(at(), "particles need a surface that encloses the body".to_owned()));
        };
        demand_numerics(document)?;
        files.limits.check_tets(&at().key("spacing_m"), fine.triangles.len() as u64)?;
        let skin = Skin::new(fine.positions_m.clone(), fine.triangles.clone()).map_err(|error| {
            Fault::value(at(), format!("particles need a surface that encloses the body: {error}"))
                .of(Stage::Body)
                .help("repair the file so that every edge of its surface has one triangle on either side")
                .cause(error)
        })?;
        let particles = ParticleSpec {
            lattice_through_m: lattice_through_m(body, &skin, constraints),
            skin,
            spacing_m: table.spacing_m,
            fine_depth_m: table.fine_depth_m,
            smooth_skin: table.smooth_skin,
            most_active: table.most_active as usize,
            waking: match table.reach_m {
                Some(reach_m) => Waking::ByTools { reach_m },
                None => Waking::in_half_ball(table.spacing_m, table.fine_depth_m, table.most_active as usize),
            },
        };
        let warnings = limit_poisson_ratios(table, &mut coarse.regions)?;
        let volume_m3 = particles.skin.volume_m3();
        let mass_kg = mass_kg(&coarse, volume_m3);
        Ok(Compiled { spec: BodySpec::Hybrid(HybridSpec { coarse, particles }), volume_m3, mass_kg, warnings })
    }

    fn locate(&self, body: &Body, point_m: DVec3) -> Located {
        match &body.skin {
            None => body.mesh.locate(body.triangles(), point_m),
            Some(skin) if is_inside(point_m, &skin.triangles, &skin.positions_m) => {
                Located { nodes: [0; 4], weights: [1.0, 0.0, 0.0, 0.0], distance_m: 0.0 }
            }
            Some(skin) => Located::nearest(&skin.positions_m, skin.triangles.iter().copied(), point_m),
        }
    }

    /// With those in the middle of edges between two of them, which composite tets have.
    fn reaction_nodes(&self, body: &Body, nodes: Vec<u32>) -> Vec<u32> {
        match body.tets() {
            Ok(mesh) => with_middles(mesh, nodes),
            Err(_) => nodes,
        }
    }

    /// Cells of the lattice have particles on either side.
    fn joins_what_touches(&self) -> bool {
        true
    }

    /// Says so when the coarse level is none.
    fn warnings(&self, body: &Body, _: &[ToolSpec]) -> Vec<String> {
        const MANY_TETS: usize = 5000;
        let tets = body.mesh.tet_count();
        if tets <= MANY_TETS {
            return Vec::new();
        }
        vec![format!(
            "{tets} tets are many for the coarse level of a body with particles, and all of them are computed all the time: a few hundred do"
        )]
    }
}

/// The skin of the wall between two surfaces, in the place of the tets' own, where there are to be particles.
pub(in crate::compile) fn skin_around(
    body: &Body,
    table: &BodyTable,
    files: &Files<'_>,
    make: impl FnOnce(f64) -> Result<FineSurface, Fault>,
) -> Result<Option<FineSurface>, Fault> {
    let Some(wanted) = &table.particles else { return Ok(None) };
    demand(wanted, table, body, files.limits)?;
    make(wanted.longest_edge_m()).map(Some)
}

/// Refuses numbers out of range, and a lattice too fine or too coarse for the body, before it is laid. A body of an implausible size was
/// probably given in another unit: then that is what is told.
fn demand(table: &ParticlesTable, of_body: &BodyTable, body: &Body, limits: &Limits) -> Result<(), Fault> {
    let (key, spacing_m) = (at().key("spacing_m"), table.spacing_m);
    check(&key, spacing_m, spacing_m > 0.0, "must be larger than 0")?;
    let most_ok = (1..=MOST_ACTIVE).contains(&(table.most_active as usize));
    check(&at().key("most_active"), table.most_active, most_ok, "must be 1 to 20000")?;
    if let Some(edge_m) = table.skin_edge_m {
        let (key, ok) = (at().key("skin_edge_m"), edge_m > 0.0 && edge_m <= spacing_m);
        check(&key, edge_m, ok, "must be larger than 0 and no larger than the spacing")?;
    }
    if let Some(depth_m) = table.fine_depth_m {
        check(&at().key("fine_depth_m"), depth_m, depth_m >= 0.0, "must not be negative")?;
    }
    if let Some(reach_m) = table.reach_m {
        let (key, ok) = (at().key("reach_m"), reach_m >= spacing_m);
        check(&key, reach_m, ok, "must be no smaller than the spacing, or no particle would wake")?;
    }
    let (low, high) = body.mesh.bounds_m();
    let smallest_m = (high - low).min_element();
    if spacing_m > smallest_m {
        let message = format!(
            "{key} = {spacing_m}: the lattice is coarser than the body, whose smallest extent is {smallest_m:.3e} m"
        );
        let help = implausible_size(of_body, body)
            .unwrap_or_else(|| "take a spacing with several particles through the thinnest part".to_owned());
        return Err(Fault::value(key, message).help(help));
    }
    let mesh = body.tets()?;
    let boundary_m2: f64 = body.triangles().map(|corners| area_m2(corners, body.mesh.positions_m())).sum();
    let most = f64::from(limits.tets);
    let edge_m = table.longest_edge_m();
    let in_box = ((high - low) / spacing_m).ceil().element_product();
    let counts = [
        (mesh.total_volume_m3() / spacing_m.powi(3), "particles", most, spacing_m),
        (in_box, "cells in the box around the body", CELLS_PER_TET * most, spacing_m),
        (boundary_m2 / (0.25 * edge_m * edge_m), "triangles of the skin", most, edge_m),
    ];
    for (count, what, most, value) in counts {
        if count > most {
            let of_skin = table.skin_edge_m == Some(value);
            let (key, help) = if of_skin { (at().key("skin_edge_m"), "edge") } else { (key, "spacing") };
            let message =
                format!("{key} = {value} gives about {count:.1e} {what}; at most {most:.0e} are allowed here");
            let help = implausible_size(of_body, body).unwrap_or_else(|| format!("take a larger {help}"));
            return Err(Fault::value(key, message).help(help));
        }
    }
    Ok(())
}

fn area_m2(corners: [u32; 3], positions_m: &[DVec3]) -> f64 {
    let [a, b, c] = corners.map(|node| positions_m[node as usize]);
    0.5 * (b - a).cross(c - a).length()
}

/// The skin of a shape or a mesh file. Shells are triangulated anew on their true surface; flat sides and the triangles of a file are
/// what they are, and only refined.
fn skin_of(table: &BodyTable, body: &Body, edge_m: f64) -> Result<FineSurface, ShapeError> {
    if let Some(shell) = &table.sphere_shell {
        shapes::sphere_shell_skin(shell.inner_radius_m, shell.outer_radius_m, edge_m)
    } else if let Some(shell) = &table.ellipsoid_shell {
        shapes::ellipsoid_shell_skin(shell.inner_semi_axes_m.into(), shell.outer_semi_axes_m.into(), edge_m)
    } else if let Some(ventricle) = &table.ventricle {
        let (outer_m, inner_m) = (ventricle.outer_semi_axes_m.into(), ventricle.inner_semi_axes_m.into());
        shapes::ventricle_skin(outer_m, inner_m, ventricle.cut_z_m, edge_m)
    } else {
        Ok(boundary(body, edge_m))
    }
}

/// The boundary of the tets, refined; its triangles come from the boundary's.
fn boundary(body: &Body, spacing_m: f64) -> FineSurface {
    let surface = &body.surface;
    let coarse = FineSurface {
        positions_m: surface.nodes.iter().map(|&node| body.mesh.positions_m()[node as usize]).collect(),
        triangles: surface.triangles.clone(),
        origins: (0..surface.triangles.len() as u32).collect(),
    };
    refine(coarse, spacing_m, &|_, middle| middle)
}

/// Gives the body its skin: parts go over to it, and what acts on its surface acts there.
fn put_on(body: &mut Body, table: &BodyTable, skin: FineSurface) {
    let of_regions = table.block.is_none() && table.mesh.is_none();
    for (number, part) in (0..).zip(&mut body.parts) {
        if of_regions {
            part.go_over_to(&skin, |origin| origin == number);
            continue;
        }
        let of_part: BTreeSet<u32> = part.triangles.iter().copied().collect();
        part.go_over_to(&skin, |origin| of_part.contains(&origin));
        // Nodes that are points or lie on edges of a file keep their numbers on the boundary.
        let kept = part.nodes.iter().map(|&node| body.surface.vertex_of_node[node as usize]);
        part.vertices.extend(kept.filter(|&vertex| vertex != u32::MAX));
        part.vertices.sort_unstable();
        part.vertices.dedup();
    }
    body.skin = Some(skin);
}

impl ParticlesTable {
    /// Of the skin's triangles (m).
    fn longest_edge_m(&self) -> f64 {
        self.skin_edge_m.unwrap_or(self.spacing_m)
    }
}

/// Lowers the Poisson's ratios that are larger than the scene allows, and tells of each.
fn limit_poisson_ratios(table: &ParticlesTable, regions: &mut [Region]) -> Result<Vec<String>, Fault> {
    let (key, most) = (at().key("most_poisson_ratio"), table.most_poisson_ratio);
    check(&key, most, most > 0.0 && most <= 0.5, "must be larger than 0 and at most 0.5")?;
    let limit = |region: &mut Region| {
        let lame = region.material.lame;
        region.material.lame = lame.with_poisson_ratio_up_to(most);
        (lame != region.material.lame).then(|| {
            format!(
                "the material \"{}\" has Poisson's ratio {}; it is taken to have {}, and to be as stiff beneath a tool, as its waves of volume would ask for \
                 many more substeps: most_poisson_ratio = 0.5 in [body.particles] leaves it as it is, and poisson_ratio = {} with young_modulus_pa = {} says what is taken",
                region.name,
                not_rounded_up_to_half(lame.poisson_ratio()),
                short(most),
                short(most),
                short(region.material.lame.young_modulus_pa())
            )
        })
    };
    Ok(regions.iter_mut().filter_map(limit).collect())
}

/// A Poisson's ratio for people; one that rounding would take to be 0.5, which none may be, is told with all its digits.
fn not_rounded_up_to_half(poisson_ratio: f64) -> String {
    let told = short(poisson_ratio);
    if told == "0.5" { poisson_ratio.to_string() } else { told }
}

/// What bodies with particles cannot have, at its key.
fn demand_numerics(document: &Document) -> Result<(), Fault> {
    let at = Where::root("numerics");
    if document.numerics.integrator != IntegratorName::Leapfrog {
        let message = "a body with particles is integrated by leapfrog only";
        return Err(Fault::value(at.key("integrator"), message).help("leave `integrator` out, or [body.particles]"));
    }
    Ok(())
}

/// A point (m) that the lattice's planes pass through: on flat sides that are held, so that no cell reaches past them; else where the shape
/// is flat; else the middle.
fn lattice_through_m(body: &Body, skin: &Skin, constraints: &Constraints) -> DVec3 {
    let (low, high) = skin.bounds_m();
    let mut through_m = body.lattice_m.unwrap_or(0.5 * (low + high));
    let slack_m = FLAT * low.distance(high);
    for set in constraints.specs.iter().rev().filter(|set| !set.nodes.is_empty()) {
        let held = set.nodes.iter().map(|&node| body.mesh.positions_m()[node as usize]);
        let (low, high) = held.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        through_m = DVec3::select((high - low).cmple(DVec3::splat(slack_m)), low, through_m);
    }
    through_m
}

/// Nodes with those in the middle of edges between two of them, which composite tets have.
fn with_middles(mesh: &TetMesh, mut nodes: Vec<u32>) -> Vec<u32> {
    let chosen: BTreeSet<u32> = nodes.iter().copied().collect();
    let mut middles = BTreeSet::new();
    for (corners, numbers) in mesh.tets().iter().zip(Composite::new(mesh).tets()) {
        for (edge, number) in EDGES.iter().zip(&numbers[4..]) {
            if edge.iter().all(|&corner| chosen.contains(&corners[corner])) {
                middles.insert(*number);
            }
        }
    }
    nodes.extend(middles);
    nodes
}
