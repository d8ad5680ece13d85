//! `[[tool]]` and `[arm]`: tools and what moves them.
use super::{Files, body::Body, check, csv, shape, starts, unique_names};
use crate::{
    document::{
        Document,
        motion::{InterpolationName, KeyframeTable},
        source::{Fault, Where},
        tool::{ArmTable, CouplingName, DriverName, ToolTable},
        words::did_you_mean,
    },
    drivers::{Driver, ScriptedHand},
    path::{Interpolation, MotionPath},
};
use glam::DVec3;
use palpate_physics::contact::{Coupling, ToolSpec};

pub(crate) struct Tools {
    pub(crate) specs: Vec<ToolSpec>,
    pub(crate) drivers: Vec<Driver>,
    pub(crate) arm: Option<ScriptedHand>,
    pub(crate) warnings: Vec<String>,
}

/// All tools, and the scripted hand.
pub(crate) fn compile(document: &Document, body: &Body, files: &Files<'_>) -> Result<Tools, Fault> {
    unique_names("tool", document.tool.iter().map(|tool| tool.name.as_str()))?;
    let mut tools = Tools { specs: Vec::new(), drivers: Vec::new(), arm: None, warnings: Vec::new() };
    for (index, table) in document.tool.iter().enumerate() {
        let at = Where::root("tool").index(index);
        let (driver, start_position_m) = driver(table, &at, files)?;
        let friction_coefficient = table.friction_coefficient;
        check(
            &at.key("friction_coefficient"),
            friction_coefficient,
            friction_coefficient >= 0.0,
            "must not be negative",
        )?;
        let coupling = coupling(table, &at)?;
        let (shape, radius_m) = shape::shape(table, coupling, body, &at)?;
        let driver = driver.turned(shape.as_capsule().map(|capsule| capsule.start_orientation).unwrap_or_default());
        let spec =
            ToolSpec { name: table.name.clone(), shape, radius_m, coupling, friction_coefficient, start_position_m };
        tools.warnings.extend(starts::warnings(&spec, body));
        tools.specs.push(spec);
        tools.drivers.push(driver);
    }
    if let Some(arm) = &document.arm {
        let mut hand = hand(arm, document)?;
        hand.path = hand.path.turned(tools.specs[hand.tool].start().orientation);
        tools.arm = Some(hand);
    }
    tools.warn_of_idle(document);
    Ok(tools)
}

impl Tools {
    fn warn_of_idle(&mut self, document: &Document) {
        for table in document.tool.iter().filter(|tool| tool.driver == DriverName::Device) {
            if document.arm.as_ref().is_none_or(|arm| arm.tool != table.name) {
                self.warnings
                    .push(format!("the tool \"{}\" waits for an arm: offline it stays at its start", table.name));
            }
        }
    }
}

fn coupling(table: &ToolTable, at: &Where) -> Result<Coupling, Fault> {
    let spring = [
        ("stiffness_n_per_m", table.stiffness_n_per_m),
        ("damping_n_s_per_m", table.damping_n_s_per_m),
        ("mass_kg", table.mass_kg),
    ];
    if table.coupling == CouplingName::Rigid {
        return match spring.iter().find(|(_, value)| value.is_some()) {
            Some((key, _)) => Err(Fault::value(at.key(key), format!("`{key}` means nothing to a rigid tool"))
                .help("remove it, or write coupling = \"spring\"")),
            None => Ok(Coupling::Rigid),
        };
    }
    let mut values = [0.0; 3];
    for (slot, (key, value)) in values.iter_mut().zip(spring) {
        let value = value.ok_or_else(|| {
            Fault::value(at.clone(), format!("the tool \"{}\" on a spring lacks the key `{key}`", table.name))
                .help("a usual start is 500 N/m, 1 N s/m and 0.05 kg")
        })?;
        let ok = value > 0.0 || (key == "damping_n_s_per_m" && value == 0.0);
        let rule = if key == "damping_n_s_per_m" { "must not be negative" } else { "must be larger than 0" };
        check(&at.key(key), value, ok, rule)?;
        *slot = value;
    }
    let [stiffness_n_per_m, damping_n_s_per_m, mass_kg] = values;
    Ok(Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg })
}

