//! `[[fixed]]`, `[[prescribed]]` and `[[load]]`.
use super::{Files, amplitude, exactly_one, regions::Regions};
use crate::{
    document::{
        Document, LoadTable,
        motion::AxesText,
        source::{Fault, Where},
    },
    timeline::{Amplitude, PrescribedMotion},
};
use glam::DVec3;
use palpate_physics::{LoadSpec, PrescribedSpec};
use std::collections::BTreeMap;

/// Prescribed sets, and their motions in the same order.
#[derive(Default)]
pub(crate) struct Constraints {
    pub(crate) specs: Vec<PrescribedSpec>,
    pub(crate) motions: Vec<PrescribedMotion>,
}

/// Loads, and their factors in the same order.
#[derive(Default)]
pub(crate) struct Loads {
    pub(crate) specs: Vec<LoadSpec>,
    pub(crate) amplitudes: Vec<Amplitude>,
}

/// Fixed and prescribed nodes. Fixed regions may overlap: a node is held along every axis that any of them names.
/// Prescribed ones may overlap with nothing along the same axis.
pub(crate) fn constraints(document: &Document, regions: &Regions<'_>, files: &Files<'_>) -> Result<Constraints, Fault> {
    let mut constraints = Constraints::default();
    let mut held: BTreeMap<u32, [bool; 3]> = BTreeMap::new();
    for (index, table) in document.fixed.iter().enumerate() {
        let at = Where::root("fixed").index(index);
        let axes = axes(&table.axes, &at)?;
        for node in regions.nodes(&table.region, &at.key("region"))? {
            let slot = held.entry(node).or_default();
            *slot = [0, 1, 2].map(|axis| slot[axis] || axes[axis]);
        }
    }
    constraints.add_fixed(&held);
    let mut owner: BTreeMap<(u32, usize), String> = BTreeMap::new();
    for (&node, axes) in &held {
        (0..3).filter(|&axis| axes[axis]).for_each(|axis| _ = owner.insert((node, axis), "a [[fixed]] region".into()));
    }
    for (index, table) in document.prescribed.iter().enumerate() {
        let at = Where::root("prescribed").index(index);
        let axes = axes(&table.axes, &at)?;
        let nodes = regions.nodes(&table.region, &at.key("region"))?;
        let name = table.name.clone().unwrap_or_else(|| table.region.clone());
        claim(&mut owner, &nodes, axes, &name, &at)?;
        constraints.specs.push(PrescribedSpec { name, nodes, axes, is_fixed: false });
        constraints.motions.push(PrescribedMotion {
            displacement_m: DVec3::from(table.displacement_m),
            amplitude: amplitude::compile(&table.amplitude, &at.key("amplitude"), files)?,
        });
    }
    Ok(constraints)
}

impl Constraints {
    /// One set for every combination of axes.
    fn add_fixed(&mut self, held: &BTreeMap<u32, [bool; 3]>) {
        let mut by_axes: BTreeMap<[bool; 3], Vec<u32>> = BTreeMap::new();
        for (&node, &axes) in held {
            by_axes.entry(axes).or_default().push(node);
        }
        for (axes, nodes) in by_axes {
            let letters: String = "xyz".chars().zip(axes).filter(|(_, held)| *held).map(|(letter, _)| letter).collect();
            let name = format!("fixed {letters}");
            self.specs.push(PrescribedSpec { name, nodes, axes, is_fixed: true });
            self.motions.push(PrescribedMotion { displacement_m: DVec3::ZERO, amplitude: Amplitude::Constant(0.0) });
        }
    }
}

fn claim(
    owner: &mut BTreeMap<(u32, usize), String>,
    nodes: &[u32],
    axes: [bool; 3],
    name: &str,
    at: &Where,
) -> Result<(), Fault> {
    for &node in nodes {
        for axis in (0..3).filter(|&axis| axes[axis]) {
            if let Some(first) = owner.insert((node, axis), format!("the [[prescribed]] \"{name}\"")) {
                let axis = ['x', 'y', 'z'][axis];
                let message = format!("node {node} is held along {axis} by {first} already");
                return Err(Fault::value(at.key("region"), message)
                    .help("make the regions disjoint, or give each only the axes it needs with `axes`"));
            }
        }
    }
    Ok(())
}

fn axes(text: &AxesText, at: &Where) -> Result<[bool; 3], Fault> {
    let letters = &text.0;
    let known = letters.chars().all(|letter| "xyz".contains(letter));
    let axes = ['x', 'y', 'z'].map(|axis| letters.contains(axis));
    let once = axes.iter().filter(|&&axis| axis).count() == letters.chars().count();
    if known && once && !letters.is_empty() {
        return Ok(axes);
    }
    Err(Fault::value(at.key("axes"), format!("axes = \"{letters}\": must be some of x, y and z, for example \"xy\"")))
}

/// All loads.
pub(crate) fn loads(document: &Document, regions: &Regions<'_>, files: &Files<'_>) -> Result<Loads, Fault> {
    let mut loads = Loads::default();
    for (index, table) in document.load.iter().enumerate() {
        let at = Where::root("load").index(index);
        loads.specs.push(load(table, regions, &at)?);
        loads.amplitudes.push(amplitude::compile(&table.amplitude, &at.key("amplitude"), files)?);
    }
    Ok(loads)
}

fn load(table: &LoadTable, regions: &Regions<'_>, at: &Where) -> Result<LoadSpec, Fault> {
    let LoadTable { region, pressure_pa, follower, traction_pa, total_force_n, force_per_node_n, .. } = table;
    exactly_one(
        at,
        &[
            ("pressure_pa", pressure_pa.is_some()),
            ("traction_pa", traction_pa.is_some()),
            ("total_force_n", total_force_n.is_some()),
            ("force_per_node_n", force_per_node_n.is_some()),
        ],
    )?;
    if follower.is_some() != pressure_pa.is_some() {
        let message = "`follower` goes with `pressure_pa`: true for a pressure on the deformed surface, false for one that acts as at rest";
        return Err(Fault::value(at.clone(), message));
    }
    let on = at.key("region");
    if let (Some(pressure_pa), Some(follower)) = (*pressure_pa, *follower) {
        return Ok(LoadSpec::Pressure { triangles: regions.triangles(region, &on)?, pressure_pa, follower });
    }
    if let Some(traction) = traction_pa {
        let triangles = regions.triangles(region, &on)?;
        return Ok(LoadSpec::Traction { triangles, traction_pa: DVec3::from(*traction) });
    }
    let nodes = regions.loaded(region, &on)?;
    let each = match (total_force_n, force_per_node_n) {
        (Some(total), _) => DVec3::from(*total) / nodes.len() as f64,
        (None, each) => DVec3::from(each.unwrap_or_default()),
    };
    Ok(LoadSpec::NodalForces(nodes.into_iter().map(|node| (node, each)).collect()))
}
