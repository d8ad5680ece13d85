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
    count: usize,
    region: Vec<u32>,
    displacement_m: Vec<DVec3>,
}

impl Frames {
    /// Frames go to `frames/` in the output folder.
    pub(super) fn new(out: &Path, model: &Model) -> miette::Result<Self> {
        let folder = out.join(folder::FRAMES);
        std::fs::create_dir_all(&folder)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot create {}", folder.display()))?;
        let region = model.spec().tet_region.iter().map(|&region| u32::from(region)).collect();
        let index = PvdIndex::create(&out.join(folder::INDEX))?;
        Ok(Self { folder: out.to_path_buf(), index, count: 0, region, displacement_m: Vec::new() })
    }

    /// Writes a frame and adds it to the index, so that an interrupted run can be opened.
    pub(super) fn write(&mut self, time_s: f64, model: &Model, state: &State) -> miette::Result<()> {
        let rest = model.rest_positions_m();
        self.displacement_m.clear();
        self.displacement_m.extend(state.x.iter().zip(rest).map(|(x, rest)| *x - *rest));
        let name = format!("{}/frame-{:06}.vtu", folder::FRAMES, self.count);
        let frame = VtuFrame {
            points: &state.x,
            cells: Cells::Tets(model.mesh().tets()),
            point_data: &[
                Field { name: "displacement_m", values: Values::Vectors(&self.displacement_m) },
                Field { name: "velocity_m_per_s", values: Values::Vectors(&state.v) },
            ],
            cell_data: &[Field { name: "material", values: Values::Integers(&self.region) }],
            time_s: Some(time_s),
        };
        write_vtu(&self.folder.join(&name), &frame)?;
        self.index.add(time_s, &name)?;
        self.count += 1;
        Ok(())
    }

    /// Frames so far.
    pub(super) fn count(&self) -> usize {
        self.count
    }
}
