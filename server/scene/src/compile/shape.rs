//! What a tool looks like.
use super::{body::Body, check};
use crate::document::{
    source::{Fault, Where},
    tool::{CouplingName, ShapeName, ToolTable},
};
use glam::{DQuat, DVec3};
use palpate_physics::contact::{Capsule, Coupling, LARGEST_TRIANGLE, ToolShape, Turning};

/// Shape and radius (m).
pub(super) fn shape(table: &ToolTable, coupling: Coupling, body: &Body, at: &Where) -> Result<(ToolShape, f64), Fault> {
    if table.shape != ShapeName::Capsule {
        only_of_capsules(table, at)?;
    }
    match table.shape {
        ShapeName::Sphere => Ok((ToolShape::Sphere, radius(table, at)?)),
        ShapeName::Capsule => capsule(table, coupling, body, at),
        ShapeName::Point => {
            if table.radius_m.is_some() {
                let message = "a point has no radius: it is as small as the surface allows".to_owned();
                return Err(Fault::value(at.key("radius_m"), message).help("remove it, or write shape = \"sphere\""));
            }
            // The smallest that `LARGEST_TRIANGLE` allows.
            Ok((ToolShape::Sphere, body.longest_edge_m() / LARGEST_TRIANGLE))
        }
    }
}

fn radius(table: &ToolTable, at: &Where) -> Result<f64, Fault> {
    let Some(radius_m) = table.radius_m else {
        let message = format!("the tool \"{}\" lacks the key `radius_m` (or `radius_mm`)", table.name);
        return Err(Fault::value(at.clone(), message));
    };
    check(&at.key("radius_m"), radius_m, radius_m > 0.0, "must be larger than 0")?;
    Ok(radius_m)
}

fn capsule(table: &ToolTable, coupling: Coupling, body: &Body, at: &Where) -> Result<(ToolShape, f64), Fault> {
    if let Some(message) = body.kind.no_capsules() {
        return Err(Fault::value(at.key("shape"), message.to_owned()).help("make the tool a sphere"));
    }
    let radius_m = radius(table, at)?;
    let half_length_m = table.half_length_m.ok_or_else(|| {
        let message = format!("the capsule \"{}\" lacks the key `half_length_m` (or `half_length_mm`)", table.name);
        Fault::value(at.clone(), message).help("from its centre to the centre of a hemisphere")
    })?;
    check(&at.key("half_length_m"), half_length_m, half_length_m > 0.0, "must be larger than 0")?;
    let axis = DVec3::from(table.axis.unwrap_or([0.0, 0.0, 1.0]));
    let along = axis.try_normalize().ok_or_else(|| {
        Fault::value(at.key("axis"), "a direction must not be zero".to_owned()).help("for example [1.0, 0.0, 0.0]")
    })?;
    let start_orientation = DQuat::from_rotation_arc(DVec3::Z, along);
    let turning = turning(table, coupling, (radius_m, half_length_m), at)?;
    Ok((ToolShape::Capsule(Capsule { half_length_m, start_orientation, turning }), radius_m))
}

fn turning(
    table: &ToolTable,
    coupling: Coupling,
    (radius_m, half_length_m): (f64, f64),
    at: &Where,
) -> Result<Turning, Fault> {
    let own = turning_keys(table);
    if table.coupling == CouplingName::Rigid {
        return match own.iter().find(|(_, value)| value.is_some()) {
            Some((key, _)) => Err(Fault::value(at.key(key), format!("`{key}` means nothing to a rigid tool"))
                .help("remove it, or write coupling = \"spring\"")),
            None => Ok(Turning::of(coupling, radius_m, half_length_m)),
        };
    }
    for (key, value) in own {
        let may_be_zero = key == "turn_damping_nm_s_per_rad";
        let rule = if may_be_zero { "must not be negative" } else { "must be larger than 0" };
        let value = value.unwrap_or(1.0);
        check(&at.key(key), value, value > 0.0 || (may_be_zero && value == 0.0), rule)?;
    }
    let default = Turning::of(coupling, radius_m, half_length_m);
    Ok(Turning {
        stiffness_nm_per_rad: table.turn_stiffness_nm_per_rad.unwrap_or(default.stiffness_nm_per_rad),
        damping_nm_s_per_rad: table.turn_damping_nm_s_per_rad.unwrap_or(default.damping_nm_s_per_rad),
        inertia_kg_m2: table.inertia_kg_m2.unwrap_or(default.inertia_kg_m2),
    })
}

fn turning_keys(table: &ToolTable) -> [(&'static str, Option<f64>); 3] {
    [
        ("turn_stiffness_nm_per_rad", table.turn_stiffness_nm_per_rad),
        ("turn_damping_nm_s_per_rad", table.turn_damping_nm_s_per_rad),
        ("inertia_kg_m2", table.inertia_kg_m2),
    ]
}

fn only_of_capsules(table: &ToolTable, at: &Where) -> Result<(), Fault> {
    let lengths = [("half_length_m", table.half_length_m.is_some()), ("axis", table.axis.is_some())];
    let turning = turning_keys(table).map(|(key, value)| (key, value.is_some()));
    match lengths.into_iter().chain(turning).find(|(_, given)| *given) {
        Some((key, _)) => Err(Fault::value(at.key(key), format!("`{key}` goes with shape = \"capsule\""))),
        None => Ok(()),
    }
}
