// What lies over a picture besides its own light: false colour and the error of each pixel, and the scale of both.

import { plain } from "../measured.js";
import { COLOURS } from "../shaders.js";

/** @typedef {import("../source.js").PictureFacts} PictureFacts */

const ERRORS = "relative error";
/** What `shaders.js` shows of an error. */
const LEAST_ERROR = "0.1 %", MOST_ERROR = "100 %";

/** The layer of a picture that holds the relative error of its pixels; -1 where that is not known. @param {PictureFacts | undefined} facts */
export const errorLayer = (facts) => facts?.layers.findIndex((each) => each.name === ERRORS) ?? -1;

/** The ends of false colour, log2 of the least and of the most of a layer. @param {import("../source.js").LayerFacts | undefined} layer */
export function falseColourEnds(layer) {
  const low = Math.log2(Math.max(layer?.smallest ?? 1e-3, 1e-12)), high = Math.log2(Math.max(layer?.largest ?? 1, 1e-9));
  return { low, high: Math.max(high, low + 0.1) };
}

/** The scale of what is drawn over the picture, in the page's element `legend`. @param {import("../canvas.js").HdrCanvas} canvas
 *  @param {string} unit */
export function drawLegend(canvas, unit) {
  const { view } = canvas, errors = view.errors && canvas.errors !== null && view.mode === "picture";
  const shown = /** @type {HTMLElement} */ (document.getElementById("legend"));
  shown.hidden = !errors && !view.falseColour;
  if (shown.hidden) return;
  const [low, bar, high] = /** @type {any} */ (shown.children);
  low.textContent = errors ? `error ${LEAST_ERROR}` : plain(2 ** view.low);
  high.textContent = errors ? MOST_ERROR : `${plain(2 ** view.high)}${unit === "cd/m²" ? " cd/m²" : ""}`;
  const context = bar.getContext("2d");
  if (!context || bar.dataset.drawn) return;
  const gradient = context.createLinearGradient(0, 0, bar.width, 0), steps = COLOURS.length / 4;
  for (let i = 0; i < steps; i++) gradient.addColorStop((i + 0.5) / steps, `rgb(${COLOURS.slice(4 * i, 4 * i + 3).join(",")})`);
  context.fillStyle = gradient;
  context.fillRect(0, 0, bar.width, bar.height);
  bar.dataset.drawn = "yes";
}
