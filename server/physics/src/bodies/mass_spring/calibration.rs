//! Calibration of the table of spring constants ([`super::constants_table`]) of a given surface on some of its vertices.
//!
//! At every sample vertex `v` and displacement `x = ξ L_v` inwards, where `L_v` is the mean length of its edges,
//! constants of a fixed ratio are matched ([`super::matching`]) on the piece of surface around it. The table has their
//! medians over the samples, and the largest relative difference of a sample from the median. It also has the energy of
//! the refined piece over that of the coarse one, `U′(x; K′(x))/U(x)`: both answer with the same force at each `x`, but
//! constants that change during the displacement add or remove the difference, which must be booked where they are
//! changed.
//!
//! *Limits.* The force of one vertex is matched. A tool that touches many vertices is met too stiffly (by `N′/N` at
//! worst); the [`super::matching::area_consistent`] constants are for such tools.
use super::{
    constants_table::{Calibration, CalibrationError, ConstantsTable, TableRow, fingerprint},
    loop_scheme::refined,
    matching::{Way, matched, point_force_n},
    net::Net,
    region::{Refined, Region},
    triangulation::{NONE, Triangulation, TriangulationError},
};
use glam::DVec3;
use std::collections::BTreeMap;

/// Displacements over the mean length of the edges.
const XI: [f64; 9] = [0.01, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0];
/// Number of rings that a sample's piece of surface has beyond the refined ones; the surface farther away hardly
/// matters.
const BEYOND: u32 = 5;

impl ConstantsTable {
    /// Calibrates a surface. `tell` is called with the fraction that is done.
    ///
    /// # Errors
    /// [`CalibrationError`].
    pub fn calibrate(
        surface: &Triangulation,
        of: Calibration,
        tell: &mut dyn FnMut(f64),
    ) -> Result<Self, CalibrationError> {
        check(&of)?;
        let samples = samples(surface, &of)?;
        let fine_rest_m = refined(surface).0;
        let mut found: Vec<Vec<(f64, f64)>> = Vec::new();
        for (done, &vertex) in samples.iter().enumerate() {
            found.push(of_sample(surface, &fine_rest_m, &of, vertex)?);
            tell((done + 1) as f64 / samples.len() as f64);
        }
        let row = |(number, xi): (usize, &f64)| {
            let ratios: Vec<f64> = found.iter().map(|sample| sample[number].0).collect();
            let anchor_ratio = median(&ratios);
            let spread = ratios.iter().map(|ratio| (ratio / anchor_ratio - 1.0).abs()).fold(0.0, f64::max);
            let energies: Vec<f64> = found.iter().map(|sample| sample[number].1).collect();
            TableRow { xi: *xi, anchor_ratio, spread, energy_ratio: median(&energies) }
        };
        Ok(Self { fingerprint: fingerprint(surface), of, rows: XI.iter().enumerate().map(row).collect() })
    }
}

fn check(of: &Calibration) -> Result<(), CalibrationError> {
    let numbers =
        [("mesh_n_per_m", of.coarse.mesh_n_per_m), ("anchor_n_per_m", of.coarse.anchor_n_per_m), ("ratio", of.ratio)];
    let bad = numbers.into_iter().find(|(_, value)| !(*value > 0.0 && value.is_finite()));
    if let Some((name, value)) = bad {
        return Err(CalibrationError::Setting { name, value, rule: "finite and larger than 0" });
    }
    for (name, count) in [("rings", of.rings as usize), ("samples", of.samples)] {
        if count == 0 {
            return Err(CalibrationError::Setting { name, value: 0.0, rule: "1 or more" });
        }
    }
    Ok(())
}

/// Returns sample vertices, evenly spaced by number, whose refined rings do not reach the boundary.
fn samples(surface: &Triangulation, of: &Calibration) -> Result<Vec<u32>, CalibrationError> {
    let within = |vertex: &u32| {
        let region = Region::rings(surface, &[*vertex], of.rings);
        region.triangles().iter().flat_map(|&t| surface.triangles()[t as usize]).all(|v| !surface.is_boundary(v))
    };
    let count = surface.positions_m().len();
    let stride = (count / of.samples).max(1);
    // Each stride gives its first vertex that is far enough from the boundary.
    let first = |start: usize| (start as u32..(start + stride).min(count) as u32).find(within);
    let found: Vec<u32> = (0..count).step_by(stride).filter_map(first).take(of.samples).collect();
    if found.is_empty() { Err(CalibrationError::NoSample { rings: of.rings }) } else { Ok(found) }
}