/// The driver, and where the tool starts (m).
fn driver(table: &ToolTable, at: &Where, files: &Files<'_>) -> Result<(Driver, DVec3), Fault> {
    let word = match table.driver {
        DriverName::Device => "device",
        DriverName::Trajectory => "trajectory",
        DriverName::Script => "script",
    };
    for (key, given, owner) in [
        ("start_m", table.start_m.is_some(), "device"),
        ("trajectory_file", table.trajectory_file.is_some(), "trajectory"),
        ("keyframe", table.keyframe.is_some(), "script"),
    ] {
        if given && owner != word {
            let message =
                format!("`{key}` goes with driver = \"{owner}\", and the driver of \"{}\" is \"{word}\"", table.name);
            return Err(Fault::value(at.key(key), message));
        }
        if !given && owner == word {
            let message = format!("the tool \"{}\" with driver = \"{word}\" lacks the key `{key}`", table.name);
            return Err(Fault::value(at.clone(), message));
        }
    }
    let interpolation = |default| table.interpolation.map_or(default, interpolation);
    if let Some(start) = table.start_m {
        return Ok((Driver::Device, DVec3::from(start)));
    }
    if let Some(file) = &table.trajectory_file {
        let at = at.key("trajectory_file");
        let keys = trajectory(file, &at, files)?;
        let path = MotionPath::new(&keys, interpolation(Interpolation::Linear), table.repeat)
            .map_err(|error| Fault::value(at.clone(), format!("{file} {error}")).cause(error))?;
        let start = path.start_m();
        return Ok((Driver::Trajectory(path), start));
    }
    let keys = table.keyframe.as_deref().unwrap_or_default();
    let path = path(keys, interpolation(Interpolation::Smooth), table.repeat, at)?;
    let start = path.start_m();
    Ok((Driver::Script(path), start))
}

fn trajectory(file: &str, at: &Where, files: &Files<'_>) -> Result<Vec<(f64, DVec3)>, Fault> {
    let columns = [csv::TIME, csv::length("x"), csv::length("y"), csv::length("z")];
    let rows = csv::read(&files.resolve(at, file)?, files.limits, columns).map_err(|error| {
        Fault::value(at.clone(), error.to_string())
            .help("a trajectory has the columns time_s, x_m, y_m, z_m (or time_ms, x_mm, y_mm, z_mm)")
            .cause(error)
    })?;
    Ok(rows.into_iter().map(|[time, x, y, z]| (time, DVec3::new(x, y, z))).collect())
}

fn interpolation(name: InterpolationName) -> Interpolation {
    match name {
        InterpolationName::Linear => Interpolation::Linear,
        InterpolationName::Smooth => Interpolation::Smooth,
    }
}

fn path(keys: &[KeyframeTable], how: Interpolation, repeat: bool, at: &Where) -> Result<MotionPath, Fault> {
    let points: Vec<(f64, DVec3)> = keys.iter().map(|key| (key.time_s, DVec3::from(key.position_m))).collect();
    MotionPath::new(&points, how, repeat).map_err(|error| {
        let at = at.key("keyframe");
        let at = error.keyframe().map_or(at.clone(), |index| at.index(index).key("time_s"));
        Fault::value(at, format!("the path {error}")).cause(error)
    })
}

fn hand(arm: &ArmTable, document: &Document) -> Result<ScriptedHand, Fault> {
    let at = Where::root("arm");
    let names: Vec<&str> = document.tool.iter().map(|tool| tool.name.as_str()).collect();
    let tool = names.iter().position(|name| *name == arm.tool).ok_or_else(|| {
        Fault::value(at.key("tool"), format!("there is no tool \"{}\"", arm.tool)).help(did_you_mean(&arm.tool, &names))
    })?;
    if document.tool[tool].driver != DriverName::Device {
        let message = format!("the arm cannot drive \"{}\": that tool's driver is not \"device\"", arm.tool);
        return Err(Fault::value(at.key("tool"), message));
    }
    let how = arm.interpolation.map_or(Interpolation::Smooth, interpolation);
    Ok(ScriptedHand { tool, tool_name: arm.tool.clone(), path: path(&arm.keyframe, how, arm.repeat, &at)? })
}
