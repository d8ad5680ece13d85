//! `load`, `reset`, `detach`, `pause`, `resume`, `step`, `save`, `restore`: what happens to the session.
use crate::{ViewError, cli, connect::Server};
use clap::{Args, Subcommand};
use palpate_proto::{
    MAX_SNAPSHOT_BYTES,
    connect::Connection,
    v1::{
        DetachRequest, ListRequest, LoadSceneRequest, PauseRequest, ResetRequest, RestoreRequest, SnapshotRequest,
        StepRequest, load_scene_request::Source, session_client::SessionClient,
    },
};
use std::path::PathBuf;

/// The commands that change a session. Forces on arms ramp to zero before time stops or jumps.
#[derive(Debug, Subcommand)]
pub enum Control {
    /// Loads another scene: one of the daemon's built-in scenes, or a scene file from here
    ///
    /// A file from here is sent as text, and may refer to no other file. One that names mesh files has to be where the daemon is
    /// (--on-daemon). On any error the running scene goes on.
    Load {
        /// Name of a built-in scene, or a scene file (.toml)
        scene: PathBuf,
        /// The file is on the daemon's machine, below a folder that `palpated --scene-folder` names
        #[arg(long)]
        on_daemon: bool,
    },
    /// Puts the body back to rest at tick 0; ends a quarantine
    Reset,
    /// Takes the tool from an arm, which does not come back by itself
    ///
    /// Its force ramps to zero first.
    Detach {
        /// Tool of the scene [default: the only one that an arm drives]
        #[arg(default_value = "", hide_default_value = true)]
        tool: String,
    },
    /// Stops time
    Pause,
    /// Lets time go on
    Resume,
    /// Advances a paused session
    Step {
        /// Ticks, 1 to 1 000 000
        #[arg(default_value_t = 1)]
        ticks: u32,
    },
    /// Saves the whole dynamic state, for `restore`
    Save(SaveArguments),
    /// Goes back to a state that `save` wrote, in the same scene; ends a quarantine
    Restore {
        /// The file
        file: PathBuf,
    },
}

/// Arguments of `save`.
#[derive(Debug, Args)]
pub struct SaveArguments {
    /// The file to write
    file: PathBuf,
    /// Replace it if it exists
    #[arg(long)]
    force: bool,
}

/// Runs one of the commands.
///
/// # Errors
/// A file, an unreachable daemon, or its refusal.
pub async fn run(server: &Server, control: &Control) -> Result<(), ViewError> {
    let mut client = SessionClient::new(server.connect().await?)
        .max_decoding_message_size(MAX_SNAPSHOT_BYTES)
        .max_encoding_message_size(MAX_SNAPSHOT_BYTES);
    // The daemon has one session; no name means that one.
    let session_id = String::new();
    let said = match control {
        Control::Load { scene, on_daemon } => load(&mut client, scene, *on_daemon).await?,
        Control::Reset => {
            let tick = client.reset(ResetRequest { session_id }).await?.into_inner().tick;
            format!("at rest, at tick {tick}")
        }
        Control::Detach { tool } => {
            let request = DetachRequest { session_id, tool_name: tool.clone() };
            let done = client.detach(request).await?.into_inner();
            format!("tool \"{}\" is free: device \"{}\" has no force and is gone", done.tool_name, done.device_name)
        }
        Control::Pause => {
            let tick = client.pause(PauseRequest { session_id, paused: true }).await?.into_inner().tick;
            format!("paused at tick {tick}; `palpate-view resume` lets time go on")
        }
        Control::Resume => {
            let tick = client.pause(PauseRequest { session_id, paused: false }).await?.into_inner().tick;
            format!("time goes on from tick {tick}")
        }
        Control::Step { ticks } => {
            let done = client.step(StepRequest { session_id, ticks: *ticks }).await?.into_inner();
            format!("at tick {}, {:.3} s", done.tick, done.time_s)
        }
        Control::Save(arguments) => {
            let saved = client.snapshot(SnapshotRequest { session_id }).await?.into_inner();
            cli::write_new(&arguments.file, &saved.state, arguments.force)?;
            format!("{}: tick {}, state {:016x}", arguments.file.display(), saved.tick, saved.state_hash)
        }
        Control::Restore { file } => {
            let state = cli::read(file)?.into();
            let done = client.restore(RestoreRequest { session_id, state }).await?.into_inner();
            format!("at tick {}, state {:016x}", done.tick, done.state_hash)
        }
    };
    cli::say(&said)
}

async fn load(client: &mut SessionClient<Connection>, scene: &PathBuf, on_daemon: bool) -> Result<String, ViewError> {
    let name = scene.to_string_lossy().into_owned();
    let builtin = client.list(ListRequest {}).await?.into_inner().builtin_scenes;
    let source = if on_daemon {
        Source::Path(name)
    } else if builtin.contains(&name) {
        Source::Builtin(name)
    } else if scene.exists() {
        let no_text = |_| ViewError::NoScene { scene: name.clone(), known: "the file is no text (UTF-8)".into() };
        Source::Toml(String::from_utf8(cli::read(scene)?).map_err(no_text)?)
    } else {
        let known =
            format!("no file of that name is here, and the daemon's built-in scenes are {}", builtin.join(", "));
        return Err(ViewError::NoScene { scene: name, known });
    };
    let loaded = client.load_scene(LoadSceneRequest { source: Some(source) }).await?.into_inner();
    let session = loaded.session.unwrap_or_default();
    let mut said = format!(
        "{}: {} tets, {} substeps a tick (session {})",
        session.scene_name, session.tet_count, session.substeps_per_tick, session.session_id
    );
    for warning in loaded.warnings {
        said.push_str("\nwarning: ");
        said.push_str(&warning);
    }
    Ok(said)
}
