//! What becomes of systems that a factorisation cannot solve, or not accurately.

use std::f64::consts::TAU;

use crate::common::{Fixture, noise};
use crate::dense::{Screened, energy, minimiser, stiffness_and_masses};
use crate::sheet::{assert_rows, given_row, mixed, push_given, sheet, wide_sheet};
use skinwright_core::fill::{Constraint, Fill, Ragged, Row, Screen, screened};
use skinwright_core::{Error, Progress};

fn fill(mesh: &Fixture) -> Fill {
    Fill::new(mesh.positions.clone(), mesh.triangles.clone(), None).unwrap()
}

fn factor(fill: &mut Fill, constraints: Vec<Constraint>, length: f64) -> Result<(), Error> {
    let progress = Progress::default();
    let assembled = fill.assemble(constraints, length, &progress).unwrap();
    fill.factor(assembled, &progress)
}

/// A disc of concentric rings of eight vertices, each half as wide as the one around it; from the 24th on all
/// have collapsed.
fn shrinking_rings(rings: usize) -> Fixture {
    let radius = |ring: usize| 2.0 * 0.5f64.powi(ring as i32).max(1e-7);
    let position = |k: usize| {
        let angle = TAU * ((k % 8) as f64 + 0.3 * noise(k as u64, 3)) / 8.0;
        [angle.cos(), angle.sin(), 0.0].map(|x| (radius(k / 8) * x) as f32)
    };
    let quad = |k: u32| {
        let (a, b) = (k, k / 8 * 8 + (k + 1) % 8);
        [[a, b, b + 8], [a, b + 8, a + 8]]
    };
    let centre = 8 * rings as u32;
    let cap = (0..8).map(|k| [centre - 8 + k, centre - 8 + (k + 1) % 8, centre]);
    let positions = (0..8 * rings).map(position).chain([[0.0; 3]]).collect();
    Fixture::new("rings", positions, (0..centre - 8).flat_map(quad).chain(cap).collect())
}

#[test]
fn triangles_too_small_for_the_factorisation_are_solved_with_floors() {
    for rings in [4, 64] {
        let disc = shrinking_rings(rings);
        let count = disc.positions.len();
        let constraint = |i: usize| if i < 16 { Constraint::Fixed } else { Constraint::Free };
        let constraints: Vec<_> = (0..count).map(constraint).collect();
        let mut fill = fill(&disc);
        factor(&mut fill, constraints.clone(), 1.0).unwrap();
        // A linear function costs no energy.
        let right = |i: usize| 0.5 + 0.2 * f64::from(disc.positions[i][0]);
        let given = |i: u32, row: &mut Row| row.extend([(0, 1.0 - right(i as usize)), (1, right(i as usize))]);
        let filled = fill.solve(&given, &Progress::default()).unwrap();
        assert_rows(&filled, |i| vec![1.0 - right(i), right(i), 0.0], count, 1e-6);
        assert_eq!(fill.assemble(constraints, 1.0, &Progress::default()).unwrap().missing_blocks(), 0);
    }
}

#[test]
fn without_any_other_way_the_harmonic_solution_counts() {
    let mesh = sheet();
    let constraint = |i: usize| if (5..25).contains(&i) { Constraint::Free } else { Constraint::Fixed };
    let fixed: Vec<_> = (0..30).filter(|&i| constraint(i) == Constraint::Fixed).map(|i| (i, given_row(i))).collect();
    let (stiffness, masses) = stiffness_and_masses(&mesh);
    let expected = minimiser(&energy(&stiffness, &masses, 0.0), &[], &fixed);
    let mut fill = fill(&mesh);
    // The square of this length is beyond all numbers.
    let constraints: Vec<_> = (0..30).map(constraint).collect();
    factor(&mut fill, constraints.clone(), 1e200).unwrap();
    let filled = fill.solve(&push_given, &Progress::default()).unwrap();
    assert_rows(&filled, |i| expected[i].clone(), 30, 1e-7);
    assert_eq!(fill.assemble(constraints, 1e200, &Progress::default()).unwrap().missing_blocks(), 0);
}

