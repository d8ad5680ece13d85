//! How much the force on a tool ripples with the particles of the hybrid body that it touches: the measurement behind what
//! `palpated check` says of it (`docs/measurements/ripple.md`).
//!
//! The scene `hybrid-block` on particles of several spacings, with skins that are smooth and skins that are not, under a rigid sphere
//! without friction. Dragged: at a constant depth
//! it goes over four spacings along one axis of the lattice and one along the other, so that it comes over particles, edges and
//! middles of cells. Pressed: it goes straight down on a particle, and on the middle of a cell.
use crate::press::Slow;
use glam::{DMat3, DVec2, DVec3};
use miette::{IntoDiagnostic, Result, ensure, miette};
use palpate_physics::{Model, contact::Coupling};
use palpate_scene::Limits;

/// Spacings (mm) of particles.
const SPACINGS_MM: [f64; 3] = [5.0, 2.5, 1.25];
/// Whether the skin is smooth.
const SKINS: [(bool, &str); 2] = [(false, "cells"), (true, "smooth")];
/// Radii (mm) of spheres.
const RADII_MM: [f64; 6] = [1.5, 2.5, 3.75, 5.0, 10.0, 20.0];
/// Depths (mm) at which they are dragged; none is dragged deeper than [`DEEPEST`].
const DEPTHS_MM: [f64; 3] = [0.3, 1.0, 2.0];
/// Greatest depth over radius.
const DEEPEST: f64 = 0.55;
/// Radii (mm) of spheres that are pressed.
const PRESSED_MM: [f64; 2] = [3.75, 10.0];
/// Depths (mm) between which stiffness is looked at: a light press and a deep one.
const PRESSES_MM: [[f64; 2]; 2] = [[0.3, 1.0], [1.0, 3.0]];

/// Spacings that a dragged sphere goes along x and y.
const WAY: DVec2 = DVec2::new(4.0, 1.0);
/// Ticks in which it goes down, in which it then waits, and in which it is dragged.
const DRAG_TICKS: [u32; 3] = [300, 300, 1250];
/// Of the way, what is left out at the start, where it starts to move.
const START: f64 = 0.05;
/// Depth (mm) that a pressed sphere goes in a tick, and half of that over which its stiffness is taken, in ticks.
const PRESS_MM: f64 = 1e-3;
const HALF_WINDOW: usize = 50;

/// Measures and prints, as the rows of two tables.
///
/// # Errors
/// A scene that is refused.
pub fn print() -> Result<()> {
    println!(
        "| spacing | radius | depth | spacing over contact | {} |",
        SKINS.map(|(_, name)| format!("{name}: mean force | ripple | sideways")).join(" | ")
    );
    println!("|---|---|---|---|{}", "---|---|---|".repeat(SKINS.len()));
    for spacing_mm in SPACINGS_MM {
        for radius_mm in RADII_MM {
            let [cells, smooth] = SKINS.map(|(is_smooth, _)| block(spacing_mm, radius_mm, is_smooth));
            let models = [cells?, smooth?];
            for depth_mm in DEPTHS_MM.into_iter().filter(|depth_mm| *depth_mm <= DEEPEST * radius_mm) {
                let of_skins = models.each_ref().map(|model| {
                    let Dragged { mean_n, ripple, sideways } = dragged(model, spacing_mm, depth_mm);
                    format!("{:.2} mN | {:.1} % | {:.1} %", 1e3 * mean_n, 100.0 * ripple, 100.0 * sideways)
                });
                let over_contact = spacing_mm / (radius_mm * depth_mm).sqrt();
                println!(
                    "| {spacing_mm} mm | {radius_mm} mm | {depth_mm} mm | {over_contact:.2} | {} |",
                    of_skins.join(" | ")
                );
            }
        }
    }
    println!();
    println!(
        "| spacing | radius | skin | on | {} |",
        PRESSES_MM.map(|[from, to]| format!("{from} to {to} mm")).join(" | ")
    );
    println!("|---|---|---|---|---|---|");
    for spacing_mm in SPACINGS_MM {
        for (radius_mm, (is_smooth, skin)) in PRESSED_MM.into_iter().flat_map(|r| SKINS.map(|skin| (r, skin))) {
            let model = block(spacing_mm, radius_mm, is_smooth)?;
            for (on, part) in [("a particle", 0.0), ("the middle of a cell", 0.5)] {
                let forces_n = pressed(&model, DVec2::splat(part * spacing_mm));
                let ripples =
                    PRESSES_MM.map(|press_mm| format!("{:.1} %", 100.0 * stiffness_ripple(&forces_n, press_mm)));
                println!("| {spacing_mm} mm | {radius_mm} mm | {skin} | {on} | {} |", ripples.join(" | "));
            }
        }
    }
    Ok(())
}

