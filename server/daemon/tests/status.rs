//! What a daemon's status tells of its body: what particles are awake for, and what is wrong with it as it is.
use crate::common::{Daemon, hybrid::hybrid_scene, vec3};
use glam::DVec3;
use palpate_proto::v1;
use palpate_scene::{Limits, parse};

fn sum(counts: &v1::AwakeFor) -> u32 {
    counts.tools + counts.loads + counts.injected_forces + counts.nothing
}

#[tokio::test(flavor = "multi_thread")]
async fn particles_are_awake_for_tools_and_for_forces_that_are_injected() {
    let daemon = Daemon::on(hybrid_scene()).await;
    daemon.pause().await;
    daemon.reset().await;
    assert_eq!(daemon.status().await.awake_for, Some(v1::AwakeFor::default()));
    daemon.step(300).await;
    let pressed = daemon.status().await;
    let counts = pressed.awake_for.unwrap();
    assert!(counts.tools > 20 && counts.loads + counts.injected_forces == 0, "{counts:?}");
    assert_eq!(sum(&counts), pressed.active_particles);
    // A force in a corner, far from the tool.
    let session = daemon.running.as_ref().unwrap().daemon.session();
    let rest = session.model.surface_rest_positions_m();
    let corner = DVec3::new(0.04, 0.04, 0.02);
    let vertex = (0..rest.len()).find(|&v| rest[v].distance(corner) < 1e-9).unwrap() as u32;
    let force_n = Some(vec3(DVec3::NEG_Z * 0.005));
    let force = v1::InjectedForce { surface_vertex: vertex, force_n, from_tick: 0, tick_count: 40 };
    daemon
        .session()
        .inject_forces(v1::InjectForcesRequest { forces: vec![force], ..Default::default() })
        .await
        .unwrap();
    daemon.step(30).await;
    let pushed = daemon.status().await;
    let counts = pushed.awake_for.unwrap();
    assert!(counts.tools > 20 && counts.injected_forces > 20 && counts.loads == 0, "{counts:?}");
    assert_eq!(sum(&counts), pushed.active_particles);
    // Once it has gone they are awake for nothing, until they sleep.
    daemon.step(11).await;
    let counts = daemon.status().await.awake_for.unwrap();
    assert_eq!(counts.injected_forces, 0, "{counts:?}");
    daemon.finish().await;
}

/// A block of StVK between plates that come nearer by so much (mm) of its 10.
fn squeezed(by_mm: f64) -> String {
    format!(
        "[scene]\nname = \"squeezed\"\n[body]\nelements = \"linear\"\n[body.box]\nsize_mm = [20, 20, 10]\ncells = [4, 4, 4]\n\
         [[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0\ndensity_kg_per_m3 = 1000\nviscosity_psi_pa_s = 0.3\n\
         [[fixed]]\nregion = \"z_min\"\n[[prescribed]]\nregion = \"z_max\"\ndisplacement_mm = [0, 0, -{by_mm}]\n\
         amplitude.smooth_step.duration_s = 0.2\n[[probe]]\nname = \"table\"\nmeasure = \"reaction\"\nregion = \"z_min\"\n"
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_is_pressed_beyond_its_law_is_told_while_it_is() {
    for (by_mm, is_told) in [(4.6, true), (3.0, false)] {
        let scene = parse(&squeezed(by_mm), "squeezed", None, &Limits::wire(), &mut |_, _| ()).unwrap();
        let daemon = Daemon::on(scene).await;
        daemon.pause().await;
        daemon.reset().await;
        assert_eq!(daemon.status().await.state_warnings, Vec::<String>::new());
        let mut told = Vec::new();
        for _ in 0..50 {
            daemon.step(5).await;
            told.extend(daemon.status().await.state_warnings);
        }
        // One layer of linear tets gives way to the others, until it is inside out; smoothed ones bear it.
        for words in ["the law \"stvk\" bears less", "elements are turned inside out"] {
            assert_eq!(told.iter().any(|warning| warning.contains(words)), is_told, "{told:?}");
        }
        // The force that held it is not told of the body at rest.
        let table_n = async || daemon.status().await.probes[0].values[2];
        assert!(table_n().await.abs() > 0.1, "{}", table_n().await);
        daemon.reset().await;
        assert_eq!(table_n().await, 0.0);
        // Bodies without particles have none that are awake.
        assert_eq!(daemon.status().await.awake_for, None);
        daemon.finish().await;
    }
}
