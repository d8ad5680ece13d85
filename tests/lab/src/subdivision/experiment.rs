//! A flat sheet of equilateral triangles, one vertex pulled out of it: the force before, and the constants with which
//! it is the same once one ring or two about the vertex are refined.
//!
//! The paper leaves open how large the sheet is, how its edge is held, whether the others move in the plane, and whose
//! constants rim and cracks have. Here: eight rings for one refined ring and six for two; a free edge; every vertex but
//! the pulled one at rest in three dimensions; all nodes of the refined area, and all springs that touch its inside,
//! its rim or close its cracks, have the new constants; rest lengths are those of the flat sheet.
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    bodies::mass_spring::{
        Net, Refined, Region,
        loop_scheme::refined,
        matching::{Way, matched, point_force_n},
        net::hexagonal_patch,
        region::Constants,
    },
    mesh::Triangulation,
};

/// `L` (m).
pub(super) const EDGE_M: f64 = 0.03;
/// `K_h` (N/m).
pub(super) const ANCHOR_N_PER_M: f64 = 60.0;
/// Displacements over `L`: the paper's plots reach from 0 to 1.
const STEPS: [f64; 24] = [
    0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8,
    0.85, 0.9, 0.95, 1.0,
];
/// `K′_m/K′_h` over `K_m/K_h`.
const RATIOS: [f64; 3] = [4.0, 1.0, 0.25];

/// A figure of the paper.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// 5 to 11.
    pub number: u32,
    /// What it shows.
    pub title: String,
    /// What its ordinate is.
    pub quantity: &'static str,
    /// Its curves.
    pub curves: Vec<Curve>,
}

/// A curve over `x/L`.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Name.
    pub name: String,
    /// `x/L` and value.
    pub points: Vec<(f64, f64)>,
}

/// The experiment at one `K_m/K_h`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Experiment {
    /// `K_m/K_h` before.
    pub mesh_over_anchor: f64,
}

/// A sheet before and after.
struct Sheet {
    coarse: Triangulation,
    refined: Refined,
    constants: Constants,
    /// Force (N) before, at each of the displacements.
    forces_n: Vec<f64>,
}

impl Sheet {
    fn new(rings: u32, constants: Constants) -> Result<Self> {
        let size = if rings == 1 { 8 } else { 6 };
        let coarse = hexagonal_patch(size, EDGE_M).into_diagnostic()?;
        let region = Region::rings(&coarse, &[0], rings);
        let after = Refined::new(&coarse, &region, &refined(&coarse).0);
        let net = Net::uniform(&coarse, constants.mesh_n_per_m, constants.anchor_n_per_m);
        let mut x_m = net.rest_m.clone();
        let mut force_n = |part: &f64| point_force_n(&net, 0, DVec3::Z * (part * EDGE_M), &mut x_m).map(|f| f.z);
        let forces_n = STEPS.iter().map(&mut force_n).collect::<Result<_, _>>().into_diagnostic()?;
        Ok(Self { coarse, refined: after, constants, forces_n })
    }

    /// Constants with which each force is the same after.
    fn matched(&self, way: Way) -> Result<Vec<Constants>> {
        let of = |(part, force_n): (&f64, &f64)| {
            matched(&self.refined, &self.constants, 0, DVec3::Z * (part * EDGE_M), *force_n, way).into_diagnostic()
        };
        STEPS.iter().zip(&self.forces_n).map(of).collect()
    }

    fn curve(&self, name: String, found: &[Constants], of: impl Fn(&Constants, &Constants) -> f64) -> Curve {
        let points = STEPS.iter().zip(found).map(|(part, found)| (*part, of(found, &self.constants))).collect();
        Curve { name, points }
    }
}

fn mesh(found: &Constants, before: &Constants) -> f64 {
    found.mesh_n_per_m / before.mesh_n_per_m
}

fn anchor(found: &Constants, before: &Constants) -> f64 {
    found.anchor_n_per_m / before.anchor_n_per_m
}

