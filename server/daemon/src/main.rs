//! plicad
fn main() {}
