//! Rest data of every tet, computed once at load; without that, once a substep.
use super::{Found, pair};
use crate::{methods::tet_body, press::Press, timing::interleaved};
use miette::{IntoDiagnostic, Result};
use palpate_physics::{Model, Skips, elements::linear_tet::RestTet};

const TETS: u32 = 1_352;

pub(super) fn run(rounds: usize) -> Result<Found> {
    let model = Model::build(pair::scene(TETS, 0.0, Skips::default())?).into_diagnostic()?;
    let body = tet_body(&model);
    let mut once = Press::new(&model, 0.0, 1);
    let mut again = Press::new(&model, 0.0, 1);
    let mut rest_tets = body.rest_tets().to_vec();
    let mut recompute = || {
        for _ in 0..model.substeps() {
            for (tet, rest) in rest_tets.iter_mut().enumerate() {
                *rest = RestTet::new(&body.mesh().edge_matrix_m(tet));
            }
            std::hint::black_box(&rest_tets);
        }
        again.tick();
    };
    let times = interleaved(&mut [Box::new(|| _ = once.tick()), Box::new(&mut recompute)], rounds);
    let same_bits = rest_tets == body.rest_tets() && once.state() == again.state();
    let farthest_m = pair::farthest_m(once.state(), again.state());
    Ok(Found { with: times[0], without: times[1], same_bits, farthest_m })
}
