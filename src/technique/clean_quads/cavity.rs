//! Cavities round irregular vertices are filled anew with as few irregular vertices as their rims allow.
//!
//! A cavity grows quad by quad from an irregular vertex; whenever its rim turns like a polygon of two to six sides it
//! may be filled by the patches of [`fill`](crate::technique::fill). So irregular vertices that lie apart, which no
//! edit of a few quads brings together, cancel each other out. A filling is smoothed, looked at, and taken back unless
//! it is as well shaped as what was there.
//!
//! Based on: G. Bunin. Non-local topological clean-up. 15th International Meshing Roundtable, 2006.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::filling::{COSTLY, LESS, cuts, lay_flat, misshape};
use super::{Cleaner, valence};
use crate::mesh::VertexId;
use crate::technique::fill::{Cut, Outline, Pattern};
use crate::technique::mixed::{Disk, Mixed, NONE};
use crate::watch::{Cancelled, Watch};

/// Larger cavities change more than they gain.
const LARGEST: usize = 120;

/// What was looked at round vertices in vain: while those faces are there, another look rarely finds more.
#[derive(Debug, Default)]
pub(super) struct Refused {
    cavities: FxHashMap<u32, Vec<u32>>,
}

impl Refused {
    fn stands(&self, mesh: &Mixed, v: u32) -> bool {
        self.cavities.get(&v).is_some_and(|faces| !faces.is_empty() && faces.iter().all(|&f| mesh.is_face(f)))
    }
}

/// A vertex of a cavity.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Quads of the cavity.
    inside: i32,
    /// Quads there are, between two curves or all round, and how many there should be.
    quads: i32,
    wanted: i32,
    /// What it costs until it has them.
    cost: f64,
    is_free: bool,
}

impl Seen {
    /// How many quads inside a vertex of the rim should have; `None` inside.
    fn turn(&self) -> Option<i32> {
        let outside = self.quads - self.inside;
        (outside > 0 || !self.is_free).then_some(self.wanted - outside)
    }
}

/// Quads that form a disk, while it grows.
struct Cavity {
    disk: Disk,
    seen: FxHashMap<u32, Seen>,
    /// What its vertices cost.
    cost: f64,
    /// Vertices of the rim by how many quads inside they should have: 1, 2, 3, and any other number.
    turns: [usize; 4],
    /// Faces beside the cavity, with the number of common edges.
    beside: BTreeMap<u32, i32>,
    /// With fewer faces it is not looked for rows again.
    rows_from: usize,
}

impl Cavity {
    fn new(mesh: &Mixed, faces: &[u32]) -> Option<Self> {
        let &first = faces.first()?;
        let disk = Disk::of(mesh, first);
        let (seen, beside) = (FxHashMap::default(), BTreeMap::new());
        let mut cavity = Self { disk, seen, cost: 0.0, turns: [0; 4], beside, rows_from: 0 };
        cavity.note(mesh, first);
        for _ in 1..faces.len() {
            let &next = faces.iter().find(|&&f| cavity.disk.may_add(mesh, f))?;
            cavity.add(mesh, next);
        }
        Some(cavity)
    }

    fn add(&mut self, mesh: &Mixed, face: u32) {
        self.disk.add(mesh, face);
        self.note(mesh, face);
    }

    /// Counts what a face that is new in the disk changes.
    fn note(&mut self, mesh: &Mixed, face: u32) {
        self.beside.remove(&face);
        for h in mesh.sides(face) {
            let v = mesh.origin(h);
            let before = self.seen.get(&v).copied();
            let mut now = before.unwrap_or_else(|| seen(mesh, h));
            if let Some(turn) = before.and_then(|b| b.turn()) {
                self.turns[place(turn)] -= 1;
            }
            if before.is_none() {
                self.cost += now.cost;
            }
            now.inside += 1;
            if let Some(turn) = now.turn() {
                self.turns[place(turn)] += 1;
            }
            self.seen.insert(v, now);
            let other = mesh.face(h ^ 1);
            if other != NONE && mesh.arc(h) == NONE && !mesh.is_triangle(other) && !self.disk.contains(other) {
                *self.beside.entry(other).or_default() += 1;
            }
        }
    }

    /// Whether a filling could cost less than what is there.
    fn may_gain(&self) -> bool {
        /// Vertices that turn back which one row can join.
        const MOST: usize = 2;
        let [corners, _, reflex, others] = self.turns;
        if others > 0 || reflex > MOST || !(2 + reflex..=6 + reflex).contains(&corners) {
            return false;
        }
        let least = (corners as f64 - reflex as f64 - 4.0).abs();
        self.cost > least + LESS
    }

