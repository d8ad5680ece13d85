//! An arm over a real socket: force when it presses, safety when it does not.
use crate::common;
use crate::common::{Arm, Daemon, above, block_scene, force_of, hello, pressing, sample};
use glam::DVec3;
use palpate_proto::v1::{self, DeviceFaultCode, device_down::Message, device_up};
use tonic::Code;

#[tokio::test(flavor = "multi_thread")]
async fn a_pressed_block_pushes_back_within_the_limits() {
    let daemon = Daemon::on(block_scene("block", 4)).await;
    let mut arm = daemon.attach(hello()).await;
    let welcome = arm.welcome().await;
    let limits = welcome.limits.unwrap();
    assert_eq!((welcome.tool_name.as_str(), limits.max_force_n), ("finger", 3.0));
    assert_eq!(limits.coupling_stiffness_n_per_m, 500.0);

    let free = arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    assert!(force_of(&free).length() < 1e-12, "nothing is touched");
    assert!(free.local_model.is_none());

    let pressed = arm.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    assert!(force_of(&pressed).length() <= 3.0);
    assert!(pressed.echo_device_time_ns == pressed.sample_sequence * 1_000_000, "the echo is the sample's own time");
    let model = arm.hold_until(pressing(), |command| command.local_model.is_some()).await.local_model.unwrap();
    let normal = model.normal.unwrap();
    assert!(normal.z > 0.9, "the block's top looks up: {normal:?}");
    assert_eq!(model.stiffness_n_per_m.unwrap().column_major.len(), 9);

    // The harder it is pressed, the closer to the limit, and never beyond.
    let deep = pressing() - DVec3::Z * 0.012;
    let mut largest = 0.0_f64;
    arm.hold_until(deep, |command| {
        largest = largest.max(force_of(command).length());
        command.sample_sequence > 800
    })
    .await;
    assert!(largest <= 3.0 + 1e-12, "{largest} N");
    let status = daemon.status().await;
    assert_eq!(status.devices.len(), 1);
    assert!(status.devices[0].samples_accepted > 800 && status.devices[0].samples_rejected == 0);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_samples_get_their_own_faults_and_the_stream_goes_on() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    let nan = Some(v1::Vec3 { x: f64::NAN, ..Default::default() });
    let change = |change: fn(&mut v1::DeviceSample)| {
        let mut bad = sample(10, above());
        change(&mut bad);
        bad
    };
    arm.send(sample(9, above())).await;
    let mut not_finite = sample(10, above());
    not_finite.twist.as_mut().unwrap().linear_m_per_s = nan;
    let cases = [
        (not_finite, DeviceFaultCode::NonFinite),
        (
            change(|s| s.pose.as_mut().unwrap().orientation = Some(v1::Quaternion::default())),
            DeviceFaultCode::BadOrientation,
        ),
        (change(|s| s.sequence = 9), DeviceFaultCode::OldSequence),
        (change(|s| s.pose = None), DeviceFaultCode::MissingField),
        (change(|s| s.pose.as_mut().unwrap().position_m.as_mut().unwrap().x = 1e9), DeviceFaultCode::OutOfRange),
    ];
    let count = cases.len() as u64;
    for (bad, code) in cases {
        arm.send(bad).await;
        loop {
            let fault = arm.fault().await;
            // A silent arm is told so as well.
            if fault.code() != DeviceFaultCode::Stale {
                assert_eq!((fault.code(), fault.count), (code, 1), "{}", fault.message);
                assert!(!fault.message.is_empty());
                break;
            }
        }
    }
    // A second hello and an empty message are refused without ending the stream.
    arm.up.send(v1::DeviceUp { message: Some(device_up::Message::Hello(hello())) }).await.unwrap();
    arm.up.send(v1::DeviceUp { message: None }).await.unwrap();
    arm.sequence = 100;
    arm.hold_until(above(), |command| command.sample_sequence > 100).await;
    let status = daemon.status().await;
    assert_eq!(status.samples_rejected, count + 2);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bad_hello_and_a_taken_tool_are_refused_with_a_reason() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let mut first = daemon.attach(hello()).await;
    first.welcome().await;
    let cases = [
        (hello(), Code::AlreadyExists, "test arm"),
        (v1::DeviceHello { tool_name: "spoon".into(), ..hello() }, Code::NotFound, "finger"),
        (v1::DeviceHello { tool_name: "probe".into(), ..hello() }, Code::FailedPrecondition, "moved by the scene"),
        (v1::DeviceHello { max_force_n: f64::NAN, ..hello() }, Code::InvalidArgument, "max_force_n"),
        (v1::DeviceHello { servo_rate_hz: 0.0, ..hello() }, Code::InvalidArgument, "servo_rate_hz"),
        (v1::DeviceHello { device_name: "x".repeat(65), ..hello() }, Code::InvalidArgument, "65 bytes"),
        (v1::DeviceHello { device_name: "arm\u{1b}[2J".into(), ..hello() }, Code::InvalidArgument, "control character"),
        (v1::DeviceHello { tool_name: "finger\n".into(), ..hello() }, Code::InvalidArgument, "control character"),
    ];
    for (hello, code, part) in cases {
        let status = daemon.attach(hello).await.next().await.unwrap_err();
        assert_eq!(status.code(), code, "{status:?}");
        assert!(status.message().contains(part), "{status:?}");
    }
    // A sample instead of a hello.
    let (up, receiver) = tokio::sync::mpsc::channel(4);
    let message = Some(device_up::Message::Sample(sample(1, above())));
    up.send(v1::DeviceUp { message }).await.unwrap();
    let mut client = v1::device_client::DeviceClient::new(daemon.channel.clone());
    let mut down = client.attach(tokio_stream::wrappers::ReceiverStream::new(receiver)).await.unwrap().into_inner();
    assert_eq!(down.message().await.unwrap_err().code(), Code::InvalidArgument);

    // The tool is free again once the first device has gone.
    drop(first);
    let mut welcomed = false;
    for _ in 0..200 {
        let mut next = daemon.attach(hello()).await;
        match next.next().await {
            Ok(Some(Message::Welcome(_))) => {
                welcomed = true;
                break;
            }
            Err(status) => assert_eq!(status.code(), Code::AlreadyExists),
            other => panic!("{other:?}"),
        }
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    assert!(welcomed);
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn silence_ramps_the_force_to_zero_and_samples_bring_it_back() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    arm.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    let mut faults = Vec::new();
    while force_of(&arm.command(&mut faults).await) != DVec3::ZERO {}
    assert!(faults.iter().any(|fault| fault.code() == DeviceFaultCode::Stale), "{faults:?}");
    arm.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    daemon.finish().await;
}

/// A silent device on a paused session was never told that it was stale, nor that the session was paused.
#[tokio::test(flavor = "multi_thread")]
async fn a_device_is_told_that_time_stands_and_that_it_is_stale_all_the_same() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    arm.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    daemon.pause().await;
    let mut told = Vec::new();
    while told.len() < 2 {
        // Silent for longer than a pose is good, and not for longer than a lease.
        let code = arm.fault().await.code();
        if code != DeviceFaultCode::Limited {
            told.push(code);
        }
    }
    told.sort();
    assert_eq!(told, [DeviceFaultCode::Stale, DeviceFaultCode::Held]);
    let from = arm.sequence;
    let held = arm.hold_until(pressing(), |command| command.sample_sequence > from + 50).await;
    assert_eq!((force_of(&held), held.local_model), (DVec3::ZERO, None));
    daemon.finish().await;
}

