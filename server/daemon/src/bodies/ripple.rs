//! How much the force on a tool ripples with the particles of a hybrid body that it touches, by how large they are beneath it.
//!
//! A surface that particles carry gives way more at a particle than in the middle of a cell, and a tool that touches less than some cells
//! feels it while it is dragged. Measured (`docs/measurements/ripple.md`: spheres dragged over a block), the force swings from its least to
//! its largest value by about
//! ```text
//! e = min(e₁, c σ²)        σ = h/a,  a = √(R δ)        c = 0.13, e₁ = 0.9; beneath a smooth skin c = 0.025, e₁ = 0.2
//! ```
//! of its mean, with the particles' spacing h and the contact's radius a, of a sphere of radius R dragged δ deep: neither R/h nor the skin's
//! triangles count. The swing is at most 1.5 times what the rule says, and may be a third of it where the lattice is in step with what the
//! contact averages. Below 2 % other things swing as much, such as what is awake.
use palpate_physics::{
    Model,
    bodies::hybrid::ParticleSpec,
    contact::{ToolShape, ToolSpec},
};
use palpate_scene::wording::{short, two_digits};

/// Depths (m) that are told: a light touch, and a press.
const DEPTHS_M: [f64; 2] = [0.3e-3, 2e-3];
/// Depth over radius that is told at most.
const DEEPEST: f64 = 0.5;
/// Below this a hand feels none of it.
const SMOOTH: f64 = 0.02;
/// Above this, while it presses, a hand feels particles in place of a body: it tells forces apart that differ by 7 to 10 %.
const ROUGH: f64 = 0.1;
/// `c` and `e₁`, and the same beneath a smooth skin.
const OF_CELLS: [f64; 2] = [0.13, 0.9];
const OF_MEANS: [f64; 2] = [0.025, 0.2];

/// What is to be expected of a tool that is dragged.
struct Expected<'m> {
    tool: &'m ToolSpec,
    spacing_m: f64,
    smooth_skin: bool,
}

/// Says how much the force on the smallest sphere ripples, where that is felt only while it hardly touches.
pub(super) fn told(model: &Model, particles: &ParticleSpec) -> Option<String> {
    let expected = Expected::of(model, particles)?;
    let is_told = expected.ripple(0) > SMOOTH && expected.ripple(1) <= ROUGH;
    is_told.then(|| format!("limit      {}", expected.sentence()))
}

/// Warns of particles that are too coarse for the smallest sphere even while it presses.
pub(super) fn warning(model: &Model, particles: &ParticleSpec) -> Option<String> {
    let expected = Expected::of(model, particles)?;
    (expected.ripple(1) > ROUGH).then(|| expected.sentence())
}

/// Returns how far the force swings, over its mean, where the particles' spacing over the contact's radius is this.
fn expected_ripple(spacing_over_contact: f64, smooth_skin: bool) -> f64 {
    let [over_square, most] = constants(smooth_skin);
    (over_square * spacing_over_contact * spacing_over_contact).min(most)
}

fn constants(smooth_skin: bool) -> [f64; 2] {
    if smooth_skin { OF_MEANS } else { OF_CELLS }
}

impl<'m> Expected<'m> {
    /// Of the smallest sphere; `None` without any. A capsule lies on more particles than a sphere of its radius.
    fn of(model: &'m Model, particles: &ParticleSpec) -> Option<Self> {
        let spheres = model.tools().iter().filter(|tool| tool.shape == ToolShape::Sphere);
        let tool = spheres.min_by(|a, b| a.radius_m.total_cmp(&b.radius_m))?;
        Some(Self { tool, spacing_m: particles.spacing_m, smooth_skin: particles.smooth_skin })
    }

    fn depth_m(&self, number: usize) -> f64 {
        DEPTHS_M[number].min(DEEPEST * self.tool.radius_m)
    }

    /// `√(R δ)` (m).
    fn contact_radius_m(&self, number: usize) -> f64 {
        (self.tool.radius_m * self.depth_m(number)).sqrt()
    }

    fn ripple(&self, number: usize) -> f64 {
        expected_ripple(self.spacing_m / self.contact_radius_m(number), self.smooth_skin)
    }

    /// The spacing (m) of particles on which the ripple is [`SMOOTH`], beneath such a skin.
    fn serving_m(&self, number: usize, smooth_skin: bool) -> f64 {
        (SMOOTH / constants(smooth_skin)[0]).sqrt() * self.contact_radius_m(number)
    }

    fn sentence(&self) -> String {
        let [light_mm, deep_mm] = [0, 1].map(|number| short(self.depth_m(number) * 1e3));
        let [light, deep] = [0, 1].map(|number| two_digits(100.0 * self.ripple(number)));
        let is_one_depth = light_mm == deep_mm;
        let serving = |smooth_skin| {
            let [fine_mm, coarse_mm] = [0, 1].map(|number| two_digits(self.serving_m(number, smooth_skin) * 1e3));
            if is_one_depth {
                format!("particles {coarse_mm} mm apart")
            } else {
                format!("particles {coarse_mm} mm apart at the one depth, {fine_mm} mm apart at the other")
            }
        };
        let lightly = if is_one_depth { String::new() } else { format!(", and by about {light} % {light_mm} mm deep") };
        let with_means =
            if self.smooth_skin { String::new() } else { format!("; with smooth_skin = true, on {}", serving(true)) };
        format!(
            "dragged over particles {} mm apart, the tool \"{}\", {} mm in radius, feels them: its force swings by about {deep} % of its mean {deep_mm} mm \
             deep{lightly}. It is smooth to {} % on {}{with_means} (in [body.particles])",
            short(self.spacing_m * 1e3),
            self.tool.name,
            short(self.tool.radius_m * 1e3),
            short(100.0 * SMOOTH),
            serving(self.smooth_skin),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spacing over contact radius, and the swing measured on the block over cells and beneath a smooth skin
    /// (`docs/measurements/ripple.md`).
    #[test]
    fn the_rule_is_what_was_measured() {
        let measured = [
            (4.71, 0.861, 0.222),
            (2.89, 0.807, 0.158),
            (2.36, 0.761, 0.132),
            (2.04, 0.687, 0.112),
            (1.83, 0.599, 0.112),
            (1.58, 0.389, 0.091),
            (1.44, 0.196, 0.056),
            (1.29, 0.079, 0.046),
            (1.12, 0.070, 0.019),
            (1.02, 0.108, 0.012),
            (0.91, 0.089, 0.005),
            (0.79, 0.048, 0.013),
        ];
        for (spacing_over_contact, cells, smooth) in measured {
            for (swing, smooth_skin) in [(cells, false), (smooth, true)] {
                let told = expected_ripple(spacing_over_contact, smooth_skin);
                assert!(swing < 1.5 * told, "{spacing_over_contact}: {told} of {swing}");
                assert!(swing > 0.3 * told || swing < SMOOTH, "{spacing_over_contact}: {told} of {swing}");
            }
        }
    }
}
