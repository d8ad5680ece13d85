//! The torque of a tool that turns, over a real socket.
use crate::common::{Daemon, SIZE_M, above, block_scene, force_of, hello, pressing, sample};
use glam::DVec3;
use palpate_physics::contact::ToolShape;
use palpate_proto::v1;

/// A capsule that lies across the block's edge: its torque comes as far as arm and daemon allow, and an arm without motors for it gets none.
#[tokio::test(flavor = "multi_thread")]
async fn a_capsule_across_the_edge_is_turned_back() {
    let mut scene = block_scene("block", 4);
    let tool = &mut scene.model.tools[0];
    tool.shape = ToolShape::capsule(tool.coupling, tool.radius_m, 0.02, DVec3::X);
    let daemon = Daemon::on(scene).await;
    for max_torque_nm in [0.1, 0.0, 1e-3] {
        let mut arm = daemon.attach(v1::DeviceHello { max_torque_nm, ..hello() }).await;
        let welcome = arm.welcome().await;
        assert_eq!((welcome.tool_half_length_m, welcome.limits.unwrap().max_torque_nm), (0.02, max_torque_nm));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mut hold = async |position_m: DVec3, enough: &dyn Fn(&v1::DeviceCommand) -> bool| {
            for _ in 0..5000 {
                arm.sequence += 1;
                let mut lying = sample(arm.sequence, position_m);
                lying.pose.as_mut().unwrap().orientation = Some(v1::Quaternion { w: half, x: 0.0, y: half, z: 0.0 });
                arm.send(lying).await;
                let command = arm.command(&mut Vec::new()).await;
                if enough(&command) {
                    return command;
                }
            }
            panic!("never enough");
        };
        let beside = DVec3::X * 0.5 * SIZE_M.x;
        hold(above() + beside, &|command| command.sample_sequence > 20).await;
        let torque_nm = |command: &v1::DeviceCommand| {
            let torque = command.wrench.unwrap().torque_nm.unwrap();
            DVec3::new(torque.x, torque.y, torque.z)
        };
        let floor_nm = 2e-4_f64.min(0.9 * max_torque_nm);
        let enough = |command: &v1::DeviceCommand| force_of(command).z > 0.1 && torque_nm(command).y >= floor_nm;
        let pressed = hold(pressing() + beside, &enough).await;
        assert!(torque_nm(&pressed).length() <= max_torque_nm + 1e-15, "{pressed:?}");
        let turned = pressed.proxy_orientation.unwrap();
        assert!((turned.w - half).abs() < 0.1 && turned.w != half, "{turned:?}");
        // Beside the arm the same torque, and what it becomes as the arm turns on.
        let model = pressed.local_model.as_ref().unwrap().torque.as_ref();
        assert_eq!(model.is_some(), max_torque_nm > 0.0);
        if let Some(model) = model {
            let told = model.torque_nm.unwrap();
            assert!(DVec3::new(told.x, told.y, told.z).distance(torque_nm(&pressed)) < 1e-12, "{pressed:?}");
            assert!(
                model.stiffness_nm_per_rad.as_ref().unwrap().column_major[4] < 0.0
                    && model.max_torque_nm <= max_torque_nm
            );
            let at = model.orientation.unwrap();
            assert!((at.w - half).abs() < 1e-6 && (at.y - half).abs() < 1e-6, "{at:?}");
        }
        drop(arm);
        while !daemon.status().await.devices.is_empty() {
            tokio::time::sleep(std::time::Duration::from_millis(5)).await;
        }
    }
    daemon.finish().await;
}
