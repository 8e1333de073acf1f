//! Straightens a network by local moves: the faces between a point's neighbours are unfolded into the plane, and the
//! point gives way to the taut line there.
//!
//! A point inside an edge slides to where the straight line between its neighbours crosses the edge. A point on a
//! vertex looks at the side where its faces make the smaller angle; if that is below 180 degrees, the fan on that side
//! is unfolded and the path pulled taut in it, bending only where it would leave the fan or touch another arc. One rule
//! so covers flat, round and saddle vertices. Both moves never lengthen the path: where the target is out of reach, the
//! way towards it is descent all along.
//!
//! Departure from Martínez et al.: where the straight line leaves the fan, the path bends at the fan's border instead
//! of being cut off there, and it keeps a margin from other arcs and from vertices that it may not touch.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::network::{NONE, Network, Node, Place};
use crate::mesh::bvh::SegmentBvh;
use crate::mesh::geometry::{angle, closest_on_segment};
use crate::mesh::halfedge::{edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, HalfedgeId, VertexId};
use crate::watch::{Cancelled, Watch};

/// Arcs keep this share of an edge from vertices that they may not touch.
const END_MARGIN: f64 = 0.1;
/// And this share from each other.
const MARGIN: f64 = 0.05;
/// A fan whose spoke leaves less room is not entered.
const LEAST_ROOM: f64 = 0.02;
/// Wedges of at least 180 degrees less this are straight, in radians.
const STRAIGHT: f64 = 1e-6;
/// A point that wishes to be this near to a vertex, in shares of its edge, or beyond it, tries to go over the vertex:
/// points that creep towards one would never arrive.
const NEAR: f64 = 0.01;
/// A move that shortens the path by a smaller share is none.
const LEAST_GAIN: f64 = 1e-9;
/// Points of a closed arc that stay during a round; other ones each round.
const HOLDS: usize = 4;

/// How far arcs may go from where they were.
pub struct Leash {
    paths: Vec<Vec<[DVec3; 2]>>,
    trees: BTreeMap<usize, SegmentBvh>,
    /// The largest distance of a point from the path of its arc.
    pub reach: f64,
}

impl std::fmt::Debug for Leash {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Leash").field("reach", &self.reach).finish_non_exhaustive()
    }
}

/// Paths of more segments are searched by a tree.
const SHORT_PATH: usize = 16;

impl Leash {
    /// A leash to these paths, the last point of a closed one followed by its first.
    pub fn new(paths: &[Vec<DVec3>], reach: f64) -> Self {
        let segments = |path: &Vec<DVec3>| path.windows(2).map(|pair| [pair[0], pair[1]]).collect::<Vec<_>>();
        let paths: Vec<_> = paths.iter().map(segments).collect();
        let long = paths.iter().enumerate().filter(|(_, path)| path.len() > SHORT_PATH);
        let trees = long.map(|(k, path)| (k, SegmentBvh::new(path.clone()))).collect();
        Self { paths, trees, reach }
    }

    /// The distance of a point from the path of an arc.
    pub fn distance(&self, arc: usize, p: DVec3) -> f64 {
        if let Some(tree) = self.trees.get(&arc) {
            return tree.closest(p).map_or(0.0, |hit| hit.distance());
        }
        let squared = self.paths[arc].iter().map(|&segment| closest_on_segment(p, segment).distance_squared);
        squared.fold(f64::INFINITY, f64::min).sqrt()
    }

    fn admits(&self, arc: usize, p: DVec3) -> bool {
        self.distance(arc, p) <= self.reach
    }
}

/// What sweeping did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sweeps {
    /// Sweeps over all points.
    pub rounds: usize,
    /// Moves made.
    pub moves: usize,
}

