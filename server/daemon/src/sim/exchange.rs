//! What passes between the loop and the rest of the daemon: fixed slots (the newest wins) and flags. Nothing here blocks or
//! allocates on the loop's side once built.
use super::bell::{Ear, bell};
use crate::bodies::{Shape, served};
use glam::{DQuat, DVec3};
use palpate_physics::{Model, Quarantine, contact::LocalContactModel};
use palpate_realtime::Doorbell;
use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};
use triple_buffer::{Input, Output, triple_buffer};

/// One measurement of an arm, checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceInput {
    /// Attachment it belongs to ([`ToolShared::attachment`]).
    pub attachment: u64,
    /// Strictly increasing per attachment.
    pub sequence: u64,
    /// The device's clock (ns), to be echoed.
    pub device_time_ns: u64,
    /// When the daemon received it (ns, [`palpate_realtime::Clock::Monotonic`]).
    pub arrived_ns: u64,
    /// Tool centre (m, world).
    pub position_m: DVec3,
    /// Its velocity (m/s, world).
    pub velocity_m_per_s: DVec3,
    /// Its orientation, tool frame to world.
    pub orientation: DQuat,
    /// Its angular velocity (rad/s, world).
    pub angular_velocity_rad_per_s: DVec3,
    /// Bit i is button i.
    pub buttons: u32,
}

/// What the loop wants an arm to do.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ToolOutput {
    /// Attachment it is meant for.
    pub attachment: u64,
    /// Tick that computed it.
    pub tick: u64,
    /// Limited force on the arm (N, world).
    pub force_n: DVec3,
    /// Limited torque on the arm (N m, world).
    pub torque_nm: DVec3,
    /// Sequence of the newest sample used.
    pub sample_sequence: u64,
    /// Its device time (ns).
    pub echo_device_time_ns: u64,
    /// For how long (ns) it had waited for this tick, the first that used it.
    pub sample_waited_ns: Option<u64>,
    /// Contact around the device, its force and stiffness scaled as the wrench is; `None` out of contact or when the force is zero
    /// by order.
    pub local_model: Option<LocalContactModel>,
    /// Largest force (N) that may be rendered from the local model: the peak times the ramp.
    pub model_max_force_n: f64,
    /// The same of torque (N m); without one the local model has none.
    pub model_max_torque_nm: f64,
    /// Centre of the proxy (m, world).
    pub proxy_position_m: DVec3,
    /// Its orientation, tool frame to world.
    pub proxy_orientation: DQuat,
    /// No sample for too long: the force ramps to zero.
    pub stale: bool,
    /// Time stands, is stepped, or is about to jump: the force ramps to zero.
    pub held: bool,
    /// The button that the force depends on is not held: the force ramps to zero.
    pub let_go: bool,
    /// Ticks of this attachment in which the force was limited.
    pub limited: LimitedTicks,
    /// Tick at which the body's state was quarantined.
    pub quarantined: Option<u64>,
}

/// In how many ticks of an attachment the force was limited, and by what; one tick may be limited by both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LimitedTicks {
    /// By anything.
    pub total: u64,
    /// By the peak.
    pub by_peak: u64,
    /// By the rate.
    pub by_rate: u64,
}

/// What both sides know of a tool.
#[derive(Debug, Default)]
pub struct ToolShared {
    attachment: AtomicU64,
    max_force_n_bits: AtomicU64,
    max_torque_nm_bits: AtomicU64,
    /// 0: the daemon's own.
    stale_after_s_bits: AtomicU64,
    is_released: AtomicBool,
}

impl ToolShared {
    /// Number of the present attachment; 0: no device.
    pub fn attachment(&self) -> u64 {
        self.attachment.load(Ordering::Acquire)
    }

    /// A device attached: the loop turns to it at its next tick, and never asks it for more than `max_force_n` (N).
    pub fn attach(&self, attachment: u64, max_force_n: f64) {
        self.max_force_n_bits.store(max_force_n.to_bits(), Ordering::Relaxed);
        self.is_released.store(false, Ordering::Relaxed);
        self.attachment.store(attachment, Ordering::Release);
    }

    /// Largest torque (N m) that the device which attaches next takes.
    pub fn set_max_torque_nm(&self, max_torque_nm: f64) {
        self.max_torque_nm_bits.store(max_torque_nm.to_bits(), Ordering::Relaxed);
    }

    /// Largest torque the attached device takes (N m); 0: none.
    pub fn max_torque_nm(&self) -> f64 {
        f64::from_bits(self.max_torque_nm_bits.load(Ordering::Relaxed))
    }

    /// Age (s) beyond which a pose of the device that attaches next is stale.
    pub fn set_stale_after_s(&self, stale_after_s: f64) {
        self.stale_after_s_bits.store(stale_after_s.to_bits(), Ordering::Relaxed);
    }

