//! Tables of text.

use kdray::util::text::escape_controls;

/// Returns rows under a header, without trailing blanks. The first column is aligned to the left, the others to the
/// right. Control characters in cells are escaped, so that each row stays one line.
pub fn table<const N: usize>(header: [&str; N], rows: &[[String; N]]) -> String {
    let header = header.map(str::to_owned);
    let rows: Vec<_> = rows.iter().map(|row| row.each_ref().map(|cell| escape_controls(cell).into_owned())).collect();
    let lines = || std::iter::once(&header).chain(&rows);
    let width = |column: usize| lines().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let mut text = String::new();
    for line in lines() {
        let mut row = String::new();
        for (column, (cell, width)) in line.iter().zip(widths).enumerate() {
            match column {
                0 => row += &format!("{cell:<width$}"),
                _ => row += &format!("  {cell:>width$}"),
            }
        }
        text += row.trim_end();
        text.push('\n');
    }
    text
}

/// Returns a number with a fixed number of decimals, or a dash for none.
pub fn decimal(number: Option<f64>, decimals: usize) -> String {
    number.map_or_else(|| "-".to_owned(), |number| format!("{number:.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let rows = [["a".to_owned(), "1.50".to_owned()], ["süß".to_owned(), decimal(None, 1)]];
        assert_eq!(table(["of"], &[["a\nb\u{1b}".to_owned()]]), "of\na\\nb\\u{1b}\n");
        assert_eq!(table(["of", "ms"], &rows), "of     ms\na    1.50\nsüß     -\n");
    }
}
