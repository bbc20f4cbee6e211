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
    /// H, symmetric positive definite.
    pub h: [[f64; N]; N],
    /// g.
    pub g: [f64; N],
    /// Number of unknowns.
    pub n: usize,
    /// What the unknowns sum to, more than zero.
    pub mass: f64,
}

/// A face of the simplex: which unknowns are not held at zero.
type Face<const N: usize> = [bool; N];

impl<const N: usize> SimplexQp<N> {
    /// Takes a feasible start (zero beyond `n`) to the minimiser. Every step is downhill: the answer is never worse than
    /// the start.
    pub fn minimise(&self, w: &mut [f64; N]) {
        let mut face = self.face_of(w);
        let mut released = false;
        // A strictly convex problem visits no face twice; the bound only guards against rounding.
        for _ in 0..16 * N {
            let (goal, multiplier) = self.minimum_on(&face);
            let step = step_towards(&goal, &face, w);
            if released && step == 0.0 {
                return;
            }
            if step < 1.0 {
                face = self.face_of(w);
                released = false;
                continue;
            }
            match self.best_release(&face, multiplier, w) {
                Some(unknown) => face[unknown] = true,
                None => return,
            }
            released = true;
        }
    }

    fn face_of(&self, w: &[f64; N]) -> Face<N> {
        std::array::from_fn(|i| i < self.n && w[i] > 0.0)
    }

    /// The minimiser on a face under the sum constraint alone, and that constraint's multiplier m:
    /// H w = g - m, so w = H^-1 g - m H^-1 1.
    ///
    /// Unknowns off the face get rows of the identity instead of being left out: no index is looked up, and the
    /// compiler unrolls everything for small N. The factorisation is the root-free one, H = L D L'.
    #[inline]
    fn minimum_on(&self, face: &Face<N>) -> ([f64; N], f64) {
        let on_face: [f64; N] = face.map(|free| f64::from(u8::from(free)));
        let mut l = [[0.0; N]; N]; // below the diagonal L, on it 1 / D
        let (mut a, mut b) = ([0.0; N], on_face);
        for i in (0..N).filter(|&i| face[i]) {
            let mut scaled = [0.0; N]; // row i of L D
            for j in 0..i {
                let known: f64 = (0..j).map(|k| scaled[k] * l[j][k]).sum();
                scaled[j] = on_face[j] * self.h[i][j] - known;
            }
            let mut pivot = self.h[i][i];
            a[i] = self.g[i];
            for k in 0..i {
                l[i][k] = scaled[k] * l[k][k];
                pivot -= scaled[k] * l[i][k];
                a[i] -= l[i][k] * a[k];
                b[i] -= l[i][k] * b[k];
            }
            l[i][i] = 1.0 / pivot.max(f64::MIN_POSITIVE);
        }
        for i in (0..N).rev() {
            a[i] *= l[i][i];
            b[i] *= l[i][i];
            for k in i + 1..N {
                a[i] -= l[k][i] * a[k];
                b[i] -= l[k][i] * b[k];
            }
        }
        let multiplier = (a.iter().sum::<f64>() - self.mass) / b.iter().sum::<f64>();
        (std::array::from_fn(|i| a[i] - multiplier * b[i]), multiplier)
    }

    /// The unknown held at zero whose release brings the objective down fastest, if any does.
    #[inline]
    fn best_release(&self, face: &Face<N>, multiplier: f64, w: &[f64; N]) -> Option<usize> {
        let trace: f64 = (0..N).map(|i| self.h[i][i]).sum();
        let (mut lowest, mut found) = (-MULTIPLIER_TOLERANCE * trace, None);
        for (j, (row, g)) in self.h.iter().zip(self.g).enumerate() {
            let slope: f64 = row.iter().zip(w).map(|(h, w)| h * w).sum();
            let bound_multiplier = slope - g + multiplier;
            if bound_multiplier < lowest && j < self.n && !face[j] {
                (lowest, found) = (bound_multiplier, Some(j));
            }
        }
        found
    }
}

/// Moves `w` towards `goal` until a bound blocks, and says how much of the way it went.
#[inline]
fn step_towards<const N: usize>(goal: &[f64; N], face: &Face<N>, w: &mut [f64; N]) -> f64 {
    let reach: [f64; N] = std::array::from_fn(|i| if face[i] && goal[i] < 0.0 { w[i] / (w[i] - goal[i]) } else { 1.0 });
    let step = reach.iter().copied().fold(1.0, f64::min);
    for i in 0..N {
        let blocks = face[i] && goal[i] < 0.0 && reach[i] <= step;
        if face[i] {
            w[i] = if blocks { 0.0 } else { (w[i] + step * (goal[i] - w[i])).max(0.0) };
        }
    }
    step
}
