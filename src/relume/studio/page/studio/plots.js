// Plots of a merge: the camera's response over what it was recovered from, and how far photographs depart from the others.

const SVG = "http://www.w3.org/2000/svg";
const COLOURS = ["#ff8a7a", "#9be08f", "#86b6ff"];
const WIDTH = 320, HEIGHT = 190, LEFT = 34, BELOW = 26;

/** @param {string} name @param {Record<string, string | number>} given @param {(Node | string)[]} inside */
function draw(name, given, ...inside) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(given)) made.setAttribute(key, String(value));
  made.append(...inside);
  return made;
}

/** The curves g(Z) = ln X with twice their error, over the observations (Debevec & Malik 1997, Fig. 7).
 *  @param {{name: string, levels: number, values: number[], curves: number[][], errors: number[][] | null, samples: [number, number][][]}} camera */
export function responsePlot(camera) {
  const { values, curves, errors, samples, levels } = camera;
  const shown = curves.flatMap((curve) => curve.slice(1, -1)), low = Math.min(...shown), high = Math.max(...shown);
  const x = (/** @type {number} */ each) => LEFT + ((each - low) / Math.max(high - low, 1e-9)) * (WIDTH - LEFT - 6);
  const y = (/** @type {number} */ each) => HEIGHT - BELOW - (each / (levels - 1)) * (HEIGHT - BELOW - 6);
  const parts = [], within = (/** @type {number} */ each) => Math.min(Math.max(x(each), LEFT), WIDTH - 2);
  for (let stop = Math.ceil(low / Math.LN2); stop <= high / Math.LN2; stop += 2) {
    parts.push(draw("line", { x1: x(stop * Math.LN2), x2: x(stop * Math.LN2), y1: 6, y2: HEIGHT - BELOW, class: "grid" }));
    parts.push(draw("text", { x: x(stop * Math.LN2), y: HEIGHT - 13, class: "tick" }, String(stop)));
  }
  for (const share of [0, 0.5, 1]) {
    parts.push(draw("line", { x1: LEFT, x2: WIDTH - 4, y1: y(share * (levels - 1)), y2: y(share * (levels - 1)), class: "grid" }));
    parts.push(draw("text", { x: LEFT - 4, y: y(share * (levels - 1)) + 3, class: "tick end" }, String(Math.round(share * (levels - 1)))));
  }
  samples.forEach((each, channel) => each.forEach(([a, b]) => {
    if (a >= low && a <= high) parts.push(draw("circle", { cx: x(a).toFixed(1), cy: y(b).toFixed(1), r: 0.9, fill: COLOURS[channel], opacity: 0.35 }));
  }));
  curves.forEach((curve, channel) => {
    const error = errors?.[channel];
    if (error) {
      const side = (/** @type {number} */ sign) => curve.map((each, i) => `${within(each + sign * 2 * error[i]).toFixed(1)},${y(values[i]).toFixed(1)}`);
      parts.push(draw("path", { d: `M${[...side(1), ...side(-1).reverse()].join("L")}Z`, fill: COLOURS[channel], opacity: 0.25, stroke: "none" }));
    }
    parts.push(draw("path", { d: `M${curve.map((each, i) => `${within(each).toFixed(1)},${y(values[i]).toFixed(1)}`).join("L")}`,
      stroke: COLOURS[channel], fill: "none", "stroke-width": 1.5 }));
  });
  parts.push(draw("text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 2, class: "tick" }, "exposure, stops"));
  return draw("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "plot", role: "img",
    "aria-label": `The response of ${camera.name || "the camera"}: pixel value over exposure, red, green and blue` }, ...parts);
}

/** A bar about 0: by how many stops one photograph departs; half a stop fills a side. @param {number | null} stops */
export function residualBar(stops) {
  const wide = 70, at = wide / 2, by = Math.max(-1, Math.min(1, (stops ?? 0) / 0.5)) * at;
  return draw("svg", { viewBox: `0 0 ${wide} 8`, class: "residual", "aria-hidden": "true" },
    draw("line", { x1: at, x2: at, y1: 0, y2: 8, class: "grid" }),
    draw("rect", { x: Math.min(at, at + by), y: 1.5, width: Math.max(Math.abs(by), stops === null ? 0 : 0.8), height: 5,
      fill: Math.abs(stops ?? 0) > 0.15 ? "var(--accent)" : "#9aa0a6" }));
}
