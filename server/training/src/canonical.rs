//! One text for one JSON value: keys sorted, no blanks, numbers in their shortest form.

use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};

/// The canonical JSON text of `value`.
///
/// # Panics
/// If a map has keys that are not text, or a type refuses to be serialised.
pub fn to_text(value: &impl Serialize) -> String {
    let value = serde_json::to_value(value).expect("plain data becomes JSON");
    let mut text = String::new();
    write(&value, &mut text);
    text
}

/// SHA-256 of the canonical JSON text of `value`, as 64 hexadecimal digits.
///
/// # Panics
/// As [`to_text`].
pub fn fingerprint(value: &impl Serialize) -> String {
    hexadecimal(&Sha256::digest(to_text(value)))
}

/// Lower-case hexadecimal digits.
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn write(value: &Value, text: &mut String) {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<_> = map.iter().collect();
            entries.sort_unstable_by_key(|(key, _)| *key);
            list(text, ['{', '}'], entries, |text, (key, value)| {
                write(&Value::String(key.clone()), text);
                text.push(':');
                write(value, text);
            });
        }
        Value::Array(items) => list(text, ['[', ']'], items, |text, item| write(item, text)),
        other => text.push_str(&other.to_string()),
    }
}

fn list<T>(
    text: &mut String,
    [open, close]: [char; 2],
    items: impl IntoIterator<Item = T>,
    mut each: impl FnMut(&mut String, T),
) {
    text.push(open);
    for (i, item) in items.into_iter().enumerate() {
        if i > 0 {
            text.push(',');
        }
        each(text, item);
    }
    text.push(close);
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn keys_are_sorted_and_numbers_are_short() {
        let value = json!({"b": [1, 2.5, -0.1], "a": {"z": null, "y": "q\"\n"}, "c": 3e4});
        assert_eq!(to_text(&value), r#"{"a":{"y":"q\"\n","z":null},"b":[1,2.5,-0.1],"c":30000.0}"#);
    }

    #[test]
    fn the_fingerprint_is_that_of_the_text() {
        // printf '{}' | sha256sum
        assert_eq!(fingerprint(&json!({})), "44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a");
    }
}
