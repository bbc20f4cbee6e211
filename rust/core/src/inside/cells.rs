//! A box of cubic cells.

use glam::{DVec3, IVec3};

/// Empty cells around what the box was made for, so that no neighbour of a cell that matters is out of range.
const MARGIN: i32 = 2;

/// A box of cubic cells, numbered x first.
#[derive(Debug, Clone, Copy)]
pub struct Cells {
    origin: DVec3,
    size: f64,
    counts: IVec3,
}

impl Cells {
    /// Cells of the given `size` (world units, positive) over the box from `low` to `high`, with two more on every side.
    pub fn new(low: DVec3, high: DVec3, size: f64) -> Self {
        let counts = ((high - low) / size).ceil().as_ivec3().max(IVec3::ONE) + 2 * MARGIN;
        let slack = counts.as_dvec3() * size - (high - low);
        Self { origin: low - 0.5 * slack, size, counts }
    }

    /// Edge of a cell, world units.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.counts.as_usizevec3().element_product()
    }

    /// Never: there is always a margin.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Cells along each axis.
    pub fn counts(&self) -> IVec3 {
        self.counts
    }

    /// Place of the cell that holds `point`; of the nearest inner one where `point` is outside.
    pub fn place(&self, point: DVec3) -> IVec3 {
        ((point - self.origin) / self.size).floor().as_ivec3().clamp(IVec3::ONE, self.counts - 2)
    }

    /// Number of the cell at `place`.
    pub fn index(&self, place: IVec3) -> usize {
        let (x, y, z) = (place.x as usize, place.y as usize, place.z as usize);
        (z * self.counts.y as usize + y) * self.counts.x as usize + x
    }

    /// Number of the cell that holds `point`, in the same way.
    pub fn index_of(&self, point: DVec3) -> usize {
        self.index(self.place(point))
    }

    /// Place of cell `index`.
    pub fn place_of(&self, index: usize) -> IVec3 {
        let (x, y) = (self.counts.x as usize, self.counts.y as usize);
        IVec3::new((index % x) as i32, (index / x % y) as i32, (index / (x * y)) as i32)
    }

    /// Middle of the cell at `place`, world space.
    pub fn middle(&self, place: IVec3) -> DVec3 {
        self.origin + (place.as_dvec3() + 0.5) * self.size
    }

    /// Whether no neighbour of the cell at `place` is out of range.
    pub fn is_inner(&self, place: IVec3) -> bool {
        place.cmpge(IVec3::ONE).all() && place.cmplt(self.counts - 1).all()
    }

    /// For the 26 neighbours of an inner cell: what to add to its number, and how far away they are in cells.
    pub fn neighbours(&self) -> [(isize, f64); 26] {
        let step = |k: usize| {
            let k = if k < 13 { k } else { k + 1 };
            IVec3::new(k as i32 % 3 - 1, k as i32 / 3 % 3 - 1, k as i32 / 9 - 1)
        };
        let row = self.counts.x as isize;
        let layer = row * self.counts.y as isize;
        std::array::from_fn(|k| {
            let s = step(k);
            (s.x as isize + s.y as isize * row + s.z as isize * layer, s.as_dvec3().length())
        })
    }
}
