//! Exact Euclidean distance to the nearest obstacle cell, up to a reach.
//!
//! The squared distance separates into a pass along columns and a minimum along rows. Planning only
//! asks about distances of a few cells, so the row pass is a minimum over a fixed window, which the
//! compiler vectorises: 1.5 million cells take a few milliseconds, less than a lower-envelope
//! transform of unlimited reach.

/// Longest reach, cells. Its square still fits `u16` twice.
pub(super) const MAX_REACH_CELLS: usize = 128;

/// Squared distances, in cells, from every cell's centre to the centre of the nearest obstacle cell
/// of a row-major grid `width` cells wide. Exact where the distance is at most `reach` cells (at
/// most [`MAX_REACH_CELLS`]); everything farther gets `(reach + 1)²`.
pub(super) fn squared_clearance(obstacle: &[bool], width: usize, reach: usize) -> Vec<u16> {
    let reach = reach.min(MAX_REACH_CELLS);
    let far = (reach + 1) as u16;
    if width == 0 || obstacle.is_empty() {
        return Vec::new();
    }

    // Cells to the nearest obstacle of the same column, downwards then upwards.
    let mut column: Vec<u16> = obstacle.iter().map(|&is_obstacle| if is_obstacle { 0 } else { far }).collect();
    let rows = column.len() / width;
    for row in 1..rows {
        let (before, here) = column.split_at_mut(row * width);
        relax(&mut here[..width], &before[(row - 1) * width..]);
    }
    for row in (0..rows.saturating_sub(1)).rev() {
        let (here, after) = column.split_at_mut((row + 1) * width);
        relax(&mut here[row * width..], &after[..width]);
    }
    column.iter_mut().for_each(|cells| *cells *= *cells);

    // Along a row: the least of column distance and offset, squared and added.
    let mut padded = vec![far * far; width + 2 * reach];
    let mut squared = column;
    for row in squared.chunks_exact_mut(width) {
        if row.iter().all(|&value| value == far * far) {
            continue;
        }
        padded[reach..reach + width].copy_from_slice(row);
        for offset in 1..=reach {
            let add = (offset * offset) as u16;
            let left = &padded[reach - offset..reach - offset + width];
            let right = &padded[reach + offset..reach + offset + width];
            for ((value, &from_left), &from_right) in row.iter_mut().zip(left).zip(right) {
                *value = (*value).min(from_left.min(from_right) + add);
            }
        }
        row.iter_mut().for_each(|value| {
            if usize::from(*value) > reach * reach {
                *value = far * far;
            }
        });
    }
    squared
}

fn relax(row: &mut [u16], neighbour: &[u16]) {
    for (value, &beside) in row.iter_mut().zip(neighbour) {
        *value = (*value).min(beside + 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equals_the_definition(
            width in 1_usize..30,
            reach in 1_usize..12,
            obstacle in prop::collection::vec(prop::bool::weighted(0.03), 0..400),
        ) {
            let rows = obstacle.len() / width;
            let obstacle = &obstacle[..rows * width];
            let squared = squared_clearance(obstacle, width, reach);
            prop_assert_eq!(squared.len(), obstacle.len());
            for (index, &value) in squared.iter().enumerate() {
                let nearest = (0..obstacle.len())
                    .filter(|&other| obstacle[other])
                    .map(|other| {
                        let (dx, dy) = ((other % width).abs_diff(index % width), (other / width).abs_diff(index / width));
                        dx * dx + dy * dy
                    })
                    .min()
                    .filter(|&nearest| nearest <= reach * reach)
                    .unwrap_or((reach + 1) * (reach + 1));
                prop_assert_eq!(usize::from(value), nearest);
            }
        }
    }
}
