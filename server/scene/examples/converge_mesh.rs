//! Convergence of the accurate mesh: presses of the evaluation, each on several meshes.
//!
//! ```text
//! cargo run --release -p plica-scene --example converge_mesh -- SCENE PRESSES MESH...
//! ```
//!
//! SCENE is a file, or `wedge`; a mesh is `32x16x8`, or `32x16x8:1,1,0.4` with gradings. For every mesh, and each press, the
//! table gives force and skin of either reference beside those of the mesh named next: name them from coarse to fine.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use plica_scene::scene::AccurateMesh;
use plica_scene::{Config, model, setup};
use plica_training::{AccurateResult, CoarseHalf, InteractionSet, Setup, SkinDistance, Spread, Stop, Tandem, plan};

const USAGE: &str = "SCENE PRESSES MESH...";

/// One mesh, solved at every press.
struct Column {
    name: String,
    tied: Vec<Option<AccurateResult>>,
    independent: Vec<Option<AccurateResult>>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [scene, presses, meshes @ ..] = words.as_slice() else { return Err(USAGE.into()) };
    let config = match scene.as_str() {
        "wedge" => Config::built_in()?,
        file => Config::from_file(Path::new(file))?,
    };
    let setup = setup::setup(&config)?;
    let set = InteractionSet { count: presses.parse()?, ..setup.evaluation[0].clone() };
    let interactions = plan(&setup, &[set], setup.evaluation_seed)?;
    let mut coarse = Tandem::new(&setup)?;
    let areas = coarse.skin().vertex_areas().to_vec();
    let mut go_on = || ControlFlow::Continue(());
    let halves: Vec<Option<CoarseHalf>> =
        interactions.iter().map(|i| coarse.solve_coarse(i, &mut go_on).ok()).collect();
    let mut columns: Vec<Column> = Vec::new();
    for name in meshes {
        let setup = Setup { accurate: model::describe_accurate(&config, Some(mesh(name)?))?, ..setup.clone() };
        let mut tandem = Tandem::new(&setup)?;
        let mut column = Column { name: name.clone(), tied: Vec::new(), independent: Vec::new() };
        let begin = Instant::now();
        for (interaction, half) in interactions.iter().zip(&halves) {
            let tied = half.as_ref().map(|half| tandem.solve_tied(half, &mut go_on));
            column.tied.push(kept(name, "tied", tied));
            let own = half.as_ref().map(|half| tandem.solve_independent(interaction, half, &mut go_on));
            column.independent.push(kept(name, "independent", own));
        }
        let n_unknowns = tandem.accurate().size().n_unknowns;
        let hexes = setup.accurate.mesh.n_hexes();
        println!("{name}: {hexes} hexahedra, {n_unknowns} unknowns, {:.0} s", begin.elapsed().as_secs_f64());
        if let Some(coarser) = columns.last() {
            print(coarser, &column, &areas);
        }
        columns.push(column);
    }
    Ok(())
}

fn kept(mesh: &str, reference: &str, result: Option<Result<AccurateResult, Stop>>) -> Option<AccurateResult> {
    result?.inspect_err(|stop| println!("{mesh}, {reference}: {stop}")).ok()
}

/// Forces and skins of one mesh beside those of the next.
fn print(coarser: &Column, finer: &Column, areas: &[f64]) {
    println!("  {} from {}:", coarser.name, finer.name);
    for (name, a, b) in
        [("tied", &coarser.tied, &finer.tied), ("independent", &coarser.independent, &finer.independent)]
    {
        let both: Vec<_> = a.iter().zip(b).filter_map(|(a, b)| Some((a.as_ref()?, b.as_ref()?))).collect();
        let force = |r: &AccurateResult| r.tool_force.norm();
        let errors = both.iter().map(|(a, b)| 100.0 * (force(a) / force(b) - 1.0).abs());
        let skins = both.iter().map(|(a, b)| 1e3 * SkinDistance::between(&a.offsets, &b.offsets, areas).rms_m);
        let finest = both.iter().map(|(_, b)| force(b));
        if let (Some(error), Some(skin), Some(size)) = (Spread::of(errors), Spread::of(skins), Spread::of(finest)) {
            println!(
                "    {name:<12} force off by {:.1} % (worst {:.1}) of {:.3} N, skin by {:.4} mm RMS (worst {:.4})",
                error.median, error.max, size.median, skin.median, skin.max
            );
        }
    }
}

fn mesh(name: &str) -> Result<AccurateMesh, Box<dyn Error>> {
    let (divisions, grading) = name.split_once(':').unwrap_or((name, "1,1,1"));
    let three = "a mesh has three divisions, and three gradings if any";
    let divisions: Vec<usize> = divisions.split('x').map(str::parse).collect::<Result<_, _>>()?;
    let grading: Vec<f64> = grading.split(',').map(str::parse).collect::<Result<_, _>>()?;
    Ok(AccurateMesh {
        divisions: divisions.try_into().map_err(|_| three)?,
        grading: grading.try_into().map_err(|_| three)?,
    })
}
