use super::*;
use palpate_physics::Surface;
use palpate_physics::mesh::quality;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

/// Edges of the boundary are used once each way: closed and manifold. Returns the Euler characteristic.
fn euler_of_closed(shape: &Shape) -> i64 {
    let surface = Surface::of(&shape.mesh).unwrap();
    let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for &[a, b, c] in &surface.triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    assert!(edges.iter().all(|(&[a, b], &n)| n == 1 && edges.get(&[b, a]) == Some(&1)), "boundary not closed");
    surface.nodes.len() as i64 - edges.len() as i64 / 2 + surface.triangles.len() as i64
}

fn largest_valence(shape: &Shape) -> usize {
    let mut valence = vec![0usize; shape.mesh.positions_m().len()];
    shape.mesh.tets().iter().flatten().for_each(|&n| valence[n as usize] += 1);
    valence.into_iter().max().unwrap()
}

fn check_all(shape: &Shape, wanted: u32, min_dihedral_deg: f64) {
    let tets = shape.mesh.tets().len();
    let measured = quality::measure(&shape.mesh);
    println!(
        "{wanted}: {tets} tets, {} nodes, {} layers, dihedral {:.1}–{:.1}°, volume-length {:.3} (mean {:.3}), valence {}",
        shape.mesh.positions_m().len(),
        shape.layers,
        measured.min_dihedral_deg,
        measured.max_dihedral_deg,
        measured.min_volume_length,
        measured.mean_volume_length,
        largest_valence(shape),
    );
    assert!((tets as f64 / f64::from(wanted) - 1.0).abs() <= 0.1, "{tets} for {wanted}");
    assert!(measured.min_dihedral_deg > min_dihedral_deg, "{measured:?}");
    assert!(largest_valence(shape) <= 40);
    let surface = Surface::of(&shape.mesh).unwrap();
    let sorted = |mut t: [u32; 3]| {
        t.sort_unstable();
        t
    };
    let named: BTreeSet<[u32; 3]> = shape.regions.iter().flat_map(|r| &r.triangles).map(|&t| sorted(t)).collect();
    let all: BTreeSet<[u32; 3]> = (0..surface.triangles.len()).map(|t| sorted(surface.triangle_nodes(t))).collect();
    assert_eq!(named, all, "the regions cover the boundary");
}

const PAPER: [u32; 4] = [188, 1352, 10_000, 50_000];

#[test]
fn ventricle_at_every_size() {
    for wanted in PAPER {
        let shape = ventricle((0.010, 0.020), (0.007, 0.017), 0.005, wanted).unwrap();
        check_all(&shape, wanted, 10.0);
        // A ball: the base joins inner and outer surface to one sphere.
        assert_eq!(euler_of_closed(&shape), 2);
        for node in shape.region("base").unwrap().nodes() {
            assert!((shape.mesh.positions_m()[node as usize].z - 0.005).abs() < 1e-15);
        }
        for (name, (short, long)) in [("inner", (0.007, 0.017)), ("outer", (0.010, 0.020))] {
            for node in shape.region(name).unwrap().nodes() {
                let p = shape.mesh.positions_m()[node as usize] / DVec3::new(short, short, long);
                assert!((p.length() - 1.0).abs() < 1e-12, "{name} {p}");
            }
        }
    }
}

#[test]
fn closed_shells_at_every_size() {
    for wanted in PAPER {
        let sphere = sphere_shell(0.05, 0.1, wanted).unwrap();
        check_all(&sphere, wanted, 10.0);
        assert_eq!(euler_of_closed(&sphere), 4);
        let ellipsoid = ellipsoid_shell(DVec3::new(0.05, 0.06, 0.09), DVec3::new(0.06, 0.075, 0.1), wanted).unwrap();
        check_all(&ellipsoid, wanted, 10.0);
        assert_eq!(euler_of_closed(&ellipsoid), 4);
    }
}

#[test]
fn volumes_converge_with_second_order() {
    let cut_volume = |short: f64, long: f64, z: f64| {
        // ∫ π short² (1 − ζ²/long²) dζ from −long to z
        PI * short * short * ((z + long) - (z.powi(3) + long.powi(3)) / (3.0 * long * long))
    };
    let exact = cut_volume(0.010, 0.020, 0.005) - cut_volume(0.007, 0.017, 0.005);
    let error = |wanted| {
        let mesh = ventricle((0.010, 0.020), (0.007, 0.017), 0.005, wanted).unwrap().mesh;
        (mesh.total_volume_m3() / exact - 1.0).abs()
    };
    let errors = [error(1352), error(10_000), error(80_000)];
    println!("volume errors {errors:?}");
    assert!(errors[1] < 0.015 && errors[2] < 0.004, "{errors:?}");
    // The edge halves when the count grows eightfold: the error falls by about 4.
    assert!(errors[0] / errors[2] > 9.0, "{errors:?}");
}

#[test]
fn scaling_the_lengths_scales_the_mesh() {
    let small = ventricle((0.010, 0.020), (0.007, 0.017), 0.005, 1352).unwrap();
    let human = ventricle((0.045, 0.090), (0.0315, 0.0765), 0.0225, 1352).unwrap();
    assert_eq!(small.mesh.tets(), human.mesh.tets());
    let ratio = human.mesh.total_volume_m3() / small.mesh.total_volume_m3();
    assert!((ratio / 4.5f64.powi(3) - 1.0).abs() < 1e-9);
}

#[test]
fn same_request_same_bits() {
    let build = || ventricle((0.010, 0.020), (0.007, 0.017), 0.005, 10_000).unwrap();
    assert_eq!(build(), build());
}

#[test]
fn bad_shells_are_refused() {
    let message = |result: Result<Shape, ShapeError>| result.unwrap_err().to_string();
    assert!(message(sphere_shell(0.0, 0.1, 1000)).contains("inner_m = 0"));
    assert!(message(sphere_shell(0.1, 0.1, 1000)).contains("larger than the inner radius"));
    assert!(message(sphere_shell(0.1, f64::INFINITY, 1000)).contains("outer_m = inf"));
    assert!(message(ventricle((0.01, 0.02), (0.007, 0.017), 0.017, 1000)).contains("cut_z_m"));
    assert!(message(ventricle((0.01, 0.02), (0.012, 0.017), 0.005, 1000)).contains("outer_m.short"));
    assert!(message(sphere_shell(0.05, 0.1, 7)).contains("nearest has 30"));
    assert!(message(sphere_shell(0.05, 0.1, 0)).contains("target_tets"));
}
