//! Self-contact by itself, of a clamp whose arms are put together.
use super::{NearWalls, SelfContact, rest::NodeAtRest};
use crate::{
    contact::{MostCarriers, SkinAtRest, SkinFollows, SurfaceModuli},
    mesh::{Surface, TetMesh},
    testing::{Random, tet_box},
};
use glam::{DQuat, DVec3};

const GAP_M: f64 = 4e-3;

/// A clamp whose arms of 8 mm are 4 mm apart; what is left of a box.
fn clamp() -> TetMesh {
    clamp_of([10, 3, 5])
}

/// The same clamp, of as many cells along each axis.
fn clamp_of(cells: [usize; 3]) -> TetMesh {
    let whole = tet_box(DVec3::ZERO, DVec3::new(0.04, 0.012, 0.02), cells);
    let middle = |tet: &[u32; 4]| tet.iter().map(|&n| whole.positions_m()[n as usize]).sum::<DVec3>() * 0.25;
    let is_kept = |p: DVec3| p.x < 0.012 || (p.z - 0.01).abs() > 0.5 * GAP_M;
    let kept: Vec<[u32; 4]> = whole.tets().iter().filter(|tet| is_kept(middle(tet))).copied().collect();
    let mut nodes: Vec<u32> = kept.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let number = |node: u32| nodes.binary_search(&node).unwrap() as u32;
    let positions = nodes.iter().map(|&n| whole.positions_m()[n as usize]).collect();
    TetMesh::new(positions, kept.iter().map(|tet| tet.map(number)).collect()).unwrap()
}

fn walls_of(mesh: &TetMesh, only_if_facing: bool) -> Option<SelfContact> {
    let surface = Surface::of(mesh).unwrap();
    let moduli = vec![SurfaceModuli { p_wave_pa: 2e4, indentation_pa: 1e4 }; surface.triangles.len()];
    // Of different masses, so that walls bear more in one place than in another.
    let mass_kg: Vec<f64> =
        (0..mesh.positions_m().len()).map(|node| if node.is_multiple_of(3) { 6e-6 } else { 3e-5 }).collect();
    let skin = SkinAtRest {
        positions_m: mesh.positions_m(),
        surface: &surface,
        moduli: &moduli,
        mass_kg: &mass_kg,
        bearing_kg: &mass_kg,
        max_natural_frequency_rad_per_s: 5e3,
        follows: SkinFollows::StiffElements,
        carriers: MostCarriers::default(),
    };
    SelfContact::build(&skin, only_if_facing)
}

/// Arms bent towards each other by so much at their ends, and shaken.
fn bent(mesh: &TetMesh, by_m: f64, shaken_m: f64, seed: u64) -> Vec<DVec3> {
    let mut random = Random(seed);
    let bend = |p: &DVec3| {
        let along = ((p.x - 0.012) / 0.028).max(0.0);
        *p - DVec3::Z * (by_m * along * (p.z - 0.01).signum()) + random.vector() * shaken_m
    };
    mesh.positions_m().iter().map(bend).collect()
}

fn pressed(walls: &SelfContact, x: &[DVec3]) -> (Vec<DVec3>, super::MeetingWalls) {
    let (mut forces_n, mut scratch) = (vec![DVec3::ZERO; x.len()], walls.scratch());
    let near: NearWalls = walls.near_at(x);
    walls.press(x, &near, &mut forces_n, &mut scratch);
    (forces_n, scratch.seen())
}

