//! Golden files: RON with numbers rounded to six significant digits, since their last bits are of no interest.

use std::path::Path;

use insta::internals::Content;
use serde::Serialize;

/// Compares `value` with `tests/snapshots/FOLDER/NAME.snap`.
pub(crate) fn assert_golden(folder: &str, name: &str, value: &impl Serialize) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots").join(folder));
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.add_dynamic_redaction(".*", |mut content, _| {
        content.walk(&mut |part| {
            if let Content::F64(number) = part {
                *number = rounded(*number);
            }
            true
        });
        content
    });
    settings.bind(|| insta::assert_ron_snapshot!(name, value));
}

/// Six significant digits; what is below 1e-12, in meshes of about unit size, is noise of the last bits.
fn rounded(number: f64) -> f64 {
    if number.abs() < 1e-12 { 0.0 } else { format!("{number:.5e}").parse().unwrap_or(number) }
}

#[test]
fn numbers_are_rounded_to_six_significant_digits() {
    assert_eq!(rounded(1_234_567.891), 1_234_570.0);
    assert_eq!(rounded(-0.001_234_567_891), -0.001_234_57);
    assert_eq!(rounded(-3e-17), 0.0);
    assert!(rounded(f64::INFINITY).is_infinite());
}
