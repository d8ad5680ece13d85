//! What `palpated serve` prints: at its start where to connect, at its end how it went.
use super::{Running, ServeConfig, Summary};
use crate::{bodies::served, sim::timing::STAGES};
use palpate_realtime::Histogram;
use palpate_scene::wording::counted;
use std::{
    fmt::Write as _,
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
};

/// Lines for the start.
pub fn startup(running: &Running, config: &ServeConfig, description: &str) -> String {
    let session = running.daemon.session();
    let info = session.info();
    let mut text = String::new();
    let dash = if description.is_empty() { "" } else { " — " };
    let _ = writeln!(text, "scene      {}{dash}{description}", info.scene_name);
    let _ = writeln!(
        text,
        "body       {}{} nodes, {} tets, {} surface triangles, {:.1} g; highest natural frequency {:.0} Hz",
        // Nodes in the middle of tets' edges are counted, too.
        if info.particle_count > 0 { "coarse level of " } else { "" },
        info.node_count,
        info.tet_count,
        info.surface_triangle_count,
        info.mass_kg * 1e3,
        info.max_natural_frequency_rad_per_s / std::f64::consts::TAU,
    );
    if info.particle_count > 0 {
        let _ = writeln!(
            text,
            "particles  {}, {:.2} mm apart, at most {} awake",
            info.particle_count,
            session.model.body().particle_spacing_m() * 1e3,
            info.most_active_particles,
        );
    }
    let _ = writeln!(
        text,
        "loop       {:.2} ms per tick, {}; tools: {}",
        info.tick_period_s * 1e3,
        counted(info.substeps_per_tick as usize, "substep"),
        if info.tool_names.is_empty() { "none".to_owned() } else { info.tool_names.join(", ") },
    );
    for note in &running.notes {
        let _ = writeln!(text, "real time  {note}");
    }
    for remark in served(&session.model).remarks() {
        let _ = writeln!(text, "note       {remark}");
    }
    for warning in &session.warnings {
        let _ = writeln!(text, "warning    {warning}");
    }
    if let Some(address) = running.address {
        reached_by_tcp(&mut text, address, config);
    }
    if let Some(socket) = &config.unix {
        let group = socket.group.as_ref().map(|group| format!(", group {group}")).unwrap_or_default();
        let _ = writeln!(text, "unix       unix://{} (permissions {:04o}{group})", socket.path.display(), socket.mode);
    }
    let _ = write!(text, "stop       Ctrl-C (forces ramp to zero first)");
    text
}

fn reached_by_tcp(text: &mut String, address: SocketAddr, config: &ServeConfig) {
    let scheme = if config.tls.is_some() { "https" } else { "http" };
    let url = format!("{scheme}://{}", here(address));
    let _ = writeln!(text, "page       {url}/");
    if address.ip().is_unspecified() {
        let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
        let port = address.port();
        let _ =
            writeln!(text, "elsewhere  {scheme}://{name}:{port}/ or an address of this machine, where others know it");
    }
    let shown = match &config.keys {
        Some(keys) => {
            format!(" --tls-ca {} --tls-cert NAME.pem --tls-key NAME.key", keys.authority().display())
        }
        None => String::new(),
    };
    let _ = writeln!(text, "arms       palpate-bridge --server {url}{shown}");
    let _ = writeln!(text, "viewers    palpate-view --server {url}{shown} status");
    let callers = match (&config.keys, config.trusts_network) {
        (Some(_), _) => "are asked who they are: `palpated pki issue` and `palpated pki token` tell them apart",
        (None, true) => "are trusted, whoever they are (--trust-the-network)",
        (None, false) => return,
    };
    let _ = writeln!(text, "callers    {callers}");
}

/// The address as one of this machine reaches it: no address at all means every one.
fn here(address: SocketAddr) -> SocketAddr {
    match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => (Ipv4Addr::LOCALHOST, address.port()).into(),
        IpAddr::V6(ip) if ip.is_unspecified() => (Ipv6Addr::LOCALHOST, address.port()).into(),
        _ => address,
    }
}

/// The table for the end.
pub fn farewell(summary: &Summary) -> String {
    let timing = &summary.timing;
    let mut text = String::from("us                           p50      p99    p99.9      max\n");
    let mut row = |name: &str, histogram: &Histogram| {
        let p = histogram.percentiles();
        let us = |ns: u64| ns as f64 * 1e-3;
        let _ = writeln!(
            text,
            "{name:<24} {:>7.1}  {:>7.1}  {:>7.1}  {:>7.1}",
            us(p.p50_ns),
            us(p.p99_ns),
            us(p.p999_ns),
            us(p.max_ns)
        );
    };
    row("wake-up lateness", &timing.the_loop.wakeup_lateness);
    row("tick", &timing.tick);
    for (name, histogram) in STAGES.iter().zip(&timing.stages) {
        row(&format!("  {name}"), histogram);
    }
    if !summary.refusals.is_empty() {
        let counts: Vec<_> = summary.refusals.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
        let _ = writeln!(text, "refused connections and requests: {}", counts.join(", "));
    }
    let _ = write!(
        text,
        "{} ticks, {} overruns, {} ticks skipped, {} ticks repeated, {} inputs refused, {} samples rejected, {} frames skipped{}",
        timing.tick.count(),
        timing.the_loop.overruns(),
        timing.the_loop.skipped(),
        timing.repeated_ticks(),
        timing.inputs_rejected(),
        summary.samples_rejected,
        summary.frames_skipped,
        if summary.cut { "; some connections did not end in time and were cut" } else { "" },
    );
    text
}
