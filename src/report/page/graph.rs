//! The graph of a run as a drawing (SVG): layers from left to right, few crossings, links to the steps.
//!
//! # Algorithm
//! A node's layer is its longest way from a file. Edges over several layers get a waypoint in each layer between.
//! Nodes of a layer are ordered by the mean place of their neighbours, to and fro, then pulled to their height without
//! overlap (after Sugiyama, Tagawa, Toda. Methods for visual understanding of hierarchical system structures, 1981).

use std::collections::BTreeMap;
use std::fmt::Write;

use super::text::escape;

const NODE: [f64; 2] = [128.0, 46.0];
const GAP: [f64; 2] = [29.0, 18.0];
/// Height that a passing edge takes.
const LANE: f64 = 8.0;
/// Rounds of ordering; more change nothing on graphs of this kind.
const ROUNDS: usize = 8;

/// A node of the drawing.
#[derive(Clone, Debug, Default)]
pub(super) struct GraphNode {
    /// The first line.
    pub(super) name: String,
    /// The second line.
    pub(super) kind: String,
    /// State or time, at the right of the first line.
    pub(super) note: String,
    /// CSS classes: what it is and its state.
    pub(super) class: String,
    /// Where a click leads within the page; empty for nowhere.
    pub(super) link: String,
    /// What a pointer on it, or a screen reader, tells.
    pub(super) title: String,
}

/// Nodes and directed edges by position.
#[derive(Clone, Debug, Default)]
pub(super) struct Graph {
    pub(super) nodes: Vec<GraphNode>,
    pub(super) edges: Vec<(usize, usize)>,
}

/// Something with a place in a layer: a node, or a waypoint of an edge.
struct Spot {
    height: f64,
    y: f64,
    before: Vec<usize>,
    after: Vec<usize>,
}

struct Layout {
    spots: Vec<Spot>,
    layers: Vec<Vec<usize>>,
    /// Spots that each edge passes, ends included.
    ways: Vec<Vec<usize>>,
}

