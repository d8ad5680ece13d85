//! A second process that takes the force off the arm when this one is killed, or hangs.
//!
//! It holds the arm's connection open and a socket to the bridge, on which the servo says one byte a tick. When that ends without a farewell, or is silent for as long as
//! the watchdog takes to zero, the guard writes the *last words*: bytes that take the force away, whatever came before them. Then an arm that holds its last force until it
//! hears another lets go within milliseconds of a SIGKILL, and not when its own patience ends. To a bridge that hangs it says so, before the words: should that go on, it knows
//! that the arm was let go. It is no help where the connection lives in this process alone (libHD), nor when
//! the machine stops.
use crate::{
    BridgeError,
    device::{LastWords, tcp},
};
use palpate_realtime::OsMeasures;
use std::{
    fs::File,
    io::{ErrorKind, Read as _, Write as _},
    net::TcpStream,
    os::{
        fd::{AsFd as _, OwnedFd},
        unix::{net::UnixStream, process::CommandExt as _},
    },
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};
use tokio::signal::unix::{SignalKind, signal};

/// One a tick: the servo lives.
const BEAT: u8 = b'.';
/// The servo ends, and the arm is without force.
const FAREWELL: u8 = b'q';
/// The guard's only word to the bridge: it speaks to the arm now.
const SPOKEN: u8 = b'!';
/// Last words that do not go out in so long do not go out.
const LAST_WORDS_TAKE: Duration = Duration::from_millis(100);

/// The bridge's end. Dropped, it bids the guard farewell and waits for it.
#[derive(Debug)]
pub struct Guard {
    socket: UnixStream,
    child: Child,
}

impl Guard {
    /// Starts `program` (this one) as a guard who is patient for so long.
    ///
    /// # Errors
    /// What the operating system refuses.
    pub fn start(program: &Path, words: LastWords, patience: Duration, measures: &OsMeasures) -> std::io::Result<Self> {
        let (mut ours, theirs) = UnixStream::pair()?;
        let child = Command::new(program)
            .arg("guard")
            .args(["--patience-us", &patience.as_micros().to_string()])
            .args(["--fifo-priority", &measures.fifo_priority.unwrap_or(0).to_string()])
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .stdout(Stdio::from(words.to))
            // Ctrl-C in a terminal is for the bridge, which takes the force away itself.
            .process_group(0)
            .spawn()?;
        let length = u32::try_from(words.bytes.len()).map_err(std::io::Error::other)?;
        ours.write_all(&length.to_be_bytes())?;
        ours.write_all(&words.bytes)?;
        ours.set_nonblocking(true)?;
        Ok(Self { socket: ours, child })
    }

    /// The servo lives. Neither waits nor allocates; a guard that is slow to listen is no matter. False: there is none any more.
    pub fn beat(&mut self) -> bool {
        let said = self.socket.write(&[BEAT]);
        said.err().is_none_or(|error| matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted))
    }

    /// Whether the guard has spoken since this was asked last: the bridge stood still. Neither waits nor allocates.
    pub fn has_spoken(&mut self) -> bool {
        let mut spoken = false;
        while matches!(self.socket.read(&mut [0; 16]), Ok(1..)) {
            spoken = true;
        }
        spoken
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.socket.set_nonblocking(false);
        let _ = self.socket.write_all(&[FAREWELL]);
        let _ = self.child.wait();
    }
}

/// The guard itself: its input is the bridge, its output the arm.
///
/// # Errors
/// When it is started by hand.
pub fn stand(patience: Duration, measures: &OsMeasures) -> Result<(), BridgeError> {
    let refused = |what| move |source| BridgeError::System { what, source };
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(refused("start the guard"))?;
    let _context = runtime.enter();
    // Whoever ends the bridge in an orderly way ends the guard by it, and nobody else does.
    let _kept: Vec<_> = [SignalKind::terminate(), SignalKind::interrupt(), SignalKind::hangup()].map(signal).into();
    // The servo's own messages tell what was refused; this process has nowhere to.
    drop(measures.apply());
    let input = std::io::stdin().as_fd().try_clone_to_owned().map_err(refused("read what is guarded"))?;
    let output = std::io::stdout().as_fd().try_clone_to_owned().map_err(refused("reach the arm"))?;
    watch(UnixStream::from(input), File::from(output), patience).map_err(refused("guard"))
}

