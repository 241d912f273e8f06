//! An error with its causes as one sentence.

/// The error and its causes, without a cause that the sentence before has said already.
pub fn sentence(error: &anyhow::Error) -> String {
    let mut message = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if message.is_empty() {
            message = cause;
        } else if !message.contains(&cause) {
            message = format!("{message}: {cause}");
        }
    }
    message
}

#[cfg(test)]
mod tests {
    use anyhow::{Context, anyhow};

    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("all of it: {0}")]
    struct Whole(#[source] std::io::Error);

    #[test]
    fn a_cause_is_said_once() {
        let cause = || std::io::Error::other("no space");
        assert_eq!(sentence(&Whole(cause()).into()), "all of it: no space");
        assert_eq!(sentence(&anyhow::Error::from(cause()).context("a.toml")), "a.toml: no space");
        let doubled: Result<(), _> = Err(anyhow!("no space")).context("no space");
        assert_eq!(doubled.map_err(|e| sentence(&e)), Err("no space".to_owned()));
    }
}
