// What the side panel says: one pixel, a region, the difference from the reference; the server measures, this prints.

/** @typedef {number | string} Value a number, or "nan" and "inf" by name */

/** As one writes it: 0.0123, 4096, 1.23e8. @param {Value} value */
export function plain(value) {
  if (typeof value === "string") return value;
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-3 && size < 1e6) return String(Number(value.toPrecision(5)));
  return value.toExponential(3);
}

/** @param {Value[]} values */
const three = (values) => values.slice(0, 3).map(plain).join("  ");
/** @param {number} share */
const percent = (share) => `${plain(100 * share)} %`;

/** @param {HTMLElement} list @param {[string, string][]} lines */
export function print(list, lines) {
  list.replaceChildren(...lines.flatMap(([name, text]) => {
    const dt = document.createElement("dt"), dd = document.createElement("dd");
    dt.textContent = name;
    dd.textContent = text;
    return [dt, dd];
  }));
}

/** @param {any} v @param {string} unit @param {any} [held] the pixel that a click holds @returns {[string, string][]} */
export function linesOfValue(v, unit, held) {
  /** @type {[string, string][]} */
  const lines = [["x, y", `${v.x}, ${v.y}`], ["R G B", three(v.rgb)]];
  lines.push(["luminance", `${plain(v.luminance)}${unit === "cd/m²" ? " cd/m²" : ""}`]);
  if (v.sigma) lines.push(["± σ", three(v.sigma)]);
  if (v.codes) lines.push(["codes", v.codes.join("  ")]);
  if (v.mark) lines.push(["mark", v.mark]);
  if (v.direction) {
    lines.push(["direction", v.direction.map((/** @type {number} */ each) => each.toFixed(4)).join("  ")]);
    lines.push(["", `${plain(v.azimuth)}° right, ${plain(v.elevation)}° up`]);
    lines.push(["solid angle", `${plain(v.solid_angle)} sr`]);
  }
  if (held && (held.x !== v.x || held.y !== v.y) && held.luminance > 0 && v.luminance > 0) {
    const ratio = v.luminance / held.luminance, stops = Math.log2(ratio);
    lines.push(["to the held", `× ${plain(ratio)}, ${stops >= 0 ? "+" : "−"}${Math.abs(stops).toFixed(2)} stops`]);
  }
  return lines;
}

/** @param {any} s @param {string} unit @returns {[string, string][]} */
export function linesOfStatistics(s, unit) {
  /** @type {[string, string][]} */
  const lines = [["pixels", s.pixels.toLocaleString("en")]];
  if (s.not_finite) lines.push(["not finite", s.not_finite.toLocaleString("en")]);
  const after = unit === "cd/m²" ? " cd/m²" : "";
  for (const name of ["mean", "deviation", "least", "median", "most"]) {
    if (s[name]) lines.push([name, three(s[name])], ["", `luminance ${plain(s[name][3])}${after}`]);
  }
  if (s.solid_angle !== undefined) {
    lines.push(["solid angle", `${plain(s.solid_angle)} sr`], ["∫ L dω", three(s.total)]);
    lines.push(["irradiance", `${three(s.irradiance_from_above)} from above`]);
  }
  return lines;
}

/** @param {any} d @returns {[string, string][]} */
export function linesOfDifference(d) {
  /** @type {[string, string][]} */
  const lines = [["RMS", plain(d.rms)], ["absolute", plain(d.absolute)], ["signed", plain(d.signed)]];
  if (d.rms_share !== null) lines.push(["of its mean", `${percent(d.rms_share)} RMS, ${percent(d.bias_share)} bias`]);
  if (d.gain !== 1) lines.push(["reference", `× ${plain(d.gain)}`]);
  lines.push(["PSNR", d.psnr === null ? "alike" : `${plain(d.psnr)} dB`]);
  return lines;
}
