//! The inside of a mesh as a graph of cells.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::bridges::{Bridge, bridges, nearest_nodes};
use super::cells::Cells;
use super::rasterise::touched;
use super::winding::Winding;
use crate::adjacency::NONE;
use crate::error::Result;
use crate::mesh::TriMesh;
use crate::progress::Progress;

/// Cells in a row whose winding number is taken to be the same, if the first one's is as good as whole.
const ALIKE: usize = 8;
const WHOLE: f64 = 0.15;

/// Most cells a lattice may have; a finer resolution is made coarser.
const MOST_CELLS: f64 = 2e7;

/// The inside of a mesh as a graph: a node for each cell whose middle is inside, and for each cell that the surface touches
/// where no such cell is near (sheets, and parts thinner than a cell). Nodes are adjacent if their cells share a corner;
/// what does not hang together is connected by bridges over the smallest gaps, so the graph is always one piece.
#[derive(Debug)]
pub struct Lattice {
    cells: Cells,
    /// Node of each cell, or [`NONE`].
    node_of_cell: Vec<u32>,
    /// Cell of each node, ascending.
    cell_of_node: Vec<u32>,
    /// Nearest node to each cell.
    nearest: Vec<u32>,
    bridges: Vec<Bridge>,
}

impl Lattice {
    /// Builds the graph with `resolution` cells along the diameter of the mesh (twice the distance of its farthest vertex
    /// from the middle of its box). Reports 0 to 1 to `progress`.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn new(mesh: &TriMesh<'_>, resolution: f64, progress: &Progress) -> Result<Self> {
        let cells = cells_over(mesh, resolution);
        let touched = touched(mesh, &cells);
        progress.check()?;
        let inside = inside(&Winding::new(mesh), &cells, &touched, progress)?;
        let node_of_cell = number_nodes(&cells, &touched, &inside);
        let mut cell_of_node = Vec::new();
        for (cell, &node) in node_of_cell.iter().enumerate() {
            if node != NONE {
                cell_of_node.push(cell as u32);
            }
        }
        progress.check()?;
        let (nearest, gaps) = nearest_nodes(&cells, &node_of_cell);
        let mut lattice = Self { cells, node_of_cell, cell_of_node, nearest, bridges: Vec::new() };
        progress.check()?;
        lattice.bridges = bridges(&lattice, &gaps);
        Ok(lattice)
    }

    /// The cells.
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Number of nodes, at least 1.
    pub fn len(&self) -> usize {
        self.cell_of_node.len()
    }

    /// Never: a mesh has a triangle, and a triangle touches a cell.
    pub fn is_empty(&self) -> bool {
        self.cell_of_node.is_empty()
    }

    /// Middle of the cell of `node`, world space.
    pub fn middle(&self, node: u32) -> DVec3 {
        self.cells.middle(self.place(node))
    }

    pub(super) fn place(&self, node: u32) -> IVec3 {
        self.cells.place_of(self.cell(node))
    }

    pub(super) fn cell(&self, node: u32) -> usize {
        self.cell_of_node[node as usize] as usize
    }

    pub(super) fn node_of_cell(&self) -> &[u32] {
        &self.node_of_cell
    }

    /// Connections between nodes that are not neighbours, each both ways, by their first node.
    pub(super) fn bridges(&self) -> &[Bridge] {
        &self.bridges
    }

    /// The node whose cell holds `point`, if there is one.
    pub fn node_at(&self, point: DVec3) -> Option<u32> {
        let node = self.node_of_cell[self.cells.index_of(point)];
        (node != NONE).then_some(node)
    }

    /// A node near `point`: that of its cell, or the one nearest to that cell.
    pub fn nearest_node(&self, point: DVec3) -> u32 {
        self.nearest[self.cells.index_of(point)]
    }

    /// The node that stands for a surface point with a `normal`: the nearest to it of those around, seen from a little
    /// way inside, so that a point does not belong to what is opposite across a gap.
    pub fn node_below(&self, point: DVec3, normal: DVec3) -> u32 {
        let seen_from = point - 0.6 * self.cells.size() * normal;
        let place = self.cells.place(seen_from);
        let mut best = (f64::INFINITY, NONE);
        for k in 0..27 {
            let near = place + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
            let node = self.node_of_cell[self.cells.index(near)];
            let distance = self.cells.middle(near).distance_squared(seen_from);
            if node != NONE && distance < best.0 {
                best = (distance, node);
            }
        }
        if best.1 == NONE { self.nearest_node(seen_from) } else { best.1 }
    }

    /// The nodes adjacent to `node`, and how far away they are in cells.
    pub fn neighbours(&self, node: u32) -> impl Iterator<Item = (u32, f64)> {
        let cell = self.cell(node) as isize;
        let around = self.cells.neighbours().into_iter();
        let around = around.map(move |(step, length)| (self.node_of_cell[(cell + step) as usize], length));
        let first = self.bridges.partition_point(|bridge| bridge.from < node);
        let bridges = self.bridges[first..].iter().take_while(move |bridge| bridge.from == node);
        around.filter(|&(other, _)| other != NONE).chain(bridges.map(|bridge| (bridge.to, bridge.length)))
    }

    /// Whether the cell at `place` or one of its neighbours has a node.
    pub fn is_near_node(&self, place: IVec3) -> bool {
        let cell = self.cells.index(place);
        let near = |(step, _): (isize, f64)| self.node_of_cell[(cell as isize + step) as usize] != NONE;
        self.node_of_cell[cell] != NONE || self.cells.neighbours().into_iter().any(near)
    }

    /// Whether the straight way from `start` to `end` leaves the nodes' cells nowhere but within `slack` cells of its ends.
    pub fn sees(&self, start: DVec3, end: DVec3, slack: f64) -> bool {
        let length = start.distance(end);
        let steps = (2.0 * length / self.cells.size()).ceil();
        let margin = slack * self.cells.size();
        (1..steps as usize).all(|k| {
            let along = k as f64 / steps;
            let from_ends = length * along.min(1.0 - along);
            from_ends < margin || self.node_at(start.lerp(end, along)).is_some()
        })
    }
}

