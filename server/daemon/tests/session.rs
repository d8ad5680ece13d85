//! Control over a real socket: scenes, time, state, injected forces, and what is refused.
use crate::common;
use crate::common::{Daemon, block_scene, pressed_scene, vec3};
use glam::DVec3;
use palpate_proto::v1::{self, load_scene_request::Source};
use tonic::Code;

fn push(surface_vertex: u32, from_tick: u64, tick_count: u32) -> v1::InjectedForce {
    let force_n = Some(vec3(DVec3::new(0.01, -0.02, -0.05)));
    v1::InjectedForce { surface_vertex, force_n, from_tick, tick_count }
}

async fn inject(daemon: &Daemon, forces: Vec<v1::InjectedForce>) -> Result<v1::InjectForcesResponse, tonic::Status> {
    let request = v1::InjectForcesRequest { forces, ..Default::default() };
    Ok(daemon.session().inject_forces(request).await?.into_inner())
}

/// Pauses, goes to rest, and pushes some vertices over the next ticks.
async fn scripted(daemon: &Daemon) {
    daemon.pause().await;
    daemon.reset().await;
    let forces = vec![push(30, 0, 40), push(31, 20, 30), push(28, 55, 5)];
    assert_eq!(inject(daemon, forces).await.unwrap(), v1::InjectForcesResponse { first_tick: 1, pending: 3 });
}

