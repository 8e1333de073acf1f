//! What was probably meant by a misspelt name.

/// Names that one name is compared with; a person tells no more of them apart.
const COMPARED: usize = 500;

/// The candidate closest to `name`, if it is close enough to be meant. Ties go to the first candidate. Only the
/// first 500 candidates are compared, so that the cost has a bound.
pub fn closest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Names are short; a long one is an attack or an accident, and comparing it would be slow.
    if name.len() > 100 {
        return None;
    }
    let spelled = name.to_lowercase().replace('_', "-");
    let mut best: Option<(f64, &str)> = None;
    let fits = |candidate: &&str| candidate.len() <= 100;
    for candidate in candidates.into_iter().filter(fits).take(COMPARED) {
        let likeness = strsim::normalized_damerau_levenshtein(&spelled, &candidate.to_lowercase());
        let shares_word = candidate.len() > 2
            && name.len() > 2
            && (candidate.split('-').any(|word| word == spelled) || spelled.split('-').any(|word| word == candidate));
        let score = if shares_word { likeness.max(0.61) } else { likeness };
        if score > 0.6 && best.is_none_or(|(other, _)| score > other) {
            best = Some((score, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// A help line: the likely meaning where there is one, else the choices.
pub fn did_you_mean<'a>(name: &str, what: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let candidates: Vec<&str> = candidates.into_iter().collect();
    match closest(name, candidates.iter().copied()) {
        Some(meant) => Some(format!("did you mean `{meant}`?")),
        None if candidates.is_empty() => None,
        None => {
            let shown = candidates.iter().take(40).map(|c| format!("`{c}`")).collect::<Vec<_>>().join(", ");
            let more = if candidates.len() > 40 { ", …" } else { "" };
            Some(format!("{what}: {shown}{more}"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_misspelt_name() {
        assert_eq!(closest("tolerence", ["tolerance", "target-faces"]), Some("tolerance"));
        assert_eq!(closest("max_edge", ["max-edge", "max-faces"]), Some("max-edge"));
        assert_eq!(closest("quality", ["improve-quality", "repair"]), Some("improve-quality"));
        assert_eq!(closest("zebra", ["repair", "read"]), None);
        assert_eq!(closest("", ["repair"]), None);
    }

    #[test]
    fn lists_the_choices_when_nothing_is_close() {
        let help = did_you_mean("zebra", "steps", ["read", "repair"]);
        assert_eq!(help.as_deref(), Some("steps: `read`, `repair`"));
        assert_eq!(did_you_mean("zebra", "steps", []), None);
    }
}
