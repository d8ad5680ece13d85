//! The material points at which displacement fields are compared: a polar pattern on the rest surface about the touch.
use super::{
    body::{BLOCK_M, Body, OCTANT_M, SMALL_VENTRICLE_M, TetBody, VENTRICLE_M, VentricleM},
    place::{Meridian, Place},
};
use glam::{DMat3, DVec3};
use palpate_physics::contact::closest_weights;
use std::f64::consts::{FRAC_PI_2, TAU};

const RINGS: u32 = 8;
const SPOKES: u32 = 16;
/// Radius (m) of the pattern: twice the tool's, and on the small ventricle twice the patch's.
const REACH_M: f64 = 20e-3;
const SMALL_REACH_M: f64 = 8e-3;
/// Directions along each arc of the octant.
const ON_OCTANT: u32 = 12;

/// A material point of the touched surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Where it is at rest (m).
    pub rest_m: DVec3,
    /// Its share of the area (m²).
    pub area_m2: f64,
    /// Whether it is in the outer half of the pattern: around what is pressed, not beneath it.
    pub is_around: bool,
    /// Its parameters on the reference grid's touched side, mirrored into the part that is modelled.
    pub parameters: [f64; 2],
    /// From displacements of the part that is modelled to those of the body: mirrored, and turned to where it is touched.
    pub frame: DMat3,
}

/// The points of a body; none for beams.
pub fn points(body: Body) -> Vec<Sample> {
    match body {
        Body::Block => polar(REACH_M).map(on_block).collect(),
        Body::Ventricle(place) => on_ventricle(VENTRICLE_M, place, REACH_M),
        Body::SmallVentricle => on_ventricle(SMALL_VENTRICLE_M, Place::Side, SMALL_REACH_M),
        Body::Octant => on_octant(),
        Body::Beam { .. } => vec![],
    }
}

/// The pattern where there is body: it may reach past the cut.
fn on_ventricle(ventricle: VentricleM, place: Place, reach_m: f64) -> Vec<Sample> {
    let on_body = |sample: &Sample| sample.rest_m.z < ventricle.2;
    polar(reach_m).map(|offset| at_ventricle(ventricle, place, offset)).filter(on_body).collect()
}

/// The middle of a cell of a polar grid.
#[derive(Debug, Clone, Copy)]
struct Offset {
    /// Along both directions of the surface (m).
    along_m: [f64; 2],
    /// The cell's area (m²).
    area_m2: f64,
    is_around: bool,
}

/// The middles of the cells of a polar grid.
fn polar(reach_m: f64) -> impl Iterator<Item = Offset> {
    let width = reach_m / f64::from(RINGS);
    (0..RINGS).flat_map(move |ring| {
        let r = width * (f64::from(ring) + 0.5);
        (0..SPOKES).map(move |spoke| {
            // Off the planes of symmetry, and every second ring turned.
            let angle = TAU * (f64::from(spoke) + 0.25 + 0.5 * f64::from(ring % 2)) / f64::from(SPOKES);
            let along_m = [r * angle.cos(), r * angle.sin()];
            Offset { along_m, area_m2: TAU * r * width / f64::from(SPOKES), is_around: 2 * ring >= RINGS }
        })
    })
}

