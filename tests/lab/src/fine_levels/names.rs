//! The methods by name.
use super::methods::{CONTROL, Kernel, Method};

/// What makes up the fine level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FineMethod {
    /// What ships: cells between eight particles.
    Cells,
    /// What it is compared with.
    Points(Method),
}

impl FineMethod {
    /// All of them, the one that ships first.
    pub const ALL: [Self; 9] = [
        Self::Cells,
        Self::Points(Method::RawSph(Kernel::Cone)),
        Self::Points(Method::RawSph(Kernel::WendlandC2)),
        Self::Points(Method::CorrectedSph { kernel: Kernel::Cone, control: CONTROL }),
        Self::Points(Method::CorrectedSph { kernel: Kernel::WendlandC2, control: CONTROL }),
        Self::Points(Method::MovingLeastSquares { control: CONTROL }),
        Self::Points(Method::ElementFreeGalerkin),
        Self::Points(Method::NodalSmoothing { gamma: 0.3 }),
        Self::Points(Method::NodalSmoothing { gamma: 0.5 }),
    ];

    /// Its name.
    pub fn name(self) -> String {
        let kernel = |kernel: Kernel| if kernel == Kernel::Cone { "cone" } else { "Wendland" };
        match self {
            Self::Cells => "cells".to_owned(),
            Self::Points(Method::RawSph(of)) => format!("raw SPH {}", kernel(of)),
            Self::Points(Method::CorrectedSph { kernel: of, .. }) => format!("corrected SPH {}", kernel(of)),
            Self::Points(Method::MovingLeastSquares { .. }) => "moving least squares".to_owned(),
            Self::Points(Method::ElementFreeGalerkin) => "element-free Galerkin".to_owned(),
            Self::Points(Method::NodalSmoothing { gamma }) => format!("smoothed tets {gamma}"),
        }
    }
}
