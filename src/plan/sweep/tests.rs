//! Cases of sweeps, and what wrong sweeps are told.

use std::path::{Path, PathBuf};

use super::*;
use crate::recipe::{Overrides, Value};

const HEAD: &str = "[inputs]\npart = \"a.stl\"\n[params]\nsize = \"2%\"\ntolerance = \"0.2%\"\ntimes = 3\n";

#[expect(clippy::unnecessary_wraps, reason = "the signature that `sweep` asks for")]
fn files(folder: &Path, pattern: &str, most: usize) -> Result<Vec<PathBuf>, String> {
    let names = ["a.stl", "b.stl"].iter().map(|name| folder.join("parts").join(name));
    Ok(if pattern == "parts/*.stl" { names.take(most).collect() } else { Vec::new() })
}

fn read_with(text: &str, axes: &[(&str, &str)]) -> Result<Sweep, Vec<String>> {
    let axes = axes.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
    let overrides = Overrides { axes, ..Overrides::default() };
    let messages = |found: Diagnostics| found.list.into_iter().map(|problem| problem.message).collect();
    let recipe =
        Recipe::load(Path::new("lab/r.toml"), &|_| Ok(format!("{HEAD}{text}")), &overrides).map_err(messages)?;
    sweep(&recipe, &files).map_err(messages)
}

fn read(text: &str) -> Result<Sweep, Vec<String>> {
    read_with(text, &[])
}

/// Each case as `name=value ...`.
fn cases(sweep: &Sweep) -> Vec<String> {
    let text = |value: &Tree| match &value.value {
        Node::Text(text) | Node::Number(text) => text.clone(),
        Node::File(path) => path.display().to_string(),
        other => other.kind().to_owned(),
    };
    let case = |case: &CaseSpec| {
        case.params.iter().map(|(name, value)| format!("{name}={}", text(value))).collect::<Vec<_>>().join(" ")
    };
    sweep.cases.iter().map(case).collect()
}

#[test]
fn a_grid_takes_every_combination_and_the_last_axis_runs_fastest() {
    let sweep = read("[sweep.axes]\nsize = [\"1%\", \"2%\"]\ntimes = [1, 2]").unwrap();
    assert_eq!(cases(&sweep), ["size=1% times=1", "size=1% times=2", "size=2% times=1", "size=2% times=2"]);
    assert_eq!(sweep.varied, ["size", "times"]);
    assert_eq!(sweep.cases[2].name, "size-2pct_times-1");
}

#[test]
fn ranges_are_linear_or_logarithmic() {
    let linear = read("[sweep.axes]\nsize = { from = \"0.1%\", to = \"0.3%\", count = 3 }").unwrap();
    assert_eq!(cases(&linear), ["size=0.1%", "size=0.2%", "size=0.3%"]);
    let log = read("[sweep.axes]\ntimes = { from = 1, to = 100, count = 3, scale = \"log\" }").unwrap();
    assert_eq!(cases(&log), ["times=1", "times=10", "times=100"]);
}

#[test]
fn the_command_line_replaces_and_adds_axes() {
    let recipe = "[sweep.axes]\nsize = [\"1%\"]";
    let sweep = read_with(recipe, &[("size", "3%,4%"), ("times", "1..5/3")]).unwrap();
    assert_eq!(sweep.cases.len(), 6);
    assert_eq!(cases(&sweep)[1], "size=3% times=3");
    let log = read_with("", &[("tolerance", "0.1%..10%/3/log")]).unwrap();
    assert_eq!(cases(&log), ["tolerance=0.1%", "tolerance=1%", "tolerance=10%"]);
    let files = read_with("", &[("part", "x.stl,../y.stl,parts/*.stl")]).unwrap();
    assert_eq!(
        cases(&files),
        ["x.stl", "../y.stl", "parts/a.stl", "parts/b.stl"].map(|file| format!("inputs.part={file}"))
    );
}

#[test]
fn globs_are_relative_to_the_recipe() {
    let sweep = read("[sweep.axes]\ninputs.part = { glob = \"parts/*.stl\" }").unwrap();
    assert_eq!(cases(&sweep), ["inputs.part=lab/parts/a.stl", "inputs.part=lab/parts/b.stl"]);
    assert_eq!(sweep.cases[1].name, "part-parts+b.stl");
}

#[test]
fn zipped_axes_advance_together() {
    let axes = "[sweep.axes]\nsize = [\"1%\", \"2%\"]\ntimes = [1, 2, 3]\ntolerance = [\"3%\", \"4%\"]";
    let sweep = read(&format!("[sweep]\nzip = [[\"size\", \"tolerance\"]]\n{axes}")).unwrap();
    assert_eq!(sweep.cases.len(), 6);
    assert_eq!(cases(&sweep)[3], "size=2% tolerance=4% times=1");
    let wrong = read(&format!("[sweep]\nzip = [\"size\", \"times\"]\n{axes}")).unwrap_err();
    assert_eq!(wrong, ["`size` has 2 values and `times` has 3, so they cannot be zipped"]);
}

#[test]
fn cases_of_their_own_follow_the_grid() {
    let text = "[sweep.axes]\ntimes = [1, 2]\n[[sweep.case]]\nname = \"coarse\"\nsize = \"8%\"\ninputs.part = \"c.stl\"\n\
        [[sweep.case]]\ntimes = 1";
    let sweep = read(text).unwrap();
    assert_eq!(
        cases(&sweep)[2..],
        ["inputs.part=lab/c.stl size=8%", "times=1"]
            .map(str::to_owned)
            .map(|case| { if case.starts_with("inputs") { "size=8% inputs.part=lab/c.stl".to_owned() } else { case } })
    );
    assert_eq!(sweep.varied, ["times", "size", "inputs.part"]);
    let names: Vec<&str> = sweep.cases.iter().map(|case| case.name.as_str()).collect();
    assert_eq!(names, ["times-1", "times-2", "coarse", "times-1_2"]);
}

