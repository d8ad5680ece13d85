//! Which rigid motions the constraints leave free.
//!
//! A small rigid motion moves a node at `X` by `t + ω × (X − c)`. It is free when it moves no prescribed axis: the null
//! space of `CᵀC`, with one row `[e_axis, (X − c) × e_axis]` of `C` per prescribed axis. Checked for every connected
//! part of the mesh.
use crate::{linalg::eigen, mesh::connected_parts};
use glam::DVec3;
use std::fmt;

/// A rigid motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RigidMotion {
    /// Along a unit direction.
    Translation {
        /// Direction.
        direction: DVec3,
    },
    /// About an axis, with `pitch_m` of translation along it per radian.
    Rotation {
        /// Unit direction of the axis.
        axis: DVec3,
        /// A point of the axis (m).
        through_m: DVec3,
        /// Translation along the axis per radian (m).
        pitch_m: f64,
    },
}

impl fmt::Display for RigidMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Translation { direction } => write!(f, "move along {}", named(*direction)),
            Self::Rotation { axis, through_m, .. } => write!(
                f,
                "turn about {} through ({:.4}, {:.4}, {:.4}) m",
                named(*axis),
                through_m.x,
                through_m.y,
                through_m.z
            ),
        }
    }
}

fn named(direction: DVec3) -> String {
    for (axis, name) in [(DVec3::X, "x"), (DVec3::Y, "y"), (DVec3::Z, "z")] {
        if direction.cross(axis).length() < 1e-6 {
            return name.into();
        }
    }
    format!("({:.3}, {:.3}, {:.3})", direction.x, direction.y, direction.z)
}

pub(crate) fn list(motions: &[RigidMotion]) -> String {
    motions.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// A part of a mesh that is not held.
#[derive(Debug, Clone, PartialEq)]
pub struct FreePart {
    /// A node of it.
    pub node: u32,
    /// Its free motions.
    pub motions: Vec<RigidMotion>,
}

/// Nodes of a mesh, for a look at how they are held.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HeldNodes<'a> {
    /// Rest positions (m).
    pub(crate) rest_m: &'a [DVec3],
    /// Lumped masses (kg).
    pub(crate) mass_kg: &'a [f64],
    /// `1/m` (1/kg) per axis, zero where prescribed.
    pub(crate) inverse_mass_per_kg: &'a [DVec3],
}

/// The first part of a mesh of these elements that is not held; `None` where all are.
pub(crate) fn first_free_part<'e>(
    nodes: &HeldNodes<'_>,
    elements: impl Iterator<Item = &'e [u32]>,
) -> Option<FreePart> {
    let part_of = connected_parts(nodes.rest_m.len(), elements);
    for part in 0..part_of.iter().copied().max().map_or(0, |last| last + 1) {
        let of_part: Vec<usize> = (0..part_of.len()).filter(|&node| part_of[node] == part).collect();
        // Coarse nodes that nothing follows are no part of the body.
        if of_part.iter().all(|&node| nodes.mass_kg[node] == 0.0) {
            continue;
        }
        let motions = free_motions(nodes, &of_part);
        if !motions.is_empty() {
            return Some(FreePart { node: of_part[0] as u32, motions });
        }
    }
    None
}

fn free_motions(of: &HeldNodes<'_>, nodes: &[usize]) -> Vec<RigidMotion> {
    let rest = of.rest_m;
    let centre = nodes.iter().map(|&node| rest[node]).sum::<DVec3>() / nodes.len() as f64;
    let size = nodes.iter().map(|&node| rest[node].distance(centre)).fold(0.0, f64::max);
    let mut normal_matrix = [0.0; 36];
    let mut rows = 0.0;
    for &node in nodes {
        let arm = (rest[node] - centre) / size;
        for axis in (0..3).filter(|&axis| of.inverse_mass_per_kg[node][axis] == 0.0) {
            let e = DVec3::AXES[axis];
            // Rotations first, so that the echelon form separates pure translations.
            let row = [arm.cross(e).to_array(), e.to_array()].concat();
            rows += 1.0;
            for i in 0..6 {
                for j in 0..6 {
                    normal_matrix[6 * i + j] += row[i] * row[j];
                }
            }
        }
    }
    let (values, vectors) = eigen::symmetric(&mut normal_matrix, 6);
    // Below: held by less than a millionth of the body's size, as by nodes on one line up to rounding.
    let free = (0..6).filter(|&k| values[k] <= 1e-12 * f64::max(rows, 1.0));
    let mut basis: Vec<[f64; 6]> = free.map(|k| std::array::from_fn(|i| vectors[6 * k + i])).collect();
    echelon(&mut basis);
    basis.iter().map(|mode| describe(mode, centre, size)).collect()
}

/// Reduced row echelon form, so that free axes come out by themselves.
fn echelon(rows: &mut [[f64; 6]]) {
    let mut done = 0;
    for column in 0..6 {
        let Some(pivot) = (done..rows.len())
            .filter(|&r| rows[r][column].abs() > 1e-6)
            .max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))
        else {
            continue;
        };
        rows.swap(done, pivot);
        let lead = rows[done].map(|v| v / rows[done][column]);
        rows[done] = lead;
        for (_, row) in rows.iter_mut().enumerate().filter(|(r, _)| *r != done) {
            let factor = row[column];
            for k in 0..6 {
                row[k] -= factor * lead[k];
            }
        }
        done += 1;
    }
}

fn describe(mode: &[f64; 6], centre: DVec3, size: f64) -> RigidMotion {
    let [wx, wy, wz, tx, ty, tz] = *mode;
    // Arms were scaled by 1/size, so t is in units of size.
    let (omega, t) = (DVec3::new(wx, wy, wz), DVec3::new(tx, ty, tz) * size);
    let rate = omega.length();
    if rate < 1e-6 {
        return RigidMotion::Translation { direction: t.normalize() };
    }
    // The axis passes where the motion is along ω: c + (ω × t)/|ω|².
    let through_m = centre + omega.cross(t) / (rate * rate);
    RigidMotion::Rotation { axis: omega / rate, through_m, pitch_m: omega.dot(t) / (rate * rate) }
}
