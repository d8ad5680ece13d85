//! The whole bridge against a daemon's Device service on real sockets.

use crate::common::{Mock, config, pushing, start, until};
use palpate_bridge::BridgeError;
use palpate_control::{Fault, Link};
use palpate_proto::v1;
use std::time::Duration;
use tokio::io::AsyncWriteExt as _;
use tonic::Status;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn pose_goes_up_force_comes_down_and_the_arm_yields() {
    let (mock, bridge) = pushing(|_| {}).await;
    // 1 N on a hand of 300 N/m: 3.3 mm.
    until("the arm has yielded", || {
        let z = |sample: &v1::DeviceSample| sample.pose.unwrap().position_m.unwrap().z;
        mock.seen(|seen| seen.last_sample.as_ref().is_some_and(|sample| (z(sample) - 1.0 / 300.0).abs() < 1e-4))
    })
    .await;
    let summary = bridge.stop().await;
    assert!(mock.seen(|seen| seen.sequences.windows(2).all(|pair| pair[0] < pair[1])));
    assert_eq!(
        mock.seen(|seen| (seen.hellos[0].device_name.clone(), seen.hellos[0].max_force_n)),
        ("simulated".into(), 3.3)
    );
    assert!(summary.sent > 20 && summary.received > 20, "{summary}");
    assert_eq!(summary.reconnects, 0);
    // Every trip measured is one of a command received, and none is impossible.
    assert!(summary.round_trip.count > 0 && summary.round_trip.count <= summary.received);
    assert!(summary.round_trip.p50_ns > 1_000 && summary.round_trip.p50_ns <= summary.round_trip.p99_ns, "{summary}");
    assert!(summary.round_trip.max_ns < 20_000_000_000, "{summary}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn stopping_ramps_to_zero_and_ends_the_stream() {
    let (mock, bridge) = pushing(|_| {}).await;
    let handle = bridge.handle.clone();
    let summary = bridge.stop().await;
    assert_eq!((summary.final_force_n, handle.stats().link()), (0.0, Link::Latched(Fault::Requested)));
    assert!(!summary.to_string().contains("without force"), "a stop is no fault: {summary}");
    until("the daemon saw the end", || mock.seen(|seen| seen.ended == 1)).await;
}

/// The counters at the end did not say that the arm had been without force for an hour.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_end_in_a_latched_fault_says_so_and_how_to_recover() {
    let (mock, bridge) = pushing(|_| {}).await;
    let stats = bridge.handle.stats();
    mock.set(|behaviour| behaviour.silent = true);
    until("the fault is latched", || stats.link() == Link::Latched(Fault::Stale)).await;
    let shown = bridge.stop().await.to_string();
    for part in ["without force at the end", "no answer to a fresh pose", "SIGUSR1", "--auto-recover"] {
        assert!(shown.contains(part), "{part} is missing in:\n{shown}");
    }
}

