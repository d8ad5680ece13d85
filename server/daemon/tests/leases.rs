//! What an arm has to do to keep its tool and its force: how long it may be silent, how it loses its tool, and a button that is to be held.
use crate::common;
use crate::common::{Arm, Daemon, above, block_scene, force_of, hello, pressing, sample};
use glam::DVec3;
use palpate_proto::v1::{self, DeviceFaultCode, device_down::Message, device_up};
use palpated::serve::ServeConfig;
use tonic::Code;

/// Its samples' rate decides how long a device may be silent; one that goes quiet loses its tool, and the next gets it.
#[tokio::test(flavor = "multi_thread")]
async fn a_silent_device_loses_its_tool() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut quiet = daemon.attach(hello()).await;
    assert_eq!(quiet.welcome().await.limits.unwrap().lease_s, 0.2);
    let goodbye = goodbye(&mut quiet).await;
    assert_eq!(goodbye.code(), DeviceFaultCode::Detached);
    assert!(goodbye.message.contains("no sample"), "{}", goodbye.message);
    // After a while of samples, too, and pressing: its force is gone before its tool is.
    let mut next = welcomed(&daemon).await;
    next.hold_until(above(), |command| command.sample_sequence > 20).await;
    next.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    let mut last_n = DVec3::ONE;
    let goodbye = loop {
        match next.next().await.unwrap().expect("a goodbye") {
            Message::Command(command) => last_n = force_of(&command),
            Message::Fault(fault) if fault.code() == DeviceFaultCode::Detached => break fault,
            _ => {}
        }
    };
    assert!(goodbye.message.contains("no sample"), "{}", goodbye.message);
    assert_eq!(last_n, DVec3::ZERO);
    welcomed(&daemon).await;
    daemon.finish().await;
}

/// A script of 100 Hz heard STALE between its samples.
#[tokio::test(flavor = "multi_thread")]
async fn a_slow_device_that_says_so_is_not_stale_between_its_samples() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut slow = daemon.attach(v1::DeviceHello { sample_rate_hz: 10.0, ..hello() }).await;
    let limits = slow.welcome().await.limits.unwrap();
    assert_eq!((limits.stale_after_s, limits.lease_s), (0.2, 0.5));
    let (mut faults, mut force_n) = (Vec::new(), DVec3::ZERO);
    for round in 0..12 {
        slow.move_to(if round < 4 { above() } else { pressing() }).await;
        let until = tokio::time::Instant::now() + std::time::Duration::from_millis(100);
        while tokio::time::Instant::now() < until {
            force_n = force_of(&slow.command(&mut faults).await);
        }
    }
    assert!(faults.iter().all(|fault| fault.code() != DeviceFaultCode::Stale), "{faults:?}");
    assert!(force_n.z > 0.1, "{force_n}");
    // It goes quiet as it moves: where it would be is believed for a few milliseconds, and the force is gone before the tool.
    slow.sequence += 1;
    let mut moving = sample(slow.sequence, above());
    moving.twist.as_mut().unwrap().linear_m_per_s = Some(v1::Vec3 { z: -0.5, ..Default::default() });
    slow.send(moving).await;
    let mut lowest_m = f64::INFINITY;
    while let Ok(Some(message)) = slow.next().await {
        if let Message::Command(command) = message {
            lowest_m = lowest_m.min(command.proxy_position_m.unwrap().z);
            force_n = force_of(&command);
        }
    }
    assert_eq!(force_n, DVec3::ZERO, "before the tool");
    assert!(lowest_m > above().z - 0.02, "{lowest_m} m, {} m", above().z);
    // What it asks for counts, in bounds.
    let mut asks = loop {
        let mut asks = daemon.attach(v1::DeviceHello { pose_valid_for_s: 0.03, ..hello() }).await;
        if let Ok(Some(Message::Welcome(welcome))) = asks.next().await {
            assert_eq!(welcome.limits.unwrap().stale_after_s, 0.03);
            break asks;
        }
    };
    asks.move_to(above()).await;
    for (bad, part) in [
        (v1::DeviceHello { sample_rate_hz: 1.0, ..hello() }, "sample_rate_hz"),
        (v1::DeviceHello { sample_rate_hz: f64::NAN, ..hello() }, "sample_rate_hz"),
        (v1::DeviceHello { pose_valid_for_s: 2.0, ..hello() }, "pose_valid_for_s"),
    ] {
        let status = daemon.attach(bad).await.next().await.unwrap_err();
        assert!(status.code() == Code::InvalidArgument && status.message().contains(part), "{status:?}");
    }
    daemon.finish().await;
}