#[test]
fn a_case_keeps_its_name_whatever_else_is_in_the_sweep() {
    let names = |files: &str| -> Vec<String> {
        let sweep = read_with("", &[("inputs.part", files)]).unwrap();
        sweep.cases.iter().map(|case| case.name.clone()).collect()
    };
    let all = names("lab/x/part.stl,lab/y/part.stl,lab/a b.stl,lab/ab.stl,lab/a+b.stl");
    assert_eq!(all[..2], ["part-x+part.stl", "part-y+part.stl"]);
    assert_eq!(all[3], "part-ab.stl");
    let different: std::collections::BTreeSet<&String> = all.iter().collect();
    assert_eq!(different.len(), all.len());
    for (file, name) in ["x/part.stl", "y/part.stl", "a b.stl", "ab.stl", "a+b.stl"].iter().zip(&all) {
        assert_eq!(&names(&format!("lab/{file}"))[0], name);
    }
    let elsewhere = ["/far/part.stl", "/off/part.stl"].map(|file| names(file)[0].clone());
    assert!(elsewhere[0].starts_with("part-part.stl-") && elsewhere[0] != elsewhere[1], "{elsewhere:?}");
    let long = |end: &str| names(&format!("{}{end}.stl", "l".repeat(200)))[0].clone();
    assert!(long("x").len() <= 100 && long("x") != long("y"), "{} {}", long("x"), long("y"));
}

#[test]
fn samples_fill_the_ranges_and_repeat_with_their_seed() {
    let text = "[sweep.axes]\nsize = { from = \"1%\", to = \"5%\" }\ntimes = [1, 2]\n[sweep.sample]\nn = 4\nseed = 7";
    let sweep = read(text).unwrap();
    assert_eq!(sweep.cases.len(), 4);
    assert_eq!(cases(&sweep), cases(&read(text).unwrap()));
    assert_ne!(cases(&sweep), cases(&read(&text.replace("seed = 7", "seed = 8")).unwrap()));
    let mut quarters: Vec<usize> = (0..4)
        .map(|case| {
            let Node::Text(size) = &sweep.cases[case].params[0].1.value else { panic!("a percent") };
            (size.trim_end_matches('%').parse::<f64>().unwrap() - 1.0) as usize
        })
        .collect();
    quarters.sort_unstable();
    assert_eq!(quarters, [0, 1, 2, 3]);
    assert_eq!(cases(&sweep).iter().filter(|case| case.ends_with("times=1")).count(), 2);
}

#[test]
fn hostile_sweeps_are_refused_before_a_case_is_made() {
    let counts = |count: usize| {
        ["size", "tolerance", "times"]
            .map(|name| {
                let unit = if name == "times" { "" } else { "%" };
                format!("{name} = {{ from = \"1{unit}\", to = \"9{unit}\", count = {count} }}\n")
                    .replace("\"1\"", "1")
                    .replace("\"9\"", "9")
            })
            .concat()
    };
    let found = read(&format!("[sweep.axes]\n{}", counts(1000))).unwrap_err();
    assert_eq!(found, ["the sweep would have 1000 x 1000 x 1000 cases, and 10000 is the most"]);
    let found = read(&format!("[sweep.axes]\n{}", counts(1_000_000_000))).unwrap_err();
    assert!(found.iter().all(|message| message == "`count` is a whole number from 2 to 10000"), "{found:?}");
    for (text, message) in [
        ("[sweep.axes]\nsise = [1]", "the recipe has no parameter or input `sise`"),
        ("[sweep.axes]\nsize = []", "the axis `size` has no value"),
        ("[sweep.axes]\nsize = 3", "an axis is a list of values or a table, got a number"),
        (
            "[sweep.axes]\nsize = { from = \"1%\", to = 2, count = 2 }",
            "a range goes from a number to a number or from a percent to a percent",
        ),
        ("[sweep.axes]\nsize = { from = 1, to = 2 }", "the range of `size` does not say how many values it has"),
        (
            "[sweep.axes]\nsize = { from = 0, to = 2, count = 2, scale = \"log\" }",
            "a logarithmic range has bounds above 0",
        ),
        ("[sweep.axes]\nsize = { glob = \"*\" }", "`glob` names files, and `size` is a parameter, not an input"),
        ("[sweep.axes]\npart = { glob = \"/**/*\" }", "`**` would search whole trees of folders"),
        ("[sweep.axes]\npart = { glob = \"none*\" }", "no file is called `none*` in `lab`"),
        ("[sweep]\naxis = 1", "the section `sweep` has no key `axis`"),
        ("[sweep.axes]\nsize = [1]\n[sweep.sample]\nn = 0", "`n` is a whole number from 1 to 10000"),
        (
            "[[sweep.case]]\nname = \"../x\"\nsize = 1",
            "the name of a case is the name of a folder that no other case has",
        ),
        ("", "the recipe `r` says nothing about a sweep"),
    ] {
        assert_eq!(read(text).unwrap_err(), [message], "{text}");
    }
}

#[test]
fn rounded_values_are_short() {
    let range = read("[sweep.axes]\nsize = { from = 0, to = 1, count = 11 }").unwrap();
    assert_eq!(cases(&range)[3], "size=0.3");
    assert_eq!(Value::Number(0.1 + 0.2).to_string(), "0.30000000000000004");
}
