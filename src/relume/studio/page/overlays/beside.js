// Two pictures side by side, at one place and one exposure: where the pointer is in the one stands a cross in the other.

/** @param {import("../canvas.js").HdrCanvas} canvas @param {HTMLElement} cross @param {number} x @param {number} y of the screen,
 *  its own pixels */
export function markTwin(canvas, cross, x, y) {
  const at = canvas.within(x), inside = canvas.isBeside && at < canvas.across && x >= 0;
  cross.hidden = !inside;
  if (!inside) return;
  const density = canvas.width / Math.max(canvas.canvas.clientWidth, 1), twin = x >= canvas.right ? at : canvas.right + at;
  cross.style.left = `${twin / density}px`;
  cross.style.top = `${y / density}px`;
}

/** What a pixel of the other picture is beside the one's, in words: how many stops brighter, as both are shown.
 *  @param {any} own @param {any} other @param {number} gain that the other is shown by */
export function stopsBetween(own, other, gain) {
  if (!(own?.luminance > 0 && other?.luminance > 0)) return "";
  const stops = Math.log2((gain * other.luminance) / own.luminance);
  return `${stops >= 0 ? "+" : "−"}${Math.abs(stops).toFixed(2)} stops`;
}

/** The pixel of the other picture at a pixel of the one; null where there is none. @param {import("../canvas.js").HdrCanvas} canvas
 *  @param {number} x @param {number} y @returns {[number, number] | null} */
export function twinPixel(canvas, x, y) {
  if (!canvas.other) return null;
  const ratio = canvas.ratio(canvas.other), [width, height] = canvas.other.layer.sizes[0];
  const [i, j] = [Math.floor((x + 0.5) / ratio), Math.floor((y + 0.5) / ratio)];
  return i >= 0 && j >= 0 && i < width && j < height ? [i, j] : null;
}