/// An order takes a tool from a device that presses: the force goes down, not away, and the tool is free when it is answered.
#[tokio::test(flavor = "multi_thread")]
async fn an_order_takes_the_tool_from_a_device() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut session = daemon.session();
    let nobody = session.detach(v1::DetachRequest::default()).await.unwrap_err();
    assert_eq!(nobody.code(), Code::FailedPrecondition, "{nobody:?}");
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    let pressed = arm.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    let unknown = v1::DetachRequest { tool_name: "spoon".into(), ..Default::default() };
    assert_eq!(session.detach(unknown).await.unwrap_err().code(), Code::NotFound);
    let up = arm.up.clone();
    let goes_on = tokio::spawn(async move {
        for sequence in arm.sequence + 1.. {
            let message = Some(device_up::Message::Sample(sample(sequence, pressing())));
            if up.send(v1::DeviceUp { message }).await.is_err() {
                break;
            }
            tokio::time::sleep(std::time::Duration::from_millis(1)).await;
        }
    });
    let ordered = tokio::spawn(async move { session.detach(v1::DetachRequest::default()).await });
    let (mut forces_n, mut goodbye) = (vec![force_of(&pressed).length()], None);
    while let Ok(Some(message)) = arm.down.message().await {
        match message.message.unwrap() {
            Message::Command(command) => forces_n.push(force_of(&command).length()),
            Message::Fault(fault) if fault.code() == DeviceFaultCode::Dismissed => goodbye = Some(fault),
            _ => {}
        }
    }
    assert!(goodbye.unwrap().message.contains("palpate-view detach"));
    assert_eq!(forces_n.last(), Some(&0.0));
    // The loop ramps at once: it does not go on until the stream does so in its place.
    assert!(forces_n.len() < 200, "{} commands before the last", forces_n.len());
    let peak_n = forces_n.iter().copied().fold(0.0, f64::max);
    let falls = forces_n.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let steepest_n = forces_n.windows(2).map(|pair| pair[0] - pair[1]).fold(0.0, f64::max);
    assert!(falls >= 3 && steepest_n < 0.5 * peak_n, "{falls} falls, of at most {steepest_n} N of {peak_n}");
    let done = ordered.await.unwrap().unwrap().into_inner();
    assert_eq!((done.device_name.as_str(), done.tool_name.as_str()), ("test arm", "finger"));
    let mut next = daemon.attach(hello()).await;
    next.welcome().await;
    goes_on.abort();
    daemon.finish().await;
}

/// The next fault that ends a stream.
async fn goodbye(arm: &mut Arm) -> v1::DeviceFault {
    loop {
        let fault = arm.fault().await;
        if matches!(fault.code(), DeviceFaultCode::Detached | DeviceFaultCode::Dismissed) {
            return fault;
        }
    }
}

/// A device on the tool, as soon as that is free.
async fn welcomed(daemon: &Daemon) -> Arm {
    let until = tokio::time::Instant::now() + common::PATIENCE;
    loop {
        let mut arm = daemon.attach(hello()).await;
        match arm.next().await {
            Ok(Some(Message::Welcome(_))) => return arm,
            Err(status) => assert_eq!(status.code(), Code::AlreadyExists),
            other => panic!("{other:?}"),
        }
        assert!(tokio::time::Instant::now() < until, "the tool is not free");
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_arm_has_force_while_its_button_is_held() {
    let mut config = ServeConfig::in_process();
    config.limits.hold_to_run = Some(2);
    let daemon = Daemon::with(block_scene("held", 3), config).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    let mut faults = Vec::new();
    let mut hold = async |buttons: u32, place: DVec3, samples: u32, faults: &mut Vec<v1::DeviceFault>| {
        let mut force_n = DVec3::ZERO;
        for _ in 0..samples {
            arm.sequence += 1;
            arm.send(v1::DeviceSample { buttons, ..sample(arm.sequence, place) }).await;
            force_n = force_of(&arm.command(faults).await);
        }
        force_n
    };
    let others = !(1 << 2);
    hold(others, above(), 400, &mut faults).await;
    assert_eq!(hold(others, pressing(), 300, &mut faults).await, DVec3::ZERO, "another button is not this one");
    let told = |faults: &[v1::DeviceFault]| faults.iter().filter(|f| f.code() == DeviceFaultCode::NotHeld).count();
    assert_eq!(told(&faults), 1);
    let held_n = hold(1 << 2, pressing(), 400, &mut faults).await;
    assert!(held_n.z > 0.1, "{held_n}");
    assert_eq!(hold(0, pressing(), 40, &mut faults).await, DVec3::ZERO);
    assert_eq!(told(&faults), 2);
    daemon.finish().await;
}
