// A mesh of the page as triangles for the screen: three corners a triangle, so that each has its own value and edges.

import { BufferAttribute, BufferGeometry } from "three";
import * as decode from "./decode.js";

/** The value of elements that have none. */
export const UNDEFINED = -3e38;

export class Model {
  /** Decodes the mesh `entry` of the page's data; coordinates are relative to `centre`. */
  static async load(entry, centre) {
    const model = new Model();
    const [points, corners, quads] = await Promise.all([
      decode.bytes(entry.positions),
      decode.bytes(entry.corners),
      entry.quads ? decode.bytes(entry.quads) : null,
    ]);
    model.entry = entry;
    model.points = decode.positions(points, entry.grid, entry.shown[0], centre);
    model.cut(decode.corners(corners), quads);
    model.geometry = model.build();
    model.columns = new Map();
    return model;
  }

  /** Cuts faces into triangles: their corners, their face, and which corner's opposite side is no edge. */
  cut(corners, quads) {
    const faces = this.entry.shown[1];
    let extra = 0;
    if (quads) for (const quad of quads) extra += quad;
    this.triangles = new Uint32Array(3 * (faces + extra));
    this.faces = new Uint32Array(faces + extra);
    this.inner = new Uint8Array(faces + extra).fill(3);
    this.starts = new Uint32Array(faces + 1);
    let at = 0;
    let t = 0;
    const add = (a, b, c, face, inner) => {
      this.triangles.set([a, b, c], 3 * t);
      this.faces[t] = face;
      this.inner[t++] = inner;
    };
    for (let face = 0; face < faces; face++) {
      this.starts[face] = t;
      const [a, b, c] = [corners[at], corners[at + 1], corners[at + 2]];
      if (quads && quads[face]) {
        const d = corners[at + 3];
        add(a, b, c, face, 1);
        add(a, c, d, face, 2);
        at += 4;
      } else {
        add(a, b, c, face, 3);
        at += 3;
      }
    }
    this.starts[faces] = t;
  }

  build() {
    const count = this.faces.length;
    const position = new Float32Array(9 * count);
    const weight = new Uint8Array(9 * count);
    for (let t = 0; t < count; t++) {
      for (let k = 0; k < 3; k++) {
        const from = 3 * this.triangles[3 * t + k];
        const to = 9 * t + 3 * k;
        position[to] = this.points[from];
        position[to + 1] = this.points[from + 1];
        position[to + 2] = this.points[from + 2];
        weight[to + k] = 255;
      }
      // A weight that is never 0 draws no edge.
      if (this.inner[t] < 3) for (let k = 0; k < 3; k++) weight[9 * t + 3 * k + this.inner[t]] = 255;
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(position, 3));
    geometry.setAttribute("weight", new BufferAttribute(weight, 3, true));
    geometry.setAttribute("value", new BufferAttribute(new Float32Array(3 * count).fill(UNDEFINED), 1));
    return geometry;
  }

  /** The column of this key as `{ column, values }`, or nothing. */
  async column(key) {
    const column = this.entry.columns.find((candidate) => candidate.key === key);
    if (!column) return null;
    if (!this.columns.has(key)) this.columns.set(key, await decode.values(column));
    return { column, values: this.columns.get(key) };
  }

  /** Gives each corner its value. */
  paint(found) {
    const value = this.geometry.getAttribute("value");
    const count = this.faces.length;
    for (let t = 0; t < count; t++) {
      for (let k = 0; k < 3; k++) {
        let v = UNDEFINED;
        if (found) v = found.values[found.column.on === "face" ? this.faces[t] : this.triangles[3 * t + k]];
        value.array[3 * t + k] = Number.isNaN(v) ? UNDEFINED : v;
      }
    }
    value.needsUpdate = true;
  }

  /** The coordinates of the ends of lines, six numbers each. */
  async segments(line) {
    const ends = decode.pairs(await decode.bytes(line.ends));
    const result = new Float32Array(3 * ends.length);
    ends.forEach((v, i) => result.set(this.points.subarray(3 * v, 3 * v + 3), 3 * i));
    return result;
  }

  /** The nearest triangle that the line from `origin` along `direction` meets, both as [x, y, z]. */
  hit(origin, direction) {
    const p = this.points;
    let best = Infinity;
    let found = -1;
    for (let t = 0; t < this.faces.length; t++) {
      const a = 3 * this.triangles[3 * t];
      const b = 3 * this.triangles[3 * t + 1];
      const c = 3 * this.triangles[3 * t + 2];
      const e1x = p[b] - p[a], e1y = p[b + 1] - p[a + 1], e1z = p[b + 2] - p[a + 2];
      const e2x = p[c] - p[a], e2y = p[c + 1] - p[a + 1], e2z = p[c + 2] - p[a + 2];
      const hx = direction[1] * e2z - direction[2] * e2y;
      const hy = direction[2] * e2x - direction[0] * e2z;
      const hz = direction[0] * e2y - direction[1] * e2x;
      const det = e1x * hx + e1y * hy + e1z * hz;
      if (det === 0) continue;
      const sx = origin[0] - p[a], sy = origin[1] - p[a + 1], sz = origin[2] - p[a + 2];
      const u = (sx * hx + sy * hy + sz * hz) / det;
      if (u < 0 || u > 1) continue;
      const qx = sy * e1z - sz * e1y, qy = sz * e1x - sx * e1z, qz = sx * e1y - sy * e1x;
      const v = (direction[0] * qx + direction[1] * qy + direction[2] * qz) / det;
      if (v < 0 || u + v > 1) continue;
      const distance = (e2x * qx + e2y * qy + e2z * qz) / det;
      if (distance < best) {
        best = distance;
        found = t;
      }
    }
    return found < 0 ? null : { face: this.faces[found], triangle: found, distance: best };
  }

  /** The outline of a face as [x, y, z] corners. */
  outline(face) {
    const first = this.starts[face];
    const corner = (t, k) => Array.from(this.points.subarray(3 * this.triangles[3 * t + k], 3 * this.triangles[3 * t + k] + 3));
    const all = [corner(first, 0), corner(first, 1), corner(first, 2)];
    if (this.starts[face + 1] - first === 2) all.push(corner(first + 1, 2));
    return all;
  }
}
