//! Whether the parts of a mesh that was read are joined where they touch.

use super::error::{Fault, Place, fault};
use super::named_mesh::NamedMesh;
use super::options::ReadOptions;
use crate::joints::{Joints, Sites};

/// Remeshing is the remedy where merging nodes joins nothing.
const REMESH: &str = "mesh the body anew so that neighbouring hexahedra share whole faces (in Gmsh: Coherence, or BooleanFragments, \
                      before meshing), or keep the parts apart with merge_tolerance_m = 0";

/// Refuses parts that touch without being joined; where they are meant, or do little harm, they become remarks.
pub(super) fn joints(named: &mut NamedMesh, options: &ReadOptions) -> Result<(), Fault> {
    let joints = Joints::of_volume(&named.mesh);
    let unit = options.metres_per_unit;
    for (problem, advice) in wrong(&joints, options) {
        if options.merge_tolerance_m != Some(0.0) {
            return fault(Place::File, problem, advice);
        }
        named.remarks.push(problem);
    }
    if let Some(sites) = &joints.near {
        named.remarks.push(format!(
            "{} face another hexahedron across less than a tenth of an edge, {}: there is a gap, nothing joins them and nothing \
             keeps them apart",
            nodes(sites.n),
            place(sites, unit)
        ));
    }
    if let Some(sites) = &joints.pinched {
        named.remarks.push(format!(
            "at {} hexahedra meet by an edge or a corner without sharing a face, {}: stress there depends on the mesh",
            nodes(sites.n),
            place(sites, unit)
        ));
    }
    Ok(())
}

/// Faults that make a solution that of another body, with the remedy; the most telling first.
fn wrong(joints: &Joints, options: &ReadOptions) -> Vec<(String, String)> {
    let unit = options.metres_per_unit;
    let Joints { coincident, hanging, overlapping, hinged, .. } = joints;
    let mut wrong = Vec::new();
    if let Some(sites) = coincident {
        let problem = format!(
            "at {} several nodes lie that are not one, {}: the parts that touch there are not joined",
            points(sites.n),
            place(sites, unit)
        );
        let rest = if hanging.is_some() || overlapping.is_some() { "; elsewhere their faces do not match" } else { "" };
        wrong.push((format!("{problem}{rest}"), merge_advice(joints, rest.is_empty())));
    }
    if let Some(sites) = hanging {
        let problem = format!(
            "{} lie on a face of another hexahedron without being its corners, {}: faces that touch there do not match (hanging \
             nodes), and are not joined",
            nodes(sites.n),
            place(sites, unit)
        );
        wrong.push((problem, REMESH.into()));
    } else if let Some(sites) = overlapping {
        let problem = format!(
            "{} faces overlap others without sharing a node, centres {}: the parts that touch there are not joined",
            sites.n,
            place(sites, unit)
        );
        wrong.push((problem, REMESH.into()));
    }
    if let Some(sites) = hinged {
        let problem = format!(
            "{} parts share no face and hang together by {} on edges or corners only, {}: they turn there like on a hinge",
            joints.n_parts,
            nodes(sites.n),
            place(sites, unit)
        );
        wrong.push((problem, REMESH.into()));
    }
    wrong
}

/// A tolerance that joins coincident nodes and no corners of a hexahedron.
fn merge_advice(joints: &Joints, is_enough: bool) -> String {
    if !is_enough {
        return REMESH.into();
    }
    let least = 2.0 * joints.widest_gap_m;
    let tolerance = 10.0_f64.powf((1e-3 * joints.shortest_edge_m).log10().floor()).max(least);
    format!(
        "set merge_tolerance_m = {tolerance:.1e} beside the file to merge them, or 0 if the parts are meant to be apart (a slit, \
         two bodies)"
    )
}

fn nodes(n: usize) -> String {
    if n == 1 { "1 node".into() } else { format!("{n} nodes") }
}

fn points(n: usize) -> String {
    if n == 1 { "1 point".into() } else { format!("{n} points") }
}

/// Where, in the unit of the file.
fn place(sites: &Sites, unit: f64) -> String {
    let shown = |x: &nalgebra::Point3<f64>| {
        let [x, y, z] = [x.x, x.y, x.z].map(|c| rounded(c / unit));
        format!("({x}, {y}, {z})")
    };
    if sites.n == 1 {
        return format!("at {} in the file's unit", shown(&sites.first));
    }
    format!(
        "the first at {}, all within {} to {} in the file's unit",
        shown(&sites.first),
        shown(&sites.lower),
        shown(&sites.upper)
    )
}

/// Six significant digits, without those that change of units has left.
fn rounded(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}