#[test]
fn forces_are_the_potentials_negative_gradient_and_change_no_momentum() {
    let mesh = clamp();
    let walls = walls_of(&mesh, true).unwrap();
    let mut looked_at = 0;
    for seed in 1..7 {
        // From a touch at the ends to arms that overlap by more than the linear part of the answer.
        let x = bent(&mesh, 1.6e-3 + 3e-4 * seed as f64, 1e-4, seed);
        let (forces_n, seen) = pressed(&walls, &x);
        assert!(seen.vertices > 5, "{seen:?}");
        let largest_n = forces_n.iter().map(|f| f.length()).fold(0.0, f64::max);
        let (sum, moment) = forces_n
            .iter()
            .zip(&x)
            .fold((DVec3::ZERO, DVec3::ZERO), |(sum, moment), (f, p)| (sum + *f, moment + p.cross(*f)));
        assert!(sum.length() < 1e-13 * largest_n && moment.length() < 1e-14 * largest_n, "{sum} {moment}");
        assert!((seen.energy_j / walls.meeting(&x).energy_j - 1.0).abs() < 1e-12);
        for (node, force_n) in forces_n.iter().enumerate().filter(|(_, f)| f.length() > 1e-3 * largest_n) {
            for axis in 0..3 {
                let moved = |by_m: f64| {
                    let mut x = x.clone();
                    x[node][axis] += by_m;
                    walls.meeting(&x).energy_j
                };
                let slope = -(moved(1e-8) - moved(-1e-8)) / 2e-8;
                assert!((slope - force_n[axis]).abs() < 1e-4 * largest_n, "node {node}: {slope} {force_n}");
                looked_at += 1;
            }
        }
    }
    assert!(looked_at > 300, "{looked_at}");
}

#[test]
fn what_the_step_is_told_is_no_less_than_the_stiffness() {
    let mesh = clamp();
    let walls = walls_of(&mesh, true).unwrap();
    // Not vertex over vertex, where what walls bear has a kink.
    let x = bent(&mesh, 2.2e-3, 1e-4, 1);
    let near = walls.near_at(&x);
    let mut scratch = walls.scratch();
    walls.press(&x, &near, &mut vec![DVec3::ZERO; x.len()], &mut scratch);
    // The largest eigenvalue of M⁻¹K by power iteration on differences of forces.
    let mut direction = vec![DVec3::Z; x.len()];
    let mut value = 0.0;
    for round in 0..60 {
        let at = |sign: f64| {
            let x: Vec<DVec3> = x.iter().zip(&direction).map(|(x, d)| *x + *d * (1e-9 * sign)).collect();
            let mut forces_n = vec![DVec3::ZERO; x.len()];
            walls.press(&x, &walls.near_at(&x), &mut forces_n, &mut walls.scratch());
            forces_n
        };
        let kg = |node: usize| if node.is_multiple_of(3) { 6e-6 } else { 3e-5 };
        let changes = at(1.0).into_iter().zip(at(-1.0)).enumerate();
        let product: Vec<DVec3> = changes.map(|(node, (p, m))| (m - p) / 2e-9 / kg(node)).collect();
        value = product.iter().map(|p| p.length_squared()).sum::<f64>().sqrt();
        let mut random = Random(7 + round);
        let noise = if round == 0 { value } else { 0.0 };
        direction = product.iter().map(|p| (*p + random.vector() * noise) / value).collect();
        let length = direction.iter().map(|d| d.length_squared()).sum::<f64>().sqrt();
        for d in &mut direction {
            *d /= length;
        }
    }
    let told = scratch.most_frequency_sq;
    println!("largest {value:.3e} 1/s², told {told:.3e} 1/s²");
    assert!(value > 0.1 * told && value < told, "{value:e} {told:e}");
}

/// Neighbours along the skin and the other side of a vertex's own wall may never meet; the arm on the other side may.
#[test]
fn who_may_meet_is_settled_at_rest() {
    let mesh = clamp();
    let walls = walls_of(&mesh, true).unwrap();
    let (forces_n, seen) = pressed(&walls, mesh.positions_m());
    assert!(forces_n.iter().all(|f| *f == DVec3::ZERO) && seen.vertices == 0 && walls.left_out() == 0);
    let at = |p: DVec3| mesh.positions_m().iter().position(|q| q.distance(p) < 1e-9).unwrap() as u32;
    let inner = at(DVec3::new(0.028, 0.004, 0.008));
    let triangles_at = |node: u32| walls.around.row(node as usize).iter().map(|&t| t as usize);
    let may = |node: u32, other: u32| triangles_at(other).any(|triangle| walls.may_meet_m(node, triangle).is_some());
    assert!(may(inner, at(DVec3::new(0.028, 0.004, 0.012))), "the other arm's inner side");
    assert!(!may(inner, at(DVec3::new(0.028, 0.004, 0.0))), "its own arm's outer side");
    assert!(!may(inner, at(DVec3::new(0.032, 0.004, 0.008))), "a neighbour");
    // Pressed flat to a third of its thickness, an arm presses nothing by itself.
    let flat: Vec<DVec3> = mesh.positions_m().iter().map(|p| DVec3::new(p.x, p.y, p.z / 3.0)).collect();
    let only_lower = |p: &DVec3| p.z < 0.008;
    let lower: f64 = pressed(&walls, &flat)
        .0
        .iter()
        .zip(mesh.positions_m())
        .filter(|(_, rest)| only_lower(rest) && (rest.z - 0.008).abs() > 1e-6)
        .map(|(f, _)| f.length())
        .sum();
    assert_eq!(lower, 0.0);
}

