//! Strokes whose answer is known in closed form.

use glam::{DAffine3, DMat3, DVec3};
use skinwright_core::sculpt::{MAX_MEMBERS, Options, SculptSolver};
use skinwright_core::{Error, Weights};

fn weights(rows: &[&[f32]]) -> Weights {
    let mut indptr = vec![0];
    rows.iter().for_each(|row| indptr.push(indptr[indptr.len() - 1] + row.len() as u32));
    let bones = rows.iter().flat_map(|row| 0..row.len() as u32).collect();
    let n_bones = rows.iter().map(|row| row.len()).max().unwrap() as u32;
    Weights::new(indptr, bones, rows.concat(), n_bones).unwrap()
}

fn solver(rest: &[[f32; 3]], rows: &[&[f32]], options: Options) -> SculptSolver {
    SculptSolver::new(rest, weights(rows), &[], options).unwrap()
}

fn shift(x: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::X * x)
}

#[test]
fn one_pass_balances_sculpt_and_pull_over_the_rest_diagonal() {
    // Bone 1 moves by 2. With its weight w the objective is ((2 w - s) / diagonal)^2 + 2 kappa^2 w^2.
    for (diagonal, kappa) in [(10.0f64, 0.05), (10.0, 0.3), (0.5, 1.0)] {
        let rest = [[0.0, 0.0, 0.0], [0.0, 0.0, diagonal as f32]];
        let mut solver = solver(&rest, &[&[1.0, 0.0], &[1.0, 0.0]], Options { kappa, passes: 1 });
        let pose = solver.add_pose(vec![DAffine3::IDENTITY, shift(2.0)], 1.0).unwrap();
        let stroke = solver.stroke(pose, &[0], &[[0.8, 0.0, 0.0]]).unwrap();
        let expected = (2.0 * 0.8 / diagonal.powi(2)) / (4.0 / diagonal.powi(2) + 2.0 * kappa * kappa);
        assert!((f64::from(solver.weights().row(0).1[1]) - expected).abs() < 1e-6, "{diagonal} {kappa}");
        let left = 0.8 - 2.0 * expected;
        assert!((f64::from(stroke.residuals[0][0]) - left).abs() < 1e-6);
        assert!((stroke.reachability - (1.0 - left / 0.8)).abs() < 1e-6, "{}", stroke.reachability);
        assert_eq!((solver.reachability(), solver.stroke_count()), (Some(stroke.reachability), 1));
    }
}

#[test]
fn where_nothing_was_to_be_moved_everything_was_reached() {
    let mut solver = solver(&[[1.0, 2.0, 3.0]], &[&[1.0, 0.0]], Options::default());
    let pose = solver.add_pose(vec![DAffine3::IDENTITY; 2], 1.0).unwrap();
    assert_eq!(solver.stroke(pose, &[0], &[[1.0, 2.0, 3.0]]).unwrap().reachability, 1.0);
    assert_eq!(solver.stroke_count(), 1);
    solver.undo();
    assert_eq!(solver.stroke_count(), 0);
}

#[test]
fn rows_without_locked_bones_are_normalised() {
    let mut solver = solver(&[[0.0; 3]], &[&[0.3, 0.1]], Options::default());
    let pose = solver.add_pose(vec![DAffine3::IDENTITY, shift(1.0)], 1.0).unwrap();
    solver.stroke(pose, &[0], &[[0.5, 0.0, 0.0]]).unwrap();
    assert!((solver.weights().row(0).1.iter().sum::<f32>() - 1.0).abs() < 1e-6);
}

#[test]
fn poses_are_the_same_up_to_rounding_relative_to_the_mesh() {
    let rest = [[0.0; 3], [1000.0, 0.0, 0.0]];
    let mut solver = solver(&rest, &[&[1.0, 0.0], &[1.0, 0.0]], Options::default());
    let mut number = |pose: DAffine3| solver.add_pose(vec![pose; 2], 1.0).unwrap();
    assert_eq!(number(shift(0.0)), 0);
    assert_eq!(number(shift(5e-4)), 0);
    assert_eq!(number(shift(5e-3)), 1);
    assert_eq!(number(DAffine3::from_rotation_z(1e-3)), 2);
    assert_eq!(number(DAffine3::from_rotation_z(1e-3 + 1e-7)), 2);
}

#[test]
fn as_many_members_as_there_may_be_are_taken() {
    let row = [1.0 / MAX_MEMBERS as f32; MAX_MEMBERS];
    assert!(SculptSolver::new(&[[0.0; 3]], weights(&[&row]), &[], Options::default()).is_ok());
}

