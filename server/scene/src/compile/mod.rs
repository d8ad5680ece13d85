//! From the document to a [`Scene`]: every reference resolved, every value checked, every fault at its key.
mod amplitude;
mod body;
mod csv;
mod kinds;
mod loads;
mod located;
mod material;
mod parts;
mod probes;
mod regions;
mod scene_files;
mod separate_parts;
mod shape;
mod starts;
mod surface_alone;
mod tools;

use crate::{
    document::{
        Document, IntegratorName, NumericsTable, OutputTable, PrecisionName,
        source::{Fault, Where},
    },
    scene::{BodySummary, OutputSettings, PartSummary, Scene, ToCalibrate},
};
use body::Body;
use glam::DVec3;
use kinds::{Compiled, Ingredients};
use palpate_physics::{
    Integrator, ModelSpec, Precision, SelfContactChoice, Settings, Skips, Substeps, mesh::quality,
    settings::MAX_SUBSTEPS,
};
use regions::Regions;
pub(crate) use scene_files::{Files, FilesFrom};

/// Compiles a document.
pub(crate) fn compile(
    document: &Document,
    files: &Files<'_>,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<Scene, Fault> {
    files.limits.check_entries(document)?;
    printable(Where::root("scene").key("name"), &document.scene.name)?;
    // A description may have several lines.
    printable(Where::root("scene").key("description"), &document.scene.description.replace(['\n', '\r', '\t'], " "))?;
    let kind = kinds::of(&document.body);
    kind.refuse(document)?;
    if document.body.elements.is_some() && !kind.has_elements() {
        let message =
            "only a body of tets alone has `elements`: this one has particles, springs, or is the papers' hybrid";
        return Err(Fault::value(Where::root("body").key("elements"), message).help("leave `elements` out"));
    }
    let mut settings = settings(document)?;
    let output = output(&document.output)?;
    let body = body::make(&document.body, files, progress)?;
    progress(0.8, "selecting regions");
    let regions = Regions::define(&document.region, &body)?;
    let materials = material::compile(&document.material, &regions, &body)?;
    let constraints = loads::constraints(document, &regions, files)?;
    let loads = loads::loads(document, &regions, files)?;
    progress(0.9, "placing tools and probes");
    let tools = tools::compile(document, &body, files)?;
    let mut warnings = body.warnings.clone();
    warnings.extend_from_slice(&materials.warnings);
    let ingredients =
        Ingredients { document, body: &body, materials, constraints: &constraints, tools: &tools.specs, files };
    let compiled = body.kind.compile(ingredients, &mut settings)?;
    warnings.extend_from_slice(&compiled.warnings);
    warnings.extend(tools.warnings);
    warnings.extend(body.kind.warnings(&body, &tools.specs));
    let probes = probes::compile(&document.probe, &regions, &body, &tools.specs, &constraints, &mut warnings)?;
    let summary = summary(&body, &regions, &compiled);
    warn_of_shape(&summary, &mut warnings);
    warnings.extend(nothing_held(document, &body));
    warnings.extend(separate_parts::warning(&body, &constraints));
    progress(1.0, "done");
    Ok(Scene {
        name: document.scene.name.clone(),
        description: document.scene.description.trim().to_owned(),
        model: ModelSpec {
            body: compiled.spec,
            prescribed: constraints.specs,
            loads: loads.specs,
            gravity_m_per_s2: DVec3::from(document.scene.gravity_m_per_s2),
            tools: tools.specs,
            settings,
        },
        timeline: crate::Timeline { loads: loads.amplitudes, prescribed: constraints.motions },
        drivers: tools.drivers,
        probes,
        output,
        arm: tools.arm,
        warnings,
        summary,
    })
}

/// What the table of a body of springs is made from.
pub(crate) fn to_calibrate(document: &Document, files: &Files<'_>) -> Result<ToCalibrate, Fault> {
    files.limits.check_entries(document)?;
    if document.body.springs.is_some() {
        kinds::of(&document.body).refuse(document)?;
    }
    let body = body::make(&document.body, files, &mut |_, _| ())?;
    kinds::mass_spring::to_calibrate(document, &body, files)
}

/// A hand would feel a body that is further from rest.
const MAX_SLEEP_TOLERANCE_UM: f64 = 100.0;
/// A solver that needs more is not meant for a tick.
const MAX_SOLVER_ITERATIONS: u32 = 10_000;