fn sign(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

fn on_block(Offset { along_m: [x, y], area_m2, is_around }: Offset) -> Sample {
    Sample {
        rest_m: DVec3::new(x, y, BLOCK_M[1]),
        area_m2,
        is_around,
        parameters: [x.abs(), y.abs()],
        frame: mirror(sign(x), sign(y)),
    }
}

fn mirror(x: f64, y: f64) -> DMat3 {
    DMat3::from_diagonal(DVec3::new(x, y, 1.0))
}

/// Offsets along the parallel and the meridian, as long as where it is touched.
fn at_ventricle((outer, _, cut): VentricleM, place: Place, offset: Offset) -> Sample {
    let Offset { along_m: [across, up], area_m2, is_around } = offset;
    let (meridian, touched) = (Meridian(outer), place.latitude_rad());
    // dA = short cosφ dθ · √(short² sin²φ + long² cos²φ) dφ
    let per_radians = |latitude: f64| [meridian.point_m(latitude).x, meridian.metres_per_radian(latitude)];
    let [per_azimuth, per_latitude] = per_radians(touched);
    let (azimuth, latitude) = (across / per_azimuth, touched + up / per_latitude);
    let stretch = per_radians(latitude).iter().product::<f64>() / (per_azimuth * per_latitude);
    let top = (cut / outer.1).asin();
    Sample {
        rest_m: place.turn() * DMat3::from_rotation_z(azimuth) * meridian.point_m(latitude),
        area_m2: area_m2 * stretch,
        is_around,
        parameters: [azimuth.abs(), (latitude + FRAC_PI_2) / (top + FRAC_PI_2)],
        frame: place.turn() * mirror(1.0, sign(azimuth)),
    }
}

fn on_octant() -> Vec<Sample> {
    let step = FRAC_PI_2 / f64::from(ON_OCTANT);
    let point = |index: u32| {
        let (i, j) = (index % ON_OCTANT, index / ON_OCTANT);
        let (azimuth, latitude) = (step * (f64::from(i) + 0.5), step * (f64::from(j) + 0.5));
        let direction = DVec3::new(latitude.cos() * azimuth.cos(), latitude.cos() * azimuth.sin(), latitude.sin());
        Sample {
            rest_m: direction * OCTANT_M[0],
            area_m2: (OCTANT_M[0] * step).powi(2) * latitude.cos(),
            is_around: false,
            parameters: [azimuth, latitude],
            frame: DMat3::IDENTITY,
        }
    };
    (0..ON_OCTANT * ON_OCTANT).map(point).collect()
}

/// Nodes and weights of the point of a mesh's touched side that is closest to each sample at rest.
#[derive(Debug, Clone)]
pub struct Probe(Vec<([u32; 3], [f64; 3])>);

impl Probe {
    /// Finds the points.
    pub fn new(body: &TetBody, samples: &[Sample]) -> Self {
        let find = |sample: &Sample| {
            let mut best = (f64::INFINITY, [0; 3], [0.0; 3]);
            for (triangle, corners) in body.touched.iter().zip(body.touched_corners_m()) {
                let weights = closest_weights(sample.rest_m, corners);
                let point: DVec3 = corners.iter().zip(weights).map(|(c, w)| *c * w).sum();
                let distance = point.distance_squared(sample.rest_m);
                if distance < best.0 {
                    best = (distance, *triangle, weights);
                }
            }
            (best.1, best.2)
        };
        Self(samples.iter().map(find).collect())
    }

    /// Displacements (m) there.
    pub fn displacements_m(&self, rest_m: &[DVec3], x: &[DVec3]) -> Vec<DVec3> {
        let of_node = |n: u32| x[n as usize] - rest_m[n as usize];
        self.0.iter().map(|(nodes, weights)| nodes.iter().zip(weights).map(|(&n, w)| of_node(n) * *w).sum()).collect()
    }
}

/// Error of a field: the norm of the difference over the norm of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldError {
    /// In L2 over the area.
    pub l2: f64,
    /// The same around what is pressed, over the reference there; `None` where no sample is.
    pub around_l2: Option<f64>,
    /// In the largest displacement.
    pub max: f64,
}