#[test]
fn a_box_faces_itself_nowhere() {
    assert!(walls_of(&tet_box(DVec3::ZERO, DVec3::splat(0.02), [4; 3]), true).is_none());
    assert!(walls_of(&tet_box(DVec3::ZERO, DVec3::splat(0.02), [4; 3]), false).is_some());
}

/// A vertex that lies on a wall at rest is left out and told; without it the rest state would press.
#[test]
fn parts_that_touch_at_rest_press_nothing_there() {
    let one = tet_box(DVec3::ZERO, DVec3::new(0.02, 0.02, 0.01), [4, 4, 2]);
    let other = tet_box(DVec3::Z * 0.01, DVec3::new(0.02, 0.02, 0.01), [5, 5, 2]);
    let count = one.positions_m().len() as u32;
    let positions = one.positions_m().iter().chain(other.positions_m()).copied().collect();
    let tets = one.tets().iter().copied().chain(other.tets().iter().map(|tet| tet.map(|n| n + count))).collect();
    let mesh = TetMesh::new(positions, tets).unwrap();
    let walls = walls_of(&mesh, false).unwrap();
    assert_eq!(walls.left_out(), 25 + 36);
    assert_eq!(pressed(&walls, mesh.positions_m()).1.vertices, 0);
}

/// All that a query rules out by bounds is indeed out of reach, whatever the deformation.
#[test]
fn queries_lose_nothing_that_is_within_reach() {
    let mesh = clamp();
    let met = met_in(&mesh, (0..40).map(|seed| bent(&mesh, 1e-4 * seed as f64, 3e-4, seed + 1)));
    assert!(met > 100, "{met}");
}

/// A body that turns as a whole has displacements of its own size; arms that also bend meet as they do where it does not turn.
#[test]
fn queries_lose_nothing_of_a_body_that_turned() {
    let mesh = clamp();
    let turned = |seed: u64| {
        let axis = DVec3::new(1.0, 0.1 * seed as f64, -0.5).normalize();
        let turn = DQuat::from_axis_angle(axis, 0.25 * seed as f64);
        bent(&mesh, 1e-4 * (20 + seed) as f64, 2e-4, seed + 1).iter().map(|p| turn * *p).collect()
    };
    let met = met_in(&mesh, (0..20).map(turned));
    assert!(met > 100, "{met}");
}

/// Most pairs of clusters of a body that turned and is little strained are ruled out by how it is displaced beside that, and
/// every one of them is as far apart as that says.
#[test]
fn bounds_of_what_turned_hold_and_rule_out() {
    let mesh = clamp_of([20, 6, 10]);
    let walls = walls_of(&mesh, true).unwrap();
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 1.0);
    let x: Vec<DVec3> = bent(&mesh, 5e-4, 1e-5, 3).iter().map(|p| turn * *p).collect();
    let (mut by_turning, mut pairs) = (0, 0);
    for one in 0..walls.clusters.len() {
        let frame = walls.frame(one, &x);
        let of_one = walls.displaced_in(one, &frame, &x);
        for entry in walls.close.row(one).iter().filter(|entry| entry.free_m.is_finite()) {
            let other = entry.cluster as usize;
            let bound_m = entry.free_m - of_one.differs_m(&walls.displaced_in(other, &frame, &x));
            let as_displaced = [one, other].map(|cluster| walls.cluster_now(cluster, &x).displaced);
            let without_m = entry.free_m - as_displaced[0].differs_m(&as_displaced[1]);
            pairs += 1;
            by_turning += u32::from(bound_m > 0.5 * entry.free_m && without_m <= 0.5 * entry.free_m);
            for &node in walls.of_cluster.row(one) {
                let may = |triangle: &usize| walls.may_meet_m(node, *triangle).is_some();
                let distance_m = |triangle| walls.distance_m(x[node as usize], triangle, &x);
                let least_m =
                    walls.triangles.cluster_range(other).filter(may).map(distance_m).fold(f64::INFINITY, f64::min);
                assert!(least_m >= bound_m - 1e-12, "clusters {one} and {other}: {least_m} {bound_m}");
            }
        }
    }
    println!("{by_turning} of {pairs} pairs");
    assert!(2 * by_turning > pairs && pairs > 50, "{by_turning} of {pairs}");
}

