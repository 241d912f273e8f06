//! Processes at the two ends of a TCP port, as far as this user may see.

use std::fmt;

/// A process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Process {
    /// Its number.
    pub id: u32,
    /// Its name.
    pub name: String,
}

/// The far end of a connection to a port of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Peer {
    /// Address, without the port that each connection has anew.
    pub address: String,
    /// Which process holds the far end, if it is on this machine.
    pub process: Option<Process>,
}

impl fmt::Display for Process {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` (process {})", self.name, self.id)
    }
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.process {
            Some(process) => write!(f, "{process} at {}", self.address),
            None => f.write_str(&self.address),
        }
    }
}

/// The process that listens on a TCP port.
pub(super) fn owner_of_port(port: u16) -> Option<Process> {
    let listens = |c: &Connection| c.state == State::Listening && c.near.1 == port;
    kernel::connections().iter().find(|c| listens(c)).and_then(|c| kernel::holder(&c.inode))
}

/// The far ends of all connections to a TCP port of this machine, in order, without repetitions.
pub(super) fn peers_of_port(port: u16) -> Vec<Peer> {
    let connections = kernel::connections();
    let open = connections.iter().filter(|c| c.state == State::Established && c.near.1 == port);
    let peer = |c: &Connection| {
        let far_end = connections.iter().find(|other| other.near == c.far && other.far == c.near);
        Peer { address: c.far.0.clone(), process: far_end.and_then(|other| kernel::holder(&other.inode)) }
    };
    let mut peers: Vec<Peer> = open.map(peer).collect();
    peers.sort_by_key(ToString::to_string);
    peers.dedup();
    peers
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Established,
    Listening,
    Other,
}

/// A line of the kernel's table: address and port of both ends.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Connection {
    state: State,
    near: (String, u16),
    far: (String, u16),
    inode: String,
}

#[cfg(target_os = "linux")]
mod kernel {
    use std::fs;
    use std::net::{Ipv4Addr, Ipv6Addr};

    use super::{Connection, Process, State};

    /// All TCP connections of this machine.
    pub(super) fn connections() -> Vec<Connection> {
        let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(|table| fs::read_to_string(table).unwrap_or_default());
        tables.iter().flat_map(|table| table.lines().skip(1)).filter_map(connection).collect()
    }

    /// The process that holds a socket.
    pub(super) fn holder(inode: &str) -> Option<Process> {
        let processes = fs::read_dir("/proc").ok()?.flatten();
        let id = processes.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).find(|id| holds(*id, inode))?;
        let name = fs::read_to_string(format!("/proc/{id}/comm")).unwrap_or_default();
        Some(Process { id, name: name.trim().to_owned() })
    }

    fn connection(line: &str) -> Option<Connection> {
        let fields: Vec<_> = line.split_whitespace().collect();
        let state = match *fields.get(3)? {
            "01" => State::Established,
            "0A" => State::Listening,
            _ => State::Other,
        };
        let (near, far) = (end(fields.get(1)?)?, end(fields.get(2)?)?);
        Some(Connection { state, near, far, inode: (*fields.get(9)?).to_owned() })
    }

    /// `0100007F:1D17`: words of the address in the order of this machine, port in hexadecimal digits.
    fn end(text: &str) -> Option<(String, u16)> {
        let (address, port) = text.split_once(':')?;
        let words: Vec<u32> = (0..address.len())
            .step_by(8)
            .map(|i| u32::from_str_radix(address.get(i..i + 8)?, 16).ok())
            .collect::<Option<_>>()?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        let address = match bytes.len() {
            4 => Ipv4Addr::from(<[u8; 4]>::try_from(bytes).ok()?).to_string(),
            _ => {
                let address = Ipv6Addr::from(<[u8; 16]>::try_from(bytes).ok()?);
                address.to_ipv4_mapped().map_or_else(|| address.to_string(), |mapped| mapped.to_string())
            }
        };
        Some((address, u16::from_str_radix(port, 16).ok()?))
    }

    fn holds(id: u32, inode: &str) -> bool {
        let wanted = format!("socket:[{inode}]");
        fs::read_dir(format!("/proc/{id}/fd")).is_ok_and(|mut files| {
            files.any(|file| {
                file.and_then(|f| fs::read_link(f.path())).is_ok_and(|target| target.as_os_str() == wanted.as_str())
            })
        })
    }
}

#[cfg(not(target_os = "linux"))]
mod kernel {
    use super::{Connection, Process};

    pub(super) fn connections() -> Vec<Connection> {
        Vec::new()
    }

    pub(super) fn holder(_inode: &str) -> Option<Process> {
        None
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use std::net::{TcpListener, TcpStream};

    use super::*;

    #[test]
    fn both_ends_of_a_connection_are_named() {
        for address in ["127.0.0.1:0", "[::1]:0"] {
            let Ok(listener) = TcpListener::bind(address) else { continue };
            let port = listener.local_addr().unwrap().port();
            assert_eq!(peers_of_port(port), []);
            let _near = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let _far = listener.accept().unwrap();
            let [peer] = &peers_of_port(port)[..] else { panic!("one connection") };
            assert!(address.contains(&peer.address), "{peer}");
            assert_eq!(peer.process.as_ref().unwrap().id, std::process::id());
            assert_eq!(owner_of_port(port).unwrap().id, std::process::id());
        }
    }
}
