// What was found: sizes and cameras with their standard deviations, how far the marks lie, and what is doubtful.

import { make } from "../studio/fields.js";

/** @typedef {import("./place.js").PlacePage} PlacePage */

const SIZES = ["width", "height", "depth"];

/** @param {PlacePage} page */
export function solution(page) {
  const { found, lacks, stale } = page.state;
  if (!found) return lacks ? [make("p", { id: "lacks" }, lacks)] : [];
  const marked = make("input", { type: "checkbox", id: "found-shown", checked: page.foundShown, onchange: () => {
    page.foundShown = marked.checked;
    page.drawn();
  } });
  return [
    ...(stale ? [make("p", { className: "doubt", id: "stale" }, "As it was before the last change; solve it again.")] : []),
    sizes(found.blocks), cameras(page, found),
    make("p", { id: "chi" }, found.freedom ? `χ² ${found.chi_square.toPrecision(4)} of ${found.freedom}: about as large where the marks are sound.` : ""),
    ...found.doubts.map((/** @type {string} */ line) => make("p", { className: "doubt" }, line)),
    make("div", { className: "row" }, marked, make("label", { for: "found-shown" }, "Draw what was found")),
  ];
}

/** @param {Record<string, {size: number[], deviation: number[]}>} blocks */
function sizes(blocks) {
  const rows = Object.entries(blocks).map(([name, { size, deviation }]) => make("tr", { data: { size: name } }, make("th", { scope: "row" }, name),
    ...size.map((each, i) => make("td", {}, ...(each > 0 ? length(each, deviation[i]) : ["–"])))));
  return make("table", {}, make("caption", {}, "Sizes, metres ± one standard deviation"),
    make("thead", {}, make("tr", {}, make("th", { scope: "col" }, "block"), ...SIZES.map((each) => make("th", { scope: "col" }, each)))), make("tbody", {}, ...rows));
}

/** As many digits as the deviation has two of. @param {number} value @param {number} deviation */
function length(value, deviation) {
  if (!(deviation > 0)) return [String(Number(value.toPrecision(5))), make("small", {}, "given")];
  const digits = Math.min(Math.max(1 - Math.floor(Math.log10(Number(deviation.toPrecision(2)))), 0), 6);
  return [value.toFixed(digits), make("small", {}, ` ± ${deviation.toFixed(digits)}`)];
}

/** @param {PlacePage} page @param {any} found */
function cameras(page, found) {
  const rows = Object.entries(found.cameras).map(([name, each]) => make("tr", { data: { camera: name } }, make("th", { scope: "row" }, name),
    make("td", {}, `${each.residual.toFixed(2)}`), make("td", {}, `± ${each.position_deviation.toPrecision(2)}`), make("td", {}, `± ${each.rotation_deviation.toPrecision(2)}`),
    make("td", {}, `${each.focal_length.toFixed(0)}${each.focal_length_deviation ? ` ± ${each.focal_length_deviation.toPrecision(2)}` : ""}`)));
  const heads = ["photograph", "marks off", "place", "turn", "focal"];
  return make("table", {}, make("caption", {}, "Cameras: marks off by pixels (RMS), place in m, turn in °, focal length in pixels"),
    make("thead", {}, make("tr", {}, ...heads.map((each) => make("th", { scope: "col" }, each)))), make("tbody", {}, ...rows));
}
