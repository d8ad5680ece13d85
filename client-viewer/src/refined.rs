//! The surface refined near tools: smaller triangles in place of some of the keyframe's.
use crate::{
    ViewError, places,
    surface::{Surface, broken, values},
};
use glam::Vec3;
use std::collections::BTreeSet;

/// The surface with what its last update refined.
///
/// # Errors
/// Arrays that do not fit each other or the keyframe, or [`ViewError::NotRefined`].
pub fn merged(mut surface: Surface) -> Result<Surface, ViewError> {
    let name = || surface.header.scene_name.clone();
    let refined = surface.last.refined_surface.take().ok_or_else(|| ViewError::NotRefined(name()))?;
    let replaced: BTreeSet<u32> = values(&refined.replaced_u32le, u32::from_le_bytes)?.into_iter().collect();
    let indices: Vec<u32> = values(&refined.triangles_u32le, u32::from_le_bytes)?;
    let moved: Vec<i16> = values(&refined.displacements_i16le, i16::from_le_bytes)?;
    let rest_m = refined.rest_positions.as_ref().map(places::positions_m).transpose()?.unwrap_or_default();
    let (moved, cut_moved) = moved.as_chunks::<3>();
    let (triangles, cut_triangles) = indices.as_chunks::<3>();
    let vertices = surface.rest_m.len() + rest_m.len();
    let whole = cut_moved.is_empty() && cut_triangles.is_empty() && moved.len() == rest_m.len();
    if !whole || indices.iter().any(|&index| index as usize >= vertices) {
        return Err(broken("refines a surface with arrays that do not fit".into()));
    }
    surface.rest_m.extend(rest_m.iter().map(|x| x.as_vec3()));
    let quantum_m = refined.displacement_quantum_m;
    surface.displacement_m.extend(moved.iter().map(|n| Vec3::from_array(n.map(f32::from)) * quantum_m));
    let kept = surface.triangles.iter().zip(0..).filter(|(_, number)| !replaced.contains(number));
    surface.triangles = kept.map(|(triangle, _)| *triangle).chain(triangles.iter().copied()).collect();
    Ok(surface)
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_proto::v1;

    /// Two triangles, of which the second is halved by a vertex at the middle of its last edge.
    fn surface(refined: Option<v1::RefinedSurface>) -> Surface {
        Surface {
            rest_m: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
            displacement_m: vec![Vec3::ZERO; 4],
            triangles: vec![[0, 1, 2], [1, 3, 2]],
            last: v1::SurfaceUpdate { refined_surface: refined, ..Default::default() },
            ..Default::default()
        }
    }

    fn halved() -> v1::RefinedSurface {
        let u32s = |numbers: &[u32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>().into();
        let i16s = [0_i16, 0, -3].iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        v1::RefinedSurface {
            replaced_u32le: u32s(&[1]),
            triangles_u32le: u32s(&[1, 3, 4, 3, 2, 4]),
            rest_positions: Some(v1::Places {
                corner_m: Some(v1::Vec3 { x: 0.5, y: 0.5, z: 0.0 }),
                quantum_m: 0.25,
                positions_u16le: vec![0; 6].into(),
            }),
            displacement_quantum_m: 0.5,
            displacements_i16le: i16s.into(),
        }
    }

    #[test]
    fn small_triangles_take_the_place_of_large_ones() {
        let merged = merged(surface(Some(halved()))).unwrap();
        assert_eq!(merged.triangles, [[0, 1, 2], [1, 3, 4], [3, 2, 4]]);
        assert_eq!(merged.positions_m()[4], Vec3::new(0.5, 0.5, -1.5));
        assert_eq!(merged.rest_m.len(), merged.displacement_m.len());
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        assert!(matches!(merged(surface(None)), Err(ViewError::NotRefined(_))));
        let without = |part: fn(&mut v1::RefinedSurface)| {
            let mut refined = halved();
            part(&mut refined);
            merged(surface(Some(refined)))
        };
        assert!(without(|r| r.rest_positions = None).is_err());
        assert!(without(|r| r.displacements_i16le.truncate(4)).is_err());
        assert!(without(|r| r.triangles_u32le.truncate(20)).is_err());
        assert!(without(|r| r.triangles_u32le = vec![5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0].into()).is_err());
        assert!(without(|r| r.replaced_u32le.truncate(3)).is_err());
    }
}
