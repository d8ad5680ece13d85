//! The daemon's status: computed outside the loop, from a copy of the state that the loop made in one go.
use crate::{
    grpc::convert,
    session::{ActiveSession, Daemon},
    sim::{
        command::{Copy, Done},
        timing::STAGES,
    },
    strained::Seen,
};
use palpate_physics::{AwakeFor, Energies, world::strained};
use palpate_proto::v1;
use palpate_realtime::{Clock, Histogram};
use palpate_scene::probes::MAX_COLUMNS;
use std::sync::atomic::Ordering;

/// Version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The answer to `Status`.
pub fn of(daemon: &Daemon, session: &ActiveSession, copy: &Copy, done: &Done) -> v1::StatusResponse {
    let stage = |(name, histogram): (&&str, &Histogram)| v1::StageTime {
        stage: (*name).to_owned(),
        cost_us: Some(percentiles(histogram)),
    };
    v1::StatusResponse {
        session: Some(session.info()),
        daemon_version: VERSION.to_owned(),
        tick: done.tick,
        time_s: done.time_s,
        paused: done.paused,
        realtime_notes: daemon.realtime_notes.clone(),
        overruns: daemon.timing.the_loop.overruns(),
        wakeup_jitter_us: Some(percentiles(&daemon.timing.the_loop.wakeup_lateness)),
        tick_cost_us: Some(percentiles(&daemon.timing.tick)),
        stages: STAGES.iter().zip(&daemon.timing.stages).map(stage).collect(),
        energies: Some(energies(session, copy)),
        viewers: daemon.hub.viewer_count(),
        frames_skipped: daemon.hub.frames_skipped(),
        devices: devices(session),
        probes: probes(session, copy),
        quarantine: convert::quarantine(copy.state.quarantine),
        skipped_ticks: daemon.timing.the_loop.skipped(),
        samples_rejected: daemon.samples_rejected.load(Ordering::Relaxed),
        repeated_ticks: daemon.timing.repeated_ticks(),
        substeps_now: copy.state.pace.substeps,
        asleep: copy.state.sleep.asleep,
        active_particles: copy.state.awake_particles() as u32,
        awake_for: copy.state.awake_for(&session.model, &copy.injected).map(awake_for),
        state_warnings: state_warnings(session, copy),
        refusals: refusals(daemon),
        autosave_age_s: daemon.autosave.as_ref().and_then(|autosave| autosave.age_s(Clock::Monotonic.now_ns())),
    }
}

fn awake_for(counts: AwakeFor) -> v1::AwakeFor {
    let AwakeFor { tools, loads, injected, nothing } = counts;
    let [tools, loads, injected_forces, nothing] = [tools, loads, injected, nothing].map(|count| count as u32);
    v1::AwakeFor { tools, loads, injected_forces, nothing }
}

fn refusals(daemon: &Daemon) -> Vec<v1::RefusalCount> {
    let count = |(reason, count): (&str, u64)| v1::RefusalCount { reason: reason.to_owned(), count };
    daemon.refusals.all().into_iter().map(count).collect()
}

/// What is wrong with the body as it is.
fn state_warnings(session: &ActiveSession, copy: &Copy) -> Vec<String> {
    let seen = Seen::of(strained(&session.model, &copy.state));
    seen.inverted_now(&session.model).into_iter().chain(seen.weakened(&session.model, false)).collect()
}

fn percentiles(histogram: &Histogram) -> v1::Percentiles {
    let p = histogram.percentiles();
    let us = |ns: u64| ns as f64 * 1e-3;
    v1::Percentiles { p50: us(p.p50_ns), p99: us(p.p99_ns), p999: us(p.p999_ns), max: us(p.max_ns), count: p.count }
}

fn energies(session: &ActiveSession, copy: &Copy) -> v1::Energies {
    let e = Energies::of(&session.model, &copy.state);
    v1::Energies {
        kinetic_j: e.kinetic_j,
        elastic_j: e.elastic_j,
        gravitational_j: e.gravitational_j,
        external_work_j: e.external_work_j,
        dissipated_j: e.dissipated_j,
    }
}

fn devices(session: &ActiveSession) -> Vec<v1::AttachedDevice> {
    let now_ns = Clock::Monotonic.now_ns();
    let attached = session.tools.iter().filter_map(|tool| tool.device().map(|device| (tool, device)));
    attached
        .map(|(tool, device)| {
            let newest_ns = device.newest_ns.load(Ordering::Relaxed);
            let age_s = if newest_ns == 0 { 0.0 } else { now_ns.saturating_sub(newest_ns) as f64 * 1e-9 };
            v1::AttachedDevice {
                device_name: device.name.clone(),
                tool_name: tool.name.clone(),
                samples_accepted: device.accepted.load(Ordering::Relaxed),
                samples_rejected: device.rejected.load(Ordering::Relaxed),
                newest_sample_age_s: age_s,
                force_n: device.force_n(),
                safety_state: device.safety_state.load(Ordering::Relaxed),
            }
        })
        .collect()
}

fn probes(session: &ActiveSession, copy: &Copy) -> Vec<v1::NamedVector> {
    let read = |probe: &palpate_scene::Probe| {
        let mut values = vec![0.0; MAX_COLUMNS];
        probe.evaluate_with(&session.model, &copy.state, &copy.reactions_n, &mut values);
        values.truncate(probe.columns().len());
        let components = probe.columns().iter().map(|&column| column.to_owned()).collect();
        v1::NamedVector { name: probe.name().to_owned(), unit: probe.unit().to_owned(), values, components }
    };
    session.probes.iter().map(read).collect()
}
