//! Strictly convex quadratic programs on the simplex, solved exactly: the weights of one vertex.
//!
//! Primal active set: walk from face to face of the simplex, always downhill, each face solved by a Cholesky
//! factorisation on the stack. A penalty for negative weights and a clean-up afterwards (thesis 6.4.4) would be
//! neither feasible nor optimal.

/// A rounding bound on the multipliers, relative to the trace of H.
const MULTIPLIER_TOLERANCE: f64 = 4.0 * f64::EPSILON;

/// Minimise 1/2 w'Hw - g'w over w >= 0, sum w = `mass`. Only the first `n <= N` unknowns take part.
#[derive(Debug, Clone, Copy)]
pub struct SimplexQp<const N: usize> {
    /// H, symmetric positive definite; only the lower triangle is read.
    pub h: [[f64; N]; N],
    /// g.
    pub g: [f64; N],
    /// Number of unknowns.
    pub n: usize,
    /// What the unknowns sum to, more than zero.
    pub mass: f64,
}

impl<const N: usize> SimplexQp<N> {
    /// Takes a feasible start to the minimiser. Every step is downhill: the answer is never worse than the start.
    pub fn minimise(&self, w: &mut [f64; N]) {
        let mut face = self.face_of(w);
        let mut released = false;
        // A strictly convex problem visits no face twice; the bound only guards against rounding.
        for _ in 0..16 * N {
            let (goal, multiplier) = self.minimum_on(&face);
            let step = face.step_towards(&goal, w);
            if released && step == 0.0 {
                return;
            }
            if step < 1.0 {
                face = self.face_of(w);
                released = false;
                continue;
            }
            match self.best_release(&face, multiplier, w) {
                Some(unknown) => face.insert(unknown),
                None => return,
            }
            released = true;
        }
    }

    fn face_of(&self, w: &[f64; N]) -> Face<N> {
        let mut face = Face { members: [0; N], len: 0 };
        for i in (0..self.n.min(N)).filter(|&i| w[i] > 0.0) {
            face.insert(i);
        }
        face
    }

    fn entry(&self, i: usize, j: usize) -> f64 {
        self.h[i.max(j)][i.min(j)]
    }

    /// The minimiser on a face under the sum constraint alone, by position in the face, and that constraint's
    /// multiplier m: H w = g - m, so w = H^-1 g - m H^-1 1.
    #[inline]
    fn minimum_on(&self, face: &Face<N>) -> ([f64; N], f64) {
        let len = face.len.min(N);
        let mut l = [[0.0; N]; N]; // Cholesky factor; the diagonal holds the reciprocals
        let (mut a, mut b) = ([0.0; N], [0.0; N]);
        for i in 0..len {
            let row = face.members[i];
            let (mut pivot, mut x, mut y) = (self.h[row][row], self.g[row], 1.0);
            for j in 0..i {
                let known: f64 = l[i].iter().zip(&l[j]).take(j).map(|(x, y)| x * y).sum();
                let entry = (self.entry(row, face.members[j]) - known) * l[j][j];
                l[i][j] = entry;
                pivot -= entry * entry;
                x -= entry * a[j];
                y -= entry * b[j];
            }
            let reciprocal = 1.0 / pivot.max(f64::MIN_POSITIVE).sqrt();
            l[i][i] = reciprocal;
            a[i] = x * reciprocal;
            b[i] = y * reciprocal;
        }
        for i in (0..len).rev() {
            for k in i + 1..len {
                a[i] -= l[k][i] * a[k];
                b[i] -= l[k][i] * b[k];
            }
            a[i] *= l[i][i];
            b[i] *= l[i][i];
        }
        let multiplier = (a.iter().sum::<f64>() - self.mass) / b.iter().sum::<f64>();
        for i in 0..len {
            a[i] -= multiplier * b[i];
        }
        (a, multiplier)
    }

    /// The unknown held at zero whose release brings the objective down fastest, if any does.
    #[inline]
    fn best_release(&self, face: &Face<N>, multiplier: f64, w: &[f64; N]) -> Option<usize> {
        let trace: f64 = (0..self.n).map(|i| self.h[i][i]).sum();
        let (mut lowest, mut found) = (-MULTIPLIER_TOLERANCE * trace, None);
        for j in (0..self.n).filter(|&j| !face.members().contains(&j)) {
            let slope: f64 = face.members().iter().map(|&i| self.entry(i, j) * w[i]).sum();
            let bound_multiplier = slope - self.g[j] + multiplier;
            if bound_multiplier < lowest {
                (lowest, found) = (bound_multiplier, Some(j));
            }
        }
        found
    }
}

/// The unknowns that are not held at zero.
struct Face<const N: usize> {
    members: [usize; N],
    len: usize,
}

impl<const N: usize> Face<N> {
    fn insert(&mut self, unknown: usize) {
        self.members[self.len] = unknown;
        self.len += 1;
    }

    fn members(&self) -> &[usize] {
        &self.members[..self.len]
    }

    /// Moves `w` towards `goal` until a bound blocks, and says how much of the way it went.
    #[inline]
    fn step_towards(&self, goal: &[f64; N], w: &mut [f64; N]) -> f64 {
        let reach = |w: f64, x: f64| if x < 0.0 { w / (w - x) } else { 1.0 };
        let pairs = || self.members().iter().zip(goal);
        let step = pairs().map(|(&i, &x)| reach(w[i], x)).fold(1.0, f64::min);
        for (&i, &x) in pairs() {
            let blocks = x < 0.0 && reach(w[i], x) <= step;
            w[i] = if blocks { 0.0 } else { (w[i] + step * (x - w[i])).max(0.0) };
        }
        step
    }
}