/// Gaps that do not matter are left out early, and no others: with walls apart, at each other and through each other.
#[test]
fn only_gaps_that_do_not_matter_are_left_out() {
    let mesh = clamp();
    let walls = walls_of(&mesh, true).unwrap();
    let (mut kept, mut left_out, mut behind) = (0, 0, 0);
    for seed in 0..80 {
        let x = bent(&mesh, 5e-5 * seed as f64, 4e-4, seed + 1);
        for of_vertex in walls.near_at(&x).pairs().chunk_by(|one, next| one.node == next.node) {
            let (node, triangles) = (of_vertex[0].node, of_vertex.iter().map(|pair| pair.triangle));
            let margin_m = walls.nodes[node as usize].margin_m;
            let any = walls.gap(node, f64::INFINITY, &triangles, &x);
            let within = walls.gap(node, margin_m, &triangles, &x);
            assert!(within.is_none() || within == any, "node {node}");
            assert_eq!(
                within.filter(|gap| gap.distance_m < margin_m),
                any.filter(|gap| gap.distance_m < margin_m),
                "node {node}"
            );
            kept += u32::from(within.is_some());
            left_out += u32::from(within.is_none() && any.is_some());
            behind += u32::from(any.is_some_and(|gap| gap.distance_m < -margin_m));
        }
    }
    println!("{kept} kept, {left_out} left out, {behind} far behind a wall");
    assert!(kept > 100 && left_out > 100 && behind > 20, "{kept} {left_out} {behind}");
}

/// A list that has served for some way presses to the last bit what one that is made anew does, from before walls meet until they overlap.
#[test]
fn what_does_not_matter_yet_is_not_pressed_either() {
    let mesh = clamp();
    let walls = walls_of(&mesh, true).unwrap();
    let (mut pressed_some, mut passed_over) = (0, 0);
    for seed in 0..60 {
        let x = bent(&mesh, 1e-3 + 4e-5 * seed as f64, 1e-4, seed + 1);
        let list = walls.near_at(&x);
        for way in [0.05, 0.3, 0.9] {
            let moved_m = way * list.slack_m;
            let mut random = Random(seed + 100);
            // Each by so much at most, towards each other where it is the other wall's.
            let moved: Vec<DVec3> = x
                .iter()
                .map(|p| {
                    let towards = DVec3::Z * -(p.z - 0.01).signum() * 3.0;
                    *p + (random.vector() + towards).clamp_length_max(1.0) * moved_m
                })
                .collect();
            let mut near = list.clone();
            near.slack_m -= moved_m;
            let (mut forces_n, mut scratch) = (vec![DVec3::ZERO; x.len()], walls.scratch());
            walls.press(&moved, &near, &mut forces_n, &mut scratch);
            let (anew_n, seen) = pressed(&walls, &moved);
            for (node, (here, anew)) in forces_n.iter().zip(&anew_n).enumerate() {
                assert_eq!(here, anew, "seed {seed}, node {node}, moved {moved_m} m");
            }
            assert_eq!(scratch.seen(), seen);
            pressed_some += u32::from(seen.vertices > 0);
            passed_over += near.pairs().iter().filter(|pair| pair.free_m > near.moved_m()).count();
        }
    }
    println!("{pressed_some} of 180 press, {passed_over} pairs were passed over");
    assert!(pressed_some > 60 && passed_over > 1000, "{pressed_some} {passed_over}");
}

