//! Tools and arrows as triangles.
use super::{colour::Rgb, raster::Vertex};
use glam::{Quat, Vec3};
use std::f32::consts::{PI, TAU};

const AROUND: usize = 48;
const ALONG: usize = 24;

/// A capsule (m) about the segment `centre ± half`; a sphere where that is a point.
pub(super) fn capsule(centre: Vec3, half: Vec3, radius: f32, colour: Rgb) -> Vec<[Vertex; 3]> {
    let pole = half.try_normalize().unwrap_or(Vec3::Z);
    // About z as it is, so that a sphere's seams are where they were.
    let turn = Quat::from_rotation_arc(Vec3::Z, pole);
    // The equator twice: once at either end of the cylinder.
    let at = |i: usize, j: usize| {
        let (ring, end) = if i <= ALONG / 2 { (i, half) } else { (i - 1, -half) };
        let (polar, azimuth) = (PI * ring as f32 / ALONG as f32, TAU * j as f32 / AROUND as f32);
        let normal = turn * Vec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos());
        Vertex { position: centre + end + normal * radius, normal, colour }
    };
    (0..=ALONG)
        .filter(|&i| i != ALONG / 2 || half != Vec3::ZERO)
        .flat_map(|i| (0..AROUND).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// An arrow from `tail` along the unit vector `direction`: shaft and head (m).
pub(super) fn arrow(tail: Vec3, direction: Vec3, length: f32, radius: f32, colour: Rgb) -> Vec<[Vertex; 3]> {
    let neck = tail + direction * (length - 4.0 * radius).max(0.0);
    let tip = tail + direction * length;
    let side = direction.any_orthonormal_vector();
    let other = direction.cross(side);
    let ring = |centre: Vec3, r: f32, j: usize| {
        let angle = TAU * j as f32 / AROUND as f32;
        let normal = side * angle.cos() + other * angle.sin();
        Vertex { position: centre + normal * r, normal, colour }
    };
    (0..AROUND)
        .flat_map(|j| {
            let [a, b] = [ring(tail, radius, j), ring(tail, radius, j + 1)];
            let [c, d] = [ring(neck, radius, j + 1), ring(neck, radius, j)];
            let [e, f] = [ring(neck, 2.2 * radius, j), ring(neck, 2.2 * radius, j + 1)];
            let point = Vertex { position: tip, normal: e.normal, colour };
            [[a, b, c], [a, c, d], [e, f, point]]
        })
        .collect()
}
