//! A TCP connection to an arm: opened with patience, small messages sent at once.
use std::{
    io::{Error, ErrorKind, Read as _, Result},
    net::{TcpStream, ToSocketAddrs as _},
    time::{Duration, Instant},
};

/// Between two looks at whether more has come.
const LOOK_EVERY: Duration = Duration::from_micros(200);
/// So often is read at once, at most: who sends more does not hold a loop up.
const MOST_READS: usize = 8;

/// Connects to the first of the address's places that answers; writes wait as long, at most.
///
/// # Errors
/// Of the last place.
pub fn connect(address: &str, patience: Duration) -> Result<TcpStream> {
    let mut last = Error::new(ErrorKind::NotFound, "the name has no address");
    for place in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&place, patience) {
            Ok(stream) => {
                // A message must not wait for more to be sent with it.
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(patience))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Reads and drops what comes until the other side ends the connection, for so long at most. To be done before a connection is closed behind last words: one that is closed
/// while something is unread is reset, and who finds that when it answers the first word may hear no more. Ends at once on what is no socket.
pub fn hear_out(stream: &TcpStream, patience: Duration) {
    let began = Instant::now();
    if stream.set_nonblocking(true).is_err() {
        return;
    }
    while began.elapsed() < patience && drop_what_came(stream).is_ok() {
        std::thread::sleep(LOOK_EVERY);
    }
}

/// Reads and drops what has come on a connection that does not wait, and not all of it where it comes without a pause; whether anything had.
///
/// # Errors
/// The other side ended the connection, or it broke.
pub fn drop_what_came(mut stream: &TcpStream) -> Result<bool> {
    let mut came = false;
    for _ in 0..MOST_READS {
        match stream.read(&mut [0; 1024]) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(_) => came = true,
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(came)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{io::Write as _, net::TcpListener};

    /// Closed at once, the connection is reset, and who answers each part of the words before it reads the next never reads that.
    #[test]
    fn last_words_arrive_whatever_was_left_unread() {
        for _ in 0..20 {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let mut ours = connect(&listener.local_addr().unwrap().to_string(), Duration::from_secs(20)).unwrap();
            let mut theirs = listener.accept().unwrap().0;
            theirs.write_all(&[b'.'; 100]).unwrap();
            ours.write_all(b"stop").unwrap();
            let other = std::thread::spawn(move || {
                // It does something else first, and answers what it reads.
                std::thread::sleep(Duration::from_millis(5));
                let mut heard = [0; 4];
                theirs.read_exact(&mut heard[..2])?;
                theirs.write_all(b"answer")?;
                theirs.read_exact(&mut heard[2..])?;
                theirs.write_all(b"answer")?;
                Ok::<_, Error>(heard)
            });
            hear_out(&ours, Duration::from_secs(20));
            drop(ours);
            assert_eq!(&other.join().unwrap().unwrap(), b"stop");
        }
    }
}
