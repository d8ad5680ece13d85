//! Exit codes of `simulate` and `static` when there is a result that is not to be trusted, and the words that go with
//! them.
use miette::{Diagnostic, Report};
use palpate_physics::Quarantine;
use palpate_scene::wording::counted;
use std::process::ExitCode;
use thiserror::Error;

/// What `--help` of both commands says.
pub(super) const CODES: &str = "\
Exit code: 0 when it is done; 1 when there is no result: a scene that is refused, no equilibrium, a folder that cannot be written; 2 for a \
mistake on the command line. There is a result, and it is not to be trusted: 3 when a state that would not be finite was refused \
(quarantine), 4 when elements turned inside out, 5 when an equilibrium is not stable or its forces do not balance.";

/// Why a result is not to be trusted.
#[derive(Debug, Error, Diagnostic)]
pub(super) enum Untrusted {
    /// The run stopped before its end.
    #[error("{what}; the run stopped there{inverted}")]
    #[diagnostic(help(
        "the step may be unstable: leave `numerics.substeps` out, raise `stretch_allowance`, or press less hard"
    ))]
    Quarantined {
        /// Where.
        what: Quarantine,
        /// What came before, if elements had turned inside out.
        inverted: String,
    },
    /// Somewhere in the run there were elements with `det F ≤ 0`.
    #[error("elements turned inside out: {least}; {end}")]
    #[diagnostic(help(
        "no real body does that. Press or load less hard, or refine the mesh there; law = \"stvk\" gives way where it is pressed \
         to some half of its length and stays inside out, \"stable-neo-hookean\" does not"
    ))]
    Inverted {
        /// The least volume ratio, where and when.
        least: String,
        /// What became of it.
        end: String,
    },
    /// An equilibrium with elements that have `det F ≤ 0`.
    #[error(
        "this equilibrium has {} turned inside out: it is one of the formulas, not one of a body",
        counted(*count as usize, "element")
    )]
    #[diagnostic(help("apply less load, refine the mesh, or take law = \"stable-neo-hookean\""))]
    InvertedAtRest {
        /// How many.
        count: u32,
    },
    /// The tangent stiffness is not positive definite.
    #[error("this equilibrium is not stable: at the least push the body would leave it{balance}")]
    #[diagnostic(help(
        "the load may be past what the body carries before it buckles; let `palpated simulate` come to rest, or apply less load"
    ))]
    Unstable {
        /// What else is wrong with it.
        balance: String,
    },
    /// Forces are left that are more than rounding.
    #[error("this is no equilibrium: {0}")]
    #[diagnostic(help("let `palpated simulate` come to rest, and look for constants or loads in the wrong unit"))]
    Unbalanced(String),
}

impl Untrusted {
    /// A word for it in summaries.
    pub(super) fn word(&self) -> &'static str {
        match self {
            Self::Quarantined { .. } => "quarantined",
            Self::Inverted { .. } | Self::InvertedAtRest { .. } => "inverted",
            Self::Unstable { .. } => "unstable",
            Self::Unbalanced(_) => "unbalanced",
        }
    }

    /// Tells it on standard error; the command's exit code.
    pub(super) fn told(self) -> ExitCode {
        let code = match self {
            Self::Quarantined { .. } => 3,
            Self::Inverted { .. } | Self::InvertedAtRest { .. } => 4,
            Self::Unstable { .. } | Self::Unbalanced(_) => 5,
        };
        eprintln!("Error: {:?}", Report::new(self));
        ExitCode::from(code)
    }
}
