// The viewer of the report: two panes, one of the page's meshes in each, with linked cameras.

import { Vector3 } from "three";
import { View, listen } from "./camera.js";
import { digits, legend } from "./legend.js";
import { namesTexture, rampTexture } from "./material.js";
import { Model } from "./model.js";
import { Pane } from "./pane.js";

const LINES = {
  "feature": ["#11161d", true],
  "region-border": ["#7a1fc2", true],
  "boundary": ["#d0107f", true],
  "seam": ["#00824f", true],
  "locked": ["#5d5d5d", false],
  "non-manifold": ["#e25400", true],
};
const GROUP_COLOURS = ["#0868ac", "#a6611a", "#01665e", "#762a83", "#b2182b", "#4d4d4d"];
const $ = (id) => document.getElementById(id);

class Viewer {
  constructor(data) {
    this.data = data;
    this.models = new Map();
    this.shared = new View();
    this.views = [this.shared, this.shared];
    this.ranges = new Map();
    this.textures = Object.fromEntries(Object.entries(data.ramps).map(([name, stops]) => [name, rampTexture(stops)]));
    this.frame();
    this.panes = [0, 1].map((side) => new Pane($(`canvas-${side}`)));
    this.names = data.pair.map((name) => (this.entry(name) ? name : data.meshes[0].name));
    this.controls();
  }

  entry(name) {
    return this.data.meshes.find((mesh) => mesh.name === name);
  }

