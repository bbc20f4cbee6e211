//! Tetrahedra around one edge, taken together: four of them share the edge between the centres of two cubes.

use crate::refine::projection::{NODES, SHARING};

/// The lattice's tetrahedra by fours where all four are there, and what is left.
#[derive(Debug)]
pub(in crate::refine) struct Octahedra {
    /// The ends of the axis and the ring around it, so that each tetrahedron of both ends and two consecutive ones of the
    /// ring has a positive volume.
    pub(in crate::refine) nodes: Vec<[u32; NODES]>,
    /// Corners of the tetrahedra that belong to none.
    pub(in crate::refine) loose: Vec<[u32; 4]>,
    /// Edges of which octahedra do not keep the whole stiffness, and the share that is missing.
    pub(in crate::refine) edges: Vec<[u32; 2]>,
    pub(in crate::refine) shares: Vec<f32>,
}

impl Octahedra {
    /// Of `tetrahedra` as the lattice has them: those of one axis one after the other, its ends first. `edges` are all
    /// of theirs, sorted.
    pub(in crate::refine) fn new(tetrahedra: &[[u32; 4]], edges: &[[u32; 2]]) -> Self {
        let (mut nodes, mut loose, mut rest) = (Vec::new(), Vec::new(), tetrahedra);
        while !rest.is_empty() {
            let octahedron = rest.first_chunk::<4>().and_then(octahedron);
            let (taken, others) = rest.split_at(if octahedron.is_some() { 4 } else { 1 });
            match octahedron {
                Some(octahedron) => nodes.push(octahedron),
                None => loose.push(taken[0]),
            }
            rest = others;
        }
        let mut missing = vec![1.0f32; edges.len()];
        for octahedron in &nodes {
            for (k, [i, j]) in sides(octahedron) {
                let edge = [i.min(j), i.max(j)];
                let at = edges.binary_search(&edge).expect("an edge of a tetrahedron");
                missing[at] -= 1.0 / SHARING[k];
            }
        }
        let kept = |&(_, &share): &(&[u32; 2], &f32)| share > 1e-3;
        let (edges, shares) = edges.iter().zip(&missing).filter(kept).unzip();
        Self { nodes, loose, edges, shares }
    }
}

/// Two ends and a ring of four, if that is what the tetrahedra are.
fn octahedron(tetrahedra: &[[u32; 4]; 4]) -> Option<[u32; NODES]> {
    let [p, q, ..] = tetrahedra[0];
    let [a, b, c, d] = tetrahedra.map(|[i, j, from, to]| ([i, j] == [p, q]).then_some([from, to]));
    let [a, b, c, d] = [a?, b?, c?, d?];
    let closes = |[a, b, c, d]: [[u32; 2]; 4]| a[1] == b[0] && b[1] == c[0] && c[1] == d[0] && d[1] == a[0];
    let ring = [a, b, c, d];
    let turned = [d, c, b, a];
    let ring = [ring, turned].into_iter().find(|ring| closes(*ring))?;
    Some([p, q, ring[0][0], ring[1][0], ring[2][0], ring[3][0]])
}

/// The edges, each with its kind: the axis, the ring, between the two.
fn sides(&[p, q, a, b, c, d]: &[u32; NODES]) -> [(usize, [u32; 2]); 13] {
    let ring = [[a, b], [b, c], [c, d], [d, a]].map(|edge| (1, edge));
    let [e, f, g, h] = ring;
    let between = [p, q].map(|end| [a, b, c, d].map(|corner| (2, [end, corner])));
    let [[i, j, k, l], [m, n, o, r]] = between;
    [(0, [p, q]), e, f, g, h, i, j, k, l, m, n, o, r]
}
