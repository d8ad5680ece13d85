//! The loop's doorbell and the task that listens to it.
//!
//! Waking a task through its runtime would take the run queue's mutex inside the tick; a doorbell is one system call.
use palpate_realtime::Doorbell;
use std::io::{self, ErrorKind};
use tokio::net::unix::pipe::Receiver;

/// The task's end; rings in between are merged into one.
#[derive(Debug)]
pub struct Ear(Receiver);

/// A doorbell and its ear. Needs a runtime's context.
///
/// # Errors
/// The operating system's, when it has no descriptors left.
pub fn bell() -> io::Result<(Doorbell, Ear)> {
    let bell = Doorbell::new()?;
    let ear = Receiver::from_owned_fd_unchecked(bell.try_clone_fd()?)?;
    Ok((bell, Ear(ear)))
}

impl Ear {
    /// Returns after at least one ring since the last return. Cancel-safe.
    ///
    /// # Errors
    /// The runtime's, when it shuts down.
    pub async fn rung(&self) -> io::Result<()> {
        loop {
            self.0.readable().await?;
            // An eventfd gives its counter, eight bytes, and starts from zero again.
            match self.0.try_read(&mut [0; 8]) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                other => return other.map(|_| ()),
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
