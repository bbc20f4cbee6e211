//! Vertices that are one although the file keeps them apart: seams of UV maps, split normals, flat shading, panels.

use rayon::prelude::*;

use crate::adjacency::DisjointSets;

/// Which of V vertices are one. Classes are numbered by their smallest vertex, which stands for all of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Weld {
    class_of: Vec<u32>,
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Weld {
    /// Declares vertex i and `other[i]` to be one, for every i, and what follows from that.
    ///
    /// Panics if an entry is out of range.
    pub fn new(other: &[u32]) -> Self {
        let mut sets = DisjointSets::new(other.len());
        std::iter::zip(0.., other).for_each(|(i, &j)| sets.union(i, j));
        Self::of_sets(sets)
    }

    fn of_sets(sets: DisjointSets) -> Self {
        let (class_of, count) = sets.number(|_| true);
        let mut starts = vec![0u32; count + 1];
        class_of.iter().for_each(|&class| starts[class as usize + 1] += 1);
        (0..count).for_each(|class| starts[class + 1] += starts[class]);
        let (mut next, mut members) = (starts.clone(), vec![0; class_of.len()]);
        for (i, &class) in std::iter::zip(0.., &class_of) {
            members[next[class as usize] as usize] = i;
            next[class as usize] += 1;
        }
        Self { class_of, starts, members }
    }

    /// Unites vertices that chains of steps no longer than `tolerance` (world units) connect; `None` if no two are that close.
    ///
    /// The answer depends on distances only. Time is near-linear, however many vertices coincide.
    pub fn coincident(positions: &[[f32; 3]], tolerance: f64) -> Option<Self> {
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return None;
        }
        let pairs = close_pairs(positions, tolerance);
        if pairs.is_empty() {
            return None;
        }
        let mut sets = DisjointSets::new(positions.len());
        pairs.into_iter().for_each(|(i, j)| sets.union(i, j));
        Some(Self::of_sets(sets))
    }

    /// Number of classes (C).
    pub fn class_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Class of each vertex, (V).
    pub fn class_of(&self) -> &[u32] {
        &self.class_of
    }

    /// The vertices of a class, ascending; the first stands for all.
    pub fn members(&self, class: usize) -> &[u32] {
        &self.members[self.starts[class] as usize..self.starts[class + 1] as usize]
    }

    /// The first vertex of each class, ascending, (C).
    pub fn representatives(&self) -> impl ExactSizeIterator<Item = u32> + '_ {
        self.starts[..self.class_count()].iter().map(|&start| self.members[start as usize])
    }

    /// The mesh in which they are one: positions (C, 3) of the representatives, and the triangles (T, 3) over classes, of which
    /// some may name a vertex twice or repeat others.
    pub fn welded(&self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let positions = self.representatives().map(|i| positions[i as usize]).collect();
        let class = |i: u32| self.class_of[i as usize];
        (positions, triangles.par_iter().with_min_len(4096).map(|t| t.map(class)).collect())
    }

    /// Edges (E, 2) over classes, of which some may name a vertex twice or repeat others.
    pub fn welded_edges(&self, edges: &[[u32; 2]]) -> Vec<[u32; 2]> {
        edges.iter().map(|edge| edge.map(|i| self.class_of[i as usize])).collect()
    }
}

/// Cells are this many tolerances wide, so that few points lie within the tolerance of a neighbouring cell.
const CELL: f64 = 64.0;

/// A cell with more points than this is divided into cells so small that all points in one are close.
const CROWD: usize = 16;

/// Pairs of vertices no farther apart than `tolerance`: enough of them to connect all that chains of such pairs connect.
fn close_pairs(positions: &[[f32; 3]], tolerance: f64) -> Vec<(u32, u32)> {
    let width = CELL * tolerance;
    let cells_of = |i: usize, keys: &mut Vec<u64>| {
        for_each_cell(positions[i], width, tolerance, |cell| keys.push(u64::from(cell) << 32 | i as u64));
    };
    let keys: Vec<u64> = (0..positions.len())
        .into_par_iter()
        .with_min_len(4096)
        .fold(Vec::new, |mut keys, i| {
            cells_of(i, &mut keys);
            keys
        })
        .reduce(Vec::new, |mut left, mut right| {
            left.append(&mut right);
            left
        });
    let (starts, points) = buckets(&keys);
    let in_bucket = |ends: &[u32]| {
        let mut pairs = Vec::new();
        append_close_pairs(positions, &points[ends[0] as usize..ends[1] as usize], tolerance, &mut pairs);
        pairs
    };
    starts.par_windows(2).with_min_len(4096).filter(|ends| ends[1] - ends[0] > 1).flat_map_iter(in_bucket).collect()
}

