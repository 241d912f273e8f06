//! What an encoding says of its payload.

/// Whether an encoding says JSON: `application/json`, `text/json` or a type that ends in `+json`, in any case, with any
/// parameters behind a semicolon.
pub fn is_json(encoding: &str) -> bool {
    let media_type = encoding.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    matches!(media_type.as_str(), "application/json" | "text/json" | "application/x-json")
        || media_type.ends_with("+json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_recognised_with_parameters_and_in_any_case() {
        for encoding in [
            crate::ENCODING_JSON,
            "application/json;charset=utf-8",
            "application/json; charset=UTF-8",
            "Application/JSON",
            "text/json",
            "application/vnd.tracker+json;v=2",
        ] {
            assert!(is_json(encoding), "{encoding}");
        }
        for encoding in
            ["", crate::ENCODING_BYTES, "zenoh/bytes;application/json", "text/json5", "application/jsonl", "json"]
        {
            assert!(!is_json(encoding), "{encoding}");
        }
    }
}
