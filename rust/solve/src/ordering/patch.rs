//! Nested dissection of a set so small that its couplings fit in a few words each.

use crate::ordering::bisection::{Point, halve, principal_axes};

/// A node of the elimination tree: a separator or a leaf, all of it eliminated after its descendants.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    /// Number of unknowns.
    pub(crate) columns: usize,
    /// Number of nodes under this one; they come right before it.
    pub(crate) descendants: usize,
}

/// Most points of a patch.
pub(crate) const MOST: usize = 512;
/// Sets up to this size are factored densely: their couplings fill nearly all of their block.
const LEAF: usize = 32;

/// A subset of the patch, one bit per point.
type Set = [u64; MOST / 64];

/// The couplings among the points of a patch.
pub(crate) struct Patch {
    neighbours: Vec<Set>,
    /// Where the points come in the order so far.
    place: Vec<u16>,
    ordered: u16,
}

impl Patch {
    /// Takes the couplings of `points`, of which the neighbours are given as indices into `points`. The points' numbers
    /// become those indices.
    pub(crate) fn new<N: Iterator<Item = u32>>(points: &[Point], neighbours: impl Fn(u32) -> N) -> Self {
        let set = |point: &Point| {
            let mut set = Set::default();
            neighbours(point.unknown).for_each(|local| insert(&mut set, local as usize));
            set
        };
        Self { neighbours: points.iter().map(set).collect(), place: vec![0; points.len()], ordered: 0 }
    }

    /// Orders `points` in place and appends the nodes.
    pub(crate) fn dissect(mut self, points: &mut [Point], nodes: &mut Vec<Node>) {
        let unknowns: Vec<u32> = points.iter().map(|point| point.unknown).collect();
        points.iter_mut().zip(0..).for_each(|(point, local)| point.unknown = local);
        self.split(points, nodes);
        points.iter_mut().for_each(|point| point.unknown = unknowns[point.unknown as usize]);
    }

    fn split(&mut self, points: &mut [Point], nodes: &mut Vec<Node>) {
        if points.len() <= LEAF {
            return self.finish(points, 0, nodes);
        }
        halve(points, principal_axes(points)[0], points[0].position);
        let middle = points.len() / 2;
        let (below, above) = (set_of(&points[..middle]), set_of(&points[middle..]));
        let touches = |point: &Point, other: &Set| intersects(&self.neighbours[point.unknown as usize], other);
        let lower = points[..middle].iter().filter(|point| touches(point, &above)).count();
        let upper = points[middle..].iter().filter(|point| touches(point, &below)).count();
        // The halves are (kept, separator, kept) in this order; the separator goes last.
        let (left, right) = if lower <= upper {
            let kept = first_where(&mut points[..middle], |point| !touches(point, &above));
            points[kept..].rotate_left(middle - kept);
            (kept, points.len() - middle)
        } else {
            (middle, first_where(&mut points[middle..], |point| !touches(point, &below)))
        };
        let (halves, separator) = points.split_at_mut(left + right);
        let before = nodes.len();
        let descendants = set_of(halves);
        let (left, right) = halves.split_at_mut(left);
        self.split(left, nodes);
        self.split(right, nodes);
        separator.sort_by_cached_key(|point| self.first_neighbour(point, &descendants));
        self.finish(separator, nodes.len() - before, nodes);
    }

    /// Gives `points` their places.
    fn finish(&mut self, points: &[Point], descendants: usize, nodes: &mut Vec<Node>) {
        for point in points {
            self.place[point.unknown as usize] = self.ordered;
            self.ordered += 1;
        }
        nodes.push(Node { columns: points.len(), descendants });
    }

    /// The first of a point's neighbours among `descendants`, see [`crate::ordering::dissection`] on why separators are sorted by it.
    fn first_neighbour(&self, point: &Point, descendants: &Set) -> Option<u16> {
        let mut first = None;
        for (word, (neighbours, descendants)) in
            self.neighbours[point.unknown as usize].iter().zip(descendants).enumerate()
        {
            let mut bits = neighbours & descendants;
            while bits != 0 {
                let place = self.place[64 * word + bits.trailing_zeros() as usize];
                first = Some(first.map_or(place, |first: u16| first.min(place)));
                bits &= bits - 1;
            }
        }
        first
    }
}

fn insert(set: &mut Set, i: usize) {
    set[i / 64] |= 1 << (i % 64);
}

fn set_of(points: &[Point]) -> Set {
    let mut set = Set::default();
    points.iter().for_each(|point| insert(&mut set, point.unknown as usize));
    set
}

fn intersects(a: &Set, b: &Set) -> bool {
    a.iter().zip(b).fold(0, |all, (a, b)| all | a & b) != 0
}

/// Moves the points that satisfy `wanted` to the front and returns their number.
pub(crate) fn first_where(points: &mut [Point], wanted: impl Fn(&Point) -> bool) -> usize {
    let mut kept = 0;
    for i in 0..points.len() {
        if wanted(&points[i]) {
            points.swap(i, kept);
            kept += 1;
        }
    }
    kept
}