/// The scene's block on particles of this spacing, under a rigid sphere of this radius without friction.
fn block(spacing_mm: f64, radius_mm: f64, is_smooth: bool) -> Result<Model> {
    const SPACING: &str = "spacing_mm = 2.5";
    let text = palpate_scene::builtin("hybrid-block").ok_or_else(|| miette!("there is no scene hybrid-block"))?;
    ensure!(text.matches(SPACING).count() == 1, "the scene hybrid-block has not one line \"{SPACING}\"");
    let text = text.replace(SPACING, &format!("spacing_mm = {spacing_mm}\nsmooth_skin = {is_smooth}"));
    let mut scene = palpate_scene::parse(&text, "hybrid-block", None, &Limits::local(), &mut |_, _| {})?;
    for tool in &mut scene.model.tools {
        tool.radius_m = 1e-3 * radius_mm;
        tool.friction_coefficient = 0.0;
        tool.coupling = Coupling::Rigid;
        tool.start_position_m = DVec3::Z * (tool.radius_m + 1e-3);
    }
    Model::build(scene.model).into_diagnostic()
}

/// What is felt while a sphere is dragged.
#[derive(Debug, Clone, Copy)]
struct Dragged {
    /// Mean force (N) along the surface's normal.
    mean_n: f64,
    /// Its largest value less its smallest, over the mean.
    ripple: f64,
    /// The same of the force along the way.
    sideways: f64,
}

fn dragged(model: &Model, spacing_mm: f64, depth_mm: f64) -> Dragged {
    let [down, wait, drag] = DRAG_TICKS;
    let mut slow = Slow::at_rest(model);
    let radius_m = model.tools()[0].radius_m;
    let at = |part: f64, depth_mm: f64| {
        // From one side of the block's middle, which a particle is in, to the other along x
        let way_mm = (WAY * part - DVec2::new(0.5 * WAY.x, 0.0)) * spacing_mm;
        (way_mm * 1e-3).extend(radius_m - 1e-3 * depth_mm)
    };
    for tick in 1..=down + wait {
        slow.tick(at(0.0, depth_mm * (f64::from(tick) / f64::from(down)).min(1.0)));
    }
    let (mut forces_n, mut low_n, mut high_n) = (DVec3::ZERO, DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut count = 0.0;
    for tick in 1..=drag {
        let part = f64::from(tick) / f64::from(drag);
        let force_n = slow.tick(at(part, depth_mm));
        if part > START {
            (forces_n, low_n, high_n) = (forces_n + force_n, low_n.min(force_n), high_n.max(force_n));
            count += 1.0;
        }
    }
    let mean_n = forces_n.z / count;
    let swing_n = high_n - low_n;
    Dragged { mean_n, ripple: swing_n.z / mean_n, sideways: swing_n.x / mean_n }
}

/// The force (N) on a sphere after each tick in which it went [`PRESS_MM`] deeper, so far (mm) from the block's middle.
fn pressed(model: &Model, beside_mm: DVec2) -> Vec<f64> {
    let mut slow = Slow::at_rest(model);
    let radius_m = model.tools()[0].radius_m;
    let ticks = (PRESSES_MM[1][1] / PRESS_MM).round() as usize + HALF_WINDOW;
    let at = |tick: usize| (beside_mm * 1e-3).extend(radius_m - 1e-3 * PRESS_MM * tick as f64);
    (0..=ticks).map(|tick| slow.tick(at(tick)).z).collect()
}

/// Returns how far stiffness, between two depths (mm), is above and below the smooth curve `ln k = c₀ + c₁ ln d + c₂ ln² d` that
/// is nearest to it, over that curve.
fn stiffness_ripple(forces_n: &[f64], [from_mm, to_mm]: [f64; 2]) -> f64 {
    let ticks = (from_mm / PRESS_MM).round() as usize..=(to_mm / PRESS_MM).round() as usize;
    let points: Vec<[f64; 2]> = ticks
        .map(|tick| {
            let stiffness = forces_n[tick + HALF_WINDOW] - forces_n[tick - HALF_WINDOW];
            [(tick as f64 * PRESS_MM).ln(), stiffness.ln()]
        })
        .collect();
    let powers = |x: f64| DVec3::new(1.0, x, x * x);
    // Normal equations of least squares: Σ p pᵀ c = Σ p y
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for &[x, y] in &points {
        let p = powers(x);
        matrix += DMat3::from_cols(p * p.x, p * p.y, p * p.z);
        right += p * y;
    }
    let fitted = matrix.inverse() * right;
    let ratio = points.iter().map(|&[x, y]| (y - fitted.dot(powers(x))).exp());
    let (low, high) = ratio.fold((f64::INFINITY, 0.0_f64), |(low, high), r| (low.min(r), high.max(r)));
    high - low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forces of a known law and a known ripple on it.
    #[test]
    fn ripple_of_stiffness_is_what_was_put_in() {
        let force_n = |amplitude: f64| -> Vec<f64> {
            let stiffness = |d_mm: f64| d_mm.sqrt() * (1.0 + amplitude * (40.0 * d_mm).sin());
            let mut sum = 0.0;
            (0..=3050)
                .map(|tick| {
                    sum += stiffness((f64::from(tick) + 0.5) * PRESS_MM) * PRESS_MM;
                    sum
                })
                .collect()
        };
        for press_mm in PRESSES_MM {
            assert!(stiffness_ripple(&force_n(0.0), press_mm) < 2e-3, "{press_mm:?}");
            // A window of 0.1 mm takes the mean of the sine: sin(2)/2 of it is left.
            let left = 2.0 * 0.1 * 2.0_f64.sin() / 2.0;
            let found = stiffness_ripple(&force_n(0.1), press_mm);
            assert!((found / left - 1.0).abs() < 0.1, "{press_mm:?}: {found} of {left}");
        }
    }
}
