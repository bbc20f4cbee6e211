//! An order in which neighbouring constraints share no particle, so that eight can be projected side by side.

/// Colours beyond this many are one: their constraints are projected one by one.
const MOST: u32 = 128;
/// A colour with fewer constraints is not worth a batch.
const SMALLEST: usize = 64;

/// Constraints over `N` particles, sorted into batches without a shared particle, then a tail to be taken one by one.
#[derive(Debug, Clone, Default)]
pub struct Colouring {
    /// Constraints in their new order.
    pub order: Vec<u32>,
    /// Ends of the batches in `order`; what comes after the last is the tail.
    pub ends: Vec<u32>,
}

impl Colouring {
    /// Greedy: each constraint in turn gets the smallest colour that none of its particles has.
    pub fn new<const N: usize>(constraints: &[[u32; N]], particle_count: usize) -> Self {
        let mut taken = vec![0u128; particle_count];
        let mut colours: Vec<Vec<u32>> = Vec::new();
        let mut tail = Vec::new();
        for (k, particles) in constraints.iter().enumerate() {
            let used = particles.iter().fold(0, |used, &p| used | taken[p as usize]);
            let colour = used.trailing_ones();
            if colour == MOST {
                tail.push(k as u32);
                continue;
            }
            particles.iter().for_each(|&p| taken[p as usize] |= 1 << colour);
            if colours.len() <= colour as usize {
                colours.push(Vec::new());
            }
            colours[colour as usize].push(k as u32);
        }
        Self::from_colours(colours, tail)
    }

    fn from_colours(colours: Vec<Vec<u32>>, overflow: Vec<u32>) -> Self {
        let mut colouring = Self::default();
        let mut tail = Vec::new();
        for colour in colours {
            if colour.len() < SMALLEST {
                tail.extend(colour);
                continue;
            }
            colouring.order.extend(colour);
            colouring.ends.push(colouring.order.len() as u32);
        }
        tail.extend(overflow);
        colouring.order.extend(tail);
        colouring
    }

    /// What is left of the order when only the constraints that `keep` accepts take part.
    pub fn filtered(&self, keep: impl Fn(u32) -> bool) -> Self {
        let mut filtered = Self::default();
        let mut from = 0;
        for &end in self.ends.iter().chain([&(self.order.len() as u32)]) {
            filtered.order.extend(self.order[from..end as usize].iter().copied().filter(|&k| keep(k)));
            filtered.ends.push(filtered.order.len() as u32);
            from = end as usize;
        }
        filtered.ends.pop();
        filtered
    }
}
