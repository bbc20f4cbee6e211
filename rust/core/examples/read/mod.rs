// Readers for the examples: meshes from OBJ files, weights from lines "vertex bone weight".

use std::error::Error as AnyError;
use std::path::{Path, PathBuf};

/// Positions (V, 3) and triangles (T, 3) of all objects in a file.
pub type Mesh = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// Where a file of these examples is.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data").join(name)
}

/// Reads a Wavefront OBJ file; faces become triangles.
pub fn mesh(path: impl AsRef<Path>) -> Result<Mesh, Box<dyn AnyError>> {
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (models, _) = tobj::load_obj(path.as_ref(), &options)?;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for model in models {
        let start = positions.len() as u32;
        positions.extend(model.mesh.positions.as_chunks::<3>().0);
        triangles.extend(model.mesh.indices.as_chunks::<3>().0.iter().map(|t| t.map(|i| i + start)));
    }
    Ok((positions, triangles))
}

/// Reads weights of `vertices` vertices.
pub fn weights(path: impl AsRef<Path>, vertices: usize) -> Result<skinwright_core::Weights, Box<dyn AnyError>> {
    let mut rows = vec![Vec::new(); vertices];
    for line in std::fs::read_to_string(path)?.lines().filter(|line| !line.starts_with('#')) {
        let [vertex, bone, weight] = line.split_whitespace().collect::<Vec<_>>()[..] else {
            return Err(format!("not \"vertex bone weight\": {line}").into());
        };
        let row = rows.get_mut(vertex.parse::<usize>()?).ok_or("a vertex that is not in the mesh")?;
        row.push((bone.parse::<u32>()?, weight.parse::<f32>()?));
    }
    let starts = rows.iter().scan(0, |end, row| {
        *end += row.len() as u32;
        Some(*end)
    });
    let indptr = std::iter::once(0).chain(starts).collect();
    let (bones, values): (Vec<u32>, Vec<f32>) = rows.into_iter().flatten().unzip();
    let n_bones = bones.iter().max().map_or(0, |&last| last + 1);
    Ok(skinwright_core::Weights::new(indptr, bones, values, n_bones)?)
}