/// Returns `K′_h/K_h` and `U′/U` at every displacement of a sample vertex.
fn of_sample(
    surface: &Triangulation,
    fine_rest_m: &[DVec3],
    of: &Calibration,
    vertex: u32,
) -> Result<Vec<(f64, f64)>, CalibrationError> {
    let in_piece = |source| CalibrationError::Piece { vertex, source };
    let (piece, piece_rest_m, own) = piece(surface, fine_rest_m, vertex, of.rings + BEYOND).map_err(in_piece)?;
    let after = Refined::new(&piece, &Region::rings(&piece, &[own], of.rings), &piece_rest_m);
    let before = Net::uniform(&piece, of.coarse.mesh_n_per_m, of.coarse.anchor_n_per_m);
    let edges = piece.edges_at(own);
    let length_m = edges.iter().map(|&edge| piece.length_m(edge)).sum::<f64>() / edges.len() as f64;
    let inwards = -normal(&piece, own);
    let mut x_m = before.rest_m.clone();
    let at = |xi: &f64| {
        let no_match = |source| CalibrationError::NoMatch { vertex, xi: *xi, source };
        let push_m = inwards * (xi * length_m);
        let force = point_force_n(&before, own, push_m, &mut x_m).map_err(|e| no_match(e.into()))?;
        let force_n = force.dot(inwards);
        let found = matched(&after, &of.coarse, own, push_m, force_n, Way::Ratio(of.ratio)).map_err(no_match)?;
        let net = after.net(&of.coarse, &found);
        let mut x_after = net.rest_m.clone();
        point_force_n(&net, own, push_m, &mut x_after).map_err(|e| no_match(e.into()))?;
        Ok((found.anchor_n_per_m / of.coarse.anchor_n_per_m, net.energy_j(&x_after) / before.energy_j(&x_m)))
    };
    XI.iter().map(at).collect()
}

/// Returns the surface within some rings of a vertex, at its rest positions, with the rest positions (m) of it refined,
/// and the number that the vertex has there.
fn piece(
    surface: &Triangulation,
    fine_rest_m: &[DVec3],
    vertex: u32,
    rings: u32,
) -> Result<(Triangulation, Vec<DVec3>, u32), TriangulationError> {
    let region = Region::rings(surface, &[vertex], rings);
    let corners = || region.triangles().iter().map(|&t| surface.triangles()[t as usize]);
    let mut number: BTreeMap<u32, u32> = corners().flatten().map(|v| (v, NONE)).collect();
    number.values_mut().zip(0..).for_each(|(own, next)| *own = next);
    let coarse_rest_m: Vec<DVec3> = number.keys().map(|&v| fine_rest_m[v as usize]).collect();
    let triangles = corners().map(|triangle| triangle.map(|v| number[&v])).collect();
    let piece = Triangulation::new(coarse_rest_m.clone(), triangles)?;
    let whole: Vec<u32> = number.keys().copied().collect();
    let middle = |nodes: [u32; 2]| {
        let [a, b] = nodes.map(|node| whole[node as usize]);
        let edge = surface.edge_between(a, b);
        edge.map_or(DVec3::ZERO, |edge| fine_rest_m[surface.positions_m().len() + edge as usize])
    };
    let rest_m = coarse_rest_m.iter().copied().chain(piece.edges().iter().map(|edge| middle(edge.nodes))).collect();
    Ok((piece, rest_m, number[&vertex]))
}