/// A bridge whose caller dropped it went on pressing, with nobody left to stop it.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bridge_that_is_dropped_lets_the_arm_go() {
    let (mock, bridge) = pushing(|_| {}).await;
    let handle = bridge.handle.clone();
    bridge.task.abort();
    until("the force is gone", || handle.stats().link() == Link::Latched(Fault::Requested)).await;
    assert_eq!(handle.stats().force_n(), 0.0);
    until("the daemon saw the end", || mock.seen(|seen| seen.ended == 1)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_silent_daemon_means_zero_force_until_recovered() {
    let (mock, bridge) = pushing(|_| {}).await;
    let stats = bridge.handle.stats();
    mock.set(|behaviour| behaviour.silent = true);
    until("the fault is latched", || stats.link() == Link::Latched(Fault::Stale)).await;
    assert_eq!(stats.force_n(), 0.0);
    mock.set(|behaviour| behaviour.silent = false);
    let received = stats.received.get();
    until("commands flow again", || stats.received.get() > received + 50).await;
    assert_eq!((stats.force_n(), stats.link()), (0.0, Link::Latched(Fault::Stale)), "no force without recovery");
    bridge.handle.recover();
    until("the force is back", || stats.force_n() > 0.99).await;
    assert_eq!(bridge.stop().await.reconnects, 0);
}

/// The network may be as slow as it is steady: an answer to an old pose is old. The thresholds are the default ones times fifty,
/// for busy test machines: 5 ms, 12 ms of ramp, answers 8 ms and 25 ms old.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_delay_of_the_network_counts_as_age() {
    let (mock, bridge) = pushing(|config| {
        (config.watchdog.stale_after_s, config.watchdog.ramp_to_zero_s) = (0.25, 0.6);
        config.servo.least_success_rate = 0.0;
    })
    .await;
    let stats = bridge.handle.stats();
    mock.set(|behaviour| behaviour.delay = Duration::from_millis(400));
    until("the force ramps", || stats.link() == Link::Ramping(Fault::Stale) && stats.force_n() < 0.85).await;
    let received = stats.received.get();
    until("late commands flow", || stats.received.get() > received + 100).await;
    assert_eq!(stats.link(), Link::Ramping(Fault::Stale));
    assert!((0.3..0.85).contains(&stats.force_n()), "1 − (0.4 − 0.25)/0.75 = 0.8 N: {} N", stats.force_n());
    mock.set(|behaviour| behaviour.delay = Duration::from_millis(1250));
    until("the fault is latched", || stats.link() == Link::Latched(Fault::Stale)).await;
    let received = stats.received.get();
    until("late commands flow", || stats.received.get() > received + 100).await;
    assert_eq!((stats.link(), stats.force_n()), (Link::Latched(Fault::Stale), 0.0));
    bridge.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn with_auto_recover_the_force_comes_back_by_itself() {
    let (mock, bridge) = pushing(|config| config.servo.auto_recover = true).await;
    let stats = bridge.handle.stats();
    mock.set(|behaviour| behaviour.silent = true);
    until("the fault is latched", || stats.link() == Link::Latched(Fault::Stale)).await;
    mock.set(|behaviour| behaviour.silent = false);
    until("the force is back", || stats.force_n() > 0.99).await;
    assert_eq!(bridge.stop().await.latched, 1, "the silence; the stop is no fault");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_daemon_that_dies_and_returns_is_found_again() {
    let mock = Mock::default();
    let (address, stop, serving) = mock.serve("127.0.0.1:0").await;
    let mut config = config(&format!("http://{address}"));
    config.servo.auto_recover = true;
    let bridge = start(config);
    let stats = bridge.handle.stats();
    until("the force is up", || stats.force_n() > 0.99).await;
    stop.cancel();
    serving.await.unwrap();
    // The server's connections live in tasks of their own: end the stream too.
    mock.set(|behaviour| behaviour.hang_up = true);
    until("the force is gone", || stats.force_n() == 0.0).await;
    until("it tried in vain", || stats.failures.get() >= 3).await;
    mock.set(|behaviour| behaviour.hang_up = false);
    let (_, _stop, _serving) = mock.serve(&address.to_string()).await;
    until("the force is back", || stats.force_n() > 0.99).await;
    let last = mock.seen(|seen| seen.sequences.clone());
    assert!(last.windows(2).all(|pair| pair[0] < pair[1]), "sequences grow across connections");
    let summary = bridge.stop().await;
    assert_eq!(summary.reconnects, 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nan_from_the_daemon_never_reaches_the_arm() {
    let (mock, bridge) = pushing(|_| {}).await;
    let stats = bridge.handle.stats();
    mock.set(|behaviour| behaviour.wrench_n.z = f64::NAN);
    until("commands are refused", || stats.rejected.get() > 20).await;
    // Refused commands are no commands: the data grow stale, and the force goes to zero.
    until("the fault is latched", || stats.link() == Link::Latched(Fault::Stale)).await;
    let summary = bridge.stop().await;
    assert!(summary.peak_force_n.is_finite() && summary.peak_force_n <= 1.0 + 1e-9, "{summary}");
    assert_eq!(summary.non_finite, 0, "it was stopped at the border, not in the loop");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_smaller_of_both_limits_holds() {
    for (ours_n, theirs_n, expected_n) in [(2.0, 100.0, 2.0), (100.0, 1.5, 1.5)] {
        let mock = Mock::default();
        mock.set(|behaviour| {
            behaviour.wrench_n.z = 50.0;
            behaviour.max_force_n = theirs_n;
        });
        let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
        let mut config = config(&format!("http://{address}"));
        config.limits.max_force_n = ours_n;
        let bridge = start(config);
        until("the limit is reached", || bridge.handle.stats().force_n() > 0.999 * expected_n).await;
        let summary = bridge.stop().await;
        assert!(summary.peak_force_n <= expected_n * (1.0 + 1e-12) && summary.saturated > 0, "{summary}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_local_model_is_rendered_beside_the_arm() {
    // The daemon's wrench says 1 N for ever; its model is a wall of 500 N/m at z = 0, which the hand presses 3 mm into.
    let mock = Mock::default();
    let vec = |x, y, z| Some(v1::Vec3 { x, y, z });
    mock.set(|behaviour| {
        behaviour.local_model = Some(v1::LocalContactModel {
            point_m: vec(0.0, 0.0, 0.0),
            normal: vec(0.0, 0.0, 1.0),
            force_n: vec(0.0, 0.0, 0.0),
            stiffness_n_per_m: Some(v1::Mat3 { column_major: vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -500.0] }),
            validity_radius_m: 0.01,
            tick: 1_000_000,
            max_force_n: 3.0,
            torque: None,
        });
    });
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let mut config = config(&format!("http://{address}"));
    let palpate_bridge::config::DeviceConfig::Simulated(arm) = &mut config.device else { unreachable!() };
    arm.keyframes[0].position_m = [0.0, 0.0, -0.003];
    let bridge = start(config);
    // Springs in series: 300 (−3 mm − z) = 500 z, z = −1.125 mm, 0.5625 N.
    let z = |sample: &v1::DeviceSample| sample.pose.unwrap().position_m.unwrap().z;
    until("hand and wall balance", || {
        let settled = mock.seen(|seen| seen.last_sample.as_ref().is_some_and(|s| (z(s) + 1.125e-3).abs() < 1e-5));
        settled && (bridge.handle.stats().force_n() - 0.5625).abs() < 5e-3
    })
    .await;
    bridge.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_quarantined_body_stops_the_force() {
    let (mock, bridge) = pushing(|_| {}).await;
    let stats = bridge.handle.stats();
    mock.set(|behaviour| behaviour.fault = Some(v1::DeviceFaultCode::Quarantined));
    until("the fault is latched", || stats.link() == Link::Latched(Fault::Peer)).await;
    assert_eq!((stats.force_n(), bridge.stop().await.peer_faults), (0.0, 1));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_unreachable_daemon_is_an_error_that_says_what_to_do() {
    // A port that was free a moment ago.
    let address = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let mut config = config(&format!("http://{address}"));
    config.server.give_up_after_s = Some(0.2);
    let bridge = start(config);
    let error = bridge.task.await.unwrap().unwrap_err();
    let shown = format!("{:?}", miette::Report::new(error));
    for part in [&format!("http://{address}"), "no daemon answered", "refused", "palpated", "--server"] {
        assert!(shown.contains(part), "{part} is missing in: {shown}");
    }
}

/// It said "refused the arm: h2 protocol error", and then, of the same server, "code: 'Unknown error', … BrokenPipe".
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_of_another_kind_is_told_from_a_daemon() {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            let _ = stream.write_all(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n").await;
        }
    });
    let mut config = config(&format!("http://{address}"));
    config.server.give_up_after_s = Some(0.2);
    let error = start(config).task.await.unwrap().unwrap_err().to_string();
    assert!(error.contains(&format!("no daemon answered at http://{address}")), "{error}");
    assert!(error.contains("another program") && error.contains("https://") && !error.contains("Custom"), "{error}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_refusal_that_will_not_change_ends_the_bridge_and_another_does_not() {
    let mock = Mock::default();
    let (address, _stop, _serving) = mock.serve("127.0.0.1:0").await;
    let url = format!("http://{address}");
    mock.set(|behaviour| behaviour.refuse = Some(Status::not_found("the scene has no tool \"hand\"")));
    match start(config(&url)).task.await.unwrap() {
        Err(BridgeError::Refused { message, help, .. }) => {
            assert!(message.contains("no tool \"hand\""));
            assert!(help.contains("--tool"));
        }
        other => panic!("{other:?}"),
    }
    mock.set(|behaviour| behaviour.refuse = Some(Status::already_exists("another arm drives this tool")));
    let bridge = start(config(&url));
    until("it tried again", || bridge.handle.is_attached()).await;
    bridge.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_network_that_swallows_everything_means_zero_force() {
    // A peer that accepts and never speaks: no welcome, no force, and a clean end.
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let bridge = start(config(&format!("http://{}", listener.local_addr().unwrap())));
    let _held = listener.accept().await.unwrap();
    tokio::time::sleep(Duration::from_millis(100)).await;
    assert_eq!((bridge.handle.stats().force_n(), bridge.handle.is_attached()), (0.0, false));
    assert_eq!(bridge.stop().await.sent, 0);
}
