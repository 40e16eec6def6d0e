// The values of pixels, printed in them where they are enlarged far enough: the file's own numbers, not the screen's.

import { plain } from "../measured.js";

const ENLARGED = 56; // screen pixels along a pixel that three numbers need
const MOST = 4096;

/** @typedef {{address: string, digest: string}} Printed the values' address, without the box, and the layer's content: values
 *   of another are not printed */

/** Of the picture, and of the one beside it. @type {({key: string, values: Float32Array} | null)[]} */ const kept = [null, null];
const asking = ["", ""];

/**
 * @param {HTMLCanvasElement} overlay
 * @param {import("../canvas.js").HdrCanvas} canvas
 * @param {Printed} one what is shown
 * @param {Printed | null} other what is shown beside it
 * @param {(error: Error) => void} failed
 */
export function drawNumbers(overlay, canvas, one, other, failed) {
  const { width, height, view } = canvas;
  const density = window.devicePixelRatio || 1;
  const parts = [{ ...one, source: canvas.one, left: 0 }, ...(other && canvas.isBeside ? [{ ...other, source: canvas.other, left: canvas.right }] : [])]
    .map((each) => ({ ...each, ratio: each.source ? canvas.ratio(each.source) : 1 }));
  // Hidden while there are none: a browser that draws by software would lay it over every frame.
  const shown = ["picture", "beside"].includes(view.mode) && parts.some((each) => each.source && view.zoom * each.ratio >= ENLARGED * density);
  if (overlay.hidden && !shown) return;
  overlay.hidden = !shown;
  if (overlay.width !== width || overlay.height !== height) Object.assign(overlay, { width, height });
  const context = /** @type {CanvasRenderingContext2D} */ (overlay.getContext("2d"));
  context.clearRect(0, 0, width, height);
  if (!shown) return;
  parts.forEach((part, place) => {
    const { source, ratio, left } = part, zoom = view.zoom * ratio;
    if (!source || zoom < ENLARGED * density) return;
    // The pixels that are seen, in the file's own.
    const size = source.layer.sizes[0], corner = canvas.toPicture(0, 0);
    const low = corner.map((each) => Math.max(0, Math.floor(each / ratio)));
    const high = [canvas.across, height].map((each, i) => Math.min(size[i], Math.ceil((corner[i] + each / view.zoom) / ratio)));
    const box = [...low, high[0] - low[0], high[1] - low[1]];
    if (box[2] <= 0 || box[3] <= 0 || box[2] * box[3] > MOST) return;
    const values = valuesOf(place, part, box, canvas, failed);
    if (!values) return;
    context.save();
    context.beginPath();
    context.rect(left, 0, canvas.across, height);
    context.clip();
    context.font = `${Math.round(Math.min(zoom / 6, 14 * density))}px ui-monospace, monospace`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 3 * density;
    context.strokeStyle = "#000c";
    for (let row = 0; row < box[3]; row++) for (let column = 0; column < box[2]; column++) {
      const [x, y] = canvas.toScreen((low[0] + column + 0.5) * ratio, (low[1] + row + 0.5) * ratio);
      for (let channel = 0; channel < 3; channel++) {
        const value = values[3 * (row * box[2] + column) + channel];
        const text = Number.isFinite(value) ? plain(value) : String(value);
        context.fillStyle = ["#ff9a8a", "#a4f0a0", "#9cc4ff"][channel];
        context.strokeText(text, left + x, y + ((channel - 1) * zoom) / 4);
        context.fillText(text, left + x, y + ((channel - 1) * zoom) / 4);
      }
    }
    context.restore();
  });
}

/** The values of a box; null until they have come. @param {number} place @param {Printed} part @param {number[]} box
 *  @param {import("../canvas.js").HdrCanvas} canvas @param {(error: Error) => void} failed */
function valuesOf(place, part, box, canvas, failed) {
  const key = `${part.digest}/${box}`, found = kept[place];
  if (found?.key === key) return found.values;
  if (asking[place] === key) return null;
  asking[place] = key;
  fetch(`${part.address}&box=${box}`).then(async (got) => {
    if (got.status === 404 || got.status === 410) return; // the file is another by now, and is shown anew
    if (!got.ok) throw new Error(`the values did not come: ${got.status}`);
    const values = new Float32Array(await got.arrayBuffer());
    // An answer to an earlier question may come after the last one's.
    if (asking[place] !== key) return;
    kept[place] = { key, values };
    canvas.draw();
  }).catch(failed);
  return null;
}
