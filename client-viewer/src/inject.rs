//! `inject`: forces on surface vertices at given ticks, from a script.
use crate::{ViewError, cli, connect::Server, surface::Surface, surface::Watcher};
use clap::Args;
use glam::Vec3;
use palpate_proto::v1::{self, InjectForcesRequest, InjectedForce, LevelOfDetail, session_client::SessionClient};
use serde::Deserialize;
use std::path::{Path, PathBuf};

const SCRIPT: &str = "\
A script has one [[force]] or more:

  [[force]]
  nearest_to_mm = [30, 0, -20]  # at the surface vertex nearest to this point of the rest shape
  force_n = [0, 0, -0.05]       # force on that vertex, world frame, at most 1000 N
  from_tick = 0                 # first tick it acts in; 0, or left out: as soon as possible
  tick_count = 1000             # ticks it acts for: one second at 1 kHz

The point may be given in metres (nearest_to_m), or the vertex by its number in the surface stream
(surface_vertex). All forces of a script are taken, or none.";

/// Arguments of `inject`.
#[derive(Debug, Args)]
#[command(after_help = SCRIPT)]
pub struct InjectArguments {
    /// The script (TOML)
    script: PathBuf,
}

/// A force script.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Script {
    force: Vec<Force>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(clippy::struct_field_names)] // the keys of the file
struct Force {
    surface_vertex: Option<u32>,
    nearest_to_m: Option<[f32; 3]>,
    nearest_to_mm: Option<[f32; 3]>,
    force_n: [f64; 3],
    #[serde(default)]
    from_tick: u64,
    tick_count: u32,
}

impl Force {
    /// The point (m) whose nearest vertex is meant, from either key.
    fn point_m(&self) -> Option<Vec3> {
        let in_mm = self.nearest_to_mm.map(|mm| Vec3::from_array(mm) * 1e-3);
        self.nearest_to_m.map(Vec3::from_array).or(in_mm)
    }
}

/// Runs `inject`.
///
/// # Errors
/// A wrong script, an unreachable daemon, or its refusal.
pub async fn run(server: &Server, arguments: &InjectArguments) -> Result<(), ViewError> {
    let no_text = |_| ViewError::Script { path: arguments.script.clone(), reason: "is no text (UTF-8)".into() };
    let text = String::from_utf8(cli::read(&arguments.script)?).map_err(no_text)?;
    let script = parse(&arguments.script, &text)?;
    let channel = server.connect().await?;
    let surface = if script.force.iter().any(|force| force.point_m().is_some()) {
        let mut watcher = Watcher::start(channel.clone(), 0.0, LevelOfDetail::Full).await?;
        let ended = || ViewError::Stream("ended before the first surface".into());
        Some(watcher.next().await?.cloned().ok_or_else(ended)?)
    } else {
        None
    };
    let forces = script
        .force
        .iter()
        .enumerate()
        .map(|(index, force)| resolve(&arguments.script, index, force, surface.as_ref()))
        .collect::<Result<Vec<_>, _>>()?;
    let found = found(&script, &forces, surface.as_ref());
    let count = forces.len();
    // A vertex found in one body must not be pushed in another that was loaded in between.
    let session_id = surface.map_or_else(String::new, |surface| surface.header.session_id);
    let request = InjectForcesRequest { session_id, forces };
    let answer = SessionClient::new(channel).inject_forces(request).await?.into_inner();
    let plural = if count == 1 { "" } else { "s" };
    cli::say(&format!(
        "{count} force{plural} accepted; the first acts at tick {}; {} pending",
        answer.first_tick, answer.pending
    ))?;
    found.iter().try_for_each(|line| cli::say(line))
}

/// Which vertices the points of a script stand for, and how far away: a point in another unit or outside the body shows here.
fn found(script: &Script, forces: &[InjectedForce], surface: Option<&Surface>) -> Vec<String> {
    let points = script.force.iter().zip(forces).enumerate();
    points
        .filter_map(|(index, (asked, force))| {
            let vertex = force.surface_vertex;
            let distance_mm = 1e3 * surface?.rest_m.get(vertex as usize)?.distance(asked.point_m()?);
            Some(format!("[[force]] number {}: surface vertex {vertex}, {distance_mm:.3} mm from the point", index + 1))
        })
        .collect()
}

