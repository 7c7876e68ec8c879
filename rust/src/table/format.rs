//! Columns of numbers to lines of text.

/// Append one line per row to `out`, fields separated by commas, every number in the fewest digits that read back to the
/// same number. NaN, a value that is not there, becomes an empty field.
///
/// # Panics
/// If the columns differ in length.
pub fn format_rows(columns: &[&[f64]], out: &mut Vec<u8>) {
    let rows = columns.first().map_or(0, |column| column.len());
    assert!(columns.iter().all(|column| column.len() == rows), "columns of one length");
    let mut digits = ryu::Buffer::new();
    for row in 0..rows {
        for (index, column) in columns.iter().enumerate() {
            if index > 0 {
                out.push(b',');
            }
            let number = column[row];
            if !number.is_nan() {
                out.extend_from_slice(digits.format(number).as_bytes());
            }
        }
        out.push(b'\n');
    }
}
