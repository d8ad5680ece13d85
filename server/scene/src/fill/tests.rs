use super::samples::{CUT_MM, INNER_MM, Noise, OUTER_MM, Sample, human};
use super::*;
use crate::files::{read_surface, write_ply, write_stl};
use palpate_physics::Surface;
use std::collections::BTreeMap;
use std::path::PathBuf;

fn filled(inner: &Sample, outer: &Sample, target: u32) -> Fill {
    let started = std::time::Instant::now();
    let fill = fill(inner.input(), outer.input(), FillOptions::new(target), &mut |_, _| {}).unwrap();
    println!("{target} in {:.2} s:\n{}", started.elapsed().as_secs_f64(), fill.report);
    check_sound(&fill, target);
    fill
}

/// Count, closed manifold boundary of the right topology, distance to the input below half an edge.
fn check_sound(fill: &Fill, target: u32) {
    let tets = fill.mesh.tets().len();
    assert!((tets as f64 / f64::from(target) - 1.0).abs() < 0.05, "{tets} for {target}");
    let surface = Surface::of(&fill.mesh).unwrap();
    let mut edges: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for &[a, b, c] in &surface.triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    assert!(edges.iter().all(|(&[a, b], &n)| n == 1 && edges.contains_key(&[b, a])), "the boundary is not closed");
    let euler = surface.nodes.len() as i64 - edges.len() as i64 / 2 + surface.triangles.len() as i64;
    assert_eq!(euler, if fill.regions.len() == 3 { 2 } else { 4 });
    assert_eq!(fill.regions.iter().map(|r| r.triangles.len()).sum::<usize>(), surface.triangles.len());
    // 10°, or where the wanted edges make flat prisms, most of the angle under which a layer is seen along an edge.
    let report = &fill.report;
    let flat_deg = (report.thickness_m / f64::from(report.layers) / report.outer_edge_m).atan().to_degrees();
    assert!(report.quality.min_dihedral_deg > f64::min(10.0, 0.7 * flat_deg), "{report}");
}

/// Both surfaces are met within this part of an edge.
fn check_near(fill: &Fill, part: f64) {
    let report = &fill.report;
    assert!(report.inner.hausdorff_m() < part * report.outer_edge_m, "{report}");
    assert!(report.outer.hausdorff_m() < part * report.outer_edge_m, "{report}");
}

fn lat_long_pair() -> (Sample, Sample) {
    (Sample::lat_long(INNER_MM, Some(CUT_MM), 40, 64), Sample::lat_long(OUTER_MM, Some(CUT_MM), 30, 48))
}

#[test]
fn ventricle_from_different_triangulations_at_every_size() {
    let inner = Sample::icosphere(INNER_MM, Some(CUT_MM), 4, 1.0);
    let outer = Sample::lat_long(OUTER_MM, Some(CUT_MM), 40, 64);
    for target in [188, 1352, 10_000, 50_000] {
        check_near(&filled(&inner, &outer, target), 0.25);
    }
}

#[test]
fn bumpy_ventricle() {
    let inner = Sample::icosphere(INNER_MM, Some(CUT_MM), 4, 0.9).with_bumps(INNER_MM);
    let outer = Sample::lat_long(OUTER_MM, Some(CUT_MM), 40, 64).with_bumps(OUTER_MM);
    for target in [188, 1352, 10_000] {
        check_near(&filled(&inner, &outer, target), 0.25);
    }
}

#[test]
fn voxel_staircases() {
    let inner = Sample::voxels(INNER_MM, Some(CUT_MM), 0.5);
    let outer = Sample::voxels(OUTER_MM, Some(CUT_MM), 0.5);
    for target in [1352, 10_000] {
        let fill = filled(&inner, &outer, target);
        // No nearer than the staircase is to itself: a voxel's diagonal of 0.87 mm.
        assert!(fill.report.inner.hausdorff_m() < 1.0e-3 && fill.report.outer.hausdorff_m() < 1.0e-3);
    }
}

