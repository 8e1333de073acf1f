//! Files of other programs, line by line.

use super::*;
use crate::criteria::read;
use crate::metric::gate::Limit;
use crate::metric::gate::criteria::Criteria;
use crate::recipe::{Scope, Span, load_criteria};
use std::path::Path;

/// The criteria that the imported text is.
fn criteria(text: &str) -> Criteria {
    let (table, sources) = load_criteria(Path::new("lab.toml"), &|_| Ok(text.to_owned()), &[]).expect(text);
    let mut problems = Vec::new();
    let read = read(("lab", Span::default()), &table, &Scope::default(), &sources, &mut problems);
    read.unwrap_or_else(|| panic!("{problems:?}\n{text}"))
}

fn levels(criteria: &Criteria, metric: &str) -> [f64; 5] {
    let found = criteria.criteria.iter().find(|criterion| criterion.metric == metric).expect(metric);
    found.levels.map(|level| match level {
        Limit::Number(number) | Limit::Percent(number) => number,
        Limit::Flag(_) => panic!("{metric}"),
    })
}

/// As the editor of HyperMesh writes it, with the values of the reference of `*writequalitycriteria`.
const HYPERMESH: &str = "\
This Criteria file was created with Criteria Editor application

 #    Criterion     On  Wt   Ideal    Good    Warn    Fail   Worst  Solver

 0 penalty value               0.00    0.00    0.80    1.00   10.00
 1 min length         1 1.0   15.00   13.50    6.00    3.00    1.50       1
 2 max length         1 1.0   15.00   18.00   22.50   30.00   45.00
 3 aspect ratio       1 1.0    1.00    2.00    4.40    5.00   10.00       0
 4 warpage            1 2.5    0.00    5.00    8.00   10.00   90.00       0
 5 max angle quad     1 1.0   90.00  110.00  125.00  135.00  180.00       0
 6 min angle quad     1 1.0   90.00   70.00   55.00   45.00    0.00       0
 7 max angle tria     1 1.0   60.00   80.00  100.00  120.00  180.00       0
 8 min angle tria     1 1.0   60.00   50.00   30.00   20.00    0.00       0
 9 skew               1 1.0    0.00   10.00   35.00   45.00   90.00       0
10 jacobian           1 1.0    1.00    0.90    0.75    0.70    0.00       0
11 chordal dev        0 1.0    0.00    0.30    0.80    1.00    2.00
12 % of trias         1 1.0    2.00    6.00    8.00   10.00   15.00
";

#[test]
fn all_twelve_checks_of_hypermesh_are_taken_over() {
    assert_eq!(Dialect::of(HYPERMESH), Some(Dialect::HyperMesh));
    let imported = import(HYPERMESH, "lab.criteria", Dialect::HyperMesh).unwrap();
    assert_eq!((imported.taken, imported.left.len()), (12, 1), "{:?}", imported.left);
    assert!(imported.left[0].starts_with("line 1: This Criteria file"));
    let criteria = criteria(&imported.text);
    assert_eq!(criteria.penalties, [0.0, 0.0, 0.8, 1.0, 10.0]);
    // One of them is off.
    assert_eq!(criteria.criteria.len(), 11);
    assert_eq!(levels(&criteria, "min-length"), [15.0, 13.5, 6.0, 3.0, 1.5]);
    assert_eq!(levels(&criteria, "triangle-share"), [0.02, 0.06, 0.08, 0.1, 0.15]);
    assert_eq!(levels(&criteria, "jacobian"), [1.0, 0.9, 0.75, 0.7, 0.0]);
    let warpage = criteria.criteria.iter().find(|criterion| criterion.metric == "warp-angle").unwrap();
    assert_eq!(warpage.weight, 2.5);
    assert!(imported.text.contains("chordal-deviation = { ideal = 0, good = 0.3, warn = 0.8, fail = 1, worst = 2"));
    assert!(imported.text.contains("on = false") && imported.text.contains("Method 1 is not taken over"));
    for line in (1..).zip(HYPERMESH.lines()).filter(|(_, line)| !line.trim().is_empty() && !line.contains('#')) {
        let mention = [format!("Line {}:", line.0), format!("line {}:", line.0)];
        assert!(mention.iter().any(|mention| imported.text.contains(mention)), "{line:?}");
    }
}

#[test]
fn rows_of_a_command_file_and_of_newer_versions_are_read() {
    let text = "*createstringarray 20 \" 0 penalty value    0.00    0.00    0.80    1.00   10.00\" \\\n  \
                \"  9 skew              1 1.0   0.000  10.000  34.000  40.000  70.000    0   46    8\" \\\n  \
                \" 14 QI color legend            32      32       7       6       3           3   -1\" \\\n  \
                \" 15 time_step         0      10.000                   0.010            0   59   12\" \\\n  \
                \"  9 skew              1 1.0   0 1 2 3 4    0\" \\\n  \
                \"   Global_solver -1\"\n*setqualitycriteria 1 20 0\n";
    assert_eq!(Dialect::of(text), Some(Dialect::HyperMesh));
    let imported = import(text, "command.tcl", Dialect::HyperMesh).unwrap();
    assert_eq!(levels(&criteria(&imported.text), "skew"), [0.0, 10.0, 34.0, 40.0, 70.0]);
    let lines: Vec<&str> = imported.left.iter().filter_map(|line| line.split(':').next()).collect();
    assert_eq!(lines, ["line 3", "line 4", "line 5", "line 6", "line 7"]);
    assert!(imported.left[2].contains("that one counts"));
}

