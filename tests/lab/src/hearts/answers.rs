//! What a finger feels at five places of irregular hearts, beside the same hearts of many tets alone.
//!
//! All of them are pressed at the same points of space and to the same depth past their first vertex there, as their surfaces differ by less
//! than the tets' edges. Tets are smoothed, the default, in two numbers, by whose difference one sees how far they have converged.
use super::{
    Heart,
    place::{Place, RADIUS_M},
};
use crate::press::Slow;
use glam::DVec3;
use miette::{IntoDiagnostic, Result, bail};
use palpate_physics::{
    BodySpec, Model, ModelSpec,
    bodies::hybrid::Waking,
    contact::{Coupling, ToolShape, ToolSpec},
};
use std::{f64::consts::TAU, ops::Range};

/// Number of places about the heart's axis.
const PLACES: u32 = 5;
/// Depth (m) to which the finger presses, and how far (m) from the heart it starts.
const DEPTH_M: f64 = 8e-3;
const GAP_M: f64 = 1e-3;
/// Ticks in which it goes there, in which the heart then comes to rest, and over which its force is averaged at last.
const TICKS: [u32; 3] = [200, 500, 50];
/// Mass damping (1/s), near critical for the heart's slowest modes.
const DAMPING_PER_S: f64 = 60.0;
/// Numbers of tets alone.
const TETS: [u32; 2] = [15_000, 40_000];

/// Measures and prints, as the rows of a table.
///
/// # Errors
/// A heart that cannot be built.
pub(super) fn print(seeds: Range<u64>, awake: &[usize]) -> Result<()> {
    println!(
        "Force on a finger of {:.0} mm, {:.0} mm deep, in newtons; in brackets over that of the most tets.\n",
        1e3 * RADIUS_M,
        1e3 * DEPTH_M
    );
    let columns: Vec<String> = awake.iter().map(|awake| format!("{awake} awake")).collect();
    println!("| heart | place | {} tets alone | {} tets alone | {} |", TETS[0], TETS[1], columns.join(" | "));
    println!("|---|---|---|---|{}", "---|".repeat(awake.len()));
    for seed in seeds {
        let heart = Heart::random(seed)?;
        let [few, many] = [Heart::of_tets(seed, TETS[0], false)?.spec, Heart::of_tets(seed, TETS[1], false)?.spec];
        let bare = Model::build(heart.spec.clone()).into_diagnostic()?;
        for number in 0..PLACES {
            let place = Place::of(&bare, TAU * f64::from(number) / f64::from(PLACES));
            let [few_n, many_n] = [pressed_n(few.clone(), place)?, pressed_n(many.clone(), place)?];
            let beside = |force_n: f64| format!("{force_n:.4} ({:+.1} %)", 100.0 * (force_n / many_n - 1.0));
            let mut cells = vec![beside(few_n), format!("{many_n:.4}")];
            for &awake in awake {
                cells.push(beside(pressed_n(with_awake(heart.spec.clone(), awake)?, place)?));
            }
            println!("| {seed}: {} | {number} | {} |", heart.told, cells.join(" | "));
        }
    }
    Ok(())
}

fn with_awake(mut spec: ModelSpec, awake: usize) -> Result<ModelSpec> {
    let BodySpec::Hybrid(hybrid) = &mut spec.body else { bail!("the heart has no particles") };
    let particles = &mut hybrid.particles;
    particles.most_active = awake;
    particles.waking = Waking::in_half_ball(particles.spacing_m, particles.fine_depth_m, awake);
    Ok(spec)
}

fn pressed_n(mut spec: ModelSpec, place: Place) -> Result<f64> {
    spec.settings.mass_damping_per_s = DAMPING_PER_S;
    spec.tools = vec![ToolSpec {
        name: "finger".to_owned(),
        shape: ToolShape::Sphere,
        radius_m: RADIUS_M,
        coupling: Coupling::Rigid,
        friction_coefficient: 0.0,
        start_position_m: place.finger_m(-GAP_M, 0.0),
    }];
    let model = Model::build(spec).into_diagnostic()?;
    let mut slow = Slow::at_rest(&model);
    let [goes, rests, averaged] = TICKS;
    let mut sum_n = DVec3::ZERO;
    for tick in 1..=goes + rests {
        let part = (f64::from(tick) / f64::from(goes)).min(1.0);
        let force_n = slow.tick(place.finger_m(-GAP_M + (GAP_M + DEPTH_M) * part, 0.0));
        if tick > goes + rests - averaged {
            sum_n += force_n;
        }
    }
    if let Some(quarantine) = slow.state().quarantine {
        bail!("the heart did not survive: {quarantine:?}");
    }
    Ok(sum_n.length() / f64::from(averaged))
}
