//! Smoothing after the solve against its formula.

use std::collections::BTreeSet;

use crate::common::{body, skirt};
use crate::walls::{dense, source, target};
use glam::Vec3;
use skinwright_core::Weights;
use skinwright_core::transfer::{Length, Settings, Transfer, transfer_weights};

/// The numbers of the body's four bones among 200.
const BONES: [u32; 4] = [3, 63, 64, 197];

fn transfer(settings: &Settings) -> Transfer {
    let (fixture, rows) = body();
    let source = source(std::slice::from_ref(&fixture), 200, |_, p| {
        let at = fixture.positions.iter().position(|q| *q == p).expect("it is one of them");
        let (bones, values) = rows[at].clone();
        (bones.into_iter().map(|bone| BONES[bone as usize]).collect(), values)
    });
    transfer_weights(&source, target(&skirt()), None, settings).unwrap()
}

/// Weights of the body's four bones; no other bone has any.
fn of_four(weights: &Weights, i: usize) -> [f64; 4] {
    let row = dense(weights, i);
    assert_eq!(
        row.iter().filter(|&&x| x != 0.0).count(),
        BONES.iter().filter(|&&bone| row[bone as usize] != 0.0).count()
    );
    BONES.map(|bone| row[bone as usize].into())
}

/// The passes `w <- (1 - factor) w + factor mean` over the vertices that are within `reach` of an inpainted one.
fn smoothed(transfer: &Transfer, reach: f64, passes: u32, factor: f64) -> Vec<Vec<f64>> {
    let mesh = skirt();
    let count = mesh.positions.len();
    let mut neighbours = vec![BTreeSet::new(); count];
    for t in &mesh.triangles {
        t.iter()
            .for_each(|&i| neighbours[i as usize].extend(t.iter().map(|&j| j as usize).filter(|&j| j != i as usize)));
    }
    let length = |i: usize, j: usize| {
        Vec3::from(mesh.positions[i]).as_dvec3().distance(Vec3::from(mesh.positions[j]).as_dvec3())
    };
    let mut distance: Vec<f64> = transfer.matched.iter().map(|&m| if m { f64::INFINITY } else { 0.0 }).collect();
    // Bellman and Ford.
    for _ in 0..count {
        let nearer = |i: usize| neighbours[i].iter().map(|&j| distance[j] + length(i, j)).fold(distance[i], f64::min);
        let next: Vec<f64> = (0..count).map(nearer).collect();
        if next == distance {
            break;
        }
        distance = next;
    }
    let mut rows: Vec<Vec<f64>> = (0..count).map(|i| of_four(&transfer.weights, i).to_vec()).collect();
    for _ in 0..passes {
        let row = |i: usize| {
            let mean =
                |bone: usize| neighbours[i].iter().map(|&j| rows[j][bone]).sum::<f64>() / neighbours[i].len() as f64;
            (0..4).map(|bone| (1.0 - factor) * rows[i][bone] + factor * mean(bone)).collect()
        };
        rows = (0..count).map(|i| if distance[i] <= reach { row(i) } else { rows[i].clone() }).collect();
    }
    rows
}

#[test]
fn passes_move_rows_towards_their_neighbours_mean_around_what_was_inpainted() {
    for (reach, passes, smoothing_factor) in [(0.15, 1, 0.2), (0.15, 4, 0.7), (0.4, 2, 1.0), (0.4, 3, 0.0)] {
        let base = Settings { max_distance: Length::Absolute(reach), smoothing_factor, ..Settings::default() };
        let unsmoothed = transfer(&base);
        assert!(unsmoothed.report.matched > 100 && unsmoothed.report.inpainted > 100);
        let expected = smoothed(&unsmoothed, reach, passes, smoothing_factor);
        let found = transfer(&Settings { smoothing_iterations: passes, ..base.clone() });
        for (i, expected) in expected.iter().enumerate() {
            let found = of_four(&found.weights, i);
            let is_near = std::iter::zip(&found, expected).all(|(x, y)| (x - y).abs() < 1e-5);
            assert!(is_near, "{reach}, {passes}, {smoothing_factor}: row {i} is {found:?}, not {expected:?}");
        }
    }
}
