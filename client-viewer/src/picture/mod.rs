//! `snapshot`: a picture of the deformed surface without a GPU: z-buffer, shading, displacement colours, legend.
mod camera;
mod colour;
mod label;
mod raster;
mod solids;

use crate::{ViewError, cli, connect::Server, moment::Moment, surface::Surface};
use camera::Camera;
use clap::Args;
use colour::Rgb;
use glam::{Quat, Vec3};
use palpate_proto::v1::WatchRequest;
use raster::{Canvas, Vertex};
use std::path::PathBuf;

/// Each pixel is the mean of this many squared.
const SUPERSAMPLING: usize = 2;
/// The least scale, as a part of the body's size (the diagonal of its box at rest).
const LEAST_SCALE: f32 = 0.01;
const GROUND: Rgb = Rgb([0.078, 0.094, 0.110]);
/// Forces written below the title: more tools would run into the legend.
const LABELLED_TOOLS: usize = 4;
const INK: Rgb = Rgb([0.90, 0.89, 0.86]);
const TOOL: Rgb = Rgb([0.91, 0.89, 0.85]);
const ARROW: Rgb = Rgb([0.44, 0.88, 0.76]);

/// Arguments of `snapshot`.
#[derive(Debug, Args)]
pub struct SnapshotArguments {
    /// PNG file to write
    file: PathBuf,
    /// Width and height in pixels
    #[arg(long, default_value = "1000x750", value_parser = parse_size, value_name = "WxH")]
    size: (usize, usize),
    /// Direction to look from, seen from the body's middle
    #[arg(long, default_value = "0.75,-1.35,0.55", value_parser = parse_direction, allow_hyphen_values = true, value_name = "X,Y,Z")]
    from: Vec3,
    /// Displacement (mm) of the last colour [default: the largest one, rounded up, and at least 1 % of the body's size]
    #[arg(long, value_parser = parse_full_scale, allow_negative_numbers = true, value_name = "MM")]
    full_scale_mm: Option<f32>,
    /// Replace the file if it exists
    #[arg(long)]
    force: bool,
    /// Draw the surface refined near tools: smooth there, whatever the size of its triangles
    #[arg(long)]
    refined: bool,
    #[command(flatten)]
    moment: Moment,
}

fn parse_size(text: &str) -> Result<(usize, usize), String> {
    let (w, h) = text.split_once('x').ok_or("write it as WIDTHxHEIGHT, for example 1000x750")?;
    let number = |s: &str| s.parse::<usize>().map_err(|e| format!("\"{s}\": {e}"));
    let (w, h) = (number(w)?, number(h)?);
    if (64..=8192).contains(&w) && (64..=8192).contains(&h) {
        Ok((w, h))
    } else {
        Err("both must be between 64 and 8192 pixels".into())
    }
}

fn parse_full_scale(text: &str) -> Result<f32, String> {
    let mm: f32 = text.parse().map_err(|error| format!("{error}"))?;
    if (1e-6..=1e6).contains(&mm) { Ok(mm) } else { Err("must be between 0.000001 and 1000000 mm".into()) }
}

fn parse_direction(text: &str) -> Result<Vec3, String> {
    let numbers: Vec<f32> = text
        .split(',')
        .map(|s| s.trim().parse::<f32>().map_err(|e| format!("\"{s}\": {e}")))
        .collect::<Result<_, _>>()?;
    match numbers[..] {
        [x, y, z] if Vec3::new(x, y, z).length() > 1e-6 && Vec3::new(x, y, z).is_finite() => Ok(Vec3::new(x, y, z)),
        _ => Err("write three numbers, not all zero, for example 1,-1,0.5".into()),
    }
}

/// Runs `snapshot`.
///
/// # Errors
/// An unreachable daemon or a file that cannot be written.
pub async fn run(server: &Server, arguments: &SnapshotArguments) -> Result<(), ViewError> {
    if !arguments.file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        return Err(ViewError::Ending { path: arguments.file.clone(), known: ".png" });
    }
    let request = WatchRequest { refined_surface: arguments.refined, ..Default::default() };
    let surface = arguments.moment.surface(server, request).await?;
    let scale = Scale::of(&surface, arguments.full_scale_mm.map(|mm| mm * 1e-3));
    let canvas = draw(&surface, arguments.size, arguments.from, scale);
    cli::write_new(&arguments.file, &encode(&canvas)?, arguments.force)?;
    cli::say(&format!(
        "{}: tick {}, largest displacement {:.3} mm, last colour at {:.3} mm ({})",
        arguments.file.display(),
        surface.last.tick,
        1e3 * scale.largest_m,
        1e3 * scale.top_m,
        scale.rule
    ))
}

