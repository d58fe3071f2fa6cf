//! The colours that ZBrush writes into comments of OBJ files, in blocks `#MRGB`. A block has eight hexadecimal digits
//! for each point, in the order of the points: a mask, which is not shown, then red, green and blue.

/// Begins the comments with the colours.
const KEYWORD: &str = "#MRGB ";
/// Number of hexadecimal digits of a point.
const N_DIGITS: usize = 8;

/// Returns the text of an OBJ file with the colours in its comments behind the coordinates of its points, line by line.
/// Any other file, and one whose points have colours already, stays as it is.
pub fn with_polypaint(text: String) -> String {
    if !text.contains(KEYWORD) {
        return text;
    }
    let Some(colours) = colours(&text) else { return text };
    let mut painted = String::with_capacity(text.len() + 24 * colours.len());
    let mut colours = colours.iter();
    for line in text.split_inclusive('\n') {
        let point = line.trim_end();
        match colours.as_slice().first().filter(|_| is_plain_point(point)) {
            Some([r, g, b]) => {
                colours.next();
                let [r, g, b] = [r, g, b].map(|part| f32::from(*part) / 255.0);
                painted.push_str(&format!("{point} {r} {g} {b}{}", &line[point.len()..]));
            }
            None => painted.push_str(line),
        }
    }
    painted
}

/// Returns the colours in the comments, or `None` if there are not as many as points.
fn colours(text: &str) -> Option<Vec<[u8; 3]>> {
    let mut colours = Vec::new();
    for digits in text.lines().filter_map(|line| line.strip_prefix(KEYWORD)) {
        for point in digits.trim().as_bytes().chunks(N_DIGITS) {
            let value = u32::from_str_radix(std::str::from_utf8(point).ok()?, 16).ok()?;
            let [_, r, g, b] = value.to_be_bytes();
            colours.push([r, g, b]);
        }
    }
    let n_points = text.lines().filter(|line| is_plain_point(line.trim_end())).count();
    (colours.len() == n_points).then_some(colours)
}

/// Returns whether a line is a point without a colour.
fn is_plain_point(line: &str) -> bool {
    line.starts_with("v ") && line.split_ascii_whitespace().count() == 4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_follow_the_points() {
        let file = "#MRGB of ZBrush\nv 0 0 0\r\nv 1 0 0\n#MRGB ff0000FFFF\n#MRGB ffff00\nf 1 2 1\n";
        // Neither the comment nor blocks of 12 digits (1.5 points) count.
        assert_eq!(with_polypaint(file.to_owned()), file);
        let file = "# MRGB\nv 0 0 0\r\nv 1 0 0\n#MRGB FF0000FF80ff0033\nf 1 2 1";
        let painted = "# MRGB\nv 0 0 0 0 0 1\r\nv 1 0 0 1 0 0.2\n#MRGB FF0000FF80ff0033\nf 1 2 1";
        assert_eq!(with_polypaint(file.to_owned()), painted);
    }

    #[test]
    fn files_without_a_colour_for_each_point_stay_as_they_are() {
        for file in
            ["v 0 0 0\nv 1 0 0\n#MRGB FF0000FF\n", "v 0 0 0\n#MRGB xyxyxyxy\n", "v 0 0 0 1 1 1\n#MRGB FF0000FF\n"]
        {
            assert_eq!(with_polypaint(file.to_owned()), file);
        }
    }
}
