//! Meshes for the tests: ordinary ones, and the list of degenerate ones that every operation must survive.

use glam::{DQuat, DVec3};

/// An owned mesh with a name.
#[derive(Clone)]
pub struct Fixture {
    pub name: &'static str,
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

impl Fixture {
    pub fn new(name: &'static str, positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        Self { name, positions, triangles }
    }

    /// Every position through `map`.
    pub fn mapped(&self, map: impl Fn(DVec3) -> DVec3) -> Self {
        let map = |p: &[f32; 3]| map(glam::Vec3::from(*p).as_dvec3()).as_vec3().to_array();
        Self { positions: self.positions.iter().map(map).collect(), ..self.clone() }
    }

    /// Both meshes as one, without a common vertex.
    pub fn joined(mut self, other: Self) -> Self {
        let offset = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + offset)));
        self
    }

    pub fn named(mut self, name: &'static str) -> Self {
        self.name = name;
        self
    }
}

/// A number in [0, 1) from two integers: jitter that is the same everywhere.
pub fn noise(a: u64, b: u64) -> f64 {
    let mut x = a.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ b.wrapping_mul(0xD1B5_4A32_D192_ED03);
    x ^= x >> 31;
    x = x.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x ^= x >> 29;
    (x >> 11) as f64 / (1u64 << 53) as f64
}

/// A tube along z, radius 1 to 1.3, height 4, jittered: `around` x `along` quads.
pub fn tube(around: usize, along: usize) -> Fixture {
    let position = |k: usize| {
        let (ring, spoke) = (k / around, k % around);
        let angle = (spoke as f64 + 0.3 * noise(k as u64, 1)) / around as f64 * std::f64::consts::TAU;
        let z = 4.0 * (ring as f64 + 0.3 * noise(k as u64, 2)) / along as f64;
        let radius = 1.0 + 0.3 * (3.0 * angle).sin() * z / 4.0;
        [(radius * angle.cos()) as f32, (radius * angle.sin()) as f32, z as f32]
    };
    let triangles = (0..along * around).flat_map(|k| {
        let (ring, spoke) = (k / around, k % around);
        let at = |r: usize, s: usize| (r * around + s % around) as u32;
        let [a, b] = [at(ring, spoke), at(ring, spoke + 1)];
        let [c, d] = [at(ring + 1, spoke), at(ring + 1, spoke + 1)];
        [[a, b, d], [a, d, c]]
    });
    Fixture::new("tube", (0..(along + 1) * around).map(position).collect(), triangles.collect())
}

/// A small button: a fan of six triangles at `centre`.
pub fn button(centre: [f64; 3], radius: f64) -> Fixture {
    let [x, y, z] = centre;
    let rim = |k: usize| {
        let angle = k as f64 / 6.0 * std::f64::consts::TAU;
        [(x + radius * angle.cos()) as f32, (y + radius * angle.sin()) as f32, z as f32]
    };
    let positions = std::iter::once([x as f32, y as f32, z as f32]).chain((0..6).map(rim)).collect();
    Fixture::new("button", positions, (0..6).map(|k| [0, 1 + k, 1 + (k + 1) % 6]).collect())
}

/// Bones and weights of one vertex.
pub type Row = (Vec<u32>, Vec<f32>);

/// The body all fixtures are dressed on: a tube whose weights slide from bone 0 (bottom) to bone 3 (top).
pub fn body() -> (Fixture, Vec<Row>) {
    let body = tube(24, 32);
    let row = |p: &[f32; 3]| {
        let s = (p[2] / 4.0 * 3.0).clamp(0.0, 2.999);
        let bone = s as u32;
        (vec![bone, bone + 1], vec![1.0 - (s - bone as f32), s - bone as f32])
    };
    let rows = body.positions.iter().map(row).collect();
    (body, rows)
}

/// A garment around the body: part of it near, the hem far out.
pub fn skirt() -> Fixture {
    let flare = |p: DVec3| {
        let out = 1.03 + 0.5 * (p.z - 2.0).max(0.0);
        DVec3::new(p.x * out, p.y * out, p.z)
    };
    tube(30, 40).mapped(flare).named("skirt")
}

/// Targets with everything that real files contain.
pub fn degenerate() -> Vec<Fixture> {
    let mut list = vec![body().0.named("target is the source"), skirt()];
    for scale in [0.01, 1.0, 100.0] {
        let far = button([0.0, 0.0, 0.0], scale).mapped(|p| p + DVec3::new(40.0 * scale, 0.0, 9.0));
        list.push(skirt().joined(far).named("second island without a match"));
    }
    let mut coincident = skirt();
    for i in 500..520 {
        coincident.positions[i] = coincident.positions[500];
    }
    list.push(coincident.named("coincident vertices"));
    let mut collinear = skirt();
    for t in collinear.triangles.clone().iter().skip(2000).step_by(7) {
        let [a, b] = [0, 1].map(|k| glam::Vec3::from(collinear.positions[t[k] as usize]));
        collinear.positions[t[2] as usize] = a.midpoint(b).to_array();
    }
    list.push(collinear.named("zero-area triangles"));
    let mut tiny_edge = skirt();
    let [i, j] = [tiny_edge.triangles[2200][0] as usize, tiny_edge.triangles[2200][1] as usize];
    tiny_edge.positions[j] = tiny_edge.positions[i];
    tiny_edge.positions[j][2] += 1e-9;
    list.push(tiny_edge.named("an edge of 1e-9"));
    list.push(skirt().mapped(|p| DVec3::new(p.x, p.y, 2.0 + (p.z - 2.0) * 1e-4)).joined(skirt()).named("slivers"));
    let mut fin = skirt();
    fin.positions.push([3.0, 3.0, 3.0]);
    let [a, b, _] = fin.triangles[2100];
    fin.triangles.push([a, b, fin.positions.len() as u32 - 1]);
    list.push(fin.named("a fin"));
    let mut duplicated = skirt();
    let [a, b, c] = duplicated.triangles[2100];
    duplicated.triangles.extend([[a, b, c], [b, a, c], [a, a, c]]);
    list.push(duplicated.named("duplicated and repeated-index faces"));
    let mut loose = skirt();
    loose.positions.extend([[1.5, 0.0, 1.0], [100.0, 0.0, 1.0]]);
    list.push(loose.named("unreferenced vertices"));
    let one = Fixture::new("one triangle", vec![[1.0, 0.0, 1.0], [1.0, 0.2, 1.0], [1.0, 0.0, 1.2]], vec![[0, 1, 2]]);
    list.push(
        one.clone().joined(Fixture { positions: vec![[1.0, 0.0, 2.0]; 3], ..one.clone() }).named("a point island"),
    );
    list.push(one);
    list
}

/// A rotation, a translation, both exactly undone by nothing: a rigid motion for invariance tests.
pub fn rigid_motion(p: DVec3) -> DVec3 {
    DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.3) * p + DVec3::new(3.0, -2.0, 0.5)
}
