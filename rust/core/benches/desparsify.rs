//! 100,000 vertices, 163 bones: a tube with the bones spread along and around it, two influences a vertex.

use divan::Bencher;
use skinwright_core::desparsify::{Method, Skeleton, desparsify};
use skinwright_core::{TriMesh, Weights};

const AROUND: u32 = 250;
const ALONG: u32 = 400;
const BONES: u32 = 163;

fn main() {
    divan::main();
}

struct Character {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    weights: Weights,
    parents: Vec<i32>,
    segments: Vec<[[f32; 3]; 2]>,
}

#[divan::bench(args = Method::ALL, sample_count = 20)]
fn members_4(bencher: Bencher, method: Method) {
    let c = character();
    let mesh = TriMesh::new(&c.positions, &c.triangles, "rest").unwrap();
    let skeleton = Skeleton { parents: &c.parents, segments: &c.segments, locked: &[] };
    bencher.bench(|| desparsify(&c.weights, method, 4, &skeleton, Some(&mesh)).unwrap());
}

fn character() -> Character {
    let point = |angle: f32, height: f32, radius: f32| [radius * angle.cos(), radius * angle.sin(), height];
    let jitter = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32 - 0.5;
    let place = |i: u32| {
        let (a, h) = ((i % AROUND) as f32 + 0.5 * jitter(i), (i / AROUND) as f32 + 0.5 * jitter(i + 7));
        point(a / AROUND as f32 * std::f32::consts::TAU, h / ALONG as f32 * 2.0, 0.2)
    };
    let positions: Vec<[f32; 3]> = (0..AROUND * ALONG).map(place).collect();
    let corner = |a: u32, h: u32| h * AROUND + a % AROUND;
    let quads = (0..ALONG - 1).flat_map(|h| (0..AROUND).map(move |a| (a, h)));
    let triangles = quads
        .flat_map(|(a, h)| {
            let [p, q, r, s] = [corner(a, h), corner(a + 1, h), corner(a + 1, h + 1), corner(a, h + 1)];
            [[p, q, r], [p, r, s]]
        })
        .collect();
    let joint = |j: u32| point(j as f32 * 2.4, (j as f32 + 0.5) / BONES as f32 * 2.0, 0.15);
    let segments: Vec<_> = (0..BONES).map(|j| [joint(j), point(j as f32 * 2.4, joint(j)[2] + 0.05, 0.15)]).collect();
    let parents = (0..BONES as i32).map(|j| if j == 0 { -1 } else { (j - 1) / 2 }).collect();
    let weights = nearest_two(&positions, &segments);
    Character { positions, triangles, weights, parents, segments }
}

fn nearest_two(positions: &[[f32; 3]], segments: &[[[f32; 3]; 2]]) -> Weights {
    let squared = |p: &[f32; 3], q: &[f32; 3]| p.iter().zip(q).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
    let (mut bones, mut values) = (Vec::new(), Vec::new());
    for p in positions {
        let mut near: Vec<(f32, u32)> = segments.iter().zip(0..).map(|(s, j)| (squared(p, &s[0]), j)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        bones.extend([near[0].1, near[1].1]);
        let share = near[1].0 / (near[0].0 + near[1].0);
        values.extend([share, 1.0 - share]);
    }
    let indptr = (0..=positions.len() as u32).map(|i| 2 * i).collect();
    Weights::new(indptr, bones, values, segments.len() as u32).unwrap()
}
