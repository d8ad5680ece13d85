//! `[[probe]]`: measurements with their points, regions and tools found.
use super::{body::Body, loads::Constraints, regions::Regions, unique_names};
use crate::{
    document::{
        source::{Fault, Where},
        tool::{ProbeKind, ProbeTable},
        words::did_you_mean,
    },
    probes::{Measure, Probe},
};
use glam::DVec3;
use palpate_physics::{bodies::MaterialPoint, contact::ToolSpec};

/// All probes.
pub(crate) fn compile(
    tables: &[ProbeTable],
    regions: &Regions<'_>,
    body: &Body,
    tools: &[ToolSpec],
    constraints: &Constraints,
    warnings: &mut Vec<String>,
) -> Result<Vec<Probe>, Fault> {
    unique_names("probe", tables.iter().map(|probe| probe.name.as_str()))?;
    let mut probes = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let at = Where::root("probe").index(index);
        demand_own_key(table, &at)?;
        let measure = match table.measure {
            ProbeKind::Displacement => {
                displacement(&table.name, DVec3::from(table.point_m.unwrap_or_default()), body, warnings)
            }
            ProbeKind::Reaction => {
                let nodes = regions.nodes(table.region.as_deref().unwrap_or_default(), &at.key("region"))?;
                if !constraints.specs.iter().any(|set| set.nodes.iter().any(|node| nodes.contains(node))) {
                    let message = "no node of this region is fixed or prescribed: it has no reaction";
                    return Err(Fault::value(at.key("region"), message));
                }
                Measure::Reaction(body.kind.reaction_nodes(body, nodes))
            }
            ProbeKind::Energy => Measure::Energy,
            ProbeKind::MinVolumeRatio => Measure::MinVolumeRatio,
            ProbeKind::ContactForce => Measure::ContactForce(tool(table, tools, &at)?),
            ProbeKind::DeviceForce => Measure::DeviceForce(tool(table, tools, &at)?),
            ProbeKind::ContactTorque => Measure::ContactTorque(tool(table, tools, &at)?),
            ProbeKind::DeviceTorque => Measure::DeviceTorque(tool(table, tools, &at)?),
            ProbeKind::ToolPosition => Measure::ToolPosition(tool(table, tools, &at)?),
            ProbeKind::Penetration => Measure::Penetration(tool(table, tools, &at)?),
        };
        probes.push(Probe::new(table.name.clone(), measure));
    }
    Ok(probes)
}

/// Each measure takes one key, and refuses those of the others.
fn demand_own_key(table: &ProbeTable, at: &Where) -> Result<(), Fault> {
    let own = match table.measure {
        ProbeKind::Displacement => Some("point_m"),
        ProbeKind::Reaction => Some("region"),
        ProbeKind::Energy | ProbeKind::MinVolumeRatio => None,
        ProbeKind::ContactForce
        | ProbeKind::DeviceForce
        | ProbeKind::ContactTorque
        | ProbeKind::DeviceTorque
        | ProbeKind::ToolPosition
        | ProbeKind::Penetration => Some("tool"),
    };
    let given =
        [("point_m", table.point_m.is_some()), ("region", table.region.is_some()), ("tool", table.tool.is_some())];
    for (key, given) in given {
        match (given, own == Some(key)) {
            (false, true) => {
                return Err(Fault::value(at.clone(), format!("the probe \"{}\" lacks the key `{key}`", table.name)));
            }
            (true, false) => {
                let message = format!("`{key}` means nothing to what the probe \"{}\" measures", table.name);
                return Err(Fault::value(at.key(key), message).help("remove it"));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Of the material point there, or the nearest of the surface.
fn displacement(name: &str, point_m: DVec3, body: &Body, warnings: &mut Vec<String>) -> Measure {
    const OUTSIDE: f64 = 1e-2;
    let point = body.locate(point_m);
    if point.distance_m > OUTSIDE * body.diagonal_m() {
        warnings.push(format!(
            "the probe \"{name}\" lies {:.3} mm outside the body; it measures the nearest point of the surface",
            point.distance_m * 1e3
        ));
    }
    let is_inside = point.distance_m == 0.0;
    let rest_m = if is_inside { point_m } else { body.rest_position_m(&point) };
    Measure::Displacement(MaterialPoint { rest_m, nodes: point.nodes, weights: point.weights })
}

fn tool(table: &ProbeTable, tools: &[ToolSpec], at: &Where) -> Result<usize, Fault> {
    let wanted = table.tool.as_deref().unwrap_or_default();
    tools.iter().position(|tool| tool.name == wanted).ok_or_else(|| {
        let names: Vec<&str> = tools.iter().map(|tool| tool.name.as_str()).collect();
        Fault::value(at.key("tool"), format!("there is no tool \"{wanted}\"")).help(did_you_mean(wanted, &names))
    })
}
