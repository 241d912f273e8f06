//! Citations `[KEY]` or `[KEY, where]`, the bibliography, and paths in documents.

use std::collections::BTreeSet;

/// Keys cited in a text: initials or a name, two digits of the year, perhaps a letter; `[MG04]`, `[Saad03, alg. 9.1]`.
pub fn cited_keys(text: &str) -> BTreeSet<String> {
    text.split('[').skip(1).filter_map(key_at_start).collect()
}

/// Keys of the entries of a BibTeX file.
pub fn bibliography_keys(bibliography: &str) -> BTreeSet<String> {
    let entries = bibliography.lines().filter(|line| line.starts_with('@'));
    entries.filter_map(|line| Some(line.split_once('{')?.1.trim().trim_end_matches(',').to_owned())).collect()
}

/// Targets of links and names in backquotes that look like files or folders of the repository.
///
/// In backquotes: a path that begins with one of `folders`, or a single name with an extension of a source or a document.
pub fn named_paths(document: &str, folders: &[String]) -> Vec<String> {
    let prose = without_code_blocks(document);
    let links = prose.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let links = links.filter(|l| !l.contains("://") && !l.starts_with('#') && !l.is_empty());
    let quoted = prose.split('`').skip(1).step_by(2).filter(|name| is_path(name, folders));
    let clean = |p: &str| p.split('#').next().unwrap_or(p).trim_end_matches('/').to_owned();
    links.chain(quoted).map(clean).collect()
}

fn key_at_start(rest: &str) -> Option<String> {
    let letters = rest.chars().take_while(char::is_ascii_alphabetic).count();
    let digits = rest[letters..].chars().take_while(char::is_ascii_digit).count();
    let suffix = usize::from(rest[letters + digits..].starts_with(|c: char| c.is_ascii_lowercase()));
    let (key, after) = rest.split_at(letters + digits + suffix);
    // Initials of several authors, or one author's name; not `AtomicU64`.
    let (name, lower) = (&rest[..letters], |c: char| c.is_ascii_lowercase());
    let is_name = name.chars().all(|c| c.is_ascii_uppercase())
        || name.starts_with(|c: char| c.is_ascii_uppercase()) && name.chars().skip(1).all(lower);
    let is_key = letters >= 2 && digits == 2 && is_name;
    (is_key && after.starts_with([']', ',', '\\'])).then(|| key.to_owned())
}

fn without_code_blocks(document: &str) -> String {
    document.split("```").step_by(2).collect()
}

fn is_path(name: &str, folders: &[String]) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    let first = name.split('/').next().unwrap_or("");
    let is_in_folder = name.contains('/') && folders.iter().any(|f| f == first);
    let is_file = [".rs", ".md", ".bib", ".py", ".toml", ".json5"].iter().any(|e| name.ends_with(e) && name != *e);
    name.chars().all(is_plain) && (is_in_folder || is_file)
}