/// What the colours stand for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scale {
    /// Displacement (m) of the last colour.
    top_m: f32,
    /// Largest displacement (m) of the surface.
    largest_m: f32,
    /// Where the end of the scale comes from.
    rule: &'static str,
}

impl Scale {
    /// The largest displacement, rounded up, but never less than 1 % of the body's size: a body at rest, which sags or trembles by
    /// micrometres, has the colours of rest.
    fn of(surface: &Surface, asked_m: Option<f32>) -> Self {
        let largest_m = surface.displacement_m.iter().map(|d| d.length()).fold(0.0, f32::max);
        let low = surface.rest_m.iter().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
        let high = surface.rest_m.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ZERO);
        let least_m = colour::nice_ceiling(LEAST_SCALE * low.distance(high), f32::MIN_POSITIVE);
        let (top_m, rule) = match asked_m {
            Some(top_m) => (top_m, "as asked"),
            None if largest_m <= least_m => (least_m, "1 % of the body, rounded up"),
            None => (colour::nice_ceiling(largest_m, least_m), "largest, rounded up"),
        };
        Self { top_m, largest_m, rule }
    }
}

fn draw(surface: &Surface, (width, height): (usize, usize), from: Vec3, scale: Scale) -> Canvas {
    let positions = surface.positions_m();
    // The rest shape too: pictures of small displacements are all taken from the same place.
    let seen: Vec<Vec3> = surface.rest_m.iter().chain(&positions).copied().collect();
    let camera = Camera::looking_at(&seen, from, width as f32 / height as f32);
    let mut canvas = Canvas::new(width * SUPERSAMPLING, height * SUPERSAMPLING, GROUND);
    let normals = vertex_normals(&positions, &surface.triangles);
    let vertices: Vec<Vertex> = positions
        .iter()
        .zip(&normals)
        .zip(&surface.displacement_m)
        .map(|((&position, &normal), d)| Vertex {
            position,
            normal,
            colour: colour::of_fraction(d.length() / scale.top_m),
        })
        .collect();
    for t in &surface.triangles {
        canvas.triangle(&camera, t.map(|i| vertices[i as usize]));
    }
    draw_tools(&mut canvas, &camera, surface);
    let mut canvas = canvas.reduced(SUPERSAMPLING);
    label::legend(
        &mut canvas,
        scale.top_m,
        &[&format!("largest now {} mm", label::trimmed(1e3 * scale.largest_m)), &format!("scale: {}", scale.rule)],
        INK,
    );
    label::title(&mut canvas, &surface.header.scene_name, surface.last.time_s, INK);
    let tools = surface.header.tools.iter().zip(&surface.last.tools);
    for (line, (shape, state)) in tools.take(LABELLED_TOOLS).enumerate() {
        let force_n = vector(state.contact_force_n).unwrap_or(Vec3::ZERO).length();
        label::force(&mut canvas, line, &shape.name, force_n, ARROW);
    }
    canvas
}

fn vector(v: Option<palpate_proto::v1::Vec3>) -> Option<Vec3> {
    v.map(|v| Vec3::new(v.x as f32, v.y as f32, v.z as f32))
}

fn draw_tools(canvas: &mut Canvas, camera: &Camera, surface: &Surface) {
    for (shape, state) in surface.header.tools.iter().zip(&surface.last.tools) {
        let Some(centre) = vector(state.proxy_position_m) else { continue };
        let q = state.proxy_orientation.unwrap_or(palpate_proto::v1::Quaternion { w: 1.0, x: 0.0, y: 0.0, z: 0.0 });
        let along = Quat::from_xyzw(q.x as f32, q.y as f32, q.z as f32, q.w as f32) * Vec3::Z;
        for t in solids::capsule(centre, along * shape.half_length_m as f32, shape.radius_m as f32, TOOL) {
            canvas.triangle(camera, t);
        }
        let force = vector(state.contact_force_n).unwrap_or(Vec3::ZERO);
        if force.length() > 1e-6 {
            // A newton is as long as 30 % of the body; longer arrows are cut at half of it.
            let length = (0.3 * force.length()).min(0.5) * camera.body_size_m;
            // From the tool's surface, since a tool is often larger than the arrow is long.
            let direction = force.normalize();
            let inside_m = (along * shape.half_length_m as f32).dot(direction).abs() + shape.radius_m as f32;
            let tail = centre + direction * inside_m;
            for t in solids::arrow(tail, direction, length, camera.body_size_m * 0.008, ARROW) {
                canvas.triangle(camera, t);
            }
        }
    }
}

/// Area-weighted vertex normals.
fn vertex_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for t in triangles {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        for i in t {
            normals[*i as usize] += (b - a).cross(c - a);
        }
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}

