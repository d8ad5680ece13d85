//! Flags of `palpated serve`.

/// Flags of `palpated serve`.
#[derive(Debug, Clone, clap::Args)]
pub struct ServeArgs {
    /// Scene file or name of a built-in scene
    #[arg(value_name = "SCENE", default_value = "ventricle")]
    pub scene: String,
}
