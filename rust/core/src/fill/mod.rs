//! Values known at some vertices of a mesh -> values at all of them.
//!
//! Minimises `sum_j w_j' (S + l^2 S M^-1 S) w_j + sum_i b_i |w_i - s_i|^2` over the rows w of all vertices that are not
//! fixed: S the cotangent stiffness, M the Voronoi areas, l a length (0: harmonic), s_i and b_i row and confidence of soft
//! vertices. With fixed and free vertices only this is weight inpainting (Abdrashitov et al., *Robust Skin Weights Transfer
//! via Weight Inpainting*, SIGGRAPH Asia 2023 Technical Communications, doi 10.1145/3610543.3626180).
//!
//! Rows go in and rows come out; where they are from is the caller's business. Unknowns that no chain of two-rings connects
//! never meet in the system, so each such block has a factorisation of its own and only the columns that reach it. A block is
//! factored again only if its unknowns, their confidences or l change. To solve a patch only, hold the rows around it: make
//! every vertex outside of it `Fixed` and give its present row.

mod block;
mod blocks;
mod constraint;
mod doubt;
mod filled;
mod rows;
pub mod screened;
mod system;

pub use constraint::Constraint;
pub use filled::Filled;
pub use rows::{GivenRows, Ragged, Row};
pub use screened::{Found, Patch, RowTable, Screen};

use std::borrow::Cow;

use skinwright_solve::Precision;

use crate::adjacency::{Islands, NONE, Topology};
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::weld::Weld;
use block::{Form, System};
use blocks::Blocks;
use constraint::Known;
use rows::KnownRows;
use system::number_unknowns;

/// Floors for what cannot be solved without, one after the other (see [`Laplacian::with_floor`]).
const FLOORS: [f64; 3] = [1e-4, 1e-3, LAST_FLOOR];
const LAST_FLOOR: f64 = 1e-2;

/// A mesh prepared for filling: topology, Laplacian and the factorisations of the problem posed last.
///
/// # Example
/// A strip of four quads: its ends are known, the rest follows.
/// ```
/// use skinwright_core::Progress;
/// use skinwright_core::fill::{Constraint, Fill, Row};
///
/// let positions: Vec<[f32; 3]> = (0..10).map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
/// let triangles = (0..4).flat_map(|k| [[2 * k, 2 * k + 2, 2 * k + 3], [2 * k, 2 * k + 3, 2 * k + 1]]).collect();
/// let mut fill = Fill::new(positions, triangles, None)?;
/// let mut constraints = vec![Constraint::Free; 10];
/// [0, 1, 8, 9].map(|i| constraints[i] = Constraint::Fixed);
///
/// let progress = Progress::default();
/// let assembled = fill.assemble(constraints, 0.1, &progress)?;
/// fill.factor(assembled, &progress)?;
/// // Column 0 is 1 at the left end, column 1 at the right one.
/// let given = |i: u32, row: &mut Row| row.push((u32::from(i >= 8), 1.0));
/// let filled = fill.solve(&given, &progress)?;
/// let mut middle = Row::new();
/// filled.append_row(4, &mut middle);
/// assert!(middle.iter().all(|(_, value)| (value - 0.5).abs() < 1e-9));
/// # Ok::<(), skinwright_core::Error>(())
/// ```
#[derive(Debug)]
pub struct Fill {
    weld: Option<Weld>,
    vertex_count: usize,
    positions: Vec<[f32; 3]>,
    /// Without repeated vertices and duplicates.
    triangles: Vec<[u32; 3]>,
    /// With them, if there were any.
    all_triangles: Option<Vec<[u32; 3]>>,
    edges: Vec<[u32; 2]>,
    /// Distinct edges to vertices without a triangle.
    wires: Vec<[u32; 2]>,
    islands: Islands,
    laplacian: Laplacian,
    blocks: Blocks,
    known: Known,
}

/// A problem whose missing blocks are assembled and wait to be factored.
#[derive(Debug)]
#[must_use = "nothing is factored yet"]
pub struct Assembled {
    known: Known,
    form: Form,
    missing: Vec<System>,
}

impl Assembled {
    /// Number of blocks to factor.
    pub fn missing_blocks(&self) -> usize {
        self.missing.len()
    }
}

/// Positions (V, 3), triangles (T, 3) and edges (E, 2) of a mesh.
pub type Arrays<'a> = (&'a [[f32; 3]], &'a [[u32; 3]], &'a [[u32; 2]]);

