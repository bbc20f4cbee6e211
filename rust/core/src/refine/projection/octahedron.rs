//! The four tetrahedra around an edge of the lattice, with all of its edges: what they do to six nodes is calculated
//! without a way through memory in between.

#![allow(clippy::needless_range_loop)]

use super::super::constraint::project_stretch;
use super::super::number::{Number, Vector};
use super::kind::{Flesh, Kind, apply};

/// Nodes of an octahedron: the ends of its axis, then the ring around it.
pub const NODES: usize = 6;
/// Multipliers: two of each tetrahedron, one of each edge.
pub const MULTIPLIERS: usize = 4 * 2 + 1 + 4 + 8;

/// How many octahedra share an edge inside of the lattice: an axis, an edge of the ring, one between the two. Each has its
/// share of the edge's stiffness.
pub const SHARING: [f32; 3] = [1.0, 4.0, 3.0];

/// Lengths of an axis or an edge of the ring, and of the edges between them, in cells.
const LENGTHS: [f32; 2] = [1.0, 0.866_025_4];

/// Octahedra keep what their tetrahedra and edges keep.
#[derive(Debug, Clone, Copy)]
pub struct Octahedra {
    /// Of the tetrahedra.
    pub flesh: Flesh,
    /// Compliance of an edge, if its length is kept.
    pub stretch_compliance: Option<f32>,
}

impl Kind<NODES, 0, MULTIPLIERS> for Octahedra {
    #[inline(always)]
    fn project<T: Number>(
        self,
        places: &mut [Vector<T>; NODES],
        w: [T; NODES],
        rest: [T; 0],
        multipliers: &mut [T; MULTIPLIERS],
    ) {
        if let Some(compliance) = self.stretch_compliance {
            let [axis, ring, between] = SHARING;
            let [axis, ring, between] = [compliance * axis, compliance * ring, compliance * between];
            self.edge(places, w, [0, 1], LENGTHS[0], axis, &mut multipliers[8]);
            for k in 0..4 {
                self.edge(places, w, [2 + k, 2 + (k + 1) % 4], LENGTHS[0], ring, &mut multipliers[9 + k]);
                self.edge(places, w, [0, 2 + k], LENGTHS[1], between, &mut multipliers[13 + k]);
                self.edge(places, w, [1, 2 + k], LENGTHS[1], between, &mut multipliers[17 + k]);
            }
        }
        for k in 0..4 {
            let (c, d) = (2 + k, 2 + (k + 1) % 4);
            let mut four = [places[0], places[1], places[c], places[d]];
            let mut own = [multipliers[2 * k], multipliers[2 * k + 1]];
            self.flesh.project(&mut four, [w[0], w[1], w[c], w[d]], rest, &mut own);
            [places[0], places[1], places[c], places[d]] = four;
            [multipliers[2 * k], multipliers[2 * k + 1]] = own;
        }
    }
}

impl Octahedra {
    #[inline(always)]
    fn edge<T: Number>(
        self,
        places: &mut [Vector<T>; NODES],
        w: [T; NODES],
        [i, j]: [usize; 2],
        length: f32,
        compliance: f32,
        multiplier: &mut T,
    ) {
        let mut ends = [places[i], places[j]];
        let any = w[0];
        let (length, compliance) = (any.constant(length), any.constant(compliance));
        apply(project_stretch(ends, [w[i], w[j]], length, compliance, *multiplier), &mut ends, multiplier);
        [places[i], places[j]] = ends;
    }
}
