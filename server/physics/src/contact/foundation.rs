//! The pressure foundation under the surface: area contact whose stiffness belongs to the surface, not to its mesh.
//!
//! Every boundary triangle carries samples, fixed in the rest surface: its `n²` congruent parts' centroids, each with
//! weights ζ of the corners and the rest area `a = A₀/n²`. A tool of radius `R` penetrates a sample `y = Σ ζ_i x_i` by
//! `g = R − |y − c|`, `c` the point of its axis that is nearest to `y` (of a sphere, its centre), and meets the
//! pressure `p = k_f g`:
//! ```text
//! Φ = ½ Σ_s k_f a_s g_s²      f_i = −∂Φ/∂x_i = Σ_s ζ_si k_f a_s g_s (y_s − c)/|y_s − c|      f_tool = −Σ_i f_i
//! ```
//! as long as no triangle is stretched ([`super::stretched_area`]) and no sample deep ([`super::depth`]).
//! (`c` may move along the axis, but that changes no `g`: `y − c` is across the axis, or `c` an end of it). So contact
//! is conservative, and balances linear momentum exactly; angular too where the tool turns, with the torque
//! `Σ (y − c₀) × f` about its centre `c₀`. `k_f = α (λ + 2µ)/min(h, R)` with the size `h = √(2A₀)` of the surface
//! element: the foundation vanishes with the mesh (its compliance is first order in h), and its frequency scales like
//! the element's own. Where a node has much surface and little mass (a sharp edge or corner), `k_f` is lowered so that
//! the nodal part of the bound below stays under a fraction ([`FREQUENCY_FRACTION`]) of the body's own ω²_max: contact
//! never rules the time step alone.
//!
//! Where a smooth skin follows means of particles that are `h` apart, it gives way less under a small load than a solid does, by
//! what is finer than the means. The foundation makes up for that: it is then `k_f = α' E/(1 − ν²)/min(h, R)`, which with α' = 2.9
//! gives spheres on a block the force of a solid to 5 % (`docs/measurements/ripple.md`); and samples are `min(h, R)/3` apart, for a
//! light touch presses few of them.
//!
//! Smoothed tets give way as a solid does, and the foundation need not hide that they would be too stiff: `k_f = α'' E/(1 − ν²)/min(h, R)`
//! with α'' = 10, and up to four times ω²_max at a node. Under a contact that is smaller than an element it is what gives way in place of
//! the element; under a larger one it hardly shows (`docs/measurements/locking.md`).
//!
//! Bound of the frequency. With `w_s = (ζ_s, −1)` on (nodes, tool), `K = Σ k a_s w_s w_sᵀ ⊗ C_s`, `C_s ≤ I` (pressure
//! along the normal, friction springs of at most the same stiffness across it). A positive block matrix is bounded by
//! the sum of its diagonal blocks, and the nodal block by the diagonal of its row sums (Gershgorin, `Σ_j ζ_sj = 1`):
//! `K ≤ diag(Σ_s k a_s ζ_si) ⊕ Σ_s k a_s`. Only samples inside the tool count: of a sphere, at most `2πR²` of surface
//! on one node and `4πR²` in all; of a capsule of half length `L`, `R(R + L)` in place of `R²`. A tool that turns has
//! `Σ_s k a_s (y_s − c₀)²` besides: at `s` along the cylinder `s² + R²`, on the hemispheres at most `(L + R)²`. The
//! largest frequency of body and diagonal together comes from the same Lanczos iteration as the body's own.
use super::{SkinAtRest, SkinFollows, broad::Triangles};
use glam::DVec3;
use std::f64::consts::PI;

/// `α`, the foundation's stiffness over that of one layer of elements, `(λ + 2µ)/h` (`docs/adr/contact-foundation.md`).
const STIFFNESS_RATIO: f64 = 8.0;
/// `α'`, the foundation's stiffness under a smooth skin over `E/((1 − ν²) h)`.
const SMOOTH_STIFFNESS_RATIO: f64 = 2.9;
/// `α''`, the foundation's stiffness over `E/((1 − ν²) h)` on elements that give way as a solid does.
const TRUE_STIFFNESS_RATIO: f64 = 10.0;
/// Largest addition of contact to the squared frequency at a node, over the body's ω²_max.
const FREQUENCY_FRACTION: f64 = 1.5;
/// The same on elements that give way as a solid does.
const TRUE_FREQUENCY_FRACTION: f64 = 4.0;
/// Largest spacing of samples, over the tool's radius.
pub(super) const SPACING: f64 = 1.0 / 3.0;
/// Largest number of subdivisions of a triangle's edge; triangles that need more are refused.
pub(super) const MAX_LEVEL: usize = 48;
/// Depth, over R, in the flat foundation at which a coupling's force saturates.
pub(super) const SATURATION_DEPTH: f64 = 0.3;
/// Depth, over R, in a deep body of elastic material beyond which no tool is pressed.
const BEARS_RADII: f64 = 3.0;