fn parse(path: &Path, text: &str) -> Result<Script, ViewError> {
    let bad = |reason| ViewError::Script { path: path.into(), reason };
    let script: Script = toml::from_str(text).map_err(|error| bad(error.to_string()))?;
    if script.force.is_empty() { Err(bad("has no [[force]]".into())) } else { Ok(script) }
}

fn resolve(path: &Path, index: usize, force: &Force, surface: Option<&Surface>) -> Result<InjectedForce, ViewError> {
    let bad = |reason: String| ViewError::Script {
        path: path.into(),
        reason: format!("[[force]] number {}: {reason}", index + 1),
    };
    let surface_vertex = match (force.surface_vertex, force.nearest_to_m, force.nearest_to_mm) {
        (Some(vertex), None, None) => vertex,
        (None, Some(point), None) | (None, None, Some(point)) if !point.iter().all(|x| x.is_finite()) => {
            return Err(bad("the point must be finite".into()));
        }
        (None, Some(_), None) | (None, None, Some(_)) => {
            let vertex = force.point_m().and_then(|point_m| nearest(surface, point_m));
            vertex.ok_or_else(|| bad("there is no surface".into()))?
        }
        _ => return Err(bad("give exactly one of surface_vertex, nearest_to_mm and nearest_to_m".into())),
    };
    if force.tick_count == 0 {
        return Err(bad("tick_count = 0: must be at least 1".into()));
    }
    if !force.force_n.iter().all(|f| f.is_finite()) {
        return Err(bad("force_n must be finite".into()));
    }
    let [x, y, z] = force.force_n;
    Ok(InjectedForce {
        surface_vertex,
        force_n: Some(v1::Vec3 { x, y, z }),
        from_tick: force.from_tick,
        tick_count: force.tick_count,
    })
}

/// Surface vertex whose rest position is nearest to a point.
fn nearest(surface: Option<&Surface>, point_m: Vec3) -> Option<u32> {
    let rest = &surface?.rest_m;
    (0..rest.len())
        .min_by(|&a, &b| rest[a].distance_squared(point_m).total_cmp(&rest[b].distance_squared(point_m)))
        .map(|vertex| vertex as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<InjectedForce>, ViewError> {
        let path = Path::new("push.toml");
        let surface = Surface { rest_m: vec![Vec3::ZERO, Vec3::X, Vec3::Y], ..Default::default() };
        let script = parse(path, text)?;
        script.force.iter().enumerate().map(|(i, force)| resolve(path, i, force, Some(&surface))).collect()
    }

    #[test]
    fn vertices_are_named_or_found() {
        let forces = read(
            "[[force]]\nsurface_vertex = 2\nforce_n = [0, 0, -1]\ntick_count = 5\n\
             [[force]]\nnearest_to_m = [0.9, 0.1, 0]\nforce_n = [1, 0, 0]\nfrom_tick = 9\ntick_count = 1\n\
             [[force]]\nnearest_to_mm = [0, 600, 0]\nforce_n = [1, 0, 0]\ntick_count = 1\n",
        )
        .unwrap();
        assert_eq!(forces[2].surface_vertex, 2, "600 mm are nearer to 1 m than to 0");
        assert_eq!((forces[0].surface_vertex, forces[0].tick_count), (2, 5));
        assert_eq!((forces[1].surface_vertex, forces[1].from_tick), (1, 9));
    }

    #[test]
    fn mistakes_are_named() {
        let message = |text: &str| read(text).unwrap_err().to_string();
        assert!(message("[[force]]\nforce_n = [0, 0, 1]\ntick_count = 1\n").contains("exactly one"));
        assert!(message("[[force]]\nsurface_vertex = 1\nforce_n = [0, 0, 1]\ntick_count = 0\n").contains("at least 1"));
        assert!(message("[[force]]\nsurface_vertex = 1\nforce = [0, 0, 1]\ntick_count = 1\n").contains("force"));
        assert!(message("force = []\n").contains("no [[force]]"));
        assert!(
            message("[[force]]\nnearest_to_m = [nan, 0, 0]\nforce_n = [0, 0, 1]\ntick_count = 1\n").contains("finite")
        );
        assert!(
            message(
                "[[force]]\nnearest_to_mm = [1, 0, 0]\nnearest_to_m = [1, 0, 0]\nforce_n = [0, 0, 1]\ntick_count = 1\n"
            )
            .contains("exactly one")
        );
        assert!(message("[[force]]\nsurface_vertex = 1\nforce_n = [0, nan, 1]\ntick_count = 1\n").contains("finite"));
    }
}
