//! Desparsification: what must hold for every method on every input, and choices worked out by hand.

use proptest::prelude::*;
use skinwright_core::desparsify::{Method, Skeleton, desparsify};
use skinwright_core::{Error, TriMesh, Weights};

/// A strip of `length` quads along x, one unit each, vertices in two rows of `length + 1`.
fn strip(length: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let row = |y: f32| (0..=length).map(move |x| [x as f32, y, 0.0]);
    let quad = |x: u32| [[x, x + 1, x + length + 2], [x, x + length + 2, x + length + 1]];
    (row(0.0).chain(row(1.0)).collect(), (0..length).flat_map(quad).collect())
}

/// A chain of bones along x, one unit each, half a unit above the strip.
fn chain(count: usize) -> (Vec<i32>, Vec<[[f32; 3]; 2]>) {
    let segment = |j: usize| [[j as f32, 0.5, 0.5], [j as f32 + 1.0, 0.5, 0.5]];
    ((0..count as i32).map(|j| j - 1).collect(), (0..count).map(segment).collect())
}

fn weights(rows: &[Vec<(u32, f32)>], n_bones: u32) -> Weights {
    let ends = rows.iter().scan(0, |end, row| {
        *end += row.len() as u32;
        Some(*end)
    });
    let entries = || rows.iter().flatten();
    let indptr = std::iter::once(0).chain(ends).collect();
    Weights::new(indptr, entries().map(|e| e.0).collect(), entries().map(|e| e.1).collect(), n_bones).unwrap()
}

fn row(weights: &Weights, i: usize) -> Vec<(u32, f32)> {
    let (bones, values) = weights.row(i);
    bones.iter().copied().zip(values.iter().copied()).collect()
}

#[derive(Debug, Clone)]
struct Input {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    parents: Vec<i32>,
    segments: Vec<[[f32; 3]; 2]>,
    locked: Vec<bool>,
    weights: Weights,
}

impl Input {
    /// A strip over a chain of bones; `rows` repeat over its vertices.
    fn strip(length: u32, bones: usize, rows: &[Vec<(u32, f32)>]) -> Self {
        let ((positions, triangles), (parents, segments)) = (strip(length), chain(bones));
        let all: Vec<_> = rows.iter().cycle().take(positions.len()).cloned().collect();
        let weights = weights(&all, bones as u32);
        Self { positions, triangles, parents, segments, locked: vec![false; bones], weights }
    }

    fn run(&self, method: Method, n: usize) -> Weights {
        let mesh = TriMesh::new(&self.positions, &self.triangles, "rest").unwrap();
        let skeleton = Skeleton { parents: &self.parents, segments: &self.segments, locked: &self.locked };
        desparsify(&self.weights, method, n, &skeleton, Some(&mesh)).unwrap()
    }
}

/// Meshes and weights at the edge of what there is.
fn degenerate() -> Vec<(&'static str, Input)> {
    let base = |rows: &[Vec<(u32, f32)>]| Input::strip(6, 9, rows);
    let mut one_point = base(&[vec![(3, 1.0)]]);
    one_point.positions.fill([1.0, 2.0, 3.0]);
    let mut loose = base(&[vec![(3, 1.0)]]);
    loose.triangles.truncate(1);
    let mut doubled = base(&[vec![(2, 0.5), (5, 0.5)]]);
    doubled.triangles.extend(doubled.triangles.clone());
    doubled.triangles.push([0, 0, 1]);
    let mut points = base(&[vec![(0, 1.0)]]);
    points.segments.fill([[0.0; 3]; 2]);
    let mut roots = base(&[vec![(4, 1.0)]]);
    roots.parents.fill(-1);
    vec![
        ("all vertices at one point", one_point),
        ("loose vertices", loose),
        ("repeated and collapsed triangles", doubled),
        ("bones without length", points),
        ("only roots", roots),
        ("no weights at all", base(&[vec![]])),
        ("only zero weights", base(&[vec![(1, 0.0), (2, 0.0)]])),
        ("negative weights", base(&[vec![(1, -1.0), (2, 0.5)]])),
        ("a bone named twice", base(&[vec![(4, 0.25), (4, 0.25), (0, 0.5)]])),
        ("more influences than wanted", base(&[(0..9).map(|b| (b, 1.0 / 9.0)).collect()])),
        ("far from normalised", base(&[vec![(0, 1e-9), (1, 1e9)]])),
    ]
}

