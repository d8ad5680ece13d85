//! How an arm's force ends: by an order, with the daemon, or when its loop fails.
use crate::common;
use crate::common::{Arm, Daemon, above, block_scene, force_of, hello, pressing, sample};
use glam::DVec3;
use palpate_proto::v1::{self, DeviceFaultCode, device_down::Message, device_up};
use palpated::serve::ServeConfig;

/// What a device hears until its stream ends: forces with their ticks, and the goodbye.
async fn to_the_end(arm: &mut Arm) -> (Vec<(DVec3, u64)>, Option<v1::DeviceFault>) {
    let (mut forces, mut goodbye) = (Vec::new(), None);
    while let Some(message) = arm.next().await.expect("the stream ends without an error") {
        match message {
            Message::Command(command) => {
                assert!(goodbye.is_none(), "nothing follows the goodbye");
                forces.push((force_of(&command), command.tick));
                arm.sequence += 1;
                let next = device_up::Message::Sample(sample(arm.sequence, pressing()));
                let _ = arm.up.try_send(v1::DeviceUp { message: Some(next) });
            }
            Message::Fault(fault) if fault.code() == DeviceFaultCode::Detached => goodbye = Some(fault),
            Message::Fault(fault) => assert_ne!(fault.code(), DeviceFaultCode::Unspecified),
            Message::Welcome(_) => panic!("a second welcome"),
        }
    }
    (forces, goodbye)
}

#[tokio::test(flavor = "multi_thread")]
async fn when_the_loop_fails_the_stream_ramps_to_zero_and_says_goodbye_and_the_daemon_stops_as_failed() {
    let mut daemon = Daemon::running(block_scene("block", 3), ServeConfig::in_process(), |the_loop, tick_loop| {
        let mut turns = 0;
        tick_loop.run(|wakeup| {
            turns += 1;
            assert!(turns < 1500, "the loop fails here, as it was meant to");
            the_loop.turn(wakeup)
        });
    })
    .await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.tick > 300).await;
    arm.hold_until(pressing(), |command| command.tick > 1300).await;
    let (forces, goodbye) = to_the_end(&mut arm).await;
    let goodbye = goodbye.expect("a goodbye");
    assert!(goodbye.message.contains("loop failed"), "{}", goodbye.message);
    assert_ramps_to_zero(forces.iter().map(|(force, _)| force));
    // Nobody told it to stop.
    let running = daemon.running.take().unwrap();
    let summary = tokio::time::timeout(common::PATIENCE, running.finished()).await.unwrap().unwrap();
    assert!(summary.failure.is_some_and(|failure| failure.contains("panic")), "{:?}", summary.failure);
}

/// From the last rise on, down to zero in steps.
fn assert_ramps_to_zero<'a>(forces: impl Iterator<Item = &'a DVec3>) {
    let forces: Vec<f64> = forces.map(|force| force.length()).collect();
    assert_eq!(forces.last(), Some(&0.0), "zero is sent, not only claimed");
    let top = forces.windows(2).rposition(|pair| pair[1] > pair[0]).map_or(0, |rise| rise + 1);
    let ramp = &forces[top..];
    let steps = ramp.iter().filter(|force| **force > 0.0 && **force < 0.9 * ramp[0]).count();
    assert!(ramp[0] > 0.1 && steps >= 2, "a ramp, not a step: {forces:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn reset_and_restore_wait_until_the_force_has_ramped_to_zero() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    let state = daemon.snapshot().await.state;
    for restore in [false, true] {
        let lifted_from = arm.sequence;
        arm.hold_until(above(), |command| command.sample_sequence > lifted_from + 300).await;
        let pressed_from = arm.sequence;
        arm.hold_until(pressing(), |command| command.sample_sequence > pressed_from + 500).await;
        let mut session = daemon.session();
        let state = state.clone();
        let order = tokio::spawn(async move {
            if restore {
                session.restore(v1::RestoreRequest { state, ..Default::default() }).await.unwrap();
            } else {
                session.reset(v1::ResetRequest::default()).await.unwrap();
            }
        });
        let mut forces = Vec::new();
        arm.hold_until(pressing(), |command| {
            forces.push(force_of(command));
            force_of(command) == DVec3::ZERO
        })
        .await;
        assert_ramps_to_zero(forces.iter());
        order.await.unwrap();
    }
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn stopping_ramps_to_zero_says_goodbye_and_ends_cleanly() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    // Until the ramp up is over and the body is at rest.
    arm.hold_until(pressing(), |command| command.sample_sequence > 500).await;
    // Samples go on: it is the order, not silence, that ramps.
    let reading = tokio::spawn(async move { to_the_end(&mut arm).await });
    tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    let daemon_state = std::sync::Arc::clone(&daemon.running.as_ref().unwrap().daemon);
    let summary = daemon.finish().await;
    let (forces, goodbye) = reading.await.unwrap();
    let goodbye = goodbye.unwrap();
    assert_eq!(goodbye.code(), DeviceFaultCode::Detached);
    assert!(goodbye.message.contains("ramped to zero"), "{}", goodbye.message);
    assert_ramps_to_zero(forces.iter().map(|(force, _)| force));
    let of_the_loop = |pair: &[(DVec3, u64)]| pair[0].1 < pair[1].1 || pair[0].0 == pair[1].0;
    assert!(forces.windows(2).all(of_the_loop), "the loop ramps, not the stream in its place: {forces:?}");
    assert!(daemon_state.sign.is_released());
    assert!(!summary.cut, "every stream ended by itself");
}
