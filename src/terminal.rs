//! Text from files, made fit to be shown: names of groups, fields and files are anybody's, and must not steer a
//! terminal.

use std::borrow::Cow;

/// The text with everything as escapes that moves a cursor, sets a colour, breaks a line or turns the direction of
/// writing: `\u{1b}` for the escape character. Ordinary text of any script is left as it is.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    if !text.chars().any(steers) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.chars().flat_map(|c| if steers(c) { c.escape_default().collect() } else { vec![c] }).collect())
}

/// The same for a text of several lines, whose breaks are meant.
pub(crate) fn printable_lines(text: &str) -> Cow<'_, str> {
    if text.lines().all(|line| matches!(printable(line), Cow::Borrowed(_))) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.split('\n').map(printable).collect::<Vec<_>>().join("\n"))
}

/// Control characters, the directional marks and overrides of Unicode, and its separators of lines and paragraphs.
pub(crate) fn steers(letter: char) -> bool {
    letter.is_control()
        || matches!(letter, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_steers_a_terminal_is_escaped_and_nothing_else() {
        assert_eq!(printable("red\u{1b}[31m\nline"), "red\\u{1b}[31m\\nline");
        assert_eq!(printable("gpj.\u{202e}exe"), "gpj.\\u{202e}exe");
        assert_eq!(printable_lines("a\u{7}\nb"), "a\\u{7}\nb");
        for plain in ["Wand süd", "支持面", "محور", "a b\u{a0}c"] {
            assert!(matches!(printable(plain), Cow::Borrowed(text) if text == plain));
        }
    }
}