#[test]
fn every_vertex_gets_exactly_n_members_whatever_the_input() {
    for (name, input) in degenerate() {
        for method in Method::ALL {
            for n in [1, 3, 4, 9, 12] {
                let result = input.run(method, n);
                for i in 0..result.vertex_count() {
                    let (bones, values) = result.row(i);
                    assert_eq!(bones.len(), n.min(9), "{name}, {method:?}, n {n}, vertex {i}");
                    assert!(bones.windows(2).all(|w| w[0] < w[1]), "{name}: sorted, each bone once");
                    let sum: f32 = values.iter().sum();
                    let has_weight = input.weights.row(i).1.iter().any(|&x| x > 0.0);
                    assert!((sum - f32::from(u8::from(has_weight))).abs() < 1e-6, "{name}: sum {sum}");
                }
            }
        }
    }
}

#[test]
fn the_largest_influences_stay_and_ties_go_by_bone_order() {
    let rows = [vec![(7, 0.1), (1, 0.3), (2, 0.2), (5, 0.2), (6, 0.2)]];
    for method in Method::ALL {
        let result = Input::strip(3, 9, &rows).run(method, 3);
        let expected = [(1, 0.3 / 0.7), (2, 0.2 / 0.7), (5, 0.2 / 0.7)];
        for ((bone, value), (expected_bone, expected_value)) in row(&result, 0).into_iter().zip(expected) {
            assert_eq!(bone, expected_bone);
            assert!((value - expected_value).abs() < 1e-6);
        }
    }
}

#[test]
fn doing_it_twice_changes_nothing() {
    for (name, input) in degenerate() {
        for method in Method::ALL {
            let once = input.run(method, 4);
            let again = Input { weights: once.clone(), ..input.clone() }.run(method, 4);
            assert_eq!(once.bones(), again.bones(), "{name}, {method:?}");
        }
    }
}

#[test]
fn hop_takes_the_neighbours_in_the_hierarchy() {
    // Bone 4 of the chain: 3 and 5 are one hop away (tie), 2 and 6 two.
    let input = Input::strip(3, 9, &[vec![(4, 1.0)]]);
    assert_eq!(row(&input.run(Method::Hop, 4), 0), [(2, 0.0), (3, 0.0), (4, 1.0), (5, 0.0)]);
    // Two thirds on 2, one third on 6. Scores: bone 1 and 3 first, then 4 before 5.
    let input = Input::strip(3, 9, &[vec![(2, 2.0 / 3.0), (6, 1.0 / 3.0)]]);
    let bones: Vec<u32> = row(&input.run(Method::Hop, 5), 0).iter().map(|r| r.0).collect();
    assert_eq!(bones, [1, 2, 3, 4, 6]);
}

#[test]
fn hop_never_crosses_to_another_root_while_its_own_has_bones() {
    let mut input = Input::strip(3, 6, &[vec![(5, 1.0)]]);
    input.parents = vec![-1, 5, -1, 0, 0, 2]; // 5 hangs below 2, 1 below 5; 0, 3, 4 are another tree
    assert_eq!(row(&input.run(Method::Hop, 4), 0), [(0, 0.0), (1, 0.0), (2, 0.0), (5, 1.0)]);
}

#[test]
fn surface_takes_the_nearest_regions() {
    // One bone a column: at column 4, the regions of 3 and 5 are one edge away, 2 and 6 two.
    let columns: Vec<_> = (0..9).map(|b| vec![(b, 1.0)]).collect();
    let input = Input::strip(8, 9, &columns);
    assert_eq!(row(&input.run(Method::Surface, 3), 4), [(3, 0.0), (4, 1.0), (5, 0.0)]);
    // 2 and 6 tie along the surface, and bone 6 starts at x = 6 while bone 2 ends at x = 3: 2 is nearer.
    assert_eq!(row(&input.run(Method::Surface, 4), 4), [(2, 0.0), (3, 0.0), (4, 1.0), (5, 0.0)]);
}

#[test]
fn surface_does_not_jump_gaps_but_falls_back_to_the_nearest_bone() {
    let mut input = Input::strip(8, 9, &[vec![(0, 1.0)]]);
    // A second island close by, all on bone 8; bones 1 to 7 have no region anywhere.
    let count = input.positions.len() as u32;
    input.positions.extend([[0.0, 2.0, 0.0], [1.0, 2.0, 0.0], [0.0, 3.0, 0.0]]);
    input.triangles.push([count, count + 1, count + 2]);
    let rows: Vec<_> = (0..input.positions.len() as u32).map(|i| vec![(if i < count { 0 } else { 8 }, 1.0)]).collect();
    input.weights = weights(&rows, 9);
    let result = input.run(Method::Surface, 3);
    assert_eq!(row(&result, 8), [(0, 1.0), (7, 0.0), (8, 0.0)], "x = 8: bone 8 is not reached, but nearest");
    assert_eq!(row(&result, count as usize), [(0, 0.0), (1, 0.0), (8, 1.0)]);
}

