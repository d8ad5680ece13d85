//! What a left ventricle is like, as two fields whose zero surfaces are its epicardium and its endocardium.
//!
//! In the heart's own axes the base is about the plane `z = 0` and the apex at negative `z`. With `q = p / a`, the semi-axes
//! `a`, both start as `(|q| − 1) min a`, about the distance (m) from an ellipsoid, negative within it.
use crate::random::Random;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Most papillary muscles.
const MOST_MUSCLES: usize = 3;
/// Part of a muscle's radius over which it merges into the wall.
const MERGES: f64 = 0.5;

/// A ventricle.
#[derive(Debug, Clone)]
pub(super) struct Anatomy {
    /// Semi-axes (m) of the epicardium.
    semi_axes_m: DVec3,
    /// The `z` (m) of the ellipsoids' centre, negative, as the base is at 0.
    centre_z_m: f64,
    /// Thickness (m) of the wall at its sides, and at the apex.
    wall_m: f64,
    apex_m: f64,
    /// Direction of the septum in the plane of the base, and how far (m) it is pushed in.
    septum: DVec3,
    flattened_m: f64,
    /// How much thicker the wall is on one side than in the mean, as a part of it, and the side (rad).
    uneven: f64,
    thick_side_rad: f64,
    muscles: Vec<Muscle>,
    /// Height (m) of the base's saddle.
    saddle_m: f64,
    saddle_rad: f64,
}

/// A papillary muscle: a capsule that leans on the wall.
#[derive(Debug, Clone)]
#[allow(clippy::struct_field_names)] // all of them are lengths
struct Muscle {
    from_m: DVec3,
    to_m: DVec3,
    radius_m: f64,
}

impl Anatomy {
    /// A left ventricle of mean human size: 84 mm long, 62 mm wide, its wall 9.5 mm thick, two papillary muscles; its septum is at
    /// negative `x`, so that what is at positive `x` is free wall. Its base is flat: a lattice of particles has a plane in it.
    pub(super) fn mean() -> Self {
        let mut heart = Self {
            semi_axes_m: DVec3::new(31e-3, 30e-3, 66e-3),
            centre_z_m: -18e-3,
            wall_m: 9.5e-3,
            apex_m: 6e-3,
            septum: -DVec3::X,
            flattened_m: 4.5e-3,
            uneven: 0.08,
            thick_side_rad: PI,
            muscles: Vec::new(),
            saddle_m: 0.0,
            saddle_rad: 0.0,
        };
        // Antero-lateral and postero-medial.
        for side_rad in [0.3 * PI, -0.35 * PI] {
            heart.muscles.push(heart.muscle(side_rad, [0.55, 0.3], 1.5e-3, 3.5e-3));
        }
        heart
    }

    pub(super) fn random(random: &mut Random) -> Self {
        let radius_m = random.within(26e-3, 32e-3);
        let semi_axes_m = DVec3::new(radius_m, radius_m * random.within(0.85, 1.1), random.within(52e-3, 66e-3));
        let wall_m = random.within(8e-3, 12e-3);
        let centre_z_m = -semi_axes_m.z * random.within(0.1, 0.3);
        let septum_rad = random.within(0.0, TAU);
        let mut heart = Self {
            semi_axes_m,
            centre_z_m,
            wall_m,
            apex_m: wall_m * random.within(0.45, 0.9),
            septum: DVec3::new(septum_rad.cos(), septum_rad.sin(), 0.0),
            flattened_m: random.within(0.0, 0.25) * radius_m,
            uneven: random.within(0.0, 0.25),
            thick_side_rad: random.within(0.0, TAU),
            muscles: Vec::new(),
            saddle_m: random.within(0.0, 4e-3),
            saddle_rad: random.within(0.0, TAU),
        };
        for _ in 0..=random.below(MOST_MUSCLES) {
            let muscle = heart.random_muscle(random);
            heart.muscles.push(muscle);
        }
        heart
    }

    fn random_muscle(&self, random: &mut Random) -> Muscle {
        let side_rad = random.within(0.0, TAU);
        let low = random.within(0.45, 0.6);
        let high = low - random.within(0.2, 0.35);
        let stands_out_m = random.within(1e-3, 3e-3);
        self.muscle(side_rad, [low, high], stands_out_m, random.within(2.5e-3, 4e-3))
    }

    /// A muscle on one side of the cavity between two heights (parts of the cavity's, from the centre towards the apex); its upper end
    /// stands out into the cavity.
    fn muscle(&self, side_rad: f64, [low, high]: [f64; 2], stands_out_m: f64, radius_m: f64) -> Muscle {
        let side = DVec3::new(side_rad.cos(), side_rad.sin(), 0.0);
        let cavity_m = self.semi_axes_m - DVec3::new(self.wall_m, self.wall_m, self.apex_m);
        let at = |height: f64| {
            let z = self.centre_z_m - height * cavity_m.z;
            let wide = (1.0 - height * height).max(0.0).sqrt();
            side * (DVec3::new(cavity_m.x, cavity_m.y, 0.0) * wide) + DVec3::Z * z
        };
        Muscle { from_m: at(low), to_m: at(high) - side * stands_out_m, radius_m }
    }

