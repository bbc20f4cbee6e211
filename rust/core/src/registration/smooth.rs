//! Vectors per vertex that vary no faster than a length: normals without the folds of clothes, displacements without creases.

use glam::{DVec3, Vec3};

use crate::error::Result;
use crate::fill::{Constraint, Fill, Row};
use crate::progress::Progress;

/// A mesh prepared for smoothing vectors on it.
#[derive(Debug)]
pub struct Smoother {
    fill: Fill,
    /// Area per vertex; no less than a thousandth of the median, so that slivers do not come loose.
    mass: Vec<f64>,
}

impl Smoother {
    /// Prepares a mesh of `positions` (U) and `triangles` (T).
    ///
    /// # Errors
    /// Those of [`Fill::new`].
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self> {
        let single = positions.iter().map(|p| p.as_vec3().to_array()).collect();
        let fill = Fill::new(single, triangles.to_vec(), None)?;
        let areas: Vec<f64> = (0..positions.len()).map(|i| fill.laplacian().mass(i)).collect();
        let least = 1e-3 * median(areas.iter().copied().filter(|&m| m > 0.0).collect());
        Ok(Self { mass: areas.iter().map(|m| m.max(least)).collect(), fill })
    }

    /// Fixes how the next vectors are smoothed: over `length` (world units), by the first derivative, all of them alike.
    ///
    /// # Errors
    /// Those of [`Fill::factor`].
    pub fn set_diffusion(&mut self, length: f64, progress: &Progress) -> Result<()> {
        let scale = 1.0 / (length * length);
        let constraints = self.mass.iter().map(|m| Constraint::Soft(scale * m)).collect();
        let assembled = self.fill.assemble(constraints, 0.0, progress)?;
        self.fill.factor(assembled, progress)
    }

    /// The same with a confidence per vertex (U), by the first and second derivative: `sum of m c |d - wanted|^2 + membrane l^2
    /// <d, S d> + l^4 <d, S M^-1 S d>`.
    ///
    /// # Errors
    /// Those of [`Fill::factor`].
    pub fn set_bending(&mut self, confidence: &[f64], length: f64, membrane: f64, progress: &Progress) -> Result<()> {
        let scale = 1.0 / (membrane * length * length);
        let soft = |(m, c): (&f64, &f64)| Constraint::Soft(scale * m * c);
        let constraints = std::iter::zip(&self.mass, confidence).map(soft).collect();
        let assembled = self.fill.assemble(constraints, length / membrane.sqrt(), progress)?;
        self.fill.factor(assembled, progress)
    }

    /// The smooth vectors for these `wanted` ones (U).
    ///
    /// # Errors
    /// Those of [`Fill::solve`].
    pub fn smooth(&self, wanted: &[DVec3], progress: &Progress) -> Result<Vec<DVec3>> {
        let given = |i: u32, row: &mut Row| row.extend((0..).zip(wanted[i as usize].to_array()));
        let filled = self.fill.solve(&given, progress)?;
        let mut row = Row::new();
        let vector = |i: usize| {
            row.clear();
            filled.append_row(i, &mut row);
            row.iter().fold(DVec3::ZERO, |v, &(axis, x)| v + x * DVec3::AXES[axis as usize])
        };
        Ok((0..wanted.len()).map(vector).collect())
    }

    /// Smooth unit vectors.
    ///
    /// # Errors
    /// Those of [`Fill::solve`].
    pub fn smooth_directions(&self, directions: &[Vec3], progress: &Progress) -> Result<Vec<Vec3>> {
        let wanted: Vec<DVec3> = directions.iter().map(|n| n.as_dvec3()).collect();
        Ok(self.smooth(&wanted, progress)?.iter().map(|n| n.normalize_or_zero().as_vec3()).collect())
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 1.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
