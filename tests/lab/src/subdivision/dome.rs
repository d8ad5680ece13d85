//! Figure 12: a hemisphere pressed at a vertex, coarse and with one and two rings refined, drawn side by side.
use glam::DVec3;
use palpate_physics::{
    bodies::mass_spring::{
        Refined, Region,
        loop_scheme::refined,
        matching::{Way, matched, point_force_n},
        region::Constants,
    },
    mesh::{Triangulation, TriangulationError},
};
use std::{collections::BTreeMap, fmt::Write as _};
use thiserror::Error;

const RADIUS_M: f64 = 0.04;
/// How often each triangle of an octahedron is split in four.
const SPLITS: u32 = 3;
const COARSE: Constants = Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 60.0 };
/// Where it is pressed, and how deep over the mean edge's length.
const TOWARDS: DVec3 = DVec3::new(0.35, -0.35, 0.87);
const DEPTH: f64 = 1.0;
/// Of a picture, in its units.
const SIZE: f64 = 420.0;

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum DomeError {
    /// The hemisphere is no surface.
    #[error(transparent)]
    Surface(#[from] TriangulationError),
    /// The springs come to no rest.
    #[error(transparent)]
    NoRest(#[from] palpate_physics::bodies::mass_spring::equilibrium::NoRest),
    /// No constants give the force.
    #[error(transparent)]
    NoMatch(#[from] palpate_physics::bodies::mass_spring::matching::NoMatch),
}

/// One of the pictures.
#[derive(Debug)]
pub struct Dome {
    /// Rings refined.
    pub rings: u32,
    /// Force (N) on the vertex.
    pub force_n: f64,
    x_m: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    is_inside: Vec<bool>,
}

/// Coarse, one ring and two, with constants matched at this depth: the same force.
///
/// # Errors
/// [`DomeError`].
pub fn domes() -> Result<Vec<Dome>, DomeError> {
    let surface = hemisphere()?;
    let rest_m = refined(&surface).0;
    let distance_m = |vertex: &u32| rest_m[*vertex as usize].distance(TOWARDS.normalize() * RADIUS_M);
    let vertices = 0..surface.positions_m().len() as u32;
    let centre = vertices.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b))).unwrap_or_default();
    let edges = 0..surface.edges().len() as u32;
    let mean_m = edges.map(|edge| surface.length_m(edge)).sum::<f64>() / surface.edges().len() as f64;
    let inwards = rest_m[centre as usize].normalize() * (-DEPTH * mean_m);
    let mut domes: Vec<Dome> = Vec::new();
    for rings in 0..=2 {
        let refined = Refined::new(&surface, &Region::rings(&surface, &[centre], rings), &rest_m);
        let inside = match domes.first() {
            None => COARSE,
            Some(coarse) => matched(&refined, &COARSE, centre, inwards, coarse.force_n, Way::Ratio(1.0))?,
        };
        let net = refined.net(&COARSE, &inside);
        let mut x_m = net.rest_m.clone();
        let force_n = point_force_n(&net, centre, inwards, &mut x_m)?.dot(inwards.normalize());
        let Refined { triangles, is_inside, .. } = refined;
        domes.push(Dome { rings, force_n, x_m, triangles, is_inside });
    }
    Ok(domes)
}

/// The upper half of an octahedron whose triangles are split and pushed out to a sphere.
fn hemisphere() -> Result<Triangulation, TriangulationError> {
    let mut p = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y];
    let mut triangles = vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]];
    for _ in 0..SPLITS {
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[one, other]: [u32; 2]| {
                *middles.entry([one.min(other), one.max(other)]).or_insert_with(|| {
                    p.push((p[one as usize] + p[other as usize]).normalize());
                    p.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Triangulation::new(p.into_iter().map(|p| p * RADIUS_M).collect(), triangles)
}

impl Dome {
    /// Seen from in front and above, what is nearer over what is farther; what is refined in another colour.
    pub fn svg(&self) -> String {
        let towards = DVec3::new(0.45, -0.6, 0.66).normalize();
        let right = DVec3::Z.cross(towards).normalize();
        let up = towards.cross(right);
        let light = (towards + up * 0.6 - right * 0.5).normalize();
        let scale = 0.44 * SIZE / RADIUS_M;
        let at = |x: DVec3| [0.5 * SIZE + x.dot(right) * scale, 0.62 * SIZE - x.dot(up) * scale];
        let corners = |triangle: &[u32; 3]| triangle.map(|node| self.x_m[node as usize]);
        let depth = |triangle: &[u32; 3]| corners(triangle).iter().map(|x| x.dot(towards)).sum::<f64>();
        let mut order = self.triangles.clone();
        order.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        let mut out = format!(
            "<svg viewBox=\"0 0 {SIZE} {:.0}\" role=\"img\" aria-label=\"a pressed hemisphere, rings refined: {}\" xmlns=\"http://www.w3.org/2000/svg\" \
             stroke=\"#1b1f24\" stroke-width=\"0.7\" stroke-linejoin=\"round\">",
            0.95 * SIZE,
            self.rings
        );
        for triangle in &order {
            let [a, b, c] = corners(triangle);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let facing = if normal.dot(towards) < 0.0 { -normal } else { normal };
            let shade = 0.45 + 0.55 * facing.dot(light).max(0.0);
            let is_refined = triangle.iter().all(|&node| self.is_inside[node as usize]);
            let colour = if is_refined { [240.0, 168.0, 120.0] } else { [176.0, 200.0, 220.0] };
            let [red, green, blue] = colour.map(|part: f64| (part * shade) as u8);
            let points = [a, b, c].map(at).map(|[x, y]| format!("{x:.1},{y:.1}")).join(" ");
            let _ = write!(out, "<polygon points=\"{points}\" fill=\"#{red:02x}{green:02x}{blue:02x}\"/>");
        }
        out.push_str("</svg>");
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same force on all three, and a dent that is deepest where it is pressed.
    #[test]
    fn refined_domes_answer_as_the_coarse_one() {
        let domes = domes().unwrap();
        let counts: Vec<usize> = domes.iter().map(|dome| dome.triangles.len()).collect();
        // A ring about a vertex of degree six: six triangles become 24, six beside them two each.
        assert_eq!(counts, [256, 256 + 18 + 6, 256 + 72 + 12]);
        for dome in &domes {
            assert!((dome.force_n / domes[0].force_n - 1.0).abs() < 1e-9, "{}", dome.force_n);
            assert_eq!(dome.svg().matches("<polygon").count(), dome.triangles.len());
        }
    }
}
