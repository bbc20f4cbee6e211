//! A skeleton into a mesh that has none.

mod hierarchy;
mod joints;
mod medial;
mod posed;
mod report;
mod template;

use glam::{DVec3, Vec3};

use crate::bones::parents_first;
use crate::error::{Error, Result};
use crate::mesh::TriMesh;
use crate::progress::Progress;

pub use report::Report;
pub use template::{Donor, embed_from_character};

/// How a skeleton is embedded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// From the shape of the mesh alone: any mesh, any armature, no other character needed.
    Medial,
    /// From another character's mesh, weights and armature: the more alike the bodies, the better. See
    /// [`embed_from_character`].
    Template,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 2] = [Self::Medial, Self::Template];
}

/// The bones of a template at rest, up and front as in the mesh; place and size do not matter.
#[derive(Debug, Clone, Copy)]
pub struct Template<'a> {
    /// Head of each bone, (B).
    pub heads: &'a [[f32; 3]],
    /// Tail of each bone, (B).
    pub tails: &'a [[f32; 3]],
    /// Parent of each bone, negative for a root, (B).
    pub parents: &'a [i32],
}

impl Template<'_> {
    pub(crate) fn len(&self) -> usize {
        self.heads.len()
    }

    pub(crate) fn head(&self, j: usize) -> DVec3 {
        Vec3::from(self.heads[j]).as_dvec3()
    }

    pub(crate) fn tail(&self, j: usize) -> DVec3 {
        Vec3::from(self.tails[j]).as_dvec3()
    }

    pub(crate) fn parent(&self, j: usize) -> Option<usize> {
        usize::try_from(self.parents[j]).ok()
    }

    /// # Errors
    /// [`Error::InvalidSkeleton`].
    fn check(&self) -> Result<()> {
        let invalid = |reason: String| Err(Error::InvalidSkeleton { reason });
        if self.len() < 2 {
            return invalid("it has fewer than two bones".into());
        }
        if self.tails.len() != self.len() || self.parents.len() != self.len() {
            let (heads, tails, parents) = (self.len(), self.tails.len(), self.parents.len());
            return invalid(format!("{heads} heads have {tails} tails and {parents} parents"));
        }
        let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite());
        if let Some(j) = (0..self.len()).find(|&j| !finite(&self.heads[j]) || !finite(&self.tails[j])) {
            return invalid(format!("bone {j} has a head or tail that is not finite"));
        }
        match parents_first(self.parents) {
            Err(j) => invalid(format!("the parents of bone {j} lead in a circle or to a bone that is not there")),
            Ok(_) => Ok(()),
        }
    }
}

/// An embedded skeleton.
#[derive(Debug, Clone, PartialEq)]
pub struct Embedding {
    /// Head of each bone, (B), in the mesh's space.
    pub heads: Vec<[f32; 3]>,
    /// Tail of each bone, (B).
    pub tails: Vec<[f32; 3]>,
    /// How far to trust each bone's head, 0 to 1, (B).
    pub confidence: Vec<f32>,
    /// Counts and times.
    pub report: Report,
}

/// Embeds `template` into `mesh`.
///
/// # Errors
/// [`Error::InvalidSkeleton`], [`Error::Cancelled`].
///
/// # Example
/// ```
/// use skinwright_core::embed::{Method, Template, embed_skeleton};
/// use skinwright_core::{Progress, TriMesh};
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/read/mod.rs"));
/// # fn main() -> Result<(), Box<dyn AnyError>> {
/// # let (positions, triangles) = mesh(data("arm.obj"))?;
/// let arm = TriMesh::new(&positions, &triangles, "arm")?;
/// let bones = Template {
///     heads: &[[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]],
///     tails: &[[0.5, 0.0, 0.0], [1.0, 0.0, 0.0]],
///     parents: &[-1, 0],
/// };
/// let embedding = embed_skeleton(&arm, &bones, Method::Medial, &Progress::default())?;
/// assert_eq!(embedding.heads.len(), 2);
/// # Ok(())
/// # }
/// ```
pub fn embed_skeleton(
    mesh: &TriMesh<'_>,
    template: &Template<'_>,
    method: Method,
    progress: &Progress,
) -> Result<Embedding> {
    template.check()?;
    match method {
        Method::Medial => medial::embed(mesh, template, progress),
        Method::Template => Err(Error::InvalidSkeleton {
            reason: "method template needs mesh and weights of the character that the bones were made for".into(),
        }),
    }
}
