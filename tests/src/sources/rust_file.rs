//! What one source file declares, imports and names. Test code does not count.

use std::collections::BTreeSet;

use super::tokens::{Token, tokens};

/// A `use` of one name.
#[derive(Clone, Debug)]
pub(super) struct Import {
    /// The name in this file; `*` for all.
    pub(super) name: String,
    /// Segments as written.
    pub(super) path: Vec<String>,
    /// `pub use`, `pub(crate) use` and so on.
    pub(super) is_public: bool,
}

/// One source file.
#[derive(Default)]
pub(super) struct RustFile {
    /// Modules in files of their own.
    pub(super) modules: Vec<String>,
    /// Names of the file's own items at its top.
    pub(super) declared: BTreeSet<String>,
    /// Imports, those inside of functions among them.
    pub(super) imports: Vec<Import>,
    /// Paths of two and more segments outside of imports.
    pub(super) paths: Vec<Vec<String>>,
    /// Every name outside of imports.
    pub(super) named: BTreeSet<String>,
}

const ITEMS: [&str; 10] = ["fn", "struct", "enum", "union", "trait", "type", "const", "static", "macro_rules", "mod"];

impl RustFile {
    pub(super) fn parse(source: &str) -> RustFile {
        let mut reader =
            Reader { tokens: tokens(source), at: 0, depth: 0, inline: Vec::new(), file: RustFile::default() };
        while reader.at < reader.tokens.len() {
            reader.take();
        }
        reader.file
    }
}

struct Reader {
    tokens: Vec<Token>,
    at: usize,
    /// Open braces.
    depth: usize,
    /// Depths at which modules with a body in this file began.
    inline: Vec<usize>,
    file: RustFile,
}

impl Reader {
    fn take(&mut self) {
        let Some(token) = self.tokens.get(self.at).cloned() else { return };
        match token {
            Token::Sign('#') if self.at_attribute() => self.take_attribute(),
            Token::Sign(c) => {
                self.count_brace(c);
                self.at += 1;
            }
            Token::PathSeparator => self.at += 1,
            Token::Name(word) if word == "use" => self.take_use(),
            Token::Name(word) if ITEMS.contains(&word.as_str()) => self.take_item(&word),
            Token::Name(_) => self.take_path(),
        }
    }

    fn count_brace(&mut self, sign: char) {
        match sign {
            '{' => self.depth += 1,
            '}' => {
                self.depth = self.depth.saturating_sub(1);
                if self.inline.last() == Some(&self.depth) {
                    self.inline.pop();
                }
            }
            _ => {}
        }
    }

    fn at_attribute(&self) -> bool {
        self.sign_at(self.at + 1, '[') || self.sign_at(self.at + 1, '!') && self.sign_at(self.at + 2, '[')
    }

    fn sign_at(&self, at: usize, sign: char) -> bool {
        self.tokens.get(at).is_some_and(|token| token.is_sign(sign))
    }

    /// Skips an attribute, and the item behind it if that is for tests only.
    fn take_attribute(&mut self) {
        let begin = self.at;
        while self.at < self.tokens.len() && !self.sign_at(self.at, '[') {
            self.at += 1;
        }
        self.skip_group('[', ']');
        let attribute = &self.tokens[begin..self.at];
        let has = |name: &str| attribute.iter().any(|token| token.is(name));
        if has("cfg") && has("test") && !has("not") {
            self.skip_item();
        }
    }

    /// Skips from an opening sign to behind the one that closes it.
    fn skip_group(&mut self, open: char, close: char) {
        let mut depth = 0;
        while self.at < self.tokens.len() {
            depth += usize::from(self.sign_at(self.at, open));
            depth -= usize::from(self.sign_at(self.at, close));
            self.at += 1;
            if depth == 0 {
                break;
            }
        }
    }

    fn skip_item(&mut self) {
        while self.at < self.tokens.len() && !self.sign_at(self.at, ';') && !self.sign_at(self.at, '{') {
            self.at += 1;
        }
        if self.sign_at(self.at, '{') { self.skip_group('{', '}') } else { self.at += 1 }
    }

    fn take_item(&mut self, keyword: &str) {
        self.at += 1;
        if keyword == "macro_rules" {
            self.at += 1;
        }
        let Some(Token::Name(name)) = self.tokens.get(self.at).cloned() else { return };
        if keyword == "mod" && self.sign_at(self.at + 1, ';') {
            self.file.modules.push(name);
            self.at += 1;
            return;
        }
        if keyword == "mod" {
            self.inline.push(self.depth);
        }
        // `const fn f` declares `f`, in the next turn.
        if !ITEMS.contains(&name.as_str()) {
            if self.depth == 0 {
                self.file.declared.insert(name);
            }
            self.at += 1;
        }
    }