  /** The common centre and size of all meshes. */
  frame() {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const { grid } of this.data.meshes) {
      for (let axis = 0; axis < 3; axis++) {
        low[axis] = Math.min(low[axis], grid.origin[axis]);
        high[axis] = Math.max(high[axis], grid.origin[axis] + 65535 * grid.step);
      }
    }
    this.centre = low.map((v, axis) => (v + high[axis]) / 2);
    this.size = Math.max(Math.hypot(...high.map((v, axis) => v - low[axis])), 1e-12);
  }

  /** The span that shows all of a model from where one looks. */
  fitted(view, models) {
    const { right, up } = view.axes();
    const box = { low: [Infinity, Infinity], high: [-Infinity, -Infinity] };
    const at = new Vector3();
    for (const model of models) {
      for (let i = 0; i < model.points.length; i += 3) {
        at.fromArray(model.points, i);
        [at.dot(right), at.dot(up)].forEach((value, axis) => {
          box.low[axis] = Math.min(box.low[axis], value);
          box.high[axis] = Math.max(box.high[axis], value);
        });
      }
    }
    const { clientWidth, clientHeight } = this.panes[0].canvas;
    const unit = Math.min(clientWidth, clientHeight);
    const extent = [0, 1].map((axis) => box.high[axis] - box.low[axis]);
    const span = 1.06 * Math.max((extent[0] * unit) / clientWidth, (extent[1] * unit) / clientHeight);
    const middle = [0, 1].map((axis) => (box.low[axis] + box.high[axis]) / 2);
    const result = new View().copy(view);
    result.target.set(0, 0, 0).addScaledVector(right, middle[0]).addScaledVector(up, middle[1]);
    result.span = span > 0 && Number.isFinite(span) ? span : this.size;
    return result;
  }

  fit(side, fly = true) {
    const linked = this.views[0] === this.views[1];
    for (const index of linked ? [0] : [side]) {
      const models = this.panes.filter((_, i) => linked || i === index).map((pane) => pane.model).filter(Boolean);
      const to = this.fitted(this.views[index], models);
      if (fly) this.views[index].fly(to, () => this.redraw());
      else this.views[index].copy(to);
    }
    this.redraw();
  }

  redraw() {
    if (this.waiting || this.holding) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = null;
      this.panes.forEach((pane, side) => pane.draw(this.views[side], this.size));
    });
  }

  controls() {
    const options = this.data.meshes.map((mesh) => [mesh.name, `${mesh.name} (${mesh.kind})`]);
    this.panes.forEach((pane, side) => {
      const select = $(`mesh-${side}`);
      select.append(...options.map(([value, text]) => new Option(text, value)));
      select.addEventListener("change", () => this.show(side, select.value));
      listen(pane.canvas, {
        view: () => this.views[side],
        redraw: () => this.redraw(),
        click: (place) => this.click(side, place),
        fit: () => this.fit(side),
      });
      new ResizeObserver(() => this.redraw()).observe(pane.canvas);
    });
    $("colour").addEventListener("change", () => this.colour());
    $("linked").addEventListener("change", () => this.link());
    $("edges").addEventListener("change", () => this.style());
    for (const button of document.querySelectorAll("[data-view]")) {
      button.addEventListener("click", () => this.look(button.dataset.view));
    }
    document.addEventListener("click", (event) => {
      const fly = event.target.closest?.(".fly");
      const show = event.target.closest?.(".show");
      if (fly) this.fly(fly.dataset);
      if (show) {
        this.show(Number(show.dataset.side), show.dataset.mesh);
        $("view").scrollIntoView();
      }
    });
  }

  async model(name) {
    if (!this.models.has(name)) this.models.set(name, Model.load(this.entry(name), this.centre));
    return this.models.get(name);
  }

  /** Shows a mesh in a pane. */
  async show(side, name) {
    if (await this.place(side, name)) await this.refresh();
  }

  /** Puts a mesh into a pane; false when another one was chosen meanwhile. */
  async place(side, name) {
    this.names[side] = name;
    const select = $(`mesh-${side}`);
    select.value = name;
    const { totals, shown } = this.entry(name);
    const count = (number) => number.toLocaleString("en").replaceAll(",", "\u2009");
    const all = `${count(totals[1])} faces, ${count(totals[0])} vertices`;
    $(`count-${side}`).textContent = shown[1] < totals[1] ? `${all}; shown thinned to ${count(shown[1])} faces, each coloured by the worst it stands for` : all;
    const model = await this.model(name);
    if (this.names[side] !== name) return false;
    this.panes[side].show(model);
    return true;
  }

  /** Brings colours and lines in line with the meshes that are shown. */
  async refresh() {
    this.choices();
    await this.colour();
    await this.lineBoxes();
  }

  async start() {
    // Nothing is drawn before everything is there: without a graphics card a picture costs more than all the rest.
    this.holding = true;
    await Promise.all([0, 1].map((side) => this.place(side, this.names[side])));
    await this.refresh();
    this.holding = false;
    this.fit(0, false);
    $("viewer").dataset.ready = "true";
  }

  /** The columns of both meshes in the select. */
  choices() {
    const select = $("colour");
    const before = select.value;
    const columns = new Map();
    for (const name of this.names) for (const column of this.entry(name).columns) columns.set(column.key, column.title);
    select.replaceChildren(new Option("nothing", ""), ...[...columns].map(([key, title]) => new Option(title, key)));
    select.value = columns.has(before) ? before : before === "" && this.painted ? "" : [...columns.keys()][0] ?? "";
  }

  async colour() {
    const key = $("colour").value;
    this.painted = true;
    const found = await Promise.all(this.panes.map((pane) => pane.model?.column(key)));
    if ($("colour").value !== key) return;
    const columns = found.filter(Boolean).map(({ column }) => column);
    // The mesh on the right, as a rule the result, speaks for ramp and names.
    const column = columns.at(-1);
    const range = this.ranges.get(key) ?? [Math.min(...columns.map((c) => c.range[0])), Math.max(...columns.map((c) => c.range[1]))];
    const isNames = column?.ramp === "names";
    this.panes.forEach((pane, side) => {
      pane.model?.paint(found[side]);
      const count = Math.min(Math.max(found[side]?.column.names.length ?? 1, 1), 4096);
      pane.material.uniforms.ramp.value = isNames ? namesTexture(count) : this.textures[column?.ramp ?? "sequential"];
      pane.material.uniforms.range.value = isNames ? [-0.5, count - 0.5] : range;
    });
    legend($("legend"), column, this.data.ramps[column?.ramp], range, (changed) => {
      if (changed) this.ranges.set(key, changed);
      else this.ranges.delete(key);
      this.colour();
    });
    this.redraw();
  }

  /** A box for each kind of line that either mesh has. */
  lineBoxes() {
    const place = $("lines");
    const states = new Map([...place.querySelectorAll("input")].map((box) => [box.value, box.checked]));
    const kinds = new Map();
    for (const name of this.names) for (const line of this.entry(name).lines) kinds.set(line.key, line.title);
    let groups = 0;
    place.replaceChildren(...[...kinds].map(([key, title]) => {
      const [colour, on] = LINES[key] ?? [GROUP_COLOURS[groups++ % GROUP_COLOURS.length], false];
      const box = Object.assign(document.createElement("input"), { type: "checkbox", value: key, checked: states.get(key) ?? on });
      const swatch = Object.assign(document.createElement("span"), { className: "swatch" });
      swatch.style.background = colour;
      box.dataset.colour = colour;
      box.addEventListener("change", () => this.style());
      const label = Object.assign(document.createElement("label"), { className: "check" });
      label.append(box, swatch, title);
      return label;
    }));
    return this.style();
  }

  async style() {
    const edges = $("edges").checked ? 1 : 0;
    const boxes = [...$("lines").querySelectorAll("input")];
    await Promise.all(this.panes.flatMap((pane) => {
      pane.material.uniforms.edges.value = edges;
      return boxes.map((box) => pane.line(box.value, box.checked, box.dataset.colour));
    }));
    this.redraw();
  }

  link() {
    this.views = $("linked").checked ? [this.shared, this.shared] : [this.shared, new View().copy(this.shared)];
    this.redraw();
  }

  look(where) {
    const right = Math.PI / 2;
    const angles = { iso: [-0.9, 0.48], x: [0, 0], y: [-right, 0], z: [-right, right] }[where];
    for (const view of new Set(this.views)) {
      const to = new View().copy(view);
      if (angles) [to.yaw, to.pitch] = angles;
      const models = this.panes.filter((_, side) => this.views[side] === view).map((pane) => pane.model).filter(Boolean);
      view.fly(this.fitted(to, models), () => this.redraw());
    }
  }

  async click(side, place) {
    const pane = this.panes[side];
    const hit = pane.pick(place, this.views[side], this.size);
    pane.mark(hit && pane.model.outline(hit.face));
    this.redraw();
    if (!hit) return;
    const at = hit.at.map((v, axis) => digits(v + this.centre[axis], 5)).join(", ");
    const key = $("colour").value;
    const keys = new Set([key, "scaled-jacobian", "stretch", "size", "min-angle", "distance", "region"]);
    const values = [];
    for (const one of keys) {
      const found = await pane.model.column(one);
      if (!found) continue;
      const index = found.column.on === "face" ? hit.face : pane.model.triangles[3 * hit.triangle];
      const value = found.values[index];
      if (Number.isNaN(value)) continue;
      const text = found.column.ramp === "names" ? found.column.names[value] || value : digits(value);
      values.push(`${found.column.title.split(" (")[0].toLowerCase()} ${text}`);
    }
    const { totals, shown } = pane.model.entry;
    const what = shown[1] < totals[1] ? "Face of the thinned mesh" : `Face ${hit.face}`;
    $("picked").textContent = `${this.names[side]}: ${what} at ${at}. ${values.join(" · ")}`;
  }

  /** Flies to an element that a button names. */
  async fly({ mesh, at, label, column }) {
    if (!this.entry(mesh)) return;
    let side = this.names.lastIndexOf(mesh);
    if (side < 0) side = 1;
    $("view").scrollIntoView();
    if (column && [...$("colour").options].some((option) => option.value === column)) $("colour").value = column;
    await this.show(side, mesh);
    const place = at.split(",").map((v, axis) => Number(v) - this.centre[axis]);
    const corners = this.corners(mesh, label, place);
    const view = this.views[side];
    const to = new View().copy(view);
    to.target.fromArray(place);
    this.face(to, corners);
    const reach = Math.max(...corners.map((corner) => Math.hypot(...corner.map((v, axis) => v - place[axis]))), 0);
    to.span = reach > 0 ? Math.max(14 * reach, this.size / 2000) : this.size / 12;
    view.fly(to, () => this.redraw());
    this.panes[side].view = view;
    this.panes[side].mark(corners);
    $("picked").textContent = `${mesh}: ${label} at ${at.split(",").map((v) => digits(Number(v), 5)).join(", ")}`;
    this.panes[side].canvas.focus({ preventScroll: true });
  }

  /** The corners of an element: as listed, as shown, or its place alone. */
  corners(mesh, label, place) {
    const { worst, totals, shown } = this.entry(mesh);
    for (const list of worst) {
      const element = list.elements.find((candidate) => `${candidate.kind} ${candidate.id}` === label);
      if (element) return element.corners.map((corner) => corner.map((v, axis) => v - this.centre[axis]));
    }
    const face = /^face (\d+)$/.exec(label);
    const model = this.panes[Math.max(0, this.names.lastIndexOf(mesh))].model;
    return face && shown[1] === totals[1] && model ? model.outline(Number(face[1])) : [place];
  }

  /** Turns a view to look straight at a face. */
  face(view, corners) {
    if (corners.length < 3) return;
    const [a, b, c] = corners.slice(0, 3).map((corner) => new Vector3(...corner));
    const normal = b.sub(a).cross(c.sub(a));
    if (normal.length() === 0) return;
    normal.normalize();
    view.pitch = Math.asin(Math.max(-1, Math.min(1, normal.z)));
    if (Math.hypot(normal.x, normal.y) > 1e-6) view.yaw = Math.atan2(normal.y, normal.x);
  }
}

