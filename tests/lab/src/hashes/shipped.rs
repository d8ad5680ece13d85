//! The scenes of `deploy/scenes`, each as far as it does something new; and those that an arm moves, moved by one.
use super::{
    case::{Case, Moment, Source},
    hand::Stroke,
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result, WrapErr};
use std::path::{Path, PathBuf};

/// Ticks until tools have come, pressed, dragged and gone and what they woke sleeps again, `None`: all; and when (s) there is an equilibrium worth looking for. A scene that is not here
/// is run as a whole.
const CUTS: [(&str, Option<u64>, Option<f64>); 15] = [
    ("block-press", None, Some(0.45)),
    ("cantilever", Some(300), Some(f64::INFINITY)),
    ("capsule-press", Some(2400), None),
    ("hybrid-block", None, Some(0.4)),
    ("hybrid-shaft", None, None),
    ("hybrid-ventricle", None, Some(0.7)),
    ("lame-sphere", Some(100), Some(f64::INFINITY)),
    ("paper-2006", Some(900), Some(0.4)),
    ("seed-ellipsoids", None, None),
    ("seed-full-fem", Some(4000), None),
    ("seed-hybrid", None, None),
    ("springs-dome", None, None),
    ("two-hands", Some(1500), None),
    ("two-surfaces", Some(300), Some(f64::INFINITY)),
    ("ventricle", Some(1500), Some(0.8)),
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy/scenes")
}

/// One for every file.
///
/// # Errors
/// The folder cannot be read.
pub(super) fn cases() -> Result<Vec<Case>> {
    let folder = folder();
    let entries =
        std::fs::read_dir(&folder).into_diagnostic().wrap_err_with(|| format!("cannot read {}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    let mut cases: Vec<Case> = paths.into_iter().filter_map(of_file).collect();
    cases.extend([hand("hybrid-shaft", shaft), hand("two-hands", two_hands)]);
    Ok(cases)
}

fn of_file(path: PathBuf) -> Option<Case> {
    let name = path.file_stem()?.to_str()?.to_owned();
    let cut = CUTS.iter().find(|(known, ..)| *known == name);
    let (ticks, rests_at_s) = cut.map_or((None, None), |&(_, ticks, rests_at_s)| (ticks, rests_at_s));
    Some(Case { rests_at_s, ..Case::of(name, Source::File(path), ticks) })
}

/// A scene moved by an arm.
fn hand(name: &str, act: fn(&mut Moment<'_>)) -> Case {
    let path = folder().join(format!("{name}.toml"));
    Case::of(format!("{name}/hand"), Source::File(path), Some(700)).acting(act)
}

fn shaft(moment: &mut Moment<'_>) {
    let stroke = Stroke {
        each_s: 0.18,
        press_m: DVec3::new(-14e-3, 0.0, 0.0),
        drag_m: DVec3::new(0.0, 6e-3, 4e-3),
        axis: DVec3::X,
        half_sine: 0.3,
    };
    move_tool(moment, 0, stroke);
}

fn two_hands(moment: &mut Moment<'_>) {
    let press_m = DVec3::new(-27e-3, 0.0, 0.0);
    let drag_m = DVec3::new(0.0, 8e-3, -5e-3);
    let finger = Stroke { each_s: 0.18, press_m, drag_m, axis: DVec3::Z, half_sine: 0.2 };
    move_tool(moment, 0, finger);
    let shaft = Stroke { each_s: 0.15, press_m: -press_m, drag_m: -drag_m, axis: DVec3::X, half_sine: 0.4 };
    move_tool(moment, 1, shaft);
}

fn move_tool(moment: &mut Moment<'_>, tool: usize, stroke: Stroke) {
    moment.drive.tools[tool] = stroke.at(moment.model.tools()[tool].start(), moment.time_s);
}