/// Straightens the network in sweeps over its points, until a sweep changes nothing.
///
/// # Errors
/// The run was interrupted.
pub fn unfold(network: &mut Network<'_>, leash: &Leash, rounds: usize, watch: &Watch) -> Result<Sweeps, Cancelled> {
    let mut done = Sweeps::default();
    // Closed arcs are held elsewhere each round.
    let needed = if network.strands.iter().any(|strand| strand.is_closed) { HOLDS } else { 1 };
    let mut quiet = 0;
    for round in 0..rounds {
        let mut moves = 0;
        for arc in 0..network.strands.len() {
            watch.check()?;
            let strand = network.strands[arc].clone();
            let nodes = network.nodes_of(&strand);
            if strand.is_closed {
                hold(network, &nodes, round);
            }
            for &node in &nodes {
                moves += usize::from(improve(network, leash, arc, node));
            }
            for &node in &nodes {
                network.nodes[node as usize].is_held = false;
            }
        }
        done.moves += moves;
        done.rounds += 1;
        quiet = if moves == 0 { quiet + 1 } else { 0 };
        if quiet == needed {
            break;
        }
    }
    Ok(done)
}

/// Holds a few points of a closed arc, so that it is smoothed and does not shrink away.
fn hold(network: &mut Network<'_>, nodes: &[u32], round: usize) {
    let turn = nodes.len() * (round % 4) / (4 * HOLDS);
    for k in 0..HOLDS.min(nodes.len()) {
        let at = (turn + k * nodes.len() / HOLDS) % nodes.len();
        network.nodes[nodes[at] as usize].is_held = true;
    }
}

fn improve(network: &mut Network<'_>, leash: &Leash, arc: usize, node: u32) -> bool {
    let here = network.nodes[node as usize];
    if !here.is_live || here.is_held || here.prev == NONE || here.next == NONE || here.prev == here.next {
        return false;
    }
    match here.place {
        Place::Edge(e, t) => slide(network, leash, arc, node, e, t),
        Place::Vertex(v) if !network.is_fixed[v] => leave_vertex(network, leash, arc, node, v),
        Place::Vertex(_) => false,
    }
}

/// Moves a point along its edge, or takes it out where its neighbours share a face.
fn slide(network: &mut Network<'_>, leash: &Leash, arc: usize, node: u32, e: EdgeId, t: f64) -> bool {
    let mesh = network.mesh;
    let here = network.nodes[node as usize];
    let [a, b] = [here.prev, here.next].map(|i| network.nodes[i as usize].place);
    let h = halfedge_of(e);
    let (Some(f), Some(g)) = (mesh.face(h), mesh.face(twin(h))) else { return false };
    let both = |face| network.lies_in(a, face) && network.lies_in(b, face);
    if both(f) || both(g) {
        network.replace(node, &[]);
        return true;
    }
    let [p, q] = mesh.ends(e).map(|v| mesh.point(v));
    let axis = (q - p).normalize_or_zero();
    let flat = |place| {
        let r = network.point(place) - p;
        let along = r.dot(axis);
        (along, (r - along * axis).length())
    };
    let ((xa, ya), (xb, yb)) = (flat(a), flat(b));
    if ya + yb <= 0.0 {
        return false;
    }
    let wish = (xa + (xb - xa) * ya / (ya + yb)) / p.distance(q);
    let end = mesh.ends(e)[usize::from(wish > 0.5)];
    let is_near = wish.min(1.0 - wish) < NEAR;
    if is_near && network.is_free(end) && gather(network, leash, arc, node, end) {
        return true;
    }
    let Some(place) = reachable(network, node, e, t, wish) else { return false };
    let (from, pa, pb) = (network.point(here.place), network.point(a), network.point(b));
    let length = |x: DVec3| pa.distance(x) + x.distance(pb);
    let to = network.point(place);
    if length(to) < length(from) * (1.0 - LEAST_GAIN) && leash.admits(arc, to) {
        network.relocate(node, place);
        return true;
    }
    false
}

