//! `status`: what the daemon runs, how well it keeps time, and who is attached.
use crate::{ViewError, cli, connect::Server};
use palpate_proto::v1::{
    AwakeFor, Percentiles, SafetyState, StatusRequest, StatusResponse, session_client::SessionClient,
};
use serde_json::json;
use std::{collections::BTreeMap, fmt::Write as _};

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
    if !status.quarantine.is_empty() {
        // Writing into a String cannot fail.
        let _ = write!(text, "QUARANTINED: {}\n\n", status.quarantine);
    }
    for warning in &status.state_warnings {
        let _ = write!(text, "WARNING: {warning}\n\n");
    }
    text.push_str(&table(&facts(status)));
    text.push_str("\n\n");
    text.push_str(&table(&timings(status)));
    text
}

/// Rows of a name and what there is to say of it.
fn facts(status: &StatusResponse) -> Vec<Vec<String>> {
    let session = status.session.clone().unwrap_or_default();
    let mut rows = Vec::new();
    let mut line = |name: &str, value: String| rows.push(vec![name.to_owned(), value]);
    line("palpated", status.daemon_version.clone());
    line("scene", format!("{} (session {})", session.scene_name, session.session_id));
    line(
        "body",
        format!(
            "{}{} nodes, {} tets, {} surface triangles, {:.4} kg",
            if session.particle_count > 0 { "coarse level of " } else { "" },
            session.node_count,
            session.tet_count,
            session.surface_triangle_count,
            session.mass_kg
        ),
    );
    if session.particle_count > 0 {
        let (awake, most) = (status.active_particles, session.most_active_particles);
        let what_for = status.awake_for.map_or_else(String::new, |counts| awake_for(&counts));
        line("particles", format!("{}, {awake} of at most {most} awake{what_for}", session.particle_count));
    }
    line(
        "time",
        format!(
            "{:.3} s; {} ticks of {} ms, {} substeps each{}{}",
            status.time_s,
            status.tick,
            1e3 * session.tick_period_s,
            session.substeps_per_tick,
            if status.paused { ", paused" } else { "" },
            if status.asleep { ", at rest and asleep" } else { "" }
        ),
    );
    line("overruns", format!("{} ({} ticks skipped)", status.overruns, status.skipped_ticks));
    if status.repeated_ticks > 0 {
        line(
            "unstable",
            format!("{} ticks repeated in more substeps; {} substeps now", status.repeated_ticks, status.substeps_now),
        );
    }
    for note in &status.realtime_notes {
        line("real time", note.clone());
    }
    if let Some(e) = &status.energies {
        let energies = [e.kinetic_j, e.elastic_j, e.gravitational_j, e.external_work_j, e.dissipated_j];
        let names = ["kinetic", "elastic", "gravity", "work", "dissipated"].map(str::to_owned);
        line("energy", measured(&names, &energies, "J"));
    }
    for device in &status.devices {
        line(
            "device",
            format!(
                "{} drives {}: {}{:.3} N, {} samples ({} rejected), newest {:.1} ms old",
                device.device_name,
                device.tool_name,
                safety_words(device.safety_state()),
                device.force_n,
                device.samples_accepted,
                device.samples_rejected,
                1e3 * device.newest_sample_age_s
            ),
        );
    }
    for probe in &status.probes {
        line("probe", format!("{}: {}", probe.name, measured(&probe.components, &probe.values, &probe.unit)));
    }
    line("viewers", format!("{} ({} frames skipped)", status.viewers, status.frames_skipped));
    if !status.refusals.is_empty() {
        let counts: Vec<_> = status.refusals.iter().map(|of| format!("{} {}", of.count, of.reason)).collect();
        line("refused", format!("{} (connections and requests; docs/protocol.md says why)", counts.join(", ")));
    }
    rows
}