#[test]
fn locked_bones_keep_their_weight_and_are_given_to_nobody() {
    for method in Method::ALL {
        let mut input = Input::strip(6, 9, &[vec![(3, 0.5), (4, 0.3), (5, 0.1), (6, 0.1)], vec![(4, 1.0)]]);
        for bone in [2, 5] {
            input.locked[bone] = true;
        }
        let result = input.run(method, 3);
        let mixed = row(&result, 0);
        assert_eq!(mixed.iter().map(|r| r.0).collect::<Vec<_>>(), [3, 4, 5]);
        assert_eq!(mixed[2].1, 0.1, "held to the bit");
        assert!((mixed.iter().map(|r| r.1).sum::<f32>() - 1.0).abs() < 1e-6);
        for i in (1..result.vertex_count()).step_by(2) {
            assert!(row(&result, i).iter().all(|&(bone, _)| bone != 2 && bone != 5), "{method:?}");
        }
        let only_locked = Input { locked: vec![true; 9], ..input.clone() };
        assert_eq!(row(&only_locked.run(method, 3), 0).len(), 4, "four locked influences all stay");
        assert_eq!(row(&only_locked.run(method, 3), 1).len(), 1, "there is no bone to give");
    }
}

#[test]
fn what_cannot_be_used_is_refused_with_the_reason() {
    let input = Input::strip(3, 4, &[vec![(0, 1.0)]]);
    let mesh = TriMesh::new(&input.positions, &input.triangles, "rest").unwrap();
    let good = Skeleton { parents: &input.parents, segments: &input.segments, locked: &[] };
    let refuse = |method, n, skeleton: &Skeleton<'_>, mesh| {
        desparsify(&input.weights, method, n, skeleton, mesh).unwrap_err().to_string()
    };
    assert_eq!(refuse(Method::Hop, 0, &good, None), "n is 0, but every vertex needs at least one bone");
    let short = Skeleton { parents: &[-1], ..good };
    assert_eq!(refuse(Method::Hop, 4, &short, None), "bone_parents has 1 entries where 4 are needed");
    let cyclic = Skeleton { parents: &[1, 2, 0, 0], ..good };
    assert!(refuse(Method::Hop, 4, &cyclic, None).contains("not below its child"));
    let outside = Skeleton { parents: &[-1, 0, 0, 9], ..good };
    assert!(refuse(Method::Hop, 4, &outside, None).contains("must be another bone"));
    assert!(refuse(Method::Surface, 4, &good, None).contains("positions"));
    let (other_positions, other_triangles) = strip(9);
    let other = TriMesh::new(&other_positions, &other_triangles, "rest").unwrap();
    assert!(refuse(Method::Surface, 4, &good, Some(&other)).contains("positions"));
    let infinite = [[[f32::INFINITY; 3]; 2]; 4];
    assert!(refuse(Method::Surface, 4, &Skeleton { segments: &infinite, ..good }, Some(&mesh)).contains("finite"));
    assert!(matches!(
        desparsify(&input.weights, Method::Hop, 4, &Skeleton { locked: &[true], ..good }, None),
        Err(Error::LengthMismatch { what: "locked", .. })
    ));
}

/// Random weights on a strip whose vertices are shaken, so that hardly any two paths tie.
fn random_input() -> impl Strategy<Value = Input> {
    let row = prop::collection::vec((0u32..12, 0.01f32..1.0), 1..6);
    let vertices = 2 * 21;
    let shake = prop::collection::vec(prop::array::uniform3(-0.3f32..0.3), vertices);
    (prop::collection::vec(row, vertices), shake).prop_map(|(rows, shake)| {
        let mut input = Input::strip(20, 12, &rows);
        for (p, s) in input.positions.iter_mut().zip(shake) {
            *p = std::array::from_fn(|c| p[c] + s[c]);
        }
        input
    })
}

proptest! {
    #[test]
    fn the_answer_is_the_same_on_any_number_of_threads(input in random_input()) {
        for method in Method::ALL {
            let on = |threads: usize| {
                rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| input.run(method, 4))
            };
            prop_assert_eq!(on(1), on(3));
        }
    }

    #[test]
    fn the_answer_does_not_depend_on_the_order_of_vertices(input in random_input()) {
        let count = input.positions.len();
        let old = |new: usize| (new * 5 + 3) % count; // 5 and 42 share no factor
        let mut new_of = vec![0; count];
        (0..count).for_each(|new| new_of[old(new)] = new as u32);
        let rows: Vec<_> = (0..count).map(|new| row(&input.weights, old(new))).collect();
        let shuffled = Input {
            positions: (0..count).map(|new| input.positions[old(new)]).collect(),
            triangles: input.triangles.iter().rev().map(|t| t.map(|i| new_of[i as usize])).collect(),
            weights: weights(&rows, 12),
            ..input.clone()
        };
        for method in Method::ALL {
            let (plain, other) = (input.run(method, 4), shuffled.run(method, 4));
            for new in 0..count {
                prop_assert_eq!(row(&other, new), row(&plain, old(new)));
            }
        }
    }
}
