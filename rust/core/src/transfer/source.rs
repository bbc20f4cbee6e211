//! The body that weights come from, prepared once for any number of garments.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::normals;
use crate::error::{Error, Result};
use crate::mesh::TriMesh;
use crate::surface::{SurfaceIndex, SurfacePoint};
use crate::weights::Weights;
use crate::weld::Weld;

/// Vertices no farther apart than this share of the diagonal are one, as far as normals are concerned.
const WELD_TOLERANCE: f64 = 1e-6;

/// A weighted mesh with its bounding volume hierarchy and normals. Owns its data; a clone shares it.
#[derive(Debug, Clone)]
pub struct Source {
    geometry: Arc<Geometry>,
    weights: Arc<SourceWeights>,
}

#[derive(Debug)]
struct Geometry {
    positions: Vec<[f32; 3]>,
    size: f64,
    areas: Vec<f32>,
    triangles: Vec<[u32; 3]>,
    index: SurfaceIndex,
    normals: Vec<Vec3>,
    diagonal: f64,
}

/// The source's weights and what is wrong with them.
#[derive(Debug)]
struct SourceWeights {
    weights: Weights,
    inverse_sums: Vec<f64>,
}

impl Source {
    /// Prepares a mesh (V positions in world units, T triangles) and its weights (V rows).
    ///
    /// # Errors
    /// Those of [`TriMesh::new`], [`Error::LengthMismatch`], [`Error::WeightNegative`].
    pub fn new(positions: &[[f32; 3]], triangles: Vec<[u32; 3]>, weights: Weights) -> Result<Self> {
        let mesh = TriMesh::new(positions, &triangles, "source")?;
        let weights = SourceWeights::new(weights, mesh.vertex_count())?;
        let diagonal = mesh.diagonal();
        let normals = || {
            let weld = Weld::coincident(positions, WELD_TOLERANCE * diagonal);
            normals::of_source(&mesh, weld.as_ref())
        };
        let (index, normals) = rayon::join(|| SurfaceIndex::new(&mesh), normals);
        let (areas, size) = (areas(&mesh), size(&mesh));
        let positions = positions.to_vec();
        let geometry = Geometry { index, normals, diagonal, size, areas, triangles, positions };
        Ok(Self { geometry: Arc::new(geometry), weights: Arc::new(weights) })
    }

