//! Filling against dense systems that are assembled and eliminated here.

use crate::common::{Fixture, noise};
use crate::dense::{energy, minimiser, stiffness_and_masses};
use crate::sheet::{COLUMNS, assert_rows, confidence, given_row, mixed, push_given, row_of, sheet};
use skinwright_core::fill::{Constraint, Fill, Row};
use skinwright_core::{Error, Progress, Weld};

fn assemble_and_factor(fill: &mut Fill, constraints: &[Constraint], length: f64) {
    let assembled = fill.assemble(constraints.to_vec(), length, &Progress::default()).unwrap();
    fill.factor(assembled, &Progress::default()).unwrap();
}

#[test]
fn free_and_soft_rows_minimise_the_energy() {
    let mesh = sheet();
    let constraints: Vec<_> = (0..30).map(mixed).collect();
    let (stiffness, masses) = stiffness_and_masses(&mesh);
    let fixed: Vec<_> = (0..30).filter(|&i| mixed(i) == Constraint::Fixed).map(|i| (i, given_row(i))).collect();
    let given: Vec<_> = (0..30).map(|i| (i, confidence(mixed(i)), given_row(i))).collect();
    let mut fill = Fill::new(mesh.positions, mesh.triangles, None).unwrap();
    for length in [0.0, 0.8] {
        assemble_and_factor(&mut fill, &constraints, length);
        let given_row = |i: u32, row: &mut Row| {
            assert_ne!(mixed(i as usize), Constraint::Free, "nobody has given row {i}");
            push_given(i, row);
        };
        let filled = fill.solve(&given_row, &Progress::default()).unwrap();
        let expected = minimiser(&energy(&stiffness, &masses, length), &given, &fixed);
        assert_rows(&filled, |i| expected[i].clone(), 30, 1e-7);
        assert!((0..30).all(|i| filled.is_solved(i) == (mixed(i) != Constraint::Fixed)));
        let least = (0..30).filter(|&i| filled.is_solved(i)).flat_map(|i| expected[i].clone());
        assert!((filled.minimum() - least.fold(f64::INFINITY, f64::min)).abs() < 1e-7);
        assert!(filled.largest_residual() > 0.0 && filled.largest_residual() < 1e-12);
    }
}

#[test]
fn one_row_everywhere_is_handed_on_to_the_bit() {
    let mesh = sheet();
    let mut fill = Fill::new(mesh.positions, mesh.triangles, None).unwrap();
    assemble_and_factor(&mut fill, &(0..30).map(mixed).collect::<Vec<_>>(), 0.8);
    let given = |_: u32, row: &mut Row| row.push((1, 0.3));
    let filled = fill.solve(&given, &Progress::default()).unwrap();
    assert!((0..30).all(|i| row_of(&filled, i) == [0.0, 0.3, 0.0]));
    assert_eq!((filled.minimum(), filled.largest_residual()), (0.3, 0.0));
}

#[test]
fn other_confidences_are_factored_again_and_other_rows_are_not() {
    let mesh = sheet();
    let mut fill = Fill::new(mesh.positions, mesh.triangles, None).unwrap();
    let constraints: Vec<_> = (0..30).map(mixed).collect();
    assemble_and_factor(&mut fill, &constraints, 0.8);
    let progress = Progress::default();
    assert_eq!(fill.assemble(constraints.clone(), 0.8, &progress).unwrap().missing_blocks(), 0);
    let mut other = constraints;
    other[5] = Constraint::Soft(9.0);
    assert_eq!(fill.assemble(other, 0.8, &progress).unwrap().missing_blocks(), 1);
}

/// The sheet with copies of some vertices, and for each vertex the one that it is.
fn with_copies() -> (Fixture, Vec<u32>) {
    let (mut mesh, copied) = (sheet(), [6, 7, 8, 17, 25, 25]);
    for (k, i) in copied.into_iter().enumerate() {
        mesh.positions.push(mesh.positions[i as usize]);
        let copy = 30 + k as u32;
        // Every second triangle around it is at the copy.
        let around = mesh.triangles.iter_mut().filter(|t| t.contains(&i)).step_by(2);
        around.for_each(|t| *t = t.map(|j| if j == i { copy } else { j }));
    }
    (mesh, (0..30).chain(copied).collect())
}

