//! Keys on the bus: `plica/v1/<session>/...`.

use thiserror::Error;

const PREFIX: &str = "plica/v1";
const MAX_NAME_BYTES: usize = 64;

/// A name that cannot be one part of a key.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("`{name}` is not a name: 1 to 64 of the characters A-Z a-z 0-9 _ - .")]
pub struct NameError {
    /// The name that was refused.
    pub name: String,
}

/// Accepts names of sessions, tools, objects and methods: 1 to 64 of `A-Z a-z 0-9 _ - .`.
pub fn check_name(name: &str) -> Result<(), NameError> {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-' | b'.');
    if (1..=MAX_NAME_BYTES).contains(&name.len()) && name.bytes().all(allowed) {
        Ok(())
    } else {
        Err(NameError { name: name.to_owned() })
    }
}

/// True if a key expression can match more than one key.
pub fn is_wildcard(key_expression: &str) -> bool {
    key_expression.contains('*')
}

/// The keys of one session. Tool, object and method names are expected to pass [`check_name`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keys {
    root: String,
}

impl Keys {
    /// Keys under `plica/v1/<session>`.
    pub fn new(session: &str) -> Result<Self, NameError> {
        check_name(session)?;
        Ok(Self { root: format!("{PREFIX}/{session}") })
    }

    /// `plica/v1/<session>`.
    pub fn root(&self) -> &str {
        &self.root
    }

    /// Poses of a tool, input. `*` for all tools.
    pub fn pose(&self, tool: &str) -> String {
        format!("{}/tool/{tool}/pose", self.root)
    }

    /// Wrenches of a tool, output. `*` for all tools.
    pub fn wrench(&self, tool: &str) -> String {
        format!("{}/tool/{tool}/wrench", self.root)
    }

    /// Skin frames of an object, output and queryable. `*` for all objects.
    pub fn skin(&self, object: &str) -> String {
        format!("{}/object/{object}/skin", self.root)
    }

    /// GLB of an object, queryable in chunks.
    pub fn mesh(&self, object: &str) -> String {
        format!("{}/object/{object}/mesh", self.root)
    }

    /// Status, output at 2 Hz and queryable.
    pub fn status(&self) -> String {
        format!("{}/status", self.root)
    }

    /// A method, queryable. `*` for all methods.
    pub fn rpc(&self, method: &str) -> String {
        format!("{}/rpc/{method}", self.root)
    }

    /// Progress of jobs, output.
    pub fn job_progress(&self) -> String {
        format!("{}/job_progress", self.root)
    }

    /// Liveliness token of the daemon.
    pub fn alive(&self) -> String {
        format!("{}/alive", self.root)
    }

    /// The tool of a concrete pose key of this session.
    pub fn tool_of_pose<'k>(&self, key: &'k str) -> Option<&'k str> {
        self.middle(key, "/tool/", "/pose")
    }

    /// The tool of a concrete wrench key of this session.
    pub fn tool_of_wrench<'k>(&self, key: &'k str) -> Option<&'k str> {
        self.middle(key, "/tool/", "/wrench")
    }

    /// The object of a concrete skin key of this session.
    pub fn object_of_skin<'k>(&self, key: &'k str) -> Option<&'k str> {
        self.middle(key, "/object/", "/skin")
    }

    /// The object of a concrete mesh key of this session.
    pub fn object_of_mesh<'k>(&self, key: &'k str) -> Option<&'k str> {
        self.middle(key, "/object/", "/mesh")
    }

    /// The method of a concrete rpc key of this session.
    pub fn method_of_rpc<'k>(&self, key: &'k str) -> Option<&'k str> {
        self.middle(key, "/rpc/", "")
    }

    fn middle<'k>(&self, key: &'k str, before: &str, after: &str) -> Option<&'k str> {
        let name = key.strip_prefix(&self.root)?.strip_prefix(before)?.strip_suffix(after)?;
        check_name(name).ok().map(|()| name)
    }
}
