//! Who touches whom on a triangle mesh: clean triangles, triangles around a vertex, islands.

use std::borrow::Cow;

use rayon::prelude::*;

/// Marks a vertex without triangle or wire, in every per-vertex index array.
pub const NONE: u32 = u32::MAX;

/// The triangles around each vertex, compressed by vertex, ascending.
#[derive(Debug)]
pub struct VertexTriangles {
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl VertexTriangles {
    /// Collects the triangles (T, 3) around each of `vertex_count` vertices.
    pub fn new(triangles: &[[u32; 3]], vertex_count: usize) -> Self {
        let mut starts = vec![0u32; vertex_count + 1];
        for &i in triangles.as_flattened() {
            starts[i as usize + 1] += 1;
        }
        for i in 0..vertex_count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut around = vec![0u32; triangles.len() * 3];
        for (t, corners) in triangles.iter().enumerate() {
            for &i in corners {
                around[next[i as usize] as usize] = t as u32;
                next[i as usize] += 1;
            }
        }
        Self { starts, triangles: around }
    }

    /// The triangles around vertex `i`.
    pub fn around(&self, i: usize) -> &[u32] {
        &self.triangles[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    /// Whether any triangle uses vertex `i`.
    pub fn is_used(&self, i: usize) -> bool {
        self.starts[i] < self.starts[i + 1]
    }
}

/// Clean triangles and who touches whom through them.
#[derive(Debug)]
pub struct Topology<'a> {
    /// None names a vertex twice, and no two have the same three vertices; in order.
    pub triangles: Cow<'a, [[u32; 3]]>,
    /// The triangles around each vertex.
    pub around: VertexTriangles,
    /// Edges that count beside them.
    pub wires: Wires,
    /// What hangs together.
    pub islands: Islands,
}

/// Edges that lead to a vertex without a triangle: wires, hair strands, laces.
#[derive(Debug, Default)]
pub struct Wires {
    /// Distinct ones, the lower vertex first, ascending.
    pub edges: Vec<[u32; 2]>,
    starts: Vec<u32>,
    other_ends: Vec<u32>,
}

impl Wires {
    /// Those of `edges` (E, 2) of which at least one end is not `used` by a triangle.
    pub fn new(edges: &[[u32; 2]], used: impl Fn(u32) -> bool, vertex_count: usize) -> Self {
        let counts = |&&[i, j]: &&[u32; 2]| i != j && !(used(i) && used(j));
        let mut edges: Vec<[u32; 2]> = edges.iter().filter(counts).map(|&[i, j]| [i.min(j), i.max(j)]).collect();
        if edges.is_empty() {
            return Self::default();
        }
        edges.sort_unstable();
        edges.dedup();
        let mut starts = vec![0u32; vertex_count + 1];
        edges.as_flattened().iter().for_each(|&i| starts[i as usize + 1] += 1);
        (0..vertex_count).for_each(|i| starts[i + 1] += starts[i]);
        let (mut next, mut other_ends) = (starts.clone(), vec![0; 2 * edges.len()]);
        for &[i, j] in &edges {
            for (end, other) in [(i, j), (j, i)] {
                other_ends[next[end as usize] as usize] = other;
                next[end as usize] += 1;
            }
        }
        Self { edges, starts, other_ends }
    }

    /// The other ends of the wires at vertex `i`.
    pub fn around(&self, i: usize) -> &[u32] {
        match self.starts.get(i..i + 2) {
            Some(&[start, end]) => &self.other_ends[start as usize..end as usize],
            _ => &[],
        }
    }
}

impl<'a> Topology<'a> {
    /// Drops triangles that name a vertex twice, and every repetition of the same three vertices (whatever the winding).
    /// Both would put NaN or a doubled stiffness into the Laplacian.
    pub fn new(triangles: &'a [[u32; 3]], vertex_count: usize) -> Self {
        Self::with_edges(triangles, &[], vertex_count)
    }

    /// The same with `edges` (E, 2), of which those count that lead to a vertex without a triangle.
    pub fn with_edges(triangles: &'a [[u32; 3]], edges: &[[u32; 2]], vertex_count: usize) -> Self {
        let repeats_a_vertex = |t: &[u32; 3]| t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
        let mut triangles = Cow::Borrowed(triangles);
        if triangles.par_iter().any(repeats_a_vertex) {
            triangles = triangles.iter().filter(|t| !repeats_a_vertex(t)).copied().collect();
        }
        let mut used = vec![false; if edges.is_empty() { 0 } else { vertex_count }];
        if !edges.is_empty() {
            triangles.as_flattened().iter().for_each(|&i| used[i as usize] = true);
        }
        let wires = Wires::new(edges, |i| used[i as usize], vertex_count);
        let find_duplicates = || {
            let around = VertexTriangles::new(&triangles, vertex_count);
            (duplicated_triangles(&triangles, &around, vertex_count), around)
        };
        // Duplicates connect nothing that is not connected without them.
        let ((duplicates, mut around), islands) =
            rayon::join(find_duplicates, || Islands::with_wires(&triangles, &wires.edges, vertex_count));
        if !duplicates.is_empty() {
            let mut dropped = duplicates.iter().peekable();
            let keep = |&(t, _): &(usize, &[u32; 3])| dropped.next_if(|&&d| d as usize == t).is_none();
            triangles = triangles.iter().enumerate().filter(keep).map(|(_, &corners)| corners).collect();
            around = VertexTriangles::new(&triangles, vertex_count);
        }
        Self { triangles, around, wires, islands }
    }
}

/// Every triangle whose vertex set an earlier triangle has already, ascending. Equal sets meet at their smallest vertex.
fn duplicated_triangles(triangles: &[[u32; 3]], around: &VertexTriangles, vertex_count: usize) -> Vec<u32> {
    let sorted = |t: u32| {
        let mut corners = triangles[t as usize];
        corners.sort_unstable();
        corners
    };
    let at_vertex = |seen: &mut Vec<([u32; 3], u32)>, i: usize| {
        seen.clear();
        seen.extend(around.around(i).iter().map(|&t| (sorted(t), t)).filter(|(corners, _)| corners[0] as usize == i));
        seen.sort_unstable();
        seen.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1).collect::<Vec<_>>()
    };
    let mut duplicates: Vec<u32> =
        (0..vertex_count).into_par_iter().map_init(Vec::new, at_vertex).flatten_iter().collect();
    duplicates.sort_unstable();
    duplicates
}

/// The islands (connected components of faces and wires) of a mesh, numbered by their smallest vertex.
#[derive(Debug)]
pub struct Islands {
    of_vertex: Vec<u32>,
    count: usize,
}

impl Islands {
    /// Finds the islands of `triangles` (T, 3) over `vertex_count` vertices.
    pub fn new(triangles: &[[u32; 3]], vertex_count: usize) -> Self {
        Self::with_wires(triangles, &[], vertex_count)
    }

