//! Finds the vertex of a skin that is nearest to a point, without looking at those that bounds rule out.
use super::broad::{CLUSTER, FittedBoxes, GROUP, ROUNDING_M, Skin};
use glam::DVec3;

const NONE: u32 = u32::MAX;

/// What may shorten a search for the nearest vertex; what is found is the same without it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Known<'a> {
    /// Contact's boxes, where they may be used.
    pub(crate) fitted: Option<FittedBoxes<'a>>,
    /// A vertex that may be near. It rules out most of the others at once.
    pub(crate) vertex: Option<u32>,
}

/// Returns the vertex nearest to a point, if one is within a distance (m), and its distance (m), on a skin of which a
/// query has begun; of several that are as near, the first one.
pub(crate) fn nearest_vertex(skin: &impl Skin, from_m: DVec3, within_m: f64, known: Known<'_>) -> Option<(u32, f64)> {
    let of_fitted_m = |cluster: usize| {
        known.fitted.map_or(0.0, |fitted| fitted.boxes[cluster].distance_bound_m(from_m, fitted.travel_m))
    };
    let in_group = GROUP / CLUSTER;
    let clusters = skin.clusters();
    let groups = 0..clusters.div_ceil(in_group);
    let of_group = |group: usize| group * in_group..((group + 1) * in_group).min(clusters);
    let (mut found, mut first) = ((within_m, NONE), clusters);
    let known_m = known.vertex.map(|vertex| (skin.position_m(vertex).distance(from_m), vertex));
    if let Some(near) = known_m.filter(|(distance_m, _)| *distance_m < within_m) {
        found = near;
    } else {
        // The first cluster should be near: it rules out most of the others.
        let near = |group: &usize| skin.group_distance_m(*group, from_m) <= within_m;
        let bound_m = |cluster: usize| skin.cluster_distance_m(cluster, from_m).max(of_fitted_m(cluster));
        let all = groups.clone().filter(near).flat_map(of_group);
        first = all.map(|cluster| (bound_m(cluster), cluster)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
        look_at(skin, first, from_m, &mut found);
    }
    for group in groups {
        if skin.group_distance_m(group, from_m) > found.0 + ROUNDING_M {
            continue;
        }
        for cluster in of_group(group) {
            let is_near = |bound_m: f64| bound_m <= found.0 + ROUNDING_M;
            if cluster != first && is_near(of_fitted_m(cluster)) && is_near(skin.cluster_distance_m(cluster, from_m)) {
                look_at(skin, cluster, from_m, &mut found);
            }
        }
    }
    let (nearest_m, vertex) = found;
    (vertex != NONE).then_some((vertex, nearest_m))
}

fn look_at(skin: &impl Skin, cluster: usize, from_m: DVec3, (nearest_m, nearest): &mut (f64, u32)) {
    for &vertex in skin.vertices(cluster) {
        let distance_m = skin.position_m(vertex).distance(from_m);
        if distance_m < *nearest_m || (distance_m == *nearest_m && vertex < *nearest && *nearest != NONE) {
            (*nearest_m, *nearest) = (distance_m, vertex);
        }
    }
}

/// Returns where (m) a tool that touches is deepest in the body, by the force on it (N): in a dent many vertices are
/// nearly as near to its centre, and the nearest one would change with the particles that are awake.
pub(crate) fn deepest_m(centre_m: DVec3, radius_m: f64, contact_force_n: DVec3) -> Option<DVec3> {
    contact_force_n.try_normalize().map(|outwards| centre_m - outwards * radius_m)
}
