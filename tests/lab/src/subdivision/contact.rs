//! Coarse sheets and sheets refined where they are touched, in the loop, against one that is fine everywhere: force and
//! shape over time, and what a tick costs.
//!
//! The fine sheet is the coarse one refined everywhere, on the same foundation per area
//! ([`matching::area_consistent`]), with the same mass per area. A sphere presses, rests, is drawn along, and leaves.
use glam::DVec3;
use palpate_physics::{
    BodySpec, Model, ModelError, ModelSpec, PrescribedSpec, Scratch, Settings, State, TickInput,
    bodies::mass_spring::{
        AnchorLaw, MassSpringSpec, Refinement, Refining, SpringSpec,
        constants_table::{Calibration, CalibrationError, ConstantsTable},
        loop_scheme::refined,
        matching,
        net::hexagonal_patch,
        region::Constants,
    },
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    mesh::{Triangulation, TriangulationError},
    step,
};
use std::time::Instant;
use thiserror::Error;

const EDGE_M: f64 = 4e-3;
const RINGS: i32 = 12;
const COARSE: Constants = Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 12.0 };
const AREA_DENSITY_KG_PER_M2: f64 = 15.0;
const DAMPING_PER_S: f64 = 60.0;
const TICKS: u32 = 1000;
/// Where rings follow the dent.
const MOST_RINGS: u32 = 6;
/// Ticks between two looks at the shape.
const SHAPE_EVERY: u32 = 10;
/// The last tick in which the tool rests.
const AT_REST: usize = 499;

/// Why nothing could be compared.
#[derive(Debug, Error)]
pub enum ContactError {
    /// No surface.
    #[error(transparent)]
    Surface(#[from] TriangulationError),
    /// No table.
    #[error(transparent)]
    Table(#[from] CalibrationError),
    /// No body.
    #[error(transparent)]
    Body(#[from] ModelError),
}

/// A tool: how it touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// What for.
    pub name: &'static str,
    /// Its radius over the coarse edges' length.
    pub radius: f64,
    /// How deep over that length.
    pub depth: f64,
}

/// What is compared: nearly one vertex, a fingertip, and many.
pub const TOUCHES: [Touch; 3] = [
    Touch { name: "point", radius: 0.3, depth: 0.25 },
    Touch { name: "fingertip", radius: 1.0, depth: 0.4 },
    Touch { name: "area", radius: 3.0, depth: 0.4 },
];

/// What one sheet did.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// How it was refined.
    pub name: String,
    /// Force (N) on the tool along its way, one a tick.
    pub force_n: Vec<DVec3>,
    /// Force over the fine sheet's while the tool rests.
    pub at_rest: f64,
    /// Root mean square of what its force is off, over that of the fine sheet's force, in all ticks.
    pub force_error: f64,
    /// The same of displacements.
    pub shape_error: f64,
    /// Median of ticks that touch (µs).
    pub tick_us: f64,
}

struct Sheet {
    name: String,
    model: Model,
    state: State,
    scratch: Scratch,
    force_n: Vec<DVec3>,
    costs_us: Vec<f64>,
    shapes_m: Vec<Vec<DVec3>>,
}

/// All sheets beneath one tool, the fine one first; `tell` is told the part done.
///
/// # Errors
/// [`ContactError`].
pub fn compare(touch: Touch, tell: &mut dyn FnMut(f64)) -> Result<Vec<Run>, ContactError> {
    let coarse = hexagonal_patch(RINGS, EDGE_M)?;
    let (fine_m, fine_triangles) = refined(&coarse);
    let vertices = fine_m.len();
    let fine = Triangulation::new(fine_m, fine_triangles)?;
    let area = matching::area_consistent(&COARSE);
    let mut sheets = vec![
        sheet("fine everywhere", fine, (area, area), (touch, 0), None)?,
        sheet("coarse", coarse.clone(), (COARSE, COARSE), (touch, 0), None)?,
    ];
    for rings in [1, 2] {
        let count = if rings == 1 { "one ring" } else { "two rings" };
        let of = Calibration { coarse: COARSE, rings, ratio: COARSE.mesh_n_per_m / COARSE.anchor_n_per_m, samples: 3 };
        let table = ConstantsTable::calibrate(&coarse, of, &mut |_| ())?;
        for (how, fine, table) in [("unchanged", COARSE, None), ("table", COARSE, Some(table)), ("area", area, None)] {
            let name = format!("{count}, {how}");
            sheets.push(sheet(&name, coarse.clone(), (COARSE, fine), (touch, rings), table)?);
        }
    }
    sheets.push(sheet("as many as needed, area", coarse, (COARSE, area), (touch, MOST_RINGS), None)?);
    for tick in 0..TICKS {
        for sheet in &mut sheets {
            sheet.tick(tick, touch, vertices);
        }
        tell(f64::from(tick + 1) / f64::from(TICKS));
    }
    let of_fine = &sheets[0];
    Ok(sheets.iter().map(|sheet| sheet.against(of_fine)).collect())
}

fn sheet(
    name: &str,
    surface: Triangulation,
    (coarse, fine): (Constants, Constants),
    (touch, rings): (Touch, u32),
    table: Option<ConstantsTable>,
) -> Result<Sheet, ContactError> {
    let vertices = surface.positions_m().len();
    let boundary: Vec<u32> = (0..vertices as u32).filter(|&vertex| surface.is_boundary(vertex)).collect();
    let springs = SpringSpec {
        coarse,
        fine,
        anchor_law: AnchorLaw::Linear,
        mass_kg: surface.vertex_areas_m2().iter().map(|area_m2| area_m2 * AREA_DENSITY_KG_PER_M2).collect(),
        held: Vec::new(),
        most_awake: vertices,
        most_refined: 1000,
        surface,
    };
    let refinement =
        (rings > 0).then_some(Refinement { rings, follows_dent: rings > 2, blend_s: 0.1, by: Refining::ByTools });
    let radius_m = touch.radius * EDGE_M;
    let model = Model::build(ModelSpec {
        body: BodySpec::MassSpring(MassSpringSpec { springs, refinement, table }),
        prescribed: vec![PrescribedSpec { name: "boundary".into(), nodes: boundary, axes: [true; 3], is_fixed: false }],
        loads: Vec::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![ToolSpec {
            name: "sphere".into(),
            shape: ToolShape::Sphere,
            radius_m,
            coupling: Coupling::Rigid,
            friction_coefficient: 0.0,
            start_position_m: place_m(0, touch),
        }],
        settings: Settings { mass_damping_per_s: DAMPING_PER_S, ..Settings::default() },
    })?;
    let (state, scratch) = (State::at_rest(&model), Scratch::new(&model));
    let name = name.to_owned();
    Ok(Sheet { name, model, state, scratch, force_n: Vec::new(), costs_us: Vec::new(), shapes_m: Vec::new() })
}

/// Where the tool's centre is (m): down for 300 ticks, at rest for 200, along for 300, up and away.
fn place_m(tick: u32, touch: Touch) -> DVec3 {
    let part = |from: u32, ticks: u32| {
        let part = (f64::from(tick.saturating_sub(from)) / f64::from(ticks)).min(1.0);
        part * part * (3.0 - 2.0 * part)
    };
    let (radius_m, depth_m) = (touch.radius * EDGE_M, touch.depth * EDGE_M);
    let above_m = radius_m + EDGE_M;
    let down_m = (above_m - (radius_m - depth_m)) * (part(0, 300) - part(800, 150));
    // Begins beside a vertex, as hands do.
    DVec3::new(0.3 * EDGE_M + 3.0 * EDGE_M * part(500, 300), 0.2 * EDGE_M, above_m - down_m)
}

impl Sheet {
    fn tick(&mut self, tick: u32, touch: Touch, vertices: usize) {
        let targets = [ToolTarget::at(place_m(tick + 1, touch))];
        let held = [DVec3::ZERO];
        let input =
            TickInput { tools: &targets, load_factors: &[], prescribed_displacements_m: &held, point_forces: &[] };
        let begun = Instant::now();
        step(&self.model, &mut self.state, &mut self.scratch, &input);
        let cost_us = begun.elapsed().as_secs_f64() * 1e6;
        let tool = &self.state.mechanical.tools[0];
        if tool.contacts > 0 {
            self.costs_us.push(cost_us);
        }
        self.force_n.push(tool.device_force_n);
        if tick.is_multiple_of(SHAPE_EVERY) {
            let mut shape_m = Vec::new();
            self.model.surface_positions_m(&self.state, &mut shape_m);
            // The first vertices of the fine sheet's skin are its own: those of the others' skins.
            let rest_m = self.model.surface_rest_positions_m();
            self.shapes_m.push(shape_m.iter().zip(rest_m).take(vertices).map(|(x, rest)| *x - *rest).collect());
        }
    }

