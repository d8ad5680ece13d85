//! A step of the seeds' hybrid neither allocates nor frees, whatever is touched.
#![allow(clippy::unwrap_used)]
mod octahedra;
mod rig;
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use glam::DVec3;
use octahedra::{body_spec, core, device_m, layer, parameters};
use palpate_physics::{
    PointForce, TickInput,
    bodies::seed::{AtVertex, SeedContact, SeedModel, SeedScratch, SeedSpec, SeedState},
    contact::ToolTarget,
};
use rig::Rig;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn a_step_does_not_allocate() {
    let spec = SeedSpec { core: core(0.01, 0.02), held_nodes: vec![0], layer: Some(layer()), parameters: parameters() };
    for parameters in [spec.parameters, spec.parameters.as_printed()] {
        let model = SeedModel::build(SeedSpec { parameters, ..spec.clone() }).unwrap();
        let (mut state, mut scratch) = (SeedState::at_rest(&model), SeedScratch::new(&model));
        let force = [AtVertex { vertex: 2, value: DVec3::Y * 1e-6 }];
        let displaced = [AtVertex { vertex: 0, value: DVec3::X * 0.0299 }, AtVertex { vertex: 5, value: DVec3::NAN }];
        let mut touched = 0;
        // Other triangles, none, and back: regions of all sizes wake and sleep.
        for triangle in [Some(0), Some(3), None, Some(7), Some(1), Some(99)] {
            let contact = SeedContact { triangle, forces_n: &force, displaced_m: &displaced };
            assert_no_alloc(|| {
                for _ in 0..5 {
                    touched += model.step(&mut state, &mut scratch, &contact).particles_touched;
                }
            });
        }
        assert!(touched > 1000);
    }
}

/// As a body of the loop: pressed, touched on another side and left, with inputs that are refused, quarantined and reset.
#[test]
fn a_tick_does_not_allocate() {
    let mut rig = Rig::new(body_spec(0.02, Some(layer()), parameters()));
    let first = rig.model.surface().nodes[0];
    let mut saved = rig.state.clone();
    let (mut awake, mut asleep, mut rejected, mut quarantined) = (0, 0, 0, 0);
    assert_no_alloc(|| {
        for tick in 0..400 {
            let odd = tick % 97 == 0;
            let blow = DVec3::X * if tick == 380 { 1e300 } else { 1e-6 };
            let tools = [ToolTarget::at(device_m(tick))];
            let forces = [
                PointForce { node: first, force_n: if odd { DVec3::NAN } else { blow } },
                // A node of the core, which nothing can push.
                PointForce { node: 0, force_n: DVec3::X },
            ];
            let input = TickInput {
                tools: if odd { &[] } else { &tools },
                load_factors: &[],
                prescribed_displacements_m: &[if odd { DVec3::X } else { DVec3::ZERO }],
                point_forces: &forces[..if odd { 2 } else { 1 }],
            };
            let report = palpate_physics::step(&rig.model, &mut rig.state, &mut rig.scratch, &input);
            rejected += report.inputs_rejected;
            quarantined += u32::from(report.quarantined.is_some());
            awake += u32::from(rig.state.awake_particles() > 0);
            asleep += u32::from(rig.state.awake_particles() == 0);
            if tick == 200 {
                saved.copy_from(&rig.state);
            }
        }
        rig.state.copy_from(&saved);
        rig.state.reset(&rig.model);
    });
    // Four odd ticks before it blows up, in each of which the tools, the holder's displacement and both forces are refused.
    assert_eq!((rejected, quarantined), (4 * 4, 1));
    assert!(awake > 100 && asleep > 30, "{awake} {asleep}");
}
