//! `fe-surface` on every part: what the files hold, and which promises.

use std::path::{Path, PathBuf};

use meshmill::metric::{Value, measure};
use meshmill::steps::repair::{RepairParams, repair};
use meshmill::watch::Watch;

use super::program::{corpus, excused, is_wanted, load, number, root, run};

/// Closed parts of the corpus on which `fe-surface` must hold its promises, by path below the corpus folder.
const CORPUS: &[&str] = &[
    "cad/l_bracket.stl",
    "cad/simple_part.stl",
    "cad/pipe_tee.stl",
    "cad/phone_panel.stl",
    "cad/hdd_cover.stl",
    "cad/relay_shell.stl",
    "cad/crankshaft.stl",
    "cad/casting_part.stl",
    "cad/valve_cover.stl",
    "cad/textured_mouse.stl",
    "cad/vase_scan.stl",
    "cad/crankshaft_scan.stl",
    "public/rocker-arm.obj",
    "public/rocker-arm-3356.stl",
    "public/fandisk.obj",
    "public/joint.off",
    "public/i4_crankshaft.stl",
    "public/i4_cylinder_head.stl",
    "public/turbineblade.ply",
];

/// What ships with the project, for a run without a corpus.
const SHIPPED: &[&str] = &["l_bracket.stl", "simple_part.stl", "pipe_tee.stl"];

/// The table; whether every row holds its targets.
pub(super) fn fe_surface(wanted: &[String]) -> bool {
    let shipped = SHIPPED.iter().map(|name| root().join("examples/meshes").join(name));
    let parts: Vec<PathBuf> = match corpus() {
        Some(corpus) => CORPUS.iter().map(|name| corpus.join(name)).collect(),
        None => shipped.collect(),
    };
    println!(
        "{:24} {:>8} {:>8} {:>4} {:>6} {:>4} {:>8} {:>8} {:>4} {:>7} {:>6} {:>7} {:>9} {:>8} {:>7} {:>7}  verdict",
        "part",
        "faces in",
        "out",
        "exit",
        "closed",
        "chi",
        "min st",
        "mean st",
        "low",
        "excused",
        "size %",
        "valence",
        "dist. %",
        "new s.i.",
        "run s",
        "again s"
    );
    let mut all_hold = true;
    for part in parts.iter().filter(|part| is_wanted(part, wanted)) {
        all_hold &= fe_surface_row(part);
    }
    all_hold
}

fn fe_surface_row(part: &Path) -> bool {
    let name = part.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = root().join("target/acceptance").join(&name);
    let (out, cache) = (folder.join("out"), folder.join("cache"));
    let _ = std::fs::remove_dir_all(&folder);
    let (code, first) = run("pipelines/fe-surface.toml", part, &out, &cache, &[]);
    let (_, again) = run("pipelines/fe-surface.toml", part, &out, &cache, &[]);
    let failed = out.join("failed/result.vtu");
    let file = if failed.exists() { failed } else { out.join("result.vtu") };
    let (Some(input), Some(result)) = (load(part), load(&file)) else {
        println!("{name:24} exit {code}: no result to measure");
        return false;
    };
    let watch = Watch::silent();
    let Ok((clean, _)) = repair(&input, &RepairParams::default(), &watch) else { return false };
    let clean = clean.to_soup();
    let (Ok(now), Ok(before)) = (measure(&result, Some(&clean), &watch), measure(&clean, None, &watch)) else {
        return false;
    };
    let percent = |length: f64| 100.0 * length / number(&before, "diagonal");
    let chi_kept = now.get("euler-characteristic") == before.get("euler-characteristic");
    let is = |name: &str| now.get(name) == Some(Value::Flag(true));
    let new_hits = number(&now, "self-intersections") - number(&before, "self-intersections");
    let targets = [
        ("exit", code == 0),
        ("closed", is("closed")),
        ("manifold", is("manifold") && is("oriented")),
        ("chi", chi_kept),
        ("min stretch", number(&now, "low-stretch-faces") <= excused(&out) as f64),
        ("mean stretch", number(&now, "mean-stretch") >= 0.75),
        ("size", percent(number(&now, "max-size")) <= 4.0 + 1e-9),
        ("valence", number(&now, "max-valence") <= 10.0),
        ("distance", percent(number(&now, "distance")) <= 0.3),
        ("self-intersections", new_hits <= 0.0),
    ];
    let missed: Vec<&str> = targets.iter().filter(|(_, holds)| !holds).map(|(name, _)| *name).collect();
    println!(
        "{:24} {:>8} {:>8} {:>4} {:>6} {:>4} {:>8.4} {:>8.4} {:>4} {:>7} {:>6.3} {:>7} {:>9.4} {:>8} {:>7.2} {:>7.3}  {}",
        name,
        input.faces.len(),
        result.faces.len(),
        code,
        if is("closed") { "yes" } else { "no" },
        if chi_kept { "kept" } else { "lost" },
        number(&now, "min-stretch"),
        number(&now, "mean-stretch"),
        number(&now, "low-stretch-faces"),
        excused(&out),
        percent(number(&now, "max-size")),
        number(&now, "max-valence"),
        percent(number(&now, "distance")),
        new_hits,
        first,
        again,
        if missed.is_empty() { "holds".to_owned() } else { format!("misses {}", missed.join(", ")) },
    );
    missed.is_empty()
}
