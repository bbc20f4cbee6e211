//! Where a limb may bend: the joint's place, the directions of both bones, and the skin and lattice around it, at rest.

use glam::DVec3;
use rayon::prelude::*;

use super::constraint::Axis;
use super::skeleton::Skeleton;

/// Share of a particle's weights that the bones of a joint must have for it to belong to the joint.
const FAMILY: f32 = 0.5;
/// Bones up and down from the joint that count.
const LEVELS: usize = 3;
/// Skin belongs to a joint up to this many radii away, measured along the bones.
const REACH: f64 = 7.0;
/// A bone shorter than this many radii has no direction of its own; the next one along the limb is taken with it.
const SHORTEST: f64 = 1.5;

/// Skin farther from the bones than this many radii is not a limb's, and at most this share of a limb's is so far.
const SLIM: f32 = 2.5;
const MOST_FAR: f64 = 0.1;

/// A joint bent further than this at rest (radians), as a hip is, has a torso above it and not a limb.
const MOST_BENT: f32 = 1.05;

/// A particle of a joint, at rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    /// Its index.
    pub(super) particle: u32,
    /// Distance from the joint along the nearer bone.
    pub(super) along: f32,
    /// Distance from the bones.
    pub(super) distance: f32,
    /// +1 on the child's side of the plane between the bones, -1 on the parent's, 0 in it.
    pub(super) side: f32,
}

/// A joint at rest.
#[derive(Debug)]
pub(super) struct Joint {
    /// The bone below and the bone above.
    pub(super) bone: usize,
    pub(super) parent: usize,
    /// The joint's place and both bones' directions.
    pub(super) axis: Axis,
    /// Median distance of skin from the bones.
    pub(super) radius: f32,
    /// Whether what is beside it lies close around the bones, so that the ends of its region move rigidly about the joint.
    pub(super) is_slim: bool,
    /// Whether both bones run through a limb, so that a plane between them makes sense.
    pub(super) is_limb: bool,
    /// Lattice nodes and surface vertices.
    pub(super) members: Vec<Member>,
}

/// Every joint that skin follows. `places` and `rows` of all particles, of which the first `nodes` are lattice nodes.
pub(super) fn joints(skeleton: &Skeleton, places: &[DVec3], rows: &[Vec<(u32, f32)>], nodes: usize) -> Vec<Joint> {
    let mut of_bone: Vec<Vec<(u32, f32)>> = vec![Vec::new(); skeleton.parents.len()];
    for (particle, row) in rows.iter().enumerate() {
        row.iter().for_each(|&(bone, value)| of_bone[bone as usize].push((particle as u32, value)));
    }
    let bones: Vec<usize> = (0..skeleton.parents.len()).collect();
    bones.par_iter().filter_map(|&bone| Joint::new(skeleton, bone, places, &of_bone, nodes)).collect()
}

impl Joint {
    fn new(
        skeleton: &Skeleton,
        bone: usize,
        places: &[DVec3],
        of_bone: &[Vec<(u32, f32)>],
        nodes: usize,
    ) -> Option<Self> {
        let parent = skeleton.parent(bone)?;
        let family = family(skeleton, bone, parent, of_bone);
        let head = skeleton.segments[bone][0];
        let skin: Vec<DVec3> = family.iter().filter(|&&p| p as usize >= nodes).map(|&p| places[p as usize]).collect();
        let nearest = skin.iter().map(|p| p.distance(head)).min_by(f64::total_cmp)?;
        let mut radius = nearest;
        let mut axis = directions(skeleton, bone, parent, 0.0)?;
        for _ in 0..3 {
            radius = median_distance(&skin, &axis, radius.max(1e-9))?;
            axis = directions(skeleton, bone, parent, SHORTEST * radius)?;
        }
        let members = members(&family, places, &axis, radius);
        let is_slim = is_slim(&members, nodes, radius as f32);
        let is_limb = is_slim && is_limb(skeleton, bone, parent, &axis, &skin, radius);
        Some(Self { bone, parent, axis, radius: radius as f32, is_slim, is_limb, members })
    }
}

