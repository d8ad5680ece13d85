//! Places along a tool, about which bodies are fine that are coarse where no tool is: a sphere's is its centre, a capsule has several along its axis.
use super::{
    broad::{ClusterBox, Skin},
    nearest::{deepest_m, nearest_vertex},
    tool::{ToolSpec, ToolState},
};
use glam::DVec3;

/// A tool has no more: the longest capsules are fine at places only that are farther apart.
const MOST: usize = 64;

/// A place along a tool, and the piece of its axis that is nearer to it than to others.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// Where it is (m).
    at_m: DVec3,
    /// Its speed (m/s).
    pub(crate) speed_m_per_s: f64,
    /// Where the tool is deepest in the body there (m), if it touches the body there.
    deepest_m: Option<DVec3>,
    /// How far (m) that piece reaches; nothing of the only place.
    half_piece_m: f64,
    radius_m: f64,
}

/// What of a skin is near to a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Near {
    /// From where it was sought (m).
    pub(crate) from_m: DVec3,
    /// The nearest vertex, and how far (m) it is from there.
    pub(crate) vertex: Option<(u32, f64)>,
    /// Gap between tool and skin (m), 0 where they touch.
    pub(crate) gap_m: f64,
}

impl ToolSpec {
    /// How many places it has: as many as make them no farther than `apart_m` from one another, and at most 64.
    pub(crate) fn place_count(&self, apart_m: f64) -> usize {
        ((2.0 * self.shape.half_length_m() / apart_m).ceil() as usize).saturating_add(1).min(MOST)
    }
}

impl ToolState {
    /// So many places along it.
    pub(crate) fn places(&self, spec: &ToolSpec, count: usize) -> impl Iterator<Item = Place> + '_ {
        let (radius_m, half_m) = (spec.radius_m, spec.shape.axis(self.centre_m, self.orientation).half_m);
        let half_piece_m = if count > 1 { half_m.length() / (count - 1) as f64 } else { 0.0 };
        (0..count).map(move |number| {
            let arm_m = if count > 1 { half_m * (2.0 * number as f64 / (count - 1) as f64 - 1.0) } else { DVec3::ZERO };
            let at_m = self.centre_m + arm_m;
            Place {
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

impl Place {
    /// The vertex of a skin nearest to where the tool is deepest in it here, or, where it does not touch it, to this place; within a gap of `2 near_m`. `fitted` are
    /// contact's boxes and its travel (m), where they are of use.
    ///
    /// Of a piece that reaches `s` to either side, a vertex that is `d` from its middle is no nearer than `√(d² − s²)`, and the nearest to the middle bounds the others:
    /// no piece that is near goes unseen, and some are seen too soon.
    pub(crate) fn look(&self, skin: &mut impl Skin, near_m: f64, fitted: Option<(&[ClusterBox], f64)>) -> Near {
        let s = self.half_piece_m;
        let within_m = (self.radius_m + 2.0 * near_m).hypot(s);
        let mut from = |from_m: DVec3| nearest_vertex(skin, from_m, within_m, fitted);
        let beside = |vertex: Option<(u32, f64)>| {
            let nearest_m = |d: f64| if s > 0.0 { (d * d - s * s).max(0.0).sqrt() } else { d };
            let gap_m = vertex.map_or(f64::INFINITY, |(_, distance_m)| nearest_m(distance_m) - self.radius_m);
            Near { from_m: self.at_m, vertex, gap_m }
        };
        let touching = |from_m: DVec3, vertex: Option<(u32, f64)>| Near { from_m, vertex, gap_m: 0.0 };
        match self.deepest_m {
            None => beside(from(self.at_m)),
            Some(deepest_m) if s == 0.0 => touching(deepest_m, from(deepest_m)),
            // It may touch elsewhere only.
            Some(deepest_m) => match beside(from(self.at_m)) {
                near if near.gap_m < near_m => touching(deepest_m, from(deepest_m).or(near.vertex)),
                apart => apart,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{Coupling, ToolShape},
        *,
    };

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
    fn a_sphere_has_its_centre_and_a_capsule_places_from_end_to_end() {
        let sphere = ToolSpec { shape: ToolShape::Sphere, ..capsule(0.0) };
        for apart_m in [1e-9, 1.0, f64::INFINITY] {
            assert_eq!(sphere.place_count(apart_m), 1);
        }
        let spec = capsule(0.01);
        assert_eq!(
            [0.02, 0.0199, 0.005, 1e-12, f64::INFINITY].map(|apart_m| spec.place_count(apart_m)),
            [2, 3, 5, 64, 1]
        );
        assert_eq!(capsule(1e300).place_count(1e-300), 64);
        let tool = ToolState {
            velocity_m_per_s: DVec3::Y,
            angular_velocity_rad_per_s: DVec3::Z * 100.0,
            ..ToolState::at_start(&spec)
        };
        let places: Vec<Place> = tool.places(&spec, 3).collect();
        for (place, x_m) in places.iter().zip([-0.01, 0.0, 0.01]) {
            assert!(place.at_m.distance(DVec3::new(x_m, 1.0, 0.0)) < 1e-15);
            assert!((place.speed_m_per_s - (1.0 + 100.0 * x_m).abs()).abs() < 1e-12);
        }
        assert_eq!(tool.places(&spec, 1).next().unwrap().at_m, DVec3::Y);
    }
}
