//! What `palpated check` says of tools: their size, what moves them, and how well they can follow it.
use palpate_physics::{
    Model,
    contact::{Following, ToolSpec},
};
use palpate_scene::{Driver, Scene, wording::short};

/// Two or three lines per tool.
pub(super) fn lines(scene: &Scene, model: &Model) -> Vec<String> {
    let dt_s = model.settings().tick_period_s / f64::from(model.substeps());
    let of_tool = |(index, (tool, driver)): (usize, (&ToolSpec, &Driver))| {
        let mut lines = vec![format!(
            "tool       {:<16} radius {:.3} mm, driven by {}",
            tool.name,
            tool.radius_m * 1e3,
            match driver {
                Driver::Device => "a device",
                Driver::Trajectory(_) => "a trajectory",
                Driver::Script(_) => "a script",
            }
        )];
        let told = following(&model.contact().following(index, dt_s));
        lines.extend(told.into_iter().map(|line| format!("           {line}")));
        lines
    };
    scene.model.tools.iter().zip(&scene.drivers).enumerate().flat_map(of_tool).collect()
}

/// How a tool follows its device, a line or two.
fn following(following: &Following) -> Vec<String> {
    match following {
        Following::Rigid { slips_at_n, moves_m_per_s } => vec![format!(
            "rigid: it is where its driver says, up to {} m/s; it slips before it would go through a surface, at {} N or less",
            round(*moves_m_per_s),
            round(*slips_at_n)
        )],
        Following::Coupled(told) => vec![
            format!(
                "on a spring that gives at most {} N near the surface, from a stretch of {} mm on: more would drive so small a tool through it",
                round(told.force_limit_n),
                round(told.stretch_limit_m * 1e3)
            ),
            format!(
                "in the air it follows at up to {} m/s, and meets the surface at up to {} m/s",
                round(told.moves_m_per_s),
                round(told.meets_m_per_s)
            ),
        ],
    }
}

/// Two significant digits: what is told are bounds.
fn round(value: f64) -> String {
    short(format!("{value:.1e}").parse().unwrap_or(value))
}