/// Samples and stiffness of the surface as one tool meets it; indices are those of [`Triangles`].
#[derive(Debug, Clone)]
pub(super) struct Foundation {
    /// Subdivisions `n` of every triangle.
    level: Vec<u8>,
    /// Number of the first sample of every triangle.
    first_sample: Vec<u32>,
    /// `k_f a` (N/m) of each sample of a triangle.
    sample_stiffness_n_per_m: Vec<f64>,
    /// `k_f` (Pa/m) of every triangle.
    stiffness_pa_per_m: Vec<f64>,
    /// Area (m²) of every triangle at rest.
    rest_m2: Vec<f64>,
    /// Indentation modulus `E/(1 − ν²)` (Pa) of every triangle.
    indentation_modulus_pa: Vec<f64>,
    /// Number of all samples.
    pub(super) samples: usize,
    /// `k_f` (Pa/m) of a typical triangle of the softest material; the coupling's limits are derived from it.
    pub(super) typical_pa_per_m: f64,
}

/// The samples of one triangle and its stiffness.
#[derive(Debug, Clone, Copy)]
pub(super) struct TriangleSamples<'a> {
    /// Weights of the second and third corner.
    pub(super) weights: &'a [[f64; 2]],
    /// Number of the first sample.
    pub(super) first: u32,
    /// `k_f a` (N/m) of each sample.
    pub(super) stiffness_n_per_m: f64,
    /// `φ`, by which pressure is stiffer where the triangle is stretched (see [`super::stretched_area`]).
    pub(super) area_factor: f64,
    /// Area (m²) of the triangle at rest.
    pub(super) rest_m2: f64,
    /// `k_f` (Pa/m).
    pub(super) foundation_pa_per_m: f64,
    /// `E/(1 − ν²)` (Pa).
    pub(super) indentation_modulus_pa: f64,
}

/// Bounds of contact's stiffness for a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ContactBound {
    /// `Σ_s k a_s` (N/m).
    pub(super) n_per_m: f64,
    /// `Σ_s k a_s p_s²` (N m/rad).
    pub(super) nm_per_rad: f64,
}

/// Weights of the samples for every number of subdivisions.
#[derive(Debug, Clone, Default)]
pub(super) struct SampleTables {
    tables: Vec<Vec<[f64; 2]>>,
}

impl SampleTables {
    pub(super) fn new() -> Self {
        Self { tables: (0..=MAX_LEVEL).map(centroids).collect() }
    }
}

/// Returns the centroids of the `n²` congruent parts of a triangle, as weights of its second and third corner.
fn centroids(n: usize) -> Vec<[f64; 2]> {
    let at = |i: usize, j: usize, third: f64| [(i as f64 + third) / n as f64, (j as f64 + third) / n as f64];
    let row = |i: usize| {
        (0..n - i).flat_map(move |j| {
            let inverted = (i + j + 1 < n).then(|| at(i, j, 2.0 / 3.0));
            std::iter::once(at(i, j, 1.0 / 3.0)).chain(inverted)
        })
    };
    (0..n).flat_map(row).collect()
}

