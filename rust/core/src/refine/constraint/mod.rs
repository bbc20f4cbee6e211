//! The constraints of extended position-based dynamics, one per file: value and gradients as pure functions.
//!
//! N. H. Abu Rumman, M. Fratarcangeli: Position-based skinning for soft articulated characters (Computer Graphics Forum
//! 34(6), 2015) and its extension to five constraints, projected with compliance (M. Macklin, M. Müller, N. Chentanez:
//! XPBD. Motion in Games 2016): lambda grows by -(C + alpha lambda) / (sum of w |gradient|^2 + alpha).

mod bind;
mod energy;
mod self_collision;
mod stretch;
mod volume;

pub use bind::{Axis, bind};
#[cfg(test)]
pub use energy::energy;
pub use energy::project_energy;
pub use self_collision::{HalfSpace, self_collision};
pub use stretch::project_stretch;
#[cfg(test)]
pub use stretch::stretch;
pub use volume::volume;

use super::number::{Number, Vector, dot, scaled};

/// A constraint's value and its gradient at each of its `N` points.
#[derive(Debug, Clone, Copy)]
pub struct Constraint<T, const N: usize> {
    /// Zero where the constraint holds.
    pub value: T,
    /// Derivatives of the value with respect to the points.
    pub gradient: [Vector<T>; N],
}

/// What projecting a constraint changes.
#[derive(Debug, Clone, Copy)]
pub struct Projection<T, const N: usize> {
    /// By how much each point moves.
    pub moves: [Vector<T>; N],
    /// By how much the multiplier grows.
    pub multiplier: T,
}

impl<T: Number, const N: usize> Constraint<T, N> {
    /// One step of XPBD for points of inverse mass `w`, with compliance `alpha` and the multiplier so far.
    #[inline(always)]
    pub fn project(&self, w: [T; N], alpha: T, multiplier: T) -> Projection<T, N> {
        let mut sum = alpha + alpha.constant(1e-20);
        for k in 0..N {
            sum = sum + w[k] * dot(self.gradient[k], self.gradient[k]);
        }
        let step = -(self.value + alpha * multiplier) / sum;
        let mut moves = self.gradient;
        for k in 0..N {
            moves[k] = scaled(moves[k], w[k] * step);
        }
        Projection { moves, multiplier: step }
    }
}
