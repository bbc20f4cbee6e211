//! Small loose parts that hang off the body and are nearly rigid become rigid: buttons, buckles, pouches, plates.
//!
//! Of 168 small islands that artists weighted by hand, 160 have one row to within 0.02. Large or soft ones are left alone, and
//! so is what lies on the skin, like a glove's finger or a patch.

use glam::Vec3;

use crate::adjacency::NONE;
use crate::fill::Fill;
use crate::weights::Weights;

/// Largest bounding-box diagonal, as a share of the source's size.
const LARGEST: f64 = 0.13;
/// Smallest median gap to the source, as a share of the island's own diagonal.
const LOOSE: f64 = 0.04;
/// Largest mean distance, half L1, of its rows from their mean.
const MOST_BENT: f64 = 0.2;

/// What becomes of small islands that were solved for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SmallIslands {
    /// Rigid with [`MatchMethod::Confidence`](super::MatchMethod::Confidence), as solved with the paper's method.
    #[default]
    Auto,
    /// Each takes the mean of its rows if it is small, loose and nearly rigid already.
    Rigid,
    /// As solved.
    Solved,
}

impl SmallIslands {
    /// All choices, for tests and menus.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Rigid, Self::Solved];
}

/// Gives each small, loose, nearly rigid island of the mesh one row, the mean of its rows by area. `gaps` are the vertices'
/// distances from the source (V), `size` is the source's. Returns how many islands were made rigid as well.
pub(super) fn stiffen(weights: Weights, fill: &Fill, gaps: &[f64], size: f64) -> (Weights, usize) {
    let islands = fill.islands();
    let mut members = vec![Vec::new(); islands.count()];
    for (i, &island) in islands.of_vertex().iter().enumerate().filter(|&(_, &island)| island != NONE) {
        members[island as usize].push(i);
    }
    let rigid =
        |vertices: &Vec<usize>| is_small_and_loose(fill, gaps, size, vertices).then(|| mean(&weights, fill, vertices));
    let rows: Vec<Option<Vec<(u32, f64)>>> = members.iter().map(|vertices| rigid(vertices).flatten()).collect();
    let count = rows.iter().flatten().count();
    if count == 0 {
        return (weights, 0);
    }
    let stiff = Weights::from_rows(
        weights.vertex_count(),
        weights.n_bones(),
        || (),
        |(), i, out| {
            let island = islands.of_vertex()[i];
            match rows.get(island as usize).and_then(Option::as_ref) {
                Some(row) => out.extend(row.iter().map(|&(bone, value)| (bone, value as f32))),
                None => {
                    out.extend(std::iter::zip(weights.row(i).0, weights.row(i).1).map(|(&bone, &value)| (bone, value)))
                }
            }
        },
    );
    (stiff, count)
}

fn is_small_and_loose(fill: &Fill, gaps: &[f64], size: f64, vertices: &[usize]) -> bool {
    let positions = || vertices.iter().map(|&i| Vec3::from(fill.mesh().positions()[i]));
    let (low, high) = (positions().reduce(Vec3::min), positions().reduce(Vec3::max));
    let diagonal = low.zip(high).map_or(0.0, |(low, high)| f64::from(high.distance(low)));
    if vertices.len() < 3 || diagonal > LARGEST * size {
        return false;
    }
    let mut gaps: Vec<f64> = vertices.iter().map(|&i| gaps[i]).collect();
    let middle = gaps.len() / 2;
    *gaps.select_nth_unstable_by(middle, f64::total_cmp).1 >= LOOSE * diagonal
}

/// The mean of the vertices' rows by area, unless they differ from it too much or are not all there.
fn mean(weights: &Weights, fill: &Fill, vertices: &[usize]) -> Option<Vec<(u32, f64)>> {
    let mass = |i: usize| fill.laplacian().mass(i);
    let total: f64 = vertices.iter().map(|&i| mass(i)).sum();
    let mut sum = vec![0.0; weights.n_bones() as usize];
    for &i in vertices {
        let (bones, values) = weights.row(i);
        if bones.is_empty() {
            return None;
        }
        std::iter::zip(bones, values).for_each(|(&b, &value)| sum[b as usize] += mass(i) / total * f64::from(value));
    }
    let of_all: f64 = sum.iter().sum();
    let bent: f64 = vertices.iter().map(|&i| mass(i) / total * half_l1(weights.row(i), &sum, of_all)).sum();
    let row = std::iter::zip(0.., sum).filter(|&(_, value)| value > 0.0).map(|(bone, value)| (bone, value / of_all));
    (total > 0.0 && bent < MOST_BENT).then(|| row.collect())
}

/// Half the L1 distance of a row from a dense one whose sum is `of_all`.
fn half_l1((bones, values): (&[u32], &[f32]), dense: &[f64], of_all: f64) -> f64 {
    let entries = std::iter::zip(bones, values).map(|(&bone, &value)| (dense[bone as usize], f64::from(value)));
    0.5 * (of_all + entries.map(|(mean, value)| (value - mean).abs() - mean).sum::<f64>())
}
