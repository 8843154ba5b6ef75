//! Ports for tests and demonstrations: nobody listens there until this process, or one that it
//! starts, does, and the system gives them to nobody else meanwhile.
//!
//! ```
//! let address = fht_reserved_port::reserve()?;
//! assert!(std::net::TcpStream::connect(address).is_err());
//! let listener = std::net::TcpListener::bind(address)?;
//! assert!(std::net::TcpStream::connect(address).is_ok());
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! A port that the system gave, and that was given back, may be somebody else's a moment later. And
//! it need not be free yet: a process that another thread was just starting has a copy of the
//! listener until it runs its program. So the port is kept here, bound, without listening. Whoever
//! listens there must allow the reuse of addresses (`SO_REUSEADDR`), as the standard library,
//! tokio, Zenoh and Python's asyncio do.
//!
//! Systems other than Linux let nobody else listen on a port that is bound. There it is given back
//! at once.

use socket2::{Domain, Socket, Type};
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Mutex;

/// Kept until the process ends.
static RESERVED: Mutex<Vec<Socket>> = Mutex::new(Vec::new());

/// A loopback address whose port the system gives to nobody else, on any of its IPv4 addresses, as
/// long as this process runs.
///
/// # Errors
/// When no port is free.
pub fn reserve() -> io::Result<SocketAddr> {
    let socket = Socket::new(Domain::IPV4, Type::STREAM, None)?;
    socket.set_reuse_address(true)?;
    socket.bind(&SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)).into())?;
    let bound = socket.local_addr()?.as_socket().ok_or(io::ErrorKind::AddrNotAvailable)?;
    if cfg!(target_os = "linux") {
        RESERVED.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(socket);
    }
    Ok(SocketAddr::from((Ipv4Addr::LOCALHOST, bound.port())))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // tests may panic

    use super::*;
    use std::collections::BTreeSet;
    use std::net::{TcpListener, TcpStream};

    #[test]
    fn nobody_listens_there_until_somebody_does() {
        let address = reserve().unwrap();
        assert_eq!(TcpStream::connect(address).unwrap_err().kind(), io::ErrorKind::ConnectionRefused);
        for _ in 0..2 {
            let _listener = TcpListener::bind(address).unwrap();
            let _stream = TcpStream::connect(address).unwrap();
            assert_eq!(TcpListener::bind(address).unwrap_err().kind(), io::ErrorKind::AddrInUse);
        }
    }

    #[test]
    fn nobody_else_gets_it() {
        let reserved: BTreeSet<u16> = (0..200).map(|_| reserve().unwrap().port()).collect();
        assert_eq!(reserved.len(), 200);
        let listeners: Vec<TcpListener> = (0..500).map(|_| TcpListener::bind("127.0.0.1:0").unwrap()).collect();
        assert!(listeners.iter().all(|listener| !reserved.contains(&listener.local_addr().unwrap().port())));
    }
}