#[tokio::test(flavor = "multi_thread")]
async fn two_daemons_with_the_same_script_reach_the_same_bits() {
    let one = Daemon::on(pressed_scene(3)).await;
    let other = Daemon::on(pressed_scene(3)).await;
    scripted(&one).await;
    scripted(&other).await;
    assert_eq!(one.step(120).await, 120);
    // The other in pieces, with wall-clock time in between.
    for ticks in [1, 60, 59] {
        other.step(ticks).await;
        tokio::time::sleep(std::time::Duration::from_millis(5)).await;
    }
    let (a, b) = (one.snapshot().await, other.snapshot().await);
    assert_eq!((a.tick, b.tick), (120, 120));
    assert_eq!(a.state_hash, b.state_hash);
    other.step(1).await;
    assert_ne!(other.snapshot().await.state_hash, a.state_hash, "the hash sees a tick");
    one.finish().await;
    other.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restored_state_goes_on_as_it_went_before() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    scripted(&daemon).await;
    daemon.step(70).await;
    let start = daemon.snapshot().await;
    daemon.step(50).await;
    let first = daemon.snapshot().await;
    let request = v1::RestoreRequest { state: start.state.clone(), ..Default::default() };
    let restored = daemon.session().restore(request).await.unwrap().into_inner();
    assert_eq!((restored.tick, restored.state_hash), (70, start.state_hash));
    assert_eq!(daemon.snapshot().await.state_hash, start.state_hash);
    daemon.step(50).await;
    assert_eq!(daemon.snapshot().await.state_hash, first.state_hash);

    let damaged: Vec<u8> = start.state.iter().take(start.state.len() - 1).copied().collect();
    let request = v1::RestoreRequest { state: damaged.into(), ..Default::default() };
    let refused = daemon.session().restore(request).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    let elsewhere = Daemon::on(block_scene("block", 2)).await;
    let request = v1::RestoreRequest { state: start.state, ..Default::default() };
    let refused = elsewhere.session().restore(request).await.unwrap_err();
    assert!(refused.message().contains("another body"), "{refused:?}");
    elsewhere.finish().await;
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn injected_forces_act_in_their_ticks_and_are_taken_all_or_none() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    daemon.pause().await;
    daemon.reset().await;
    let at_rest = daemon.snapshot().await;
    inject(&daemon, vec![push(14, 3, 1)]).await.unwrap();
    daemon.step(2).await;
    let energy = daemon.status().await.energies.unwrap();
    assert_eq!(energy.kinetic_j + energy.elastic_j, 0.0, "not yet");
    daemon.step(1).await;
    let energy = daemon.status().await.energies.unwrap();
    assert!(energy.kinetic_j > 0.0 && energy.external_work_j > 0.0);
    let held = energy.kinetic_j + energy.elastic_j + energy.dissipated_j;
    assert!((held - energy.external_work_j).abs() < 1e-3 * energy.external_work_j, "{energy:?}");

    for (bad, part) in [
        (vec![push(14, 0, 1), push(14, 2, 1)], "is over"),
        (vec![push(14, 0, 1), push(1_000_000, 0, 1)], "forces[1]: surface_vertex"),
        (vec![push(14, 0, 0)], "tick_count"),
        (vec![v1::InjectedForce { force_n: None, ..push(14, 0, 1) }], "force_n"),
        (vec![v1::InjectedForce { force_n: Some(vec3(DVec3::NAN)), ..push(14, 0, 1) }], "not finite"),
        (vec![v1::InjectedForce { force_n: Some(vec3(DVec3::splat(600.0))), ..push(14, 0, 1) }], "1000 N"),
        (vec![v1::InjectedForce { force_n: Some(vec3(DVec3::splat(1e300))), ..push(14, 0, 1) }], "1000 N"),
        (vec![push(14, 0, u32::MAX)], "tick_count = 4294967295 is more than"),
        (vec![push(14, u64::MAX, 1)], "too far ahead"),
        (vec![push(14, 0, 1); 4097], "4097"),
    ] {
        let refused = inject(&daemon, bad).await.unwrap_err();
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused:?}");
        assert!(refused.message().contains(part), "{refused:?}");
    }
    assert_eq!(inject(&daemon, Vec::new()).await.unwrap().pending, 0, "none of the refused was taken");
    daemon.reset().await;
    assert_eq!(daemon.snapshot().await.state_hash, at_rest.state_hash);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn orders_that_make_no_sense_are_refused_and_the_daemon_goes_on() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let mut session = daemon.session();
    let step = |ticks, id: &str| v1::StepRequest { ticks, session_id: id.into() };
    assert_eq!(session.step(step(5, "")).await.unwrap_err().code(), Code::FailedPrecondition, "it runs");
    daemon.pause().await;
    assert_eq!(session.step(step(0, "")).await.unwrap_err().code(), Code::InvalidArgument);
    assert_eq!(session.step(step(1_000_001, "")).await.unwrap_err().code(), Code::InvalidArgument);
    let unknown = session.step(step(1, "nonsense")).await.unwrap_err();
    let current = session.list(v1::ListRequest {}).await.unwrap().into_inner().sessions[0].session_id.clone();
    assert_eq!(unknown.code(), Code::NotFound);
    assert!(unknown.message().contains(&current), "it names the current one: {unknown:?}");
    let before = daemon.status().await.tick;
    assert_eq!(session.step(step(3, &current)).await.unwrap().into_inner().tick, before + 3);

    // Longer than the service reads at all, and longer than a small request may be.
    let huge = v1::RestoreRequest { state: vec![0_u8; 65 << 20].into(), ..Default::default() };
    let mut unlimited = daemon.session().max_encoding_message_size(usize::MAX);
    assert!(unlimited.restore(huge).await.is_err());
    let long = v1::ResetRequest { session_id: "x".repeat(3 << 20) };
    assert_eq!(session.reset(long).await.unwrap_err().code(), Code::OutOfRange);

    // A long step is interrupted by a reset.
    let mut stepping = daemon.session();
    let waiting = tokio::spawn(async move { stepping.step(step(1_000_000, "")).await });
    while daemon.status().await.tick < 10 {}
    let second = session.step(step(1, "")).await.unwrap_err();
    assert_eq!(second.code(), Code::FailedPrecondition);
    daemon.reset().await;
    assert_eq!(waiting.await.unwrap().unwrap_err().code(), Code::Aborted);
    assert_eq!(daemon.status().await.tick, 0);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scene_that_cannot_be_loaded_leaves_the_running_one_alone() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let before = daemon.status().await.session.unwrap();
    let mut session = daemon.session();
    for (source, code) in [
        (None, Code::InvalidArgument),
        (Some(Source::Builtin("no such scene".into())), Code::NotFound),
        (Some(Source::Path("/etc/passwd".into())), Code::PermissionDenied),
        (Some(Source::Toml("nonsense = = 1".into())), Code::InvalidArgument),
        (Some(Source::Toml("#".repeat((1 << 20) + 1))), Code::InvalidArgument),
    ] {
        let shown = format!("{source:.60?}");
        let refused = session.load_scene(v1::LoadSceneRequest { source }).await.unwrap_err();
        assert_eq!(refused.code(), code, "{shown}: {refused:?}");
    }
    // A loop could be neither asked nor stopped during such ticks.
    let slow = OTHER.replace("[body.box]", "tick_period_s = 0.6\n[body.box]");
    let heavy = format!("{}\n[numerics]\nsubsteps = 100000", OTHER.replace("[2, 2, 2]", "[5, 5, 5]"));
    for (toml, message) in [(slow, "needs ticks of 0.5 s at most"), (heavy, "750 tets in 100000 substeps")] {
        let source = Some(Source::Toml(toml));
        let refused = session.load_scene(v1::LoadSceneRequest { source }).await.unwrap_err();
        assert!(refused.message().contains(message), "{refused:?}");
    }
    assert_eq!(daemon.status().await.session.unwrap(), before);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn status_tells_the_probes_the_stages_and_the_energies() {
    let daemon = Daemon::on(pressed_scene(3)).await;
    let mut status = daemon.status().await;
    let until = tokio::time::Instant::now() + common::PATIENCE;
    while status.tick < 400 && tokio::time::Instant::now() < until {
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        status = daemon.status().await;
    }
    let stages: Vec<&str> = status.stages.iter().map(|stage| stage.stage.as_str()).collect();
    assert_eq!(stages, ["input", "contact_and_dynamics", "coupling", "publish"]);
    assert!(status.stages.iter().all(|stage| stage.cost_us.unwrap().count > 0));
    let table = status.probes.iter().find(|probe| probe.name == "table force").unwrap();
    assert_eq!((table.unit.as_str(), table.values.len()), ("N", 3));
    assert!(table.values[2] > 0.05, "the table holds the pressed block up: {:?}", table.values);
    let energies = status.energies.unwrap();
    assert!(energies.elastic_j > 0.0 && energies.external_work_j > 0.0);
    assert!((status.time_s - status.tick as f64 * 1e-3).abs() < 1e-9);
    assert!(status.devices.is_empty() && !status.paused);
    daemon.finish().await;
}

