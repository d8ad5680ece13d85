//! Stanford PLY (ASCII), with the displacement's magnitude per vertex.
use crate::surface::Surface;
use std::fmt::Write as _;

/// Deformed positions (m), displacement magnitude (m), triangles.
pub(super) fn to_text(surface: &Surface) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\ncomment {} at tick {}, metres\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nproperty float displacement_m\nelement face {}\nproperty list uchar uint vertex_indices\n\
         end_header\n",
        surface.header.scene_name.replace(['\n', '\r'], " "),
        surface.last.tick,
        surface.rest_m.len(),
        surface.triangles.len()
    );
    for (p, d) in surface.positions_m().iter().zip(&surface.displacement_m) {
        // Writing into a String cannot fail.
        let _ = writeln!(text, "{} {} {} {}", p.x, p.y, p.z, d.length());
    }
    for [a, b, c] in &surface.triangles {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text
}
