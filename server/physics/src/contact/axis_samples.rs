//! Samples of a tool's axis, about which bodies are fine that are coarse elsewhere: a sphere's centre, several points
//! along a capsule.
use super::{
    broad::Skin,
    nearest::{Known, deepest_m, nearest_vertex},
    tool::{ToolSpec, ToolState},
};
use glam::DVec3;

/// Largest number of samples of a tool's axis; on the longest capsules samples are farther apart than wanted.
const MOST_SAMPLES: usize = 64;

/// A sample of a tool's axis, and the piece of the axis that is nearer to it than to other samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AxisSample {
    /// Position (m) of the sample.
    at_m: DVec3,
    /// Speed (m/s) of the sample.
    pub(crate) speed_m_per_s: f64,
    /// Where (m) the tool is deepest in the body about the sample, if it touches the body.
    deepest_m: Option<DVec3>,
    /// How far (m) that piece reaches to either side; 0 for a single sample.
    half_piece_m: f64,
    radius_m: f64,
}

/// What of a skin is near to an axis sample.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Near {
    /// The point (m) from which it was sought.
    pub(crate) from_m: DVec3,
    /// The vertex nearest to that point, and its distance (m).
    pub(crate) vertex: Option<(u32, f64)>,
    /// Gap (m) between tool and skin, 0 where they touch.
    pub(crate) gap_m: f64,
}

impl ToolSpec {
    /// Returns the number of samples of its axis: as many as make them no farther than `apart_m` from one another, and
    /// at most [`MOST_SAMPLES`].
    pub(crate) fn axis_sample_count(&self, apart_m: f64) -> usize {
        ((2.0 * self.shape.half_length_m() / apart_m).ceil() as usize).saturating_add(1).min(MOST_SAMPLES)
    }
}

impl ToolState {
    /// Returns this number of samples of its axis.
    pub(crate) fn axis_samples(&self, spec: &ToolSpec, count: usize) -> impl Iterator<Item = AxisSample> + '_ {
        let (radius_m, half_m) = (spec.radius_m, spec.shape.axis(self.centre_m, self.orientation).half_m);
        let half_piece_m = if count > 1 { half_m.length() / (count - 1) as f64 } else { 0.0 };
        (0..count).map(move |number| {
            let arm_m = if count > 1 { half_m * (2.0 * number as f64 / (count - 1) as f64 - 1.0) } else { DVec3::ZERO };
            let at_m = self.centre_m + arm_m;
            AxisSample {
                at_m,
                // v + ω × r
                speed_m_per_s: (self.velocity_m_per_s + self.angular_velocity_rad_per_s.cross(arm_m)).length(),
                deepest_m: deepest_m(at_m, radius_m, self.contact_force_n),
                half_piece_m,
                radius_m,
            }
        })
    }
}

