//! Transfers weights between two OBJ files that share a space: `transfer_obj [SOURCE.obj SOURCE.weights TARGET.obj]`.
//!
//! Prints the target's weights as lines "vertex bone weight". Without arguments: a sleeve on an arm.

mod read;

use std::error::Error;

use skinwright_core::transfer::{Settings, Source, TargetMesh, transfer_weights};

fn main() -> Result<(), Box<dyn Error>> {
    let given: Vec<_> = std::env::args_os().skip(1).map(Into::into).collect();
    let [source_file, weights_file, target_file] = match <[std::path::PathBuf; 3]>::try_from(given) {
        Ok(files) => files,
        Err(given) if given.is_empty() => ["arm.obj", "arm.weights", "sleeve.obj"].map(read::data),
        Err(_) => return Err("usage: transfer_obj SOURCE.obj SOURCE.weights TARGET.obj".into()),
    };
    let (positions, triangles) = read::mesh(source_file)?;
    let source = Source::new(&positions, triangles, read::weights(weights_file, positions.len())?)?;
    let (positions, triangles) = read::mesh(target_file)?;
    let target = TargetMesh { positions, triangles, ..TargetMesh::default() };
    let transfer = transfer_weights(&source, target, None, &Settings::default())?;
    eprintln!("{} of {} vertices matched", transfer.report.matched, transfer.report.vertices);
    for i in 0..transfer.weights.vertex_count() {
        let (bones, values) = transfer.weights.row(i);
        std::iter::zip(bones, values).for_each(|(bone, value)| println!("{i} {bone} {value}"));
    }
    Ok(())
}