fn settings(document: &Document) -> Result<Settings, Fault> {
    let at = Where::root("numerics");
    let NumericsTable {
        precision,
        integrator,
        substeps,
        step_safety,
        subcycle_unstable,
        long_coarse_steps,
        stretch_allowance,
        mass_damping_per_s,
        solver_iterations,
        solver_tolerance,
        sleep_tolerance_um,
    } = document.numerics;
    let defaults = kinds::of(&document.body).default_settings();
    let stretch_allowance = stretch_allowance.unwrap_or(defaults.stretch_allowance);
    let period = document.scene.tick_period_s;
    check(
        &Where::root("scene").key("tick_period_s"),
        period,
        (1e-5..=10.0).contains(&period),
        "must be between 1e-5 and 10",
    )?;
    check(&at.key("step_safety"), step_safety, step_safety > 0.0 && step_safety <= 1.0, "must be in (0, 1]")?;
    check(&at.key("stretch_allowance"), stretch_allowance, stretch_allowance >= 1.0, "must be 1 or larger")?;
    check(&at.key("mass_damping_per_s"), mass_damping_per_s, mass_damping_per_s >= 0.0, "must not be negative")?;
    let iterations_ok = (1..=MAX_SOLVER_ITERATIONS).contains(&solver_iterations);
    check(&at.key("solver_iterations"), solver_iterations, iterations_ok, "must be 1 to 10000")?;
    let tolerance_ok = solver_tolerance > 0.0 && solver_tolerance < 1.0;
    check(&at.key("solver_tolerance"), solver_tolerance, tolerance_ok, "must be in (0, 1)")?;
    let sleep_ok = (0.0..=MAX_SLEEP_TOLERANCE_UM).contains(&sleep_tolerance_um);
    check(&at.key("sleep_tolerance_um"), sleep_tolerance_um, sleep_ok, "must be 0 (never sleeps) to 100")?;
    let seeds = matches!(integrator, IntegratorName::SeedVerlet | IntegratorName::SeedSemiImplicit);
    check(
        &at.key("sleep_tolerance_um"),
        sleep_tolerance_um,
        sleep_tolerance_um == 0.0 || !seeds,
        "must be 0 with the papers' integrators, which never sleep",
    )?;
    if let Some(n) = substeps {
        check(
            &at.key("substeps"),
            n,
            (1..=MAX_SUBSTEPS).contains(&n),
            "must be 1 to 100000; leave it out to have it measured",
        )?;
    }
    let self_contact = self_contact(document)?;
    Ok(Settings {
        tick_period_s: period,
        integrator: match integrator {
            IntegratorName::Leapfrog => Integrator::Leapfrog,
            IntegratorName::SeedVerlet => Integrator::SeedVerlet,
            IntegratorName::SeedSemiImplicit => Integrator::SeedSemiImplicit,
            IntegratorName::BackwardEuler => Integrator::BackwardEuler,
        },
        substeps: substeps.map_or(Substeps::Measured, Substeps::Fixed),
        step_safety,
        subcycle_unstable,
        long_coarse_steps,
        stretch_allowance,
        precision: match precision {
            PrecisionName::Single => Precision::Single,
            PrecisionName::Double => Precision::Double,
        },
        mass_damping_per_s,
        solver_iterations,
        solver_tolerance,
        sleep_tolerance_m: 1e-6 * sleep_tolerance_um,
        self_contact,
        skips: Skips::default(),
    })
}

/// Whether walls of the body press each other.
fn self_contact(document: &Document) -> Result<SelfContactChoice, Fault> {
    let cannot = |what: &str| {
        let message = format!("walls of {what} cannot press each other");
        Fault::value(Where::root("body").key("self_contact"), message)
            .help("leave `self_contact` out, or set it to false")
    };
    match document.body.self_contact {
        None => Ok(SelfContactChoice::WhereFacing),
        Some(false) => Ok(SelfContactChoice::Off),
        Some(true) if document.body.springs.is_some() => Err(cannot("a surface of springs, which is a single sheet,")),
        Some(true) if document.body.seed.is_some() => {
            Err(cannot("the papers' hybrid, which is stepped as they print it,"))
        }
        Some(true) if document.numerics.integrator != IntegratorName::Leapfrog => {
            Err(cannot("a body that is not integrated by leapfrog"))
        }
        Some(true) => Ok(SelfContactChoice::On),
    }
}