/** Tables whose columns can be sorted by a click on their head. */
function sortable(table) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = Object.assign(document.createElement("button"), { type: "button" });
    button.append(...head.childNodes);
    head.append(button);
    head.setAttribute("aria-sort", "none");
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach((other) => other.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const key = (row) => row.cells[column].dataset.sort ?? row.cells[column].textContent;
      const compare = new Intl.Collator("en", { numeric: true }).compare;
      const number = (text) => (text.trim() === "" ? NaN : Number(text.replace("%", "")));
      const order = (a, b) => {
        const [x, y] = [number(key(a)), number(key(b))];
        return Number.isNaN(x) || Number.isNaN(y) ? compare(key(a), key(b)) : x - y;
      };
      const rows = [...table.tBodies[0].rows].sort((a, b) => (down ? order(b, a) : order(a, b)));
      table.tBodies[0].append(...rows);
    });
  });
}

/** The pictures of the page in the place of the meshes, for a browser without WebGL; the rest is as good as before. */
function pictures(names, error) {
  const make = (tag, attributes, ...children) => {
    const element = Object.assign(document.createElement(tag), attributes);
    element.append(...children);
    return element;
  };
  const known = [...document.querySelectorAll("article.step, .gallery figure, figure")]
    .map((place) => [place.querySelector("h3, figcaption a")?.textContent.trim(), place.querySelector("img")])
    .filter(([name, image]) => name && image);
  const wanted = known.filter(([name]) => names.includes(name));
  const figure = ([name, image]) => {
    const copy = image.cloneNode();
    copy.loading = "eager";
    return make("figure", { className: "pane still" }, make("figcaption", { textContent: name }), copy);
  };
  const shown = (wanted.length ? wanted : known).slice(0, 12).map(figure);
  const words = `This browser shows no meshes in 3D (${error.message})${shown.length ? "; these are pictures of them." : "."}`;
  return [make("p", { className: "note", textContent: words }), make("div", { className: "panes" }, ...shown)];
}

function begin() {
  document.querySelectorAll("table.sortable").forEach(sortable);
  const data = $("data");
  if (!data) return;
  const content = JSON.parse(data.textContent);
  if (!content.meshes.length) return;
  $("viewer").hidden = false;
  try {
    new Viewer(content).start();
  } catch (error) {
    $("viewer").replaceChildren(...pictures(content.meshes.map((mesh) => mesh.name), error));
  }
}

begin();