fn cells_over(mesh: &TriMesh<'_>, resolution: f64) -> Cells {
    let used = || mesh.triangles().as_flattened().iter().map(|&i| mesh.position(i));
    let (low, high) = used().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let middle = 0.5 * (low + high);
    let diameter = 2.0 * used().map(|p| p.distance(middle)).fold(0.0, f64::max);
    // A point has no size, and the cells of a point may have any.
    let size = if diameter > 0.0 { diameter / resolution } else { 1.0 };
    let volume = ((high - low) / size + 4.0).element_product();
    Cells::new(low, high, size * (volume / MOST_CELLS).max(1.0).cbrt())
}

/// Whether the middle of each cell is inside.
fn inside(winding: &Winding, cells: &Cells, touched: &[bool], progress: &Progress) -> Result<Vec<bool>> {
    let row = cells.counts().x as usize;
    let mut inside = vec![false; cells.len()];
    inside.par_chunks_mut(row).enumerate().try_for_each(|(r, inside)| {
        progress.check()?;
        let number = |x: usize| winding.number(cells.middle(cells.place_of(r * row + x)).as_vec3().to_array());
        fill_row(inside, &touched[r * row..][..row], number);
        Ok(())
    })?;
    Ok(inside)
}

/// No surface lies between cells of a run that it does not touch: there the winding number only changes near holes.
fn fill_row(inside: &mut [bool], touched: &[bool], number: impl Fn(usize) -> f64) {
    let mut x = 0;
    while x < inside.len() {
        let first = number(x);
        inside[x] = first > 0.5;
        let whole = (first - first.round()).abs() < WHOLE;
        let run = if whole && !touched[x] { ALIKE } else { 1 };
        let end = (x + 1..(x + run).min(inside.len())).find(|&y| touched[y]).unwrap_or((x + run).min(inside.len()));
        inside[x..end].fill(first > 0.5);
        x = end;
    }
}

fn number_nodes(cells: &Cells, touched: &[bool], inside: &[bool]) -> Vec<u32> {
    let neighbours = cells.neighbours();
    let is_node = |cell: usize| {
        let alone = || !neighbours.iter().any(|&(step, _)| inside[(cell as isize + step) as usize]);
        cells.is_inner(cells.place_of(cell)) && (inside[cell] || touched[cell] && alone())
    };
    let is_node: Vec<bool> = (0..cells.len()).into_par_iter().with_min_len(4096).map(is_node).collect();
    let mut count = 0;
    let number = |is_node: bool| {
        let node = if is_node { count } else { NONE };
        count += u32::from(is_node);
        node
    };
    is_node.into_iter().map(number).collect()
}