    /// Age (s) beyond which a pose of the attached device is stale; 0: as the daemon has it.
    pub fn stale_after_s(&self) -> f64 {
        f64::from_bits(self.stale_after_s_bits.load(Ordering::Relaxed))
    }

    /// The attached device is to lose its tool: the loop ramps its force to zero.
    pub fn release(&self) {
        self.is_released.store(true, Ordering::Relaxed);
    }

    /// Whether the attached device is to lose its tool.
    pub fn is_released(&self) -> bool {
        self.is_released.load(Ordering::Relaxed)
    }

    /// The device went.
    pub fn detach(&self) {
        self.attachment.store(0, Ordering::Release);
    }

    /// Largest force the attached device takes (N).
    pub fn max_force_n(&self) -> f64 {
        f64::from_bits(self.max_force_n_bits.load(Ordering::Relaxed))
    }
}

/// The loop's end of a tool.
#[derive(Debug)]
pub struct ToolPort {
    /// Newest sample.
    pub samples: Output<Option<DeviceInput>>,
    /// Newest output.
    pub outputs: Input<ToolOutput>,
    /// Rung after an output, while a device is attached.
    pub bell: Doorbell,
    /// Attachment.
    pub shared: Arc<ToolShared>,
}

/// The end of a tool that a device's stream holds while it is attached.
#[derive(Debug)]
pub struct ToolEnd {
    /// Newest sample.
    pub samples: Input<Option<DeviceInput>>,
    /// Newest output.
    pub outputs: Output<ToolOutput>,
    /// Hears of outputs.
    pub ear: Ear,
    /// Attachment.
    pub shared: Arc<ToolShared>,
}

/// Both ends of a tool.
///
/// # Errors
/// See [`bell`].
pub fn tool() -> io::Result<(ToolPort, ToolEnd)> {
    let (bell, ear) = bell()?;
    let (sample_in, sample_out) = triple_buffer(&None);
    let (output_in, output_out) = triple_buffer(&ToolOutput::default());
    let shared = Arc::new(ToolShared::default());
    let port = ToolPort { samples: sample_out, outputs: output_in, bell, shared: Arc::clone(&shared) };
    Ok((port, ToolEnd { samples: sample_in, outputs: output_out, ear, shared }))
}

/// A tool as viewers see it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ToolView {
    /// Device (m, world).
    pub device_position_m: DVec3,
    /// Proxy (m, world).
    pub proxy_position_m: DVec3,
    /// Of the body on the tool (N, world).
    pub contact_force_n: DVec3,
    /// Sent to the arm (N, world).
    pub device_force_n: DVec3,
    /// Contact points that carry force.
    pub contacts: u32,
    /// Of the device, tool frame to world.
    pub device_orientation: DQuat,
    /// Of the proxy, tool frame to world.
    pub proxy_orientation: DQuat,
    /// Of the body on the tool (N m, world).
    pub contact_torque_nm: DVec3,
    /// Sent to the arm (N m, world).
    pub device_torque_nm: DVec3,
}

/// The surface at a tick.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceSnapshot {
    /// Tick.
    pub tick: u64,
    /// Simulated time (s).
    pub time_s: f64,
    /// Wall-clock cost of the last tick (µs).
    pub tick_cost_us: f64,
    /// Why the state stands, if it is quarantined.
    pub quarantine: Option<Quarantine>,
    /// Whether anybody wants vertices.
    pub wants_vertices: bool,
    /// Where the body is.
    pub shape: Shape,
    /// Tools.
    pub tools: Vec<ToolView>,
}

/// The loop's end of the surface.
#[derive(Debug)]
pub struct SurfacePort {
    /// Newest surface.
    pub slot: Input<SurfaceSnapshot>,
    /// Rung after it was filled.
    pub bell: Doorbell,
}

/// The hub's end of the surface.
#[derive(Debug)]
pub struct SurfaceEnd {
    /// Newest surface.
    pub slot: Output<SurfaceSnapshot>,
    /// Hears of it.
    pub ear: Ear,
}

/// Both ends of a model's surface.
///
/// # Errors
/// See [`bell`].
pub fn surface(model: &Model) -> io::Result<(SurfacePort, SurfaceEnd)> {
    let (bell, ear) = bell()?;
    let (input, output) = triple_buffer(&SurfaceSnapshot {
        tick: 0,
        time_s: 0.0,
        tick_cost_us: 0.0,
        quarantine: None,
        wants_vertices: false,
        shape: served(model).largest_shape(model),
        tools: vec![ToolView::default(); model.tools().len()],
    });
    Ok((SurfacePort { slot: input, bell }, SurfaceEnd { slot: output, ear }))
}