#[test]
fn what_hangs_on_nothing_but_rounding_is_refused() {
    let two = sheet().joined(sheet());
    let constraint = |i: usize| match i {
        0..30 => mixed(i),
        47 => Constraint::Soft(1e-25),
        _ => Constraint::Free,
    };
    for length in [0.0, 0.5] {
        let refused = factor(&mut fill(&two), (0..60).map(constraint).collect(), length).unwrap_err();
        assert_eq!(refused, Error::NotPositiveDefinite { vertex: 30 });
    }
}

#[test]
fn a_solve_that_is_not_accurate_is_refused() {
    let mesh = wide_sheet(20, 20);
    let constraint = |i: usize| if i < 20 { Constraint::Fixed } else { Constraint::Free };
    let constraints: Vec<_> = (0..400).map(constraint).collect();
    let (mut fill, progress) = (fill(&mesh), Progress::default());
    // Factors of screened problems are stored in single precision; `solve` promises more than that.
    let assembled = fill.assemble_screened(constraints.clone(), &progress).unwrap();
    fill.factor(assembled, &progress).unwrap();
    let refused = fill.solve(&push_given, &progress).map(|filled| filled.largest_residual());
    assert_eq!(refused.unwrap_err(), Error::NotPositiveDefinite { vertex: 20 });
    factor(&mut fill, constraints, 0.0).unwrap();
    assert!(fill.solve(&push_given, &progress).unwrap().largest_residual() < 1e-12);
}

/// Bone `i` modulo 64, and one of six others with this share.
fn two_bones(i: usize, share: f64) -> [(u32, f64); 2] {
    [(i as u32 % 64, 1.0 - share), (64 + i as u32 % 6, share)]
}

#[test]
fn bones_with_small_weights_only_are_solved_like_others() {
    // Columns are solved in groups of 64: beside the small weights of the second group, what is neglected is much.
    let (mesh, count) = (wide_sheet(3, 150), 450);
    let (stiffness, masses) = stiffness_and_masses(&mesh);
    let confidence: Vec<f64> =
        masses.iter().enumerate().map(|(i, &mass)| screened::confidence(mass, 1.0 + (i % 7) as f64 / 3.0)).collect();
    let (mut fill, progress) = (fill(&mesh), Progress::default());
    let constraints = confidence.iter().map(|&b| Constraint::Soft(b)).collect();
    let assembled = fill.assemble_screened(constraints, &progress).unwrap();
    fill.factor(assembled, &progress).unwrap();
    let mut problem = Screened { stiffness, confidence, is_fixed: vec![false; count], rows: Vec::new(), masses };
    for share in [0.5, 1e-3] {
        let given_to = |i: usize| if i % 150 < 30 { two_bones(i, share) } else { two_bones(i, 0.0) };
        let given =
            |i: u32, row: &mut Row| row.extend(given_to(i as usize).into_iter().filter(|&(_, value)| value > 0.0));
        let (rows, nothing_kept) = (fill.row_table(&given), Ragged::new(count, |_, _| {}));
        let screen = Screen { rows: &rows, kept: &nothing_kept, patch: None, with_all_solves: false };
        let filled = fill.solve_screened(&given, screen, &progress).unwrap();
        let of_second_group = |entries: &[(u32, f64)]| {
            let mut row = vec![0.0; 6];
            let second = entries.iter().filter(|&&(bone, _)| bone >= 64);
            second.for_each(|&(bone, value)| row[bone as usize - 64] += value);
            row
        };
        problem.rows = (0..count).map(|i| Some(of_second_group(&given_to(i)))).collect();
        for (i, expected) in problem.solved(|_, _| 0.0).into_iter().enumerate() {
            let mut row = Row::new();
            filled.append_row(i, &mut row);
            for (found, expected) in std::iter::zip(of_second_group(&row), expected) {
                assert!((found - expected).abs() < 2e-5, "{share}: vertex {i}: {found} is not {expected}");
            }
        }
    }
}
