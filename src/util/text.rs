//! Text that quotes a file or a file's name, made safe to print on a terminal.

use std::borrow::Cow;

/// Escapes control characters, as in `\u{1b}` or `\n`, because a terminal would obey them. It also escapes characters
/// that change the direction of text and those that end a line.
pub fn escape_controls(text: &str) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        match c {
            c if is_obeyed(c) => escaped.extend(c.escape_default()),
            c => escaped.push(c),
        }
    }
    Cow::Owned(escaped)
}

/// Escapes text as [`escape_controls`] does, and makes it one line. White space of any kind and length becomes one
/// space, and none is left at the ends.
pub fn one_line(text: &str) -> String {
    let words: Vec<_> = text.split_whitespace().collect();
    escape_controls(&words.join(" ")).into_owned()
}

/// Makes text one line as [`one_line`] does. After 300 characters an ellipsis replaces the rest, since the text may
/// quote a hostile file.
pub fn short_line(text: &str) -> String {
    let line = one_line(text);
    match line.char_indices().nth(300) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}

/// Returns whether a terminal would obey a character instead of printing it.
pub(crate) fn is_obeyed(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_escaped_and_all_else_is_kept() {
        for plain in ["", "süß `a\\b` \"c\" 日本", "e\u{301}"] {
            assert!(matches!(escape_controls(plain), Cow::Borrowed(text) if text == plain));
        }
        let hostile = "a\u{1b}[2Jb\r\n\t\u{7f}\u{9b}31m\u{202e}c";
        assert_eq!(escape_controls(hostile), "a\\u{1b}[2Jb\\r\\n\\t\\u{7f}\\u{9b}31m\\u{202e}c");
    }

    #[test]
    fn lines_become_one() {
        assert_eq!(one_line("  a\n\n  b\t\u{7}c \r\n"), "a b \\u{7}c");
        assert_eq!(short_line(&"ä\n".repeat(200)), format!("{}…", "ä ".repeat(150)));
    }
}
