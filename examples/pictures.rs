//! From regions to quads in pictures: `pictures [--flip] MESH FOLDER`.
//!
//! Repairs the mesh, marks its features, partitions it, straightens the borders, cuts along them and makes quads, all
//! with default parameters but the size of 3 %. Writes `regions.png` (the mesh as it was, each region in a colour),
//! `split.png` (cut along the curves, which are drawn bold), `quads.png` (by scaled Jacobian, blue is a square) and
//! `quad-regions.png`, the same four as VTU, and `curves.obj` (the curves as polylines); prints what each step says of
//! itself.
#![expect(clippy::print_stdout, reason = "the statistics are to be read")]

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use meshmill::format::{self, Format, WriteOptions};
use meshmill::mesh::{Surface, SurfacePoint};
use meshmill::report::picture;
use meshmill::step::Length;
use meshmill::steps::features::{FeaturesParams, features};
use meshmill::steps::partition::{PartitionParams, partition};
use meshmill::steps::q_morph::{QMorphParams, q_morph};
use meshmill::steps::repair::{RepairParams, repair};
use meshmill::steps::split::{SplitParams, split};
use meshmill::steps::straighten::{Method, StraightenParams, straighten};
use meshmill::watch::Watch;

/// The curves of a surface as lines of an OBJ file.
fn lines(surface: &Surface) -> String {
    let (mut points, mut lines, mut count) = (String::new(), String::new(), 0);
    for curve in &surface.carried.curves {
        lines.push('l');
        let first = count + 1;
        for point in &curve.points {
            let p = match *point {
                SurfacePoint::Vertex(v) => surface.points[v],
                SurfacePoint::Edge { edge: [a, b], t } => surface.points[a] * (1.0 - t) + surface.points[b] * t,
            };
            count += 1;
            let _ = writeln!(points, "v {} {} {}", p.x, p.y, p.z);
            let _ = write!(lines, " {count}");
        }
        if curve.is_closed {
            let _ = write!(lines, " {first}");
        }
        lines.push('\n');
    }
    points + &lines
}

fn told(step: &str, stats: &impl serde::Serialize) -> Result<(), Box<dyn Error>> {
    println!("{step}: {}", serde_json::to_string(stats)?);
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let method = if arguments.iter().any(|a| a == "--flip") { Method::FlipGeodesic } else { Method::Unfold };
    arguments.retain(|a| a != "--flip");
    let [mesh, folder] = &arguments[..] else { return Err("usage: pictures [--flip] MESH FOLDER".into()) };
    let (watch, folder) = (Watch::silent(), Path::new(folder));
    let bytes = std::fs::read(mesh)?;
    let (soup, _) = format::read(Format::detect(mesh, &bytes)?, &bytes, &watch)?;
    let (clean, _) = repair(&soup, &RepairParams::default(), &watch)?;
    let (marked, _) = features(&clean, &FeaturesParams::default(), &watch)?;
    let (parts, stats) = partition(&marked, &PartitionParams::default(), &watch)?;
    told("partition", &stats)?;
    let straight = StraightenParams { method, ..StraightenParams::default() };
    let (curves, stats) = straighten(&parts, &straight, &watch)?;
    told("straighten", &stats)?;
    let (cut, stats) = split(&curves, &SplitParams::default(), &watch)?;
    told("split", &stats)?;
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("curves.obj"), lines(&curves))?;
    let wanted = QMorphParams { size: Length::Percent(3.0).into(), ..QMorphParams::default() };
    let (quads, stats) = q_morph(&cut, &wanted, &watch)?;
    told("q-morph", &stats)?;
    let (parts, cut) = (parts.to_soup(), cut.to_soup());
    for (name, mesh, by_region) in [
        ("regions", &parts, true),
        ("split", &cut, true),
        ("quads", &quads.mesh, false),
        ("quad-regions", &quads.mesh, true),
    ] {
        let draw = if by_region { picture::regions_png } else { picture::png };
        std::fs::write(folder.join(format!("{name}.png")), draw(mesh, [1200, 900], "meshmill pictures")?)?;
        let bytes = format::write(Format::Vtu, mesh, &WriteOptions::default())?;
        std::fs::write(folder.join(format!("{name}.vtu")), bytes)?;
    }
    Ok(())
}