/// Returns the outward normal at a vertex: the mean of its triangles' normals, weighted by area.
fn normal(surface: &Triangulation, vertex: u32) -> DVec3 {
    let of = |&triangle: &u32| {
        let [a, b, c] = surface.triangles()[triangle as usize].map(|v| surface.positions_m()[v as usize]);
        (b - a).cross(c - a)
    };
    surface.triangles_at(vertex).iter().map(of).sum::<DVec3>().normalize_or_zero()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let [low, high] = [(sorted.len() - 1) / 2, sorted.len() / 2].map(|at| sorted[at]);
    f64::midpoint(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::{
        region::Constants,
        testing::{hexagon, sphere},
    };

    const OF: Calibration = Calibration {
        coarse: Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 60.0 },
        rings: 1,
        ratio: 1.0,
        samples: 1,
    };

    /// On the paper's sheet the table is the middle curve of figure 8.
    #[test]
    fn on_the_flat_sheet_it_is_the_papers_curve() {
        let table = ConstantsTable::calibrate(&hexagon(8, 0.03), OF, &mut |_| {}).unwrap();
        let of = |xi: f64| table.rows.iter().find(|row| row.xi == xi).unwrap();
        assert!(
            (of(0.01).anchor_ratio - 0.9993).abs() < 1e-3 && (of(1.0).anchor_ratio - 0.7041).abs() < 2e-3,
            "{:?}",
            table.rows
        );
        // With constants that fall during the displacement the energy is not the work that was done.
        assert!((of(0.01).energy_ratio - 1.0).abs() < 1e-3, "{:?}", of(0.01));
        assert!(table.rows.iter().all(|row| (0.5..1.5).contains(&row.energy_ratio)), "{:?}", table.rows);
        let between = table.at(0.7).anchor_n_per_m / 60.0;
        assert!((between - f64::midpoint(of(0.6).anchor_ratio, of(0.8).anchor_ratio)).abs() < 1e-12);
        assert_eq!(table.at(9.0).anchor_n_per_m, 60.0 * of(1.0).anchor_ratio);
        assert_eq!(table.at(0.0).mesh_n_per_m, 60.0 * of(0.01).anchor_ratio);
    }

    /// With the table's constants a vertex that was no sample feels as before, within the spread of the samples.
    #[test]
    fn on_a_ball_other_vertices_feel_as_before() {
        let ball = sphere(3, 0.05);
        let table = ConstantsTable::calibrate(&ball, Calibration { samples: 6, ..OF }, &mut |_| {}).unwrap();
        let fine_rest = refined(&ball).0;
        let at_rest = ball.moved(fine_rest[..ball.positions_m().len()].to_vec()).unwrap();
        let coarse = Net::uniform(&at_rest, 60.0, 60.0);
        for (vertex, row) in [(101, 4), (7, 2), (200, 6)].map(|(v, r): (u32, usize)| (v, table.rows[r])) {
            let edges = at_rest.edges_at(vertex);
            let length = edges.iter().map(|&edge| at_rest.length_m(edge)).sum::<f64>() / edges.len() as f64;
            let push = -normal(&at_rest, vertex) * (row.xi * length);
            let force = |net: &Net| point_force_n(net, vertex, push, &mut net.rest_m.clone()).unwrap().length();
            let after = Refined::new(&ball, &Region::rings(&ball, &[vertex], 1), &fine_rest);
            let ratio = force(&after.net(&OF.coarse, &table.at(row.xi))) / force(&coarse);
            assert!((ratio - 1.0).abs() < 0.05 + row.spread, "{vertex} at {}: {ratio}, spread {}", row.xi, row.spread);
        }
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let patch = hexagon(4, 0.03);
        let table = ConstantsTable::calibrate(&patch, OF, &mut |_| {}).unwrap();
        table.fits(&patch, &OF).unwrap();
        let other = Constants { anchor_n_per_m: 59.0, ..OF.coarse };
        for (surface, of, what) in [
            (&hexagon(4, 0.031), OF, "another surface"),
            (&patch, Calibration { coarse: other, ..OF }, "other spring constants"),
            (&patch, Calibration { ratio: 2.0, ..OF }, "other spring constants"),
            (&patch, Calibration { rings: 2, ..OF }, "another number of rings"),
        ] {
            assert_eq!(table.fits(surface, &of), Err(CalibrationError::Stale { what }));
        }
        let refused = |of| ConstantsTable::calibrate(&patch, of, &mut |_| {}).unwrap_err().to_string();
        assert_eq!(refused(Calibration { ratio: 0.0, ..OF }), "ratio = 0: must be finite and larger than 0");
        assert_eq!(refused(Calibration { rings: 0, ..OF }), "rings = 0: must be 1 or more");
        assert!(refused(Calibration { rings: 9, ..OF }).starts_with("no vertex of the surface is 9 rings from"));
        let nothing = ConstantsTable { rows: vec![], ..table };
        assert!(nothing.fits(&patch, &OF).is_err() && nothing.at(0.5).anchor_n_per_m == 60.0);
    }
}