#[test]
fn closed_shell() {
    let inner = Sample::icosphere(INNER_MM, None, 4, 1.0);
    let outer = Sample::lat_long(OUTER_MM, None, 40, 64);
    for target in [188, 1352, 10_000] {
        check_near(&filled(&inner, &outer, target), 0.5);
    }
}

#[test]
fn volumes_converge_to_the_analytic_ellipsoids() {
    let inner = Sample::icosphere(INNER_MM, Some(CUT_MM), 5, 1.0);
    let outer = Sample::lat_long(OUTER_MM, Some(CUT_MM), 100, 160);
    let exact = Sample::exact_volume(OUTER_MM, Some(CUT_MM)) - Sample::exact_volume(INNER_MM, Some(CUT_MM));
    let error = |target, match_volume| {
        let options = FillOptions { match_volume, ..FillOptions::new(target) };
        let fill = fill(inner.input(), outer.input(), options, &mut |_, _| {}).unwrap();
        assert!((fill.report.input_volume_m3 * 1e9 / exact - 1.0).abs() < 5e-4);
        (fill.mesh.total_volume_m3() * 1e9 / exact - 1.0).abs()
    };
    // Matched: as near as the input itself is.
    let matched = [error(188, true), error(1352, true), error(10_000, true)];
    // Nodes on the surfaces: the edge falls by 10000^⅓/1352^⅓ = 1.9 or so, the error with its square.
    let inscribed = [error(1352, false), error(10_000, false)];
    println!("matched {matched:?} inscribed {inscribed:?}");
    assert!(matched.into_iter().all(|e| e < 1e-3), "{matched:?}");
    assert!(inscribed[0] < 0.04 && inscribed[1] < inscribed[0] / 3.0, "{inscribed:?}");
}

#[test]
fn units_are_the_callers() {
    let (inner, outer) = lat_long_pair();
    let in_metres = |sample: &Sample| sample.clone().moved(|p| p * 1e-3);
    let (inner_m, outer_m) = (in_metres(&inner), in_metres(&outer));
    let with_unit = |s| SurfaceInput { metres_per_unit: 1.0, ..s };
    let options = FillOptions::new(1352);
    let a = fill(inner.input(), outer.input(), options, &mut |_, _| {}).unwrap();
    let b = fill(with_unit(inner_m.input()), with_unit(outer_m.input()), options, &mut |_, _| {}).unwrap();
    assert!((a.mesh.total_volume_m3() / b.mesh.total_volume_m3() - 1.0).abs() < 1e-2);
}

#[test]
fn same_surfaces_same_bits_and_progress_rises() {
    let (inner, outer) = lat_long_pair();
    let mut seen = Vec::new();
    let a = fill(inner.input(), outer.input(), FillOptions::new(1352), &mut |part, _| seen.push(part)).unwrap();
    let b = fill(inner.input(), outer.input(), FillOptions::new(1352), &mut |_, _| {}).unwrap();
    assert_eq!(a, b);
    assert!(seen.is_sorted() && seen.first() == Some(&0.0) && seen.last() == Some(&1.0), "{seen:?}");
}

/// Fills a pair with a defect and returns the repairs of the surfaces.
fn repaired(inner: &Sample, outer: &Sample) -> (Repairs, Repairs) {
    let fill = filled(inner, outer, 1352);
    check_near(&fill, 0.35);
    (fill.report.inner.repairs, fill.report.outer.repairs)
}

#[test]
fn duplicate_points_of_an_stl_soup_are_welded() {
    let (inner, outer) = lat_long_pair();
    let points = inner.points.len();
    let soup = inner.soup();
    let (found, _) = repaired(&soup, &outer);
    assert_eq!(found.welded_points, soup.points.len() - points);
}

#[test]
fn degenerate_and_duplicate_triangles_are_dropped() {
    let (inner, mut outer) = lat_long_pair();
    let [a, b, c] = outer.triangles[100];
    outer.triangles.extend([[a, b, c], [c, b, a], [a, a, b], [a, b, b]]);
    let (_, found) = repaired(&inner, &outer);
    assert_eq!((found.duplicate_triangles, found.degenerate_triangles), (2, 2));
}

