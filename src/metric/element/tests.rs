//! Known answers for metrics of elements.

use super::*;
use glam::dvec3;

fn near(left: f64, right: f64) {
    assert!((left - right).abs() < 1e-9, "{left} is not {right}");
}

fn triangle(name: &str, p: [DVec3; 3]) -> f64 {
    match find(name).unwrap().measure {
        Measure::Triangle(of) | Measure::Face(of, _) => of(p),
        Measure::Quad(_) | Measure::Reference | Measure::Mesh(_) => panic!("{name} is none of triangles"),
    }
}

fn quad(name: &str, p: [DVec3; 4]) -> f64 {
    match find(name).unwrap().measure {
        Measure::Quad(of) | Measure::Face(_, of) => of(p),
        Measure::Triangle(_) | Measure::Reference | Measure::Mesh(_) => panic!("{name} is none of quads"),
    }
}

#[test]
fn names_are_unique_and_every_metric_has_a_good_side() {
    let mut names: Vec<&str> = ELEMENT_METRICS.iter().map(|metric| metric.name).collect();
    names.sort_unstable();
    let count = names.len();
    names.dedup();
    assert_eq!(names.len(), count);
    assert!(ELEMENT_METRICS.iter().all(|metric| metric.direction != Direction::Neutral));
}

#[test]
fn a_right_triangle_of_three_four_five() {
    let p = [DVec3::ZERO, 4.0 * DVec3::X, 3.0 * DVec3::Y];
    near(triangle("min-length", p), 3.0);
    near(triangle("max-length", p), 5.0);
    near(triangle("area", p), 6.0);
    near(triangle("edge-ratio", p), 5.0 / 3.0);
    near(triangle("characteristic-length", p), 2.4);
    near(triangle("max-tria-angle", p), 90.0);
    near(triangle("min-tria-angle", p), libm::atan(0.75).to_degrees());
    near(triangle("equiangle-skew", p), (60.0 - libm::atan(0.75).to_degrees()) / 60.0);
    // Median and opposite side at each corner: (2, 1.5) and (4, −3), (−4, 1.5) and y, (2, −3) and x.
    let angle = |u: DVec3, v: DVec3| libm::acos((u.dot(v) / u.length() / v.length()).abs()).to_degrees();
    let pairs = [(dvec3(2.0, 1.5, 0.0), dvec3(4.0, -3.0, 0.0)), (dvec3(-4.0, 1.5, 0.0), DVec3::Y)];
    let least = pairs.into_iter().map(|(u, v)| angle(u, v)).fold(angle(dvec3(2.0, -3.0, 0.0), DVec3::X), f64::min);
    near(triangle("skew", p), 90.0 - least);
}

#[test]
fn the_ideal_elements_are_ideal_in_any_unit() {
    for size in [1e-150, 1.0, 1e150] {
        let p = [DVec3::ZERO, size * DVec3::X, size * dvec3(0.5, 0.75_f64.sqrt(), 0.0)];
        for (name, value) in [("edge-ratio", 1.0), ("aspect-ratio", 1.0), ("stretch", 1.0), ("skew", 0.0)] {
            near(triangle(name, p), value);
        }
        near(triangle("equiangle-skew", p), 0.0);
        let p = [DVec3::ZERO, DVec3::X, dvec3(1.0, 1.0, 0.0), DVec3::Y].map(|p| size * p);
        for name in ["edge-ratio", "aspect-ratio", "stretch", "jacobian", "scaled-jacobian", "flatness", "twist"] {
            near(quad(name, p), 1.0);
        }
        for name in ["skew", "equiangle-skew", "warp-angle", "taper"] {
            near(quad(name, p), 0.0);
        }
        near(quad("triangle-twist", p), 1.0);
    }
}

#[test]
fn a_rhombus_is_skewed_and_keeps_its_jacobian() {
    let (x, y) = (0.5, 0.75_f64.sqrt());
    let p = [DVec3::ZERO, DVec3::X, dvec3(1.0 + x, y, 0.0), dvec3(x, y, 0.0)];
    near(quad("skew", p), 30.0);
    near(quad("jacobian", p), 1.0);
    near(quad("taper", p), 0.0);
    near(quad("min-quad-angle", p), 60.0);
    near(quad("max-quad-angle", p), 120.0);
    near(quad("characteristic-length", p), y);
}

#[test]
fn a_trapezoid_is_tapered() {
    // Sides 4 and 2 at height 2: area 6, the least corner triangle has area 2.
    let p = [DVec3::ZERO, 4.0 * DVec3::X, dvec3(3.0, 2.0, 0.0), dvec3(1.0, 2.0, 0.0)];
    near(quad("taper", p), 1.0 - 2.0 / 3.0);
    near(quad("area", p), 6.0);
    // The determinant is linear across: 4·(3 ± 1/√3)/3 at the Gauss points.
    let place = 1.0 / 3.0_f64.sqrt();
    near(quad("jacobian", p), (3.0 - place) / (3.0 + place));
}

#[test]
fn a_folded_quad_is_warped_and_twisted() {
    // Two right triangles that meet at a right angle along the diagonal from (0,0,0) to (1,1,0).
    let half = 0.5_f64.sqrt();
    let p = [DVec3::ZERO, DVec3::X, dvec3(1.0, 1.0, 0.0), dvec3(0.5, 0.5, half)];
    assert!(quad("warp-angle", p) >= 90.0 - 1e-9, "{}", quad("warp-angle", p));
    assert!(quad("flatness", p) < 0.95 && quad("twist", p) < 0.9 && quad("triangle-twist", p) < quad("twist", p));
}

#[test]
fn what_has_no_area_has_no_shape() {
    let flat = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
    for name in ["stretch", "skew", "min-tria-angle", "aspect-ratio", "characteristic-length"] {
        assert!(triangle(name, flat).is_nan(), "{name}");
    }
    assert!(triangle("edge-ratio", [DVec3::ONE; 3]).is_nan());
    let bow = [DVec3::ZERO, DVec3::X, DVec3::Y, dvec3(1.0, 1.0, 0.0)];
    assert!(quad("skew", bow).is_nan() && quad("jacobian", bow).is_nan());
    for metric in ELEMENT_METRICS {
        if let Measure::Quad(of) | Measure::Face(_, of) = metric.measure {
            let value = of([DVec3::NAN; 4]);
            assert!(value.is_nan() || value.is_infinite() || metric.unit == Unit::Length, "{}: {value}", metric.name);
        }
    }
}
