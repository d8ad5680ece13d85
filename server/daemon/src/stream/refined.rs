//! The surface near tools refined by Loop's scheme, for viewers: smooth where one looks, whatever the size of its triangles.
//!
//! With the gap `g_i = min |x_i − c| − r` between a vertex and the tools (centre `c`, radius `r`), a *reach* R of [`REACH_EDGES`] mean edges and
//! `s(t) = t²(3 − 2t)` within [0, 1]:
//! ```text
//! w_i = s(2 (R − g_i)/R)                                      of the middle of an edge a b: (w_a + w_b)/2
//! p   = (1 − w) p_lin + w p_loop                              p_lin: the vertex itself, or the edge's middle
//! ```
//! for `p = X` and `p = u` alike, so that `x = X + u` is Loop's point of the deformed surface where `w = 1`. Triangles with a vertex of `w > 0` are split in
//! four; a neighbour with one edge split in two, with two or three it is taken in. Where that ends `w = 0`: new vertices lie on the old edges there, so the refined
//! surface goes over into the other one without a gap or a crease, and nothing jumps as a tool comes, moves or leaves.
//!
//! *Creases*: an edge at which the body turns by more than [`SHARP_DEG`] at rest is sharp, and a line of such edges stays one (Hoppe and others 1994): it is refined
//! like a boundary, by its own vertices alone; where three or more meet the vertex stays:
//! ```text
//! sharp edge  ½ (a + b)        vertex of 2 sharp edges  ¾ p + ⅛ (b_1 + b_2)        of 3 or more  p        of 1 or none  Loop's
//! ```
//!
//! At most [`MOST_NEAR`] vertices are near: of more, the nearest, and R is the gap of the first that is left out.
use super::{
    encode::{power_of_two, put, quantum_exponent},
    places,
};
use crate::bodies::served;
use bytes::{BufMut, BytesMut};
use glam::DVec3;
use palpate_physics::{
    Model,
    bodies::mass_spring::{
        around::rings_into,
        loop_scheme::{Mask, apply, edge_mask, vertex_mask},
    },
    mesh::triangulation::{Edge, Triangulation},
};
use palpate_proto::v1;
use std::collections::BTreeSet;

/// As far from a tool as so many edges the surface is refined, the nearer half of it fully.
pub const REACH_EDGES: f64 = 4.0;
/// Most vertices with a weight: a closed surface has twice as many triangles about them.
pub const MOST_NEAR: usize = 1000;

/// Turns of the surface at an edge (degrees) beyond this are meant: they stay sharp.
const SHARP_DEG: f64 = 50.0;

/// Refines frame by frame.
#[derive(Debug)]
pub struct Refiner {
    surface: Triangulation,
    /// Of each edge.
    sharp: Vec<bool>,
    reach_m: f64,
    displacements_m: Vec<DVec3>,
    weights: Vec<f64>,
    patch: Patch,
}

/// What is refined, as long as the same vertices are near.
#[derive(Debug, Default)]
struct Patch {
    /// Ascending.
    near: Vec<u32>,
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
    /// Ascending.
    replaced: BTreeSet<u32>,
}

/// Of the refined surface.
#[derive(Debug)]
struct Vertex {
    /// The ends of the edge that it halves, or twice the vertex that it stands for.
    of: [u32; 2],
    mask: Mask,
}

impl Refiner {
    /// `None` of a body that viewers see refined already, and of a surface that cannot be refined. `rest_f32_m` is what viewers have.
    pub fn new(model: &Model, rest_f32_m: &[[f32; 3]]) -> Option<Self> {
        if !served(model).may_be_refined_for_viewers() {
            return None;
        }
        let rest_m = rest_f32_m.iter().map(|x| DVec3::from(x.map(f64::from))).collect();
        let refused = |error: &_| tracing::warn!(%error, "the surface cannot be refined for viewers");
        let surface = Triangulation::new(rest_m, model.surface().triangles.clone()).inspect_err(refused).ok()?;
        let edges = surface.edges().len();
        let mean_m = (0..edges as u32).map(|edge| surface.length_m(edge)).sum::<f64>() / edges as f64;
        Some(Self {
            reach_m: REACH_EDGES * mean_m,
            displacements_m: Vec::new(),
            weights: vec![0.0; rest_f32_m.len()],
            sharp: surface.edges().iter().map(|edge| is_sharp(&surface, edge)).collect(),
            patch: Patch::default(),
            surface,
        })
    }

