//! The surfaces of the heart that Palpate ships (`deploy/scenes/heart.toml`): a mean human left ventricle, triangulated evenly.
//!
//! Vertices are on rings about the long axis, at equal arc lengths of a meridian; each is where the field of
//! [`Anatomy`](super::anatomy::Anatomy) changes its sign along a ray from the ellipsoids' centre. Bands between rings take the shorter of
//! two diagonals in turn.
use super::anatomy::Anatomy;
use clap::Args;
use glam::DVec3;
use miette::{IntoDiagnostic, Result, WrapErr};
use palpate_scene::files::write_ply;
use std::{
    f64::consts::{PI, TAU},
    fs,
    path::PathBuf,
};

/// The longest edges (mm), about.
const EDGE_MM: f64 = 3.0;
/// What coordinates (mm) are rounded to, so that every machine writes the same file.
const ROUNDED_TO_MM: f64 = 1e-3;
/// Angles that a meridian is measured at.
const MERIDIAN: usize = 2000;
/// Fewest vertices of a ring.
const SMALLEST_RING: usize = 6;
/// Halvings of a ray: below a nanometre.
const HALVINGS: usize = 40;

/// Where the files go.
#[derive(Debug, Clone, Args)]
pub struct ShippedOptions {
    /// The folder that `heart-inner.ply` and `heart-outer.ply` are written to
    #[arg(long, default_value = "deploy/scenes/data")]
    out: PathBuf,
}

/// Writes both surfaces and says what they are.
///
/// # Errors
/// The folder cannot be made or written.
pub fn write(options: &ShippedOptions) -> Result<()> {
    let out = &options.out;
    fs::create_dir_all(out).into_diagnostic().wrap_err_with(|| format!("cannot make {}", out.display()))?;
    for (name, surface) in surfaces() {
        let path = out.join(name);
        write_ply(&path, &surface.vertices_mm, &surface.triangles).into_diagnostic()?;
        println!("{}: {} vertices, {} triangles", path.display(), surface.vertices_mm.len(), surface.triangles.len());
    }
    Ok(())
}

