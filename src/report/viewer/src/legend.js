// What the colours mean: a ramp with its range, which can be changed, or the names.

import { nameColour } from "./material.js";

/** A number in so many significant digits. */
export function digits(number, count = 3) {
  if (number === 0) return "0";
  const magnitude = Math.floor(Math.log10(Math.abs(number)));
  if (magnitude < -4 || magnitude > 6) return number.toExponential(count - 1).replace("-", "−");
  const text = number.toFixed(Math.max(0, count - 1 - magnitude));
  return (text.includes(".") ? text.replace(/\.?0+$/, "") : text).replace("-", "−");
}

const css = ([r, g, b]) => `rgb(${r},${g},${b})`;

function element(tag, properties, ...children) {
  const result = Object.assign(document.createElement(tag), properties);
  result.append(...children);
  return result;
}

const MOST_NAMES = 24;

function names(column) {
  const list = element("div", { className: "names" });
  column.names.slice(0, MOST_NAMES).forEach((name, i) => {
    const swatch = element("span", { className: "swatch" });
    swatch.style.background = css(nameColour(i));
    list.append(element("span", {}, swatch, name || `region ${i}`));
  });
  const more = column.names.length - MOST_NAMES;
  if (more > 0) list.append(element("span", { className: "muted" }, `and ${more} more`));
  return list;
}

function field(label, value, change) {
  const input = element("input", { type: "number", step: "any", value: Number(value.toPrecision(4)) });
  input.addEventListener("change", () => Number.isFinite(input.valueAsNumber) && change(input.valueAsNumber));
  return element("label", {}, `${label} `, input);
}

/** Shows what a column's colours mean. `change` gets a new range, or nothing for the column's own. */
export function legend(place, column, stops, range, change) {
  place.replaceChildren();
  if (!column) return;
  if (column.ramp === "names") {
    place.append(element("b", {}, column.title), names(column));
    return;
  }
  const bar = element("div", { className: "ramp" });
  bar.style.background = `linear-gradient(90deg, ${stops.map(css).join(",")})`;
  const unit = column.unit ? ` (${column.unit})` : "";
  const middle = (range[0] + range[1]) / 2;
  const scale = element("div", { className: "scale" }, ...[range[0], middle, range[1]].map((v) => element("span", {}, digits(v))));
  const reset = element("button", { type: "button" }, "Reset");
  reset.addEventListener("click", () => change(null));
  place.append(
    element("b", {}, column.title + unit),
    element("div", {}, bar, scale),
    field("from", range[0], (low) => change([low, Math.max(range[1], low)])),
    field("to", range[1], (high) => change([Math.min(range[0], high), high])),
    reset,
  );
}
