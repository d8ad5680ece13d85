//! Wavefront OBJ.
use crate::surface::Surface;
use std::fmt::Write as _;

/// Deformed positions (m) and triangles.
pub(super) fn to_text(surface: &Surface) -> String {
    let name = surface.header.scene_name.replace(['\n', '\r'], " ");
    let mut text = format!("# {name} at tick {}, metres\n", surface.last.tick);
    for p in surface.positions_m() {
        // Writing into a String cannot fail.
        let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
    }
    for [a, b, c] in &surface.triangles {
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    text
}
