//! Particle methods for the hybrid body's fine level, on the block under the small patch, against the lab's references.
mod hybrid_body;

use hybrid_body::{Case, error, problem};
use palpate_physics::hybrid::{kernels::Kernel, methods::Method};

#[test]
fn explore() {
    let methods = [
        None,
        Some(Method::NodalSmoothing { gamma: 0.5 }),
        Some(Method::CorrectedSph { kernel: Kernel::Cone, control: 1.0 }),
        Some(Method::CorrectedSph { kernel: Kernel::Cone, control: 0.1 }),
        Some(Method::CorrectedSph { kernel: Kernel::WendlandC2, control: 1.0 }),
        Some(Method::CorrectedSph { kernel: Kernel::WendlandC2, control: 0.1 }),
        Some(Method::MovingLeastSquares { control: 1.0 }),
        Some(Method::MovingLeastSquares { control: 0.1 }),
        Some(Method::ElementFreeGalerkin),
        Some(Method::RawSph(Kernel::Cone)),
        Some(Method::RawSph(Kernel::WendlandC2)),
    ];
    for method in methods {
        for nu in ["0.30", "0.45", "0.49"] {
            let case = Case { coarse_tets: 4, skin_tets: 32, spacing_m: 2.5e-3, active: 600, method };
            error(&problem(&format!("block-patch-small-nu{nu}")), &case);
        }
    }
}
