//! The model touched: what it answers, and what it survives.
use super::{ball, ball_with, press, touched, triangle_towards, try_press};
use crate::{
    bodies::seed::{
        AtVertex, Exchange, InterfaceForce, PairStress, PaperModel, SeedContact, SeedParameters, SeedScratch, SeedState,
    },
    material::Viscosity,
};
use glam::DVec3;

/// With table 1 of 2006 a triangle of the skin is pressed to 3 of the layer's 10 mm in 500 steps.
#[test]
fn a_press_stays_finite_and_pushes_back_the_more_the_deeper() {
    let model = ball();
    let (reactions, state) = press(&model, 3e-3, 500);
    println!("mean reactions by tenths (µN): {:?}", reactions.iter().map(|r| (r * 1e6).round()).collect::<Vec<_>>());
    assert!(reactions.iter().all(|&r| r > 0.0), "outwards throughout");
    // The start of a press from rest at once is an impact; then it grows.
    assert!(reactions[2..].windows(2).all(|pair| pair[1] > pair[0]), "{reactions:?}");
    assert!(reactions[9] > 2.0 * reactions[4]);
    // The touched triangle is where it was pressed to, the far side of the skin did not move that much.
    let corners = model.surface_triangles()[touched(&model).0 as usize];
    for vertex in corners {
        let by = model.surface_m(&state, vertex).distance(model.surface_rest_m()[vertex as usize]);
        assert!((by / 3e-3 - 1.0).abs() < 0.35, "{by}");
    }
    let far = model.surface_triangles()[triangle_towards(&model, DVec3::Z) as usize];
    for vertex in far {
        let by = model.surface_m(&state, vertex).distance(model.surface_rest_m()[vertex as usize]);
        assert!(by < 0.3e-3, "{by}");
    }
}

#[test]
fn twice_the_constants_push_twice_as_hard() {
    // Not a tautology of units: dt √2 smaller keeps every step's ratio of time scales.
    let soft = ball_with(|spec| spec.parameters.viscosity = Viscosity::default());
    let stiff = ball_with(|spec| {
        let parameters = &mut spec.parameters;
        parameters.viscosity = Viscosity::default();
        parameters.lame.lambda_pa *= 2.0;
        parameters.lame.mu_pa *= 2.0;
        parameters.dt_s /= 2f64.sqrt();
    });
    let (a, b) = (press(&soft, 1e-3, 300).0, press(&stiff, 1e-3, 300).0);
    for (a, b) in a.iter().zip(&b) {
        assert!((b / a - 2.0).abs() < 1e-3, "{a} {b}");
    }
}

/// The printed interface force does nothing while nobody leaves a voxel, and then drives them out, however short the
/// step.
#[test]
fn the_printed_interface_force_pumps_energy() {
    for (dt_s, steps) in [(7e-3, 500), (1e-3, 3500)] {
        let result = |interface_force| {
            let model = ball_with(|spec| {
                spec.parameters.interface_force = interface_force;
                spec.parameters.dt_s = dt_s;
            });
            try_press(&model, 3e-3, steps).map(|(_, state)| {
                let region = model.awake(&state).unwrap();
                (0..region.len()).map(|slot| state.particles.x[slot].distance(region.rest_m(slot))).fold(0.0, f64::max)
            })
        };
        let (own, nearest) = (result(InterfaceForce::OwnVoxel), result(InterfaceForce::NearestVoxel));
        println!("{dt_s} s: farthest particle (m) or last step: own {own:?}, nearest {nearest:?}");
        assert!(own.unwrap() < 8e-3 && nearest.is_err());
    }
}

#[test]
fn same_inputs_same_bits() {
    let model = ball();
    let (first, second) = (press(&model, 2e-3, 120), press(&model, 2e-3, 120));
    assert_eq!(first, second);
    assert!(first.1.fits(&model));
}

#[test]
fn bad_inputs_are_left_out_and_counted() {
    let model = ball();
    let (mut state, mut scratch) = (SeedState::at_rest(&model), SeedScratch::new(&model));
    let bad = [AtVertex { vertex: 9999, value: DVec3::ZERO }, AtVertex { vertex: 0, value: DVec3::NAN }];
    let contact = SeedContact { triangle: Some(9999), forces_n: &bad, displaced_m: &bad };
    let report = model.step(&mut state, &mut scratch, &contact);
    assert_eq!((report.inputs_rejected, report.is_finite), (5, true));
    let mut untouched = SeedState::at_rest(&model);
    model.step(&mut untouched, &mut scratch, &SeedContact::default());
    assert_eq!(state, untouched);
}

#[test]
fn a_core_alone_pushes_back_too() {
    let model = ball_with(|spec| spec.layer = None);
    assert_eq!((model.surface_triangles().len(), model.most_awake()), (160, 0));
    let (reactions, _) = press(&model, 2e-3, 300);
    assert!(reactions[9] > 0.0 && reactions[9] > reactions[4], "{reactions:?}");
}