fn watch(mut bridge: UnixStream, mut arm: File, patience: Duration) -> std::io::Result<()> {
    let mut length = [0; 4];
    bridge.read_exact(&mut length)?;
    let mut words = vec![0; u32::from_be_bytes(length) as usize];
    bridge.read_exact(&mut words)?;
    let (mut heard, mut beats) = ([0; 256], false);
    loop {
        match bridge.read(&mut heard) {
            // Killed.
            Ok(0) => return say_the_last(arm, &words),
            Ok(count) if heard[..count].contains(&FAREWELL) => return Ok(()),
            Ok(_) if !beats => {
                beats = true;
                bridge.set_read_timeout(Some(patience.max(Duration::from_micros(1))))?;
            }
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            // It hangs; should it go on, it is watched again.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                // One that is gone meanwhile needs not know.
                let _ = bridge.write_all(&[SPOKEN]);
                say(&mut arm, &words)?;
                beats = false;
                bridge.set_read_timeout(None)?;
            }
            Err(_) => return say_the_last(arm, &words),
        }
    }
}

/// Nobody else listens to the arm any more.
fn say_the_last(mut arm: File, words: &[u8]) -> std::io::Result<()> {
    say(&mut arm, words)?;
    tcp::hear_out(&TcpStream::from(OwnedFd::from(arm)), LAST_WORDS_TAKE);
    Ok(())
}

/// The connection may be one that does not wait.
fn say(arm: &mut File, words: &[u8]) -> std::io::Result<()> {
    let (began, mut said) = (Instant::now(), 0);
    while said < words.len() && began.elapsed() < LAST_WORDS_TAKE {
        match arm.write(&words[said..]) {
            Ok(count) => said += count,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                std::thread::sleep(Duration::from_micros(200));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A guard in a thread, with what its arm hears.
    fn guarded(patience: Duration) -> (UnixStream, UnixStream, std::thread::JoinHandle<std::io::Result<()>>) {
        let (mut bridge, theirs) = UnixStream::pair().unwrap();
        let (arm, guards) = UnixStream::pair().unwrap();
        let guard = std::thread::spawn(move || watch(theirs, File::from(OwnedFd::from(guards)), patience));
        bridge.write_all(&[0, 0, 0, 4]).unwrap();
        bridge.write_all(b"stop").unwrap();
        (bridge, arm, guard)
    }

    fn heard(mut arm: UnixStream) -> String {
        let mut text = String::new();
        arm.read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn a_bridge_that_is_gone_leaves_its_last_words_and_one_that_bids_farewell_none() {
        for (last, words) in [(&b"..."[..], "stop"), (b"..q", ""), (b"", "stop")] {
            let (mut bridge, arm, guard) = guarded(Duration::from_secs(100));
            bridge.write_all(last).unwrap();
            drop(bridge);
            guard.join().unwrap().unwrap();
            assert_eq!(heard(arm), words, "{last:?}");
        }
    }

    #[test]
    fn a_bridge_that_hangs_is_spoken_for_each_time() {
        let (mut bridge, arm, guard) = guarded(Duration::from_millis(20));
        for _ in 0..2 {
            bridge.write_all(b".").unwrap();
            std::thread::sleep(Duration::from_millis(200));
        }
        let mut told = [0; 3];
        assert_eq!((bridge.read(&mut told).unwrap(), &told[..2]), (2, &b"!!"[..]));
        bridge.write_all(b"q").unwrap();
        guard.join().unwrap().unwrap();
        assert_eq!(heard(arm), "stopstop");
    }
}
