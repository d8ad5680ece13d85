//! The deformed surface rebuilt from the stream: keyframe chunks, then displacements of changed vertices in quanta.
use crate::ViewError;
use glam::Vec3;
use palpate_proto::{
    connect::Connection,
    v1::{
        KeyframeChunk, KeyframeHeader, LevelOfDetail, SurfaceUpdate, WatchRequest, surface_client::SurfaceClient,
        surface_event::Message,
    },
};
use std::time::Duration;
use tonic::Streaming;

/// A daemon sends updates at the asked rate, even while time stands: silence for so much longer is a fault.
const PATIENCE: Duration = Duration::from_secs(5);

/// A surface as last seen.
#[derive(Debug, Clone, Default)]
pub struct Surface {
    /// Epoch of its keyframe.
    pub epoch: u32,
    /// Names and counts.
    pub header: KeyframeHeader,
    /// Rest positions (m).
    pub rest_m: Vec<Vec3>,
    /// Displacements (m).
    pub displacement_m: Vec<Vec3>,
    /// Triangles as vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// Last update, its arrays taken out.
    pub last: SurfaceUpdate,
}

impl Surface {
    /// Deformed positions (m).
    pub fn positions_m(&self) -> Vec<Vec3> {
        self.rest_m.iter().zip(&self.displacement_m).map(|(rest, displacement)| *rest + *displacement).collect()
    }

    /// Applies an update of the same epoch.
    ///
    /// # Errors
    /// Arrays that do not fit each other or the keyframe.
    pub fn apply(&mut self, mut update: SurfaceUpdate) -> Result<(), ViewError> {
        let displacements: Vec<i16> = values(&update.displacements_i16le, i16::from_le_bytes)?;
        let count = displacements.len() / 3;
        let changed: Vec<u32> = values(&update.changed_u32le, u32::from_le_bytes)?;
        let all = changed.is_empty();
        let fits = if all { count == 0 || count == self.rest_m.len() } else { changed.len() == count };
        if !fits || !displacements.len().is_multiple_of(3) {
            return Err(broken(format!("moves {count} vertices of {}", self.rest_m.len())));
        }
        for i in 0..count {
            let vertex = if all { i } else { changed[i] as usize };
            let quanta = Vec3::from_array([0, 1, 2].map(|axis| f32::from(displacements[3 * i + axis])));
            match self.displacement_m.get_mut(vertex) {
                Some(displacement) => *displacement = quanta * update.displacement_quantum_m,
                None => return Err(broken(format!("moves vertex {vertex} of {}", self.rest_m.len()))),
            }
        }
        update.changed_u32le.clear();
        update.displacements_i16le.clear();
        self.last = update;
        Ok(())
    }
}

/// The stream and the surface it keeps up to date.
pub struct Watcher {
    stream: Streaming<palpate_proto::v1::SurfaceEvent>,
    chunks: Vec<KeyframeChunk>,
    /// Longest silence that is not taken for a fault.
    pub patience: Duration,
    /// The surface, once its keyframe is complete.
    pub surface: Option<Surface>,
}

impl Watcher {
    /// Starts to watch the current session.
    ///
    /// # Errors
    /// The daemon's refusal, among them a rate that it does not give.
    pub async fn start(channel: Connection, max_rate_hz: f64, detail: LevelOfDetail) -> Result<Self, ViewError> {
        let level_of_detail = detail as i32;
        Self::ask(channel, WatchRequest { max_rate_hz, level_of_detail, ..Default::default() }).await
    }

    /// Starts to watch what is asked for.
    ///
    /// # Errors
    /// The daemon's refusal, among them a rate that it does not give.
    pub async fn ask(channel: Connection, request: WatchRequest) -> Result<Self, ViewError> {
        let max_rate_hz = request.max_rate_hz;
        let stream = SurfaceClient::new(channel).watch(request).await?.into_inner();
        // The daemon has taken the rate: 0 (its own) or up to 240 Hz.
        let period_s = if max_rate_hz > 0.0 { 1.0 / max_rate_hz } else { 0.0 };
        let patience = PATIENCE.saturating_add(Duration::try_from_secs_f64(period_s).unwrap_or(Duration::MAX));
        Ok(Self { stream, chunks: Vec::new(), patience, surface: None })
    }

    /// Waits for the next update and applies it; `None` when the daemon ends the stream.
    ///
    /// # Errors
    /// A broken or silent stream.
    pub async fn next(&mut self) -> Result<Option<&Surface>, ViewError> {
        loop {
            let silent = |_| ViewError::Silent { silence_s: self.patience.as_secs_f64() };
            let event = tokio::time::timeout(self.patience, self.stream.message()).await.map_err(silent)??;
            let Some(event) = event else { return Ok(None) };
            match event.message {
                Some(Message::Keyframe(chunk)) => self.push(chunk)?,
                Some(Message::Update(update)) => {
                    let Some(surface) = self.surface.as_mut().filter(|s| s.epoch == update.epoch) else { continue };
                    surface.apply(update)?;
                    return Ok(self.surface.as_ref());
                }
                None => {}
            }
        }
    }