impl Fill {
    /// Prepares a mesh (V positions, T triangles). Vertices that `weld` declares to be one are one in the system: S and M
    /// are assembled on the welded triangles, without those that welding makes degenerate or equal, so that the answer is to
    /// the bit that of the welded mesh.
    ///
    /// # Errors
    /// Those of [`TriMesh::new`]; [`Error::LengthMismatch`] if `weld` is for another number of vertices.
    pub fn new(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>, weld: Option<Weld>) -> Result<Self> {
        Self::with_edges(positions, triangles, Vec::new(), weld)
    }

    /// The same with `edges` (E, 2), of which those count that lead to a vertex without a triangle: a wire is a ribbon as wide
    /// as the wires of its island are long on average. There may be edges only.
    ///
    /// # Errors
    /// Those of [`Fill::new`]; [`Error::EdgeOutOfRange`].
    pub fn with_edges(
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        edges: Vec<[u32; 2]>,
        weld: Option<Weld>,
    ) -> Result<Self> {
        let vertex_count = positions.len();
        TriMesh::with_edges(&positions, &triangles, &edges, "target")?;
        let (positions, triangles, edges) = match &weld {
            None => (positions, triangles, edges),
            Some(weld) => {
                let found = weld.class_of().len();
                if found != vertex_count {
                    return Err(Error::LengthMismatch { what: "weld", found, expected: vertex_count });
                }
                let (positions, triangles) = weld.welded(&positions, &triangles);
                (positions, triangles, weld.welded_edges(&edges))
            }
        };
        let mesh = TriMesh::of_checked(&positions, &triangles);
        let topology = Topology::with_edges(&triangles, &edges, positions.len());
        let laplacian = Laplacian::new(&mesh, &topology);
        let Topology { triangles: clean, islands, wires, .. } = topology;
        let (triangles, all_triangles) =
            if clean.len() == triangles.len() { (triangles, None) } else { (clean.into_owned(), Some(triangles)) };
        let (wires, blocks, known) = (wires.edges, Blocks::default(), Known::default());
        Ok(Self {
            weld,
            vertex_count,
            positions,
            triangles,
            all_triangles,
            edges,
            wires,
            islands,
            laplacian,
            blocks,
            known,
        })
    }

