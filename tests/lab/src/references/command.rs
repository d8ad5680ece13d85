//! `palpate-lab references`.
use super::{Reference, path, remake};
use crate::problems::{self, exact};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result, ensure};
use std::time::Duration;

/// Which references are made.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Make again also what is stored
    #[arg(long)]
    remake: bool,
    /// Only problems whose name contains this
    filter: Option<String>,
}

/// Makes what is missing, or everything, and prints what there is.
///
/// # Errors
/// No such problem, or a reference that cannot be made or written.
pub fn run(options: &Options) -> Result<()> {
    let wanted = |name: &str| options.filter.as_deref().is_none_or(|filter| name.contains(filter));
    let problems: Vec<_> = problems::all().into_iter().filter(|p| wanted(&p.name)).collect();
    ensure!(!problems.is_empty(), "no problem's name contains that; without a filter all are listed");
    let bar = ProgressBar::new(problems.len() as u64);
    let style = ProgressStyle::with_template("{pos}/{len} {elapsed} {prefix} {msg}").into_diagnostic()?;
    bar.set_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    let mut failed = 0;
    for problem in &problems {
        bar.set_prefix(problem.name.clone());
        let path = path(problem);
        let stored = exact::answer_m(problem).is_some() || path.exists();
        let reference = if stored && !(options.remake && exact::answer_m(problem).is_none()) {
            Reference::of(problem)?
        } else {
            match remake(problem, &mut |text| bar.set_message(text.to_owned())) {
                Ok(reference) => {
                    let text = toml::to_string(&reference).into_diagnostic()?;
                    std::fs::write(&path, text).into_diagnostic()?;
                    reference
                }
                Err(error) => {
                    bar.suspend(|| println!("{:<32} {error:?}", problem.name));
                    failed += 1;
                    continue;
                }
            }
        };
        bar.set_message("");
        bar.suspend(|| println!("{}", line(&reference)));
        bar.inc(1);
    }
    bar.finish_and_clear();
    ensure!(failed == 0, "{failed} of {} references could not be made", problems.len());
    Ok(())
}

fn line(r: &Reference) -> String {
    let relative = 100.0 * r.uncertainty / r.value.abs();
    let order = r.observed_order.map_or_else(|| "-".into(), |order| format!("{order:.1}"));
    format!(
        "{:<32} {:.6e} {} ± {relative:.3} %, order {order}, field {:.1e}",
        r.problem, r.value, r.unit, r.field_difference
    )
}