impl Foundation {
    pub(super) fn new(skin: &SkinAtRest<'_>, triangles: &Triangles, radius_m: f64, half_length_m: f64) -> Self {
        let count = triangles.len();
        let mut built = Self {
            level: Vec::with_capacity(count),
            first_sample: Vec::with_capacity(count),
            sample_stiffness_n_per_m: Vec::with_capacity(count),
            stiffness_pa_per_m: Vec::with_capacity(count),
            rest_m2: Vec::with_capacity(count),
            indentation_modulus_pa: Vec::with_capacity(count),
            samples: 0,
            typical_pa_per_m: 0.0,
        };
        let most = most_at_nodes(skin, triangles, 2.0 * quarter_m2(radius_m, half_length_m));
        let (mut softest_pa, mut ratio_area, mut total_m2) = (f64::INFINITY, 0.0, 0.0);
        for triangle in 0..count {
            let moduli = skin.moduli[triangles.surface_triangle[triangle] as usize];
            let corners = triangles.corners(triangle, skin.positions_m);
            let area_m2 = area_m2(corners);
            // k_f = α (λ + 2µ)/min(h, R), or of E/(1 − ν²) in place of λ + 2µ; and no more than any of its nodes can bear
            let size_m = (2.0 * area_m2).sqrt();
            let wanted = match skin.follows {
                SkinFollows::StiffElements => STIFFNESS_RATIO * moduli.p_wave_pa / size_m.min(radius_m),
                SkinFollows::TrueElements => TRUE_STIFFNESS_RATIO * moduli.indentation_pa / size_m.min(radius_m),
                SkinFollows::Means { apart_m } => {
                    SMOOTH_STIFFNESS_RATIO * moduli.indentation_pa / apart_m.min(radius_m)
                }
            };
            let k_f = triangles.nodes[triangle].iter().map(|&n| most[n as usize]).fold(wanted, f64::min);
            let [a, b, c] = corners;
            let longest_m = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let apart_m = SPACING * skin.follows.apart_m().unwrap_or(radius_m).min(radius_m);
            let n = ((longest_m / apart_m).ceil() as usize).clamp(1, MAX_LEVEL);
            built.level.push(n as u8);
            built.first_sample.push(built.samples as u32);
            built.sample_stiffness_n_per_m.push(k_f * area_m2 / (n * n) as f64);
            built.stiffness_pa_per_m.push(k_f);
            built.rest_m2.push(area_m2);
            built.indentation_modulus_pa.push(moduli.indentation_pa);
            built.samples += n * n;
            softest_pa = softest_pa.min(moduli.p_wave_pa);
            ratio_area += k_f / moduli.p_wave_pa * area_m2;
            total_m2 += area_m2;
        }
        built.typical_pa_per_m = softest_pa * ratio_area / total_m2;
        built
    }

    pub(super) fn of<'a>(&self, triangle: usize, tables: &'a SampleTables) -> TriangleSamples<'a> {
        TriangleSamples {
            weights: &tables.tables[self.level[triangle] as usize],
            first: self.first_sample[triangle],
            stiffness_n_per_m: self.sample_stiffness_n_per_m[triangle],
            area_factor: 1.0,
            rest_m2: self.rest_m2[triangle],
            foundation_pa_per_m: self.stiffness_pa_per_m[triangle],
            indentation_modulus_pa: self.indentation_modulus_pa[triangle],
        }
    }

    /// Returns the triangle of a sample, and the number after the triangle's last sample.
    pub(super) fn triangle_of(&self, sample: u32) -> (usize, u32) {
        let next = self.first_sample.partition_point(|&first| first <= sample);
        (next - 1, self.first_sample.get(next).copied().unwrap_or(self.samples as u32))
    }

    /// Returns the force (N) that presses a sphere to depth `d` into a flat foundation:
    /// `∫ k_f (d − r²/2R) dA = π k_f R d²`.
    pub(super) fn flat_force_n(&self, radius_m: f64, depth_m: f64) -> f64 {
        PI * self.typical_pa_per_m * radius_m * depth_m * depth_m
    }

    /// Returns the most force (N) that a tool of this radius may press the surface with: what presses a sphere
    /// [`SATURATION_DEPTH`]·R into the flat foundation, and no more than what presses it [`BEARS_RADII`]·R deep into the
    /// stiffest part of the body, `4/3 E/(1 − ν²) √R d^{3/2}` (Hertz). On fine triangles the foundation is so much stiffer than
    /// the body that it would bear what turns the body inside out.
    pub(super) fn bears_n(&self, radius_m: f64) -> f64 {
        let stiffest_pa = self.indentation_modulus_pa.iter().copied().fold(0.0, f64::max);
        let of_body_n = 4.0 / 3.0 * stiffest_pa * radius_m * radius_m * BEARS_RADII.powf(1.5);
        self.flat_force_n(radius_m, SATURATION_DEPTH * radius_m).min(of_body_n)
    }

    /// Returns the mean of `E/(1 − ν²)` (Pa) behind the triangles; 0 without any.
    pub(super) fn mean_indentation_modulus_pa(&self) -> f64 {
        self.indentation_modulus_pa.iter().sum::<f64>() / self.indentation_modulus_pa.len().max(1) as f64
    }

    /// Returns the row sums `Σ_s k a_s ζ_si` (N/m) over the samples that one tool can touch around each node, and the
    /// bounds of all that it can touch at once; see the module's documentation.
    pub(super) fn row_sums_n_per_m(
        &self,
        triangles: &Triangles,
        nodes: usize,
        radius_m: f64,
        half_length_m: f64,
    ) -> (Vec<f64>, ContactBound) {
        let quarter_m2 = quarter_m2(radius_m, half_length_m);
        let (mut nodal, mut stiffest_at) = (vec![0.0_f64; nodes], vec![0.0_f64; nodes]);
        let (mut total, mut stiffest) = (0.0, 0.0_f64);
        for (triangle, nodes) in triangles.nodes.iter().enumerate() {
            let k_f = self.stiffness_pa_per_m[triangle];
            let n = f64::from(self.level[triangle]);
            let whole = self.sample_stiffness_n_per_m[triangle] * n * n;
            total += whole;
            stiffest = stiffest.max(k_f);
            for &node in nodes {
                nodal[node as usize] += whole / 3.0;
                stiffest_at[node as usize] = stiffest_at[node as usize].max(k_f);
            }
        }
        for (sum, k_f) in nodal.iter_mut().zip(&stiffest_at) {
            *sum = sum.min(2.0 * quarter_m2 * k_f);
        }
        let square = |a: f64| a * a;
        let reach_sq = square(half_length_m + radius_m);
        // ∫ p² dA over cylinder and hemispheres
        let cylinder_m4 = PI * radius_m * half_length_m * (square(half_length_m) / 3.0 + square(radius_m));
        let moment_m4 = 4.0 * (cylinder_m4 + PI * square(radius_m) * reach_sq);
        let bound = ContactBound {
            n_per_m: f64::min(total, 4.0 * quarter_m2 * stiffest),
            nm_per_rad: f64::min(total * reach_sq, moment_m4 * stiffest),
        };
        (nodal, bound)
    }
}