    /// The mesh that is solved on with all of its triangles and edges: positions, (T, 3), (E, 2).
    pub fn arrays(&self) -> Arrays<'_> {
        (&self.positions, self.all_triangles.as_ref().unwrap_or(&self.triangles), &self.edges)
    }

    /// The triangles of [`Fill::mesh`], and after them each wire as one that names its second vertex twice.
    pub fn triangles_and_wires(&self) -> Cow<'_, [[u32; 3]]> {
        if self.wires.is_empty() {
            return Cow::Borrowed(&self.triangles);
        }
        self.triangles.iter().copied().chain(self.wires.iter().map(|&[i, j]| [i, j, j])).collect()
    }

    /// Whether a vertex of the mesh that is solved on has wires but no triangle.
    pub fn is_wire(&self) -> Vec<bool> {
        if self.wires.is_empty() {
            return vec![false; self.positions.len()];
        }
        let mut is_wire: Vec<bool> = self.islands.of_vertex().iter().map(|&island| island != NONE).collect();
        self.triangles.as_flattened().iter().for_each(|&i| is_wire[i as usize] = false);
        is_wire
    }

    /// The mesh that is solved on: welded, without triangles that name a vertex twice or repeat another.
    pub fn mesh(&self) -> TriMesh<'_> {
        TriMesh::of_checked(&self.positions, &self.triangles)
    }

    /// Its islands.
    pub fn islands(&self) -> &Islands {
        &self.islands
    }

    /// Its stiffness and masses.
    pub fn laplacian(&self) -> &Laplacian {
        &self.laplacian
    }

    /// Number of independent blocks of the problem posed last.
    pub fn block_count(&self) -> usize {
        self.blocks.as_slice().len()
    }

    /// Poses a problem: `constraints` (V) and `length` l >= 0 in world units. Assembles the blocks that are not there yet.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::InvalidParameter`], [`Error::Cancelled`].
    pub fn assemble(&mut self, constraints: Vec<Constraint>, length: f64, progress: &Progress) -> Result<Assembled> {
        self.assemble_in(Form { length, precision: Precision::Double }, constraints, progress)
    }

    /// Poses a problem for [`Self::solve_screened`] alone: l = 0, and factors take half the memory.
    ///
    /// # Errors
    /// Those of [`Fill::assemble`].
    pub fn assemble_screened(&mut self, constraints: Vec<Constraint>, progress: &Progress) -> Result<Assembled> {
        self.assemble_in(Form { length: 0.0, precision: Precision::Single }, constraints, progress)
    }

    fn assemble_in(&mut self, form: Form, constraints: Vec<Constraint>, progress: &Progress) -> Result<Assembled> {
        let length = form.length;
        let (found, expected) = (constraints.len(), self.vertex_count);
        if found != expected {
            return Err(Error::LengthMismatch { what: "constraints", found, expected });
        }
        if !(length.is_finite() && length >= 0.0) {
            let must = "must be a finite number, 0 or more";
            return Err(Error::InvalidParameter { name: "length", value: length, must });
        }
        let known = Known::new(constraints, self.weld.as_ref(), &self.islands)?;
        let missing = self.blocks.assemble_missing(&self.laplacian, &known, form, progress)?;
        Ok(Assembled { known, form, missing })
    }

    /// Factors the blocks that were missing; they are kept until a problem has no use for them.
    ///
    /// A block that collapsed triangles make singular is assembled again with floors under lengths and masses, and in the
    /// end without the second term of the energy.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`], [`Error::Cancelled`]; the blocks that were there before stay usable.
    pub fn factor(&mut self, assembled: Assembled, progress: &Progress) -> Result<()> {
        let Assembled { known, form, missing } = assembled;
        let mut failed = self.blocks.factor(&self.positions, missing, progress)?;
        for (floor, length) in FLOORS.map(|floor| (floor, form.length)).into_iter().chain([(LAST_FLOOR, 0.0)]) {
            if failed.is_empty() {
                break;
            }
            let mesh = TriMesh::of_checked(&self.positions, &self.triangles);
            let topology = Topology::with_edges(&self.triangles, &self.edges, self.positions.len());
            let laplacian = Laplacian::with_floor(&mesh, &topology, floor);
            let number = number_unknowns(&failed, self.positions.len());
            let used = Form { length, ..form };
            let system = |unknowns| System::new(&laplacian, &known, unknowns, &number, used).standing_for(form);
            let systems = failed.into_iter().map(system).collect();
            failed = self.blocks.factor(&self.positions, systems, progress)?;
        }
        if let Some(unknowns) = failed.first() {
            return Err(Error::NotPositiveDefinite { vertex: unknowns[0] as usize });
        }
        self.known = known;
        Ok(())
    }

    /// Which vertices of the mesh that is solved on are unknowns of the problem posed last.
    pub fn unknown(&self) -> &[bool] {
        &self.known.unknown
    }

    /// Solves the problem posed last for `given` rows; another set of rows costs a solve and nothing else.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if a solution is not accurate, [`Error::Cancelled`].
    pub fn solve<'a>(&'a self, given: GivenRows<'a>, progress: &Progress) -> Result<Filled<'a>> {
        let known = KnownRows { known: &self.known, weld: self.weld.as_ref(), given };
        let rows = self.blocks.solve(known, progress)?;
        Ok(Filled::new(known, self.blocks.as_slice(), rows))
    }

    /// The `given` rows as the mesh that is solved on sees them, for [`Self::solve_screened`].
    pub fn row_table(&self, given: GivenRows<'_>) -> RowTable {
        let known = KnownRows { known: &self.known, weld: self.weld.as_ref(), given };
        RowTable::new(self.known.constraints.len(), |i, row| {
            if self.known.constraints[i].is_known() {
                known.append(i as u32, row);
            }
        })
    }

    /// Solves the problem posed last by [`Self::assemble_screened`], with confidences from [`screened::confidence`], such that every
    /// soft row is trusted over its length. `screen` has the [table](Self::row_table) of the `given` rows, and what else there is.
    ///
    /// # Errors
    /// Those of [`Fill::solve`].
    pub fn solve_screened<'a>(
        &'a self,
        given: GivenRows<'a>,
        screen: Screen<'_>,
        progress: &Progress,
    ) -> Result<Filled<'a>> {
        let number = number_block_unknowns(self.blocks.as_slice(), self.known.unknown.len());
        let all = screened::Given { laplacian: &self.laplacian, screen, number: &number };
        let found = self.blocks.solve_screened(all, progress)?;
        let known = KnownRows { known: &self.known, weld: self.weld.as_ref(), given };
        Ok(Filled::new(known, self.blocks.as_slice(), found))
    }
}

/// Place of every unknown in its block, [`NONE`] for the other vertices, (V).
fn number_block_unknowns(blocks: &[block::Block], vertex_count: usize) -> Vec<u32> {
    let mut number = vec![NONE; vertex_count];
    for block in blocks {
        std::iter::zip(0.., block.unknowns()).for_each(|(k, &i)| number[i as usize] = k);
    }
    number
}