    /// A frame: displacements (m) of all vertices from what viewers have, and where tools are: centre (m) and radius (m).
    pub fn read(&mut self, displacements_m: &[[f32; 3]], tools: &[(DVec3, f64)]) -> v1::RefinedSurface {
        self.displacements_m.clear();
        self.displacements_m.extend(displacements_m.iter().map(|u| DVec3::from(u.map(f64::from))));
        self.weigh(tools);
        let Self { surface, displacements_m, weights, patch, .. } = self;
        let point = |vertex: &Vertex, of: &[DVec3]| {
            let [a, b] = vertex.of.map(|v| v as usize);
            let straight = (of[a] + of[b]) * 0.5;
            straight + (apply(&vertex.mask, of) - straight) * (0.5 * (weights[a] + weights[b]))
        };
        let points = |of: &[DVec3]| patch.vertices.iter().map(|vertex| point(vertex, of)).collect::<Vec<_>>();
        let (rest_m, moved_m) = (points(surface.positions_m()), points(displacements_m));
        let quantum_m =
            power_of_two(quantum_exponent(moved_m.iter().map(|u| u.abs().max_element()).fold(0.0, f64::max)));
        let mut moved = BytesMut::with_capacity(moved_m.len() * 6);
        for u in &moved_m {
            put(&mut moved, (*u / f64::from(quantum_m)).to_array().map(|c| c.round() as i16));
        }
        v1::RefinedSurface {
            replaced_u32le: little_endian(patch.replaced.iter().copied()),
            triangles_u32le: little_endian(patch.triangles.iter().flatten().copied()),
            rest_positions: Some(places::encode(&rest_m)),
            displacement_quantum_m: quantum_m,
            displacements_i16le: moved.freeze(),
        }
    }

    /// Weights of all vertices, and another patch when others are near.
    fn weigh(&mut self, tools: &[(DVec3, f64)]) {
        let gap_m = |vertex: usize| {
            let x = self.surface.positions_m()[vertex] + self.displacements_m[vertex];
            tools.iter().map(|(centre, radius_m)| x.distance(*centre) - radius_m).fold(f64::INFINITY, f64::min)
        };
        let vertices = 0..self.weights.len();
        let mut near: Vec<(f64, u32)> =
            vertices.map(|v| (gap_m(v), v as u32)).filter(|(gap, _)| *gap < self.reach_m).collect();
        let mut rim_m = self.reach_m;
        if near.len() > MOST_NEAR {
            let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            rim_m = near.select_nth_unstable_by(MOST_NEAR, order).1.0;
            near.truncate(MOST_NEAR);
        }
        self.weights.fill(0.0);
        for (gap_m, vertex) in &near {
            let t = (2.0 * (rim_m - gap_m) / self.reach_m).min(1.0);
            self.weights[*vertex as usize] = t * t * (3.0 - 2.0 * t);
        }
        let mut near: Vec<u32> = near.into_iter().map(|(_, vertex)| vertex).collect();
        near.sort_unstable();
        if near != self.patch.near {
            self.patch = Patch::new(&self.surface, &self.sharp, near);
        }
    }
}

