//! `ro-crate-metadata.json`: what a bundle holds, for archives and catalogues that know nothing of meshmill.
//!
//! The document is JSON-LD as RO-Crate 1.1 asks for: the descriptor, the root with its parts, a file entity for each
//! member, the action that made the results from the recipe and the inputs, and a value for each metric. Inputs that
//! are told by their hashes alone are no parts but entities of their own. Source: Sefton et al., *RO-Crate Metadata
//! Specification 1.1*, <https://w3id.org/ro/crate/1.1>.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{Contents, FILES, LOCK, MANIFEST, METADATA, METRICS, OUTPUTS};
use crate::metric;

const AUTHOR: &str = "#author";
const PUBLISHER: &str = "#publisher";

/// The metadata of a bundle.
pub(super) fn metadata(contents: &Contents) -> Value {
    let metrics = metrics(contents);
    let measured: Vec<Value> = metrics.iter().map(|value| json!({ "@id": value["@id"] })).collect();
    let program = format!("#meshmill-{}", contents.manifest.meshmill);
    let mut graph = vec![descriptor(), root(contents), software(contents, &program), action(contents, &program)];
    graph.extend(people(contents));
    graph.extend(contents.members.iter().map(|(name, content)| file(contents, name, content, &measured)));
    graph.extend(contents.manifest.left_out.iter().map(|(name, hash)| {
        json!({ "@id": absent(name), "@type": "CreativeWork", "name": name, "identifier": format!("blake3:{hash}") })
    }));
    graph.extend(metrics);
    json!({ "@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph })
}

fn descriptor() -> Value {
    json!({
        "@id": METADATA,
        "@type": "CreativeWork",
        "conformsTo": { "@id": "https://w3id.org/ro/crate/1.1" },
        "about": { "@id": "./" }
    })
}

fn root(contents: &Contents) -> Value {
    let parts: Vec<Value> = contents.members.keys().map(|name| reference(name)).collect();
    let mut root = json!({
        "@id": "./",
        "@type": "Dataset",
        "name": format!("{}: recipe, inputs and results of meshmill", contents.lock.recipe),
        "description": contents.description(),
        "datePublished": contents.date,
        "license": { "@id": license_id(contents) },
        "mainEntity": reference(&contents.manifest.recipe),
        "hasPart": parts,
        "mentions": { "@id": "#run" }
    });
    if contents.author.is_some() {
        root["author"] = json!({ "@id": AUTHOR });
    }
    if contents.publisher.is_some() {
        root["publisher"] = json!({ "@id": PUBLISHER });
    }
    root
}

/// The licence, and who made and who publishes the crate, as far as that was said.
fn people(contents: &Contents) -> Vec<Value> {
    let license = json!({ "@id": license_id(contents), "@type": "CreativeWork", "name": contents.license });
    let who = |id: &str, kind: &str, name: &String| json!({ "@id": id, "@type": kind, "name": name });
    let author = contents.author.as_ref().map(|name| who(AUTHOR, "Person", name));
    let publisher = contents.publisher.as_ref().map(|name| who(PUBLISHER, "Organization", name));
    [Some(license), author, publisher].into_iter().flatten().collect()
}

/// The address of the licence, where one was given.
fn license_id(contents: &Contents) -> &str {
    let license = contents.license.as_str();
    let is_address = ["https://", "http://"].iter().any(|start| license.starts_with(start));
    if is_address && license.bytes().all(|byte| byte.is_ascii_graphic()) { license } else { "#license" }
}

fn software(contents: &Contents, program: &str) -> Value {
    json!({
        "@id": program,
        "@type": "SoftwareApplication",
        "name": "meshmill",
        "softwareVersion": contents.manifest.meshmill
    })
}

/// What was done: the program and the recipe made the results from what was read.
fn action(contents: &Contents, program: &str) -> Value {
    let of = |wanted: &dyn Fn(&str) -> bool| -> Vec<Value> {
        contents.members.keys().filter(|name| wanted(name)).map(|name| reference(name)).collect()
    };
    let mut objects = of(&|name| name.starts_with(FILES));
    objects.extend(contents.manifest.left_out.keys().map(|name| json!({ "@id": absent(name) })));
    let results = of(&|name| name.starts_with(OUTPUTS) || [LOCK, METRICS].contains(&name));
    json!({
        "@id": "#run",
        "@type": "CreateAction",
        "name": format!("run of the recipe {}", contents.lock.recipe),
        "instrument": [{ "@id": program }, reference(&contents.manifest.recipe)],
        "object": objects,
        "result": results
    })
}

fn reference(name: &str) -> Value {
    json!({ "@id": encoded(name) })
}

/// The entity of an input that is not in the bundle.
fn absent(name: &str) -> String {
    format!("#left-out/{}", encoded(name))
}

fn file(contents: &Contents, name: &str, content: &[u8], measured: &[Value]) -> Value {
    let title = match name {
        LOCK => "lock: what the results were made of, and their hashes and metrics",
        METRICS => "metrics of the results",
        MANIFEST => "what `meshmill verify` reads",
        name => name,
    };
    let kind = if *name == contents.manifest.recipe { json!(["File", "SoftwareSourceCode"]) } else { json!("File") };
    let mut entity = json!({
        "@id": encoded(name),
        "@type": kind,
        "name": title,
        "contentSize": content.len().to_string(),
        "encodingFormat": media_type(name),
        "identifier": format!("blake3:{}", blake3::hash(content).to_hex())
    });
    if name == METRICS && !measured.is_empty() {
        entity["variableMeasured"] = json!(measured);
    }
    entity
}

/// One entity for each metric of each step.
fn metrics(contents: &Contents) -> Vec<Value> {
    let results = contents.lock.results.iter();
    let values = results.flat_map(|(step, locked)| locked.metrics.iter().map(move |(name, value)| (step, name, value)));
    let entity = |(step, name, value): (&String, &String, &metric::Value)| {
        json!({
            "@id": format!("#metric/{}/{}", encoded(step), encoded(name)),
            "@type": "PropertyValue",
            "name": format!("{name} of {step}"),
            "propertyID": name,
            "value": super::plain(*value)
        })
    };
    values.map(entity).collect()
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase()).as_deref() {
        Some("toml") => "application/toml",
        Some("json") => "application/json",
        Some("stl") => "model/stl",
        Some("obj") => "model/obj",
        Some("png") => "image/png",
        Some("vtu" | "vtk") => "application/x-vtk",
        Some("ron" | "csv" | "txt") => "text/plain",
        _ => "application/octet-stream",
    }
}

/// A name as a part of an address, where spaces and others must not stand.
fn encoded(name: &str) -> String {
    let mut text = String::with_capacity(name.len());
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte) {
            text.push(byte as char);
        } else {
            // A String takes everything.
            let _ = write!(text, "%{byte:02X}");
        }
    }
    text
}