    fn push(&mut self, chunk: KeyframeChunk) -> Result<(), ViewError> {
        if chunk.chunk == 0 {
            self.chunks.clear();
        }
        let other_epoch = self.chunks.first().is_some_and(|first| first.epoch != chunk.epoch);
        if chunk.chunk as usize != self.chunks.len() || chunk.chunk >= chunk.chunk_count || other_epoch {
            return Err(broken(format!("brings keyframe chunk {} out of order", chunk.chunk)));
        }
        let count = chunk.chunk_count as usize;
        self.chunks.push(chunk);
        if self.chunks.len() == count {
            self.surface = Some(assemble(&std::mem::take(&mut self.chunks))?);
        }
        Ok(())
    }
}

/// Joins the chunks of a keyframe.
///
/// # Errors
/// A missing header, or counts that differ from it.
pub fn assemble(chunks: &[KeyframeChunk]) -> Result<Surface, ViewError> {
    let header = chunks
        .first()
        .and_then(|chunk| chunk.header.clone())
        .ok_or_else(|| broken("has a keyframe without header".into()))?;
    let joined = |part: fn(&KeyframeChunk) -> &[u8]| -> Vec<u8> {
        chunks.iter().flat_map(|c| part(c).iter().copied()).collect()
    };
    let rest: Vec<f32> = values(&joined(|c| &c.rest_positions_m_f32le), f32::from_le_bytes)?;
    let indices: Vec<u32> = values(&joined(|c| &c.triangles_u32le), u32::from_le_bytes)?;
    let rest_m: Vec<Vec3> = rest.chunks_exact(3).map(Vec3::from_slice).collect();
    let triangles: Vec<[u32; 3]> = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let counts_fit = rest_m.len() == header.vertex_count as usize && triangles.len() == header.triangle_count as usize;
    if !counts_fit || indices.iter().any(|&index| index as usize >= rest_m.len()) {
        return Err(broken("has a keyframe whose counts or indices do not fit".into()));
    }
    let displacement_m = vec![Vec3::ZERO; rest_m.len()];
    let epoch = chunks[0].epoch;
    Ok(Surface { epoch, header, rest_m, displacement_m, triangles, last: SurfaceUpdate::default() })
}

/// Length of a vector of the wire; 0 when it is not there.
pub fn magnitude(v: Option<&palpate_proto::v1::Vec3>) -> f64 {
    v.map_or(0.0, |v| (v.x * v.x + v.y * v.y + v.z * v.z).sqrt())
}

pub(crate) fn values<const N: usize, T>(bytes: &[u8], of: fn([u8; N]) -> T) -> Result<Vec<T>, ViewError> {
    let (whole, rest) = bytes.as_chunks::<N>();
    if rest.is_empty() {
        Ok(whole.iter().map(|&b| of(b)).collect())
    } else {
        Err(broken("has an array cut short".into()))
    }
}

pub(crate) fn broken(what: String) -> ViewError {
    ViewError::Stream(what)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keyframe() -> Vec<KeyframeChunk> {
        let rest: Vec<u8> =
            [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let triangles: Vec<u8> = [0_u32, 1, 2].iter().flat_map(|v| v.to_le_bytes()).collect();
        let header = KeyframeHeader { vertex_count: 3, triangle_count: 1, ..Default::default() };
        let cut = 5;
        vec![
            KeyframeChunk {
                epoch: 9,
                chunk: 0,
                chunk_count: 2,
                header: Some(header),
                rest_positions_m_f32le: rest[..cut].to_vec().into(),
                ..Default::default()
            },
            KeyframeChunk {
                epoch: 9,
                chunk: 1,
                chunk_count: 2,
                rest_positions_m_f32le: rest[cut..].to_vec().into(),
                triangles_u32le: triangles.into(),
                ..Default::default()
            },
        ]
    }

    fn moved(vertices: &[u32], quanta: &[i16]) -> SurfaceUpdate {
        SurfaceUpdate {
            epoch: 9,
            displacement_quantum_m: 0.5,
            changed_u32le: vertices.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().into(),
            displacements_i16le: quanta.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().into(),
            ..Default::default()
        }
    }

    #[test]
    fn a_keyframe_split_in_the_middle_of_a_number_is_joined() {
        let surface = assemble(&keyframe()).unwrap();
        assert_eq!(surface.rest_m, vec![Vec3::ZERO, Vec3::X, Vec3::Y]);
        assert_eq!(surface.triangles, vec![[0, 1, 2]]);
    }

    #[test]
    fn updates_move_named_vertices() {
        let mut surface = assemble(&keyframe()).unwrap();
        surface.apply(moved(&[2], &[2, 0, -4])).unwrap();
        assert_eq!(surface.positions_m()[2], Vec3::new(1.0, 1.0, -2.0));
        surface.apply(moved(&[], &[])).unwrap();
        assert_eq!(surface.displacement_m[2], Vec3::new(1.0, 0.0, -2.0));
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        let mut surface = assemble(&keyframe()).unwrap();
        assert!(surface.apply(moved(&[3], &[0, 0, 0])).is_err());
        assert!(surface.apply(moved(&[0, 1], &[0, 0, 0])).is_err());
        assert!(surface.apply(moved(&[], &[0, 0, 0])).is_err());
        let mut chunks = keyframe();
        chunks.pop();
        assert!(assemble(&chunks).is_err());
    }
}