/// Leads the path over a vertex in its way, instead of the points on the vertex's edges with which it goes round.
fn gather(network: &mut Network<'_>, leash: &Leash, arc: usize, node: u32, v: VertexId) -> bool {
    let is_spoke = |network: &Network<'_>, i: u32| {
        let Node { place, prev, next, is_held, .. } = network.nodes[i as usize];
        let on_spoke = matches!(place, Place::Edge(e, _) if network.mesh.ends(e).contains(&v));
        on_spoke && !is_held && prev != NONE && next != NONE
    };
    let mut around = vec![node];
    let (mut first, mut last) = (network.nodes[node as usize].prev, network.nodes[node as usize].next);
    while is_spoke(network, first) && first != last {
        around.push(first);
        first = network.nodes[first as usize].prev;
    }
    around.reverse();
    while is_spoke(network, last) && first != last {
        around.push(last);
        last = network.nodes[last as usize].next;
    }
    if first == last {
        return false;
    }
    let at = |i: u32| network.point(network.nodes[i as usize].place);
    let path: Vec<DVec3> = [first].into_iter().chain(around.iter().copied()).chain([last]).map(at).collect();
    let before: f64 = path.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let to = network.mesh.point(v);
    if at(first).distance(to) + to.distance(at(last)) >= before || !leash.admits(arc, to) {
        return false;
    }
    for other in around.into_iter().filter(|&i| i != node) {
        network.replace(other, &[]);
    }
    network.relocate(node, Place::Vertex(v));
    true
}

/// The place on the edge nearest to the wish that others leave free.
fn reachable(network: &Network<'_>, node: u32, e: EdgeId, t: f64, wish: f64) -> Option<Place> {
    let ends = network.mesh.ends(e);
    let [mut low, mut high] = [0, 1].map(|k| {
        let margin = if network.is_free(ends[k]) { 0.0 } else { END_MARGIN };
        if k == 0 { margin } else { 1.0 - margin }
    });
    for other in network.others(e, node) {
        if other < t {
            low = low.max(other + MARGIN);
        } else {
            high = high.min(other - MARGIN);
        }
    }
    let to = wish.clamp(low.min(t), high.max(t));
    // On the vertex itself it would be for `gather` to go.
    (!to.is_nan()).then(|| Place::Edge(e, to.clamp(1e-9, 1.0 - 1e-9)))
}

/// A spoke of a fan: its edge, its far end, the angle from the fan's beginning, its length, the share that is free.
struct Spoke {
    halfedge: HalfedgeId,
    angle: f64,
    length: f64,
    room: f64,
}

/// The direction of a place as seen from a vertex: the outgoing half-edge at or before it, and the angle beyond.
fn direction(network: &Network<'_>, v: VertexId, ring: &[HalfedgeId], place: Place) -> Option<(usize, f64)> {
    let mesh = network.mesh;
    let centre = mesh.point(v);
    for (k, &h) in ring.iter().enumerate() {
        let on_spoke = match place {
            Place::Vertex(w) => w == mesh.target(h),
            Place::Edge(e, _) => e == edge_of(h),
        };
        if on_spoke {
            return Some((k, 0.0));
        }
    }
    let Place::Edge(e, _) = place else { return None };
    let k = ring.iter().position(|&h| edge_of(mesh.next(h)) == e)?;
    Some((k, angle(mesh.point(mesh.target(ring[k])) - centre, network.point(place) - centre)))
}

/// The half-edges out of an inner vertex, counter-clockwise.
fn ring_of(network: &Network<'_>, v: VertexId) -> Vec<HalfedgeId> {
    let first = network.mesh.vertex_halfedge(v);
    let mut ring = vec![first];
    let mut h = twin(network.mesh.prev(first));
    while h != first {
        ring.push(h);
        h = twin(network.mesh.prev(h));
    }
    ring
}

