//! The bodies of the contact problems as graded grids, cut at their planes of symmetry.
use super::grid::{HexGrid, Side, graded};
use crate::problems::{body::VentricleM, place::Meridian};
use glam::{BVec3, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// How much of a body a grid holds, and which of its sides is what.
#[derive(Debug, Clone)]
pub struct Body {
    /// The grid.
    pub grid: HexGrid,
    /// Planes of symmetry and holders: sides whose nodes cannot move along some axes.
    pub held: Vec<(Side, [bool; 3])>,
    /// The side that is touched.
    pub touched: Side,
    /// The whole body over what is modelled: 2 per plane of symmetry.
    pub multiplicity: f64,
    /// Where it is touched (m), and the unit normal there, outwards.
    pub touch_m: DVec3,
    /// Outward unit normal there.
    pub normal: DVec3,
}

impl Body {
    /// Of every node, the axes along which it can move.
    pub fn free_axes(&self) -> Vec<BVec3> {
        let mut free = vec![BVec3::TRUE; self.grid.positions_m.len()];
        for (side, axes) in &self.held {
            for node in self.grid.faces(*side).into_iter().flatten() {
                free[node as usize] &= !BVec3::from_array(*axes);
            }
        }
        free
    }
}

/// A block `width × width × height` (m) held at its lower face, touched in the middle of the upper one: a quarter of it, each way
/// in `n` elements over one and a half times `contact_m`, the radius of the contact, and `n` beyond.
pub fn block(width_m: f64, height_m: f64, contact_m: f64, n: usize) -> Body {
    let across = from_contact(contact_m, 0.5 * width_m, (n, n));
    let down = from_contact(contact_m, height_m, (n, n)).iter().rev().map(|depth| height_m - depth).collect();
    let grid = HexGrid::new([across.clone(), across, down], |p| p);
    let side = |parameter, upper| Side { parameter, upper };
    Body {
        grid,
        held: vec![
            (side(0, false), [true, false, false]),
            (side(1, false), [false, true, false]),
            (side(2, false), [true; 3]),
        ],
        touched: side(2, true),
        multiplicity: 4.0,
        touch_m: DVec3::Z * height_m,
        normal: DVec3::Z,
    }
}

/// Intervals from 0 to `length`: `near` equal ones over one and a half radii of the contact, and `far` beyond, each longer than the last,
/// `x(t) = x₁ + h·far (e^{at} − 1)/a` for t from 0 to 1, which goes on from the equal ones' length h. Grids with `near` and `far` in the
/// same proportion so are refinements of one another, as Richardson's extrapolation supposes.
fn from_contact(contact: f64, length: f64, (near, far): (usize, usize)) -> Vec<f64> {
    let equal = 1.5 * contact;
    let first = equal / near as f64;
    // (eᵃ − 1)/a = (length − x₁)/(h·far)
    let stretch = (length - equal) / (first * far as f64);
    if stretch <= 1.0 {
        return graded(0.0, length, near + far, 1.0);
    }
    let (mut low, mut high) = (0.0_f64, 20.0_f64);
    for _ in 0..80 {
        let middle = f64::midpoint(low, high);
        if middle.exp_m1() < stretch * middle { low = middle } else { high = middle }
    }
    let beyond = |i: usize| equal + (length - equal) * (high * i as f64 / far as f64).exp_m1() / high.exp_m1();
    let mut breaks = graded(0.0, equal, near, 1.0);
    breaks.extend((1..=far).map(beyond));
    breaks
}

/// The truncated-ellipsoid ventricle of `shapes::ventricle` with semi-axes (short, long) in metres, held at its base and
/// touched in the plane of +x and z, at a latitude (rad) of its outer ellipsoid, by a contact of radius `contact_m`: the half with y ≥ 0. `n` elements over one and a half times that
/// radius each way, inwards too; beyond, `2n` to the opposite meridian and to the apex, `n` to the base and through the wall.
pub fn ventricle((outer_m, inner_m, cut_z_m): VentricleM, latitude_rad: f64, contact_m: f64, n: usize) -> Body {
    let outer = Meridian(outer_m);
    let place = |p: DVec3| {
        let (azimuth, t, s) = (p.x, p.y, p.z);
        let on = |(short, long): (f64, f64)| {
            let top = (cut_z_m / long).asin();
            let (sin, cos) = (t * (top + FRAC_PI_2) - FRAC_PI_2).sin_cos();
            DVec3::new(short * cos * azimuth.cos(), short * cos * azimuth.sin(), long * sin)
        };
        on(inner_m).lerp(on(outer_m), s)
    };
    let span = (cut_z_m / outer_m.1).asin() + FRAC_PI_2;
    let at_touch = (latitude_rad + FRAC_PI_2) / span;
    // A metre along the meridian is so much of the parameter where it is touched.
    let contact_t = contact_m / (outer.metres_per_radian(latitude_rad) * span);
    let down = from_contact(contact_t, at_touch, (n, 2 * n));
    let up = from_contact(contact_t, 1.0 - at_touch, (n, if latitude_rad < 0.0 { 2 * n } else { n }));
    let mut along: Vec<f64> = down.iter().skip(1).rev().map(|t| at_touch - t).collect();
    along.extend(up.iter().map(|t| at_touch + t));
    let around = from_contact(contact_m / outer.point_m(latitude_rad).x, PI, (n, 2 * n));
    let wall = outer_m.0 - inner_m.0;
    let through = from_contact(contact_m / wall, 1.0, (n, n)).iter().rev().map(|depth| 1.0 - depth).collect();
    let side = |parameter, upper| Side { parameter, upper };
    Body {
        grid: HexGrid::new([around, along, through], place),
        held: vec![
            (side(0, false), [false, true, false]),
            (side(0, true), [false, true, false]),
            (side(1, true), [true; 3]),
        ],
        touched: side(2, true),
        multiplicity: 2.0,
        touch_m: outer.point_m(latitude_rad),
        normal: outer.normal(latitude_rad),
    }
}

/// An octant of a sphere shell between two radii (m), `n` elements each way: the reference's own test against Lamé.
pub fn sphere_octant(inner_m: f64, outer_m: f64, n: usize) -> Body {
    let place = |p: DVec3| {
        let (azimuth, latitude) = (p.x, p.y);
        DVec3::new(latitude.cos() * azimuth.cos(), latitude.cos() * azimuth.sin(), latitude.sin()) * p.z
    };
    let quarter = graded(0.0, FRAC_PI_2, n, 1.0);
    let side = |parameter, upper| Side { parameter, upper };
    Body {
        grid: HexGrid::new([quarter.clone(), quarter, graded(inner_m, outer_m, n, 1.5)], place),
        held: vec![
            (side(0, false), [false, true, false]),
            (side(0, true), [true, false, false]),
            (side(1, false), [false, false, true]),
        ],
        touched: side(2, false),
        multiplicity: 8.0,
        touch_m: DVec3::X * inner_m,
        normal: DVec3::NEG_X,
    }
}
