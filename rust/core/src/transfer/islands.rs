//! Islands without a single match have no equation (the paper's stated limitation). They get weights by a policy.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::Vec3;

use super::Source;
use super::source::merge_and_normalise;
use crate::adjacency::{Islands, NONE};
use crate::mesh::TriMesh;
use crate::surface::{SurfaceIndex, SurfacePoint};
use crate::weights::Weights;

/// What an island of the target without any match gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IslandPolicy {
    /// The whole island takes one row, from the nearest point of the garment around it: buttons, belts, pockets.
    Bridge,
    /// Each vertex takes its own closest point's weights: soft parts that lie on the body.
    Nearest,
    /// The whole island takes the mean of its closest points' rows, near ones counting more: buckles, plates.
    Rigid,
    /// Left without weights and reported.
    Skip,
}

impl IslandPolicy {
    /// All policies, for tests and menus.
    pub const ALL: [Self; 4] = [Self::Bridge, Self::Nearest, Self::Rigid, Self::Skip];
}

/// One island without a match and what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct UnmatchedIsland {
    /// Its smallest vertex.
    pub first_vertex: u32,
    /// Number of its vertices.
    pub vertices: usize,
    /// The policy that gave it its weights; differs from the one asked for where that one had nothing to give.
    pub policy: IslandPolicy,
}

/// The target as the island step sees it.
pub(super) struct Scene<'a> {
    pub source: &'a Source,
    pub mesh: TriMesh<'a>,
    pub islands: &'a Islands,
    /// Closest source point of each vertex.
    pub points: &'a [SurfacePoint],
    /// Whether an island holds a match.
    pub has_match: &'a [bool],
    /// Gap, world units, over which an island hangs on the garment even if the body is nearer.
    pub max_distance: f64,
}

type Row = Vec<(u32, f64)>;

impl Scene<'_> {
    /// Fills the rows of islands without a match, and of loose vertices (always from their closest point). Returns the
    /// islands concerned.
    pub fn fill(&self, weights: Weights, policy: IslandPolicy) -> (Weights, Vec<UnmatchedIsland>) {
        let members = self.members();
        let mut rows: Vec<Option<Row>> = vec![None; members.len()];
        let mut policies = vec![policy; members.len()];
        if matches!(policy, IslandPolicy::Nearest | IslandPolicy::Rigid) {
            for (row, island) in std::iter::zip(&mut rows, &members) {
                *row = Some(self.mean_row(island)).filter(|row| !row.is_empty());
            }
        }
        if policy != IslandPolicy::Skip {
            let pending: Vec<usize> =
                (0..members.len()).filter(|&k| !members[k].is_empty() && rows[k].is_none()).collect();
            for &k in &pending {
                policies[k] = IslandPolicy::Bridge;
            }
            if !pending.is_empty() {
                Bridging::new(self, &weights, &members).hang(&pending, &mut rows);
            }
        }
        let filled = Weights::from_rows(self.points.len(), weights.n_bones(), Row::new, |row, i, out| {
            row.clear();
            match self.islands.of_vertex()[i] {
                NONE => self.source.blend(&self.points[i], row),
                island if self.has_match[island as usize] => {
                    let (bones, values) = weights.row(i);
                    out.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, value)));
                }
                island => {
                    if policies[island as usize] == IslandPolicy::Nearest {
                        self.source.blend(&self.points[i], row);
                    }
                    if row.is_empty() {
                        row.extend(rows[island as usize].iter().flatten());
                    }
                }
            }
            out.extend(row.iter().map(|&(bone, value)| (bone, value as f32)));
        });
        let unmatched = std::iter::zip(&members, policies).filter(|(island, _)| !island.is_empty());
        let report = |(island, policy): (&Vec<u32>, IslandPolicy)| UnmatchedIsland {
            first_vertex: island[0],
            vertices: island.len(),
            policy,
        };
        (filled, unmatched.map(report).collect())
    }

    /// Vertices of each island without a match; empty for the others.
    fn members(&self) -> Vec<Vec<u32>> {
        let mut members = vec![Vec::new(); self.islands.count()];
        for (i, &island) in self.islands.of_vertex().iter().enumerate() {
            if island != NONE && !self.has_match[island as usize] {
                members[island as usize].push(i as u32);
            }
        }
        members
    }

    /// Mean of the closest points' rows, each weighing 1 / (distance + 0.001 of the source's diagonal).
    fn mean_row(&self, island: &[u32]) -> Row {
        let mut mean = Row::new();
        for &i in island {
            let point = &self.points[i as usize];
            let share = 1.0 / (point.distance + 1e-3 * self.source.diagonal()).max(f64::MIN_POSITIVE.sqrt());
            let start = mean.len();
            self.source.blend(point, &mut mean);
            mean[start..].iter_mut().for_each(|(_, value)| *value *= share);
            if mean.len() > 4096 {
                merge(&mut mean);
            }
        }
        merge_and_normalise(&mut mean, 0);
        mean
    }
}

/// Merges equal bones without changing the row's sum.
fn merge(row: &mut Row) {
    let sum: f64 = row.iter().map(|&(_, value)| value).sum();
    merge_and_normalise(row, 0);
    row.iter_mut().for_each(|(_, value)| *value *= sum);
}

