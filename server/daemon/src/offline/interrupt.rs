//! Ctrl-C and SIGTERM end an offline run cleanly: what is there is written.
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

/// Set by the first Ctrl-C or SIGTERM; a second one ends the program at once.
#[derive(Debug, Clone, Default)]
pub(super) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens on a thread of its own. Where signals cannot be had the run simply cannot be interrupted cleanly.
    pub(super) fn listen() -> Self {
        let flag = Self::default();
        let seen = flag.clone();
        std::thread::spawn(move || {
            let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_all().build() else { return };
            runtime.block_on(async {
                if signal().await {
                    seen.0.store(true, Ordering::Relaxed);
                }
                if signal().await {
                    std::process::exit(130);
                }
            });
        });
        flag
    }

    pub(super) fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

#[cfg(unix)]
async fn signal() -> bool {
    use tokio::signal::unix::{SignalKind, signal};
    let (Ok(mut interrupt), Ok(mut terminate)) = (signal(SignalKind::interrupt()), signal(SignalKind::terminate()))
    else {
        return false;
    };
    tokio::select! { got = interrupt.recv() => got.is_some(), got = terminate.recv() => got.is_some() }
}

#[cfg(not(unix))]
async fn signal() -> bool {
    tokio::signal::ctrl_c().await.is_ok()
}
