//! Circles in a graph of modules, and in the graph of folders that it makes.

use std::collections::{BTreeMap, BTreeSet};

use super::crate_tree::Arrow;

type Graph = BTreeMap<Vec<String>, BTreeSet<Vec<String>>>;

/// Groups of modules each of which reaches every other one of its group.
///
/// An arrow from a module to one above it does not count: a file beside its folder is one piece with what lies in the folder.
pub fn circles(arrows: &BTreeSet<Arrow>) -> Vec<Vec<Vec<String>>> {
    let counted = arrows.iter().filter(|arrow| !arrow.from.starts_with(&arrow.to));
    circles_of(&graph(counted.map(|arrow| (arrow.from.clone(), arrow.to.clone()))))
}

/// The same for siblings, each with all that lies below it: an arrow between two files is one between the children of the
/// nearest module that has both below it.
pub fn folder_circles(arrows: &BTreeSet<Arrow>) -> Vec<Vec<Vec<String>>> {
    circles_of(&graph(arrows.iter().filter_map(between_siblings)))
}

fn between_siblings(arrow: &Arrow) -> Option<(Vec<String>, Vec<String>)> {
    let shared = arrow.from.iter().zip(&arrow.to).take_while(|(a, b)| a == b).count();
    let sibling = |module: &[String]| (module.len() > shared).then(|| module[..=shared].to_vec());
    Some((sibling(&arrow.from)?, sibling(&arrow.to)?))
}

fn graph(arrows: impl Iterator<Item = (Vec<String>, Vec<String>)>) -> Graph {
    let mut graph = Graph::new();
    for (from, to) in arrows {
        graph.entry(from).or_default().insert(to);
    }
    graph
}

fn circles_of(graph: &Graph) -> Vec<Vec<Vec<String>>> {
    let reached: Graph = graph.keys().map(|from| (from.clone(), reachable(graph, from))).collect();
    let reaches = |a: &Vec<String>, b: &Vec<String>| reached.get(a).is_some_and(|r| r.contains(b));
    let mut found: Vec<Vec<Vec<String>>> = Vec::new();
    for module in graph.keys().filter(|module| reaches(module, module)) {
        match found.iter_mut().find(|group| reaches(module, &group[0]) && reaches(&group[0], module)) {
            Some(group) => group.push(module.clone()),
            None => found.push(vec![module.clone()]),
        }
    }
    found
}

fn reachable(graph: &Graph, from: &Vec<String>) -> BTreeSet<Vec<String>> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(module) = open.pop() {
        for next in graph.get(module).into_iter().flatten() {
            if seen.insert(next.clone()) {
                open.push(next);
            }
        }
    }
    seen
}