impl FieldError {
    /// Of `found` against `reference` at some samples; `None` without samples.
    pub fn of(samples: &[Sample], found: &[DVec3], reference: &[DVec3]) -> Option<Self> {
        if samples.is_empty() || samples.len() != reference.len() {
            return None;
        }
        let l2_where = |counts: &dyn Fn(&Sample) -> bool, of: &dyn Fn(usize) -> DVec3| {
            let counted = samples.iter().enumerate().filter(|(_, s)| counts(s));
            counted.map(|(i, s)| s.area_m2 * of(i).length_squared()).sum::<f64>().sqrt()
        };
        let max = |of: &dyn Fn(usize) -> DVec3| (0..samples.len()).map(|i| of(i).length()).fold(0.0, f64::max);
        let (difference, whole) = (|i: usize| found[i] - reference[i], |i: usize| reference[i]);
        let l2 = |counts: &dyn Fn(&Sample) -> bool| l2_where(counts, &difference) / l2_where(counts, &whole);
        let around_l2 = samples.iter().any(|s| s.is_around).then(|| l2(&|s| s.is_around));
        Some(Self { l2: l2(&|_| true), around_l2, max: max(&difference) / max(&whole) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{bodies, solid::surface_points};
    use std::f64::consts::PI;

    #[test]
    fn points_cover_their_part_of_the_surface() {
        let area = |body| points(body).iter().map(|s| s.area_m2).sum::<f64>();
        assert!((area(Body::Block) / (PI * REACH_M * REACH_M) - 1.0).abs() < 1e-12);
        assert!((area(Body::Octant) / (0.5 * PI * 0.05 * 0.05) - 1.0).abs() < 1e-3);
        assert_eq!(points(Body::Ventricle(Place::Side)).len(), 127);
    }

    #[test]
    fn the_reference_grids_parameters_name_the_same_points() {
        let mut hex = vec![
            (Body::Block, bodies::block(BLOCK_M[0], BLOCK_M[1], 5e-3, 4)),
            (Body::SmallVentricle, bodies::ventricle(SMALL_VENTRICLE_M, 0.0, 2e-3, 3)),
        ];
        let at = |place: Place| bodies::ventricle(VENTRICLE_M, place.latitude_rad(), 5e-3, 4);
        hex.extend(Place::ALL.map(|place| (Body::Ventricle(place), at(place))));
        for (body, hex) in hex {
            for sample in points(body) {
                let found = hex.grid.on_side(hex.touched, sample.parameters);
                let at: DVec3 = found.iter().map(|&(n, w)| hex.grid.positions_m[n as usize] * w).sum();
                assert!((sample.frame * at).distance(sample.rest_m) < 2e-5, "{body:?}: {at} {}", sample.rest_m);
            }
            assert!(!surface_points(&hex.grid, &hex.grid.faces(hex.touched)[0], 1).is_empty());
        }
    }

    #[test]
    fn a_probe_reads_a_linear_field_of_a_flat_side_exactly() {
        let body = Body::Block.tets(8).unwrap();
        let samples = points(Body::Block);
        let linear = |p: DVec3| DVec3::new(0.1 * p.y, 0.2 * p.x, 0.3 * p.x - 0.1 * p.y);
        let rest = body.mesh.positions_m();
        let x: Vec<DVec3> = rest.iter().map(|p| *p + linear(*p)).collect();
        let found = Probe::new(&body, &samples).displacements_m(rest, &x);
        let want: Vec<DVec3> = samples.iter().map(|s| linear(s.rest_m)).collect();
        assert!(FieldError::of(&samples, &found, &want).unwrap().max < 1e-12);
    }

    /// Half of the pattern's radius is a quarter of its area.
    #[test]
    fn an_error_around_the_contact_is_told_apart_from_one_beneath_it() {
        let samples = points(Body::Block);
        let around: f64 = samples.iter().filter(|s| s.is_around).map(|s| s.area_m2).sum();
        assert!((around / (0.75 * PI * REACH_M * REACH_M) - 1.0).abs() < 1e-12);
        let want = vec![DVec3::Z; samples.len()];
        let off = |is_around: bool| -> Vec<DVec3> {
            samples.iter().map(|s| if s.is_around == is_around { DVec3::Z * 1.1 } else { DVec3::Z }).collect()
        };
        let [beneath, around] = [false, true].map(|side| FieldError::of(&samples, &off(side), &want).unwrap());
        assert!((beneath.l2 - 0.05).abs() < 1e-12 && beneath.around_l2 == Some(0.0), "{beneath:?}");
        assert!((around.around_l2.unwrap() - 0.1).abs() < 1e-12, "{around:?}");
        assert_eq!(FieldError::of(&points(Body::Octant), &[DVec3::Z; 144], &[DVec3::Z; 144]).unwrap().around_l2, None);
    }
}
