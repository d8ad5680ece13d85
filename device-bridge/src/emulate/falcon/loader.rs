//! A Falcon's loader: greeted at one rate, it takes the firmware at another, and says every byte again.
use crate::device::falcon::firmware::{GREETING, GREETING_BAUD, LOADING_BAUD, READY};

/// What it has come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Waits to be greeted.
    Waiting,
    /// Greeted: waits for the other rate.
    Greeted,
    /// Takes it.
    Loading,
}

/// The loader, and what is to be loaded.
#[derive(Debug)]
pub(super) struct Loader {
    firmware: Vec<u8>,
    stage: Stage,
    heard: Vec<u8>,
    taken: Vec<u8>,
}

impl Loader {
    pub(super) fn new(firmware: Vec<u8>) -> Self {
        Self { firmware, stage: Stage::Waiting, heard: Vec::new(), taken: Vec::new() }
    }

    /// All of it, and nothing else.
    pub(super) fn is_loaded(&self) -> bool {
        self.taken == self.firmware
    }

    /// What it says to a byte. Bytes at a rate that is not its own are none; a deaf one takes other bytes than it is told.
    pub(super) fn take(&mut self, byte: u8, baud: u32, is_deaf: bool) -> Vec<u8> {
        match self.stage {
            _ if baud == GREETING_BAUD => {
                self.heard.push(byte);
                if !self.heard.ends_with(GREETING[0]) {
                    return Vec::new();
                }
                self.heard.clear();
                self.taken.clear();
                self.stage = Stage::Greeted;
                // A zero first, as some say.
                [&[0], GREETING[1]].concat()
            }
            Stage::Greeted if baud == LOADING_BAUD && [byte] == READY[0] => {
                self.stage = Stage::Loading;
                READY[1].to_vec()
            }
            Stage::Loading if baud == LOADING_BAUD => {
                let byte = if is_deaf { !byte } else { byte };
                self.taken.push(byte);
                vec![byte]
            }
            _ => Vec::new(),
        }
    }
}