#[test]
fn a_check_that_cannot_be_read_is_an_error_with_its_line() {
    for (row, said) in [
        ("skew 1 1.0 0 10 34 40", "seven numbers"),
        ("skew 1 1.0 0 10 thirty 40 70", "`thirty` is not a number"),
        ("skew 1 1.0 0 10 34 20 70", "rise and fall"),
        ("skew 1 -1 0 10 34 40 70", "weight"),
        ("skew 1 1.0 0 10 34 40 1e999", "is not a number"),
        ("skew 1 1.0 0 10 34 40 nan", "is not a number"),
        ("penalty value 0 0 1", "five numbers"),
    ] {
        let error = import(&format!("\n{row}\n"), "x", Dialect::HyperMesh).unwrap_err();
        assert!(error.line == 2 && error.message.contains(said), "{row}: {error}");
    }
}

const SNAPPY: &str = "\
/*---------------------------------------------------------*\\
| another head                                              |
\\*---------------------------------------------------------*/
FoamFile
{
    version     2.0;
    object      meshQualityDict;
}
// * * * //
maxNonOrtho         65;
maxBoundarySkewness 20;
maxInternalSkewness 4;
maxConcave          80;
minVol              1e-13;   // absolute
minTetQuality       1e-15;
minArea             -1;
minTwist            0.05;
minDeterminant      0.001;
minFaceWeight       0.05;
minVolRatio         0.01;
minTriangleTwist    -1;
minFlatness 0.5; minEdgeLength 0.25;
#includeEtc \"caseDicts/mesh/generation/meshQualityDict\"
nSmoothScale        4;
errorReduction      0.75;
relaxed
{
    maxNonOrtho 75;
    minTwist    0.02;
}
";

#[test]
fn every_line_of_a_mesh_quality_dict_is_accounted_for() {
    assert_eq!(Dialect::of(SNAPPY), Some(Dialect::Snappy));
    let imported = import(SNAPPY, "meshQualityDict", Dialect::Snappy).unwrap();
    let criteria = criteria(&imported.text);
    assert_eq!(imported.taken, 4);
    // The strict limit warns and the relaxed one fails.
    assert_eq!(levels(&criteria, "twist"), [1.0, 1.0, 0.05, 0.02, -1.0]);
    assert_eq!(levels(&criteria, "max-quad-angle"), [90.0, 90.0, 226.0, 260.0, 360.0]);
    assert_eq!(levels(&criteria, "flatness"), [1.0, 1.0, 0.6, 0.5, 0.0]);
    assert_eq!(levels(&criteria, "min-length"), [0.25, 0.25, 0.25, 0.25, 0.0]);
    for (line, text) in (1..).zip(SNAPPY.lines()).filter(|(line, text)| *line > 5 && text.contains(';')) {
        let told = [format!("Line {line}:"), format!("line {line}:"), format!("on line {line}.")];
        assert!(told.iter().any(|told| imported.text.contains(told)), "{line}: {text}\n{}", imported.text);
    }
    assert!(imported.left.iter().any(|line| line.contains("minArea -1: this value turns the check off")));
    assert!(imported.left.iter().any(|line| line.contains("relaxed.maxNonOrtho 75: it judges volume cells")));
    assert!(imported.left.iter().any(|line| line.contains("#includeEtc") && line.contains("not followed")));
}

#[test]
fn of_a_whole_snappy_dict_the_quality_controls_count() {
    let text = "castellatedMesh true;\nsnapControls { minTwist 0.9; }\nmeshQualityControls\n{\n  minTwist 0.1;\n  \
                minTwist 0.2;\n  relaxed { minTwist 0.3; }\n  strange { a b c; }\n}\n";
    let imported = import(text, "snappyHexMeshDict", Dialect::Snappy).unwrap();
    // A relaxed limit that is stricter fails nothing that the other one lets pass.
    assert_eq!(levels(&criteria(&imported.text), "twist"), [1.0, 1.0, 0.3, 0.2, -1.0]);
    assert_eq!(imported.left.len(), 4, "{:?}", imported.left);
}

#[test]
fn hostile_dictionaries_are_errors_and_never_more() {
    let deep = "a {".repeat(1000);
    let long = format!("{} 1;", "a".repeat(100_000));
    let many = "a 1;".repeat(20_000);
    let wrong = [
        "a",
        "a {",
        "}",
        "{ }",
        "/* never",
        "\"never",
        "minTwist x;",
        "minTwist 1e999;",
        "a { b }",
        &deep,
        &long,
        &many,
    ];
    for text in wrong {
        assert!(import(text, "x", Dialect::Snappy).is_err(), "{}", text.get(..20).unwrap_or(text));
    }
    let text = "minTwist 0.1;\nevil\u{7}\u{202e}\u{1b}[31m \"quoted \n more\";\n";
    let imported = import(text, "na\"me\\\n\u{1b}", Dialect::Snappy).unwrap();
    assert!(!imported.text.chars().any(|letter| letter.is_control() && letter != '\n'), "{:?}", imported.text);
    assert_eq!(criteria(&imported.text).criteria.len(), 1);
    assert_eq!(Dialect::of("solid cube\nfacet normal 0 0 1\n"), None);
}
