//! What is cited is in the bibliography, and what documents name exists.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::collections::BTreeSet;
use std::path::Path;

use plica_tests::citations::{bibliography_keys, cited_keys, named_paths};
use plica_tests::words::{HOUSE_WORDS, lines_with};
use plica_tests::{files, read, repository};

const CITING: [&str; 5] = [".rs", ".md", ".toml", ".py", ".wgsl"];

/// This crate's own sources show keys as examples.
fn cites(path: &Path) -> bool {
    !path.starts_with(repository().join("tests"))
}

#[test]
fn every_cited_key_is_in_the_bibliography() {
    let known = bibliography_keys(&read(&repository().join("server/references.bib")));
    let mut cited = BTreeSet::new();
    for path in files(&repository(), &CITING).into_iter().filter(|p| cites(p)) {
        for key in cited_keys(&read(&path)) {
            assert!(known.contains(&key), "{} cites [{key}], which server/references.bib lacks", path.display());
            cited.insert(key);
        }
    }
    let unused: Vec<_> = known.difference(&cited).collect();
    assert!(unused.is_empty(), "server/references.bib holds what nobody cites: {unused:?}");
}

#[test]
fn every_path_in_a_document_exists() {
    let root = repository();
    let is_folder = |entry: &std::fs::DirEntry| entry.path().is_dir();
    let names = |folder: &Path| -> Vec<String> {
        let entries = folder.read_dir().unwrap().flatten().filter(is_folder);
        entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect()
    };
    let folders = [names(&root), names(&root.join("server")), vec!["docs".to_owned()]].concat();
    for document in files(&root, &[".md"]) {
        let around = [document.parent().unwrap().to_owned(), root.clone(), root.join("server")];
        for path in named_paths(&read(&document), &folders) {
            let exists = around.iter().any(|folder| folder.join(&path).exists());
            assert!(exists, "{} names `{path}`, which does not exist", document.display());
        }
    }
}

#[test]
fn keys_and_paths_are_recognised() {
    let keys = cited_keys(
        r"see [MG04], [Saad03, alg. 9.1] and \[KMBG09\]; not [N/m], [u32], [V3], [f64; 24], [n_nodes], [AtomicU64]",
    );
    assert_eq!(keys.into_iter().collect::<Vec<_>>(), ["KMBG09", "MG04", "Saad03"]);
    let bibliography = "@book{Saad03,\n  title = {x},\n}\n@inproceedings{MG04,\n}\n";
    assert_eq!(bibliography_keys(bibliography).len(), 2);
    let text = "`sim/src/step.rs`, `MATH.md`, `rpc/step`, [a](docs/a.png), [b](https://x.org/y), `A dv = r`\n```\n`no.rs`\n```";
    assert_eq!(named_paths(text, &["sim".to_owned()]), ["docs/a.png", "sim/src/step.rs", "MATH.md"]);
}

#[test]
fn comments_and_messages_use_the_words_of_the_glossary() {
    let folders = ["server", "clients", "protocol"].map(|folder| repository().join(folder));
    let sources: Vec<_> = folders.iter().flat_map(|folder| files(folder, &[".rs"])).collect();
    for house in HOUSE_WORDS {
        let places = sources.iter().flat_map(|path| {
            let lines = lines_with(&read(path), house.word);
            lines.into_iter().map(move |line| format!("{}:{line}", path.display()))
        });
        let places: Vec<String> = places.collect();
        assert!(
            places.is_empty(),
            "\"{}\" is said where the term is {}:\n{}",
            house.word,
            house.term,
            places.join("\n")
        );
    }
}

#[test]
fn house_words_are_found_in_comments_and_strings_only() {
    assert_eq!(
        lines_with("/// The Verdict.\nlet verdict = judge(\"a verdict\");\nlet verdict = 1;", "verdict"),
        [1, 2]
    );
    assert_eq!(lines_with("// confirm, firmer, firm_up", "firm"), [0; 0]);
}