/// `: 98 for tools, 2 for nothing any more`; nothing where none is awake.
fn awake_for(counts: &AwakeFor) -> String {
    let all = [
        (counts.tools, "for tools"),
        (counts.loads, "for loads"),
        (counts.injected_forces, "for injected forces"),
        (counts.nothing, "for nothing any more"),
    ];
    let some = all.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}"));
    let told = some.collect::<Vec<_>>().join(", ");
    if told.is_empty() { told } else { format!(": {told}") }
}

/// Values with their names where they have one, and their unit; the unit of a plain number is not written.
fn measured(names: &[String], values: &[f64], unit: &str) -> String {
    let name = |i: usize| names.get(i).filter(|name| *name != "value").map_or(String::new(), |name| format!("{name} "));
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let named: Vec<String> =
        values.iter().enumerate().map(|(i, v)| format!("{}{v:.3e}", name(i).replace('_', " "))).collect();
    named.join(", ") + &unit
}

/// How long what takes.
fn timings(status: &StatusResponse) -> Vec<Vec<String>> {
    let heading = ["us", "p50", "p99", "p99.9", "max", "ticks"].map(str::to_owned).to_vec();
    let row = |name: String, p: Option<&Percentiles>| {
        let measured = p.filter(|p| p.count > 0);
        let numbers = measured.map(|p| [p.p50, p.p99, p.p999, p.max].map(|us| format!("{us:.1}")));
        let numbers = numbers.unwrap_or_else(|| ["-"; 4].map(str::to_owned));
        let count = p.map_or(0, |p| p.count).to_string();
        std::iter::once(name).chain(numbers).chain([count]).collect()
    };
    let mut rows = vec![heading, row("tick".to_owned(), status.tick_cost_us.as_ref())];
    let stages = status.stages.iter();
    rows.extend(stages.map(|stage| row(format!("  {}", stage.stage.replace('_', " ")), stage.cost_us.as_ref())));
    rows.push(row("wake-up late by".to_owned(), status.wakeup_jitter_us.as_ref()));
    rows
}

/// Rows as columns, each as wide as the longest of its cells: the first to the left, and the others to the right where there are more
/// than two.
fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width_of = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|column| width_of(column).unwrap_or(0)).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| match (column, columns) {
            (0, _) | (_, 2) => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
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
        "particles": session.particle_count,
        "active_particles": status.active_particles,
        "active_for": status.awake_for.map(|counts| json!({
            "tools": counts.tools, "loads": counts.loads, "injected_forces": counts.injected_forces, "nothing": counts.nothing,
        })),
        "substeps_per_tick": session.substeps_per_tick,
        "tick_period_s": session.tick_period_s,
        "tick": status.tick,
        "time_s": status.time_s,
        "paused": status.paused,
        "overruns": status.overruns,
        "skipped_ticks": status.skipped_ticks,
        "repeated_ticks": status.repeated_ticks,
        "substeps_now": status.substeps_now,
        "asleep": status.asleep,
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
            "safety_state": d.safety_state().as_str_name(),
        })).collect::<Vec<_>>(),
        "probes": status.probes.iter().map(|p| json!({"name": p.name, "unit": p.unit, "components": p.components, "values": p.values})).collect::<Vec<_>>(),
        "viewers": status.viewers,
        "frames_skipped": status.frames_skipped,
        "refusals": status.refusals.iter().map(|of| (of.reason.clone(), of.count)).collect::<BTreeMap<_, _>>(),
        "samples_rejected": status.samples_rejected,
        "quarantine": status.quarantine,
        "state_warnings": status.state_warnings,
    })
}

