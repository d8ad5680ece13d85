//! What a scene measures: named values with units, one row per sample.
use glam::DVec3;
use palpate_physics::{Energies, Model, Scratch, State, bodies::MaterialPoint, world};

/// A named measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    name: String,
    measure: Measure,
}

/// What a [`Probe`] measures.
#[derive(Debug, Clone, PartialEq)]
pub enum Measure {
    /// Displacement of a material point (m).
    Displacement(MaterialPoint),
    /// Force (N) that holds the prescribed degrees of freedom of these nodes.
    Reaction(Vec<u32>),
    /// The energy ledger (J).
    Energy,
    /// Force of the body on a tool (N).
    ContactForce(usize),
    /// Force on a tool's device (N).
    DeviceForce(usize),
    /// Torque of the body on a tool, about its centre (N m).
    ContactTorque(usize),
    /// Torque on a tool's device (N m).
    DeviceTorque(usize),
    /// Centre of a tool (m).
    ToolPosition(usize),
    /// Deepest penetration of a tool (m).
    Penetration(usize),
    /// Smallest `det F` over all tets.
    MinVolumeRatio,
}

const XYZ: &[&str] = &["x", "y", "z"];
const VALUE: &[&str] = &["value"];
const ENERGIES: &[&str] = &["kinetic", "elastic", "gravitational", "external_work", "dissipated"];

/// No probe has more columns than this.
pub const MAX_COLUMNS: usize = 5;

impl Probe {
    /// A probe with a name.
    pub fn new(name: impl Into<String>, measure: Measure) -> Self {
        Self { name: name.into(), measure }
    }

    /// Its name, unique in a scene.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it measures.
    pub fn measure(&self) -> &Measure {
        &self.measure
    }

    /// Whether it tells of elements that are turned inside out.
    pub fn tells_of_inversion(&self) -> bool {
        matches!(self.measure, Measure::MinVolumeRatio)
    }

    /// Unit of its values: `m`, `N`, `Nm`, `J` or `1`.
    pub fn unit(&self) -> &'static str {
        match self.measure {
            Measure::Displacement(_) | Measure::ToolPosition(_) | Measure::Penetration(_) => "m",
            Measure::Reaction(_) | Measure::ContactForce(_) | Measure::DeviceForce(_) => "N",
            Measure::ContactTorque(_) | Measure::DeviceTorque(_) => "Nm",
            Measure::Energy => "J",
            Measure::MinVolumeRatio => "1",
        }
    }

    /// Names of its values: `x y z`, `value`, or the energies.
    pub fn columns(&self) -> &'static [&'static str] {
        match self.measure {
            Measure::Penetration(_) | Measure::MinVolumeRatio => VALUE,
            Measure::Energy => ENERGIES,
            _ => XYZ,
        }
    }

    /// Writes the values at this state; `out` is at least as long as [`Self::columns`]. Does not allocate.
    /// Energies and the volume ratio visit every tet.
    pub fn evaluate(&self, model: &Model, state: &State, scratch: &Scratch, out: &mut [f64]) {
        self.evaluate_with(model, state, scratch.reactions_n(), out);
    }

    /// The same with the reactions (N per node) given, for states that no step has made.
    pub fn evaluate_with(&self, model: &Model, state: &State, reactions_n: &[DVec3], out: &mut [f64]) {
        match &self.measure {
            Measure::Displacement(point) => put(out, model.displacement_m(state, point)),
            Measure::Reaction(nodes) => {
                put(out, nodes.iter().map(|&node| reactions_n[node as usize]).sum());
            }
            Measure::Energy => {
                let e = Energies::of(model, state);
                let values = [e.kinetic_j, e.elastic_j, e.gravitational_j, e.external_work_j, e.dissipated_j];
                copy(out, &values);
            }
            Measure::ContactForce(tool) => put(out, state.mechanical.tools[*tool].contact_force_n),
            Measure::DeviceForce(tool) => put(out, state.mechanical.tools[*tool].device_force_n),
            Measure::ContactTorque(tool) => put(out, state.mechanical.tools[*tool].contact_torque_nm),
            Measure::DeviceTorque(tool) => put(out, state.mechanical.tools[*tool].device_torque_nm),
            Measure::ToolPosition(tool) => put(out, state.mechanical.tools[*tool].centre_m),
            Measure::Penetration(tool) => copy(out, &[state.mechanical.tools[*tool].penetration_m]),
            Measure::MinVolumeRatio => {
                // A surface of springs is never crushed.
                copy(out, &[world::min_volume_ratio(model, state).map_or(1.0, |smallest| smallest.ratio)]);
            }
        }
    }
}

fn put(out: &mut [f64], value: DVec3) {
    copy(out, &value.to_array());
}

fn copy(out: &mut [f64], values: &[f64]) {
    for (slot, value) in out.iter_mut().zip(values) {
        *slot = *value;
    }
}
