//! Bones above bones.

/// All bones, each after its parent and as the input has them otherwise. `parents` (B) are negative for roots.
///
/// # Errors
/// A bone whose parents lead in a circle or to a bone that is not there.
pub(crate) fn parents_first(parents: &[i32]) -> Result<Vec<usize>, usize> {
    let depth = |bone: usize| {
        let mut above = bone;
        for depth in 0..=parents.len() {
            match usize::try_from(*parents.get(above).ok_or(bone)?) {
                Ok(parent) => above = parent,
                Err(_) => return Ok(depth),
            }
        }
        Err(bone)
    };
    let depths = (0..parents.len()).map(depth).collect::<Result<Vec<usize>, usize>>()?;
    let mut order: Vec<usize> = (0..parents.len()).collect();
    order.sort_by_key(|&bone| depths[bone]);
    Ok(order)
}

#[cfg(test)]
mod tests {
    use super::parents_first;

    #[test]
    fn parents_come_first_and_circles_are_found() {
        assert_eq!(parents_first(&[2, -1, 1, 1]), Ok(vec![1, 2, 3, 0]));
        assert_eq!(parents_first(&[]), Ok(vec![]));
        assert_eq!(parents_first(&[-1, 2, 1]), Err(1));
        assert_eq!(parents_first(&[0]), Err(0));
        assert_eq!(parents_first(&[-1, 7]), Err(1));
    }
}
