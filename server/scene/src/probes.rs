//! What a scene measures: named values with units, one row per sample.
use glam::DVec3;
use palpate_physics::{
    Energies, Model, Scratch, State, bodies::hybrid::place::Place, contact::closest_weights, health, mesh::TetMesh,
};

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
    /// The same of a hybrid body's, by its rest position (m).
    LatticeDisplacement(DVec3),
    /// The same of a point of a surface of springs, its nodes being vertices of the surface refined everywhere.
    SkinDisplacement(MaterialPoint),
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

/// A point of the body as weights of nodes: inside a tet, or the nearest on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaterialPoint {
    /// Nodes; unused corners have weight 0.
    pub nodes: [u32; 4],
    /// Barycentric weights, sum 1.
    pub weights: [f64; 4],
    /// Distance (m) from the point asked for: 0 inside the body.
    pub distance_m: f64,
}

impl MaterialPoint {
    /// Interpolates a nodal field.
    pub fn of(&self, field: &[DVec3]) -> DVec3 {
        self.nodes.iter().zip(self.weights).map(|(&node, weight)| field[node as usize] * weight).sum()
    }

    /// The material point at a rest position (m): barycentric in the first tet that contains it, else the nearest
    /// point of the boundary triangles (node triples).
    pub fn locate(mesh: &TetMesh, boundary: &[[u32; 3]], point_m: DVec3) -> Self {
        (0..mesh.tets().len())
            .find_map(|tet| Self::inside(mesh, tet, point_m))
            .unwrap_or_else(|| Self::nearest(mesh.positions_m(), boundary.iter().copied(), point_m))
    }

    /// The nearest point of triangles.
    pub(crate) fn nearest(positions_m: &[DVec3], triangles: impl Iterator<Item = [u32; 3]>, point_m: DVec3) -> Self {
        let candidates = triangles.map(|triangle| Self::on_triangle(positions_m, triangle, point_m));
        candidates.fold(Self { nodes: [0; 4], weights: [1.0, 0.0, 0.0, 0.0], distance_m: f64::INFINITY }, |a, b| {
            if b.distance_m < a.distance_m { b } else { a }
        })
    }

    pub(crate) fn inside(mesh: &TetMesh, tet: usize, point_m: DVec3) -> Option<Self> {
        const ROUNDING: f64 = 1e-12;
        let corner = mesh.corners_m(tet)[0];
        let local = mesh.edge_matrix_m(tet).inverse() * (point_m - corner);
        let weights = [1.0 - local.x - local.y - local.z, local.x, local.y, local.z];
        let inside = weights.iter().all(|&w| w >= -ROUNDING);
        inside.then(|| Self { nodes: mesh.tets()[tet], weights, distance_m: 0.0 })
    }

    pub(crate) fn on_triangle(positions_m: &[DVec3], triangle: [u32; 3], point_m: DVec3) -> Self {
        let [a, b, c] = triangle.map(|node| positions_m[node as usize]);
        let w = closest_weights(point_m, [a, b, c]);
        let closest = a * w[0] + b * w[1] + c * w[2];
        let nodes = [triangle[0], triangle[1], triangle[2], triangle[2]];
        Self { nodes, weights: [w[0], w[1], w[2], 0.0], distance_m: closest.distance(point_m) }
    }
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

