//! `export`: the deformed surface, or the active particles, as a file for other programs. One file per format.
mod obj;
mod ply;
mod points;
mod vtu;

use crate::{ViewError, cli, connect::Server, moment::Moment, surface::Surface};
use clap::Args;
use glam::DVec3;
use palpate_proto::v1::WatchRequest;
use std::path::{Path, PathBuf};

/// Arguments of `export`.
#[derive(Debug, Args)]
pub struct ExportArguments {
    /// File to write; its ending chooses the format: .vtu, .obj or .ply
    file: PathBuf,
    /// Replace the file if it exists
    #[arg(long)]
    force: bool,
    /// Write the active particles of a hybrid body as points, in place of the surface (.vtu, .ply)
    #[arg(long)]
    particles: bool,
    /// Refine the surface near tools: smooth there, whatever the size of its triangles
    #[arg(long, conflicts_with = "particles")]
    refined: bool,
    #[command(flatten)]
    moment: Moment,
}

/// Runs `export`.
///
/// # Errors
/// An unknown ending, an unreachable daemon, or a file that cannot be written.
pub async fn run(server: &Server, arguments: &ExportArguments) -> Result<(), ViewError> {
    if arguments.particles {
        return run_particles(server, arguments).await;
    }
    let write = writer_for(&arguments.file)?;
    let request = WatchRequest { refined_surface: arguments.refined, ..Default::default() };
    let surface = arguments.moment.surface(server, request).await?;
    cli::write_new(&arguments.file, write(&surface).as_bytes(), arguments.force)?;
    cli::say(&format!(
        "{}: {} vertices, {} triangles at tick {}",
        arguments.file.display(),
        surface.rest_m.len(),
        surface.triangles.len(),
        surface.last.tick
    ))
}

async fn run_particles(server: &Server, arguments: &ExportArguments) -> Result<(), ViewError> {
    let write = particle_writer_for(&arguments.file)?;
    let request = WatchRequest { active_particles: true, ..Default::default() };
    let surface = arguments.moment.surface(server, request).await?;
    if surface.header.particle_spacing_m == 0.0 {
        return Err(ViewError::NoParticles(surface.header.scene_name));
    }
    let positions_m = points::positions_m(&surface)?;
    cli::write_new(&arguments.file, write(&surface, &positions_m).as_bytes(), arguments.force)?;
    let (file, count, tick) = (arguments.file.display(), positions_m.len(), surface.last.tick);
    cli::say(&format!("{file}: {count} active particles at tick {tick}"))
}

fn ending(path: &Path) -> Option<String> {
    path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase)
}

/// The text of a file with points at these positions (m).
type ParticleWriter = fn(&Surface, &[DVec3]) -> String;

fn particle_writer_for(path: &Path) -> Result<ParticleWriter, ViewError> {
    match ending(path).as_deref() {
        Some("vtu") => Ok(points::to_vtu),
        Some("ply") => Ok(points::to_ply),
        _ => Err(ViewError::Ending { path: path.into(), known: ".vtu and .ply for particles" }),
    }
}

fn writer_for(path: &Path) -> Result<fn(&Surface) -> String, ViewError> {
    match ending(path).as_deref() {
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
    fn particles_are_written_as_points() {
        let mut surface = surface();
        let positions_u16le = [0_u16, 1, 2, 4, 0, 0].iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let corner_m = Some(palpate_proto::v1::Vec3 { x: -1.0, y: 0.0, z: 0.5 });
        let particles = |bytes: &[u8]| palpate_proto::v1::Places {
            corner_m,
            quantum_m: 0.25,
            positions_u16le: bytes.to_vec().into(),
        };
        assert!(points::positions_m(&surface).unwrap().is_empty());
        surface.last.active_particles = Some(particles(&positions_u16le));
        let positions_m = points::positions_m(&surface).unwrap();
        assert_eq!(positions_m, [DVec3::new(-1.0, 0.25, 1.0), DVec3::new(0.0, 0.0, 0.5)]);
        let ply = points::to_ply(&surface, &positions_m);
        assert!(ply.contains("element vertex 2\n") && ply.ends_with("\n0.0000000 0.0000000 0.5000000\n"), "{ply}");
        let vtu = points::to_vtu(&surface, &positions_m);
        assert!(
            vtu.contains("NumberOfPoints=\"2\" NumberOfCells=\"2\"") && vtu.contains(">\n1\n2\n</DataArray>"),
            "{vtu}"
        );
        surface.last.active_particles = Some(particles(&positions_u16le[..7]));
        assert!(points::positions_m(&surface).is_err());
    }

    #[test]
    fn unknown_endings_are_refused() {
        assert!(particle_writer_for(Path::new("awake.obj")).is_err());
        assert!(writer_for(Path::new("dent.docx")).is_err());
        assert!(writer_for(Path::new("dent.VTU")).is_ok());
    }
}
