//! Gives every vertex the same number of candidate bones, the new ones at weight zero, so that a later solve has
//! room to move (Rubino 2020, section 6.3; cited in [`crate::sculpt`]). The thesis's own selection keeps the first
//! bones by index where it should keep the largest.

mod hop;
mod surface;

use glam::{DVec3, Vec3};

use crate::bones::parents_first;
use crate::error::{Error, Result};
use crate::mesh::TriMesh;
use crate::weights::Weights;

/// How the new bones of a vertex are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Nearest in the bone hierarchy: when the mesh is a soup of loose parts, or there is no mesh at hand.
    Hop,
    /// Nearest along the surface, then nearest bone: everywhere else.
    Surface,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 2] = [Self::Hop, Self::Surface];
}

/// What is known of the bones, one entry a bone.
#[derive(Debug, Clone, Copy)]
pub struct Skeleton<'a> {
    /// Parent of each bone, negative for a root.
    pub parents: &'a [i32],
    /// Head and tail of each bone in rest pose, in the mesh' space. Read by [`Method::Surface`].
    pub segments: &'a [[[f32; 3]; 2]],
    /// Bones whose weights stay as they are and which are given to no vertex; empty for none.
    pub locked: &'a [bool],
}

/// Every vertex of `weights` with exactly `n` members: the locked ones, the largest of the others, and new ones at
/// weight zero in the order of `method`, ties by bone order.
///
/// Rows come back sorted by bone. What is kept is scaled so that a row sums to 1; locked weights are not scaled.
/// A row has fewer members only when there are fewer bones to give, and more only when more than `n` of its bones are
/// locked. An unweighted vertex keeps all weights at zero. `mesh` is read by [`Method::Surface`].
///
/// # Errors
/// [`Error::InvalidParameter`], [`Error::LengthMismatch`] if the inputs do not fit together.
///
/// # Example
/// ```
/// use skinwright_core::Weights;
/// use skinwright_core::desparsify::{Method, Skeleton, desparsify};
///
/// // One vertex that follows the second of three bones in a chain.
/// let weights = Weights::new(vec![0, 1], vec![1], vec![1.0], 3)?;
/// let chain = Skeleton { parents: &[-1, 0, 1], segments: &[], locked: &[] };
/// let more = desparsify(&weights, Method::Hop, 3, &chain, None)?;
/// assert_eq!(more.row(0), (&[0, 1, 2][..], &[0.0, 1.0, 0.0][..]));
/// # Ok::<(), skinwright_core::Error>(())
/// ```
pub fn desparsify(
    weights: &Weights,
    method: Method,
    n: usize,
    skeleton: &Skeleton<'_>,
    mesh: Option<&TriMesh<'_>>,
) -> Result<Weights> {
    let order = check(weights, n, skeleton)?;
    let mut locked = skeleton.locked.to_vec();
    locked.resize(weights.n_bones() as usize, false);
    let keep =
        |row: &mut Vec<(u32, f64)>, i: usize, out: &mut Vec<(u32, f32)>| keep(weights.row(i), n, &locked, row, out);
    let kept = Weights::from_rows(weights.vertex_count(), weights.n_bones(), Vec::new, keep);
    match method {
        Method::Hop => Ok(hop::fill(&kept, n, skeleton.parents, &order, &locked)),
        Method::Surface => {
            Ok(surface::fill(&kept, n, surface_of(weights, mesh)?, &segments(weights, skeleton)?, &locked))
        }
    }
}

/// The influences a vertex keeps, sorted by bone: everything locked, then the largest, ties by bone order. The free ones
/// are scaled to fill what the locked ones leave of 1.
fn keep(
    (bones, values): (&[u32], &[f32]),
    n: usize,
    locked: &[bool],
    row: &mut Vec<(u32, f64)>,
    out: &mut Vec<(u32, f32)>,
) {
    let is_locked = |bone: u32| locked[bone as usize];
    row.clear();
    row.extend(bones.iter().copied().zip(values.iter().map(|&x| f64::from(x))));
    row.sort_by_key(|&(bone, _)| bone);
    row.dedup_by(|(bone, value), (first, sum)| bone == first && (*sum += *value, true).1);
    row.retain(|&(bone, value)| value > 0.0 || is_locked(bone));
    row.sort_by(|a, b| is_locked(b.0).cmp(&is_locked(a.0)).then(b.1.total_cmp(&a.1)));
    let held = row.iter().filter(|&&(bone, _)| is_locked(bone)).count();
    row.truncate(n.max(held));
    let sum = |row: &[(u32, f64)]| row.iter().map(|r| r.1).sum::<f64>();
    let scale = (1.0 - sum(&row[..held])).max(0.0) / sum(&row[held..]);
    row[held..].iter_mut().for_each(|r| r.1 *= scale);
    row.sort_by_key(|&(bone, _)| bone);
    out.extend(row.iter().map(|&(bone, value)| (bone, value as f32)));
}

/// The bones with parents first.
fn check(weights: &Weights, n: usize, skeleton: &Skeleton<'_>) -> Result<Vec<usize>> {
    let bones = weights.n_bones() as usize;
    if n == 0 {
        return Err(Error::InvalidParameter { name: "n", value: 0.0, must: "every vertex needs at least one bone" });
    }
    check_length("bone_parents", skeleton.parents.len(), bones)?;
    if !skeleton.locked.is_empty() {
        check_length("locked", skeleton.locked.len(), bones)?;
    }
    parents_first(skeleton.parents).map_err(|bone| {
        let (value, must) =
            (skeleton.parents[bone].into(), "a parent must be another bone and not below its child, or -1");
        Error::InvalidParameter { name: "bone_parents", value, must }
    })
}

fn surface_of<'a, 'm>(weights: &Weights, mesh: Option<&'a TriMesh<'m>>) -> Result<&'a TriMesh<'m>> {
    let mesh = mesh.ok_or(Error::LengthMismatch { what: "positions", found: 0, expected: weights.vertex_count() })?;
    check_length("positions", mesh.vertex_count(), weights.vertex_count())?;
    Ok(mesh)
}

fn segments(weights: &Weights, skeleton: &Skeleton<'_>) -> Result<Vec<[DVec3; 2]>> {
    check_length("bone_segments", skeleton.segments.len(), weights.n_bones() as usize)?;
    if let Some(&x) = skeleton.segments.as_flattened().as_flattened().iter().find(|x| !x.is_finite()) {
        let must = "every bone's head and tail must be finite";
        return Err(Error::InvalidParameter { name: "bone_segments", value: x.into(), must });
    }
    Ok(skeleton.segments.iter().map(|s| s.map(|p| Vec3::from(p).as_dvec3())).collect())
}

fn check_length(what: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected { Ok(()) } else { Err(Error::LengthMismatch { what, found, expected }) }
}
