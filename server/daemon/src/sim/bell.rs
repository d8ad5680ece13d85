//! The loop's doorbell and the task that listens to it.
//!
//! Waking a task through its runtime would take the run queue's mutex inside the tick; a doorbell is one system call.
use palpate_realtime::Doorbell;
use std::io;
use tokio::io::{Interest, unix::AsyncFd};

/// The task's end; rings in between are merged into one.
#[derive(Debug)]
pub struct Ear(AsyncFd<Doorbell>);

/// A doorbell and its ear. Needs a runtime's context.
///
/// # Errors
/// The operating system's, when it has no descriptors left.
// Deprecated for types whose descriptor may change or close under the reactor; a Doorbell's lives as long as it does. The
// replacement is an unsafe function, and this crate has no unsafe code.
#[allow(deprecated)]
pub fn bell() -> io::Result<(Doorbell, Ear)> {
    let bell = Doorbell::new()?;
    Ok((bell.clone(), Ear(AsyncFd::with_interest(bell, Interest::READABLE)?)))
}

impl Ear {
    /// Returns after at least one ring since the last return. Cancel-safe.
    ///
    /// # Errors
    /// The runtime's, when it shuts down.
    pub async fn rung(&self) -> io::Result<()> {
        loop {
            let mut ready = self.0.readable().await?;
            // Readiness is cleared first: a ring after `answer` makes it ready again.
            ready.clear_ready();
            if self.0.get_ref().answer() > 0 {
                return Ok(());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[tokio::test]
    async fn rings_wake_once_and_are_merged() {
        let (bell, ear) = bell().unwrap();
        let remote = bell.clone();
        std::thread::spawn(move || (0..3).for_each(|_| remote.ring())).join().unwrap();
        ear.rung().await.unwrap();
        assert!(tokio::time::timeout(Duration::from_millis(20), ear.rung()).await.is_err(), "all three were one");
        bell.ring();
        ear.rung().await.unwrap();
    }
}
