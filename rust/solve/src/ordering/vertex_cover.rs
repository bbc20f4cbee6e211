//! The fewest vertices that touch every edge of a bipartite graph: a maximum matching gives them (Koenig's theorem).

use std::collections::VecDeque;

const NONE: u32 = u32::MAX;

/// Minimum vertex cover of the graph whose left vertex `i` is joined to the right vertices
/// `edges[starts[i]..starts[i + 1]]`. Returns the left and the right vertices of the cover, ascending.
pub(crate) fn minimum_vertex_cover(starts: &[u32], edges: &[u32], right_count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut matching = Matching::new(starts, edges, right_count);
    matching.take_greedily();
    while matching.layer() {
        matching.augment();
    }
    matching.cover()
}

/// A matching grown by shortest augmenting paths (Hopcroft and Karp 1973).
struct Matching<'a> {
    starts: &'a [u32],
    edges: &'a [u32],
    partner_of_left: Vec<u32>,
    partner_of_right: Vec<u32>,
    /// Length of the shortest alternating path from a free left vertex, per left vertex.
    level: Vec<u32>,
    /// Next edge to try, per left vertex.
    next: Vec<u32>,
}

impl<'a> Matching<'a> {
    fn new(starts: &'a [u32], edges: &'a [u32], right_count: usize) -> Self {
        let left_count = starts.len() - 1;
        Self {
            starts,
            edges,
            partner_of_left: vec![NONE; left_count],
            partner_of_right: vec![NONE; right_count],
            level: vec![NONE; left_count],
            next: vec![0; left_count],
        }
    }

    fn neighbours(&self, left: usize) -> &'a [u32] {
        &self.edges[self.starts[left] as usize..self.starts[left + 1] as usize]
    }

    fn pair(&mut self, left: usize, right: usize) {
        self.partner_of_left[left] = right as u32;
        self.partner_of_right[right] = left as u32;
    }

    fn take_greedily(&mut self) {
        for left in 0..self.level.len() {
            let free = |&&right: &&u32| self.partner_of_right[right as usize] == NONE;
            if let Some(&right) = self.neighbours(left).iter().find(free) {
                self.pair(left, right as usize);
            }
        }
    }

    /// Measures alternating paths from all free left vertices; true if one of them ends at a free right vertex.
    fn layer(&mut self) -> bool {
        let mut queue: VecDeque<usize> = VecDeque::new();
        for left in 0..self.level.len() {
            self.level[left] = if self.partner_of_left[left] == NONE { 0 } else { NONE };
            if self.level[left] == 0 {
                queue.push_back(left);
            }
        }
        let mut found = false;
        while let Some(left) = queue.pop_front() {
            for &right in self.neighbours(left) {
                let partner = self.partner_of_right[right as usize];
                found |= partner == NONE;
                if partner != NONE && self.level[partner as usize] == NONE {
                    self.level[partner as usize] = self.level[left] + 1;
                    queue.push_back(partner as usize);
                }
            }
        }
        found
    }

    /// Follows disjoint paths of rising level to free right vertices and swaps the edges along each.
    fn augment(&mut self) {
        self.next.copy_from_slice(&self.starts[..self.level.len()]);
        let mut path: Vec<usize> = Vec::new();
        for root in 0..self.level.len() {
            if self.partner_of_left[root] != NONE {
                continue;
            }
            path.push(root);
            while let Some(&left) = path.last() {
                if self.next[left] == self.starts[left + 1] {
                    path.pop();
                    if let Some(&parent) = path.last() {
                        self.next[parent] += 1;
                    }
                    continue;
                }
                let right = self.edges[self.next[left] as usize] as usize;
                let partner = self.partner_of_right[right];
                if partner == NONE {
                    for left in path.drain(..).rev() {
                        self.pair(left, self.edges[self.next[left] as usize] as usize);
                    }
                } else if self.level[partner as usize] == self.level[left] + 1 {
                    path.push(partner as usize);
                } else {
                    self.next[left] += 1;
                }
            }
        }
    }

    /// Left vertices no alternating path reaches, and right vertices one does; `layer` must have found no free end.
    fn cover(&self) -> (Vec<u32>, Vec<u32>) {
        let mut reached = vec![false; self.partner_of_right.len()];
        for left in (0..self.level.len()).filter(|&left| self.level[left] != NONE) {
            self.neighbours(left).iter().for_each(|&right| reached[right as usize] = true);
        }
        let left = (0..self.level.len()).filter(|&left| self.level[left] == NONE);
        let right = (0..reached.len()).filter(|&right| reached[right]);
        (left.map(|i| i as u32).collect(), right.map(|i| i as u32).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Size of the smallest cover, by trying every set of left vertices.
    fn smallest(starts: &[u32], edges: &[u32], right_count: usize) -> usize {
        let left_count = starts.len() - 1;
        let size = |kept: u32| {
            let outside = (0..left_count).filter(|i| kept >> i & 1 == 0);
            let right: std::collections::BTreeSet<u32> =
                outside.flat_map(|i| &edges[starts[i] as usize..starts[i + 1] as usize]).copied().collect();
            kept.count_ones() as usize + right.len()
        };
        assert!(right_count < 32);
        (0..1u32 << left_count).map(size).min().unwrap()
    }

    #[test]
    fn covers_every_edge_with_the_fewest_vertices() {
        let mut state = 1u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) % below
        };
        for _ in 0..300 {
            let (left_count, right_count, density) = (random(9), 1 + random(9), 1 + random(9));
            let (mut starts, mut edges) = (vec![0], Vec::new());
            for _ in 0..left_count {
                edges.extend((0..right_count as u32).filter(|_| random(10) < density));
                starts.push(edges.len() as u32);
            }
            let (left, right) = minimum_vertex_cover(&starts, &edges, right_count as usize);
            for i in 0..left_count as usize {
                for right_vertex in &edges[starts[i] as usize..starts[i + 1] as usize] {
                    assert!(left.contains(&(i as u32)) || right.contains(right_vertex));
                }
            }
            assert_eq!(left.len() + right.len(), smallest(&starts, &edges, right_count as usize));
        }
    }
}