/// The two surfaces, open at the base, by the names of their files.
fn surfaces() -> [(&'static str, EvenSurface); 2] {
    let heart = Anatomy::mean();
    [
        ("heart-inner.ply", EvenSurface::of(&heart, |p| heart.cavity_m(p))),
        ("heart-outer.ply", EvenSurface::of(&heart, |p| heart.outside_m(p))),
    ]
}

/// A triangulated surface; triangles are counter-clockwise seen from where the field is positive.
struct EvenSurface {
    vertices_mm: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl EvenSurface {
    /// The zero surface of a field (m) that is negative around the heart's centre, below the base.
    fn of(heart: &Anatomy, field: impl Fn(DVec3) -> f64) -> Self {
        let rays = Rays { heart, field: &field };
        let (fractions, radii_m) = rays.rings();
        let mut surface = Self { vertices_mm: Vec::new(), triangles: Vec::new() };
        let mut above: Vec<u32> = Vec::new();
        for (number, (&fraction, radius_m)) in fractions.iter().zip(radii_m).enumerate() {
            let is_apex = number + 1 == fractions.len();
            let count =
                if is_apex { 1 } else { ((TAU * radius_m * 1e3 / EDGE_MM).round() as usize).max(SMALLEST_RING) };
            let first = surface.vertices_mm.len() as u32;
            // Every other ring is turned by half an edge.
            let turned = if number % 2 == 1 { 0.5 } else { 0.0 };
            surface.vertices_mm.extend((0..count).map(|vertex| {
                let around_rad = TAU * (vertex as f64 + turned) / count as f64;
                let place_mm = heart.on_saddle(rays.point_m(around_rad, fraction)) * 1e3;
                (place_mm / ROUNDED_TO_MM).round() * ROUNDED_TO_MM
            }));
            let ring: Vec<u32> = (first..first + count as u32).collect();
            surface.band(&above, &ring);
            above = ring;
        }
        surface
    }

    /// Adds the triangles between a ring and the next one towards the apex.
    fn band(&mut self, above: &[u32], below: &[u32]) {
        let Some(&start) = above.first() else { return };
        let at = |vertex: u32| self.vertices_mm[vertex as usize];
        let apart = |a: u32, b: u32| at(a).distance(at(b));
        let first = (0..below.len()).min_by(|&a, &b| apart(start, below[a]).total_cmp(&apart(start, below[b])));
        let of_above = |step: usize| above[step % above.len()];
        let of_below = |step: usize| below[(first.unwrap_or_default() + step) % below.len()];
        let mut triangles = Vec::new();
        let (mut a, mut b) = (0, 0);
        // The apex is one vertex, which the ring above it goes around.
        let steps_below = if below.len() == 1 { 0 } else { below.len() };
        while a < above.len() || b < steps_below {
            let along_above = apart(of_above(a + 1), of_below(b)) < apart(of_above(a), of_below(b + 1));
            if b == steps_below || (a < above.len() && along_above) {
                triangles.push([of_above(a), of_below(b), of_above(a + 1)]);
                a += 1;
            } else {
                triangles.push([of_above(a), of_below(b), of_below(b + 1)]);
                b += 1;
            }
        }
        self.triangles.extend(triangles);
    }
}

/// Rays from a heart's centre to the zero surface of a field.
struct Rays<'a, F> {
    heart: &'a Anatomy,
    field: &'a F,
}

impl<F: Fn(DVec3) -> f64> Rays<'_, F> {
    /// Where rings are, as fractions of the angle from the rim to the apex, and their radii (m): at equal arc lengths along one meridian.
    fn rings(&self) -> (Vec<f64>, Vec<f64>) {
        let samples: Vec<(f64, DVec3)> = (0..=MERIDIAN)
            .map(|sample| sample as f64 / MERIDIAN as f64)
            .map(|fraction| (fraction, self.point_m(0.0, fraction)))
            .collect();
        let lengths_mm: Vec<f64> = samples
            .windows(2)
            .scan(0.0, |length_mm, pair| {
                *length_mm += pair[0].1.distance(pair[1].1) * 1e3;
                Some(*length_mm)
            })
            .collect();
        let whole_mm = lengths_mm[MERIDIAN - 1];
        let count = (whole_mm / (EDGE_MM * 3_f64.sqrt() / 2.0)).round() as usize;
        let chosen = (0..=count).map(|ring| {
            let wanted_mm = whole_mm * ring as f64 / count as f64;
            // The sample behind the length; the rim is the first, the apex the last.
            let sample = if ring == count { MERIDIAN } else { lengths_mm.partition_point(|&l| l <= wanted_mm) };
            (samples[sample].0, samples[sample].1.truncate().length())
        });
        chosen.unzip()
    }

    /// The point (m) of the surface at an angle (rad) about the axis, and a fraction of the way from the rim to the apex.
    fn point_m(&self, around_rad: f64, fraction: f64) -> DVec3 {
        let side = DVec3::new(around_rad.cos(), around_rad.sin(), 0.0);
        let (centre_m, far_m) = self.heart.centre_and_reach_m();
        let rim_m = self.first_positive(DVec3::ZERO, side, far_m);
        let at_rim_rad = rim_m.atan2(-centre_m.z);
        let from_axis_rad = at_rim_rad + (PI - at_rim_rad) * fraction;
        let direction = side * from_axis_rad.sin() + DVec3::Z * from_axis_rad.cos();
        let away_m = self.first_positive(centre_m, direction, far_m);
        let mut found_m = centre_m + direction * away_m;
        if fraction == 0.0 {
            found_m.z = 0.0;
        }
        found_m
    }

    /// How far (m) along a ray the field changes its sign.
    fn first_positive(&self, from_m: DVec3, direction: DVec3, far_m: f64) -> f64 {
        let (mut inside_m, mut outside_m) = (0.0, far_m);
        for _ in 0..HALVINGS {
            let middle_m = 0.5 * (inside_m + outside_m);
            if (self.field)(from_m + direction * middle_m) < 0.0 {
                inside_m = middle_m;
            } else {
                outside_m = middle_m;
            }
        }
        0.5 * (inside_m + outside_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_scene::files::read_surface;
    use std::path::Path;

    /// The files in deploy are those that the command writes.
    #[test]
    fn the_shipped_surfaces_are_made_here() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../deploy/scenes/data"));
        for (name, made) in surfaces() {
            let shipped = read_surface(&folder.join(name)).unwrap();
            assert_eq!(shipped.triangles, made.triangles, "{name}");
            for (shipped_mm, made_mm) in shipped.vertices.iter().zip(&made.vertices_mm) {
                assert!(shipped_mm.distance(*made_mm) < 2.0 * ROUNDED_TO_MM, "{name}: {shipped_mm} {made_mm}");
            }
        }
    }

    /// Edges of the epicardium are of one length within a half, and no triangle of it is thin; on the steep sides of muscles, within, they are stretched to three times
    /// that.
    #[test]
    fn the_triangles_are_even() {
        // An equilateral triangle has 0.43 of its longest edge's square.
        for ((name, surface), (stretched, least_area)) in surfaces().into_iter().zip([(3.5, 0.05), (1.5, 0.2)]) {
            for corners in &surface.triangles {
                let [a, b, c] = corners.map(|vertex| surface.vertices_mm[vertex as usize]);
                let edges_mm = [a.distance(b), b.distance(c), c.distance(a)];
                let [shortest_mm, longest_mm] = [
                    edges_mm.iter().copied().fold(f64::INFINITY, f64::min),
                    edges_mm.iter().copied().fold(0.0, f64::max),
                ];
                let area_mm2 = 0.5 * (b - a).cross(c - a).length();
                assert!(shortest_mm > 0.4 * EDGE_MM && longest_mm < stretched * EDGE_MM, "{name}: {edges_mm:?} at {a}");
                assert!(area_mm2 > least_area * longest_mm * longest_mm, "{name}: {edges_mm:?} at {a}");
            }
        }
    }
}
