// Bundles `src/main.js` and three.js into `dist/viewer.js`; with `--check` only says whether that file is what they give.

import { build } from "esbuild";
import { readFile } from "node:fs/promises";

const place = new URL("dist/viewer.js", import.meta.url).pathname;
const check = process.argv.includes("--check");
const { outputFiles } = await build({
  absWorkingDir: new URL(".", import.meta.url).pathname,
  entryPoints: ["src/main.js"],
  bundle: true,
  minify: true,
  format: "esm",
  target: ["es2022"],
  charset: "ascii",
  // The licence of three.js stays in the bundle.
  legalComments: "inline",
  banner: { js: "// meshmill viewer; contains three.js, MIT licence, Copyright 2010-2026 three.js authors" },
  outfile: "dist/viewer.js",
  write: !check,
});
if (check) {
  const committed = await readFile(place, "utf8");
  if (committed !== outputFiles[0].text) {
    console.error("dist/viewer.js is not what the sources give; run `npm ci && npm run build` here");
    process.exit(1);
  }
}
