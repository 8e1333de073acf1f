//! Where edits were refused, so that they are not tried again before something changes there.

use super::Cleaner;

/// Counts edits, and knows for each vertex the last one near it and the last time nothing helped there.
#[derive(Debug, Default)]
pub(super) struct Memory {
    edits: u32,
    /// For each vertex the last edit near it, and how many there had been when nothing helped, plus 1.
    seen: Vec<(u32, u32)>,
}

impl Memory {
    fn entry(&mut self, v: u32) -> &mut (u32, u32) {
        if self.seen.len() <= v as usize {
            self.seen.resize(v as usize + 1, (0, 0));
        }
        &mut self.seen[v as usize]
    }

    /// Whether nothing helped at a vertex, and nothing has changed near it since.
    pub(super) fn is_hopeless(&self, v: u32) -> bool {
        self.seen.get(v as usize).is_some_and(|&(changed, refused)| refused > changed)
    }

    /// Nothing helped at a vertex.
    pub(super) fn note_refusal(&mut self, v: u32) {
        let now = self.edits + 1;
        self.entry(v).1 = now;
    }

    fn note_change(&mut self, v: u32) {
        let now = self.edits;
        self.entry(v).0 = now;
    }
}

impl Cleaner<'_, '_> {
    /// The topology changed at these vertices: what was refused at them and next to them is worth another try.
    pub(super) fn note_change(&mut self, vertices: &[u32]) {
        self.memory.edits += 1;
        for &v in vertices {
            if self.mesh.is_vertex(v) {
                for w in std::iter::once(v).chain(self.mesh.neighbours(v)) {
                    self.memory.note_change(w);
                }
            }
        }
    }
}