/// What an arm says of its force, before its numbers; nothing of one that operates, or says nothing.
fn safety_words(state: SafetyState) -> &'static str {
    match state {
        SafetyState::Unspecified | SafetyState::Operating => "",
        SafetyState::Standby => "no force yet, ",
        SafetyState::ProtectiveStop => "PROTECTIVE STOP, ",
        SafetyState::FaultLatched => "FAULT LATCHED, no force until somebody at the arm recovers it, ",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_proto::v1::{NamedVector, SessionInfo, StageTime};

    fn status() -> StatusResponse {
        let cost = |p50, max| Some(Percentiles { p50, p99: p50, p999: p50, max, count: 12_345 });
        let stage = |name: &str, p50| StageTime { stage: name.to_owned(), cost_us: cost(p50, 1234.5) };
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        StatusResponse {
            repeated_ticks: 2,
            substeps_now: 5,
            tick_cost_us: cost(20.0, 98_765.4),
            stages: vec![stage("input", 0.1), stage("contact_and_dynamics", 19.0)],
            probes: vec![
                NamedVector {
                    name: "ledger".into(),
                    unit: "J".into(),
                    values: vec![1.0, 2.0, 3.0, 4.0, 5.0],
                    components: names(&["kinetic", "elastic", "gravitational", "external_work", "dissipated"]),
                },
                NamedVector { name: "J".into(), unit: "1".into(), values: vec![0.5], components: names(&["value"]) },
            ],
            ..Default::default()
        }
    }

    /// The name of one stage was longer than its column, and its numbers stood beside those of the others.
    #[test]
    fn numbers_stand_under_their_headings() {
        let text = to_text(&status());
        let times: Vec<&str> = text.lines().skip_while(|line| !line.starts_with("us ")).collect();
        assert_eq!(times.len(), 5, "{text}");
        let ends = |line: &str, cell: &str| line.find(cell).map_or_else(|| panic!("{text}"), |at| at + cell.len());
        assert_eq!(ends(times[0], "max"), ends(times[1], "98765.4"), "{text}");
        assert_eq!(ends(times[0], "max"), ends(times[3], "1234.5"), "{text}");
        assert_eq!(ends(times[0], "ticks"), ends(times[3], "12345"), "{text}");
        assert!(times[3].starts_with("  contact and dynamics  ") && times[4].ends_with(" 0"), "{text}");
    }

    #[test]
    fn values_of_a_probe_have_names_and_unit() {
        let text = to_text(&status());
        let ledger = "ledger: kinetic 1.000e0, elastic 2.000e0, gravitational 3.000e0, external work 4.000e0, dissipated 5.000e0 J";
        assert!(text.contains(ledger), "{text}");
        assert!(text.lines().any(|line| line.ends_with("J: 5.000e-1")), "{text}");
    }

    #[test]
    fn particles_are_told_with_what_they_are_awake_for() {
        let session = Some(SessionInfo { particle_count: 500, most_active_particles: 200, ..Default::default() });
        let of = |awake_for| StatusResponse { session: session.clone(), active_particles: 98, awake_for, ..status() };
        let counts = AwakeFor { tools: 60, loads: 0, injected_forces: 30, nothing: 8 };
        let text = to_text(&of(Some(counts)));
        let told = "500, 98 of at most 200 awake: 60 for tools, 30 for injected forces, 8 for nothing any more";
        assert!(text.contains(told), "{text}");
        assert_eq!(to_json(&of(Some(counts)))["active_for"]["injected_forces"], 30);
        // Daemons before this, and bodies of other kinds, do not tell.
        assert!(to_text(&of(None)).contains("98 of at most 200 awake\n"));
        assert!(to_json(&of(None))["active_for"].is_null());
    }

    #[test]
    fn what_is_wrong_with_the_body_comes_first() {
        let wrong = StatusResponse { state_warnings: vec!["elements are inside out".into()], ..status() };
        assert!(to_text(&wrong).starts_with("WARNING: elements are inside out\n\n"));
        assert_eq!(to_json(&wrong)["state_warnings"][0], "elements are inside out");
    }

    #[test]
    fn repeated_ticks_are_said_when_there_are_any() {
        let shown =
            |status: &StatusResponse| to_text(status).contains("2 ticks repeated in more substeps; 5 substeps now");
        assert!(shown(&status()) && !shown(&StatusResponse { repeated_ticks: 0, ..status() }));
    }
}
