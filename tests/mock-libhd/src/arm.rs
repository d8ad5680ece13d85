//! The other end of the socket: lines of text. We say `frame`, `force X Y Z A B C` (N, mN m) and `calibrate STYLE`; to a new connection and to each `frame` it says
//! parameters, `NUMBER values…` each, the number in hexadecimal as in `hdDefines.h`; `text NUMBER words…`, `calibration NUMBER`, `raise NUMBER`; and `.` at the end.
use std::{
    io::{BufRead as _, BufReader, Error, ErrorKind, Write as _},
    os::unix::net::UnixStream,
    time::Duration,
};

/// Where the arm is unless a name says another place.
pub(crate) const DEFAULT: &str = "/tmp/palpate-phantom";
/// An arm that says nothing for so long is gone.
const PATIENCE: Duration = Duration::from_secs(2);

/// What it says.
#[derive(Debug, PartialEq)]
pub(crate) enum Said {
    Numbers(u32, Vec<f64>),
    Text(u32, String),
    Calibration(u32),
    Raise(u32),
}

#[derive(Debug)]
pub(crate) struct Connection {
    says: BufReader<UnixStream>,
    hears: UnixStream,
}

impl Connection {
    pub(crate) fn open(path: &str) -> std::io::Result<Self> {
        let hears = UnixStream::connect(path)?;
        hears.set_read_timeout(Some(PATIENCE))?;
        hears.set_write_timeout(Some(PATIENCE))?;
        Ok(Self { says: BufReader::new(hears.try_clone()?), hears })
    }

    pub(crate) fn say(&mut self, line: &str) -> std::io::Result<()> {
        self.hears.write_all(format!("{line}\n").as_bytes())
    }

    /// All that it says, up to the end.
    pub(crate) fn listen(&mut self) -> std::io::Result<Vec<Said>> {
        let mut all = Vec::new();
        loop {
            let mut line = String::new();
            if self.says.read_line(&mut line)? == 0 {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            match line.trim_end() {
                "." => return Ok(all),
                line => all.push(parse(line).ok_or_else(|| Error::other(format!("strange line: {line}")))?),
            }
        }
    }
}

fn parse(line: &str) -> Option<Said> {
    let number = |word: &str| u32::from_str_radix(word, 16).ok();
    let (word, rest) = line.split_once(' ')?;
    match word {
        "text" => rest.split_once(' ').and_then(|(key, text)| Some(Said::Text(number(key)?, text.to_owned()))),
        "calibration" => number(rest).map(Said::Calibration),
        "raise" => number(rest).map(Said::Raise),
        key => {
            let values = rest.split(' ').map(str::parse).collect::<Result<_, _>>().ok()?;
            Some(Said::Numbers(number(key)?, values))
        }
    }
}
