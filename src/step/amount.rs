//! Amounts of memory and disk, as people write and read them.

/// Units that amounts are shown in, largest first.
const SHOWN: [(&str, u64); 4] = [("TB", 1_000_000_000_000), ("GB", 1_000_000_000), ("MB", 1_000_000), ("kB", 1000)];
/// Further units that are understood.
const BINARY: [(&str, u64); 4] = [("TiB", 1 << 40), ("GiB", 1 << 30), ("MiB", 1 << 20), ("KiB", 1 << 10)];

/// The bytes of an amount such as `50GB`, `1.5 GiB` or `1000`; `None` where it is no amount.
pub fn bytes(text: &str) -> Option<u64> {
    let split = text.find(|letter: char| letter.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = (text[..split].trim(), text[split..].trim());
    let factor = match unit {
        "" | "B" | "b" => 1,
        unit => SHOWN.iter().chain(&BINARY).find(|(name, _)| name.eq_ignore_ascii_case(unit))?.1,
    };
    number.parse::<f64>().ok().filter(|number| *number >= 0.0).map(|number| (number * factor as f64) as u64)
}

/// An amount with one digit after the point and the unit that suits it.
pub fn text(bytes: u64) -> String {
    for (unit, factor) in SHOWN {
        if bytes >= factor {
            return format!("{:.1} {unit}", bytes as f64 / factor as f64);
        }
    }
    format!("{bytes} B")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_have_units() {
        for (text, expected) in [
            ("50GB", Some(50_000_000_000)),
            ("1.5 MB", Some(1_500_000)),
            ("2 GiB", Some(1 << 31)),
            (" 1 kb", Some(1000)),
            ("12", Some(12)),
            ("0", Some(0)),
            ("-1", None),
            ("1QB", None),
            ("nan", None),
            ("", None),
        ] {
            assert_eq!(bytes(text), expected, "{text}");
        }
        assert_eq!(text(1_500_000), "1.5 MB");
        assert_eq!(text(999), "999 B");
    }
}