impl Patch {
    fn new(surface: &Triangulation, sharp: &[bool], near: Vec<u32>) -> Self {
        let mut split = Vec::new();
        rings_into(surface, &near, 1, usize::MAX, &mut split, &mut Vec::new());
        let is_split = |triangle: &u32| split.binary_search(triangle).is_ok();
        let corners: BTreeSet<u32> = split.iter().flat_map(|&t| surface.triangles()[t as usize]).collect();
        // Those with a triangle that is not split stay: w = 0.
        let inside: Vec<u32> = corners.into_iter().filter(|&v| surface.triangles_at(v).iter().all(is_split)).collect();
        let edges: BTreeSet<u32> = split.iter().flat_map(|&t| surface.edges_of(t)).collect();
        let edges: Vec<u32> = edges.into_iter().collect();
        let first = surface.positions_m().len() as u32;
        let corner = |vertex: u32| inside.binary_search(&vertex).map_or(vertex, |number| first + number as u32);
        let middle = |edge: &u32| edges.binary_search(edge).ok().map(|number| first + (inside.len() + number) as u32);
        let mut triangles = Vec::new();
        let mut replaced = BTreeSet::new();
        let across = edges.iter().flat_map(|&edge| surface.edges()[edge as usize].triangles);
        // Of an edge on the boundary the other side is no triangle.
        for triangle in split.iter().copied().chain(across.filter(|&t| (t as usize) < surface.triangles().len())) {
            if replaced.insert(triangle) {
                let [a, b, c] = surface.triangles()[triangle as usize].map(corner);
                match surface.edges_of(triangle).each_ref().map(middle) {
                    [Some(ab), Some(bc), Some(ca)] => {
                        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
                    }
                    [Some(ab), _, _] => triangles.extend([[a, ab, c], [ab, b, c]]),
                    [_, Some(bc), _] => triangles.extend([[b, bc, a], [bc, c, a]]),
                    [_, _, Some(ca)] => triangles.extend([[c, ca, b], [ca, a, b]]),
                    [None, None, None] => {}
                }
            }
        }
        let of_vertices = inside.iter().map(|&v| Vertex { of: [v; 2], mask: mask_of_vertex(surface, sharp, v) });
        let of_edges = edges.iter().map(|&edge| {
            let of = surface.edges()[edge as usize].nodes;
            let straight = || of.map(|end| (end, 0.5)).to_vec();
            Vertex {
                of,
                mask: if sharp[edge as usize] { straight() } else { edge_mask(&surface.edges()[edge as usize]) },
            }
        });
        Self { vertices: of_vertices.chain(of_edges).collect(), near, triangles, replaced }
    }
}

fn is_sharp(surface: &Triangulation, edge: &Edge) -> bool {
    let normal = |triangle: u32| {
        let [a, b, c] = surface.triangles()[triangle as usize].map(|v| surface.positions_m()[v as usize]);
        (b - a).cross(c - a)
    };
    !edge.is_boundary() && normal(edge.triangles[0]).angle_between(normal(edge.triangles[1])).to_degrees() > SHARP_DEG
}

fn mask_of_vertex(surface: &Triangulation, sharp: &[bool], vertex: u32) -> Mask {
    let ends = surface.edges_at(vertex).iter().filter(|&&edge| sharp[edge as usize]);
    match ends.map(|&edge| surface.other_end(edge, vertex)).collect::<Vec<_>>()[..] {
        [] | [_] => vertex_mask(surface, vertex),
        [one, other] => vec![(vertex, 0.75), (one, 0.125), (other, 0.125)],
        _ => vec![(vertex, 1.0)],
    }
}

