//! What was written since a transaction began, and how to take it back.

use glam::DVec3;

use super::{Mixed, NONE, Place};

/// A column of plain numbers.
#[derive(Clone, Copy, Debug)]
pub(super) enum Column {
    Next,
    Prev,
    Origin,
    Face,
    Arc,
    Out,
    First,
    Region,
}

#[derive(Clone, Copy, Debug)]
enum Written {
    Number(Column, u32, u32),
    Point(u32, DVec3, DVec3),
    Place(u32, Place),
}

/// The writes of an open transaction, and how long the columns were when it began.
#[derive(Clone, Debug, Default)]
pub(super) struct Journal {
    is_open: bool,
    writes: Vec<Written>,
    vertices: usize,
    halfedges: usize,
    faces: usize,
}

impl Mixed {
    fn column(&mut self, column: Column) -> &mut Vec<u32> {
        match column {
            Column::Next => &mut self.next,
            Column::Prev => &mut self.prev,
            Column::Origin => &mut self.origin,
            Column::Face => &mut self.face,
            Column::Arc => &mut self.arc,
            Column::Out => &mut self.out,
            Column::First => &mut self.first,
            Column::Region => &mut self.region,
        }
    }

    pub(super) fn set(&mut self, column: Column, index: u32, value: u32) {
        let old = std::mem::replace(&mut self.column(column)[index as usize], value);
        if self.journal.is_open {
            self.journal.writes.push(Written::Number(column, index, old));
        }
    }

    /// Moves a vertex; `normal` is the surface's there.
    pub fn set_point(&mut self, v: u32, point: DVec3, normal: DVec3) {
        if self.journal.is_open {
            self.journal.writes.push(Written::Point(v, self.points[v as usize], self.normals[v as usize]));
        }
        self.points[v as usize] = point;
        self.normals[v as usize] = normal;
    }

    /// Binds a vertex to another place.
    pub fn set_place(&mut self, v: u32, place: Place) {
        if self.journal.is_open {
            self.journal.writes.push(Written::Place(v, self.places[v as usize]));
        }
        self.places[v as usize] = place;
    }

    /// Puts the edge of `h` on a curve, or off it with [`NONE`].
    pub fn set_arc(&mut self, h: u32, arc: u32) {
        self.set(Column::Arc, h >> 1, arc);
    }

    /// Puts a face into another region.
    pub fn set_region(&mut self, f: u32, region: u32) {
        self.set(Column::Region, f, region);
    }

    /// A new vertex without edges.
    pub fn add_vertex(&mut self, point: DVec3, normal: DVec3, place: Place, size: f64) -> u32 {
        self.sizes.push(size);
        self.out.push(NONE);
        self.points.push(point);
        self.normals.push(normal);
        self.places.push(place);
        self.vertex_slots() - 1
    }

    pub(super) fn add_edge(&mut self, a: u32, b: u32, arc: u32) -> u32 {
        let h = self.halfedge_slots();
        for origin in [a, b] {
            self.next.push(NONE);
            self.prev.push(NONE);
            self.origin.push(origin);
            self.face.push(NONE);
        }
        self.arc.push(arc);
        h
    }

    pub(super) fn add_face(&mut self, first: u32, region: u32) -> u32 {
        self.first.push(first);
        self.region.push(region);
        self.stamps.push(0);
        self.face_slots() - 1
    }

    /// Opens a transaction. There is one at a time.
    pub fn begin(&mut self) {
        debug_assert!(!self.journal.is_open);
        self.journal.writes.clear();
        self.journal.is_open = true;
        self.journal.vertices = self.out.len();
        self.journal.halfedges = self.next.len();
        self.journal.faces = self.first.len();
    }

    /// Keeps what was done.
    pub fn commit(&mut self) {
        self.journal.is_open = false;
    }

    /// Takes back everything since [`begin`](Self::begin).
    pub fn rollback(&mut self) {
        self.journal.is_open = false;
        while let Some(write) = self.journal.writes.pop() {
            match write {
                Written::Number(column, index, old) => self.column(column)[index as usize] = old,
                Written::Point(v, point, normal) => {
                    self.points[v as usize] = point;
                    self.normals[v as usize] = normal;
                }
                Written::Place(v, place) => self.places[v as usize] = place,
            }
        }
        let (vertices, halfedges, faces) = (self.journal.vertices, self.journal.halfedges, self.journal.faces);
        self.out.truncate(vertices);
        self.points.truncate(vertices);
        self.normals.truncate(vertices);
        self.places.truncate(vertices);
        self.sizes.truncate(vertices);
        for column in [&mut self.next, &mut self.prev, &mut self.origin, &mut self.face] {
            column.truncate(halfedges);
        }
        self.arc.truncate(halfedges / 2);
        self.first.truncate(faces);
        self.region.truncate(faces);
        self.stamps.truncate(faces);
    }
}