#[test]
fn mixed_and_inward_orientations_are_put_right() {
    let (mut inner, mut outer) = lat_long_pair();
    outer.triangles.iter_mut().step_by(7).for_each(|t| t.swap(0, 1));
    inner.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let (_, found) = repaired(&inner, &outer);
    assert_eq!(found.turned_triangles, outer.triangles.len().div_ceil(7));
}

#[test]
fn a_hole_at_the_apex_is_filled() {
    let (inner, outer) = lat_long_pair();
    let (found, _) = repaired(&inner.with_apex_hole(1.2), &outer);
    assert_eq!(found.filled_holes, 1);
}

#[test]
fn a_seam_that_gapes_is_joined() {
    // The triangles of the first meridian get their own copies of its points, moved by up to a tenth of an edge.
    let (inner, mut outer) = lat_long_pair();
    let mut noise = Noise::new(3);
    let (rings, around) = (30u32, 48u32);
    for k in 1..=rings {
        let old = 1 + (k - 1) * around;
        let new = outer.points.len() as u32;
        outer.points.push(outer.points[old as usize] + noise.vector() * 0.04);
        for t in &mut outer.triangles {
            let before = t.iter().any(|&v| v > 0 && (v - 1) % around == around - 1);
            if before {
                t.iter_mut().filter(|v| **v == old).for_each(|v| *v = new);
            }
        }
    }
    let (_, found) = repaired(&inner, &outer);
    assert!(found.joined_gap_points + found.filled_holes > 0, "{found}");
}

#[test]
fn a_flap_and_debris_are_dropped() {
    let (inner, mut outer) = lat_long_pair();
    let [a, b, _] = outer.triangles[200];
    let tip = outer.points.len() as u32;
    outer.points.extend([DVec3::new(30.0, 0.0, 0.0), DVec3::new(50.0, 0.0, 0.0), DVec3::new(51.0, 0.0, 0.0)]);
    outer.points.push(DVec3::new(50.0, 1.0, 0.0));
    outer.triangles.extend([[a, b, tip], [tip + 1, tip + 2, tip + 3]]);
    let (_, found) = repaired(&inner, &outer);
    assert_eq!((found.non_manifold_triangles, found.dropped_parts), (1, 1));
}

#[test]
fn noise_and_a_jagged_rim_are_borne() {
    let mut noise = Noise::new(1);
    let inner = Sample::icosphere(INNER_MM, Some(CUT_MM), 4, 0.0).moved(|p| p + noise.vector() * 0.1);
    let outer = Sample::icosphere(OUTER_MM, Some(CUT_MM), 4, 0.3).moved(|p| p + noise.vector() * 0.1);
    for target in [188, 1352, 5000] {
        filled(&inner, &outer, target);
    }
}

fn refused(inner: &Sample, outer: &Sample, target: u32) -> FillError {
    fill(inner.input(), outer.input(), FillOptions::new(target), &mut |_, _| {}).unwrap_err()
}

