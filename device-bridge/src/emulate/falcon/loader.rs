//! A Falcon's loader: greeted at one rate, it takes the firmware at another, and says every byte again.
use crate::device::falcon::firmware::{GREETING, GREETING_BAUD, LOADING_BAUD, READY};

/// What it has come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Waits to be greeted.
    Waiting,
    /// Greeted: waits for the other rate.
    Greeted,
    /// Takes so many bytes that it has already.
    Loading(usize),
}

/// The loader, and what is to be loaded.
#[derive(Debug)]
pub(super) struct Loader {
    firmware: Vec<u8>,
    stage: Stage,
    heard: Vec<u8>,
}

impl Loader {
    pub(super) fn new(firmware: Vec<u8>) -> Self {
        Self { firmware, stage: Stage::Waiting, heard: Vec::new() }
    }

    /// All of it, and nothing else.
    pub(super) fn is_loaded(&self) -> bool {
        self.stage == Stage::Loading(self.firmware.len())
    }

    /// What it says to a byte. Bytes at a rate that is not its own are none; a deaf one takes other bytes than it is told.
    pub(super) fn take(&mut self, byte: u8, baud: u32, is_deaf: bool) -> Vec<u8> {
        match self.stage {
            Stage::Waiting | Stage::Greeted if baud == GREETING_BAUD => {
                self.heard.push(byte);
                if !self.heard.ends_with(GREETING[0]) {
                    return Vec::new();
                }
                self.heard.clear();
                self.stage = Stage::Greeted;
                // A zero first, as some say.
                [&[0], GREETING[1]].concat()
            }
            Stage::Greeted if baud == LOADING_BAUD && [byte] == READY[0] => {
                self.stage = Stage::Loading(0);
                READY[1].to_vec()
            }
            Stage::Loading(count) if baud == LOADING_BAUD => {
                let byte = if is_deaf { !byte } else { byte };
                // Anything but the firmware does not run.
                self.stage =
                    if self.firmware.get(count) == Some(&byte) { Stage::Loading(count + 1) } else { Stage::Waiting };
                vec![byte]
            }
            _ => Vec::new(),
        }
    }
}
