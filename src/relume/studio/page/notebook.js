// The canvas in a notebook: the tiles are in the page.

import { HdrCanvas } from "./canvas.js";
import { plain } from "./measured.js";
import { TILE } from "./source.js";

/** @type {Map<string, ArrayBuffer>} */ const decoded = new Map();
/** The bytes of a text in base 64, decoded once. @param {string} text */
function bytes(text) {
  let found = decoded.get(text);
  if (!found) decoded.set(text, (found = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer));
  return found;
}

/** The number that a half float's sixteen bits are. @param {number} bits */
export function half(bits) {
  const sign = bits & 0x8000 ? -1 : 1, power = (bits >> 10) & 31, rest = bits & 1023;
  if (power === 0) return sign * rest * 2 ** -24;
  if (power === 31) return rest ? NaN : sign * Infinity;
  return sign * (1 + rest / 1024) * 2 ** (power - 15);
}

/** @param {{layer: import("./source.js").LayerFacts, stops: number, unit: string, reduced: number, size: number[],
 *   inside: boolean, tiles: Record<string, string>}} facts */
export function begin(facts) {
  const picture = /** @type {HTMLCanvasElement} */ (document.getElementById("picture"));
  const slider = /** @type {HTMLInputElement} */ (document.getElementById("stops"));
  const shown = /** @type {HTMLElement} */ (document.getElementById("shown"));
  const value = /** @type {HTMLElement} */ (document.getElementById("value"));
  const inside = /** @type {HTMLButtonElement} */ (document.getElementById("inside"));
  const { layer } = facts;
  const failed = (/** @type {Error} */ error) => (value.textContent = error.message);
  /** @type {HdrCanvas} */ let canvas;
  try {
    canvas = new HdrCanvas(picture, () => {
      slider.value = String(canvas.view.stops);
      shown.textContent = `${canvas.view.stops >= 0 ? "+" : "−"}${Math.abs(canvas.view.stops).toFixed(2)} stops`;
    }, failed);
  } catch (error) {
    failed(/** @type {Error} */ (error));
    return;
  }
  canvas.resized();
  canvas.open(layer, async (level, column, row) => bytes(facts.tiles[`${level}/${column}/${row}`]));
  canvas.fit();
  canvas.set({ stops: facts.stops });
  inside.hidden = !facts.inside;
  inside.addEventListener("click", () => canvas.set({ mode: canvas.view.mode === "inside" ? "picture" : "inside" }));
  slider.addEventListener("input", () => canvas.set({ stops: Number(slider.value) }));
  const point = (/** @type {MouseEvent} */ event) => {
    const box = picture.getBoundingClientRect(), density = canvas.width / box.width;
    return /** @type {[number, number]} */ ([(event.clientX - box.left) * density, (event.clientY - box.top) * density]);
  };
  /** @type {[number, number] | null} */ let last = null;
  picture.addEventListener("pointerdown", (event) => {
    picture.setPointerCapture(event.pointerId);
    last = point(event);
  });
  picture.addEventListener("pointerup", () => (last = null));
  picture.addEventListener("pointermove", (event) => {
    const [x, y] = point(event);
    if (last) {
      canvas.pan(x - last[0], y - last[1]);
      last = [x, y];
    }
    const at = canvas.toPicture(x, y).map(Math.floor);
    const [width, height] = layer.sizes[0];
    if (canvas.view.mode === "inside" || at[0] < 0 || at[1] < 0 || at[0] >= width || at[1] >= height) return;
    const column = Math.floor(at[0] / TILE), row = Math.floor(at[1] / TILE), data = bytes(facts.tiles[`0/${column}/${row}`]);
    const across = Math.min(TILE, width - column * TILE), start = 4 * ((at[1] - row * TILE) * across + at[0] - column * TILE);
    const values = layer.half ? [...new Uint16Array(data, 2 * start, 3)].map(half) : [...new Float32Array(data, 4 * start, 3)];
    const unit = facts.unit === "cd/m²" ? " cd/m²" : "";
    value.textContent = `${at[0] * facts.reduced}, ${at[1] * facts.reduced}: `
      + values.map((each) => plain(Number((each * layer.scale).toPrecision(4)))).join("  ") + unit
      + (facts.reduced > 1 ? ` (mean of ${facts.reduced} × ${facts.reduced} pixels)` : "");
  });
  picture.addEventListener("wheel", (event) => {
    event.preventDefault();
    canvas.enlarge(2 ** (-event.deltaY / 200), ...point(event));
  }, { passive: false });
  picture.addEventListener("keydown", (event) => {
    if (event.key === "e" || event.key === "E") canvas.set({ stops: canvas.view.stops + (event.shiftKey ? -0.5 : 0.5) });
    if (event.key === "f") canvas.fit();
  });
  Object.assign(window, { relume: { canvas, settled: () => canvas.settled } });
}
