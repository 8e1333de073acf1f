// One of the two panes: a canvas with a mesh, its lines, and the element that is pointed at.

import { Color, Mesh, Scene, Vector2, Vector3, WebGLRenderer } from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import { newCamera } from "./camera.js";
import { material } from "./material.js";

export class Pane {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setClearColor(0, 0);
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene = new Scene();
    this.camera = newCamera();
    this.material = material();
    this.size = new Vector2();
    this.lines = new Map();
    this.model = null;
    this.marked = null;
  }

  /** Shows another model, or none. */
  show(model) {
    this.model = model;
    for (const line of this.lines.values()) this.drop(line);
    this.lines.clear();
    if (this.mesh) this.scene.remove(this.mesh);
    this.mesh = model ? new Mesh(model.geometry, this.material) : null;
    if (this.mesh) {
      this.mesh.frustumCulled = false;
      this.scene.add(this.mesh);
    }
    this.mark(null);
  }

  drop(line) {
    this.scene.remove(line);
    line.geometry.dispose();
    line.material.dispose();
  }

  segments(coordinates, colour, width, onTop = false) {
    const geometry = new LineSegmentsGeometry().setPositions(coordinates);
    const line = new LineSegments2(geometry, new LineMaterial({ color: new Color(colour), linewidth: width, depthTest: !onTop }));
    line.frustumCulled = false;
    line.renderOrder = onTop ? 2 : 1;
    return line;
  }

  /** Draws or hides the lines of a kind. */
  async line(key, visible, colour) {
    const model = this.model;
    const entry = model?.entry.lines.find((candidate) => candidate.key === key);
    if (visible && entry && !this.lines.has(key)) {
      const coordinates = await model.segments(entry);
      if (this.model !== model || this.lines.has(key)) return;
      const line = this.segments(coordinates, colour, key === "feature" ? 1.6 : 2.2);
      this.lines.set(key, line);
      this.scene.add(line);
    }
    const line = this.lines.get(key);
    if (line) line.visible = visible;
  }

  /** Marks an element by its corners, given relative to the common centre. */
  mark(corners) {
    if (this.marked) this.drop(this.marked);
    this.marked = null;
    if (!corners?.length) return;
    const ends = corners.flatMap((corner, i) => [...corner, ...corners[(i + 1) % corners.length]]);
    // A vertex has no outline of its own; a cross is drawn instead.
    this.cross = corners.length === 1 ? corners[0] : null;
    const coordinates = this.cross ? this.star(this.cross) : new Float32Array(ends);
    this.marked = this.segments(coordinates, "#ff00c8", 4, true);
    this.scene.add(this.marked);
  }

  star(at) {
    const { right, up } = this.view.axes();
    const reach = this.view.span / 30;
    const ends = [right, up].flatMap((axis) => [-reach, reach].map((r) => new Vector3(...at).addScaledVector(axis, r)));
    return new Float32Array(ends.flatMap((end) => end.toArray()));
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    this.renderer.getSize(this.size);
    if (this.size.x !== clientWidth || this.size.y !== clientHeight) this.renderer.setSize(clientWidth, clientHeight, false);
  }

  draw(view, size) {
    this.view = view;
    this.resize();
    view.apply(this.camera, this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight), size);
    if (this.marked && this.cross) this.marked.geometry.setPositions(this.star(this.cross));
    this.renderer.render(this.scene, this.camera);
  }

  /** The face under a place in the pane, with its point. */
  pick([x, y], view, size) {
    if (!this.model) return null;
    const { right, up, eye } = view.axes();
    const origin = view.target.clone().addScaledVector(right, x * view.span).addScaledVector(up, y * view.span).addScaledVector(eye, 4 * size);
    const direction = eye.clone().negate();
    const hit = this.model.hit(origin.toArray(), direction.toArray());
    return hit && { ...hit, at: origin.addScaledVector(direction, hit.distance).toArray() };
  }
}