#[test]
fn vertices_that_are_one_get_one_row_that_minimises_the_sum_of_their_pulls() {
    let (mesh, one) = with_copies();
    // 6 and its copy are soft, 7's copy is fixed while 7 is soft, 8 is free and its copy soft, 25 is three soft ones.
    let constraint = |i: usize| match i {
        6 | 8 | 25 | 30 | 32 | 34 | 35 => Constraint::Soft(0.1 + noise(i as u64, 3)),
        8.. if i == 31 => Constraint::Fixed,
        _ if i == 7 => Constraint::Soft(1.0),
        _ if i < 30 => mixed(i),
        _ => Constraint::Free,
    };
    let constraint = |i: usize| if i == 8 { Constraint::Free } else { constraint(i) };
    let count = mesh.positions.len();
    let (stiffness, masses) = stiffness_and_masses(&sheet());
    let given: Vec<_> = (0..count).map(|i| (one[i] as usize, confidence(constraint(i)), given_row(i))).collect();
    let is_fixed = |&i: &usize| constraint(i) == Constraint::Fixed;
    let fixed: Vec<_> = (0..count).filter(is_fixed).map(|i| (one[i] as usize, given_row(i))).collect();
    let expected = minimiser(&energy(&stiffness, &masses, 0.5), &given, &fixed);

    let mut fill = Fill::new(mesh.positions, mesh.triangles, Some(Weld::new(&one))).unwrap();
    let constraints: Vec<_> = (0..count).map(constraint).collect();
    assemble_and_factor(&mut fill, &constraints, 0.5);
    let filled = fill.solve(&push_given, &Progress::default()).unwrap();
    assert_rows(&filled, |i| expected[one[i] as usize].clone(), count, 1e-7);
    assert!(!filled.is_solved(31) && !filled.is_solved(7), "one of them is fixed");
    assert!((0..count).all(|i| filled.is_solved(i) == filled.is_solved(one[i] as usize)));
}

#[test]
fn vertices_that_are_one_and_hang_on_nothing_get_the_mean_of_their_rows() {
    let mut mesh = sheet();
    mesh.positions.extend([[9.0; 3]; 4]);
    let mut one: Vec<u32> = (0..34).collect();
    (one[31], one[32]) = (30, 30);
    let mut fill = Fill::new(mesh.positions, mesh.triangles, Some(Weld::new(&one))).unwrap();
    let confidences = [0.3, 1.2, 2.5];
    let mut constraints = vec![Constraint::Fixed; 34];
    std::iter::zip(&mut constraints[30..], confidences).for_each(|(c, b)| *c = Constraint::Soft(b));
    constraints[33] = Constraint::Soft(0.0);
    assemble_and_factor(&mut fill, &constraints, 0.5);
    let filled = fill.solve(&push_given, &Progress::default()).unwrap();
    for column in 0..COLUMNS {
        let mean = (0..3).map(|k| confidences[k] / 4.0 * given_row(30 + k)[column]).sum::<f64>();
        assert!((30..33).all(|i| (row_of(&filled, i)[column] - mean).abs() < 1e-12));
    }
    assert_eq!(row_of(&filled, 33), [0.0; 3], "no confidence is no row");
}

#[test]
fn a_wire_is_linear_between_known_ends() {
    // Two quads with a wire of four vertices from one corner, and a vertex that hangs on nothing.
    let mut positions: Vec<[f32; 3]> = (0..6).map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
    let along = [0.5, 0.75, 2.0, 3.0];
    positions.extend(along.map(|x| [2.0 + x, 0.0, 0.0]));
    positions.push([9.0; 3]);
    let triangles = vec![[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]];
    let edges = vec![[4, 6], [6, 7], [7, 8], [8, 9], [0, 2]];
    let mut fill = Fill::with_edges(positions.clone(), triangles.clone(), edges.clone(), None).unwrap();
    assert_eq!(fill.is_wire(), [false, false, false, false, false, false, true, true, true, true, false]);
    assert_eq!(fill.arrays(), (&positions[..], &triangles[..], &edges[..]));
    assert_eq!(fill.triangles_and_wires().len(), triangles.len() + 4);
    let mut constraints = vec![Constraint::Fixed; 11];
    constraints[6..9].fill(Constraint::Free);
    constraints[10] = Constraint::Soft(1.0);
    assemble_and_factor(&mut fill, &constraints, 0.0);
    let given = |i: u32, row: &mut Row| row.push((u32::from(i >= 9), 1.0));
    let filled = fill.solve(&given, &Progress::default()).unwrap();
    for (i, x) in std::iter::zip(6.., &along[..3]) {
        let [start, end, _] = row_of(&filled, i);
        assert!((end - f64::from(*x) / 3.0).abs() < 1e-9 && (start + end - 1.0).abs() < 1e-9, "{i}: {end}");
    }
    assert_eq!(row_of(&filled, 10), [0.0, 1.0, 0.0], "there is nothing but the row that it is pulled to");
    assert_eq!((filled.is_solved(10), fill.block_count()), (false, 1));
}

