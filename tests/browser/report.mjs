// Opens reports in headless Chromium and checks what a reader would notice: no error, meshes on the canvases, everything
// reachable by keyboard, readable in light and dark, on a wide screen and on a phone.
//
//   node report.mjs REPORT.html ...        screenshots go to the folder SCREENSHOTS names, if any

import { chromium } from "playwright-core";
import { existsSync, mkdirSync, statSync } from "node:fs";
import { basename, join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const CHROMIUM = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
const MOST_BYTES = 15e6;
const MOST_SECONDS = Number(process.env.MOST_SECONDS ?? 10);

const failures = [];
const check = (holds, message) => {
  if (!holds) failures.push(message);
};

/** Relative luminance and contrast as in the Web Content Accessibility Guidelines. */
function contrast(a, b) {
  const luminance = (colour) => {
    const [r, g, b] = colour.map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
  return (high + 0.05) / (low + 0.05);
}

/** Texts with their colour and the colour behind them. */
const texts = () => {
  const parse = (css) => (css.match(/[\d.]+/g) ?? []).map(Number);
  const behind = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const [r, g, b, alpha = 1] = parse(getComputedStyle(at).backgroundColor);
      if (alpha > 0.99) return [r, g, b];
    }
    return [255, 255, 255];
  };
  const found = [];
  for (const element of document.querySelectorAll("h1, h2, h3, p, td, th, dt, dd, summary, button, label, a, span, svg text, pre span")) {
    const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    const box = element.getBoundingClientRect();
    if (!own || box.width < 2 || box.height < 2) continue;
    const style = getComputedStyle(element);
    const isSvg = element instanceof SVGElement;
    const node = element.closest("svg.graph .node")?.querySelector("rect");
    const ground = node ? parse(getComputedStyle(node).fill).slice(0, 3) : behind(isSvg ? element.closest("svg").parentElement : element);
    found.push({ text: element.textContent.trim().slice(0, 40), colour: parse(isSvg ? style.fill : style.color).slice(0, 3), ground });
  }
  return found;
};

/** Colours of a canvas: how many differ, and the share of the commonest. */
async function colours(page, id) {
  const shot = await page.locator(`#${id}`).screenshot();
  return page.evaluate(async (data) => {
    const image = await createImageBitmap(new Blob([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))]));
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const pixels = new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
    const counts = new Map();
    for (const pixel of pixels) counts.set(pixel, (counts.get(pixel) ?? 0) + 1);
    return { distinct: counts.size, commonest: Math.max(...counts.values()) / pixels.length };
  }, shot.toString("base64"));
}

async function ready(page) {
  await page.waitForSelector("#viewer[data-ready=true]", { timeout: 60_000 });
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
}

async function keyboard(page, name) {
  await page.evaluate(() => document.activeElement?.blur());
  const reached = new Set();
  for (let i = 0; i < 400; i++) {
    await page.keyboard.press("Tab");
    const id = await page.evaluate(() => {
      const at = document.activeElement;
      if (!at || at === document.body) return "";
      return at.id || at.dataset?.view || at.getAttribute("class") || at.tagName.toLowerCase();
    });
    if (!id) break;
    reached.add(id.split(" ")[0]);
  }
  for (const id of ["skip", "colour", "fit", "linked", "edges", "mesh-0", "canvas-0", "mesh-1", "canvas-1", "node", "summary"]) {
    check(reached.has(id), `${name}: the keyboard does not reach ${id}; it reached ${[...reached].join(" ")}`);
  }
  await page.focus("#canvas-0");
  const before = (await page.locator("#canvas-0").screenshot()).toString("base64");
  const other = (await page.locator("#canvas-1").screenshot()).toString("base64");
  for (const key of ["ArrowLeft", "ArrowUp", "+"]) await page.keyboard.press(key);
  await page.waitForTimeout(700);
  check((await page.locator("#canvas-0").screenshot()).toString("base64") !== before, `${name}: arrow keys do not turn the mesh`);
  check((await page.locator("#canvas-1").screenshot()).toString("base64") !== other, `${name}: the cameras are not linked`);
}

