//! What is known of each vertex.

use crate::adjacency::{Islands, NONE};
use crate::error::{Error, Result};
use crate::weld::Weld;

/// What is known of one vertex. The rows themselves are given when solving, so that several sets of values share one
/// factorisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constraint {
    /// Nothing: the row is solved for.
    Free,
    /// The row is given and kept.
    Fixed,
    /// The row is pulled towards the given one: the energy has the term `b |w - s|^2`, b >= 0 being this confidence. It is
    /// a coefficient of the energy as it stands, so it contains the vertex's mass. 0 is the same as [`Self::Free`].
    Soft(f64),
}

impl Constraint {
    fn check(constraints: &[Self]) -> Result<()> {
        let bad = |c: &Self| matches!(c, Self::Soft(b) if !(b.is_finite() && *b >= 0.0));
        match constraints.iter().find(|&c| bad(c)) {
            Some(&Self::Soft(value)) => {
                Err(Error::InvalidParameter { name: "confidence", value, must: "must be a finite number, 0 or more" })
            }
            _ => Ok(()),
        }
    }

    /// Whether a row is given, and counts.
    pub fn is_known(self) -> bool {
        match self {
            Self::Free => false,
            Self::Fixed => true,
            Self::Soft(b) => b > 0.0,
        }
    }

    /// Both at once: a fixed row wins, confidences add up.
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Fixed, _) | (_, Self::Fixed) => Self::Fixed,
            (Self::Soft(a), Self::Soft(b)) => Self::Soft(a + b),
            (soft @ Self::Soft(_), Self::Free) | (Self::Free, soft) => soft,
        }
    }
}

/// The constraints of one problem: as they were given, and for each vertex of the welded mesh.
#[derive(Debug, Default)]
pub(super) struct Known {
    /// As given; empty without a weld.
    pub given: Vec<Constraint>,
    /// For each vertex of the mesh that is solved on.
    pub constraints: Vec<Constraint>,
    /// Which of those are solved for: not fixed, and on an island where something is known.
    pub unknown: Vec<bool>,
}

impl Known {
    /// Checks `given` (V), unites the constraints of vertices that are one, and decides who is solved for.
    pub fn new(given: Vec<Constraint>, weld: Option<&Weld>, islands: &Islands) -> Result<Self> {
        Constraint::check(&given)?;
        let (given, constraints) = match weld {
            None => (Vec::new(), given),
            Some(weld) => {
                let of_class = |c| weld.members(c).iter().map(|&i| given[i as usize]).reduce(Constraint::and);
                let of_classes = (0..weld.class_count()).map(|c| of_class(c).expect("no class is empty")).collect();
                (given, of_classes)
            }
        };
        let mut is_reached = vec![false; islands.count()];
        let with_islands = || std::iter::zip(islands.of_vertex(), &constraints);
        for (&island, _) in with_islands().filter(|&(&island, c)| island != NONE && c.is_known()) {
            is_reached[island as usize] = true;
        }
        let is_unknown = |(&island, &c): (&u32, &Constraint)| {
            c != Constraint::Fixed && island != NONE && is_reached[island as usize]
        };
        let unknown = with_islands().map(is_unknown).collect();
        Ok(Self { given, constraints, unknown })
    }

    /// The confidence in the row given for vertex `i` of the mesh that is solved on, 0 where none is.
    pub fn confidence(&self, i: u32) -> f64 {
        match self.constraints[i as usize] {
            Constraint::Soft(b) => b,
            Constraint::Free | Constraint::Fixed => 0.0,
        }
    }
}
