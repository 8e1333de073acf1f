//! Tables of criteria, right and wrong.

use super::*;
use crate::recipe::load_criteria;
use std::path::Path;

fn problems_of(text: &str) -> (Option<Criteria>, Vec<String>) {
    let (table, sources) = load_criteria(Path::new("lab.toml"), &|_| Ok(text.to_owned()), &[]).expect(text);
    let mut problems = Vec::new();
    let read = read(("lab", Span::default()), &table, &Scope::default(), &sources, &mut problems);
    let said = |problem: &Diagnostic| format!("{} [{}]", problem.message, sources.text(problem.labels[0].span));
    (read, problems.iter().map(said).collect())
}

#[test]
fn levels_weights_and_parameters_are_read() {
    let (criteria, problems) = problems_of(
        r#"
description = "a lab"
params = { size = 5 }
penalties = [0, 0.1, 0.8, 1, 20]
triangle-share = { ideal = "2%", good = "6%", warn = "8%", fail = 0.1, worst = "15%" }
min-length = { ideal = "=size", good = "=0.9*size", warn = 2, fail = 1, worst = 0, weight = 3 }
max-length = { ideal = 0, good = "1%", warn = "2%", fail = "3%", worst = "4%" }
skew = { ideal = 0, good = 10, warn = 35, fail = 45, worst = 70, on = false }
taper = false
"#,
    );
    assert_eq!(problems, [""; 0]);
    let criteria = criteria.unwrap();
    let names: Vec<&str> = criteria.criteria.iter().map(|criterion| criterion.metric.as_str()).collect();
    assert_eq!(names, ["min-length", "max-length", "triangle-share"]);
    assert_eq!(criteria.penalties, [0.0, 0.1, 0.8, 1.0, 20.0]);
    let [min, max, share] = criteria.criteria.as_slice() else { panic!() };
    assert_eq!((min.levels, min.weight), ([5.0, 4.5, 2.0, 1.0, 0.0].map(Limit::Number), 3.0));
    assert_eq!(max.levels, [0.0, 1.0, 2.0, 3.0, 4.0].map(Limit::Percent));
    assert_eq!(share.levels, [0.02, 0.06, 0.08, 0.1, 0.15].map(Limit::Number));
}

#[test]
fn every_fault_is_told_at_its_place() {
    let skew = |text: &str| format!("skew = {{ ideal = 0, good = 10, warn = 35, fail = 45, worst = 70 }}\n{text}");
    for (text, said) in [
        ("skw = {}", "criteria have no key `skw` [skw]"),
        ("taper = 3", "the criterion `taper` is a table of levels, got a number [3]"),
        ("taper = true", "the criterion `taper` is a table of levels, got a bool [true]"),
        ("taper = { ideal = 0, fail = 1 }", "the criterion `taper` has no good, no warn, no worst [taper]"),
        (
            "taper = { ideal = 0, good = 0.2, warn = 0.1, fail = 0.6, worst = 1 }",
            "`warn` of `taper` is better than its `good`: less is better here [0.1]",
        ),
        (
            "jacobian = { ideal = 1, good = 0.9, warn = 0.7, fail = 0.8, worst = 0 }",
            "`fail` of `jacobian` is better than its `warn`: more is better here [0.8]",
        ),
        (
            "taper = { ideal = 0, good = \"20%\", warn = 0.5, fail = 0.6, worst = 1 }",
            "`good` of `taper` is a number, got \"20%\" [\"20%\"]",
        ),
        (
            "max-length = { ideal = 1, good = \"2%\", warn = 3, fail = 4, worst = 5 }",
            "the levels of `max-length` are all numbers or all percents [\"2%\"]",
        ),
        (
            "taper = { ideal = 0, good = inf, warn = 1, fail = 1, worst = 1 }",
            "`good` of `taper` is a number, got inf [inf]",
        ),
        (
            "taper = { ideal = nan, good = 1, warn = 1, fail = 1, worst = 1 }",
            "`ideal` of `taper` is a number, got nan [nan]",
        ),
        (
            "taper = { ideal = 0, good = 0, warn = 0, fail = 0, worst = 0, weight = -1 }",
            "`weight` of `taper` is a number from 0 to 1e9 [-1]",
        ),
        (
            "taper = { ideal = 0, good = 0, warn = 0, fail = 0, worst = 0, on = 1 }",
            "`on` of `taper` is true or false, got a number [1]",
        ),
        ("taper = { ideal = 0, good = 0, warn = 0, fail = 0, bad = 0 }", "a criterion has no key `bad` [bad]"),
        (
            "penalties = [0, 1, 2]",
            "`penalties` are five numbers from 0 to 1e9, none less than the one before [[0, 1, 2]]",
        ),
        (
            "penalties = [0, 2, 1, 3, 4]",
            "`penalties` are five numbers from 0 to 1e9, none less than the one before [[0, 2, 1, 3, 4]]",
        ),
        ("params = { size = 5 }", "nothing in these criteria uses the parameter `size` [size]"),
        ("params = 5", "`params` is a table, got a number [5]"),
        ("description = 5", "`description` is a string, got a number [5]"),
    ] {
        let (criteria, problems) = problems_of(&skew(text));
        assert_eq!((criteria, problems), (None, vec![said.to_owned()]), "{text}");
    }
    let (criteria, problems) = problems_of("description = \"nothing\"");
    assert!(criteria.is_none() && problems[0].starts_with("the criteria `lab` judge nothing"));
    let (criteria, problems) = problems_of("taper = { ideal = \"=size\", good = 0, warn = 0, fail = 0, worst = 0 }");
    assert!(criteria.is_none() && problems[0].starts_with("there is no parameter `size`"), "{problems:?}");
}
