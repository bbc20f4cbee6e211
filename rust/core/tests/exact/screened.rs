//! Screened filling against the four dense solves that it stands for.

use crate::common::noise;
use crate::dense::{Screened, stiffness_and_masses};
use crate::sheet::{assert_rows, confidence, given_row, mixed, push_given, row_of, sheet};
use skinwright_core::Progress;
use skinwright_core::fill::{Constraint, Fill, GivenRows, Patch, Ragged, Row, RowTable, Screen, screened};

#[test]
fn a_screened_solve_takes_the_four_steps_that_are_written_down() {
    // What is negligible must not depend on the unit of length, nor on how lengths compare with edges.
    for scale in [1.0, 100.0, 0.01] {
        takes_four_steps(scale, scale, mixed);
        takes_four_steps(scale, scale, |i| Constraint::Soft(noise(i as u64, 3)));
    }
    takes_four_steps(1.0, 8.0, mixed);
}

/// On a sheet of this `size`, with soft rows that are trusted over one to four times `reach`.
fn takes_four_steps(size: f64, reach: f64, kind: impl Fn(usize) -> Constraint) {
    let mesh = sheet().mapped(|p| p * size);
    let (stiffness, masses) = stiffness_and_masses(&mesh);
    let constraint = |i: usize| match kind(i) {
        Constraint::Soft(x) => Constraint::Soft(screened::confidence(masses[i], reach * (1.0 + 2.0 * x))),
        other => other,
    };
    let constraints: Vec<_> = (0..30).map(constraint).collect();
    let mut fill = Fill::new(mesh.positions.clone(), mesh.triangles.clone(), None).unwrap();
    let progress = Progress::default();
    let assembled = fill.assemble_screened(constraints.clone(), &progress).unwrap();
    fill.factor(assembled, &progress).unwrap();
    // The share of an edge's change that is kept, as either end says it; the lower index decides.
    let share = |i: usize, j: usize| 0.8 * noise(i as u64, 100 + j as u64);
    let is_soft = |i: usize| matches!(constraints[i], Constraint::Soft(_));
    let neighbours = |i: usize| fill.laplacian().neighbours(i).to_vec();
    let list = |i: usize, out: &mut Vec<f64>| out.extend(neighbours(i).iter().map(|&j| share(i, j as usize)));
    let kept = Ragged::new(30, |i, out| {
        if is_soft(i) {
            list(i, out)
        }
    });
    let rows = fill.row_table(&push_given);
    let screen = Screen { rows: &rows, kept: &kept, patch: None, with_all_solves: true };
    let filled = fill.solve_screened(&push_given, screen, &progress).unwrap();

    let problem = Screened {
        stiffness,
        confidence: constraints.iter().map(|&c| confidence(c)).collect(),
        is_fixed: constraints.iter().map(|&c| c == Constraint::Fixed).collect(),
        rows: (0..30).map(|i| constraints[i].is_known().then(|| given_row(i).to_vec())).collect(),
        masses,
    };
    let expected = problem.solved(|i, j| if is_soft(j) { share(i.min(j), i.max(j)) } else { share(i, j) });
    assert_rows(&filled, |i| expected[i].clone(), 30, 3e-5);
    let solved = (0..30).filter(|&i| filled.is_solved(i)).flat_map(|i| expected[i].clone());
    assert!((filled.minimum() - solved.fold(f64::INFINITY, f64::min)).abs() < 3e-5);
    assert!(filled.largest_residual() > 0.0 && filled.largest_residual() < 1e-5);
}

fn factored(constraints: &[Constraint]) -> Fill {
    let mesh = sheet();
    let mut fill = Fill::new(mesh.positions, mesh.triangles, None).unwrap();
    factor(&mut fill, constraints);
    fill
}

fn factor(fill: &mut Fill, constraints: &[Constraint]) {
    let assembled = fill.assemble_screened(constraints.to_vec(), &Progress::default()).unwrap();
    fill.factor(assembled, &Progress::default()).unwrap();
}

fn screen<'a>(rows: &'a RowTable, kept: &'a Ragged<f64>) -> Screen<'a> {
    Screen { rows, kept, patch: None, with_all_solves: true }
}

#[test]
fn one_row_everywhere_is_handed_on_to_the_bit() {
    let fill = factored(&(0..30).map(mixed).collect::<Vec<_>>());
    let nothing_kept = Ragged::new(30, |_, _| {});
    let solve = |given: GivenRows<'_>| {
        let rows = fill.row_table(given);
        let filled = fill.solve_screened(given, screen(&rows, &nothing_kept), &Progress::default()).unwrap();
        ((0..30).map(|i| row_of(&filled, i)).collect::<Vec<_>>(), filled.largest_residual())
    };
    let (rows, residual) = solve(&|_, row: &mut Row| row.push((1, 0.3)));
    assert!(rows.iter().all(|row| *row == [0.0, 0.3, 0.0]) && residual == 0.0);
    // All are the same but for the first.
    let first = (0..30).find(|&i| matches!(mixed(i), Constraint::Soft(_))).unwrap();
    let (rows, _) = solve(&|i, row: &mut Row| row.push((if i as usize == first { 0 } else { 1 }, 1.0)));
    assert!(rows[first].iter().take(2).all(|&x| x > 1e-3) && rows[0] == [0.0, 1.0, 0.0]);
}

#[test]
fn a_patch_held_at_what_the_whole_found_is_the_whole() {
    let whole: Vec<_> = (0..30).map(mixed).collect();
    let nothing_kept = Ragged::new(30, |_, _| {});
    let one = |_: u32, row: &mut Row| row.push((1, 0.7));
    for given in [&push_given as GivenRows<'_>, &one] {
        let mut fill = factored(&whole);
        let rows = fill.row_table(given);
        let filled = fill.solve_screened(given, screen(&rows, &nothing_kept), &Progress::default()).unwrap();
        let (expected, found): (Vec<_>, _) = ((0..30).map(|i| row_of(&filled, i)).collect(), filled.found());
        let is_held: Vec<bool> = (0..30).map(|i| i >= 15 && whole[i] != Constraint::Fixed).collect();
        let constraint = |i: usize| if i < 15 { whole[i] } else { Constraint::Fixed };
        factor(&mut fill, &(0..30).map(constraint).collect::<Vec<_>>());
        let patch = Some(Patch { found: &found, is_held: &is_held });
        let screen = Screen { patch, ..screen(&rows, &nothing_kept) };
        let filled = fill.solve_screened(given, screen, &Progress::default()).unwrap();
        assert_rows(&filled, |i| expected[i].to_vec(), 15, 1e-5);
    }
}
