//! A z-buffer for shaded triangles.
use super::{camera::Camera, colour::Rgb};
use glam::{Vec2, Vec3};

/// A corner of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vertex {
    /// World position (m).
    pub(super) position: Vec3,
    /// Unit normal (world).
    pub(super) normal: Vec3,
    pub(super) colour: Rgb,
}

/// Colours and depths, rows from the top.
pub(super) struct Canvas {
    pub(super) width: usize,
    pub(super) height: usize,
    colours: Vec<[f32; 3]>,
    depths: Vec<f32>,
}

impl Canvas {
    /// An empty picture.
    pub(super) fn new(width: usize, height: usize, ground: Rgb) -> Self {
        Self { width, height, colours: vec![ground.0; width * height], depths: vec![f32::INFINITY; width * height] }
    }

    /// Draws a triangle, both sides, lit from beside the eye. Triangles that reach behind the eye are left out.
    pub(super) fn triangle(&mut self, camera: &Camera, corners: [Vertex; 3]) {
        let clip = corners.map(|v| camera.clip(v.position));
        if clip.iter().any(|c| c.w <= 0.0 || c.z < -c.w) {
            return;
        }
        let size = Vec2::new(self.width as f32, self.height as f32);
        let at = clip.map(|c| Vec2::new(0.5 + 0.5 * c.x / c.w, 0.5 - 0.5 * c.y / c.w) * size);
        let depth = clip.map(|c| c.z / c.w);
        let lit = corners.map(|v| shade(v, camera.to_eye));
        let area = (at[1] - at[0]).perp_dot(at[2] - at[0]);
        if area.abs() < 1e-12 {
            return;
        }
        let low = at[0].min(at[1]).min(at[2]).floor().max(Vec2::ZERO);
        let high = at[0].max(at[1]).max(at[2]).ceil().min(size);
        for row in low.y as usize..high.y as usize {
            for column in low.x as usize..high.x as usize {
                let p = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let w1 = (p - at[0]).perp_dot(at[2] - at[0]) / area;
                let w2 = (at[1] - at[0]).perp_dot(p - at[0]) / area;
                let weights = [1.0 - w1 - w2, w1, w2];
                if weights.iter().any(|&w| w < 0.0) {
                    continue;
                }
                let z: f32 = (0..3).map(|i| weights[i] * depth[i]).sum();
                let pixel = row * self.width + column;
                if z < self.depths[pixel] {
                    self.depths[pixel] = z;
                    self.colours[pixel] = [0, 1, 2].map(|c| (0..3).map(|i| weights[i] * lit[i][c]).sum());
                }
            }
        }
    }

    /// Means over squares of `factor` pixels.
    pub(super) fn reduced(&self, factor: usize) -> Self {
        let (width, height) = (self.width / factor, self.height / factor);
        let mut small = Self::new(width, height, Rgb([0.0; 3]));
        let share = 1.0 / (factor * factor) as f32;
        for row in 0..height * factor {
            for column in 0..width * factor {
                let from = self.colours[row * self.width + column];
                let to = &mut small.colours[row / factor * width + column / factor];
                for c in 0..3 {
                    to[c] += from[c] * share;
                }
            }
        }
        small
    }

    /// Paints one pixel; outside ones are ignored.
    pub(super) fn paint(&mut self, column: usize, row: usize, colour: Rgb) {
        if column < self.width && row < self.height {
            self.colours[row * self.width + column] = colour.0;
        }
    }

    /// Rows of 8-bit sRGB.
    pub(super) fn to_rgb8(&self) -> Vec<u8> {
        self.colours.iter().flat_map(|c| c.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)).collect()
    }

    /// One pixel, 8-bit.
    #[cfg(test)]
    pub(super) fn pixel(&self, column: usize, row: usize) -> [u8; 3] {
        self.colours[row * self.width + column].map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)
    }
}

/// Diffuse light from above the eye, a little from everywhere, and a faint highlight.
fn shade(vertex: Vertex, to_eye: Vec3) -> [f32; 3] {
    let lamp = (to_eye + Vec3::new(-0.3, 0.0, 0.4)).normalize();
    // Both sides are lit: the inside of an open body is seen as well.
    let facing = if vertex.normal.dot(to_eye) < 0.0 { -vertex.normal } else { vertex.normal };
    let diffuse = facing.dot(lamp).max(0.0);
    let highlight = facing.dot((lamp + to_eye).normalize()).max(0.0).powi(40);
    vertex.colour.0.map(|c| c * (0.42 + 0.62 * diffuse) + 0.08 * highlight)
}