    /// The ellipsoids' centre (m), and a distance (m) from it that nothing is beyond.
    pub(super) fn centre_and_reach_m(&self) -> (DVec3, f64) {
        (DVec3::Z * self.centre_z_m, 1.5 * self.semi_axes_m.max_element())
    }

    /// Returns a box (m) that holds the surfaces below the base.
    pub(super) fn bounds_m(&self) -> [DVec3; 2] {
        let side_m = self.semi_axes_m.x.max(self.semi_axes_m.y) * 1.05;
        let bottom_m = self.centre_z_m - self.semi_axes_m.z * 1.05;
        [DVec3::new(-side_m, -side_m, bottom_m), DVec3::new(side_m, side_m, 0.0)]
    }

    /// Returns the field (m) whose zero surface is the epicardium; negative inside.
    pub(super) fn outside_m(&self, p: DVec3) -> f64 {
        self.ellipsoid_m(self.flattened(p), self.semi_axes_m)
    }

    /// Returns the field (m) whose zero surface is the endocardium; negative in the cavity.
    pub(super) fn cavity_m(&self, p: DVec3) -> f64 {
        let side_rad = p.y.atan2(p.x) - self.thick_side_rad;
        let away = (p.truncate().length() / self.semi_axes_m.x).min(1.0);
        let side_m = self.wall_m * (1.0 + self.uneven * away * side_rad.cos());
        let cavity_m = self.ellipsoid_m(self.flattened(p), self.semi_axes_m - DVec3::new(side_m, side_m, self.apex_m));
        self.muscles.iter().fold(cavity_m, |cavity_m, muscle| muscle.taken_from(cavity_m, p))
    }

    /// Returns a point of the plane `z = 0` and what is below it where the base's saddle puts it: a fifth of the heart's
    /// height below, nothing moves.
    pub(super) fn on_saddle(&self, p: DVec3) -> DVec3 {
        let (angle, away) = (p.y.atan2(p.x) - self.saddle_rad, p.truncate().length() / self.semi_axes_m.x);
        let fades = (1.0 + p.z / (0.4 * self.semi_axes_m.z)).clamp(0.0, 1.0);
        p + DVec3::Z * (self.saddle_m * fades * away * away * (2.0 * angle).cos())
    }

    /// Returns the point of the ellipsoids that is put at `p` where the septum is pushed in: by the flattening where it is
    /// outermost, and less with the square of how far inwards.
    fn flattened(&self, p: DVec3) -> DVec3 {
        let out = (p.dot(self.septum) / self.semi_axes_m.x).clamp(0.0, 1.0);
        p + self.septum * (self.flattened_m * out * out)
    }

    fn ellipsoid_m(&self, p: DVec3, semi_axes_m: DVec3) -> f64 {
        let q = (p - DVec3::Z * self.centre_z_m) / semi_axes_m;
        (q.length() - 1.0) * semi_axes_m.min_element()
    }
}

impl Muscle {
    /// Returns the field of a cavity less the muscle, which merges into the wall smoothly: the largest of both fields, and
    /// a little more where they are alike (Quilez's polynomial).
    fn taken_from(&self, cavity_m: f64, p: DVec3) -> f64 {
        let along = self.to_m - self.from_m;
        let part = ((p - self.from_m).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        let muscle_m = self.radius_m - p.distance(self.from_m + along * part);
        let width_m = MERGES * self.radius_m;
        let alike_m = (width_m - (cavity_m - muscle_m).abs()).max(0.0);
        cavity_m.max(muscle_m) + 0.25 * alike_m * alike_m / width_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is in the cavity is within the epicardium by a wall of some millimetres, whatever the seed.
    #[test]
    fn the_wall_is_never_thin() {
        for seed in 0..200 {
            let mut random = Random::new(seed);
            let heart = Anatomy::random(&mut random);
            let [low, high] = heart.bounds_m();
            let mut in_cavity = 0;
            for _ in 0..2000 {
                let p = low + (high - low) * (0.5 + 0.5 * random.vector());
                if heart.cavity_m(p) < 0.0 {
                    in_cavity += 1;
                    // The field underestimates distances along the long axis.
                    assert!(heart.outside_m(p) < -1.5e-3, "seed {seed}: {p} {}", heart.outside_m(p));
                }
            }
            assert!(in_cavity > 100, "seed {seed}: {in_cavity}");
        }
    }
}
