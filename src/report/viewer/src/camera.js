// Where one looks from: a parallel view that turns about a point, z upwards.

import { OrthographicCamera, Vector3 } from "three";

const RIGHT_ANGLE = Math.PI / 2;
const STILL = matchMedia("(prefers-reduced-motion: reduce)");

/** A place to look from; two panes share one while their cameras are linked. */
export class View {
  constructor() {
    this.target = new Vector3();
    this.yaw = -0.9;
    this.pitch = 0.48;
    this.span = 1;
    this.flight = 0;
  }

  copy(other) {
    this.target.copy(other.target);
    [this.yaw, this.pitch, this.span] = [other.yaw, other.pitch, other.span];
    return this;
  }

  /** Unit vectors to the right, upwards and to the eye. */
  axes() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    return { right: new Vector3(-sy, cy, 0), up: new Vector3(-cy * sp, -sy * sp, cp), eye: new Vector3(cy * cp, sy * cp, sp) };
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(RIGHT_ANGLE, Math.max(-RIGHT_ANGLE, this.pitch + pitch));
  }

  /** Moves by parts of the span. */
  move(x, y) {
    const { right, up } = this.axes();
    this.target.addScaledVector(right, -x * this.span).addScaledVector(up, y * this.span);
  }

  /** Zooms about a point of the pane, given in parts of the span from its middle. */
  zoom(factor, x = 0, y = 0) {
    const span = Math.min(1e9, Math.max(1e-9, this.span * factor));
    const { right, up } = this.axes();
    this.target.addScaledVector(right, x * (this.span - span)).addScaledVector(up, y * (this.span - span));
    this.span = span;
  }

  /** Goes to another view, step by step unless motion is unwanted. */
  fly(to, redraw) {
    const from = new View().copy(this);
    const turn = ((((to.yaw - from.yaw + Math.PI) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI)) - Math.PI;
    const flight = ++this.flight;
    const start = performance.now();
    const step = (now) => {
      if (flight !== this.flight) return;
      const part = STILL.matches ? 1 : Math.min(1, Math.max(0, (now - start) / 450));
      const s = part * part * (3 - 2 * part);
      this.target.lerpVectors(from.target, to.target, s);
      this.yaw = from.yaw + turn * s;
      this.pitch = from.pitch + (to.pitch - from.pitch) * s;
      this.span = from.span * (to.span / from.span) ** s;
      redraw();
      if (part < 1) requestAnimationFrame(step);
    };
    step(start);
  }

  /** Sets a camera of three.js for a pane of this shape and a model of this size. */
  apply(camera, aspect, size) {
    const { up, eye } = this.axes();
    const half = this.span / 2;
    const [x, y] = aspect >= 1 ? [half * aspect, half] : [half, half / aspect];
    Object.assign(camera, { left: -x, right: x, top: y, bottom: -y, near: 0, far: 8 * size });
    camera.up.copy(up);
    camera.position.copy(this.target).addScaledVector(eye, 4 * size);
    camera.lookAt(this.target);
    camera.updateProjectionMatrix();
  }
}

export const newCamera = () => new OrthographicCamera();

/** Pointers, wheel and keys of a canvas move the view that `view()` gives. `click` gets a place in the pane. */
export function listen(canvas, { view, redraw, click, fit }) {
  const pointers = new Map();
  let travelled = 0;
  const unit = () => Math.min(canvas.clientWidth, canvas.clientHeight);
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left - box.width / 2, box.height / 2 - (event.clientY - box.top)].map((v) => v / unit());
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    travelled = 0;
    view().flight++;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    travelled += Math.abs(dx) + Math.abs(dy);
    if (pointers.size === 2) {
      const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const distance = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]);
      view().zoom(distance(before) / Math.max(1, distance([event.clientX, event.clientY])));
      view().move(dx / unit() / 2, dy / unit() / 2);
    } else if (event.shiftKey || event.buttons & 6) {
      view().move(dx / unit(), dy / unit());
    } else {
      view().turn((-dx / unit()) * 3.2, (dy / unit()) * 3.2);
    }
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    redraw();
  });
  const end = (event) => {
    if (pointers.delete(event.pointerId) && event.type === "pointerup" && travelled < 4) click(place(event));
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    view().flight++;
    view().zoom(Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.004), ...place(event));
    redraw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const step = 0.12;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const arrow = arrows[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (arrow && event.shiftKey) view().move((-arrow[0] * step) / 2, (arrow[1] * step) / 2);
    else if (arrow) view().turn(arrow[0] * step, arrow[1] * step);
    else if (event.key === "+" || event.key === "=") view().zoom(0.8);
    else if (event.key === "-") view().zoom(1.25);
    else if (event.key === "0" || event.key === "Home") fit();
    else return;
    event.preventDefault();
    view().flight++;
    redraw();
  });
}
