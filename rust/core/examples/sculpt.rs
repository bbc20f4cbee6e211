//! Sculpts a posed arm: the inside of the bent elbow is pushed out, and the weights follow.

mod read;

use std::error::Error;

use glam::{DAffine3, DQuat, DVec3};
use skinwright_core::desparsify::{Method, Skeleton, desparsify};
use skinwright_core::sculpt::{Options, SculptSolver};

fn main() -> Result<(), Box<dyn Error>> {
    let (rest, _) = read::mesh(read::data("arm.obj"))?;
    let weights = read::weights(read::data("arm.weights"), rest.len())?;
    let skeleton = Skeleton { parents: &[-1, 0], segments: &[], locked: &[] };
    let weights = desparsify(&weights, Method::Hop, 2, &skeleton, None)?;
    let mut solver = SculptSolver::new(&rest, weights, &[], Options::default())?;

    let elbow = DAffine3::from_translation(DVec3::new(0.5, 0.0, 0.0));
    let bend = DAffine3::from_quat(DQuat::from_rotation_z(1.5));
    let pose = solver.add_pose(vec![DAffine3::IDENTITY, elbow * bend * elbow.inverse()], 1.0)?;

    let is_crook = |i: &u32| (rest[*i as usize][0] - 0.5).abs() < 0.08 && rest[*i as usize][1] > 0.03;
    let vertices: Vec<u32> = (0..rest.len() as u32).filter(is_crook).collect();
    let places: Vec<[f32; 3]> = vertices.iter().map(|&i| rest[i as usize]).collect();
    let mut targets = solver.posed(pose, &vertices, &places)?;
    targets.iter_mut().for_each(|[x, y, _]| (*x, *y) = (*x - 0.01, *y + 0.01));
    let stroke = solver.stroke(pose, &vertices, &targets)?;
    println!("{} vertices sculpted, {:.0} % of it reached", vertices.len(), 100.0 * stroke.reachability);
    Ok(())
}
