//! Linear blend skinning against cases worked out by hand.

use glam::DAffine3;
use skinwright_core::skinning::{linear_blend, pose_from_matrices};
use skinwright_core::{Error, Weights};

const TURN: [[f64; 4]; 4] = [[0., -1., 0., 3.], [1., 0., 0., 0.], [0., 0., 1., 0.], [0., 0., 0., 1.]];
const SHIFT: [[f64; 4]; 4] = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 4.], [0., 0., 0., 1.]];

fn pose() -> Vec<DAffine3> {
    pose_from_matrices(&[TURN, SHIFT]).unwrap()
}

fn one_vertex(bones: Vec<u32>, values: Vec<f32>) -> Weights {
    Weights::new(vec![0, bones.len() as u32], bones, values, 2).unwrap()
}

fn blended(bones: Vec<u32>, values: Vec<f32>) -> [f32; 3] {
    linear_blend(&[[1.0, 2.0, 5.0]], &one_vertex(bones, values), &pose()).unwrap()[0]
}

#[test]
fn one_bone_moves_the_vertex_as_its_matrix_does() {
    assert_eq!(blended(vec![0], vec![1.0]), [1.0, 1.0, 5.0]);
    assert_eq!(blended(vec![1], vec![1.0]), [1.0, 2.0, 9.0]);
}

#[test]
fn weights_are_divided_by_their_sum() {
    assert_eq!(blended(vec![0, 1], vec![0.5, 0.5]), [1.0, 1.5, 7.0]);
    assert_eq!(blended(vec![0, 1], vec![0.125, 0.125]), [1.0, 1.5, 7.0]);
    assert_eq!(blended(vec![1], vec![0.25]), [1.0, 2.0, 9.0]);
}

#[test]
fn an_unweighted_vertex_stays() {
    assert_eq!(blended(vec![], vec![]), [1.0, 2.0, 5.0]);
    assert_eq!(blended(vec![0, 1], vec![0.0, 0.0]), [1.0, 2.0, 5.0]);
    assert_eq!(blended(vec![1], vec![0.00009]), [1.0, 2.0, 5.0]);
    assert_eq!(blended(vec![1], vec![0.00011]), [1.0, 2.0, 9.0]);
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let weights = one_vertex(vec![0], vec![1.0]);
    let mismatch = |what, found, expected| Some(Error::LengthMismatch { what, found, expected });
    assert_eq!(linear_blend(&[], &weights, &pose()).err(), mismatch("rest_positions", 0, 1));
    assert_eq!(linear_blend(&[[0.0; 3]], &weights, &pose()[..1]).err(), mismatch("pose_from_rest", 1, 2));
    let mut broken = TURN;
    broken[0][3] = f64::INFINITY;
    assert!(matches!(
        pose_from_matrices(&[SHIFT, broken]),
        Err(Error::InvalidParameter { name: "pose_from_rest", .. })
    ));
    broken = TURN;
    broken[3][3] = f64::NAN;
    assert!(pose_from_matrices(&[broken]).is_ok(), "the last row is not read");
}