#[test]
fn every_bad_pair_has_its_message() {
    let (inner, outer) = lat_long_pair();
    let closed = Sample::lat_long(OUTER_MM, None, 30, 48);
    let pushed = inner.clone().moved(|p| p + DVec3::X * 4.0);
    let FillError::Crossing { at_m, .. } = refused(&pushed, &outer, 1352) else { panic!("no crossing") };
    assert!(at_m.x > 0.0 && ((at_m * 1e3 / OUTER_MM).length() - 1.0).abs() < 0.02, "{at_m}");
    let beside = inner.clone().moved(|p| p + DVec3::X * 40.0);
    assert!(matches!(refused(&beside, &outer, 1352), FillError::NotInside { swapped: false, .. }));
    assert!(matches!(refused(&outer, &inner, 1352), FillError::NotInside { swapped: true, .. }));
    let in_metres = inner.clone().moved(|p| p * 1e-3);
    assert!(refused(&in_metres, &outer, 1352).to_string().contains("millimetres"));
    assert!(matches!(refused(&inner, &closed, 1352), FillError::OpenAndClosed { open: "inner", closed: "outer" }));
    assert!(matches!(refused(&Sample::default(), &outer, 1352), FillError::Empty { which: "inner" }));
    let point = inner.clone().moved(|_| DVec3::ONE);
    assert!(matches!(refused(&point, &outer, 1352), FillError::Empty { which: "inner" }));
    let FillError::Count { lowest, .. } = refused(&inner, &outer, 20) else { panic!("20 tets") };
    assert!((30..188).contains(&lowest), "{lowest}");
    assert!(matches!(refused(&inner, &outer, 4_000_000_000), FillError::Count { .. }));
    let thin = outer.clone().moved(|p| if p.z < -19.9 { p * 0.85002 } else { p });
    assert!(matches!(refused(&inner, &thin, 1352), FillError::TooThin { .. } | FillError::Crossing { .. }));
    let mut nan = inner.clone();
    nan.points[5].y = f64::NAN;
    assert!(matches!(refused(&nan, &outer, 1352), FillError::NonFinite { which: "inner", vertex: 5 }));
    let mut wild = outer.clone();
    wild.triangles[9][1] = 1_000_000;
    assert!(matches!(refused(&inner, &wild, 1352), FillError::IndexOutOfRange { which: "outer", .. }));
    let mut two = outer.clone();
    let offset = two.points.len() as u32;
    two.points.extend(outer.points.iter().map(|p| *p + DVec3::X * 50.0));
    two.triangles.extend(outer.triangles.iter().map(|t| t.map(|v| v + offset)));
    assert!(matches!(refused(&inner, &two, 1352), FillError::SeveralParts { which: "outer", parts: 2 }));
    let tube = |s: &Sample| s.clone().with_apex_hole(7.0);
    assert!(matches!(refused(&tube(&inner), &outer, 1352), FillError::SeveralOpenings { openings: 2, .. }));
    let options = FillOptions { min_dihedral_deg: 55.0, ..FillOptions::new(1352) };
    let strict = fill(inner.input(), outer.input(), options, &mut |_, _| {}).unwrap_err();
    assert!(matches!(strict, FillError::Quality { wanted_deg: 55.0, .. }));
}

#[test]
#[ignore = "prints times"]
fn stage_times() {
    let inner = Sample::icosphere(INNER_MM, Some(CUT_MM), 5, 1.0);
    let outer = Sample::lat_long(OUTER_MM, Some(CUT_MM), 100, 160);
    for (inner, outer) in [(&inner, &outer), (&lat_long_pair().0, &lat_long_pair().1)] {
        for target in [1352, 10_000, 50_000] {
            let started = std::time::Instant::now();
            let mut last = String::new();
            println!("{} and {} triangles, {target} tets", inner.triangles.len(), outer.triangles.len());
            fill(inner.input(), outer.input(), FillOptions::new(target), &mut |part, what| {
                if what != last {
                    println!("  {:6.3} s {part:.2} {what}", started.elapsed().as_secs_f64());
                    last = what.to_owned();
                }
            })
            .unwrap();
        }
    }
}