/// Points by the hash of their cell, in about as many buckets as there are keys (hash, point): where each begins, and all.
fn buckets(keys: &[u64]) -> (Vec<u32>, Vec<u32>) {
    let mask = keys.len().next_power_of_two() - 1;
    let bucket = |key: u64| (key >> 32) as usize & mask;
    let mut starts = vec![0u32; mask + 2];
    keys.iter().for_each(|&key| starts[bucket(key) + 1] += 1);
    (0..=mask).for_each(|k| starts[k + 1] += starts[k]);
    let (mut next, mut points) = (starts.clone(), vec![0; keys.len()]);
    for &key in keys {
        let at = &mut next[bucket(key)];
        points[*at as usize] = key as u32;
        *at += 1;
    }
    (starts, points)
}

/// Calls `visit` with the hash of every cell within `reach` of a point.
fn for_each_cell(position: [f32; 3], width: f64, reach: f64, mut visit: impl FnMut(u32)) {
    let ranges = position.map(|x| {
        let at = |x: f64| floor(x / width);
        (at(f64::from(x) - reach), at(f64::from(x) + reach))
    });
    for x in ranges[0].0..=ranges[0].1 {
        for y in ranges[1].0..=ranges[1].1 {
            for z in ranges[2].0..=ranges[2].1 {
                visit(hash([x, y, z]));
            }
        }
    }
}

/// The next lower whole number, without the call that `f64::floor` is where nothing is known of the processor.
fn floor(x: f64) -> i64 {
    let towards_zero = x as i64;
    towards_zero - i64::from((towards_zero as f64) > x)
}

fn hash(cell: [i64; 3]) -> u32 {
    let mixed = cell.iter().fold(0x9E37_79B9_7F4A_7C15_u64, |hash, &x| {
        let hash = (hash ^ x as u64).wrapping_mul(0xD6E8_FEB8_6659_FD93);
        hash ^ hash >> 32
    });
    mixed as u32
}

fn are_close(positions: &[[f32; 3]], i: u32, j: u32, tolerance: f64) -> bool {
    let difference = |k: usize| f64::from(positions[i as usize][k]) - f64::from(positions[j as usize][k]);
    (0..3).map(|k| difference(k) * difference(k)).sum::<f64>() <= tolerance * tolerance
}

/// Appends close pairs among the `points` of one cell.
fn append_close_pairs(positions: &[[f32; 3]], points: &[u32], tolerance: f64, pairs: &mut Vec<(u32, u32)>) {
    if points.len() > CROWD {
        return append_pairs_of_crowd(positions, points, tolerance, pairs);
    }
    for (k, &i) in points.iter().enumerate() {
        let close = points[..k].iter().filter(|&&j| are_close(positions, i, j, tolerance));
        pairs.extend(close.map(|&j| (j, i)));
    }
}

/// The same for many points: those in a cell whose diagonal is the tolerance are close without a look, and cells are
/// compared with the neighbours that are near enough, point by point until a close pair is found.
fn append_pairs_of_crowd(positions: &[[f32; 3]], points: &[u32], tolerance: f64, pairs: &mut Vec<(u32, u32)>) {
    // A shade smaller than tolerance / sqrt(3), so that rounding does not matter.
    let width = 0.577 * tolerance;
    let cell_of = |i: u32| positions[i as usize].map(|x| (f64::from(x) / width).floor() as i64);
    let mut keyed: Vec<([i64; 3], u32)> = points.iter().map(|&i| (cell_of(i), i)).collect();
    keyed.sort_unstable();
    let cells: Vec<&[([i64; 3], u32)]> = keyed.chunk_by(|a, b| a.0 == b.0).collect();
    for cell in &cells {
        pairs.extend(cell[1..].iter().map(|&(_, i)| (cell[0].1, i)));
        let [x, y, z] = cell[0].0;
        for neighbour in (0..125).map(|k| [x + k / 25 - 2, y + k / 5 % 5 - 2, z + k % 5 - 2]) {
            if neighbour <= cell[0].0 {
                continue;
            }
            if let Ok(at) = cells.binary_search_by_key(&neighbour, |cell| cell[0].0) {
                let close = |&(i, j): &(u32, u32)| are_close(positions, i, j, tolerance);
                let all = cell.iter().flat_map(|&(_, i)| cells[at].iter().map(move |&(_, j)| (i, j)));
                pairs.extend({ all }.find(close));
            }
        }
    }
}
