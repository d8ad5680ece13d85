//! A TCP connection to an arm: opened with patience, small messages sent at once.
use std::{
    io::{Error, ErrorKind, Result},
    net::{TcpStream, ToSocketAddrs as _},
    time::Duration,
};

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