impl AxisSample {
    /// Finds the vertex of a skin, of which a query has begun, that is nearest to where the tool is deepest in it here,
    /// or, where the tool does not touch it, to this sample. Vertices are sought within a gap of `2 near_m`, or
    /// `near_m + cover_m` of a tool that touches: no point of the skin is farther than `cover_m` from a vertex.
    ///
    /// A vertex at distance `d` from the middle of a piece that reaches `s` to either side is no nearer to the piece
    /// than `√(d² − s²)`, and the vertex nearest to the middle bounds the others: no piece that is near is missed, and
    /// some are found too early.
    pub(crate) fn look(&self, skin: &impl Skin, (near_m, cover_m): (f64, f64), known: Known<'_>) -> Near {
        let s = self.half_piece_m;
        // A tool that touches has a vertex within `cover_m` of where it does; the rest is a margin for a stretched
        // skin.
        let touching_m = near_m + cover_m;
        let reach_m = if self.deepest_m.is_some() { touching_m.max(2.0 * near_m) } else { 2.0 * near_m };
        let within_m = (self.radius_m + reach_m).hypot(s);
        let from = |from_m: DVec3| nearest_vertex(skin, from_m, within_m, known);
        let gap_m = |d: f64| if s > 0.0 { (d * d - s * s).max(0.0).sqrt() } else { d } - self.radius_m;
        let beside = || {
            let vertex = from(self.at_m);
            Near { from_m: self.at_m, vertex, gap_m: vertex.map_or(f64::INFINITY, |(_, distance_m)| gap_m(distance_m)) }
        };
        let Some(deepest_m) = self.deepest_m else { return beside() };
        if s == 0.0 {
            return Near { from_m: deepest_m, vertex: from(deepest_m), gap_m: 0.0 };
        }
        let near = beside();
        if near.gap_m >= touching_m {
            // The tool touches elsewhere only.
            return near;
        }
        // If a tool is levered between two walls, the force of both may point away from the one that is here.
        let is_here = |vertex: &(u32, f64)| gap_m(skin.position_m(vertex.0).distance(self.at_m)) < touching_m;
        match from(deepest_m).filter(is_here) {
            Some(vertex) => Near { from_m: deepest_m, vertex: Some(vertex), gap_m: 0.0 },
            None => Near { gap_m: 0.0, ..near },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{Coupling, ToolShape, broad::CLUSTER},
        *,
    };
    use glam::DQuat;
    use proptest::prelude::*;

    /// A skin of vertices, with a cluster for each.
    struct Cloud {
        at_m: Vec<DVec3>,
        ids: Vec<u32>,
    }

    impl Skin for Cloud {
        fn begin(&mut self) {}

        fn group_distance_m(&self, _: usize, _: DVec3) -> f64 {
            0.0
        }

        fn cluster_distance_m(&self, cluster: usize, from_m: DVec3) -> f64 {
            0.9 * self.at_m[cluster].distance(from_m)
        }

        fn clusters(&self) -> usize {
            self.at_m.len()
        }

        fn vertices(&self, cluster: usize) -> &[u32] {
            &self.ids[cluster..=cluster]
        }

        fn position_m(&self, vertex: u32) -> DVec3 {
            self.at_m[vertex as usize]
        }
    }

    /// One end of a shaft is pushed up by what is beneath it, the other one, less, down by what is above: the sum of
    /// the forces points away from the latter, to a wall that is far.
    #[test]
    fn what_a_levered_tool_touches_is_where_it_touches() {
        let spec = capsule(0.012);
        let at_m = [DVec3::new(-0.012, -0.005, 0.0), DVec3::new(0.012, 0.005, 0.0), DVec3::new(0.012, -0.013, 0.0)];
        let cloud = Cloud { at_m: at_m.to_vec(), ids: vec![0, 1, 2] };
        let tool = ToolState { centre_m: DVec3::ZERO, contact_force_n: 0.1 * DVec3::Y, ..ToolState::at_start(&spec) };
        let looks: Vec<Near> =
            tool.axis_samples(&spec, 5).map(|sample| sample.look(&cloud, (3e-3, 1e-3), Known::default())).collect();
        let found = [looks[0], looks[4]].map(|near| (near.vertex.map(|(vertex, _)| vertex), near.gap_m));
        assert_eq!(found, [(Some(0), 0.0), (Some(1), 0.0)]);
    }

    fn within(half_m: f64) -> impl Strategy<Value = DVec3> {
        [-half_m..half_m, -half_m..half_m, -half_m..half_m].prop_map(DVec3::from)
    }

    proptest! {
        /// The samples' gaps are compared with the distance of every vertex from the whole axis.
        #[test]
        fn what_is_near_the_axis_is_near_a_sample(
            at_m in prop::collection::vec(within(0.04), 1..3 * CLUSTER),
            axis in within(1.0),
            half_length_m in 0.0..0.03,
            apart_m in 1e-3..0.05,
            near_m in 1e-3..4e-3,
            cover_m in 0.0..3e-3,
            force_n in prop::option::of(within(1.0)),
        ) {
            let spec = capsule(half_length_m);
            let axis = axis.try_normalize().unwrap_or(DVec3::X);
            let orientation = DQuat::from_rotation_arc(DVec3::Z, axis);
            let contact_force_n = force_n.unwrap_or_default();
            let tool = ToolState { centre_m: DVec3::ZERO, orientation, contact_force_n, ..ToolState::at_start(&spec) };
            let from_axis_m = |p: DVec3| p.distance(axis * p.dot(axis).clamp(-half_length_m, half_length_m));
            let gap_m = at_m.iter().map(|p| from_axis_m(*p)).fold(f64::INFINITY, f64::min) - spec.radius_m;
            let cloud = Cloud { ids: (0..at_m.len() as u32).collect(), at_m };
            let count = spec.axis_sample_count(apart_m);
            let samples = tool.axis_samples(&spec, count);
            let looks: Vec<Near> =
                samples.map(|sample| sample.look(&cloud, (near_m, cover_m), Known::default())).collect();
            // Whatever vertex is told to be near, the same are found.
            for vertex in 0..cloud.at_m.len() as u32 {
                let known = Known { vertex: Some(vertex), fitted: None };
                let again = tool.axis_samples(&spec, count).map(|sample| sample.look(&cloud, (near_m, cover_m), known));
                prop_assert!(again.zip(&looks).all(|(again, look)| (again.vertex, again.gap_m) == (look.vertex, look.gap_m)));
            }
            let least_m = looks.iter().map(|near| near.gap_m).fold(f64::INFINITY, f64::min);
            let touches = contact_force_n != DVec3::ZERO;
            let reach_m = if touches { (near_m + cover_m).max(2.0 * near_m) } else { 2.0 * near_m };
            prop_assert!(least_m <= gap_m.max(0.0) + 1e-12 || gap_m > reach_m - 1e-12, "{least_m} {gap_m}");
            if count > 1 && touches && gap_m < near_m + cover_m - 1e-12 {
                prop_assert!(looks.iter().any(|near| near.vertex.is_some() && near.gap_m == 0.0), "{looks:?}");
            }
            for (vertex, distance_m, from_m) in looks.iter().filter_map(|n| n.vertex.map(|(v, d)| (v, d, n.from_m))) {
                prop_assert_eq!(cloud.at_m[vertex as usize].distance(from_m), distance_m);
            }
        }
    }

    fn capsule(half_length_m: f64) -> ToolSpec {
        ToolSpec {
            name: "shaft".into(),
            shape: ToolShape::capsule(Coupling::Rigid, 0.005, half_length_m, DVec3::X),
            radius_m: 0.005,
            coupling: Coupling::Rigid,
            friction_coefficient: 0.0,
            start_position_m: DVec3::Y,
        }
    }

    #[test]
    fn a_sphere_has_its_centre_and_a_capsule_samples_from_end_to_end() {
        let sphere = ToolSpec { shape: ToolShape::Sphere, ..capsule(0.0) };
        for apart_m in [1e-9, 1.0, f64::INFINITY] {
            assert_eq!(sphere.axis_sample_count(apart_m), 1);
        }
        let spec = capsule(0.01);
        assert_eq!(
            [0.02, 0.0199, 0.005, 1e-12, f64::INFINITY].map(|apart_m| spec.axis_sample_count(apart_m)),
            [2, 3, 5, 64, 1]
        );
        assert_eq!(capsule(1e300).axis_sample_count(1e-300), 64);
        let tool = ToolState {
            velocity_m_per_s: DVec3::Y,
            angular_velocity_rad_per_s: DVec3::Z * 100.0,
            ..ToolState::at_start(&spec)
        };
        let axis_samples: Vec<AxisSample> = tool.axis_samples(&spec, 3).collect();
        for (sample, x_m) in axis_samples.iter().zip([-0.01, 0.0, 0.01]) {
            assert!(sample.at_m.distance(DVec3::new(x_m, 1.0, 0.0)) < 1e-15);
            assert!((sample.speed_m_per_s - (1.0 + 100.0 * x_m).abs()).abs() < 1e-12);
        }
        assert_eq!(tool.axis_samples(&spec, 1).next().unwrap().at_m, DVec3::Y);
    }
}