    fn take_use(&mut self) {
        let before = self.at.checked_sub(1).map(|i| &self.tokens[i]);
        let is_public = before.is_some_and(|token| token.is("pub") || token.is_sign(')'));
        self.at += 1;
        // `use<'a>` of a captured lifetime is no import.
        if !self.sign_at(self.at, '<') {
            self.take_use_tree(&[], is_public);
        }
    }

    fn take_use_tree(&mut self, prefix: &[String], is_public: bool) {
        let mut path = prefix.to_vec();
        while let Some(token) = self.tokens.get(self.at).cloned() {
            self.at += 1;
            match token {
                Token::Name(word) if word == "as" => {
                    let Some(Token::Name(name)) = self.tokens.get(self.at).cloned() else { return };
                    self.at += 1;
                    return self.import(name, path, is_public);
                }
                Token::Name(word) => path.push(word),
                Token::Sign('*') => return self.import("*".to_owned(), path, is_public),
                Token::Sign('{') => return self.take_use_group(&path, is_public),
                Token::PathSeparator => {}
                Token::Sign(_) => {
                    self.at -= 1;
                    break;
                }
            }
        }
        if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = path.last().cloned().unwrap_or_default();
        self.import(name, path, is_public);
    }

    fn take_use_group(&mut self, prefix: &[String], is_public: bool) {
        while self.at < self.tokens.len() && !self.sign_at(self.at, '}') {
            self.take_use_tree(prefix, is_public);
            if self.sign_at(self.at, ',') {
                self.at += 1;
            }
        }
        self.at += 1;
    }

    fn import(&mut self, name: String, path: Vec<String>, is_public: bool) {
        if let Some(path) = self.seen_from_file(path) {
            self.file.imports.push(Import { name, path, is_public });
        }
    }

    fn take_path(&mut self) {
        let mut path = Vec::new();
        while let Some(Token::Name(word)) = self.tokens.get(self.at) {
            path.push(word.clone());
            self.at += 1;
            let goes_on = matches!(self.tokens.get(self.at + 1), Some(Token::Name(_)));
            if self.tokens.get(self.at) != Some(&Token::PathSeparator) || !goes_on {
                break;
            }
            self.at += 1;
        }
        self.file.named.extend(path.iter().cloned());
        if path.len() > 1 {
            self.file.paths.extend(self.seen_from_file(path));
        }
    }

    /// A path of a module with a body in this file, as the file itself would write it; none if it stays inside.
    fn seen_from_file(&self, path: Vec<String>) -> Option<Vec<String>> {
        let n_supers = path.iter().take_while(|segment| *segment == "super").count();
        let n_inline = self.inline.len();
        match (n_inline, n_supers) {
            (0, _) => Some(path),
            (_, 0) => (path.first().is_some_and(|segment| segment == "crate")).then_some(path),
            _ if n_supers < n_inline => None,
            _ if n_supers == n_inline => {
                Some(["self".to_owned()].into_iter().chain(path.into_iter().skip(n_supers)).collect())
            }
            _ => Some(path[n_inline..].to_vec()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn imports(source: &str) -> Vec<String> {
        let text = |import: &Import| format!("{} = {}", import.name, import.path.join("::"));
        RustFile::parse(source).imports.iter().map(text).collect()
    }

    #[test]
    fn every_form_of_an_import_is_read() {
        assert_eq!(
            imports("use a::{self, b::{C as D, e}, f::*};\nfn g() { use super::h; }"),
            ["a = a", "D = a::b::C", "e = a::b::e", "* = a::f", "h = super::h"]
        );
        assert_eq!(
            imports("use a::b;\n#[cfg(test)]\nmod tests { use super::*; }\nuse c::d;"),
            ["b = a::b", "d = c::d"]
        );
        let file = RustFile::parse("pub(crate) use a::B;\nuse c::D;");
        assert_eq!(file.imports.iter().map(|i| i.is_public).collect::<Vec<_>>(), [true, false]);
    }

    #[test]
    fn paths_modules_and_items_are_read() {
        let source =
            "mod a;\n#[cfg(test)] mod tests;\npub const fn b() { crate::c::D::e(x) }\nstruct F;\nimpl F { fn g() {} }";
        let file = RustFile::parse(source);
        assert_eq!(file.modules, ["a"]);
        assert_eq!(file.declared.iter().collect::<Vec<_>>(), ["F", "b"]);
        assert_eq!(file.paths, [["crate", "c", "D", "e"]]);
    }

    #[test]
    fn a_module_with_a_body_counts_as_part_of_its_file() {
        let file = RustFile::parse("mod a { use super::B; fn c() { super::super::d::e(); f::g() } }\nuse super::h;");
        let paths: Vec<_> = file.imports.iter().map(|i| i.path.join("::")).collect();
        assert_eq!(paths, ["self::B", "super::h"]);
        assert_eq!(file.paths, [["super", "d", "e"]]);
    }
}
