// The values of pixels, printed in them where they are enlarged far enough: the file's own numbers, not the screen's.

import { plain } from "./measured.js";

const ENLARGED = 56; // screen pixels along a pixel that three numbers need
const MOST = 4096;

/** @type {{key: string, box: number[], values: Float32Array} | null} */ let kept = null;
let asking = "";

/**
 * @param {HTMLCanvasElement} overlay
 * @param {import("./canvas.js").HdrCanvas} canvas
 * @param {string} address of the values, without the box
 * @param {string} digest of the layer: values of another are not printed
 * @param {(error: Error) => void} failed
 */
export function drawNumbers(overlay, canvas, address, digest, failed) {
  const { width, height } = canvas;
  const density = window.devicePixelRatio || 1, { zoom } = canvas.view;
  // Hidden while there are none: a browser that draws by software would lay it over every frame.
  const shown = !!canvas.one && canvas.view.mode === "picture" && zoom >= ENLARGED * density;
  if (overlay.hidden && !shown) return;
  overlay.hidden = !shown;
  if (overlay.width !== width || overlay.height !== height) Object.assign(overlay, { width, height });
  const context = /** @type {CanvasRenderingContext2D} */ (overlay.getContext("2d"));
  context.clearRect(0, 0, width, height);
  if (!shown || !canvas.one) return;
  const size = canvas.one.layer.sizes[0];
  const [left, top] = canvas.toPicture(0, 0).map((each) => Math.max(0, Math.floor(each)));
  const [right, bottom] = canvas.toPicture(width, height).map((each, i) => Math.min(size[i], Math.ceil(each)));
  const box = [left, top, right - left, bottom - top];
  if (box[2] <= 0 || box[3] <= 0 || box[2] * box[3] > MOST) return;
  const key = `${digest}/${box}`;
  if (kept?.key !== key) {
    if (asking !== key) {
      asking = key;
      fetch(`${address}&box=${box}`).then(async (got) => {
        if (!got.ok) throw new Error(`the values did not come: ${got.status}`);
        const values = new Float32Array(await got.arrayBuffer());
        // An answer to an earlier question may come after the last one's.
        if (asking !== key) return;
        kept = { key, box, values };
        canvas.draw();
      }).catch(failed);
    }
    return;
  }
  context.font = `${Math.round(Math.min(zoom / 6, 14 * density))}px ui-monospace, monospace`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineWidth = 3 * density;
  context.strokeStyle = "#000c";
  for (let row = 0; row < box[3]; row++) for (let column = 0; column < box[2]; column++) {
    const [x, y] = canvas.toScreen(left + column + 0.5, top + row + 0.5);
    for (let channel = 0; channel < 3; channel++) {
      const value = kept.values[3 * (row * box[2] + column) + channel];
      const text = Number.isFinite(value) ? plain(value) : String(value);
      context.fillStyle = ["#ff9a8a", "#a4f0a0", "#9cc4ff"][channel];
      context.strokeText(text, x, y + ((channel - 1) * zoom) / 4);
      context.fillText(text, x, y + ((channel - 1) * zoom) / 4);
    }
  }
}