/// Particles that follow the joint's bones by at least half, ascending.
fn family(skeleton: &Skeleton, bone: usize, parent: usize, of_bone: &[Vec<(u32, f32)>]) -> Vec<u32> {
    let mut bones = vec![bone];
    let mut above = Some(parent);
    for _ in 0..LEVELS {
        let Some(at) = above else { break };
        bones.push(at);
        above = skeleton.parent(at);
    }
    let mut below = skeleton.next(bone);
    for _ in 1..LEVELS {
        let Some(at) = below else { break };
        bones.push(at);
        below = skeleton.next(at);
    }
    let mut entries: Vec<(u32, f32)> = bones.iter().flat_map(|&j| of_bone[j].iter().copied()).collect();
    entries.sort_by_key(|entry| entry.0);
    let chunks = entries.chunk_by(|a, b| a.0 == b.0);
    chunks.filter(|c| c.iter().map(|e| e.1).sum::<f32>() >= FAMILY).map(|c| c[0].0).collect()
}

/// The joint with the directions of its bones, each at least `shortest` long or as long as the limb goes on.
fn directions(skeleton: &Skeleton, bone: usize, parent: usize, shortest: f64) -> Option<Axis> {
    let head = skeleton.segments[bone][0];
    let (mut up, mut at) = (skeleton.segments[parent][0], parent);
    while up.distance(head) < shortest.max(1e-9) {
        let Some(next) = skeleton.parent(at) else { break };
        (up, at) = (skeleton.segments[next][0], next);
    }
    let (mut down, mut at) = (skeleton.segments[bone][1], bone);
    while down.distance(head) < shortest.max(1e-9) {
        let Some(next) = skeleton.next(at) else { break };
        (down, at) = (skeleton.segments[next][1], next);
    }
    let directions = [(up - head).try_normalize()?, (down - head).try_normalize()?];
    Some(Axis { origin: head.as_vec3(), directions: directions.map(|d| d.as_vec3()) })
}

fn median_distance(skin: &[DVec3], axis: &Axis, radius: f64) -> Option<f64> {
    let near = skin.iter().filter(|p| p.distance(axis.origin.as_dvec3()) < 2.0 * radius);
    let mut distances: Vec<f32> = near.map(|p| axis.offset(p.as_vec3()).length()).collect();
    if distances.is_empty() {
        return None;
    }
    let middle = distances.len() / 2;
    Some(f64::from(*distances.select_nth_unstable_by(middle, f32::total_cmp).1))
}

fn members(family: &[u32], places: &[DVec3], axis: &Axis, radius: f64) -> Vec<Member> {
    let [up, down] = axis.directions;
    let normal = (down - up).normalize_or_zero();
    let member = |&particle: &u32| {
        let place = places[particle as usize].as_vec3();
        let (along, distance) = (axis.along(place).abs(), axis.offset(place).length());
        let height = (place - axis.origin).dot(normal);
        let side = if height.abs() < 4e-4 * radius as f32 { 0.0 } else { height.signum() };
        Member { particle, along, distance, side }
    };
    let reach = (REACH * radius) as f32;
    family.iter().map(member).filter(|m| m.along < reach && m.distance < reach).collect()
}

/// Little skin beside the joint is far from the bones: at a shoulder, the chest is.
fn is_slim(members: &[Member], nodes: usize, radius: f32) -> bool {
    let beside = members.iter().filter(|m| m.particle as usize >= nodes && m.along < 2.0 * radius);
    let (far, all) = beside.fold((0, 0), |(far, all), m| (far + usize::from(m.distance > SLIM * radius), all + 1));
    far as f64 <= MOST_FAR * f64::from(all)
}

/// Both bones are longer than the limb is thick, and the skin around the joint lies at about one distance from them.
fn is_limb(skeleton: &Skeleton, bone: usize, parent: usize, axis: &Axis, skin: &[DVec3], radius: f64) -> bool {
    let head = skeleton.segments[bone][0];
    let length = skeleton.segments[bone][1].distance(head);
    let above = skeleton.segments[parent][0].distance(head);
    let near = skin.iter().filter(|p| p.distance(head) < 2.0 * radius);
    let mut distances: Vec<f32> = near.map(|p| axis.offset(p.as_vec3()).length()).collect();
    distances.sort_by(f32::total_cmp);
    let quantile = |q: f64| distances[((distances.len() - 1) as f64 * q) as usize];
    let [up, down] = axis.directions;
    let straight = (-up).angle_between(down) < MOST_BENT;
    length > 0.8 * radius && above > 0.3 * radius && straight && quantile(0.9) < 4.0 * quantile(0.1)
}