/// A block so stiff that one step a tick is too long.
#[tokio::test(flavor = "multi_thread")]
async fn status_tells_of_ticks_that_were_repeated() {
    let mut scene = block_scene("stiff", 2);
    scene.model.settings.substeps = palpate_physics::Substeps::Fixed(1);
    for region in &mut scene.model.body.solid_mut().unwrap().regions {
        region.material.lame.mu_pa *= 400.0;
        region.material.lame.lambda_pa *= 400.0;
    }
    let daemon = Daemon::on(scene).await;
    daemon.pause().await;
    inject(&daemon, vec![push(14, 0, 1)]).await.unwrap();
    daemon.step(50).await;
    let status = daemon.status().await;
    assert!(status.repeated_ticks >= 1 && status.quarantine.is_empty(), "{status:?}");
    assert!(status.substeps_now > 1 && status.session.unwrap().substeps_per_tick == 1);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_at_rest_sleeps_and_an_injected_force_wakes_it() {
    let mut scene = block_scene("sleepy", 2);
    scene.model.settings.sleep_tolerance_m = 1e-7;
    let daemon = Daemon::on(scene).await;
    daemon.pause().await;
    daemon.step(200).await;
    assert!(daemon.status().await.asleep);
    inject(&daemon, vec![push(14, 0, 1)]).await.unwrap();
    daemon.step(2).await;
    let status = daemon.status().await;
    assert!(!status.asleep && status.energies.unwrap().kinetic_j > 0.0);
    daemon.finish().await;
}

const OTHER: &str = r#"
[scene]
name = "another block"
[body.box]
size_m = [0.02, 0.02, 0.02]
cells = [2, 2, 2]
[[material]]
law = "stable-neo-hookean"
young_modulus_pa = 5000.0
poisson_ratio = 0.4
density_kg_per_m3 = 1000.0
[[fixed]]
region = "z_min"
"#;

#[tokio::test(flavor = "multi_thread")]
async fn a_loaded_scene_reaches_its_viewers_and_lets_devices_go() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut arm = daemon.attach(common::hello()).await;
    arm.welcome().await;
    arm.hold_until(common::above(), |command| command.sample_sequence > 20).await;
    arm.hold_until(common::pressing(), |command| common::force_of(command).z > 0.1).await;
    let mut viewer = daemon
        .surface()
        .watch(v1::WatchRequest { max_rate_hz: 60.0, ..Default::default() })
        .await
        .unwrap()
        .into_inner();
    let mut mirror = common::Mirror::default();
    while !mirror.complete {
        mirror.apply(viewer.message().await.unwrap().unwrap());
    }
    let (old_epoch, old_id) = (mirror.epoch, daemon.status().await.session.unwrap().session_id);

    let reading = tokio::spawn(async move {
        let (mut last_n, mut goodbye) = (None, None);
        while let Some(message) = arm.next().await.expect("the stream ends without an error") {
            match message {
                v1::device_down::Message::Command(command) => {
                    last_n = Some(common::force_of(&command).length());
                    arm.sequence += 1;
                    let next = common::sample(arm.sequence, common::pressing());
                    let next = v1::DeviceUp { message: Some(v1::device_up::Message::Sample(next)) };
                    let _ = arm.up.try_send(next);
                }
                v1::device_down::Message::Fault(fault) => goodbye = Some(fault),
                v1::device_down::Message::Welcome(_) => panic!("a second welcome"),
            }
        }
        (last_n, goodbye)
    });
    let source = Some(Source::Toml(OTHER.into()));
    let loaded = daemon.session().load_scene(v1::LoadSceneRequest { source }).await.unwrap().into_inner();
    let loaded = loaded.session.unwrap();
    assert_ne!(loaded.session_id, old_id);
    assert_eq!(daemon.status().await.session.unwrap(), loaded);
    let (last_n, goodbye) = tokio::time::timeout(common::PATIENCE, reading).await.unwrap().unwrap();
    let goodbye = goodbye.expect("a goodbye");
    assert_eq!((last_n, goodbye.code()), (Some(0.0), v1::DeviceFaultCode::Detached), "{}", goodbye.message);
    assert!(goodbye.message.contains("attach again"), "{}", goodbye.message);

    let until = tokio::time::Instant::now() + common::PATIENCE;
    while mirror.epoch == old_epoch || !mirror.complete {
        assert!(tokio::time::Instant::now() < until, "no keyframe of the new scene");
        let event = tokio::time::timeout(common::PATIENCE, viewer.message()).await.unwrap();
        mirror.apply(event.unwrap().unwrap());
    }
    let header = mirror.header.as_ref().unwrap();
    assert_eq!(header.session_id, loaded.session_id);
    assert_eq!(3 * loaded.surface_triangle_count as usize, mirror.triangles.len());
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_that_goes_away_does_not_leave_half_a_replacement() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let mut old = daemon.status().await.session.unwrap().session_id;
    for delay_ms in [0, 1, 3, 10, 30, 100, 300] {
        let mut session = daemon.session();
        let source = Some(Source::Toml(OTHER.into()));
        let call = tokio::spawn(async move { session.load_scene(v1::LoadSceneRequest { source }).await });
        tokio::time::sleep(std::time::Duration::from_millis(delay_ms)).await;
        call.abort();
    }
    // What was begun is finished, and the next one is served: nothing is locked, paused, or of two minds.
    let until = tokio::time::Instant::now() + common::PATIENCE;
    let loaded = loop {
        let source = Some(Source::Toml(OTHER.into()));
        match daemon.session().load_scene(v1::LoadSceneRequest { source }).await {
            Ok(loaded) => break loaded.into_inner().session.unwrap(),
            Err(status) => assert_eq!(status.code(), Code::Aborted, "{status:?}"),
        }
        assert!(tokio::time::Instant::now() < until, "still loading");
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    };
    assert_ne!(loaded.session_id, std::mem::take(&mut old));
    let before = daemon.status().await;
    assert_eq!((before.session.as_ref(), before.paused), (Some(&loaded), false));
    tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    assert!(daemon.status().await.tick > before.tick, "time goes on");
    daemon.finish().await;
}

/// Only `palpated check` told what is wrong with a body's lattice.
#[tokio::test(flavor = "multi_thread")]
async fn a_session_tells_what_is_wrong_with_its_lattice() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let toml = "[scene]\nname = \"thin\"\n[body]\n[body.box]\nsize_mm = [40, 40, 20]\ncells = [2, 2, 1]\n\
                [body.particles]\nspacing_mm = 5\nmost_active = 60\nfine_depth_mm = 15\n\
                [[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n[[fixed]]\nregion = \"z_min\"\n";
    let source = Some(Source::Toml(toml.into()));
    let loaded = daemon.session().load_scene(v1::LoadSceneRequest { source }).await.unwrap().into_inner();
    let told = loaded.warnings.iter().any(|warning| warning.starts_with("fine depth in [body.particles]"));
    assert!(told, "{:?}", loaded.warnings);
    daemon.finish().await;
}