/// Pairs that are hard on the map between the surfaces.
#[test]
fn hard_pairs() {
    let inner = Sample::icosphere(INNER_MM, Some(CUT_MM), 4, 1.0);
    let outer = Sample::lat_long(OUTER_MM, Some(CUT_MM), 40, 64);
    let pairs = [
        (
            "cut below the equator",
            Sample::icosphere(INNER_MM, Some(-5.0), 4, 1.0),
            Sample::lat_long(OUTER_MM, Some(-5.0), 40, 64),
        ),
        ("inner rim lower", Sample::lat_long(INNER_MM, Some(3.5), 40, 64), outer.clone()),
        ("inner rim higher", Sample::lat_long(INNER_MM, Some(6.5), 40, 64), outer.clone()),
        ("tilted inner rim", inner.clone().moved(|p| p + DVec3::Z * 0.15 * p.x * ((p.z + 17.0) / 22.0)), outer.clone()),
        (
            "wall from 1 to 5 mm",
            inner.clone().moved(|p| p + DVec3::X * 2.0 * (1.0 - (p.z / 20.0).powi(2))),
            outer.clone(),
        ),
        (
            "thin wall, 1.5 mm",
            inner.clone().moved(|p| p * DVec3::new(8.5 / 7.0, 8.5 / 7.0, 1.0) - DVec3::Z * 1.2),
            outer.clone(),
        ),
        ("thick wall, 6 mm", inner.clone().moved(|p| p * DVec3::new(4.0 / 7.0, 4.0 / 7.0, 1.0)), outer.clone()),
        ("bent", bent(&inner), bent(&outer)),
        ("deep grooves", grooved(&inner, 0.5), grooved(&outer, 1.2)),
    ];
    let mut failed = Vec::new();
    for (name, inner, outer) in &pairs {
        for target in [188, 1352, 5000] {
            match fill(inner.input(), outer.input(), FillOptions::new(target), &mut |_, _| {}) {
                Ok(fill) => {
                    println!("{name}, {target}:\n{}", fill.report);
                    check_sound(&fill, target);
                }
                Err(error) => failed.push(format!("{name}, {target}: {error}")),
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// A banana: the long axis bent to a circle of 40 mm.
fn bent(sample: &Sample) -> Sample {
    sample.clone().moved(|p| {
        let (sin, cos) = (p.z / 40.0).sin_cos();
        DVec3::new(40.0 - (40.0 - p.x) * cos, p.y, (40.0 - p.x) * sin)
    })
}

/// Grooves along the long axis, like trabeculae, this deep (mm).
fn grooved(sample: &Sample, depth: f64) -> Sample {
    sample.clone().moved(|p| {
        let around = p.y.atan2(p.x);
        let radius = p.truncate().length();
        let factor = 1.0 - depth / 7.0 * (0.5 + 0.5 * (7.0 * around).cos()) * (radius / (radius + 2.0));
        DVec3::new(p.x * factor, p.y * factor, p.z)
    })
}

/// The sample surfaces for users: a bumpy human-sized ventricle in millimetres, its cavity with a hole at the apex.
fn sample_files() -> [PathBuf; 2] {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../deploy/scenes/data");
    ["ventricle-inner.stl", "ventricle-outer.ply"].map(|name| folder.join(name))
}

#[test]
#[ignore = "writes deploy/scenes/data"]
fn write_sample_files() {
    let [inner_path, outer_path] = sample_files();
    std::fs::create_dir_all(inner_path.parent().unwrap()).unwrap();
    let (inner, outer) = human();
    write_stl(&inner_path, &inner.points, &inner.triangles).unwrap();
    write_ply(&outer_path, &outer.points, &outer.triangles).unwrap();
}

#[test]
fn sample_files_are_as_generated_and_fill() {
    let read = sample_files().map(|path| read_surface(&path).unwrap());
    let (inner, outer) = human();
    for (file, made) in read.iter().zip([&inner, &outer]) {
        assert_eq!(file.triangles.len(), made.triangles.len());
        for (a, b) in file.triangles.iter().zip(&made.triangles) {
            for (&i, &j) in a.iter().zip(b) {
                // STL is single precision.
                assert!(file.vertices[i as usize].distance(made.points[j as usize]) < 1e-4);
            }
        }
    }
    let [inner, outer] = read.map(|file| Sample { points: file.vertices, triangles: file.triangles });
    for target in [188, 1352, 5000] {
        let fill = filled(&inner, &outer, target);
        check_near(&fill, 0.25);
        assert_eq!(fill.report.inner.repairs.filled_holes, 1);
        assert!((fill.report.volume_m3 / fill.report.input_volume_m3 - 1.0).abs() < 0.01);
    }
}
