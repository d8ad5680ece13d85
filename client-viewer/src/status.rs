//! `status`: what the daemon runs, how well it keeps time, and who is attached.
use crate::{ViewError, cli, connect::Server};
use palpate_proto::v1::{Percentiles, StatusRequest, StatusResponse, session_client::SessionClient};
use serde_json::json;
use std::fmt::Write as _;

/// Runs `status`.
///
/// # Errors
/// An unreachable daemon or its refusal.
pub async fn run(server: &Server, as_json: bool) -> Result<(), ViewError> {
    let mut client = SessionClient::new(server.connect().await?);
    let status = client.status(StatusRequest::default()).await?.into_inner();
    cli::say(&if as_json { to_json(&status).to_string() } else { to_text(&status) })
}

/// The status for people.
pub fn to_text(status: &StatusResponse) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        // Writing into a String cannot fail.
        let _ = writeln!(text, "{name:<18} {value}");
    };
    let session = status.session.clone().unwrap_or_default();
    line("palpated", status.daemon_version.clone());
    line("scene", format!("{} (session {})", session.scene_name, session.session_id));
    line(
        "body",
        format!(
            "{} nodes, {} tets, {} surface triangles, {:.4} kg",
            session.node_count, session.tet_count, session.surface_triangle_count, session.mass_kg
        ),
    );
    line(
        "time",
        format!(
            "tick {} = {:.3} s, {:.3} ms in {} substeps{}",
            status.tick,
            status.time_s,
            1e3 * session.tick_period_s,
            session.substeps_per_tick,
            if status.paused { ", paused" } else { "" }
        ),
    );
    line("tick cost / us", percentiles(status.tick_cost_us.as_ref()));
    for stage in &status.stages {
        line(&format!("  {}", stage.stage), percentiles(stage.cost_us.as_ref()));
    }
    line("wake-up / us", percentiles(status.wakeup_jitter_us.as_ref()));
    line("overruns", format!("{} ({} ticks skipped)", status.overruns, status.skipped_ticks));
    for note in &status.realtime_notes {
        line("real time", note.clone());
    }
    if let Some(e) = &status.energies {
        line(
            "energy / J",
            format!(
                "kinetic {:.3e}, elastic {:.3e}, gravity {:.3e}; work {:.3e}, dissipated {:.3e}",
                e.kinetic_j, e.elastic_j, e.gravitational_j, e.external_work_j, e.dissipated_j
            ),
        );
    }
    for device in &status.devices {
        line(
            "device",
            format!(
                "{} drives {}: {:.3} N, {} samples ({} rejected), newest {:.1} ms old",
                device.device_name,
                device.tool_name,
                device.force_n,
                device.samples_accepted,
                device.samples_rejected,
                1e3 * device.newest_sample_age_s
            ),
        );
    }
    for probe in &status.probes {
        let values: Vec<String> = probe.values.iter().map(|v| format!("{v:.6e}")).collect();
        line("probe", format!("{} = {} {}", probe.name, values.join(" "), probe.unit));
    }
    line("viewers", format!("{} ({} frames skipped)", status.viewers, status.frames_skipped));
    if !status.quarantine.is_empty() {
        line("QUARANTINED", status.quarantine.clone());
    }
    text.trim_end().to_owned()
}

fn percentiles(p: Option<&Percentiles>) -> String {
    p.filter(|p| p.count > 0).map_or_else(
        || "not measured yet".into(),
        |p| format!("p50 {:.1}  p99 {:.1}  p99.9 {:.1}  max {:.1}  ({} ticks)", p.p50, p.p99, p.p999, p.max, p.count),
    )
}

fn to_json(status: &StatusResponse) -> serde_json::Value {
    let session = status.session.clone().unwrap_or_default();
    let spread = |p: Option<&Percentiles>| {
        p.map(|p| json!({"p50": p.p50, "p99": p.p99, "p999": p.p999, "max": p.max, "count": p.count}))
    };
    json!({
        "daemon_version": status.daemon_version,
        "session_id": session.session_id,
        "scene_name": session.scene_name,
        "nodes": session.node_count,
        "tets": session.tet_count,
        "substeps_per_tick": session.substeps_per_tick,
        "tick_period_s": session.tick_period_s,
        "tick": status.tick,
        "time_s": status.time_s,
        "paused": status.paused,
        "overruns": status.overruns,
        "skipped_ticks": status.skipped_ticks,
        "wakeup_jitter_us": spread(status.wakeup_jitter_us.as_ref()),
        "tick_cost_us": spread(status.tick_cost_us.as_ref()),
        "stages_us": status.stages.iter().map(|s| json!({"stage": s.stage, "cost_us": spread(s.cost_us.as_ref())})).collect::<Vec<_>>(),
        "realtime_notes": status.realtime_notes,
        "energies_j": status.energies.map(|e| json!({
            "kinetic": e.kinetic_j, "elastic": e.elastic_j, "gravitational": e.gravitational_j,
            "external_work": e.external_work_j, "dissipated": e.dissipated_j,
        })),
        "devices": status.devices.iter().map(|d| json!({
            "device_name": d.device_name, "tool_name": d.tool_name, "samples_accepted": d.samples_accepted,
            "samples_rejected": d.samples_rejected, "newest_sample_age_s": d.newest_sample_age_s, "force_n": d.force_n,
        })).collect::<Vec<_>>(),
        "probes": status.probes.iter().map(|p| json!({"name": p.name, "unit": p.unit, "values": p.values})).collect::<Vec<_>>(),
        "viewers": status.viewers,
        "frames_skipped": status.frames_skipped,
        "samples_rejected": status.samples_rejected,
        "quarantine": status.quarantine,
    })
}
