//! The pressure foundation under the surface: area contact whose stiffness belongs to the surface, not to its mesh.
//!
//! Every boundary triangle carries samples, fixed in the rest surface: its `n²` congruent parts' centroids, each with
//! weights ζ of the corners and the rest area `a = A₀/n²`. A sphere of centre `c` and radius `R` penetrates a sample
//! `y = Σ ζ_i x_i` by `g = R − |y − c|`, and meets the pressure `p = k_f g`:
//! ```text
//! Φ = ½ Σ_s k_f a_s g_s²      f_i = −∂Φ/∂x_i = Σ_s ζ_si k_f a_s g_s (y_s − c)/|y_s − c|      f_tool = −Σ_i f_i
//! ```
//! so contact is conservative and balances linear momentum exactly. `k_f = α (λ + 2µ)/min(h, R)` with the size `h = √(2A₀)`
//! of the surface element: the foundation vanishes with the mesh (its compliance is first order in h), and its frequency
//! scales like the element's own.
//!
//! Bound of the frequency that contact adds. With `w_s = (ζ_s, −1)` on (nodes, tool), `K = Σ k a_s w_s w_sᵀ ⊗ C_s`, `C_s ≤ I`
//! (pressure along the normal, friction springs of at most the same stiffness across it). A positive block matrix is bounded
//! by the sum of its diagonal blocks; the nodal block by its row sums (Gershgorin, `Σ_j ζ_sj = 1`):
//! `λ_max(M⁻¹K) ≤ max_i Σ_s k a_s ζ_si / m_i + Σ_s k a_s / m_tool`. Only samples inside the sphere count: at most `2πR²` of
//! surface on one node and `4πR²` in all.
use super::{SurfaceModuli, ToolSpec, broad::Triangles};
use glam::DVec3;
use std::f64::consts::PI;

/// α: foundation stiffness over that of one element layer, `(λ + 2µ)/h`. See `docs/adr` on contact.
pub(super) const STIFFNESS_RATIO: f64 = 8.0;
/// Sample spacing wanted, as a fraction of the tool's radius.
const SPACING: f64 = 1.0 / 3.0;
/// Most subdivisions of a triangle's edge.
const MAX_LEVEL: usize = 48;

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
    /// Indentation modulus `E/(1 − ν²)` (Pa) of every triangle.
    indentation_modulus_pa: Vec<f64>,
    /// All samples.
    pub(super) samples: usize,
}

/// A triangle as the foundation sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct TriangleSamples<'a> {
    /// Weights of the second and third corner.
    pub(super) weights: &'a [[f64; 2]],
    /// Number of the first sample.
    pub(super) first: u32,
    /// `k_f a` (N/m) of each.
    pub(super) stiffness_n_per_m: f64,
    /// `k_f` (Pa/m).
    pub(super) foundation_pa_per_m: f64,
    /// `E/(1 − ν²)` (Pa).
    pub(super) indentation_modulus_pa: f64,
}

/// Weights of the samples for every subdivision in use.
#[derive(Debug, Clone, Default)]
pub(super) struct SampleTables {
    tables: Vec<Vec<[f64; 2]>>,
}

impl SampleTables {
    pub(super) fn new() -> Self {
        Self { tables: (0..=MAX_LEVEL).map(centroids).collect() }
    }
}

/// Centroids of the `n²` congruent parts of a triangle, as weights of its second and third corner.
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
    pub(super) fn new(
        triangles: &Triangles,
        rest_positions_m: &[DVec3],
        moduli: &[SurfaceModuli],
        radius_m: f64,
    ) -> Self {
        let count = triangles.len();
        let mut built = Self {
            level: Vec::with_capacity(count),
            first_sample: Vec::with_capacity(count),
            sample_stiffness_n_per_m: Vec::with_capacity(count),
            stiffness_pa_per_m: Vec::with_capacity(count),
            indentation_modulus_pa: Vec::with_capacity(count),
            samples: 0,
        };
        for triangle in 0..count {
            let [a, b, c] = triangles.corners(triangle, rest_positions_m);
            let area_m2 = 0.5 * (b - a).cross(c - a).length();
            let longest_m = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let n = ((longest_m / (SPACING * radius_m)).ceil() as usize).clamp(1, MAX_LEVEL);
            let moduli = moduli[triangles.surface_triangle[triangle] as usize];
            // k_f = α (λ + 2µ) / min(h, R)
            let k_f = STIFFNESS_RATIO * moduli.p_wave_pa / (2.0 * area_m2).sqrt().min(radius_m);
            built.level.push(n as u8);
            built.first_sample.push(built.samples as u32);
            built.sample_stiffness_n_per_m.push(k_f * area_m2 / (n * n) as f64);
            built.stiffness_pa_per_m.push(k_f);
            built.indentation_modulus_pa.push(moduli.indentation_pa);
            built.samples += n * n;
        }
        built
    }

    pub(super) fn of<'a>(&self, triangle: usize, tables: &'a SampleTables) -> TriangleSamples<'a> {
        TriangleSamples {
            weights: &tables.tables[self.level[triangle] as usize],
            first: self.first_sample[triangle],
            stiffness_n_per_m: self.sample_stiffness_n_per_m[triangle],
            foundation_pa_per_m: self.stiffness_pa_per_m[triangle],
            indentation_modulus_pa: self.indentation_modulus_pa[triangle],
        }
    }

    /// Smallest `k_f` (Pa/m) of the surface.
    pub(super) fn softest_pa_per_m(&self) -> f64 {
        self.stiffness_pa_per_m.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Force (N) that presses a sphere to depth `d` into a flat foundation: `∫ k_f (d − r²/2R) dA = π k_f R d²`.
    pub(super) fn flat_force_n(&self, radius_m: f64, depth_m: f64) -> f64 {
        PI * self.softest_pa_per_m() * radius_m * depth_m * depth_m
    }

    /// Bound (rad²/s²) of the square of the frequency this tool's contact adds; see the module's documentation.
    pub(super) fn frequency_bound_sq(&self, triangles: &Triangles, mass_kg: &[f64], tool: &ToolSpec) -> f64 {
        let ball_m2 = PI * tool.radius_m * tool.radius_m;
        let mut nodal_n_per_m = vec![0.0_f64; mass_kg.len()];
        let mut nodal_k_f = vec![0.0_f64; mass_kg.len()];
        let (mut total_n_per_m, mut stiffest) = (0.0, 0.0_f64);
        for (triangle, nodes) in triangles.nodes.iter().enumerate() {
            let k_f = self.stiffness_pa_per_m[triangle];
            let n = f64::from(self.level[triangle]);
            let whole = self.sample_stiffness_n_per_m[triangle] * n * n;
            total_n_per_m += whole;
            stiffest = stiffest.max(k_f);
            for &node in nodes {
                nodal_n_per_m[node as usize] += whole / 3.0;
                nodal_k_f[node as usize] = nodal_k_f[node as usize].max(k_f);
            }
        }
        let nodal = (0..mass_kg.len())
            .map(|node| nodal_n_per_m[node].min(2.0 * ball_m2 * nodal_k_f[node]) / mass_kg[node])
            .fold(0.0, f64::max);
        nodal + tool.coupling.frequency_bound_sq(total_n_per_m.min(4.0 * ball_m2 * stiffest))
    }
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
