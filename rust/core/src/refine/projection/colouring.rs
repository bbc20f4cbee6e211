//! Colours, so that constraints of one share no particle and sixteen can be projected side by side.

/// Colours there are. Constraints for which none is left are projected one by one.
const MOST: u32 = 128;
/// The colour of those.
pub(super) const NONE: u8 = u8::MAX;

/// The colour of every constraint. Any subset of the constraints may keep its colours.
#[derive(Debug, Clone, Default)]
pub struct Colouring(pub(super) Vec<u8>);

impl Colouring {
    /// Of constraints over one particle each, all different.
    pub fn single(count: usize) -> Self {
        Self(vec![0; count])
    }

    /// Greedy: each constraint in turn gets the smallest colour that none of its particles has.
    pub fn new<const N: usize>(constraints: &[[u32; N]], particle_count: usize) -> Self {
        let mut taken = vec![0u128; particle_count];
        let colour = |particles: &[u32; N]| {
            let used = particles.iter().fold(0, |used, &p| used | taken[p as usize]);
            let colour = used.trailing_ones();
            if colour == MOST {
                return NONE;
            }
            particles.iter().for_each(|&p| taken[p as usize] |= 1 << colour);
            colour as u8
        };
        Self(constraints.iter().map(colour).collect())
    }
}
