// A block drawn by its edges, to pick the one that is to be marked: what is marked here, elsewhere, and nowhere yet.

/** @typedef {{vertices: number[][], faces: number[][], edges: Record<string, number[]>, corners: Record<string, number>, flat: number | null}} Body */
/** @typedef {{turn: number, chosen: string, size: number[], state: (name: string) => string, choose: (name: string) => void}} Shown
 *  turn: degrees about the vertical; state: "here", "elsewhere" or "" */

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 320, HEIGHT = 190, INSET = 26;
const PITCH = (24 * Math.PI) / 180;
const THINNEST = 0.12; // of the largest size: what is thinner could not be pointed at

/** @param {Body} body @param {Shown} shown @returns {SVGSVGElement} */
export function wireframe(body, { turn, chosen, size, state, choose }) {
  const points = projected(body, size, turn), seen = visible(body, points);
  const svg = /** @type {SVGSVGElement} */ (element("svg", { class: "wireframe", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img",
    "aria-label": "The block's edges and corners; the list below has the same" }));
  const path = (/** @type {number[][]} */ pieces) => pieces.map(([a, b]) => `M${points[a].map(fixed)}L${points[b].map(fixed)}`).join("");
  const names = Object.keys(body.edges).filter((name, i, all) => !all.slice(0, i).some((other) => same(body.edges[name], body.edges[other])));
  for (const name of names) {
    const ring = body.edges[name], pieces = ring.slice(1).map((vertex, i) => [ring[i], vertex]);
    const kind = `${state(name)} ${same(body.edges[chosen], ring) ? "chosen" : ""}`;
    const front = pieces.filter(([a, b]) => seen(a, b)), behind = pieces.filter(([a, b]) => !seen(a, b));
    svg.append(element("path", { class: `${kind} hidden`, d: path(behind) }), element("path", { class: kind, d: path(front) }));
    svg.append(hit("path", { class: "hit", d: path(pieces), "data-edge": name }, name, choose));
  }
  for (const [name, vertex] of Object.entries(body.corners)) {
    const [cx, cy] = points[vertex].map(fixed);
    svg.append(hit("circle", { class: `${state(name)} ${name === chosen ? "chosen" : ""}`, cx, cy, r: 3.2, "data-edge": name }, name, choose));
  }
  return svg;
}

/** @param {string} kind @param {Record<string, string | number>} given @returns {SVGElement} */
function element(kind, given) {
  const made = /** @type {SVGElement} */ (document.createElementNS(SVG, kind));
  for (const [name, value] of Object.entries(given)) made.setAttribute(name, String(value));
  return made;
}

/** What may be pointed at. @param {string} kind @param {Record<string, string | number>} given @param {string} name @param {(name: string) => void} choose */
function hit(kind, given, name, choose) {
  const made = element(kind, given), title = element("title", {});
  title.textContent = name;
  made.append(title);
  made.addEventListener("click", () => choose(name));
  return made;
}

/** @param {number} value */
const fixed = (value) => value.toFixed(1);
/** @param {number[] | undefined} one @param {number[]} other */
const same = (one, other) => one !== undefined && one.length === other.length && one.every((each, i) => each === other[i]);

/** The vertices in the drawing, x right and y down. @param {Body} body @param {number[]} size @param {number} turn @returns {number[][]} */
function projected(body, size, turn) {
  const largest = Math.max(...size) || 1, [sin, cos] = [Math.sin((turn * Math.PI) / 180), Math.cos((turn * Math.PI) / 180)];
  const shown = size.map((each, axis) => (axis === body.flat ? 0 : Math.max(each / largest, THINNEST)));
  const raw = body.vertices.map((vertex) => {
    const [x, y, z] = vertex.map((each, axis) => (each - 0.5) * shown[axis]), ahead = z * cos - x * sin;
    return [x * cos + z * sin, ahead * Math.sin(PITCH) - y * Math.cos(PITCH)];
  });
  const [left, top] = [0, 1].map((i) => Math.min(...raw.map((each) => each[i]))), [right, low] = [0, 1].map((i) => Math.max(...raw.map((each) => each[i])));
  const scale = Math.min((WIDTH - 2 * INSET) / (right - left || 1), (HEIGHT - 2 * INSET) / (low - top || 1));
  return raw.map(([x, y]) => [WIDTH / 2 + scale * (x - (left + right) / 2), HEIGHT / 2 + scale * (y - (top + low) / 2)]);
}

/** Whether a piece of an edge lies on a face that is turned to whoever looks. @param {Body} body @param {number[][]} points */
function visible(body, points) {
  /** @type {Map<string, boolean>} */ const found = new Map();
  for (const ring of body.faces) {
    let area = 0;
    ring.forEach((vertex, i) => {
      const [a, b] = [points[vertex], points[ring[(i + 1) % ring.length]]];
      area += a[0] * b[1] - b[0] * a[1];
    });
    const towards = area < -1e-6; // counter-clockwise from outside, where y points down
    ring.forEach((vertex, i) => {
      const key = keyOf(vertex, ring[(i + 1) % ring.length]);
      found.set(key, towards || (found.get(key) ?? false));
    });
  }
  return (/** @type {number} */ a, /** @type {number} */ b) => body.flat !== null || (found.get(keyOf(a, b)) ?? true);
}

/** @param {number} a @param {number} b */
const keyOf = (a, b) => (a < b ? `${a} ${b}` : `${b} ${a}`);
