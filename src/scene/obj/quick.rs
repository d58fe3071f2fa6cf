//! The quick way to rewrite an OBJ file for tobj. It reads no numbers but indices, and takes what nearly all programs
//! write: points without colours, and indices in range. Whatever else a file has is left to [`clean`](super::clean),
//! which also says what is wrong with a file.

use super::clean::{CleanObj, Cleaner, Corner, split_keyword, statements};

/// Rewrites the text of an OBJ file as [`clean_obj`](super::clean::clean_obj) does, but without a look at the numbers
/// of points, normals and texture coordinates, and with their spelling and their gaps as they are. Returns `None` for
/// a file that has anything else than is usual.
pub fn quick_obj(text: &str) -> Option<CleanObj> {
    let mut quick = Quick::default();
    for (line, statement) in statements(text) {
        let (keyword, rest) = split_keyword(&statement);
        match keyword {
            "v" | "vn" => quick.numbers(keyword, rest, 3)?,
            "vt" => quick.numbers(keyword, rest, 2)?,
            "f" => quick.face(rest)?,
            _ => quick.cleaner.statement(line, &statement).ok()?,
        }
    }
    quick.cleaned()
}

#[derive(Default)]
struct Quick {
    cleaner: Cleaner,
    /// The greatest indices of corners: of a position, texture coordinates and a normal.
    greatest: [usize; 3],
}

impl Quick {
    /// Adds a point, a normal or texture coordinates, which have `n_numbers` numbers. Texture coordinates may have a
    /// third number, which is ignored.
    fn numbers(&mut self, keyword: &str, rest: &str, n_numbers: usize) -> Option<()> {
        let n_words = n_words_of(rest.as_bytes())?;
        let is_number = |word: &str| word.parse::<f32>().is_ok_and(f32::is_finite);
        let is_usual =
            n_words == n_numbers || keyword == "vt" && n_words == 3 && rest.split_whitespace().all(is_number);
        if !is_usual {
            return None;
        }
        let out = self.cleaner.element(keyword);
        out.push_str(keyword);
        out.push(' ');
        out.push_str(rest);
        out.push('\n');
        Some(())
    }

    fn face(&mut self, rest: &str) -> Option<()> {
        let seen = self.cleaner.seen();
        let corners = self.cleaner.begin_face();
        let bytes = rest.as_bytes();
        let mut at = 0;
        while at < bytes.len() {
            let corner = corner(bytes, &mut at, seen)?;
            for (greatest, ix) in self.greatest.iter_mut().zip([Some(corner.0), corner.1, corner.2]) {
                *greatest = (*greatest).max(ix.unwrap_or(0));
            }
            corners.push(corner);
            while at < bytes.len() && matches!(bytes[at], b' ' | b'\t') {
                at += 1;
            }
        }
        self.cleaner.end_face().ok()
    }

    /// Returns the rewritten file if it has all elements that its faces name.
    fn cleaned(self) -> Option<CleanObj> {
        let Self { cleaner, greatest } = self;
        let are_there = greatest.iter().zip(cleaner.seen()).all(|(greatest, n)| *greatest <= n);
        are_there.then(|| cleaner.finish())
    }
}

/// Returns the number of words, or `None` if there is a comment or a character beyond ASCII.
fn n_words_of(bytes: &[u8]) -> Option<usize> {
    let (mut n_words, mut is_in_word) = (0, false);
    for &byte in bytes {
        if byte == b'#' || !byte.is_ascii() {
            return None;
        }
        let is_gap = byte.is_ascii_whitespace();
        n_words += usize::from(!is_gap && !is_in_word);
        is_in_word = !is_gap;
    }
    Some(n_words)
}

/// Reads a corner of a face: `v`, `v/vt`, `v//vn` or `v/vt/vn`, up to a gap or the end. `seen`: the numbers of elements
/// so far, from which negative indices count back.
fn corner(bytes: &[u8], at: &mut usize, seen: [usize; 3]) -> Option<Corner> {
    let position = index(bytes, at, seen[0])?;
    let (mut texcoord, mut normal) = (None, None);
    if bytes.get(*at) == Some(&b'/') {
        *at += 1;
        if bytes.get(*at) != Some(&b'/') {
            texcoord = Some(index(bytes, at, seen[1])?);
        }
        if bytes.get(*at) == Some(&b'/') {
            *at += 1;
            normal = Some(index(bytes, at, seen[2])?);
        }
    }
    matches!(bytes.get(*at), None | Some(b' ' | b'\t')).then_some((position, texcoord, normal))
}

/// Reads an index, and returns it absolute and counted from 1.
fn index(bytes: &[u8], at: &mut usize, seen: usize) -> Option<usize> {
    let is_negative = bytes.get(*at) == Some(&b'-');
    *at += usize::from(is_negative);
    let first = *at;
    let mut value = 0;
    while let Some(digit) = bytes.get(*at).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
        // An index that wraps has more digits than are accepted below.
        value = usize::wrapping_mul(value, 10).wrapping_add(usize::from(digit));
        *at += 1;
    }
    // More digits could overflow.
    if !(1..=18).contains(&(*at - first)) {
        return None;
    }
    let index = if is_negative { (seen + 1).checked_sub(value)? } else { value };
    (index > 0).then_some(index)
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;
    use crate::scene::obj::clean::clean_obj;

    fn text(clean: &CleanObj) -> String {
        let mut text = String::new();
        clean.text().read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn both_ways_give_the_same_text() {
        let file = [
            "# made by hand\nmtllib a.mtl\no thing\nv 0 0 0\nv 1.5 0 -2e-3\r\nv 1 1 0\nv 0 1 0\nvt 0 1\nvt 1 1 0.5\n",
            "vn 0 0 1\ng part\nusemtl red\nf 1 2 3\ns off\nf -4 -3 -2 -1\nf 1/1 2/2 3/-1 \nf 1//1 2//1 3//-1\n",
            "usemtl blue\nf 1/1/1 2/2/1 4/2/1\nf 1/1/1 2 3\nl 1 2\nwhat 3\n",
        ]
        .concat();
        let (quick, careful) = (quick_obj(&file).unwrap(), clean_obj(&file, glam::DVec3::ZERO).unwrap());
        assert_eq!(text(&quick).replace("vt 1 1 0.5", "vt 1 1"), text(&careful));
        assert_eq!((&quick.libraries, &quick.used_materials), (&careful.libraries, &careful.used_materials));
        assert_eq!((quick.size, quick.colour_scale, &quick.unknown), (careful.size, 1.0, &careful.unknown));
    }

    #[test]
    fn what_is_unusual_is_left_to_the_careful_way() {
        let start = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
        assert!(quick_obj(&format!("{start}f 1 2 3\n")).is_some());
        for unusual in [
            "v 0 0 0 1 1 1",
            "v 0 0 0 1",
            "v 0 0",
            "v 0 0 0 # a comment",
            "vn 0 0",
            "vt 0",
            "vt 0 0 nan",
            "vt 0 0 x",
            "f 1 2",
            "f 1 2 4",
            "f 1 2 0",
            "f 1 2 -4",
            "f 1 2 x",
            "f 1 2 3/",
            "f 1 2 3/1/",
            "f 1 2 3/2",
            "f 1 2 3//2",
            "f 1 2 3/1/1/1",
            "f 1 2 99999999999999999999",
            "f 1 2 +3",
            "f 1 2 3 # a comment",
            "usemtl",
            "mtllib",
        ] {
            assert!(quick_obj(&format!("{start}{unusual}\n")).is_none(), "{unusual}");
        }
    }
}
