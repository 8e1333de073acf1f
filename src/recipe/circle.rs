//! The order in which things that need each other can be done, and the circles that prevent it.

use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};

/// What [`order`] found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Order {
    /// Everything that is in no circle, needs first.
    pub sorted: Vec<usize>,
    /// Circles as paths: each needs the next, the last one needs the first. One for each tangle of circles.
    pub circles: Vec<Vec<usize>>,
}

/// Orders `needs.len()` things, where thing `i` needs the things `needs[i]`. Linear, without recursion.
pub fn order(needs: &[Vec<usize>]) -> Order {
    let mut graph = DiGraph::<(), (), usize>::with_capacity(needs.len(), needs.iter().map(Vec::len).sum());
    for _ in needs {
        graph.add_node(());
    }
    for (thing, needed) in needs.iter().enumerate() {
        for need in needed {
            graph.add_edge(NodeIndex::new(thing), NodeIndex::new(*need), ());
        }
    }
    let mut found = Order::default();
    for component in kosaraju_scc(&graph) {
        let mut members: Vec<usize> = component.iter().map(|node| node.index()).collect();
        members.sort_unstable();
        match members.as_slice() {
            [single] if !needs[*single].contains(single) => found.sorted.push(*single),
            _ => found.circles.push(circle(&members, needs)),
        }
    }
    found.circles.sort();
    found
}

/// A path around a strongly connected set: from the first member along the lowest need inside, until one repeats.
fn circle(members: &[usize], needs: &[Vec<usize>]) -> Vec<usize> {
    let inside = |need: &usize| members.binary_search(need).is_ok();
    let mut path: Vec<usize> = Vec::new();
    let mut visited = vec![None; members.len()];
    let mut at = members.first().copied();
    while let Some(thing) = at {
        let Ok(slot) = members.binary_search(&thing) else { break };
        if let Some(start) = visited[slot] {
            path.drain(..start);
            break;
        }
        visited[slot] = Some(path.len());
        path.push(thing);
        at = needs[thing].iter().copied().filter(inside).min();
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn puts_needs_first() {
        let found = order(&[vec![1, 2], vec![2], vec![]]);
        assert_eq!(found, Order { sorted: vec![2, 1, 0], circles: vec![] });
    }

    #[test]
    fn finds_circles_as_paths() {
        let found = order(&[vec![1], vec![2], vec![1], vec![3]]);
        assert_eq!(found, Order { sorted: vec![0], circles: vec![vec![1, 2], vec![3]] });
    }

    #[test]
    fn long_chains_do_not_exhaust_the_stack() {
        let count = 200_000;
        let needs: Vec<_> = (0..count).map(|i| if i + 1 < count { vec![i + 1] } else { vec![] }).collect();
        assert_eq!(order(&needs).sorted.len(), count);
    }
}
