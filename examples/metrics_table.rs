//! Prints the metrics of mesh files as one JSON object a line: `metrics_table [--weld] MESH[=REFERENCE]...`.
//!
//! A second program can read the lines and compare them with its own figures. With `--weld`, vertices of identical
//! coordinates are welded first, as `meshmill measure` does. A last key, `seconds`, says how long measuring took.
#![expect(clippy::print_stdout, reason = "the table is what the program is for")]

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use meshmill::format::{self, Format};
use meshmill::mesh::Soup;
use meshmill::metric::weld::weld_identical;
use meshmill::metric::{Value, measure};
use meshmill::watch::Watch;

fn load(path: &str, weld: bool) -> Result<Soup, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let name = Path::new(path).file_name().map_or(String::new(), |n| n.to_string_lossy().into_owned());
    let read = format::read(Format::detect(&name, &bytes)?, &bytes, &Watch::silent())?;
    Ok(if weld { weld_identical(&read.0) } else { read.0 })
}

fn line(argument: &str, weld: bool) -> Result<serde_json::Value, Box<dyn Error>> {
    let (path, reference) = argument.split_once('=').map_or((argument, None), |(p, r)| (p, Some(r)));
    let mesh = load(path, weld)?;
    let reference = reference.map(|r| load(r, weld)).transpose()?;
    let start = Instant::now();
    let table = measure(&mesh, reference.as_ref(), &Watch::silent())?;
    let seconds = start.elapsed().as_secs_f64();
    let mut out = serde_json::Map::new();
    out.insert("file".to_owned(), argument.into());
    for (name, value) in table.values {
        let value = match value {
            Value::Count(count) | Value::AtLeast(count) => count.into(),
            Value::Integer(integer) => integer.into(),
            Value::Number(number) => number.into(),
            Value::Flag(flag) => flag.into(),
        };
        out.insert(name, value);
    }
    out.insert("seconds".to_owned(), seconds.into());
    Ok(out.into())
}

fn main() {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let weld = arguments.iter().any(|a| a == "--weld");
    arguments.retain(|a| a != "--weld");
    for argument in &arguments {
        match line(argument, weld) {
            Ok(line) => println!("{line}"),
            Err(error) => println!("{}", serde_json::json!({ "file": argument, "error": error.to_string() })),
        }
    }
}
