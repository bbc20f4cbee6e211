//! The openings of a surface, each closed by a fan around the middle of its rim: a sleeve, a trouser leg or a body without
//! hands encloses a volume, which then depends on no origin.

use glam::DVec3;

use crate::adjacency::DisjointSets;

/// Sides of triangles without a triangle on the other side, from vertex to vertex as their triangle has them.
pub(super) type Rim = Vec<[u32; 2]>;

/// The rims of `triangles` over `count` vertices. Rims that touch are one. Every sum of triangles has a closed boundary, so
/// fans close whatever is not manifold or not wound consistently too.
pub(super) fn rims(triangles: &[[u32; 3]], count: usize) -> Vec<Rim> {
    let sides = bare_sides(triangles);
    let mut sets = DisjointSets::new(count);
    sides.iter().for_each(|&[i, j]| sets.union(i, j));
    let mut is_on_rim = vec![false; count];
    sides.iter().flatten().for_each(|&i| is_on_rim[i as usize] = true);
    let (rim_of, rim_count) = sets.number(|i| is_on_rim[i as usize]);
    let mut rims = vec![Rim::new(); rim_count];
    sides.into_iter().for_each(|side| rims[rim_of[side[0] as usize] as usize].push(side));
    rims
}

/// Sides that fewer triangles pass the other way, as often as that is so.
fn bare_sides(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut sides: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    sides.sort_unstable();
    let back = |&[i, j]: &[u32; 2]| {
        let from = sides.partition_point(|side| *side < [j, i]);
        sides[from..].iter().take_while(|side| **side == [j, i]).count()
    };
    let bare = |same: &[[u32; 2]]| vec![same[0]; same.len().saturating_sub(back(&same[0]))];
    sides.chunk_by(|a, b| a == b).flat_map(bare).collect()
}

/// The triangles that close a rim.
pub(super) fn fan(rim: &Rim, at: impl Fn(u32) -> DVec3) -> impl Iterator<Item = [DVec3; 3]> {
    let middle = rim.iter().map(|&[i, _]| at(i)).sum::<DVec3>() / rim.len() as f64;
    rim.iter().map(move |&[i, j]| [at(j), at(i), middle])
}