#[test]
fn as_printed_all_three_repairs_are_out() {
    let parameters = SeedParameters::paper_2006(PaperModel::Hybrid).as_printed();
    assert_eq!(parameters.pair_stress, PairStress::Neighbour);
    assert_eq!(
        (parameters.exchange, parameters.interface_force),
        (Exchange::Displacements, InterfaceForce::NearestVoxel)
    );
    let model = ball_with(|spec| spec.parameters = parameters);
    // A short press is survived, a longer one not.
    let (_, state) = press(&model, 0.5e-3, 50);
    assert!(state.particles.is_finite(model.most_awake()));
    let burst = try_press(&model, 3e-3, 500);
    println!("as printed it bursts after {:?} steps", burst.as_ref().err());
    assert!(burst.is_err());
}

/// "To obtain a more global motion of the object surface when no particles are activated": the links bring the skin
/// back to rest.
#[test]
fn a_surface_that_is_let_go_comes_back() {
    let model = ball();
    let (_, mut state) = press(&model, 2e-3, 300);
    let mut scratch = SeedScratch::new(&model);
    let away = |state: &SeedState| {
        let distance = |(x, rest): (&DVec3, &DVec3)| x.distance(*rest);
        state.skin.x.iter().zip(model.surface_rest_m()).map(distance).fold(0.0, f64::max)
    };
    let stretched = |state: &SeedState| {
        let links = model.links().unwrap();
        let stretch = |(vertex, x): (usize, &DVec3)| {
            x.distance(links.at_attachment(vertex, &state.core.x) + links.offset_m[vertex])
        };
        state.skin.x.iter().enumerate().map(stretch).fold(0.0, f64::max)
    };
    let (pressed, start) = (away(&state), stretched(&state));
    for _ in 0..1000 {
        assert!(model.step(&mut state, &mut scratch, &SeedContact::default()).is_finite);
    }
    println!(
        "from rest {:.3} mm, after 7 s {:.3} mm; links stretched {:.3} mm, then {:.4} mm",
        pressed * 1e3,
        away(&state) * 1e3,
        start * 1e3,
        stretched(&state) * 1e3
    );
    // The core still swings, which next to nothing damps; the skin swings with it.
    assert!(pressed > 1e-3 && away(&state) < 0.3 * pressed);
    assert!(start > 0.5e-3 && stretched(&state) < 0.03 * start);
}

/// One triangle after its neighbour is pressed by a millimetre and let go: 200 touches in 70 s.
#[test]
fn a_touch_that_walks_over_the_surface_stays_finite() {
    let model = ball();
    let (mut state, mut scratch) = (SeedState::at_rest(&model), SeedScratch::new(&model));
    let triangles = model.surface_triangles();
    let mut triangle = touched(&model).0;
    let (mut visited, mut farthest) = (vec![triangle], 0.0_f64);
    for _ in 0..200 {
        let corners = triangles[triangle as usize];
        let rest = corners.map(|v| model.surface_rest_m()[v as usize]);
        let outwards = (rest[1] - rest[0]).cross(rest[2] - rest[0]).normalize();
        for step in 0..50 {
            let depth = 1e-3 * (std::f64::consts::PI * (f64::from(step) + 0.5) / 50.0).sin();
            let goals = [0, 1, 2].map(|i| AtVertex { vertex: corners[i], value: rest[i] - outwards * depth });
            let contact = SeedContact { triangle: Some(triangle), displaced_m: &goals, ..SeedContact::default() };
            assert!(model.step(&mut state, &mut scratch, &contact).is_finite, "{} triangles", visited.len());
        }
        let region = model.awake(&state).unwrap();
        farthest = (0..region.len())
            .map(|slot| state.particles.x[slot].distance(region.rest_m(slot)))
            .fold(farthest, f64::max);
        let beside = |t: &u32| triangles[*t as usize].iter().filter(|v| corners.contains(v)).count() == 2;
        let next = (0..triangles.len() as u32).filter(beside).find(|t| !visited.contains(t));
        triangle = next.unwrap_or(visited[0]);
        visited.push(triangle);
    }
    println!("{} touches, farthest particle {:.2} mm", visited.len(), farthest * 1e3);
}

/// The papers' "external force": 30 µN on a triangle, reached in 2 s.
#[test]
fn an_external_force_dents_the_surface() {
    let model = ball();
    let triangle = touched(&model).0;
    let corners = model.surface_triangles()[triangle as usize];
    let rest = corners.map(|v| model.surface_rest_m()[v as usize]);
    let outwards = (rest[1] - rest[0]).cross(rest[2] - rest[0]).normalize();
    let (mut state, mut scratch) = (SeedState::at_rest(&model), SeedScratch::new(&model));
    let mut depths = Vec::new();
    for step in 0..300 {
        let force = outwards * (-10e-6 * (f64::from(step) / 285.0).min(1.0));
        let push = corners.map(|vertex| AtVertex { vertex, value: force });
        let contact = SeedContact { triangle: Some(triangle), forces_n: &push, ..SeedContact::default() };
        assert!(model.step(&mut state, &mut scratch, &contact).is_finite, "step {step}");
        if step % 60 == 59 {
            let sunk = |i: usize| (rest[i] - model.surface_m(&state, corners[i])).dot(outwards);
            depths.push((sunk(0) + sunk(1) + sunk(2)) / 3.0);
        }
    }
    println!("sunk by {:?} mm", depths.iter().map(|d| (d * 1e6).round() / 1e3).collect::<Vec<_>>());
    assert!(depths[0] > 0.0 && depths.windows(2).all(|pair| pair[1] > pair[0]), "{depths:?}");
}