    /// Unit of its values: `m`, `N`, `Nm`, `J` or `1`.
    pub fn unit(&self) -> &'static str {
        match self.measure {
            Measure::Displacement(_)
            | Measure::LatticeDisplacement(_)
            | Measure::SkinDisplacement(_)
            | Measure::ToolPosition(_)
            | Measure::Penetration(_) => "m",
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
            Measure::Displacement(point) => put(out, point.of(&state.x) - point.of(model.rest_positions_m())),
            Measure::LatticeDisplacement(point_m) => put(out, lattice_displacement_m(model, state, *point_m)),
            Measure::SkinDisplacement(point) => put(out, skin_displacement_m(model, state, point)),
            Measure::Reaction(nodes) => {
                put(out, nodes.iter().map(|&node| reactions_n[node as usize]).sum());
            }
            Measure::Energy => {
                let e = Energies::of(model, state);
                let values = [e.kinetic_j, e.elastic_j, e.gravitational_j, e.external_work_j, e.dissipated_j];
                copy(out, &values);
            }
            Measure::ContactForce(tool) => put(out, state.tools[*tool].contact_force_n),
            Measure::DeviceForce(tool) => put(out, state.tools[*tool].device_force_n),
            Measure::ContactTorque(tool) => put(out, state.tools[*tool].contact_torque_nm),
            Measure::DeviceTorque(tool) => put(out, state.tools[*tool].device_torque_nm),
            Measure::ToolPosition(tool) => put(out, state.tools[*tool].centre_m),
            Measure::Penetration(tool) => copy(out, &[state.tools[*tool].penetration_m]),
            Measure::MinVolumeRatio => copy(out, &[health::min_volume_ratio(model, state).0]),
        }
    }
}

/// Displacement (m) of a point at rest of a hybrid body, between the particles that carry it.
fn lattice_displacement_m(model: &Model, state: &State, point_m: DVec3) -> DVec3 {
    let Some(hybrid) = model.hybrid() else { return DVec3::ZERO };
    let partition = hybrid.partition();
    let (of_nodes, of_particles) = state.x.split_at(hybrid.node_count());
    let moved = |particle: u32| {
        let x = match state.active.ids().binary_search(&particle) {
            Ok(number) => of_particles[number],
            Err(_) => partition.anchor(particle).of(of_nodes),
        };
        x - partition.particle_m(particle)
    };
    let place = Place::new(partition, point_m);
    place.particles.into_iter().zip(place.weights).map(|(particle, weight)| moved(particle) * weight).sum()
}

/// Displacement (m) of a point of a surface of springs.
fn skin_displacement_m(model: &Model, state: &State, point: &MaterialPoint) -> DVec3 {
    let (Some(body), Some(springs)) = (model.springs(), &state.springs) else { return DVec3::ZERO };
    let moved = |vertex: u32| {
        let x = body.vertex_m(&springs.motion, vertex, &state.x);
        x - body.model().rest_m()[vertex as usize]
    };
    point.nodes.iter().zip(point.weights).filter(|(_, w)| *w != 0.0).map(|(&vertex, w)| moved(vertex) * w).sum()
}

fn put(out: &mut [f64], value: DVec3) {
    copy(out, &value.to_array());
}

fn copy(out: &mut [f64], values: &[f64]) {
    for (slot, value) in out.iter_mut().zip(values) {
        *slot = *value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> TetMesh {
        TetMesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], vec![[0, 1, 2, 3]]).unwrap()
    }

    const BOUNDARY: [[u32; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

    #[test]
    fn a_point_inside_is_reproduced_exactly() {
        let mesh = unit();
        let p = DVec3::new(0.2, 0.3, 0.1);
        let point = MaterialPoint::locate(&mesh, &BOUNDARY, p);
        assert_eq!(point.distance_m, 0.0);
        assert!((point.of(mesh.positions_m()) - p).length() < 1e-15);
    }

    #[test]
    fn a_point_outside_takes_the_nearest_of_face_edge_and_corner() {
        let mesh = unit();
        for (p, nearest) in [
            (DVec3::new(0.25, 0.25, -1.0), DVec3::new(0.25, 0.25, 0.0)),
            (DVec3::new(0.5, -1.0, -1.0), DVec3::new(0.5, 0.0, 0.0)),
            (DVec3::new(3.0, 0.0, 0.0), DVec3::X),
        ] {
            let point = MaterialPoint::locate(&mesh, &BOUNDARY, p);
            assert!((point.of(mesh.positions_m()) - nearest).length() < 1e-15, "{p}");
            assert!((point.distance_m - p.distance(nearest)).abs() < 1e-15);
            assert!((point.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
    }
}
