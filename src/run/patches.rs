//! Patches as a JSON document.
//!
//! ```json
//! { "format": "meshmill-patches", "version": 1, "header": "…", "degree": [3, 3],
//!   "patches": [ { "knots": [[0, 0, 0, 0, 1, 1, 1, 1], […]], "controls": [[[x, y, z], …], …],
//!                  "triangle": false, "max-error": 0.01, "rms-error": 0.002 } ],
//!   "seams": [ { "patches": [0, 1], "angle": 0.5, "smooth": true } ] }
//! ```
//!
//! Every patch is a clamped, non-rational B-spline surface of degree 3 by 3. `knots` holds the knot vectors along u and
//! v with the ends four times; `controls` the rows of control points, one row for each control point along v, u running
//! inside a row. The side v = 1 of a `triangle` is a single point. Errors are distances in mesh units, angles degrees.

use serde_json::json;

use crate::mesh::Patches;

/// The document, with a line break at its end.
pub(super) fn json(patches: &Patches, header: &str) -> Vec<u8> {
    let knots = |spans: usize| -> Vec<f64> {
        (0..spans + 7).map(|i| ((i as f64 - 3.0) / spans as f64).clamp(0.0, 1.0)).collect()
    };
    let all: Vec<_> = patches
        .patches
        .iter()
        .map(|p| {
            let rows: Vec<Vec<[f64; 3]>> =
                p.controls.chunks(p.width()).map(|row| row.iter().map(glam::DVec3::to_array).collect()).collect();
            json!({
                "knots": p.spans.map(knots),
                "controls": rows,
                "triangle": p.is_triangle,
                "max-error": p.max_error,
                "rms-error": p.rms_error,
            })
        })
        .collect();
    let seams: Vec<_> = patches
        .seams
        .iter()
        .map(|s| json!({ "patches": s.patches, "angle": s.angle, "smooth": s.is_smooth }))
        .collect();
    let document = json!({
        "format": "meshmill-patches",
        "version": 1,
        "header": header,
        "degree": [3, 3],
        "patches": all,
        "seams": seams,
    });
    let mut bytes = serde_json::to_vec(&document).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}
