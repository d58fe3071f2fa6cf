//! Statements of OBJ and MTL files.

use std::borrow::Cow;

/// Returns the statements of a file, each with the number of its first line. Comments and blank lines are left out;
/// continued lines (`\` at the end) are joined.
pub fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = text.lines().enumerate();
    let next = move || {
        let (ix, line) = lines.next()?;
        let mut statement = Cow::Borrowed(line.trim());
        while let Some(head) = statement.strip_suffix('\\') {
            let Some((_, tail)) = lines.next() else { break };
            statement = Cow::Owned(format!("{head} {}", tail.trim()));
        }
        Some((ix + 1, statement))
    };
    std::iter::from_fn(next).filter(|(_, statement)| !statement.is_empty() && !statement.starts_with('#'))
}

/// Returns a statement's keyword and the rest, trimmed.
pub fn split_keyword(statement: &str) -> (&str, &str) {
    let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
    (keyword, rest.trim())
}

/// Returns the words before a comment.
pub fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split('#').next().unwrap_or_default().split_whitespace()
}

/// A line, counted from 1, and what is wrong there.
pub type Fault = (usize, String);