fn little_endian(numbers: impl Iterator<Item = u32>) -> bytes::Bytes {
    let mut bytes = BytesMut::new();
    numbers.for_each(|number| bytes.put_u32_le(number));
    bytes.freeze()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::keyframe::rest_positions_f32;
    use palpate_physics::bodies::mass_spring::loop_scheme::refined;
    use palpate_scene::{Limits, parse};

    const BALL: &str = "[scene]\nname = \"t\"\n[body.sphere_shell]\ninner_radius_mm = 30\nouter_radius_mm = 40\n\
        target_tets = TETS\n[[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.4\ndensity_kg_per_m3 = 1e3\n";

    fn ball(tets: u32) -> Refiner {
        let text = BALL.replace("TETS", &tets.to_string());
        let model = Model::build(parse(&text, "t", None, &Limits::local(), &mut |_, _| ()).unwrap().model).unwrap();
        Refiner::new(&model, &rest_positions_f32(&model)).unwrap()
    }

    /// A dent (m) about a point.
    fn dented(refiner: &Refiner, at: DVec3) -> Vec<[f32; 3]> {
        let dent = |x: &DVec3| -x.normalize() * 4e-3 * (-(x.distance_squared(at) / 1e-4)).exp();
        refiner.surface.positions_m().iter().map(|x| dent(x).to_array().map(|c| c as f32)).collect()
    }

    fn numbers(bytes: &[u8]) -> Vec<u32> {
        bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }

    /// What a viewer draws: rest positions (m), displacements (m), triangles.
    fn drawn(
        refiner: &Refiner,
        u: &[[f32; 3]],
        message: &v1::RefinedSurface,
    ) -> (Vec<DVec3>, Vec<DVec3>, Vec<[u32; 3]>) {
        let places = message.rest_positions.as_ref().unwrap();
        let triple = |b: &[u8], of: fn([u8; 2]) -> f64| DVec3::from([0, 2, 4].map(|at| of([b[at], b[at + 1]])));
        let corner = places.corner_m.map(|c| DVec3::new(c.x, c.y, c.z)).unwrap();
        let place = |b| corner + triple(b, |b| f64::from(u16::from_le_bytes(b))) * f64::from(places.quantum_m);
        let moved = |b| triple(b, |b| f64::from(i16::from_le_bytes(b))) * f64::from(message.displacement_quantum_m);
        let rest_m = refiner.surface.positions_m().iter().copied();
        let rest_m = rest_m.chain(places.positions_u16le.chunks_exact(6).map(place)).collect();
        let u_m = u.iter().map(|u| DVec3::from(u.map(f64::from)));
        let u_m = u_m.chain(message.displacements_i16le.chunks_exact(6).map(moved)).collect();
        let replaced = numbers(&message.replaced_u32le);
        assert!(replaced.is_sorted());
        let kept = refiner.surface.triangles().iter().zip(0..).filter(|(_, t)| replaced.binary_search(t).is_err());
        let small = numbers(&message.triangles_u32le);
        (rest_m, u_m, kept.map(|(t, _)| *t).chain(small.chunks_exact(3).map(|t| [t[0], t[1], t[2]])).collect())
    }

    /// The surface of the vertices that are drawn: those that others took the place of are not.
    fn without_unused(of_m: &[DVec3], triangles: &[[u32; 3]]) -> Triangulation {
        let used: Vec<u32> = triangles.iter().flatten().copied().collect::<BTreeSet<_>>().into_iter().collect();
        let number = |v: u32| used.binary_search(&v).unwrap() as u32;
        let positions_m = used.iter().map(|&v| of_m[v as usize]).collect();
        Triangulation::new(positions_m, triangles.iter().map(|t| t.map(number)).collect()).unwrap()
    }

    /// Every vertex of the surface refined once: where Loop's scheme has it, and where it is drawn.
    fn everywhere(refiner: &Refiner, of_m: &[DVec3], drawn_m: &[DVec3]) -> Vec<(DVec3, DVec3, DVec3)> {
        let (surface, vertices) = (&refiner.surface, refiner.surface.positions_m().len());
        let (loop_m, _) = refined(&surface.moved(of_m.to_vec()).unwrap());
        let ends = (0..vertices as u32).map(|v| [v; 2]).chain(surface.edges().iter().map(|edge| edge.nodes));
        let straight_m = ends.clone().map(|ends| ends.map(|v| of_m[v as usize]).iter().sum::<DVec3>() * 0.5);
        let own =
            |ends| refiner.patch.vertices.iter().position(|vertex| vertex.of == ends).map(|n| drawn_m[vertices + n]);
        let shown = ends.zip(straight_m.clone()).map(|(ends, straight)| own(ends).unwrap_or(straight));
        loop_m.into_iter().zip(straight_m).zip(shown).map(|((a, b), c)| (a, b, c)).collect()
    }

    #[test]
    fn near_a_tool_it_is_the_schemes_and_goes_over_into_the_rest() {
        let mut refiner = ball(20_000);
        let (at, radius_m) = (DVec3::new(0.0, 0.024, 0.032), 6e-3);
        let u = dented(&refiner, at);
        let tools = [(at * (42.0 / 40.0), radius_m)];
        let message = refiner.read(&u, &tools);
        let (rest_m, u_m, triangles) = drawn(&refiner, &u, &message);
        // No edge with one triangle or three, no vertex of two fans, none without area.
        let whole = without_unused(&rest_m, &triangles);
        assert!(whole.edges().iter().all(|edge| !edge.is_boundary()));
        assert!(whole.triangles().len() > refiner.surface.triangles().len() + 100);
        let x_m: Vec<DVec3> = rest_m.iter().zip(&u_m).map(|(rest, u)| *rest + *u).collect();
        let of_m = &x_m[..refiner.surface.positions_m().len()];
        let (mut as_scheme, mut between, mut straight) = (0, 0, 0);
        for (number, (by_loop, by_line, shown)) in everywhere(&refiner, of_m, &x_m).into_iter().enumerate() {
            let of = |v: u32| {
                let gap_m = of_m[v as usize].distance(tools[0].0) - radius_m;
                let t = (2.0 - 2.0 * gap_m / refiner.reach_m).clamp(0.0, 1.0);
                t * t * (3.0 - 2.0 * t)
            };
            let w = match number.checked_sub(of_m.len()) {
                None => of(number as u32),
                Some(edge) => refiner.surface.edges()[edge].nodes.map(of).iter().sum::<f64>() * 0.5,
            };
            assert!(shown.distance(by_line.lerp(by_loop, w)) < 2e-6, "{number}, w = {w}: {shown} {by_loop} {by_line}");
            *if w > 0.999 {
                &mut as_scheme
            } else if w > 0.0 {
                &mut between
            } else {
                &mut straight
            } += 1;
        }
        assert!(as_scheme > 10 && between > 50 && straight > 1000, "{as_scheme} {between} {straight}");
    }

    /// A cube keeps its edges and corners; all else of it is flat.
    #[test]
    fn what_is_sharp_stays_sharp() {
        let text = BALL.replace(
            "[body.sphere_shell]\ninner_radius_mm = 30\nouter_radius_mm = 40\ntarget_tets = TETS",
            "[body.box]\nsize_mm = [20, 20, 20]\ncells = [4, 4, 4]",
        );
        let model = Model::build(parse(&text, "t", None, &Limits::local(), &mut |_, _| ()).unwrap().model).unwrap();
        let mut refiner = Refiner::new(&model, &rest_positions_f32(&model)).unwrap();
        assert_eq!(refiner.sharp.iter().filter(|sharp| **sharp).count(), 12 * 4);
        let u = vec![[0.0; 3]; refiner.surface.positions_m().len()];
        let message = refiner.read(&u, &[(refiner.surface.positions_m()[0], 0.1)]);
        let (rest_m, _, _) = drawn(&refiner, &u, &message);
        let everywhere = everywhere(&refiner, &rest_m[..u.len()], &rest_m);
        assert!(
            everywhere.iter().all(|(_, straight, shown)| straight.distance(*shown) < 1e-6),
            "nothing is rounded off"
        );
        assert!(everywhere.iter().any(|(by_loop, _, shown)| by_loop.distance(*shown) > 1e-4), "without creases it was");
        assert_eq!(refiner.patch.near.len(), u.len());
    }

    /// From far over the surface and away, in steps of 0.1 mm.
    #[test]
    fn nothing_jumps_as_a_tool_moves() {
        let mut refiner = ball(3000);
        let u = vec![[0.0; 3]; refiner.surface.positions_m().len()];
        let rest_m = refiner.surface.positions_m().to_vec();
        let mut before: Option<Vec<DVec3>> = None;
        let (mut patches, mut largest_m, mut by_scheme_m) = (BTreeSet::new(), 0.0_f64, 0.0_f64);
        for step in 0..600 {
            let centre = DVec3::new(-0.03 + 1e-4 * f64::from(step), 0.004, 0.045);
            let message = refiner.read(&u, &[(centre, 5e-3), (DVec3::splat(f64::NAN), 5e-3)]);
            let (drawn_m, _, _) = drawn(&refiner, &u, &message);
            let points = everywhere(&refiner, &rest_m, &drawn_m);
            by_scheme_m =
                points.iter().map(|(_, straight, shown)| straight.distance(*shown)).fold(by_scheme_m, f64::max);
            let shown: Vec<DVec3> = points.into_iter().map(|(_, _, shown)| shown).collect();
            let moved_m = before.iter().flatten().zip(&shown).map(|(a, b)| a.distance(*b));
            largest_m = moved_m.fold(largest_m, f64::max);
            before = Some(shown);
            patches.insert(refiner.patch.near.clone());
        }
        assert!(
            patches.len() > 10 && largest_m < 2e-5 && by_scheme_m > 2e-4,
            "{} {largest_m} {by_scheme_m}",
            patches.len()
        );
    }

    #[test]
    fn none_near_is_nothing_and_a_tool_over_everything_is_bounded() {
        let mut refiner = ball(20_000);
        let u = vec![[0.0; 3]; refiner.surface.positions_m().len()];
        let far = refiner.read(&u, &[(DVec3::splat(1.0), 5e-3)]);
        assert!(far.replaced_u32le.is_empty() && far.triangles_u32le.is_empty() && far.displacements_i16le.is_empty());
        assert!(u.len() > MOST_NEAR + 100, "{}", u.len());
        let over = refiner.read(&u, &[(DVec3::new(0.0, 0.0, 0.01), 0.1)]);
        let (rest_m, _, triangles) = drawn(&refiner, &u, &over);
        assert_eq!(refiner.patch.near.len(), MOST_NEAR);
        assert!(without_unused(&rest_m, &triangles).edges().iter().all(|edge| !edge.is_boundary()));
    }
}
