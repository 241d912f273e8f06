//! Source files of a crate as a graph: which file takes a name that another one declares.

mod circles;
mod crate_tree;
mod rust_file;
mod tokens;

pub use circles::{circles, folder_circles};
pub use crate_tree::{Arrow, CrateTree};