    fn against(&self, fine: &Self) -> Run {
        let off = |own: &[DVec3], of_fine: &[DVec3]| {
            let pairs = own.iter().zip(of_fine);
            pairs.fold([0.0; 2], |[off, size], (a, b)| [off + a.distance_squared(*b), size + b.length_squared()])
        };
        let [force_off, force_size] = off(&self.force_n, &fine.force_n);
        let shapes = self.shapes_m.iter().zip(&fine.shapes_m).map(|(own, of_fine)| off(own, of_fine));
        let [shape_off, shape_size] = shapes.fold([0.0; 2], |sum, pair| [sum[0] + pair[0], sum[1] + pair[1]]);
        let mut costs_us = self.costs_us.clone();
        costs_us.sort_by(f64::total_cmp);
        Run {
            name: self.name.clone(),
            at_rest: self.force_n[AT_REST].length() / fine.force_n[AT_REST].length(),
            force_n: self.force_n.clone(),
            force_error: (force_off / force_size).sqrt(),
            shape_error: (shape_off / shape_size).sqrt(),
            tick_us: costs_us.get(costs_us.len() / 2).copied().unwrap_or(f64::NAN),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beneath a tool that touches many vertices, refined on the same foundation per area, force and shape are nearer
    /// to the fine sheet's than coarse; beneath any tool constants unchanged are too stiff.
    #[test]
    fn refined_on_the_same_foundation_is_nearer_to_the_fine_sheet() {
        let area = TOUCHES[2];
        let runs = compare(area, &mut |_| ()).unwrap();
        let named = |name: &str| runs.iter().find(|run| run.name == name).unwrap();
        assert!(named("fine everywhere").force_error == 0.0 && named("fine everywhere").at_rest == 1.0);
        let (coarse, area) = (named("coarse"), named("two rings, area"));
        assert!(area.shape_error < coarse.shape_error, "{} {}", area.shape_error, coarse.shape_error);
        assert!(named("two rings, unchanged").at_rest > 1.3, "{}", named("two rings, unchanged").at_rest);
        assert!((area.at_rest - 1.0).abs() < 0.1, "{}", area.at_rest);
    }
}
