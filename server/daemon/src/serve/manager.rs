//! The service manager, if there is one.
use sd_notify::NotifyState;

/// Tells systemd, if it is there.
pub(super) fn notify(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!(%error, "no service manager was told");
    }
}