/// Draws a graph without circles. Edges that would close one are left out.
pub(super) fn draw(graph: &Graph) -> String {
    let layout = Layout::new(graph);
    let low = layout.spots.iter().map(|s| s.y - s.height / 2.0).fold(f64::INFINITY, f64::min).min(0.0);
    let high = layout.spots.iter().map(|s| s.y + s.height / 2.0).fold(0.0, f64::max);
    let width = layout.layers.len() as f64 * (NODE[0] + GAP[0]) - GAP[0] + 4.0;
    let height = high - low + 4.0;
    let mut text = format!(
        r#"<svg class="graph" viewBox="-2 {:.1} {width:.1} {height:.1}" width="{width:.0}" height="{height:.0}" role="group" aria-label="Graph of the run">"#,
        low - 2.0
    );
    let column = layout.columns();
    for way in &layout.ways {
        let _ = write!(text, r#"<path class="edge" d="{}"/>"#, layout.path(way, &column));
    }
    for (index, node) in graph.nodes.iter().enumerate() {
        draw_node(&mut text, node, column[index] * (NODE[0] + GAP[0]), layout.spots[index].y);
    }
    text.push_str("</svg>");
    text
}

fn draw_node(text: &mut String, node: &GraphNode, x: f64, y: f64) {
    let (top, [width, height]) = (y - NODE[1] / 2.0, NODE);
    let (open, close) = if node.link.is_empty() {
        (format!(r#"<g class="node {}">"#, escape(&node.class)), "</g>")
    } else {
        (format!(r##"<a class="node {}" href="#{}">"##, escape(&node.class), escape(&node.link)), "</a>")
    };
    let fit = |words: &str, most: usize| {
        if words.chars().count() <= most {
            escape(words)
        } else {
            escape(&(words.chars().take(most - 1).collect::<String>() + "…"))
        }
    };
    let _ = write!(
        text,
        r#"{open}<title>{}</title><rect x="{x:.1}" y="{top:.1}" width="{width}" height="{height}" rx="7"/><rect class="mark" x="{x:.1}" y="{:.1}" width="4" height="{}" rx="2"/><text class="name" x="{:.1}" y="{:.1}">{}</text><text class="kind" x="{:.1}" y="{:.1}">{}</text><text class="note" x="{:.1}" y="{:.1}">{}</text>{close}"#,
        escape(&node.title),
        top + 7.0,
        height - 14.0,
        x + 12.0,
        top + 19.0,
        fit(&node.name, if node.note.is_empty() { 15 } else { 14_usize.saturating_sub(node.note.chars().count() / 2) }),
        x + 12.0,
        top + 36.0,
        fit(&node.kind, 19),
        x + width - 8.0,
        top + 19.0,
        escape(&node.note)
    );
}

impl Layout {
    fn new(graph: &Graph) -> Self {
        let layer = layers(graph);
        let mut layout = Self {
            spots: Vec::new(),
            layers: vec![Vec::new(); layer.iter().max().map_or(0, |l| l + 1)],
            ways: Vec::new(),
        };
        for &l in &layer {
            layout.add(l, NODE[1] + GAP[1]);
        }
        for &(from, to) in graph.edges.iter().filter(|(from, to)| layer[*from] < layer[*to]) {
            let mut way = vec![from];
            way.extend((layer[from] + 1..layer[to]).map(|l| layout.add(l, LANE)));
            way.push(to);
            for pair in way.windows(2) {
                layout.spots[pair[0]].after.push(pair[1]);
                layout.spots[pair[1]].before.push(pair[0]);
            }
            layout.ways.push(way);
        }
        layout.arrange();
        layout
    }

    fn add(&mut self, layer: usize, height: f64) -> usize {
        self.spots.push(Spot { height, y: 0.0, before: Vec::new(), after: Vec::new() });
        self.layers[layer].push(self.spots.len() - 1);
        self.spots.len() - 1
    }

    fn arrange(&mut self) {
        for layer in 0..self.layers.len() {
            self.stack(layer, &|layout, spot| layout.spots[spot].y);
        }
        let mean = |spots: &[Spot], of: &[usize], otherwise: f64| {
            if of.is_empty() { otherwise } else { of.iter().map(|i| spots[*i].y).sum::<f64>() / of.len() as f64 }
        };
        for round in 0..ROUNDS {
            let forward = round % 2 == 0;
            for step in 0..self.layers.len() {
                let layer = if forward { step } else { self.layers.len() - 1 - step };
                let wanted: BTreeMap<usize, f64> = self.layers[layer]
                    .iter()
                    .map(|&i| {
                        let spot = &self.spots[i];
                        (i, mean(&self.spots, if forward { &spot.before } else { &spot.after }, spot.y))
                    })
                    .collect();
                self.layers[layer].sort_by(|a, b| wanted[a].total_cmp(&wanted[b]));
                self.stack(layer, &|_, spot| wanted[&spot]);
            }
        }
    }

    /// Puts the spots of a layer as near to the heights wanted as their order and sizes allow: neighbours that would
    /// overlap move together.
    fn stack(&mut self, layer: usize, wanted: &dyn Fn(&Self, usize) -> f64) {
        // A block is a run of spots that touch: its first place, its length, and what its spots want of its start.
        let mut blocks: Vec<(Vec<usize>, f64, f64)> = Vec::new();
        for &spot in &self.layers[layer] {
            let height = self.spots[spot].height;
            let mut block = (vec![spot], height, wanted(self, spot) - height / 2.0);
            while let Some(last) = blocks.pop_if(|last| last.2 + last.1 > block.2) {
                let count = (last.0.len() + block.0.len()) as f64;
                let start = (last.2 * last.0.len() as f64 + (block.2 - last.1) * block.0.len() as f64) / count;
                block = ([last.0, block.0].concat(), last.1 + block.1, start);
            }
            blocks.push(block);
        }
        for (spots, _, start) in blocks {
            let mut top = start;
            for spot in spots {
                self.spots[spot].y = top + self.spots[spot].height / 2.0;
                top += self.spots[spot].height;
            }
        }
    }

    /// The column of each spot.
    fn columns(&self) -> Vec<f64> {
        let mut columns = vec![0.0; self.spots.len()];
        for (index, layer) in self.layers.iter().enumerate() {
            for &spot in layer {
                columns[spot] = index as f64;
            }
        }
        columns
    }

    fn path(&self, way: &[usize], column: &[f64]) -> String {
        let left = |spot: usize| column[spot] * (NODE[0] + GAP[0]);
        let mut path = String::new();
        for (index, pair) in way.windows(2).enumerate() {
            let (from, to) = (left(pair[0]) + NODE[0], left(pair[1]));
            let (y, to_y) = (self.spots[pair[0]].y, self.spots[pair[1]].y);
            if index == 0 {
                let _ = write!(path, "M{from:.1} {y:.1}");
            } else {
                // Through a waypoint the line runs straight.
                let _ = write!(path, "L{from:.1} {y:.1}");
            }
            let middle = 0.5 * (from + to);
            let _ = write!(path, "C{middle:.1} {y:.1} {middle:.1} {to_y:.1} {to:.1} {to_y:.1}");
        }
        path
    }
}

/// The longest way from a node without inputs; nodes on a circle count as far as they were reached.
fn layers(graph: &Graph) -> Vec<usize> {
    let mut layer = vec![0; graph.nodes.len()];
    for _ in 0..graph.nodes.len() {
        let mut changed = false;
        for &(from, to) in &graph.edges {
            if layer[to] <= layer[from] && layer[from] + 1 < graph.nodes.len() {
                layer[to] = layer[from] + 1;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    // A file is drawn next to the step that reads it.
    for node in 0..graph.nodes.len() {
        let is_source = graph.edges.iter().all(|(_, to)| *to != node);
        let nearest = graph.edges.iter().filter(|(from, _)| *from == node).map(|(_, to)| layer[*to]).min();
        if let (true, Some(nearest)) = (is_source, nearest) {
            layer[node] = nearest.saturating_sub(1);
        }
    }
    layer
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(count: usize, edges: &[(usize, usize)]) -> Graph {
        let node = |i: usize| GraphNode { name: format!("n{i}"), ..GraphNode::default() };
        Graph { nodes: (0..count).map(node).collect(), edges: edges.to_vec() }
    }

    #[test]
    fn nodes_of_a_layer_do_not_overlap() {
        let layout = Layout::new(&graph(7, &[(0, 1), (1, 2), (1, 3), (1, 4), (0, 5), (4, 6), (0, 6)]));
        for layer in &layout.layers {
            let mut spots: Vec<&Spot> = layer.iter().map(|i| &layout.spots[*i]).collect();
            spots.sort_by(|a, b| a.y.total_cmp(&b.y));
            for pair in spots.windows(2) {
                assert!(pair[1].y - pair[0].y >= f64::midpoint(pair[0].height, pair[1].height) - 1e-9);
            }
        }
        assert_eq!(layout.ways.last().map(Vec::len), Some(4));
    }

    #[test]
    fn a_chain_is_straight_and_a_circle_ends() {
        let layout = Layout::new(&graph(4, &[(0, 1), (1, 2), (2, 3)]));
        assert!(layout.spots.iter().all(|spot| (spot.y - layout.spots[0].y).abs() < 1e-9));
        assert!(draw(&graph(3, &[(0, 1), (1, 2), (2, 0)])).ends_with("</svg>"));
        assert!(draw(&Graph::default()).contains("<svg"));
    }
}
