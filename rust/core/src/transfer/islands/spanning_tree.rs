//! Hangs islands one by one, always the one with the smallest gap to what is solved already (Prim's algorithm), so a
//! buckle on a belt on a coat follows the belt, and the belt the coat.

use rayon::prelude::*;

use super::super::source::merge_and_normalise;
use super::bounds::Bounds;
use super::gap_tree::GapTree;
use super::near_surface::can_be_nearest;
use super::{Scene, Unmatched};
use crate::adjacency::NONE;
use crate::error::Result;
use crate::fill::Row;
use crate::progress::Progress;
use crate::surface::{SurfaceIndex, SurfacePoint, squared_distance_to_triangle};
use crate::weights::Weights;

/// Islands with no more triangles than this are compared without an index.
const FEW_TRIANGLES: usize = 16;

/// Islands that wait to be hung, numbered 0.. in the order of `pending`.
pub(super) struct SpanningTree<'a> {
    tree: GapTree,
    gaps: Gaps<'a>,
}

/// What each pending island hangs on so far.
struct Gaps<'a> {
    scene: &'a Scene<'a>,
    /// Vertices of each pending island.
    members: Vec<&'a [u32]>,
    /// Triangles of each pending island.
    triangles: Vec<Vec<u32>>,
    /// Index over them, once it has paid to make one.
    indices: Vec<Option<SurfaceIndex>>,
    boxes: Vec<Bounds>,
    gaps: Vec<f64>,
    /// Place in the order of hanging of what each hangs on, [`NONE`] for what was solved before.
    anchors: Vec<u32>,
    /// Place of each island in that order, once it is hung.
    order: Vec<u32>,
    /// The row of what was solved, and of the island once it is hung.
    rows: Vec<Row>,
}

impl<'a> SpanningTree<'a> {
    /// Finds the gap of each `pending` island (numbers in `unmatched`) to what is solved, or to the source if nothing is.
    pub(super) fn new(
        scene: &'a Scene<'a>,
        weights: &Weights,
        unmatched: &'a Unmatched,
        pending: &[u32],
        progress: &Progress,
    ) -> Result<Self> {
        let (triangles, solved) = triangles_by_island(scene, unmatched, pending);
        let members: Vec<&[u32]> = pending.iter().map(|&k| unmatched.members(k as usize)).collect();
        let anchors = if solved.is_empty() {
            members.par_iter().map(|members| scene.on_source(members)).collect()
        } else {
            scene.on_solved(weights, solved, &members)
        };
        progress.check()?;
        let bounds_of = |members: &&[u32]| Bounds::of(members.iter().map(|&i| scene.mesh.positions()[i as usize]));
        let boxes: Vec<Bounds> = members.par_iter().map(bounds_of).collect();
        let (gaps, rows): (Vec<f64>, Vec<Row>) = anchors.into_iter().unzip();
        let tree = GapTree::new(&boxes, &gaps);
        let indices = members.iter().map(|_| None).collect();
        let (anchors, order) = (vec![NONE; members.len()], vec![NONE; members.len()]);
        Ok(Self { tree, gaps: Gaps { scene, members, triangles, indices, boxes, gaps, anchors, order, rows } })
    }

    /// The row of each pending island.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub(super) fn hang(mut self, progress: &Progress) -> Result<Vec<Row>> {
        let mut hung: Vec<u32> = Vec::with_capacity(self.gaps.rows.len());
        while let Some(p) = self.tree.pop(&mut |q, p| self.gaps.improve(q, p)) {
            progress.check()?;
            self.gaps.hang(p, &mut hung);
            self.tree.offer(p, &mut |q, p| self.gaps.improve(q, p));
            progress.report(0.9 + 0.1 * hung.len() as f64 / self.gaps.rows.len() as f64);
        }
        Ok(self.gaps.rows)
    }
}

