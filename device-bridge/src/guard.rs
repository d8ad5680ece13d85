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
/// Last words to whom nobody else speaks any more, that do not go out in so long, do not go out.
const LAST_WORDS_TAKE: Duration = Duration::from_millis(100);
/// Between two tries to say them.
const LOOK_EVERY: Duration = Duration::from_micros(200);

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

#[cfg(test)]
impl Guard {
    /// One that a test speaks for.
    pub(crate) fn spoken_for() -> (Self, UnixStream) {
        let (socket, theirs) = UnixStream::pair().unwrap();
        socket.set_nonblocking(true).unwrap();
        (Self { socket, child: Command::new("true").spawn().unwrap() }, theirs)
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
    // Of the words, while it hangs: a line may be full.
    let mut unsaid = 0;
    loop {
        match bridge.read(&mut heard) {
            // Killed.
            Ok(0) => return say_the_last(arm, &words, unsaid),
            Ok(count) if heard[..count].contains(&FAREWELL) => return Ok(()),
            Ok(_) => {
                if unsaid > 0 {
                    // Half a message is worse than a late one.
                    let _ = say(&mut arm, &words[words.len() - unsaid..], LAST_WORDS_TAKE);
                    let _ = bridge.write_all(&[SPOKEN]);
                    unsaid = 0;
                }
                if !beats {
                    beats = true;
                    bridge.set_read_timeout(Some(patience.max(Duration::from_micros(1))))?;
                }
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            // It hangs; should it go on, it is watched again.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                // Before the words, so that no answer is earlier, and behind them, for they may take their time. One that is gone meanwhile needs not know.
                if unsaid == 0 {
                    let _ = bridge.write_all(&[SPOKEN]);
                    unsaid = words.len();
                }
                // What an arm refuses that is gone, nobody can say to it.
                unsaid = say(&mut arm, &words[words.len() - unsaid..], Duration::ZERO).unwrap_or(0);
                if unsaid == 0 {
                    let _ = bridge.write_all(&[SPOKEN]);
                }
                beats = false;
                bridge.set_read_timeout((unsaid > 0).then_some(LOOK_EVERY))?;
            }
            Err(_) => return say_the_last(arm, &words, unsaid),
        }
    }
}

/// Nobody else listens to the arm any more. So many of them, which were begun, come first.
fn say_the_last(mut arm: File, words: &[u8], unsaid: usize) -> std::io::Result<()> {
    say(&mut arm, &words[words.len() - unsaid..], LAST_WORDS_TAKE)?;
    say(&mut arm, words, LAST_WORDS_TAKE)?;
    tcp::hear_out(&TcpStream::from(OwnedFd::from(arm)), LAST_WORDS_TAKE);
    Ok(())
}

/// On a connection that may be one that does not wait, for so long at most; how many bytes are left.
fn say(arm: &mut File, words: &[u8], patience: Duration) -> std::io::Result<usize> {
    let (began, mut said) = (Instant::now(), 0);
    while said < words.len() {
        match arm.write(&words[said..]) {
            Ok(count) => said += count,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                if began.elapsed() >= patience {
                    break;
                }
                std::thread::sleep(LOOK_EVERY);
            }
            Err(error) => return Err(error),
        }
    }
    Ok(words.len() - said)
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

    /// The words were given up after 0.1 s, half said perhaps, and whatever stood in the line before them was heard in their place.
    #[test]
    fn a_line_that_is_full_while_the_bridge_hangs_hears_the_words_when_it_listens() {
        let (mut bridge, theirs) = UnixStream::pair().unwrap();
        let (mut arm, mut line) = UnixStream::pair().unwrap();
        line.set_nonblocking(true).unwrap();
        while line.write(&[b'x'; 4096]).is_ok() {}
        let held = File::from(OwnedFd::from(line));
        let guard = std::thread::spawn(move || watch(theirs, held, Duration::from_millis(5)));
        bridge.write_all(b"\0\0\0\x04stop.").unwrap();
        std::thread::sleep(Duration::from_millis(300));
        let mut text = String::new();
        let mut bytes = [0; 4096];
        while !text.ends_with("stop") {
            let count = arm.read(&mut bytes).unwrap();
            text.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
        }
        bridge.write_all(b".q").unwrap();
        guard.join().unwrap().unwrap();
        assert_eq!(text.trim_start_matches('x'), "stop", "once, and whole");
    }

    #[test]
    fn a_bridge_that_hangs_is_spoken_for_each_time() {
        let (mut bridge, arm, guard) = guarded(Duration::from_millis(20));
        for _ in 0..2 {
            bridge.write_all(b".").unwrap();
            std::thread::sleep(Duration::from_millis(200));
        }
        let mut told = [0; 8];
        assert_eq!((bridge.read(&mut told).unwrap(), &told[..4]), (4, &b"!!!!"[..]));
        bridge.write_all(b"q").unwrap();
        guard.join().unwrap().unwrap();
        assert_eq!(heard(arm), "stopstop");
    }
}
