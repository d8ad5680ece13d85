//! Keeps the running session from time to time, when the daemon stops, and before another scene takes its place.
use super::folder::{Kept, KeptError, KeptFolder, Slot};
use crate::{
    session::{ActiveSession, Daemon},
    sim::command::{Copy, Done, Refusal},
};
use palpate_physics::snapshot;
use palpate_realtime::Clock;
use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use thiserror::Error;
use tokio::{sync::Mutex, time::sleep};

/// How the session is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct AutosaveSettings {
    /// Where.
    pub folder: KeptFolder,
    /// How often.
    pub every: Duration,
}

/// Keeps sessions.
#[derive(Debug)]
pub struct Autosave {
    settings: AutosaveSettings,
    /// One at a time: the last to begin is the last to be written.
    writing: Mutex<()>,
    /// When the running session was last written (ns, monotonic); 0: not yet.
    saved_ns: AtomicU64,
    /// When this began (ns, monotonic).
    began_ns: u64,
}

/// Why the session was not kept.
#[derive(Debug, Error)]
enum NotKept {
    #[error("the loop gave no copy: {0}")]
    Copy(#[from] Refusal),
    #[error(transparent)]
    File(#[from] KeptError),
    #[error("writing it failed unexpectedly")]
    Panic,
}

/// A copy of a session that can be kept: its scene is known.
type Taken = (Arc<ActiveSession>, Box<Copy>, Done);

impl Autosave {
    /// Nothing is written before it is told to.
    pub fn new(settings: AutosaveSettings) -> Self {
        Self { settings, writing: Mutex::new(()), saved_ns: AtomicU64::new(0), began_ns: Clock::Monotonic.now_ns() }
    }

    /// Age of the newest that was written (s).
    pub fn age_s(&self, now_ns: u64) -> Option<f64> {
        let saved_ns = self.saved_ns.load(Ordering::Relaxed);
        (saved_ns > 0).then(|| now_ns.saturating_sub(saved_ns) as f64 * 1e-9)
    }

    /// Since when nothing was written (s): as [`Self::age_s`] or, before the first, since the start.
    pub fn unsaved_s(&self) -> f64 {
        let now_ns = Clock::Monotonic.now_ns();
        self.age_s(now_ns).unwrap_or(now_ns.saturating_sub(self.began_ns) as f64 * 1e-9)
    }

    /// Keeps the session from time to time, until the daemon stops.
    pub async fn run(self: Arc<Self>, daemon: Arc<Daemon>) {
        loop {
            tokio::select! {
                () = daemon.stop.cancelled() => return,
                () = sleep(self.settings.every) => self.keep(&daemon, Slot::Newest).await,
            }
        }
    }

    /// Keeps the session as it is. What goes wrong is logged: the session goes on.
    pub async fn keep(&self, daemon: &Daemon, slot: Slot) {
        let kept = match self.take(daemon).await {
            Ok(Some(taken)) => self.write(taken, slot).await,
            Ok(None) => return,
            Err(error) => Err(error),
        };
        self.tell(kept, slot);
    }

    /// A copy of the session now, for [`Self::keep_last`].
    pub async fn last(&self, daemon: &Daemon) -> Option<Taken> {
        self.take(daemon).await.unwrap_or_else(|error| {
            self.tell(Err(error), Slot::Newest);
            None
        })
    }

    /// Keeps what was copied when the daemon began to stop.
    pub async fn keep_last(&self, taken: Taken) {
        let kept = self.write(taken, Slot::Newest).await;
        self.tell(kept, Slot::Newest);
    }

    async fn take(&self, daemon: &Daemon) -> Result<Option<Taken>, NotKept> {
        let session = daemon.session();
        if session.source.is_none() {
            return Ok(None);
        }
        let (copy, done, _room) = daemon.copy(&session).await?;
        // A body that has come to grief is not kept in the place of one that was well.
        Ok(copy.state.quarantine.is_none().then_some((session, copy, done)))
    }

    async fn write(&self, (session, copy, done): Taken, slot: Slot) -> Result<(), NotKept> {
        let _one_at_a_time = self.writing.lock().await;
        let folder = self.settings.folder.clone();
        let write = move || {
            let Some(source) = session.source.clone() else { return Ok(()) };
            let Done { tick, time_s, paused, .. } = done;
            let state = snapshot::save(&session.model, &copy.state);
            let state_hash = snapshot::state_hash(&copy.state);
            folder.write(slot, &Kept { source, state, state_hash, tick, time_s, paused })
        };
        tokio::task::spawn_blocking(write).await.map_err(|_| NotKept::Panic)?.map_err(NotKept::File)
    }

    fn tell(&self, kept: Result<(), NotKept>, slot: Slot) {
        match kept {
            Ok(()) if slot == Slot::Replaced => {}
            Ok(()) => {
                let now_ns = Clock::Monotonic.now_ns();
                if self.saved_ns.swap(now_ns, Ordering::Relaxed) == 0 {
                    tracing::info!(every_s = self.settings.every.as_secs_f64(), "the session is kept from now on");
                }
            }
            Err(error) => {
                let error = crate::telemetry::causes(&error);
                tracing::error!(error, "the session was not kept; what was kept before is there still");
            }
        }
    }
}