/// Returns a quarter of the surface of a tool (m²).
fn quarter_m2(radius_m: f64, half_length_m: f64) -> f64 {
    PI * radius_m * (radius_m + half_length_m)
}

fn area_m2([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// Returns the largest `k_f` (Pa/m) that each node can bear: `k_f min(A_i, 2πR²)/m_i ≤ fraction · ω²_max`,
/// with its third `A_i` of the triangles around it, and the area `touched_m2` (m²) that a tool can touch at once in
/// place of `2πR²`.
fn most_at_nodes(skin: &SkinAtRest<'_>, triangles: &Triangles, touched_m2: f64) -> Vec<f64> {
    let mut area = vec![0.0; skin.mass_kg.len()];
    for (triangle, nodes) in triangles.nodes.iter().enumerate() {
        let third = area_m2(triangles.corners(triangle, skin.positions_m)) / 3.0;
        for &node in nodes {
            area[node as usize] += third;
        }
    }
    let fraction = match skin.follows {
        SkinFollows::TrueElements => TRUE_FREQUENCY_FRACTION,
        SkinFollows::StiffElements | SkinFollows::Means { .. } => FREQUENCY_FRACTION,
    };
    let most = |(area, mass): (&f64, &f64)| fraction * skin.frequency_sq() * mass / area.min(touched_m2);
    area.iter().zip(skin.mass_kg).map(most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_integrate_linear_functions_exactly() {
        for n in 1..=12 {
            let table = centroids(n);
            assert_eq!(table.len(), n * n);
            let mean = |corner: usize| table.iter().map(|w| w[corner]).sum::<f64>() / (n * n) as f64;
            assert!((mean(0) - 1.0 / 3.0).abs() < 1e-14 && (mean(1) - 1.0 / 3.0).abs() < 1e-14, "n = {n}");
            assert!(table.iter().all(|w| w[0] > 0.0 && w[1] > 0.0 && w[0] + w[1] < 1.0));
        }
    }

    #[test]
    fn quadratic_error_falls_with_the_square_of_the_spacing() {
        // ∫ ξ² over the unit triangle's area fraction is 1/6.
        let error = |n: usize| centroids(n).iter().map(|w| w[0] * w[0]).sum::<f64>() / (n * n) as f64 - 1.0 / 6.0;
        let order = (error(4) / error(8)).log2();
        assert!((order - 2.0).abs() < 0.05, "{order}");
    }
}
