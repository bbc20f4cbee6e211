//! What each policy gives to one island.

use super::super::source::merge_and_normalise;
use super::Scene;
use crate::fill::Row;

/// What an island of the target without any match gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IslandPolicy {
    /// The whole island takes one row, from the nearest point of the garment around it: buttons, belts, pockets.
    Bridge,
    /// Each vertex takes its own closest point's weights: soft parts that lie on the body.
    Nearest,
    /// The whole island takes the mean of its closest points' rows, near ones counting more: buckles, plates.
    Rigid,
    /// Left without weights and reported.
    Skip,
}

impl IslandPolicy {
    /// All policies, for tests and menus.
    pub const ALL: [Self; 4] = [Self::Bridge, Self::Nearest, Self::Rigid, Self::Skip];

    /// What this policy gives to an island of `members`.
    pub(super) fn answer(self, scene: &Scene<'_>, members: &[u32]) -> Answer {
        match self {
            Self::Bridge => Answer::Hang,
            Self::Nearest => Answer::own_points(scene.mean_row(members)),
            Self::Rigid => Answer::one_row(scene.mean_row(members)),
            Self::Skip => Answer::Nothing,
        }
    }
}

/// The weights of one island.
#[derive(Debug)]
pub(super) enum Answer {
    /// Each vertex takes its closest point's weights, or this row where that point has none.
    OwnPoints(Row),
    /// One row for all.
    OneRow(Row),
    /// To be hung on the garment around it: by policy, or because the source has no weights there.
    Hang,
    /// One row, from the garment around it.
    Hung(Row),
    /// Left without weights.
    Nothing,
}

impl Answer {
    fn own_points(mean: Row) -> Self {
        if mean.is_empty() { Self::Hang } else { Self::OwnPoints(mean) }
    }

    fn one_row(mean: Row) -> Self {
        if mean.is_empty() { Self::Hang } else { Self::OneRow(mean) }
    }

    /// The policy that gave it.
    pub(super) fn given_by(&self, asked: IslandPolicy) -> IslandPolicy {
        if matches!(self, Self::Hang | Self::Hung(_)) { IslandPolicy::Bridge } else { asked }
    }

    /// Appends the row of vertex `i` of the island.
    pub(super) fn append_row(&self, scene: &Scene<'_>, i: usize, row: &mut Row) {
        if let Self::OwnPoints(_) = self {
            scene.source.blend(&scene.points[i], row);
        }
        match self {
            Self::OwnPoints(one) | Self::OneRow(one) | Self::Hung(one) if row.is_empty() => row.extend(one),
            _ => {}
        }
    }
}

impl Scene<'_> {
    /// Mean of the closest points' rows, each weighing 1 / (distance + 0.001 of the source's diagonal).
    fn mean_row(&self, members: &[u32]) -> Row {
        let mut mean = Row::new();
        for &i in members {
            let point = &self.points[i as usize];
            let share = 1.0 / (point.distance + 1e-3 * self.source.diagonal()).max(f64::MIN_POSITIVE.sqrt());
            let start = mean.len();
            self.source.blend(point, &mut mean);
            mean[start..].iter_mut().for_each(|(_, value)| *value *= share);
            if mean.len() > 4096 {
                merge(&mut mean);
            }
        }
        merge_and_normalise(&mut mean, 0);
        mean
    }
}

/// Merges equal bones without changing the row's sum.
fn merge(row: &mut Row) {
    let sum: f64 = row.iter().map(|&(_, value)| value).sum();
    merge_and_normalise(row, 0);
    row.iter_mut().for_each(|(_, value)| *value *= sum);
}