#[test]
fn a_hub_of_many_spokes_couples_all_of_them() {
    let spokes = 150;
    let position = |k: usize| {
        let (ring, angle) = (1 + k / spokes, (k % spokes) as f64 / spokes as f64 * std::f64::consts::TAU);
        [0, 1, 2]
            .map(|axis| (ring as f64 * [angle.cos(), angle.sin(), 0.1][axis] * (1.0 + 0.1 * noise(k as u64, 5))) as f32)
    };
    let n = spokes as u32;
    let spoke = |k: u32| {
        let (a, b) = (1 + k, 1 + (k + 1) % n);
        [[0, a, b], [a, a + n, b + n], [a, b + n, b]]
    };
    let positions: Vec<[f32; 3]> = std::iter::once([0.0; 3]).chain((0..2 * spokes).map(position)).collect();
    let mesh = Fixture::new("hub", positions, (0..n).flat_map(spoke).collect());
    let (stiffness, masses) = stiffness_and_masses(&mesh);
    let fixed: Vec<_> = (1 + spokes..1 + 2 * spokes).map(|i| (i, given_row(i))).collect();
    let expected = minimiser(&energy(&stiffness, &masses, 0.4), &[], &fixed);
    let mut fill = Fill::new(mesh.positions, mesh.triangles, None).unwrap();
    let constraint = |i: usize| if i <= spokes { Constraint::Free } else { Constraint::Fixed };
    assemble_and_factor(&mut fill, &(0..1 + 2 * spokes).map(constraint).collect::<Vec<_>>(), 0.4);
    let filled = fill.solve(&push_given, &Progress::default()).unwrap();
    assert_rows(&filled, |i| expected[i].clone(), 1 + spokes, 1e-6);
}

#[test]
fn no_confidence_at_all_leaves_nothing_to_solve() {
    let mesh = sheet();
    let mut fill = Fill::new(mesh.positions, mesh.triangles, None).unwrap();
    assemble_and_factor(&mut fill, &[Constraint::Soft(0.0); 30], 0.5);
    let filled = fill.solve(&push_given, &Progress::default()).unwrap();
    assert!((0..30).all(|i| !filled.is_solved(i) && row_of(&filled, i) == [0.0; COLUMNS]));
    assert_eq!((fill.block_count(), filled.minimum()), (0, 0.0));
}

#[test]
fn repeated_triangles_are_given_back_but_not_solved_on() {
    let mut mesh = sheet();
    let once = mesh.triangles.clone();
    assert_eq!(Fill::new(mesh.positions.clone(), once.clone(), None).unwrap().mesh().triangles(), once);
    mesh.triangles.extend([[0, 5, 6], [7, 7, 8]]);
    let fill = Fill::new(mesh.positions.clone(), mesh.triangles.clone(), None).unwrap();
    assert_eq!(fill.mesh().triangles(), once);
    assert_eq!(fill.arrays(), (&mesh.positions[..], &mesh.triangles[..], &[][..]));
}

#[test]
fn what_cannot_be_posed_is_refused() {
    let mesh = sheet();
    let mut fill = Fill::new(mesh.positions.clone(), mesh.triangles.clone(), None).unwrap();
    let mut posed = |constraint: Constraint, count: usize, length: f64| {
        fill.assemble(vec![constraint; count], length, &Progress::default()).map(|_| ()).unwrap_err()
    };
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let confidence = posed(Constraint::Soft(bad), 30, 0.0);
        assert!(matches!(confidence, Error::InvalidParameter { name: "confidence", .. }), "{bad}");
        let length = posed(Constraint::Fixed, 30, bad);
        assert!(matches!(length, Error::InvalidParameter { name: "length", .. }), "{bad}");
    }
    assert!(matches!(posed(Constraint::Fixed, 29, 0.0), Error::LengthMismatch { what: "constraints", found: 29, .. }));
    let weld = Some(Weld::new(&[0, 1, 1]));
    let refused = Fill::new(mesh.positions, mesh.triangles, weld).unwrap_err();
    assert_eq!(refused, Error::LengthMismatch { what: "weld", found: 3, expected: 30 });
}