/// Hangs islands one by one, always the one with the smallest gap to what is solved already (Prim's algorithm), so a
/// buckle on a belt on a coat follows the belt, and the belt the coat.
struct Bridging<'a> {
    scene: &'a Scene<'a>,
    weights: &'a Weights,
    members: &'a [Vec<u32>],
    /// Triangles of each island without a match, and of all the others together.
    triangles: Vec<Vec<[u32; 3]>>,
    solved: Vec<[u32; 3]>,
}

/// The nearest solved point found so far.
#[derive(Clone)]
struct Anchor {
    gap: f64,
    row: Row,
}

impl<'a> Bridging<'a> {
    fn new(scene: &'a Scene<'a>, weights: &'a Weights, members: &'a [Vec<u32>]) -> Self {
        let mut triangles = vec![Vec::new(); members.len()];
        let mut solved = Vec::new();
        for &t in scene.mesh.triangles() {
            let island = scene.islands.of_vertex()[t[0] as usize] as usize;
            if scene.has_match[island] { solved.push(t) } else { triangles[island].push(t) }
        }
        Self { scene, weights, members, triangles, solved }
    }

    fn hang(&self, pending: &[usize], rows: &mut [Option<Row>]) {
        let mut anchors: Vec<Option<Anchor>> = vec![None; rows.len()];
        let mut queue = BinaryHeap::new();
        for (&k, anchor) in std::iter::zip(pending, self.nearest_solved(pending)) {
            queue.push(Reverse((anchor.gap.to_bits(), k)));
            anchors[k] = Some(anchor);
        }
        let boxes: Vec<Bounds> = self.members.iter().map(|island| Bounds::new(self.scene.mesh, island)).collect();
        while let Some(Reverse((gap, k))) = queue.pop() {
            let Some(anchor) = anchors[k].take_if(|anchor| anchor.gap.to_bits() == gap) else { continue };
            let row = self.choose(&self.members[k], anchor);
            let nearer = |&&p: &&usize| anchors[p].as_ref().is_some_and(|a| boxes[p].distance(&boxes[k]) < a.gap);
            let neighbours: Vec<usize> = pending.iter().filter(nearer).copied().collect();
            if !neighbours.is_empty() {
                let index = self.index_of(&self.triangles[k]);
                for p in neighbours {
                    let gap = self.nearest(&index, &self.members[p]).distance;
                    if anchors[p].as_ref().is_some_and(|anchor| gap < anchor.gap) {
                        anchors[p] = Some(Anchor { gap, row: row.clone() });
                        queue.push(Reverse((gap.to_bits(), p)));
                    }
                }
            }
            rows[k] = Some(row);
        }
    }

    /// The garment's row, unless the garment is out of reach and the body is nearer.
    fn choose(&self, island: &[u32], anchor: Anchor) -> Row {
        let points = self.scene.points;
        let body = island.iter().map(|&i| &points[i as usize]).min_by(|a, b| a.distance.total_cmp(&b.distance));
        let body = body.filter(|body| anchor.gap > self.scene.max_distance && body.distance < anchor.gap);
        let mut row = Row::new();
        if let Some(body) = body {
            self.scene.source.blend(body, &mut row);
        }
        if row.is_empty() { anchor.row } else { row }
    }

    fn nearest_solved(&self, pending: &[usize]) -> Vec<Anchor> {
        let index = self.index_of(&self.solved);
        let anchor = |&k: &usize| {
            let point = self.nearest(&index, &self.members[k]);
            let mut row = Row::new();
            for (i, share) in std::iter::zip(self.solved[point.triangle as usize], point.barycentric) {
                let (bones, values) = self.weights.row(i as usize);
                row.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, share * f64::from(value))));
            }
            merge_and_normalise(&mut row, 0);
            Anchor { gap: point.distance, row }
        };
        pending.iter().map(anchor).collect()
    }

    fn index_of(&self, triangles: &[[u32; 3]]) -> SurfaceIndex {
        let mesh = TriMesh::new(self.scene.mesh.positions(), triangles, "target");
        SurfaceIndex::new(&mesh.expect("part of a checked mesh, and no island is without a triangle"))
    }

    /// The point of the indexed surface nearest to any vertex of `island`.
    fn nearest(&self, index: &SurfaceIndex, island: &[u32]) -> SurfacePoint {
        let positions: Vec<[f32; 3]> = island.iter().map(|&i| self.scene.mesh.positions()[i as usize]).collect();
        let points = index.closest_points(&positions);
        points.into_iter().min_by(|a, b| a.distance.total_cmp(&b.distance)).expect("an island has vertices")
    }
}

/// An axis-aligned box.
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    fn new(mesh: TriMesh<'_>, vertices: &[u32]) -> Self {
        let positions = vertices.iter().map(|&i| Vec3::from(mesh.positions()[i as usize]));
        let nothing = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
        positions.fold(nothing, |b, p| Self { low: b.low.min(p), high: b.high.max(p) })
    }

    fn distance(&self, other: &Self) -> f64 {
        let gap = (self.low - other.high).max(other.low - self.high).max(Vec3::ZERO);
        f64::from(gap.length())
    }
}
