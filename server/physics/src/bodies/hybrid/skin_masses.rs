//! What bears contact at the vertices of the skin.
use super::body::HybridBody;

impl HybridBody {
    /// Returns the masses (kg) that contact may take for those of the skin's vertices, if it is cut into these triangles:
    /// with the area `A_v` of a vertex, `A_v min_p m_p/A_p` over its particles, `A_p = Σ_v w_vp A_v`. Each of a vertex's
    /// particles then bears what a foundation does to the vertex per area.
    pub(crate) fn vertex_masses_kg(&self, triangles: &[[u32; 3]]) -> Vec<f64> {
        let mut vertex_m2 = vec![0.0; self.vertex_points.len()];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|vertex| self.skin_rest_m()[vertex as usize]);
            let third = (b - a).cross(c - a).length() / 6.0;
            for &vertex in triangle {
                vertex_m2[vertex as usize] += third;
            }
        }
        let vertices = 0..self.vertex_points.len() as u32;
        let points = || vertices.clone().map(|vertex| self.carriers_of_vertex(vertex)).zip(&vertex_m2);
        let mut particle_m2 = vec![0.0; self.partition.particle_count()];
        for (carriers, area_m2) in points() {
            for &(particle, weight) in carriers {
                particle_m2[particle as usize] += weight.max(0.0) * area_m2;
            }
        }
        let per_area = |particle: u32| self.masses.particle_kg[particle as usize] / particle_m2[particle as usize];
        let of_vertex = |(carriers, area_m2): (&[(u32, f64)], &f64)| {
            let carriers = carriers.iter().filter(|(_, weight)| *weight > 1e-6);
            area_m2 * carriers.map(|(particle, _)| per_area(*particle)).fold(f64::INFINITY, f64::min)
        };
        points().map(of_vertex).collect()
    }

    /// Returns the masses (kg) by which what is pressed at the skin's vertices is borne where neighbours are pressed alike:
    /// `min_p m_p/Σ_v w_vp` over the particles of each, the sum over the vertices that may be pressed. Unlike [`Self::vertex_masses_kg`] it knows no areas: a vertex of
    /// small triangles is borne by the same particles as its neighbours.
    pub(crate) fn bearing_masses_kg(&self, vertices: &[u32]) -> Vec<f64> {
        let points = || (0..self.vertex_points.len() as u32).map(|vertex| self.carriers_of_vertex(vertex));
        let mut shares = vec![0.0; self.partition.particle_count()];
        for &vertex in vertices {
            for &(particle, weight) in self.carriers_of_vertex(vertex) {
                shares[particle as usize] += weight.max(0.0);
            }
        }
        let of_vertex = |carriers: &[(u32, f64)]| {
            let carriers = carriers.iter().filter(|(_, weight)| *weight > 1e-6);
            let each = carriers.map(|(p, _)| self.masses.particle_kg[*p as usize] / shares[*p as usize]);
            each.fold(f64::INFINITY, f64::min)
        };
        points().map(of_vertex).collect()
    }

    /// Returns the springs (N/m) at vertices of the skin as their particles feel them: the row sums of
    /// `Σ_v k_v w_v w_vᵀ`.
    pub(crate) fn particle_springs_n_per_m(&self, of_vertices_n_per_m: &[f64]) -> Vec<f64> {
        let mut springs = vec![0.0; self.partition.particle_count()];
        for ((vertex, point), stiffness) in (0..).zip(&self.vertex_points).zip(of_vertices_n_per_m) {
            let carriers = self.carriers_of_vertex(vertex);
            let of_carriers = || carriers.iter().map(|(_, weight)| weight.abs()).sum();
            let amplification = if self.particles.smooth_skin { of_carriers() } else { point.amplification() };
            for &(particle, weight) in carriers {
                springs[particle as usize] += stiffness * weight.abs() * amplification;
            }
        }
        springs
    }
}