/// Pulls the path off a vertex over the side of the smaller angle.
fn leave_vertex(network: &mut Network<'_>, leash: &Leash, arc: usize, node: u32, v: VertexId) -> bool {
    let here = network.nodes[node as usize];
    let [a, b] = [here.prev, here.next].map(|i| network.nodes[i as usize].place);
    let ring = ring_of(network, v);
    let mesh = network.mesh;
    let centre = mesh.point(v);
    let spokes: Vec<DVec3> = ring.iter().map(|&h| mesh.point(mesh.target(h)) - centre).collect();
    let sectors: Vec<f64> = (0..ring.len()).map(|k| angle(spokes[k], spokes[(k + 1) % ring.len()])).collect();
    let (Some(from), Some(to)) = (direction(network, v, &ring, a), direction(network, v, &ring, b)) else {
        return false;
    };
    let before = |k: usize| sectors[..k].iter().sum::<f64>();
    let whole: f64 = before(sectors.len());
    let left = (before(to.0) + to.1 - before(from.0) - from.1).rem_euclid(whole);
    let is_left = left <= whole - left;
    let wedge = left.min(whole - left);
    if wedge.is_nan() || wedge >= std::f64::consts::PI - STRAIGHT {
        return false;
    }
    let ((start, end), [first, last]) = if is_left { ((from, to), [a, b]) } else { ((to, from), [b, a]) };
    let Some(fan) = fan(network, &ring, &spokes, &sectors, start, end) else { return false };
    let radius = |place| network.point(place).distance(centre);
    let mut places = taut(network, &fan, radius(first), radius(last), wedge);
    if !is_left {
        places.reverse();
    }
    let length = |inner: &[Place]| {
        let all: Vec<DVec3> = [a].iter().chain(inner).chain([&b]).map(|&place| network.point(place)).collect();
        all.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f64>()
    };
    let shorter = length(&places) < length(&[here.place]) * (1.0 - LEAST_GAIN);
    if shorter && places.iter().all(|&place| leash.admits(arc, network.point(place))) {
        network.replace(node, &places);
        return true;
    }
    false
}

/// The spokes strictly between two directions, counter-clockwise; `None` where one has no room.
fn fan(
    network: &Network<'_>,
    ring: &[HalfedgeId],
    spokes: &[DVec3],
    sectors: &[f64],
    start: (usize, f64),
    end: (usize, f64),
) -> Option<Vec<Spoke>> {
    let n = ring.len();
    let mut steps = (end.0 + n - start.0) % n;
    if steps == 0 && end.1 < start.1 {
        steps = n;
    }
    let mut fan = Vec::new();
    let mut angle = -start.1;
    for step in 1..=steps {
        let k = (start.0 + step) % n;
        angle += sectors[(k + n - 1) % n];
        if step == steps && end.1 == 0.0 {
            break;
        }
        let h = ring[k];
        let mut room = if network.is_free(network.mesh.target(h)) { 1.0 } else { 1.0 - END_MARGIN };
        for t in network.others(edge_of(h), NONE) {
            let from_centre = if h == halfedge_of(edge_of(h)) { t } else { 1.0 - t };
            room = room.min(from_centre - MARGIN);
        }
        if room < LEAST_ROOM {
            return None;
        }
        fan.push(Spoke { halfedge: h, angle, length: spokes[k].length(), room });
    }
    Some(fan)
}

/// The taut path from one side of a fan to the other that bends only where a spoke ends or its room does.
fn taut(network: &Network<'_>, fan: &[Spoke], first: f64, last: f64, wedge: f64) -> Vec<Place> {
    let polar = |radius: f64, angle: f64| radius * DVec2::new(libm::cos(angle), libm::sin(angle));
    let mut chain: Vec<(DVec2, f64)> = vec![(polar(first, 0.0), 0.0)];
    let stops = fan.iter().map(|s| (polar(s.room * s.length, s.angle), s.angle)).chain([(polar(last, wedge), wedge)]);
    for (point, angle) in stops {
        // What lies outside the line from its neighbour before to the next point does not hold the path.
        while let [.., (p, _), (q, _)] = chain[..] {
            if (q - p).perp_dot(point - q) >= 0.0 {
                chain.pop();
            } else {
                break;
            }
        }
        chain.push((point, angle));
    }
    let place = |spoke: &Spoke| {
        let k = chain[1..].partition_point(|stop| stop.1 < spoke.angle).min(chain.len() - 2);
        let ([p, q], ray) = ([chain[k].0, chain[k + 1].0], polar(1.0, spoke.angle));
        let radius = p.perp_dot(q) / ray.perp_dot(q - p);
        let share = (radius / spoke.length).clamp(LEAST_ROOM.min(spoke.room), spoke.room);
        if share >= 1.0 - 1e-9 {
            return Place::Vertex(network.mesh.target(spoke.halfedge));
        }
        let e = edge_of(spoke.halfedge);
        Place::Edge(e, if spoke.halfedge == halfedge_of(e) { share } else { 1.0 - share })
    };
    fan.iter().map(place).collect()
}
