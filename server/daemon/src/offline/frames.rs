//! Frames as a VTU series with its index, for ParaView.
use super::folder;
use glam::DVec3;
use miette::{IntoDiagnostic, WrapErr};
use palpate_physics::{Model, State};
use palpate_scene::files::{Cells, Field, PvdIndex, Values, VtuFrame, write_vtu};
use std::path::{Path, PathBuf};

/// A growing series.
pub(super) struct Frames {
    folder: PathBuf,
    index: PvdIndex,
    times_s: Vec<f64>,
    region: Vec<u32>,
    displacement_m: Vec<DVec3>,
    /// Positions (m) of the skin of a body with particles.
    skin_m: Vec<DVec3>,
}

fn name_of(frame: usize) -> String {
    format!("{}/frame-{frame:06}.vtu", folder::FRAMES)
}

fn add(folder: &Path, index: &mut PvdIndex, times_s: &mut Vec<f64>, frame: &VtuFrame<'_>) -> miette::Result<()> {
    let name = name_of(times_s.len());
    write_vtu(&folder.join(&name), frame)?;
    let time_s = frame.time_s.unwrap_or_default();
    index.add(time_s, &name)?;
    times_s.push(time_s);
    Ok(())
}

impl Frames {
    /// Frames go to `frames/` in the output folder, behind those of these times (s) that are there already.
    pub(super) fn new(out: &Path, model: &Model, there_s: &[f64]) -> miette::Result<Self> {
        let folder = out.join(folder::FRAMES);
        std::fs::create_dir_all(&folder)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot create {}", folder.display()))?;
        let regions = model.body().filling_tets().map_or(&[][..], |solid| &solid.tet_region);
        let region = regions.iter().map(|&region| u32::from(region)).collect();
        let mut index = PvdIndex::create(&out.join(folder::INDEX))?;
        for (frame, &time_s) in there_s.iter().enumerate() {
            index.add(time_s, &name_of(frame))?;
        }
        let times_s = there_s.to_vec();
        Ok(Self { folder: out.to_path_buf(), index, times_s, region, displacement_m: Vec::new(), skin_m: Vec::new() })
    }

    /// Writes a frame and adds it to the index, so that an interrupted run can be opened.
    pub(super) fn write(&mut self, time_s: f64, model: &Model, state: &State) -> miette::Result<()> {
        let Some(solid) = model.body().filling_tets() else { return self.write_skin(time_s, model, state) };
        let rest = model.rest_positions_m();
        self.displacement_m.clear();
        self.displacement_m.extend(state.mechanical.x.iter().zip(rest).map(|(x, rest)| *x - *rest));
        let frame = VtuFrame {
            points: &state.mechanical.x,
            cells: Cells::Tets(solid.mesh.tets()),
            point_data: &[
                Field { name: "displacement_m", values: Values::Vectors(&self.displacement_m) },
                Field { name: "velocity_m_per_s", values: Values::Vectors(&state.mechanical.v) },
            ],
            cell_data: &[Field { name: "material", values: Values::Integers(&self.region) }],
            time_s: Some(time_s),
        };
        add(&self.folder, &mut self.index, &mut self.times_s, &frame)
    }

    /// Of a body with particles, its skin; of springs, the surface refined everywhere.
    fn write_skin(&mut self, time_s: f64, model: &Model, state: &State) -> miette::Result<()> {
        model.surface_positions_m(state, &mut self.skin_m);
        let rest = model.surface().nodes.iter().map(|&node| model.surface_rest_positions_m()[node as usize]);
        self.displacement_m.clear();
        self.displacement_m.extend(self.skin_m.iter().zip(rest).map(|(x, rest)| *x - rest));
        let frame = VtuFrame {
            points: &self.skin_m,
            cells: Cells::Triangles(&model.surface().triangles),
            point_data: &[Field { name: "displacement_m", values: Values::Vectors(&self.displacement_m) }],
            cell_data: &[],
            time_s: Some(time_s),
        };
        add(&self.folder, &mut self.index, &mut self.times_s, &frame)
    }

    /// Frames so far.
    pub(super) fn count(&self) -> usize {
        self.times_s.len()
    }

    /// Their times (s).
    pub(super) fn times_s(&self) -> &[f64] {
        &self.times_s
    }
}