    /// The same with `wires` (W, 2).
    pub fn with_wires(triangles: &[[u32; 3]], wires: &[[u32; 2]], vertex_count: usize) -> Self {
        let mut sets = DisjointSets::new(vertex_count);
        let mut used = vec![false; vertex_count];
        for &[a, b, c] in triangles {
            sets.union(a, b);
            sets.union(a, c);
            for i in [a, b, c] {
                used[i as usize] = true;
            }
        }
        for &[i, j] in wires {
            sets.union(i, j);
            (used[i as usize], used[j as usize]) = (true, true);
        }
        let (of_vertex, count) = sets.number(|i| used[i as usize]);
        Self { of_vertex, count }
    }

    /// Island of each vertex (V), [`NONE`] for a vertex without triangle or wire.
    pub fn of_vertex(&self) -> &[u32] {
        &self.of_vertex
    }

    /// Number of islands.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// Union-find whose representative is always the smallest member, so results do not depend on the order of unions.
#[derive(Debug)]
pub struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// `count` sets of one member each.
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// The smallest member of the set that holds `i`.
    pub fn find(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            let grandparent = self.parent[self.parent[i as usize] as usize];
            self.parent[i as usize] = grandparent;
            i = grandparent;
        }
        i
    }

    /// Merges the sets of `i` and `j`.
    pub fn union(&mut self, i: u32, j: u32) {
        let (i, j) = (self.find(i), self.find(j));
        self.parent[i.max(j) as usize] = i.min(j);
    }

    /// Numbers the sets 0.. by smallest member, over the members that `keep` accepts; the others get [`NONE`].
    pub fn number(mut self, keep: impl Fn(u32) -> bool) -> (Vec<u32>, usize) {
        let mut number = vec![NONE; self.parent.len()];
        let mut count = 0;
        for i in (0..self.parent.len() as u32).filter(|&i| keep(i)) {
            let root = self.find(i) as usize;
            if number[root] == NONE {
                number[root] = count;
                count += 1;
            }
            number[i as usize] = number[root];
        }
        (number, count as usize)
    }
}
