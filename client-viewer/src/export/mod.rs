//! `export`: the deformed surface as a file for other programs. One file per format.
mod obj;
mod ply;
mod vtu;

use crate::{ViewError, cli, connect::Server, moment::Moment, surface::Surface};
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `export`.
#[derive(Debug, Args)]
pub struct ExportArguments {
    /// File to write; its ending chooses the format: .vtu, .obj or .ply
    file: PathBuf,
    /// Replace the file if it exists
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    moment: Moment,
}

/// Runs `export`.
///
/// # Errors
/// An unknown ending, an unreachable daemon, or a file that cannot be written.
pub async fn run(server: &Server, arguments: &ExportArguments) -> Result<(), ViewError> {
    let write = writer_for(&arguments.file)?;
    let surface = arguments.moment.surface(server).await?;
    cli::write_new(&arguments.file, write(&surface).as_bytes(), arguments.force)?;
    cli::say(&format!(
        "{}: {} vertices, {} triangles at tick {}",
        arguments.file.display(),
        surface.rest_m.len(),
        surface.triangles.len(),
        surface.last.tick
    ))
}

fn writer_for(path: &Path) -> Result<fn(&Surface) -> String, ViewError> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("vtu") => Ok(vtu::to_text),
        Some("obj") => Ok(obj::to_text),
        Some("ply") => Ok(ply::to_text),
        _ => Err(ViewError::Ending { path: path.into(), known: ".vtu, .obj, .ply" }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn surface() -> Surface {
        Surface {
            rest_m: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            displacement_m: vec![Vec3::ZERO, Vec3::ZERO, Vec3::new(0.0, 0.25, 0.0)],
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        }
    }

    #[test]
    fn a_scene_name_of_two_lines_stays_in_the_comment() {
        let mut surface = surface();
        surface.header.scene_name = "heart\nv 9 9 9".into();
        assert_eq!(obj::to_text(&surface).lines().filter(|line| line.starts_with("v ")).count(), 3);
        assert!(ply::to_text(&surface).lines().all(|line| line != "v 9 9 9 at tick 0, metres"));
    }

    #[test]
    fn every_format_carries_deformed_positions_and_faces() {
        let obj = obj::to_text(&surface());
        assert!(obj.contains("v 0 1.25 0\n") && obj.contains("f 1 2 3\n"), "{obj}");
        let ply = ply::to_text(&surface());
        assert!(
            ply.contains("element vertex 3\n") && ply.contains("\n0 1.25 0 ") && ply.ends_with("3 0 1 2\n"),
            "{ply}"
        );
        let vtu = vtu::to_text(&surface());
        assert!(vtu.contains("NumberOfPoints=\"3\" NumberOfCells=\"1\"") && vtu.contains("0 1.25 0\n"), "{vtu}");
        assert!(vtu.contains("Name=\"displacement_m\""));
    }

    #[test]
    fn unknown_endings_are_refused() {
        assert!(writer_for(Path::new("dent.docx")).is_err());
        assert!(writer_for(Path::new("dent.VTU")).is_ok());
    }
}