/// The tick in which a fault was told had no command.
#[tokio::test(flavor = "multi_thread")]
async fn a_fault_takes_no_commands_place() {
    let mut scene = block_scene("slow", 2);
    scene.model.settings.tick_period_s = 0.1;
    let daemon = Daemon::on(scene).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    let mut faults = Vec::new();
    let mut ticks = vec![arm.command(&mut faults).await.tick];
    while ticks.len() < 8 {
        // Each is stale before the next tick.
        arm.move_to(above()).await;
        ticks.push(arm.command(&mut faults).await.tick);
    }
    assert!(faults.iter().any(|fault| fault.code() == DeviceFaultCode::Stale), "{faults:?}");
    assert!(ticks.windows(2).all(|pair| pair[1] == pair[0] + 1), "{ticks:?}");
    daemon.finish().await;
}

/// A device whose samples were refused faster than it read heard of nothing else.
#[tokio::test(flavor = "multi_thread")]
async fn refused_samples_take_no_commands_place() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    arm.move_to(above()).await;
    let up = arm.up.clone();
    let flood = tokio::spawn(async move {
        let old = v1::DeviceUp { message: Some(device_up::Message::Sample(sample(1, above()))) };
        while up.send(old.clone()).await.is_ok() {}
    });
    let mut faults = Vec::new();
    let first = arm.command(&mut faults).await.tick;
    let commands = async {
        for _ in 0..100 {
            arm.command(&mut faults).await;
        }
        arm.command(&mut faults).await.tick
    };
    let last =
        tokio::time::timeout(std::time::Duration::from_secs(5), commands).await.expect("commands come all the same");
    flood.abort();
    assert!(last >= first + 101, "{first} to {last}");
    assert!(!faults.is_empty());
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_quarantined_body_is_told_and_reset_brings_it_back() {
    let daemon = Daemon::on(block_scene("block", 3)).await;
    let mut arm = daemon.attach(hello()).await;
    arm.welcome().await;
    arm.hold_until(above(), |command| command.sample_sequence > 20).await;
    arm.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    daemon.break_the_body().await;
    let (mut faults, until) = (Vec::new(), tokio::time::Instant::now() + common::PATIENCE);
    // Samples go on: it is the quarantine that takes the force away, not silence.
    loop {
        arm.move_to(pressing()).await;
        let force_n = force_of(&arm.command(&mut faults).await);
        if faults.iter().any(|fault| fault.code() == DeviceFaultCode::Quarantined) && force_n == DVec3::ZERO {
            break;
        }
        assert!(tokio::time::Instant::now() < until, "{force_n} N, {faults:?}");
    }
    assert!(daemon.status().await.quarantine.contains("non-finite"));
    let from = arm.sequence;
    arm.hold_until(pressing(), |command| {
        assert_eq!(force_of(command), DVec3::ZERO);
        command.sample_sequence > from + 60
    })
    .await;
    daemon.reset().await;
    assert_eq!(daemon.status().await.quarantine, "");
    let mut again = Arm { ..arm };
    // The tool has been put to the device, into the body at rest: it has to come out once.
    let from = again.sequence;
    let held = again.hold_until(pressing(), |command| command.sample_sequence > from + 50).await;
    assert_eq!(force_of(&held), DVec3::ZERO);
    again.hold_until(above(), |command| command.sample_sequence > from + 300).await;
    again.hold_until(pressing(), |command| force_of(command).z > 0.1).await;
    daemon.finish().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tool_is_free_again_however_abruptly_devices_go() {
    let daemon = Daemon::on(block_scene("block", 2)).await;
    for round in 0..200_u32 {
        let mut arm = daemon.attach(hello()).await;
        // Some go before the welcome, some after, some close one way first, some speak while they go.
        if round % 4 != 0 {
            let _ = arm.next().await;
        }
        let Arm { up, down, .. } = arm;
        match round % 3 {
            0 => drop((up, down)),
            1 => {
                drop(up);
                tokio::time::sleep(std::time::Duration::from_micros(u64::from(round) * 5)).await;
                drop(down);
            }
            _ => {
                let _ = up.try_send(v1::DeviceUp { message: Some(device_up::Message::Sample(sample(1, above()))) });
                drop(down);
            }
        }
    }
    let until = tokio::time::Instant::now() + common::PATIENCE;
    loop {
        let mut arm = daemon.attach(hello()).await;
        match arm.next().await {
            Ok(Some(Message::Welcome(_))) => break,
            Err(status) => assert_eq!(status.code(), Code::AlreadyExists),
            other => panic!("{other:?}"),
        }
        assert!(tokio::time::Instant::now() < until, "the tool is lost");
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    daemon.finish().await;
}
