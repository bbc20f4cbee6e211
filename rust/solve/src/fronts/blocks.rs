//! How fronts lie in memory: rows in blocks of eight, each block by columns, so that every kernel reads straight streams.
//!
//! A front with k columns and m rows under them has a panel (its part of the factor) and an update (what its parent
//! receives). Element (i, p) of a row block is at `8 p + i`. Blocks of the two triangles hold only the columns up to their
//! diagonal; the last rows of a ragged block are zero.

/// Rows of a block: one cache line.
pub(crate) const BLOCK: usize = 8;
/// Work on the row blocks of one front (multiplications) worth a second thread.
pub(crate) const FORK: usize = 1 << 21;

/// Length of a lower triangle of `blocks` full row blocks, and so where row block `blocks` starts.
pub(crate) fn triangle_len(blocks: usize) -> usize {
    BLOCK * BLOCK * (blocks * (blocks + 1) / 2)
}

/// Length of the triangular part of a panel with `columns` columns.
pub(crate) fn diagonal_len(columns: usize) -> usize {
    match columns.div_ceil(BLOCK) {
        0 => 0,
        blocks => triangle_len(blocks - 1) + BLOCK * columns,
    }
}

/// Length of a panel.
pub(crate) fn panel_len(columns: usize, rows: usize) -> usize {
    diagonal_len(columns) + rows.div_ceil(BLOCK) * BLOCK * columns
}

/// Length of an update.
pub(crate) fn update_len(rows: usize) -> usize {
    triangle_len(rows.div_ceil(BLOCK))
}

/// Where element (row, column) of a panel lies, `row` counted from the first column.
pub(crate) fn panel_index(columns: usize, row: usize, column: usize) -> usize {
    if row < columns {
        triangle_len(row / BLOCK) + BLOCK * column + row % BLOCK
    } else {
        let below = row - columns;
        diagonal_len(columns) + below / BLOCK * BLOCK * columns + BLOCK * column + below % BLOCK
    }
}

/// Splits `count` row blocks from `first` on, each as long as its number but no longer than `most`, into halves of about
/// the same work; whole groups of three.
pub(crate) fn middle_row(first: usize, count: usize, most: usize) -> usize {
    let tenths = if first >= most {
        5
    } else if first == 0 {
        7
    } else {
        6
    };
    (count * tenths / 10 / 3 * 3).max(3)
}