#[test]
fn a_range_of_motion_is_a_guard_for_each_turn() {
    let rest = [[0.3, 0.1, 0.2], [1.0, -0.4, 0.5], [1.6, 0.3, -0.2]];
    let rows: [&[f32]; 3] = [&[0.8, 0.2, 0.0], &[0.3, 0.4, 0.3], &[0.1, 0.3, 0.6]];
    let heads = [[0.0, 0.0, 0.0], [0.9, 0.1, -0.3], [1.5, 0.2, 0.1]];
    let parents = [-1, 0, 1];
    let mut by_range = solver(&rest, &rows, Options::default());
    by_range.guard_range_of_motion(&parents, &heads, &[1], 0.6).unwrap();
    let mut by_hand = solver(&rest, &rows, Options::default());
    let head = DVec3::from(heads[1].map(f64::from));
    let turn: [fn(f64) -> DMat3; 3] = [DMat3::from_rotation_x, DMat3::from_rotation_y, DMat3::from_rotation_z];
    for turn in turn {
        for degrees in [-90.0f64, -45.0, 45.0, 90.0] {
            let back = DAffine3::from_translation(-head);
            let turned = DAffine3::from_translation(head) * DAffine3::from_mat3(turn(degrees.to_radians())) * back;
            by_hand.guard(&[DAffine3::IDENTITY, turned, turned], 0.6 / 12.0).unwrap();
        }
    }
    for solver in [&mut by_range, &mut by_hand] {
        let pose = solver.add_pose(vec![DAffine3::IDENTITY, shift(0.5), shift(1.0)], 1.0).unwrap();
        solver.stroke(pose, &[0, 1, 2], &[[0.6, 0.1, 0.2], [1.8, -0.4, 0.5], [1.8, 0.3, -0.2]]).unwrap();
    }
    let (found, expected) = (by_range.weights(), by_hand.weights());
    assert!(std::iter::zip(found.values(), expected.values()).all(|(a, b)| (a - b).abs() < 1e-6));
    let refused = by_range.guard_range_of_motion(&parents, &heads, &[3], 0.6).unwrap_err();
    assert!(matches!(refused, Error::InvalidParameter { name: "joint", .. }));
}

/// The offset that makes up for `residual` under the blend of two bones with these matrices.
fn offset(matrices: [DMat3; 2], residual: [f32; 3]) -> [f32; 3] {
    // The pull is so strong that the stroke changes nothing.
    let mut solver = solver(&[[0.0; 3]], &[&[0.5, 0.5]], Options { kappa: 1e6, passes: 1 });
    let pose = solver.add_pose(matrices.map(DAffine3::from_mat3).to_vec(), 1.0).unwrap();
    solver.stroke(pose, &[0], &[residual]).unwrap();
    solver.rest_residuals(pose).unwrap().vectors[0]
}

#[test]
fn rest_residuals_invert_the_blend_and_damp_what_has_collapsed() {
    let is_near =
        |found: [f32; 3], expected: [f32; 3]| std::iter::zip(found, expected).all(|(a, b)| (a - b).abs() < 1e-5);
    let small = DMat3::from_diagonal(DVec3::splat(0.05));
    assert!(is_near(offset([small, small], [0.1, -0.2, 0.3]), [2.0, -4.0, 6.0]));
    let large = DMat3::from_diagonal(DVec3::new(20.0, 40.0, 10.0));
    assert!(is_near(offset([large, large], [1.0, 2.0, 3.0]), [0.05, 0.05, 0.3]));
    // What is left of half a turn either way is the axis: (M'M + d)^-1 M' with d a hundredth of a third of its square.
    for (turn, axis) in
        [(DMat3::from_rotation_x as fn(f64) -> DMat3, 0), (DMat3::from_rotation_y, 1), (DMat3::from_rotation_z, 2)]
    {
        let found = offset([turn(std::f64::consts::FRAC_PI_2), turn(-std::f64::consts::FRAC_PI_2)], [0.3; 3]);
        let mut expected = [0.0; 3];
        expected[axis] = 0.3 / (1.0 + 0.01 / 3.0);
        assert!(is_near(found, expected), "{found:?} is not {expected:?}");
    }
    assert_eq!(offset([DMat3::IDENTITY, -DMat3::IDENTITY], [0.3; 3]), [0.0; 3]);
}