fn encode(canvas: &Canvas) -> Result<Vec<u8>, ViewError> {
    let mut bytes = Vec::new();
    let failed = |error: png::EncodingError| ViewError::Stream(format!("cannot become a PNG: {error}"));
    let mut encoder = png::Encoder::new(&mut bytes, canvas.width as u32, canvas.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&canvas.to_rgb8()).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square in the plane z = 0, seen from above, displaced at one corner.
    fn square() -> Surface {
        Surface {
            rest_m: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
            displacement_m: vec![Vec3::ZERO, Vec3::ZERO, Vec3::new(0.0, 0.0, 0.02), Vec3::ZERO],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Default::default()
        }
    }

    #[test]
    fn the_middle_shows_the_body_and_the_corner_the_ground() {
        let scale = Scale::of(&square(), None);
        let canvas = draw(&square(), (200, 150), Vec3::new(0.0, -0.01, 1.0), scale);
        assert_ne!(canvas.pixel(100, 75), canvas.pixel(2, 2));
        assert_eq!(canvas.pixel(2, 148), GROUND.0.map(|c| (c * 255.0).round() as u8));
    }

    /// A body that trembled by a micrometre was drawn in all colours.
    #[test]
    fn the_scale_ends_at_the_largest_displacement_but_never_below_a_hundredth_of_the_body() {
        let moved_m = |z: f32| Surface { displacement_m: vec![Vec3::new(0.0, 0.0, z); 4], ..square() };
        // The square's diagonal is 1.41 m.
        for (z, asked_m, top_m, rule) in [
            (1e-6, None, 0.02, "1 % of the body, rounded up"),
            (0.019, None, 0.02, "1 % of the body, rounded up"),
            (0.03, None, 0.05, "largest, rounded up"),
            (0.03, Some(0.001), 0.001, "as asked"),
        ] {
            let scale = Scale::of(&moved_m(z), asked_m);
            assert!((scale.top_m / top_m - 1.0).abs() < 1e-4 && scale.rule == rule, "{z}: {scale:?}");
        }
        let nothing = Scale::of(&Surface::default(), None);
        assert!(nothing.top_m > 0.0, "{nothing:?}");
    }

    /// The camera saw the rest shape only: a body that had moved far was outside the picture.
    #[test]
    fn a_body_that_moved_far_is_in_the_picture() {
        let mut moved = square();
        moved.displacement_m = vec![Vec3::new(5.0, 0.0, 0.0); 4];
        let canvas = draw(&moved, (200, 150), Vec3::new(0.0, -0.01, 1.0), Scale::of(&moved, None));
        let ground = GROUND.0.map(|c| (c * 255.0).round() as u8);
        assert!((100..200).any(|column| canvas.pixel(column, 75) != ground));
    }

    #[test]
    fn the_force_is_written_beside_its_arrow() {
        let mut pressed = square();
        pressed.header.tools =
            vec![palpate_proto::v1::ToolShape { name: "finger".into(), radius_m: 0.01, half_length_m: 0.0 }];
        let force = Some(palpate_proto::v1::Vec3 { x: 0.0, y: 0.0, z: 0.5 });
        pressed.last.tools = vec![palpate_proto::v1::ToolState { contact_force_n: force, ..Default::default() }];
        let arrow = ARROW.0.map(|c| (c * 255.0).round() as u8);
        let canvas = draw(&pressed, (400, 300), Vec3::new(0.0, -0.01, 1.0), Scale::of(&pressed, None));
        let written =
            (0..400).flat_map(|x| (24..48).map(move |y| (x, y))).filter(|&(x, y)| canvas.pixel(x, y) == arrow);
        assert!(written.count() > 100);
    }

    #[test]
    fn the_picture_is_a_png() {
        let canvas = draw(&square(), (64, 64), Vec3::ONE, Scale::of(&square(), Some(0.05)));
        let bytes = encode(&canvas).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (64, 64));
        assert_eq!(pixels, canvas.to_rgb8());
    }

    #[test]
    fn sizes_and_directions_are_checked() {
        assert_eq!(parse_size("640x480"), Ok((640, 480)));
        assert_eq!(parse_full_scale("2.5"), Ok(2.5));
        assert!(["nan", "-5", "0", "inf", "x"].iter().all(|text| parse_full_scale(text).is_err()));
        assert!(parse_size("640").is_err() && parse_size("1x1").is_err());
        assert!(parse_direction("0,0,0").is_err() && parse_direction("1,2").is_err());
        assert_eq!(parse_direction("1, -2, 3"), Ok(Vec3::new(1.0, -2.0, 3.0)));
    }
}
