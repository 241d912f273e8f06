//! Which process listens on a port, as far as this user may see.

/// Number and name of the process that listens on a TCP port.
#[cfg(target_os = "linux")]
pub(super) fn owner_of_port(port: u16) -> Option<(u32, String)> {
    let inode = listening_inode(port)?;
    let processes = std::fs::read_dir("/proc").ok()?.flatten();
    processes.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).find_map(|pid: u32| {
        holds_socket(pid, &inode).then(|| {
            let name = std::fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default();
            (pid, name.trim().to_owned())
        })
    })
}

/// Inode of the socket in state LISTEN (0A) on `port`, from the kernel's tables.
#[cfg(target_os = "linux")]
fn listening_inode(port: u16) -> Option<String> {
    let wanted = format!(":{port:04X}");
    ["/proc/net/tcp", "/proc/net/tcp6"].iter().find_map(|table| {
        let table = std::fs::read_to_string(table).ok()?;
        table.lines().skip(1).find_map(|line| {
            let fields: Vec<_> = line.split_whitespace().collect();
            let listens = fields.get(3) == Some(&"0A") && fields.get(1)?.ends_with(&wanted);
            listens.then(|| fields.get(9).map(|inode| (*inode).to_owned())).flatten()
        })
    })
}

#[cfg(target_os = "linux")]
fn holds_socket(pid: u32, inode: &str) -> bool {
    let wanted = format!("socket:[{inode}]");
    std::fs::read_dir(format!("/proc/{pid}/fd")).is_ok_and(|mut files| {
        files.any(|file| {
            file.and_then(|f| std::fs::read_link(f.path())).is_ok_and(|target| target.as_os_str() == wanted.as_str())
        })
    })
}

#[cfg(not(target_os = "linux"))]
pub(super) fn owner_of_port(_port: u16) -> Option<(u32, String)> {
    None
}
