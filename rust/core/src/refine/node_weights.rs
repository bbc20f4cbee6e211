//! Skin weights for lattice nodes: those of the skin embedded around them, and inside the smoothest between.

use crate::skinning::LEAST_TOTAL_WEIGHT;
use crate::weights::Weights;

use super::lattice::Lattice;
use super::surface::Surface;

/// Averages over neighbours after the first filling.
const PASSES: usize = 12;
/// Influences that a node keeps.
const MOST: usize = 8;

type Row = Vec<(u32, f32)>;

/// Weights of nodes, then of surface vertices, each row normalised (or empty for unweighted skin).
pub(super) fn particle_weights(lattice: &Lattice, surface: &Surface, weights: &Weights) -> Vec<Row> {
    let skin: Vec<Row> = surface.source.iter().map(|&i| normalised(weights, i as usize)).collect();
    let mut rows = from_skin(lattice, &skin);
    let fixed: Vec<bool> = rows.iter().map(|row| !row.is_empty()).collect();
    let rings = rings(lattice);
    fill(&mut rows, &rings);
    for _ in 0..PASSES {
        let average = |(i, row): (usize, &Row)| {
            if fixed[i] { row.clone() } else { mean(rings[i].iter().map(|&n| (&rows[n as usize], 1.0))) }
        };
        rows = rows.iter().enumerate().map(average).collect();
    }
    rows.extend(skin);
    rows
}

fn normalised(weights: &Weights, vertex: usize) -> Row {
    let (bones, values) = weights.row(vertex);
    let total: f64 = values.iter().map(|&x| f64::from(x)).sum();
    if total <= LEAST_TOTAL_WEIGHT {
        return Row::new();
    }
    let entries = bones.iter().zip(values).filter(|(_, value)| **value > 0.0);
    entries.map(|(&bone, &value)| (bone, (f64::from(value) / total) as f32)).collect()
}

fn from_skin(lattice: &Lattice, skin: &[Row]) -> Vec<Row> {
    let mut around: Vec<Vec<(u32, f32)>> = vec![Vec::new(); lattice.nodes.len()];
    for (i, embedding) in lattice.embedding.iter().enumerate() {
        let Some(embedding) = embedding else { continue };
        for (&node, &share) in embedding.nodes.iter().zip(&embedding.shares) {
            around[node as usize].push((i as u32, share.max(0.0) + 1e-3));
        }
    }
    around.iter().map(|vertices| mean(vertices.iter().map(|&(i, share)| (&skin[i as usize], share)))).collect()
}

fn rings(lattice: &Lattice) -> Vec<Vec<u32>> {
    let mut rings = vec![Vec::new(); lattice.nodes.len()];
    for &[i, j] in &lattice.edges {
        rings[i as usize].push(j);
        rings[j as usize].push(i);
    }
    rings
}

/// Layer by layer from the nodes that have weights.
fn fill(rows: &mut [Row], rings: &[Vec<u32>]) {
    loop {
        let filled = |i: usize| mean(rings[i].iter().map(|&n| (&rows[n as usize], 1.0)));
        let empty = (0..rows.len()).filter(|&i| rows[i].is_empty());
        let layer: Vec<(usize, Row)> = empty.map(|i| (i, filled(i))).filter(|(_, row)| !row.is_empty()).collect();
        if layer.is_empty() {
            return;
        }
        layer.into_iter().for_each(|(i, row)| rows[i] = row);
    }
}

/// The weighted mean of rows, of its largest entries, normalised.
fn mean<'a>(rows: impl Iterator<Item = (&'a Row, f32)>) -> Row {
    let mut entries: Row = Vec::new();
    for (row, share) in rows {
        entries.extend(row.iter().map(|&(bone, value)| (bone, value * share)));
    }
    entries.sort_by_key(|&(bone, _)| bone);
    let mut sums: Row = Vec::new();
    for (bone, value) in entries {
        match sums.last_mut() {
            Some(last) if last.0 == bone => last.1 += value,
            _ => sums.push((bone, value)),
        }
    }
    sums.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    sums.truncate(MOST);
    let total: f32 = sums.iter().map(|&(_, value)| value).sum();
    sums.iter_mut().for_each(|(_, value)| *value /= total);
    sums.sort_by_key(|&(bone, _)| bone);
    sums
}
