//! Open connections of the server: their number, and which of them may be dropped.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Largest number of connections at once, each with a thread; browsers open six to one server.
pub(super) const MAX_CONNECTIONS: usize = 64;
/// Interval at which a full server looks for a connection to drop again.
const RETRY_INTERVAL: Duration = Duration::from_millis(100);

/// The open connections, the oldest first.
#[derive(Default)]
pub(super) struct Connections {
    open: Mutex<Vec<Connection>>,
    freed: Condvar,
}

struct Connection {
    id: u64,
    stream: TcpStream,
    state: State,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    /// It sends a request, or its answer is complete.
    Idle,
    /// Its request is answered.
    Served,
    /// It has been closed; its thread ends.
    Dropped,
}

/// The place of one connection, given back when dropped.
pub(super) struct Place<'a> {
    connections: &'a Connections,
    id: u64,
}

impl Connections {
    /// Adds a connection. If there are [`MAX_CONNECTIONS`], the oldest one whose request is not
    /// complete, or is answered already, is closed; if all are being answered, this waits.
    ///
    /// # Errors
    /// An error of the operating system.
    pub(super) fn admit(&self, stream: &TcpStream) -> io::Result<Place<'_>> {
        let stream = stream.try_clone()?;
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        while open.len() >= MAX_CONNECTIONS {
            let mut idle = open.iter_mut().filter(|other| other.state == State::Idle);
            if let Some(oldest) = idle.next() {
                oldest.state = State::Dropped;
                // Fails if the other side has closed it.
                let _ = oldest.stream.shutdown(Shutdown::Both);
            }
            let waited = self.freed.wait_timeout(open, RETRY_INTERVAL);
            open = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let id = open.last().map_or(0, |last| last.id + 1);
        open.push(Connection {
            id,
            stream,
            state: State::Idle,
        });
        Ok(Place {
            connections: self,
            id,
        })
    }
}

impl Place<'_> {
    /// Marks the connection as one whose request is being answered; false if it was closed before.
    pub(super) fn begin_answer(&self) -> bool {
        self.change(State::Served)
    }

    /// Marks the connection as one whose answer is complete.
    pub(super) fn end_answer(&self) {
        self.change(State::Idle);
    }

    fn change(&self, state: State) -> bool {
        let open = self.connections.open.lock();
        let mut open = open.unwrap_or_else(PoisonError::into_inner);
        let own = open.iter_mut().find(|connection| connection.id == self.id);
        match own {
            Some(own) if own.state != State::Dropped => {
                own.state = state;
                true
            }
            _ => false,
        }
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        let open = self.connections.open.lock();
        let mut open = open.unwrap_or_else(PoisonError::into_inner);
        open.retain(|connection| connection.id != self.id);
        self.connections.freed.notify_all();
    }
}

/// A connection whose reads and writes all end by one time, however slowly the other side goes on.
pub(super) struct Timed<'a> {
    stream: &'a TcpStream,
    end: Instant,
}

impl<'a> Timed<'a> {
    /// Limits a connection to `time` from now.
    pub(super) fn new(stream: &'a TcpStream, time: Duration) -> Self {
        Self {
            stream,
            end: Instant::now() + time,
        }
    }

    /// The time that is left; none is an error.
    fn left(&self) -> io::Result<Option<Duration>> {
        let left = self.end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        Ok(Some(left))
    }
}

impl Read for Timed<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.stream.set_read_timeout(self.left()?)?;
        (&mut &*self.stream).read(buffer)
    }
}

impl Write for Timed<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.set_write_timeout(self.left()?)?;
        (&mut &*self.stream).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        (&mut &*self.stream).flush()
    }
}
