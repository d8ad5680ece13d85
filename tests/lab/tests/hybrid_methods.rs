//! Particle methods for the hybrid body's fine level, on the block under the small patch, against the lab's references.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
mod hybrid_body;

use glam::{DMat3, DMat4, DVec3, DVec4};
use hybrid_body::{Case, MakePlaces, MakePoints, error, problem};
use palpate_physics::hybrid::{
    kernels::{Kernel, SMOOTHING},
    methods::{CONTROL, Method},
    partition::Partition,
    place::Place,
    points::Points,
};

const NU: [&str; 3] = ["0.30", "0.45", "0.49"];
const RAW: Method = Method::RawSph(Kernel::Cone);

/// Relative errors of the answer and of the field, with 192 coarse tets and particles every 2.5 mm.
fn errors(name: &str, nu: &str, active: usize, points: Option<MakePoints>, places: Option<MakePlaces>) -> (f64, f64) {
    print!("{name}: ");
    let case = Case { coarse_tets: 4, skin_tets: 32, spacing_m: 2.5e-3, active, points, places };
    error(&problem(&format!("block-patch-small-nu{nu}")), &case)
}

fn of(method: Method) -> MakePoints {
    Box::new(move |partition, active| method.points(partition, active))
}

#[test]
fn explore() {
    for active in [600, 2400] {
        for nu in NU {
            let name = format!("{active} {nu}");
            errors(&name, nu, active, None, None);
            for method in [
                Method::CorrectedSph { kernel: Kernel::Cone, control: CONTROL },
                Method::CorrectedSph { kernel: Kernel::WendlandC2, control: CONTROL },
                Method::CorrectedSph { kernel: Kernel::WendlandC2, control: 1.0 },
                Method::MovingLeastSquares { control: CONTROL },
                Method::ElementFreeGalerkin,
                Method::NodalSmoothing { gamma: 0.3 },
            ] {
                print!("{method:?} ");
                errors(&name, nu, active, Some(of(method)), None);
            }
            for method in [Method::MovingLeastSquares { control: CONTROL }, Method::ElementFreeGalerkin] {
                print!("own functions {method:?} ");
                errors(&name, nu, active, Some(of(method)), Some(by_least_squares));
            }
        }
    }
}

/// The rows' gradients multiplied by what is made of the gradient that they give the identity map.
fn corrected(points: &mut Points, by: impl Fn(&DMat3) -> DMat3) {
    for row in &mut points.rows {
        let by = by(&row.of_identity());
        for term in &mut row.terms {
            term.gradient_per_m = by * term.gradient_per_m;
        }
    }
}

/// Raw sums see `I + ∇u A_qᵀ`: what a corrected method sees of displacement, by far too little of it.
#[test]
fn raw_sums_are_soft_because_they_see_too_little_strain() {
    for nu in NU {
        let variant = |name: &str, by: fn(&DMat3) -> DMat3| {
            let points: MakePoints = Box::new(move |partition, active| {
                let mut points = RAW.points(partition, active);
                corrected(&mut points, by);
                points
            });
            1.0 + errors(name, nu, 600, Some(points), None).0
        };
        // A far from the surface is 0.80 I; beneath it its zz is 0.70, in it A is (0.62, 0.62, 0.40).
        let raw = variant("raw", |_| DMat3::IDENTITY);
        let corrected = variant("corrected everywhere", DMat3::inverse);
        let inside = variant("corrected to 0.80 at the surface", |a| a.inverse() * a.x_axis.x.max(0.79916));
        let surface = variant("corrected by 1/0.80 everywhere", |_| DMat3::IDENTITY * (1.0 / 0.79916));
        println!(
            "{nu}: {raw} {corrected} inside {} surface {} product {}",
            inside / corrected,
            surface / corrected,
            inside * surface / corrected
        );
    }
}

/// Values of the shape functions of moving least squares, as places of up to eight particles.
fn by_least_squares(partition: &Partition, point_m: DVec3) -> Vec<Place> {
    let smoothing_m = SMOOTHING * partition.sites().spacing_m();
    let near = partition.particles_near(point_m, Kernel::support_m(smoothing_m));
    let row = |&particle: &u32| {
        let span = (partition.particle_m(particle) - point_m) / smoothing_m;
        let weight = Kernel::WendlandC2.value_per_m3(span.length() * smoothing_m, smoothing_m) * smoothing_m.powi(3);
        (particle, DVec4::new(1.0, span.x, span.y, span.z), weight)
    };
    let rows: Vec<(u32, DVec4, f64)> = near.iter().map(row).collect();
    let moment = rows
        .iter()
        .fold(DMat4::ZERO, |sum, (_, p, w)| sum + DMat4::from_cols(*p * p.x, *p * p.y, *p * p.z, *p * p.w) * *w);
    let inverse = moment.inverse();
    let of_eight = |rows: &[(u32, DVec4, f64)]| {
        let mut place = Place { particles: [rows[0].0; 8], weights: [0.0; 8] };
        for (k, (particle, p, w)) in rows.iter().enumerate() {
            (place.particles[k], place.weights[k]) = (*particle, (inverse * *p).x * w);
        }
        place
    };
    rows.chunks(8).map(of_eight).collect()
}
