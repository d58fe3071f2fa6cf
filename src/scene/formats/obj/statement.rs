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
            let n = head.len();
            let joined = statement.to_mut();
            joined.truncate(n);
            joined.push(' ');
            joined.push_str(tail.trim());
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

/// Returns a name without a comment: `#` begins one after white space only, since names may have it.
pub fn without_comment(name: &str) -> &str {
    comments(name).next().map_or(name, |at| name[..at].trim_end())
}

/// Returns where comments could begin behind a name.
pub fn comments(name: &str) -> impl DoubleEndedIterator<Item = usize> {
    name.match_indices('#').map(|(at, _)| at).filter(|at| name[..*at].ends_with(char::is_whitespace))
}

/// Returns the words before a comment.
pub fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split('#').next().unwrap_or_default().split_whitespace()
}

/// A line, counted from 1, and what is wrong there.
pub type Fault = (usize, String);
