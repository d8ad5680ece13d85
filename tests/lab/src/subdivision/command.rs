//! The command: figures as data and plots.
use super::{
    contact::{Run, TOUCHES, Touch, compare},
    dome::domes,
    experiment::{Experiment, Figure, figures},
    page,
};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{Context, IntoDiagnostic, Result};
use std::{fmt::Write as _, path::PathBuf};

/// `K_m/K_h` before: the paper's figures, and the two it compares them with.
const MESH_OVER_ANCHOR: [f64; 3] = [1.0, 10.0, 0.1];

/// Where to.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Directory for subdivision.html, subdivision.csv and subdivision-contact.csv
    #[arg(long, default_value = "lab-results")]
    out: PathBuf,
}

/// Computes figures 5 to 11 at all three `K_m/K_h`, figure 12, and sheets beneath tools; writes them and says what they
/// say.
///
/// # Errors
/// A file that cannot be written, or springs that come to no rest.
pub fn run(options: &Options) -> Result<()> {
    let out = &options.out;
    std::fs::create_dir_all(out).into_diagnostic().wrap_err_with(|| format!("cannot make {}", out.display()))?;
    let bar = ProgressBar::new(1000);
    bar.set_style(ProgressStyle::with_template("{bar:20} {percent} % {elapsed} {msg}").into_diagnostic()?);
    let mut all = Vec::new();
    for (number, mesh_over_anchor) in MESH_OVER_ANCHOR.into_iter().enumerate() {
        bar.set_message(format!("K_m/K_h = {mesh_over_anchor}"));
        let mut tell = |part: f64| bar.set_position(((number as f64 + part) / 6.0 * 1000.0) as u64);
        all.push((mesh_over_anchor, figures(Experiment { mesh_over_anchor }, &mut tell)?));
    }
    let mut contacts = Vec::new();
    for (number, touch) in TOUCHES.into_iter().enumerate() {
        bar.set_message(format!("sheets beneath a sphere ({})", touch.name));
        let mut tell = |part: f64| bar.set_position(((3.0 + number as f64 + part) / 6.0 * 1000.0) as u64);
        contacts.push((touch, compare(touch, &mut tell).into_diagnostic()?));
    }
    bar.finish_and_clear();
    let page = page::page(&all, &domes().into_diagnostic()?, &contacts);
    let files = [("subdivision.csv", csv(&all)), ("subdivision-contact.csv", contact_csv(&contacts))];
    for (name, text) in files.into_iter().chain([("subdivision.html", page)]) {
        let path = out.join(name);
        std::fs::write(&path, text).into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))?;
    }
    print(&all);
    print_contacts(&contacts);
    println!("\nwritten to {}: subdivision.html (plots), subdivision.csv, subdivision-contact.csv", out.display());
    Ok(())
}

fn csv(all: &[(f64, Vec<Figure>)]) -> String {
    let mut text = String::from("km_over_kh,figure,quantity,curve,x_over_l,value\n");
    for (mesh_over_anchor, figures) in all {
        for figure in figures {
            for curve in &figure.curves {
                for (x, value) in &curve.points {
                    let (number, quantity, name) = (figure.number, figure.quantity, &curve.name);
                    let _ = writeln!(text, "{mesh_over_anchor},{number},{quantity},{name},{x},{value:.9e}");
                }
            }
        }
    }
    text
}

/// The force on the tool, tick by tick.
fn contact_csv(contacts: &[(Touch, Vec<Run>)]) -> String {
    let mut text = String::from("touch,sheet,tick,force_x_n,force_y_n,force_z_n\n");
    for (touch, runs) in contacts {
        for run in runs {
            for (tick, force) in run.force_n.iter().enumerate() {
                let _ = writeln!(
                    text,
                    "{},\"{}\",{},{:.6e},{:.6e},{:.6e}",
                    touch.name,
                    run.name,
                    tick + 1,
                    force.x,
                    force.y,
                    force.z
                );
            }
        }
    }
    text
}

fn print_contacts(contacts: &[(Touch, Vec<Run>)]) {
    println!("\nsheets beneath a sphere, against one that is fine everywhere:");
    for (Touch { name, radius, depth }, runs) in contacts {
        println!("  {name}: radius {radius} L, {depth} L deep");
        println!("    {:<23} {:>12} {:>12} {:>12} {:>10}", "", "at rest", "force off", "shape off", "us a tick");
        for run in runs {
            println!(
                "    {:<23} {:>12.3} {:>10.1} % {:>10.1} % {:>10.1}",
                run.name,
                run.at_rest,
                100.0 * run.force_error,
                100.0 * run.shape_error,
                run.tick_us
            );
        }
    }
}

/// Ends and middle of every curve.
fn print(all: &[(f64, Vec<Figure>)]) {
    for (mesh_over_anchor, figures) in all {
        println!("\nK_m/K_h = {mesh_over_anchor}: at x = 0.01 L, 0.5 L, L");
        for figure in figures {
            println!("  figure {}: {}", figure.number, figure.title);
            for curve in &figure.curves {
                let at = |x: f64| curve.points.iter().find(|p| p.0 == x).map_or(f64::NAN, |p| p.1);
                let [start, middle, end] = [0.01, 0.5, 1.0].map(at);
                println!("    {:<9} {:<18} {start:>10.4} {middle:>10.4} {end:>10.4}", figure.quantity, curve.name);
            }
        }
    }
}