    /// The same prepared geometry with other weights (V rows).
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::WeightNegative`].
    pub fn with_weights(&self, weights: Weights) -> Result<Self> {
        let weights = SourceWeights::new(weights, self.geometry.normals.len())?;
        Ok(Self { geometry: Arc::clone(&self.geometry), weights: Arc::new(weights) })
    }

    /// Triangles, (T, 3).
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.geometry.triangles
    }

    /// Area-weighted vertex normals, (V, 3); vertices that only the file keeps apart have one, unless they lie on opposite
    /// sides of a sheet.
    pub fn normals(&self) -> &[Vec3] {
        &self.geometry.normals
    }

    /// The closest-point index over the triangles.
    pub fn index(&self) -> &SurfaceIndex {
        &self.geometry.index
    }

    /// Diagonal of the bounding box, world units.
    pub fn diagonal(&self) -> f64 {
        self.geometry.diagonal
    }

    /// The surface's extent, world units: 4.2 times the area-weighted root mean square of the distance from its centroid.
    /// Within 8 % of the bounding box's diagonal for a person, but no rotation changes it.
    pub fn size(&self) -> f64 {
        self.geometry.size
    }

    /// World position of a point of the surface.
    pub(super) fn position(&self, point: &SurfacePoint) -> DVec3 {
        let corners = self.geometry.triangles[point.triangle as usize];
        let corner = |i: u32| Vec3::from(self.geometry.positions[i as usize]).as_dvec3();
        std::iter::zip(corners, point.barycentric).map(|(i, share)| corner(i) * share).sum()
    }

    /// Area of triangle `t`.
    pub(super) fn area(&self, t: u32) -> f64 {
        self.geometry.areas[t as usize].into()
    }

    /// Number of bones.
    pub fn n_bones(&self) -> u32 {
        self.weights.weights.n_bones()
    }

    /// Vertices whose weights sum to zero, and those whose sum is neither zero nor one (to 1e-3).
    pub fn unweighted_and_unnormalised(&self) -> (usize, usize) {
        let unweighted = self.weights.inverse_sums.iter().filter(|&&x| x == 0.0).count();
        let off = |x: &&f64| (**x - 1.0).abs() > 1e-3;
        let unnormalised = self.weights.inverse_sums.iter().filter(|&&x| x != 0.0).filter(off).count();
        (unweighted, unnormalised)
    }

    /// Weights at a surface point: the barycentric blend of the three normalised rows, itself normalised, appended to
    /// `row` in bone order. Nothing is appended where all three rows are empty.
    pub fn blend(&self, point: &SurfacePoint, row: &mut Vec<(u32, f64)>) {
        let start = row.len();
        for (i, share) in std::iter::zip(self.geometry.triangles[point.triangle as usize], point.barycentric) {
            let (bones, values) = self.weights.weights.row(i as usize);
            let scale = share * self.weights.inverse_sums[i as usize];
            if scale > 0.0 {
                row.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, f64::from(value) * scale)));
            }
        }
        merge_and_normalise(row, start);
    }

    /// Whether a position lies behind the triangle of a surface point.
    pub(super) fn is_behind(&self, point: &SurfacePoint, position: [f32; 3]) -> bool {
        let corners = self.geometry.triangles[point.triangle as usize];
        let [a, b, c] = corners.map(|i| Vec3::from(self.geometry.positions[i as usize]).as_dvec3());
        (Vec3::from(position).as_dvec3() - a).dot((b - a).cross(c - a)) < 0.0
    }

    /// Whether [`Source::blend`] appends anything at a point.
    pub(super) fn is_weighted(&self, point: &SurfacePoint) -> bool {
        let corners = self.geometry.triangles[point.triangle as usize];
        let inverse_sums = &self.weights.inverse_sums;
        std::iter::zip(corners, point.barycentric).any(|(i, share)| share * inverse_sums[i as usize] > 0.0)
    }
}

fn areas(mesh: &TriMesh<'_>) -> Vec<f32> {
    mesh.triangles().iter().map(|t| 0.5 * mesh.doubled_area(t).length() as f32).collect()
}

/// See [`Source::size`]; the moments of triangles are exact.
fn size(mesh: &TriMesh<'_>) -> f64 {
    let corners = || mesh.triangles().iter().map(|t| t.map(|i| mesh.position(i)));
    let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length() / 2.0;
    let total: f64 = corners().map(area).sum();
    if total == 0.0 {
        return mesh.diagonal();
    }
    let centroid = corners().map(|t| area(t) * (t[0] + t[1] + t[2]) / 3.0).sum::<DVec3>() / total;
    let moment = |t: [DVec3; 3]| {
        let [a, b, c] = t.map(|p| p - centroid);
        area(t) * (a.length_squared() + b.length_squared() + c.length_squared() + (a + b + c).length_squared()) / 12.0
    };
    4.2 * (corners().map(moment).sum::<f64>() / total).sqrt()
}

impl SourceWeights {
    fn new(weights: Weights, vertex_count: usize) -> Result<Self> {
        if weights.vertex_count() != vertex_count {
            let found = weights.vertex_count();
            return Err(Error::LengthMismatch { what: "source weights", found, expected: vertex_count });
        }
        weights.check_not_negative()?;
        let inverse_sum = |i| {
            let sum: f64 = weights.row(i).1.iter().map(|&x| f64::from(x)).sum();
            if sum > 0.0 { 1.0 / sum } else { 0.0 }
        };
        let inverse_sums = (0..vertex_count).map(inverse_sum).collect();
        Ok(Self { weights, inverse_sums })
    }
}

/// Sorts `row[start..]` by bone, merges equal bones, drops zeros and divides by the sum.
pub(super) fn merge_and_normalise(row: &mut Vec<(u32, f64)>, start: usize) {
    row[start..].sort_by_key(|&(bone, _)| bone);
    let mut end = start;
    let mut sum = 0.0;
    for at in start..row.len() {
        let (bone, value) = row[at];
        sum += value;
        if end > start && row[end - 1].0 == bone {
            row[end - 1].1 += value;
        } else if value > 0.0 {
            row[end] = (bone, value);
            end += 1;
        }
    }
    row.truncate(end);
    for (_, value) in &mut row[start..] {
        *value /= sum;
    }
}