/// A clamp of several groups of clusters, whose one arm slides back along the other by half its length and into it: what
/// meets is not close at rest.
#[test]
fn groups_that_are_ruled_out_together_lose_nothing_either() {
    let mesh = clamp_of([30, 6, 15]);
    let slid = |into_m: f64, seed: u64| {
        let by_m = DVec3::new(-0.024, 0.0, -GAP_M - into_m);
        let arm = mesh.positions_m().iter().zip(bent(&mesh, 0.0, 1e-4, seed));
        arm.map(|(rest, p)| if rest.z > 0.01 + 0.4 * GAP_M { p + by_m } else { p }).collect()
    };
    let met = met_in(&mesh, [slid(0.0, 1), slid(2e-3, 2)].into_iter());
    assert!(met > 100, "{met}");
}

/// Asks, in such states (m), what every vertex meets, of all triangles and of those that are listed; returns how many times
/// one met something.
fn met_in(mesh: &TetMesh, states: impl Iterator<Item = Vec<DVec3>>) -> u32 {
    let walls = walls_of(mesh, true).unwrap();
    let mut met = 0;
    for x in states {
        let found = walls.near_at(&x);
        let slack_m = found.slack_m;
        assert!(slack_m >= 0.99 * walls.stride_m, "{slack_m}");
        let surface_nodes = (0..x.len() as u32).filter(|&n| walls.nodes[n as usize] != NodeAtRest::INSIDE);
        for node in surface_nodes {
            let all = (0..walls.triangles.len() as u32).filter(|&t| walls.may_meet_m(node, t as usize).is_some());
            let listed = found.pairs().iter().filter(|pair| pair.node == node).map(|pair| pair.triangle);
            let (by_all, by_list) =
                (walls.gap(node, f64::INFINITY, &all, &x), walls.gap(node, f64::INFINITY, &listed, &x));
            assert_eq!(by_all, by_list, "node {node}");
            met += u32::from(by_all.is_some_and(|gap| gap.distance_m < walls.nodes[node as usize].margin_m));
        }
    }
    met
}

/// What is too far away or faces away is passed over when the least distances at rest are found.
#[test]
fn distances_at_rest_are_those_of_all_vertices_and_triangles() {
    let walls = walls_of(&clamp(), true).unwrap();
    let nodes = |cluster: usize| walls.of_cluster.row(cluster).iter().copied();
    let least_m = |node: u32, cluster: usize| {
        let range = walls.triangles.cluster_range(cluster);
        range.filter_map(|triangle| walls.may_meet_m(node, triangle)).fold(f64::INFINITY, f64::min)
    };
    let mut facing = 0;
    for one in 0..walls.clusters.len() {
        for entry in walls.close.row(one) {
            let other = entry.cluster as usize;
            let of_pair_m = nodes(one).map(|n| least_m(n, other)).chain(nodes(other).map(|n| least_m(n, one)));
            assert_eq!(entry.free_m, of_pair_m.fold(f64::INFINITY, f64::min), "clusters {one} and {other}");
            facing += u32::from(entry.free_m.is_finite());
        }
        for node in nodes(one) {
            let close = walls.close.row(one).iter().map(|entry| least_m(node, entry.cluster as usize));
            assert_eq!(walls.nodes[node as usize].free_close_m, close.fold(f64::INFINITY, f64::min), "node {node}");
        }
    }
    assert!(facing > 10, "{facing}");
}

/// In a step that was too long nodes were anywhere or not finite, and one query looked at every vertex with every
/// triangle for seconds, before the tick was taken back.
#[test]
fn a_torn_skin_is_passed_over_and_told() {
    let mesh = clamp();
    let walls = walls_of(&mesh, true).unwrap();
    let mut random = Random(3);
    let anywhere: Vec<DVec3> = mesh.positions_m().iter().map(|p| *p + random.vector()).collect();
    let mut not_finite = mesh.positions_m().to_vec();
    for p in not_finite.iter_mut().step_by(3) {
        p.y = f64::NAN;
    }
    for x in [anywhere, not_finite] {
        let near = walls.near_at(&x);
        assert!(near.pairs().is_empty() && walls.meeting(&x).missed > 0);
    }
    assert_eq!(walls.meeting(mesh.positions_m()).missed, 0);
}