    /// A filling that costs less than what is there.
    fn filling(&mut self, mesh: &Mixed, rim: &[u32]) -> Option<Pattern> {
        let turn = |v: u32| self.seen.get(&v).and_then(Seen::turn);
        let places = |wanted: i32| (0..rim.len()).filter(|&k| turn(rim[k]) == Some(wanted)).collect::<Vec<_>>();
        let (corners, reflex) = (places(1), places(3));
        let is_straight = reflex.is_empty();
        let nodes = rim.iter().map(|&v| VertexId::from_raw(v)).collect();
        let outline = Outline { nodes, corners, reflex };
        if let Some(faces) = if is_straight { outline.whole(&mut 0) } else { None } {
            return self.is_of_the_size(faces.len()).then(|| {
                let mut pattern = Pattern::over(&outline.nodes, &faces);
                lay_flat(mesh, &self.disk, rim).place(&mut pattern);
                pattern
            });
        }
        // Straight loops of one quad more rarely take a row where those before did not.
        if is_straight && self.disk.faces.len() < self.rows_from {
            return None;
        }
        if is_straight && self.cost > COSTLY {
            self.rows_from = self.disk.faces.len() * 9 / 8 + 1;
        }
        let cuts = cuts(mesh, &outline, self.cost);
        let made = |cut: &Cut| outline.in_two(*cut).filter(|faces| self.is_of_the_size(faces.len()));
        let mut fillings: Vec<Pattern> =
            cuts.iter().filter_map(made).map(|faces| Pattern::over(&outline.nodes, &faces)).collect();
        if fillings.is_empty() {
            return None;
        }
        let flat = lay_flat(mesh, &self.disk, rim);
        for pattern in &mut fillings {
            flat.place(pattern);
        }
        let judged = fillings.into_iter().map(|pattern| (misshape(mesh, rim, &pattern), pattern));
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
    }

    /// Whether so many faces are about as many as there are.
    fn is_of_the_size(&self, faces: usize) -> bool {
        let now = self.disk.faces.len();
        4 * faces >= 3 * now && 2 * faces <= 3 * now + 4
    }

    /// The neighbour that makes the cavity roundest and keeps it a disk: at a vertex that no filling can have on its
    /// rim first, then the one with most common edges.
    fn next(&self, mesh: &Mixed) -> Option<u32> {
        /// Neighbours tried.
        const CHOICES: usize = 8;
        let score = |(&f, &common): (&u32, &i32)| {
            let at = |h: u32| match self.seen.get(&mesh.origin(h)).and_then(Seen::turn) {
                None => 0,
                Some(1 | 2) => 1,
                Some(_) => 25,
            };
            (-10 * common - mesh.sides(f).map(at).sum::<i32>(), f)
        };
        let mut ranked: Vec<(i32, u32)> = self.beside.iter().map(score).collect();
        ranked.sort_unstable();
        ranked.into_iter().take(CHOICES).map(|r| r.1).find(|&f| self.disk.may_add(mesh, f))
    }
}

/// The place of a turn among those that are counted.
fn place(turn: i32) -> usize {
    if (1..=3).contains(&turn) { turn as usize - 1 } else { 3 }
}

/// The origin of `h`, as the face of `h` has it.
fn seen(mesh: &Mixed, h: u32) -> Seen {
    let v = mesh.origin(h);
    let is_free = mesh.place(v).is_free();
    let sector = if is_free { None } else { valence::sector_of(mesh, h) };
    if let Some((quads, angle)) = sector {
        let wanted = valence::ideal(angle);
        let cost = valence::cost(quads, angle);
        return Seen { inside: 0, quads: quads as i32, wanted: wanted as i32, cost, is_free };
    }
    let quads = mesh.valence(v) as i32;
    let cost = f64::from((quads - 4) * (quads - 4));
    Seen { inside: 0, quads, wanted: 4, cost, is_free }
}

impl Cleaner<'_, '_> {
    /// Grows cavities round irregular vertices; how many were filled anew.
    pub(super) fn fill_cavities(&mut self, refused: &mut Refused, watch: &Watch) -> Result<usize, Cancelled> {
        let mut filled = 0;
        for v in 0..self.mesh.vertex_slots() {
            if !self.mesh.is_vertex(v) || !self.is_awake(v) || self.misfit(v) == 0.0 || refused.stands(self.mesh, v) {
                continue;
            }
            watch.check()?;
            let mut looked = Vec::new();
            if self.seeds(v).iter().any(|faces| self.grow(faces, &mut looked)) {
                filled += 1;
            } else {
                refused.cavities.insert(v, looked);
            }
        }
        Ok(filled)
    }

    /// The faces at a vertex: all of them, or those of each sector that has not the quads that it should have.
    fn seeds(&self, v: u32) -> Vec<Vec<u32>> {
        if self.is_free(v) {
            return vec![self.mesh.faces_at(v).collect()];
        }
        let mut seeds = Vec::new();
        valence::walk_sectors(self.mesh, v, |corners, angle| {
            if valence::cost(corners.len() as f64, angle) > 0.0 {
                seeds.push(corners.iter().map(|&h| self.mesh.face(h)).collect());
            }
        });
        seeds
    }

    /// Grows a cavity from some faces until it is filled anew. Where it is not, `looked` gets its faces.
    fn grow(&mut self, faces: &[u32], looked: &mut Vec<u32>) -> bool {
        /// Refused fillings before a cavity is given up.
        const TRIES: usize = 4;
        if faces.len() > LARGEST
            || faces.iter().any(|&f| self.mesh.is_triangle(f) || !self.awake[self.mesh.region(f) as usize])
        {
            return false;
        }
        let Some(mut cavity) = Cavity::new(self.mesh, faces) else { return false };
        let mut tries = 0;
        loop {
            if cavity.may_gain() {
                let rim = cavity.disk.rim(self.mesh);
                if let Some(pattern) = cavity.filling(self.mesh, &rim) {
                    if self.fill_anew(&cavity.disk.faces, &rim, &pattern) {
                        return true;
                    }
                    tries += 1;
                }
            }
            let is_done = cavity.disk.faces.len() >= LARGEST || tries >= TRIES;
            let Some(next) = (if is_done { None } else { cavity.next(self.mesh) }) else {
                looked.extend(&cavity.disk.faces);
                return false;
            };
            cavity.add(self.mesh, next);
        }
    }
}