fn output(table: &OutputTable) -> Result<OutputSettings, Fault> {
    let at = Where::root("output");
    let OutputTable { duration_s, sample_interval_s, frame_interval_s } = *table;
    for (key, value) in
        [("duration_s", duration_s), ("sample_interval_s", sample_interval_s), ("frame_interval_s", frame_interval_s)]
    {
        check(&at.key(key), value, value > 0.0 && value.is_finite(), "must be finite and larger than 0")?;
    }
    Ok(OutputSettings { duration_s, sample_interval_s, frame_interval_s })
}

/// Refuses a value with its rule.
fn check(at: &Where, value: impl std::fmt::Display, ok: bool, rule: &str) -> Result<(), Fault> {
    if ok { Ok(()) } else { Err(Fault::value(at.clone(), format!("{at} = {value}: {rule}"))) }
}

/// The one given of several keys.
fn exactly_one<'k>(at: &Where, given: &[(&'k str, bool)]) -> Result<&'k str, Fault> {
    let present: Vec<&str> = given.iter().filter(|(_, present)| *present).map(|(key, _)| *key).collect();
    let known = given.iter().map(|(key, _)| format!("`{key}`")).collect::<Vec<_>>().join(", ");
    match present.as_slice() {
        [one] => Ok(one),
        [] => Err(Fault::value(at.clone(), format!("[{at}] gives nothing; it needs exactly one of {known}"))),
        [_, second, ..] => {
            let all = present.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(" and ");
            Err(Fault::value(at.key(second), format!("[{at}] gives {all}; it needs exactly one of {known}")))
        }
    }
}

/// Refuses control characters: a name goes to terminals, where escape codes act.
fn printable(at: Where, text: &str) -> Result<(), Fault> {
    match text.chars().find(|c| c.is_control()) {
        Some(c) => Err(Fault::value(at, format!("it holds the control character U+{:04X}", u32::from(c)))
            .help("write letters, digits and signs only")),
        None => Ok(()),
    }
}

/// Refuses two elements of one name.
fn unique_names<'n>(table: &str, names: impl Iterator<Item = &'n str>) -> Result<(), Fault> {
    let mut seen: Vec<&str> = Vec::new();
    for (index, name) in names.enumerate() {
        let at = Where::root(table).index(index).key("name");
        if name.trim().is_empty() {
            return Err(Fault::value(at, format!("[[{table}]] {index} has an empty name")));
        }
        printable(at.clone(), name)?;
        if seen.contains(&name) {
            return Err(Fault::value(at, format!("there are two [[{table}]] named \"{name}\"")).help("rename one"));
        }
        seen.push(name);
    }
    Ok(())
}

fn summary(body: &Body, regions: &Regions<'_>, compiled: &Compiled) -> BodySummary {
    BodySummary {
        origin: body.origin.clone(),
        nodes: body.mesh.positions_m().len(),
        tets: body.mesh.tet_count(),
        surface_triangles: body.triangle_count(),
        volume_m3: compiled.volume_m3,
        mass_kg: compiled.mass_kg,
        quality: body.mesh.tets().map(quality::measure),
        fill_report: body.report.clone(),
        parts: regions
            .summaries()
            .map(|(name, [nodes, triangles, tets])| PartSummary { name, nodes, triangles, tets })
            .collect(),
    }
}

/// Says so when what acts on a body may move it as a whole.
fn nothing_held(document: &Document, body: &Body) -> Option<String> {
    let acts = [
        (document.scene.gravity_m_per_s2 != [0.0; 3], "gravity will move"),
        (!document.load.is_empty(), "a load may move"),
        (!document.tool.is_empty(), "a tool will move"),
    ];
    let (_, moves) = acts.into_iter().find(|(given, _)| *given)?;
    let is_held = !document.fixed.is_empty() || !document.prescribed.is_empty() || body.kind.holds_each_node();
    (!is_held).then(|| {
        format!(
            "nothing holds the body: {moves} it as a whole, and `palpated static` refuses it; add a [[fixed]] region"
        )
    })
}

fn warn_of_shape(summary: &BodySummary, warnings: &mut Vec<String>) {
    const THIN_DIHEDRAL_DEG: f64 = 5.0;
    let worst = summary.quality.as_ref().map_or(f64::INFINITY, |quality| quality.min_dihedral_deg);
    if worst < THIN_DIHEDRAL_DEG {
        warnings.push(format!(
            "the smallest dihedral angle is {worst:.1}°: such slivers cost substeps and accuracy; improve the mesh"
        ));
    }
}
