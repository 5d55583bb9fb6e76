//! How many labels inputs may have.

/// Most label values, rows times label columns: every row has a value, possibly empty, for each.
pub const MAX_CELLS: usize = 1 << 24;
/// Bytes of labels that all rows together may hold (1 GiB): the names of columns and, in a tar, the values as
/// well, since one member may label many recordings.
pub const MAX_LABEL_BYTES: usize = 1 << 30;

/// Refuses tables that would not fit in memory: of so many rows and label columns, whose names have so many
/// bytes.
pub fn require_cells(rows: usize, columns: usize, names: usize) -> Result<(), String> {
    if rows.saturating_mul(columns) > MAX_CELLS {
        return Err(format!(
            "{rows} rows with {columns} label columns are too many: at most {MAX_CELLS} label values"
        ));
    }
    if rows.saturating_mul(names) > MAX_LABEL_BYTES {
        return Err(format!(
            "the names of the label columns have {names} bytes, too many for {rows} rows: names times rows may \
             have {MAX_LABEL_BYTES} bytes; shorten the names"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_that_memory_should_not_hold_are_refused() {
        assert_eq!(require_cells(1_000_000, 16, 200), Ok(()));
        let many = require_cells(MAX_CELLS, 2, 2).unwrap_err();
        assert!(many.contains("at most 16777216 label values"), "{many}");
        // 1.2 MB of text took a gigabyte.
        let long = require_cells(1_100, 1, 1_000_000).unwrap_err();
        assert!(long.contains("1000000 bytes, too many for 1100 rows"), "{long}");
    }
}
