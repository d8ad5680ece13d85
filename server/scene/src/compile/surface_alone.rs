//! `[body.surface]`: a surface file as a body without an inside, mended and told.
use super::{
    Files,
    body::{Body, BodyMesh},
    kinds::BodyKind,
};
use crate::{
    document::{
        body::SurfaceTable,
        source::{Fault, Where},
    },
    fill::{self, Mended},
    wording::counted,
};
use palpate_physics::Surface;

/// Reads the file.
pub(super) fn read(
    kind: &'static dyn BodyKind,
    table: &SurfaceTable,
    files: &Files<'_>,
    at: &Where,
) -> Result<Body, Fault> {
    let at = at.key("file");
    let file = files.read_surface(&at, &table.file)?;
    files.limits.check_tets(&at, file.triangles.len() as u64)?;
    let scale = table.unit.in_m();
    let mended = fill::mend(file.vertices.iter().map(|vertex| *vertex * scale).collect(), file.triangles);
    let told = told(&mended).map(|told| format!("{at} = \"{}\": {told}", table.file));
    let warnings = file.warnings.into_iter().chain(told).collect();
    let surface = Surface::alone(mended.points.len(), mended.triangles);
    let origin = format!("surface {}", table.file);
    let mesh = BodyMesh::Surface { positions_m: mended.points, control: None };
    Ok(Body { warnings, report: file.notes, ..Body::new(kind, mesh, surface, origin) })
}

/// What was mended, why, and how to be rid of the warning.
fn told(mended: &Mended) -> impl Iterator<Item = String> {
    let all = mended.triangles.len();
    let loose = (mended.repairs.welded_points > 0).then(|| {
        format!(
            "{}: its triangles were loose, no spring would have joined them; save the surface with shared vertices",
            // What is turned is told below.
            fill::Repairs { turned_triangles: 0, ..mended.repairs }
        )
    });
    let mixed = (mended.repairs.turned_triangles > 0).then(|| {
        let turned = counted(mended.repairs.turned_triangles, "triangle");
        format!("{turned} of {all} turned: their corners went round the other way than their neighbours'; save the surface with one orientation")
    });
    let inside_out = (mended.inside_out > 0).then(|| {
        let turned = counted(mended.inside_out, "triangle");
        format!("{turned} of {all} turned: the closed surface was inside out, tools would not have felt it; save it with the corners of its triangles counter-clockwise, seen from outside")
    });
    [loose, mixed, inside_out].into_iter().flatten()
}
