//! Wakes an async task from a real-time thread: one `eventfd`, one system call, no lock.
//!
//! A tokio task takes [`Doorbell::try_clone_fd`] as a `tokio::net::unix::pipe::Receiver` (`from_owned_fd_unchecked`; eight bytes
//! are read from it as from a pipe), waits until it is readable, reads, and looks into its slot. A thread polls the
//! descriptor and calls [`Doorbell::answer`].
use rustix::{
    event::{EventfdFlags, eventfd},
    fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd, RawFd},
    io::{read, write},
};
use std::{io, sync::Arc};

/// A counter in the kernel that makes its file descriptor readable. Clones ring the same bell.
#[derive(Debug, Clone)]
pub struct Doorbell {
    fd: Arc<OwnedFd>,
}

impl Doorbell {
    /// A silent bell.
    ///
    /// # Errors
    /// When the process has too many open files.
    pub fn new() -> io::Result<Self> {
        Ok(Self { fd: Arc::new(eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)?) })
    }

    /// Makes the descriptor readable. Never blocks: rings nobody answered add up, and a full counter is readable already.
    pub fn ring(&self) {
        let _ = write(&*self.fd, &1_u64.to_ne_bytes());
    }

    /// Another descriptor of the same bell, for a runtime that wants to own one. Not blocking.
    ///
    /// # Errors
    /// When the process has too many open files.
    pub fn try_clone_fd(&self) -> io::Result<OwnedFd> {
        self.fd.try_clone()
    }

    /// Silences it; how often it rang since the last answer.
    pub fn answer(&self) -> u64 {
        let mut rings = [0; 8];
        match read(&*self.fd, &mut rings) {
            Ok(8) => u64::from_ne_bytes(rings),
            _ => 0,
        }
    }
}

impl AsFd for Doorbell {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

impl AsRawFd for Doorbell {
    fn as_raw_fd(&self) -> RawFd {
        self.fd.as_raw_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::event::{PollFd, PollFlags, Timespec, poll};

    fn readable(bell: &Doorbell) -> bool {
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        poll(&mut [PollFd::new(bell, PollFlags::IN)], Some(&now)).unwrap() == 1
    }

    #[test]
    fn rings_until_answered() {
        let bell = Doorbell::new().unwrap();
        assert!(!readable(&bell));
        assert_eq!(bell.answer(), 0);
        bell.ring();
        bell.clone().ring();
        assert!(readable(&bell));
        let mut rings = [0; 8];
        read(bell.try_clone_fd().unwrap(), &mut rings).unwrap();
        assert_eq!(u64::from_ne_bytes(rings), 2);
        bell.clone().ring();
        bell.ring();
        assert_eq!(bell.answer(), 2);
        assert!(!readable(&bell));
    }
}
