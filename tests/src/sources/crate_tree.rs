//! The modules of one crate, and the arrows between their files.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::rust_file::{Import, RustFile};

/// Segments from the root of a crate, `["contact", "law"]`.
type ModulePath = Vec<String>;

/// A file takes a name that another one declares.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Arrow {
    /// Module that takes.
    pub from: ModulePath,
    /// Module that declares.
    pub to: ModulePath,
    /// The path as written in `from`.
    pub name: String,
    /// The ancestor of `from` that hands the name on without declaring it, if it comes that way.
    pub through: Option<ModulePath>,
}

/// Every module of one crate that is no test.
pub struct CrateTree {
    modules: BTreeMap<ModulePath, Module>,
}

struct Module {
    file: PathBuf,
    content: RustFile,
}

/// Where a path leads.
#[derive(Default)]
struct Target {
    module: ModulePath,
    /// Modules that hand the name on by an import of theirs.
    through: Vec<ModulePath>,
    is_module: bool,
}

/// Re-exports of re-exports are followed this far; a longer chain is a circle of imports.
const LONGEST_CHAIN: usize = 16;

impl CrateTree {
    /// Reads a crate from its root, `lib.rs` or `main.rs`, by its `mod` declarations. `read` has the text of a file, if there is one.
    pub fn new(root: &Path, read: &dyn Fn(&Path) -> Option<String>) -> CrateTree {
        let mut tree = CrateTree { modules: BTreeMap::new() };
        let folder = root.parent().unwrap_or(Path::new("")).to_owned();
        tree.add(Vec::new(), root.to_owned(), &folder, read);
        tree
    }

    fn add(&mut self, path: ModulePath, file: PathBuf, folder: &Path, read: &dyn Fn(&Path) -> Option<String>) {
        let content = RustFile::parse(&read(&file).unwrap_or_default());
        for name in &content.modules {
            let own_folder = folder.join(name);
            let candidates = [folder.join(format!("{name}.rs")), own_folder.join("mod.rs")];
            let child = [path.clone(), vec![name.clone()]].concat();
            if let Some(file) = candidates.into_iter().find(|file| read(file).is_some()) {
                self.add(child, file, &own_folder, read);
            }
        }
        self.modules.insert(path, Module { file, content });
    }

    /// The files that the tree holds.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.modules.values().map(|module| module.file.as_path())
    }

    /// The file of a module of the tree.
    pub fn file(&self, module: &[String]) -> &Path {
        &self.modules[module].file
    }

    /// All arrows between two files, each name once.
    ///
    /// `mod x;` is none, and a `pub use` is one only if the file that hands the name on uses it itself.
    pub fn arrows(&self) -> BTreeSet<Arrow> {
        self.modules.iter().flat_map(|(path, module)| self.arrows_of(path, &module.content)).collect()
    }

    fn arrows_of(&self, from: &ModulePath, content: &RustFile) -> Vec<Arrow> {
        let is_used = |import: &&Import| !import.is_public || content.named.contains(&import.name);
        let imports = content.imports.iter().filter(is_used).map(|import| (&import.path, import.name == "*"));
        let paths = content.paths.iter().map(|path| (path, false)).chain(imports);
        paths.filter_map(|(path, is_glob)| self.arrow(from, path, is_glob)).collect()
    }

    fn arrow(&self, from: &ModulePath, path: &[String], is_glob: bool) -> Option<Arrow> {
        let target = self.resolve(from, path, LONGEST_CHAIN)?;
        // Importing a module takes nothing of it yet; the paths that begin with its name do.
        if target.module == *from || target.is_module && !is_glob {
            return None;
        }
        let is_above = |module: &&ModulePath| from.starts_with(module) && *module != from && **module != target.module;
        // What begins with an import of the file itself is counted there.
        let is_imported = target.through.contains(from);
        let through = target.through.iter().find(|module| !is_imported && is_above(module)).cloned();
        Some(Arrow { from: from.clone(), to: target.module, name: path.join("::"), through })
    }

    /// The module that declares the end of a path, if it is one of this crate.
    fn resolve(&self, from: &ModulePath, path: &[String], chain: usize) -> Option<Target> {
        let chain = chain.checked_sub(1)?;
        let n_supers = path.iter().take_while(|segment| *segment == "super").count();
        let first = path.first()?.as_str();
        match first {
            "crate" => self.walk(Target::at(Vec::new()), &path[1..], chain),
            "self" => self.walk(Target::at(from.clone()), &path[1..], chain),
            "super" => {
                let above = from.len().checked_sub(n_supers)?;
                self.walk(Target::at(from[..above].to_vec()), &path[n_supers..], chain)
            }
            _ if self.knows(from, first) => self.walk(Target::at(from.clone()), path, chain),
            _ => None,
        }
    }

    fn knows(&self, module: &ModulePath, name: &str) -> bool {
        let content = &self.modules[module].content;
        let is_module = content.modules.iter().any(|m| m == name) && self.child(module, name).is_some();
        is_module || content.declared.contains(name) || content.imports.iter().any(|i| i.name == name)
    }

    fn child(&self, module: &ModulePath, name: &str) -> Option<ModulePath> {
        let path = [module.as_slice(), &[name.to_owned()]].concat();
        self.modules.contains_key(&path).then_some(path)
    }

    fn walk(&self, mut target: Target, path: &[String], chain: usize) -> Option<Target> {
        let Some((name, rest)) = path.split_first() else {
            target.is_module = true;
            return Some(target);
        };
        if let Some(child) = self.child(&target.module, name) {
            target.module = child;
            return self.walk(target, rest, chain);
        }
        let content = &self.modules[&target.module].content;
        if content.declared.contains(name) {
            return Some(target);
        }
        match self.imported(&target.module, name, chain) {
            Some(mut found) => {
                found.through.extend(target.through);
                found.through.push(target.module);
                if !found.is_module {
                    return Some(found);
                }
                found.is_module = false;
                self.walk(found, rest, chain)
            }
            // Imported from another crate, or made by a macro.
            None if content.imports.iter().any(|import| import.name == *name) => None,
            None => Some(target),
        }
    }

    /// What a module's imports, `*` among them, say of a name.
    fn imported(&self, module: &ModulePath, name: &str, chain: usize) -> Option<Target> {
        let imports = &self.modules[module].content.imports;
        if let Some(import) = imports.iter().find(|import| import.name == name) {
            // `use x::y as x` and `use x;` would ask for themselves.
            let path = if import.path.first().is_some_and(|first| first == name) {
                self.child(module, name)?;
                [&["self".to_owned()], import.path.as_slice()].concat()
            } else {
                import.path.clone()
            };
            return self.resolve(module, &path, chain);
        }
        imports.iter().filter(|import| import.name == "*").find_map(|import| {
            let source = self.resolve(module, &import.path, chain)?;
            (source.module != *module && self.knows(&source.module, name))
                .then(|| self.walk(Target::at(source.module), &[name.to_owned()], chain.saturating_sub(1)))?
        })
    }
}

impl Target {
    fn at(module: ModulePath) -> Target {
        Target { module, ..Target::default() }
    }
}