impl Gaps<'_> {
    /// Gives island `p` the row of what it hangs on.
    fn hang(&mut self, p: u32, hung: &mut Vec<u32>) {
        let k = p as usize;
        let of_garment = match self.anchors[k] {
            NONE => std::mem::take(&mut self.rows[k]),
            anchor => self.rows[hung[anchor as usize] as usize].clone(),
        };
        self.rows[k] = self.scene.choose(self.members[k], self.gaps[k], of_garment);
        self.order[k] = hung.len() as u32;
        hung.push(p);
    }

    /// The gap of island `q` to the hung island `p`, if it is smaller than the one `q` has; of equal ones what was hung first
    /// counts, and before all what was solved.
    fn improve(&mut self, q: u32, p: u32) -> Option<f64> {
        let gap = self.gap_between(q, p);
        let k = q as usize;
        let rank = |anchor: u32| anchor.wrapping_add(1);
        let order = self.order[p as usize];
        let is_better = gap < self.gaps[k] || gap == self.gaps[k] && rank(order) < rank(self.anchors[k]);
        is_better.then(|| {
            (self.gaps[k], self.anchors[k]) = (gap, order);
            gap
        })
    }

    /// Smallest distance of a vertex of island `q` to the surface of island `p`; infinite where it is larger than the gap of
    /// `q` for certain.
    fn gap_between(&mut self, q: u32, p: u32) -> f64 {
        let (scene, triangles, bounds) = (self.scene, &self.triangles[p as usize], self.boxes[p as usize]);
        // Boxes are compared in f32.
        let reach = self.gaps[q as usize] * (1.0 + 1e-6);
        let position = |i: u32| scene.mesh.positions()[i as usize];
        let near = |&&i: &&u32| Bounds::of([position(i)].into_iter()).distance(&bounds) <= reach;
        let vertices = self.members[q as usize].iter().filter(near).copied();
        if triangles.len() > FEW_TRIANGLES {
            let make = || SurfaceIndex::of_triangles(&scene.mesh, triangles).expect("there are more than a few");
            let index = self.indices[p as usize].get_or_insert_with(make);
            let queries: Vec<[f32; 3]> = vertices.map(position).collect();
            return index.closest_points(&queries).iter().map(|point| point.distance).fold(f64::INFINITY, f64::min);
        }
        let corners = |&t: &u32| scene.mesh.triangles()[t as usize].map(|i| scene.mesh.position(i));
        let to_triangles = |i: u32| {
            let query = scene.mesh.position(i);
            let squared = triangles.iter().map(|t| squared_distance_to_triangle(query, corners(t)));
            squared.fold(f64::INFINITY, f64::min)
        };
        vertices.map(to_triangles).fold(f64::INFINITY, f64::min).sqrt()
    }
}

/// Triangles of each pending island, and those of islands with a match together, all ascending.
fn triangles_by_island(scene: &Scene<'_>, unmatched: &Unmatched, pending: &[u32]) -> (Vec<Vec<u32>>, Vec<u32>) {
    let mut place = vec![NONE; unmatched.count()];
    std::iter::zip(0.., pending).for_each(|(p, &k)| place[k as usize] = p);
    let (mut triangles, mut solved) = (vec![Vec::new(); pending.len()], Vec::new());
    for (t, corners) in std::iter::zip(0.., scene.mesh.triangles()) {
        match unmatched.number[scene.islands.of_vertex()[corners[0] as usize] as usize] {
            NONE => solved.push(t),
            k if place[k as usize] != NONE => triangles[place[k as usize] as usize].push(t),
            _ => {}
        }
    }
    (triangles, solved)
}

/// Gap and row of an island.
type Anchor = (f64, Row);

impl Scene<'_> {
    /// The garment's row, unless the garment is out of reach and the body is nearer.
    fn choose(&self, members: &[u32], gap: f64, row: Row) -> Row {
        let body = members.iter().map(|&i| &self.points[i as usize]).min_by(|a, b| a.distance.total_cmp(&b.distance));
        let body = body.filter(|body| gap > self.max_distance && body.distance < gap);
        let mut of_body = Row::new();
        if let Some(body) = body {
            self.source.blend(body, &mut of_body);
        }
        if of_body.is_empty() { row } else { of_body }
    }

    /// The nearest point of the source that has weights, as an anchor.
    fn on_source(&self, members: &[u32]) -> Anchor {
        let points = members.iter().map(|&i| &self.points[i as usize]).filter(|point| self.source.is_weighted(point));
        let Some(nearest) = points.min_by(|a, b| a.distance.total_cmp(&b.distance)) else {
            return (f64::INFINITY, Row::new());
        };
        let mut row = Row::new();
        self.source.blend(nearest, &mut row);
        (nearest.distance, row)
    }

    /// The nearest point of the `solved` triangles, as an anchor for each island.
    fn on_solved(&self, weights: &Weights, solved: Vec<u32>, islands: &[&[u32]]) -> Vec<Anchor> {
        let near = can_be_nearest(&self.mesh, solved, islands);
        let index = SurfaceIndex::of_triangles(&self.mesh, &near).expect("something is solved");
        let vertices = islands.iter().copied().flatten();
        let queries: Vec<[f32; 3]> = vertices.map(|&i| self.mesh.positions()[i as usize]).collect();
        let mut points = index.closest_points(&queries).into_iter();
        let nearest = |island: &&[u32]| {
            let points = points.by_ref().take(island.len());
            points.min_by(|a, b| a.distance.total_cmp(&b.distance)).expect("an island has vertices")
        };
        let nearest: Vec<SurfacePoint> = islands.iter().map(nearest).collect();
        nearest.par_iter().with_min_len(256).map(|point| self.on_garment(weights, point)).collect()
    }

    fn on_garment(&self, weights: &Weights, point: &SurfacePoint) -> Anchor {
        let mut row = Row::new();
        for (i, share) in std::iter::zip(self.mesh.triangles()[point.triangle as usize], point.barycentric) {
            let (bones, values) = weights.row(i as usize);
            row.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, share * f64::from(value))));
        }
        merge_and_normalise(&mut row, 0);
        (point.distance, row)
    }
}
