// Lights that were never there: each is placed by a point of an object that shall mirror it, and stands apart in light.added.

import { make, numberField, rounded } from "../fields.js";
import { post } from "../../requests.js";

/** E(n) by the coefficients of what was measured: 1, x, y, z, xy, yz, zx, x² − y², 3z² − 1. @param {number[][]} c @param {number[]} n */
function irradiance(c, [x, y, z]) {
  const terms = [1, x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1];
  return [0, 1, 2].map((channel) => Math.max(0, terms.reduce((sum, each, i) => sum + each * c[i][channel], 0)));
}

const luminance = (/** @type {number[]} */ [r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
const colour = (/** @type {number | number[]} */ value) => (Array.isArray(value) ? value : [value, value, value]);
const hex = (/** @type {number[]} */ rgb) => "#" + rgb.map((each) => Math.round(255 * (each / Math.max(...rgb, 1e-9)) ** (1 / 2.2)).toString(16).padStart(2, "0")).join("");

/** @param {import("../studio.js").Studio} studio */
export function addedLights(studio) {
  let aiming = false, chosen = -1;
  const lights = () => studio.state.table.light?.added ?? [];

  /** What one gives beside the measured light, on a surface that faces it. @param {any} light */
  function share(light) {
    const { measured } = studio;
    if (!measured) return "";
    const length = Math.hypot(...light.direction), towards = light.direction.map((/** @type {number} */ each) => each / length);
    const turn = ((studio.state.table.light?.turn ?? 0) * Math.PI) / -180, [x, y, z] = towards;
    const there = [Math.cos(turn) * x + Math.sin(turn) * z, y, Math.cos(turn) * z - Math.sin(turn) * x];
    const known = luminance(irradiance(measured.irradiance, there)) * 2 ** (studio.state.table.light?.exposure ?? 0);
    return known > 0 ? `adds ${Math.round((100 * luminance(colour(light.irradiance))) / known)} % to what the measured light gives a surface that faces it` : "";
  }

  /** Place a light, or move the chosen one, by a point of an object. @param {number} x @param {number} y pixels of the plate */
  async function place(x, y) {
    const found = await studio.attempt(() => post("/light/mirrored", { x, y }));
    if (!found) return;
    const direction = found.direction.map(rounded), list = lights();
    aiming = false;
    if (list[chosen]) return void studio.edit([{ set: ["light", "added", chosen, "direction"], value: direction }]);
    const given = irradiance(studio.measured.irradiance, direction), strength = 0.5 * Math.max(luminance(given), 1e-6);
    await studio.edit([{ append: ["light", "added"], value: { direction, irradiance: Number(strength.toPrecision(3)), size: 10 } }]);
    chosen = lights().length - 1;
    studio.rebuild();
  }

  /** @param {any} light @param {number} n */
  function entry(light, n) {
    const where = ["light", "added", n], on = make("input", { type: "checkbox", id: `added-${n}`, checked: light.on !== false,
      onchange: () => studio.edit(on.checked ? [{ remove: [...where, "on"] }] : [{ set: [...where, "on"], value: false }]) });
    const tint = make("input", { type: "color", ariaLabel: `Colour of added light ${n + 1}`, value: hex(colour(light.irradiance)), onchange: () => {
      const linear = [1, 3, 5].map((i) => (parseInt(tint.value.slice(i, i + 2), 16) / 255) ** 2.2), before = luminance(colour(light.irradiance));
      studio.edit([{ set: [...where, "irradiance"], value: linear.map((each) => Number(((each * before) / Math.max(luminance(linear), 1e-9)).toPrecision(4))) }]);
    } });
    tint.setAttribute("aria-label", `Colour of added light ${n + 1}`);
    const brighter = (/** @type {number} */ stops) => studio.edit([{ set: [...where, "irradiance"],
      value: Array.isArray(light.irradiance) ? light.irradiance.map((/** @type {number} */ each) => Number((each * 2 ** stops).toPrecision(4))) : Number((light.irradiance * 2 ** stops).toPrecision(4)) }]);
    return make("div", { className: "added", data: { added: String(n) } },
      make("div", { className: "row" }, on, make("label", { for: `added-${n}` }, `Light ${n + 1}`), tint,
        make("button", { type: "button", onclick: () => brighter(0.5) }, "Brighter"), make("button", { type: "button", onclick: () => brighter(-0.5) }, "Dimmer"),
        make("button", { type: "button", onclick: () => ((chosen = n), (aiming = true), studio.rebuild()) }, "Move"),
        make("button", { type: "button", onclick: () => ((chosen = -1), studio.edit(lights().length > 1 ? [{ remove: where }] : [{ remove: ["light", "added"] }])) }, "Out")),
      numberField(studio, "Degrees across", [...where, "size"], { otherwise: 10, min: 0.5, max: 120, step: 0.5, unit: "°" }),
      make("p", {}, share(light)));
  }

  return {
    /** Whether the next click on an object places a light. */
    get aiming() {
      return aiming;
    },
    place,
    build: () => [
      make("h2", {}, "Lights that were never there"),
      ...lights().map(entry),
      make("div", { className: "row" }, make("button", { type: "button", disabled: !studio.measured, ariaPressed: String(aiming), onclick: () => {
        [aiming, chosen] = [!aiming, -1];
        studio.rebuild();
      } }, aiming ? "Never mind" : "Add one by its reflection")),
      ...(aiming ? [make("p", {}, "Click the point of an object that shall mirror it.")]
        : lights().length ? [make("p", {}, "They stand apart from the measured light, in light.added; the plate's own pixels stay as they are.")] : []),
    ],
  };
}