/// Figures 5 to 11. `tell` is told the part done.
///
/// # Errors
/// Springs that come to no rest, or a force that no constant gives.
pub fn figures(experiment: Experiment, tell: &mut dyn FnMut(f64)) -> Result<Vec<Figure>> {
    let constants =
        Constants { mesh_n_per_m: experiment.mesh_over_anchor * ANCHOR_N_PER_M, anchor_n_per_m: ANCHOR_N_PER_M };
    let sheets = [Sheet::new(1, constants)?, Sheet::new(2, constants)?];
    let total = 2.0 * (2 + RATIOS.len()) as f64;
    let mut done = 0.0;
    let mut tell = || {
        done += 1.0;
        tell(done / total);
    };
    let mut figures = vec![Figure {
        number: 5,
        title: format!("Force over displacement, before ({} vertices)", sheets[0].coarse.positions_m().len()),
        quantity: "F (N)",
        curves: vec![Curve {
            name: "F".into(),
            points: STEPS.iter().copied().zip(sheets[0].forces_n.iter().copied()).collect(),
        }],
    }];
    for (rings, sheet) in ["one ring", "two rings"].into_iter().zip(&sheets) {
        let number = if rings == "one ring" { 6 } else { 7 };
        // K′_h = K_h N/N′: anchor springs add up to the same.
        let spread = constants.anchor_n_per_m * sheet.refined.node_ratio();
        let mut curves = Vec::new();
        for (name, anchor_n_per_m) in [("K'_h by eq. 5", spread), ("K'_h = K_h", constants.anchor_n_per_m)] {
            curves.push(sheet.curve(name.into(), &sheet.matched(Way::Anchor(anchor_n_per_m))?, mesh));
            tell();
        }
        let title = format!("K'_m that gives the same force, {rings} refined");
        figures.push(Figure { number, title, quantity: "K'_m/K_m", curves });
    }
    for (rings, sheet, number) in [("one ring", &sheets[0], 8), ("two rings", &sheets[1], 10)] {
        let (mut anchors, mut meshes) = (Vec::new(), Vec::new());
        for ratio in RATIOS {
            let found = sheet.matched(Way::Ratio(ratio * experiment.mesh_over_anchor))?;
            let name = format!("K'_m/K'_h = {}", ratio * experiment.mesh_over_anchor);
            anchors.push(sheet.curve(name.clone(), &found, anchor));
            meshes.push(sheet.curve(name, &found, mesh));
            tell();
        }
        let title = |of: &str| format!("{of} at a fixed ratio, {rings} refined");
        figures.push(Figure { number, title: title("K'_h"), quantity: "K'_h/K_h", curves: anchors });
        figures.push(Figure { number: number + 1, title: title("K'_m"), quantity: "K'_m/K_m", curves: meshes });
    }
    Ok(figures)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn curves(figures: &[Figure], number: u32) -> Vec<Vec<f64>> {
        let figure = figures.iter().find(|figure| figure.number == number).unwrap();
        figure.curves.iter().map(|curve| curve.points.iter().map(|p| p.1).collect()).collect()
    }

    fn range(values: &[f64]) -> f64 {
        let [low, high] = [f64::min, f64::max].map(|pick| values.iter().copied().reduce(pick).unwrap());
        high / low
    }

    fn falls(values: &[f64]) -> bool {
        values.windows(2).all(|pair| pair[1] < pair[0])
    }

    /// What the paper says of its figures, one by one.
    fn statements(mesh_over_anchor: f64) {
        let figures = figures(Experiment { mesh_over_anchor }, &mut |_| {}).unwrap();
        assert_eq!(figures.iter().map(|figure| figure.number).collect::<Vec<_>>(), [5, 6, 7, 8, 9, 10, 11]);
        let force = &curves(&figures, 5)[0];
        assert!(force.windows(2).all(|pair| pair[1] > pair[0]));
        for number in [6, 7] {
            let [spread, kept] = &curves(&figures, number)[..] else { panic!() };
            // "As displacement approaches zero, the upper plot asymptotically approaches infinity": as 1/x² at least.
            assert!(
                falls(&spread[..8]) && spread[0] > 3.5 * spread[1] && spread[0] > 30.0,
                "{mesh_over_anchor}: {spread:?}"
            );
            assert!(spread.iter().zip(kept).all(|(upper, lower)| upper > lower));
            // "It also shows that K'_m is smaller than K_m."
            assert!(kept.iter().all(|k| *k < 1.0), "{kept:?}");
        }
        for (anchors, meshes) in [(8, 9), (10, 11)] {
            let (anchors, meshes) = (curves(&figures, anchors), curves(&figures, meshes));
            // "All the plots start from a ratio of K'_h/K_h close to 1."
            assert!(anchors.iter().all(|curve| (curve[0] - 1.0).abs() < 0.03), "{anchors:?}");
            // "When K'_h has a ratio of 4 over K'_m, the plot shows the least variation"; "the K'_h = 0.25 K'_m plot
            // shows the largest".
            let ranges: Vec<f64> = anchors.iter().map(|curve| range(curve)).collect();
            assert!(ranges[0] > ranges[1] && ranges[0] > ranges[2], "{ranges:?}");
            // "Actually they are the same plot drawn in different ordinates."
            for ((anchor, mesh), ratio) in anchors.iter().zip(&meshes).zip(RATIOS) {
                assert!(anchor.iter().zip(mesh).all(|(h, m)| (m / h / ratio - 1.0).abs() < 1e-9));
            }
        }
        // "The number of rings does not change the nature of the shape of the plots."
        for (one, two) in [(8, 10), (9, 11)] {
            for (one, two) in curves(&figures, one).iter().zip(&curves(&figures, two)) {
                assert!(one.iter().zip(two).all(|(a, b)| (a / b - 1.0).abs() < 0.25), "{one:?} {two:?}");
                assert_eq!(one[0] > one[STEPS.len() - 1], two[0] > two[STEPS.len() - 1]);
            }
        }
    }

    #[test]
    fn the_papers_statements_hold() {
        statements(1.0);
        let figures = figures(Experiment { mesh_over_anchor: 1.0 }, &mut |_| {}).unwrap();
        // "An approximately linear relationship": within a few per cent of the straight line nearest to it.
        let kept = &curves(&figures, 6)[1];
        assert!(deviation_from_line(kept) < 0.1, "{}", deviation_from_line(kept));
        let anchors = curves(&figures, 8);
        assert!(range(&anchors[2]) < range(&anchors[1]), "ratio 0.25 varies least");
    }

    /// "The initial ratio of K_m/K_h does not affect the basic relationship."
    #[test]
    fn at_ten_and_a_tenth_they_hold_likewise() {
        statements(10.0);
        statements(0.1);
    }

    fn deviation_from_line(values: &[f64]) -> f64 {
        let n = STEPS.len() as f64;
        let (mx, my) = (STEPS.iter().sum::<f64>() / n, values.iter().sum::<f64>() / n);
        let sxx: f64 = STEPS.iter().map(|x| (x - mx).powi(2)).sum();
        let sxy: f64 = STEPS.iter().zip(values).map(|(x, y)| (x - mx) * (y - my)).sum();
        let off = STEPS.iter().zip(values).map(|(x, y)| (y - my - sxy / sxx * (x - mx)).abs());
        off.fold(0.0, f64::max) / my
    }
}