async function interact(page, name) {
  await page.keyboard.press("0");
  await page.waitForTimeout(700);
  const options = await page.locator("#colour option").evaluateAll((all) => all.map((option) => option.value));
  for (const option of options) {
    await page.selectOption("#colour", option);
    await page.waitForTimeout(80);
  }
  check(options.length > 3, `${name}: only ${options.length} colours to choose from`);
  await page.selectOption("#colour", options[1]);
  await page.locator("#canvas-1").click();
  await page.waitForTimeout(300);
  check(/(Face|at) /.test(await page.locator("#picked").textContent()), `${name}: a click tells nothing of the element`);
  const details = page.locator("details:has(.fly)").first();
  if (await details.count()) {
    await details.locator("summary").click();
    const before = (await page.locator("#canvas-1").screenshot()).toString("base64");
    await page.locator("details .fly").first().click();
    await page.waitForTimeout(900);
    const canvases = await Promise.all(["canvas-0", "canvas-1"].map((id) => page.locator(`#${id}`).screenshot()));
    check(canvases.some((shot) => shot.toString("base64") !== before), `${name}: the camera does not fly to the worst element`);
  }
}

async function look(browser, file, scheme, width, isFirst) {
  const name = `${basename(file)} ${scheme} ${width}`;
  const context = await browser.newContext({ colorScheme: scheme, viewport: { width, height: width < 500 ? 844 : 900 }, offline: true });
  const page = await context.newPage();
  page.on("console", (message) => message.type() === "error" && failures.push(`${name}: console: ${message.text()}`));
  page.on("pageerror", (error) => failures.push(`${name}: ${error.message}`));
  page.on("request", (request) => check(/^(file|data|blob):/.test(request.url()), `${name}: asks the network for ${request.url()}`));
  const start = performance.now();
  await page.goto(pathToFileURL(resolve(file)).href);
  const hasMeshes = (await page.locator("#viewer").count()) > 0;
  if (hasMeshes) await ready(page);
  const seconds = (performance.now() - start) / 1000;
  check(seconds < MOST_SECONDS, `${name}: open after ${seconds.toFixed(1)} s`);
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  check(overflow <= 0, `${name}: the page is ${overflow} pixels too wide`);
  for (const { text, colour, ground } of await page.evaluate(texts)) {
    const ratio = contrast(colour, ground);
    check(ratio >= 4.4, `${name}: contrast ${ratio.toFixed(1)} of “${text}”`);
  }
  if (hasMeshes) {
    for (const id of ["canvas-0", "canvas-1"]) {
      const { distinct, commonest } = await colours(page, id);
      check(distinct > 50 && commonest < 0.97, `${name}: ${id} is blank (${distinct} colours, ${(100 * commonest).toFixed(0)} % alike)`);
    }
  }
  const shots = process.env.SCREENSHOTS;
  if (shots) {
    mkdirSync(shots, { recursive: true });
    await page.screenshot({ path: join(shots, `${basename(file, ".html")}-${scheme}-${width}.png`), fullPage: true });
  }
  if (hasMeshes && isFirst) {
    await keyboard(page, name);
    await interact(page, name);
    if (shots) await page.screenshot({ path: join(shots, `${basename(file, ".html")}-flown.png`) });
  }
  await context.close();
  return seconds;
}

/** Without WebGL the pictures stand in the place of the meshes. */
async function withoutWebGl(browser, file) {
  const context = await browser.newContext({ offline: true });
  const page = await context.newPage();
  await page.addInitScript(() => {
    HTMLCanvasElement.prototype.getContext = () => null;
  });
  await page.goto(pathToFileURL(resolve(file)).href);
  if (await page.locator("#viewer").count()) {
    await page.waitForSelector("#viewer:not([hidden]) .note");
    const widths = await page.locator("#viewer img").evaluateAll((all) => all.map((image) => image.naturalWidth));
    check(widths.length > 0 && widths.every((width) => width > 0), `${basename(file)}: no picture where there is no WebGL`);
  }
  await context.close();
}

const files = process.argv.slice(2);
const executablePath = CHROMIUM.find((path) => path && existsSync(path));
if (!executablePath || files.length === 0) {
  console.log(executablePath ? "usage: node report.mjs REPORT.html ..." : "SKIPPED: there is no Chromium; set CHROMIUM to one");
  process.exit(executablePath ? 2 : 0);
}
const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--enable-unsafe-swiftshader"],
});
for (const file of files) {
  const bytes = statSync(file).size;
  check(bytes < MOST_BYTES, `${file}: ${(bytes / 1e6).toFixed(1)} MB`);
  const times = [];
  for (const scheme of ["light", "dark"]) {
    for (const width of [1280, 390]) times.push(await look(browser, file, scheme, width, times.length === 0));
  }
  await withoutWebGl(browser, file);
  console.log(`${file}: ${(bytes / 1e6).toFixed(2)} MB, open after ${times.map((t) => t.toFixed(2)).join(", ")} s`);
}
await browser.close();
const unique = [...new Set(failures)];
for (const failure of unique) console.error(failure);
console.log(unique.length ? `${unique.length} faults` : "no fault");
process.exit(unique.length ? 1 : 0);
