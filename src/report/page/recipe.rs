//! The text of a recipe with comments, section heads, keys and strings set apart.

use serde::Serialize;

use super::text::escape;
use crate::report::Report;

/// A text of the recipe.
#[derive(Clone, Debug, Serialize)]
pub(super) struct RecipeText {
    name: String,
    /// As HTML.
    html: String,
}

/// The texts of a run's recipe.
pub(super) fn texts(report: &Report) -> Vec<RecipeText> {
    let file = |path: &str| path.rsplit(['/', '\\']).next().unwrap_or(path).to_owned();
    report.texts.iter().map(|(name, text)| RecipeText { name: file(name), html: coloured(text) }).collect()
}

/// TOML as HTML. Only what starts a line or stands in quotes is looked at, so nothing can go wrong but a colour.
fn coloured(text: &str) -> String {
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

fn line(line: &str) -> String {
    let trimmed = line.trim_start();
    if trimmed.starts_with('#') {
        return span("comment", line);
    }
    let (code, comment) = split_comment(line);
    let mut html = if trimmed.starts_with('[') {
        span("head", code)
    } else if let Some((key, value)) = code.split_once('=').filter(|(key, _)| !key.contains(['"', '\'', '{'])) {
        format!("{}={}", span("key", key), strings(value))
    } else {
        strings(code)
    };
    if !comment.is_empty() {
        html.push_str(&span("comment", comment));
    }
    html
}

/// The line before and from the first `#` that stands outside of quotes.
fn split_comment(line: &str) -> (&str, &str) {
    let mut quote = None;
    for (at, letter) in line.char_indices() {
        match (quote, letter) {
            (None, '#') => return line.split_at(at),
            (None, '"' | '\'') => quote = Some(letter),
            (Some(open), letter) if open == letter => quote = None,
            _ => {}
        }
    }
    (line, "")
}

/// Text in quotes set apart.
fn strings(code: &str) -> String {
    let mut html = String::new();
    let mut rest = code;
    while let Some(start) = rest.find('"') {
        let Some(length) = rest[start + 1..].find('"') else { break };
        html.push_str(&escape(&rest[..start]));
        html.push_str(&span("string", &rest[start..start + length + 2]));
        rest = &rest[start + length + 2..];
    }
    html + &escape(rest)
}

fn span(class: &str, text: &str) -> String {
    format!(r#"<span class="{class}">{}</span>"#, escape(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_stays_and_nothing_becomes_markup() {
        let text = "# a <b>\n[steps.fe]\nfrom = \"x # y\" # why\nlist = [\n  \"a\", 'b'\n]\nbad = \"open <\n";
        let html = coloured(text);
        assert!(html.contains(r#"<span class="comment"># a &lt;b&gt;</span>"#));
        assert!(html.contains(r#"<span class="string">&quot;x # y&quot;</span> <span class="comment"># why</span>"#));
        let mut plain = String::new();
        let mut inside = false;
        for letter in html.chars() {
            match letter {
                '<' => inside = true,
                '>' => inside = false,
                other if !inside => plain.push(other),
                _ => {}
            }
        }
        let plain = plain.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&#39;", "'");
        assert_eq!(plain, text.trim_end());
    }
}
