// The light edited as a whole: turned, brightened, in another mapping; a slice painted on elsewhere and brought back.

import { make } from "../fields.js";
import { json, post } from "../../requests.js";

const MAPPINGS = [["", "as it is"], ["latlong", "lat-long"], ["angular", "angular map"], ["ball", "mirrored ball"], ["cross", "cube cross"], ["cross-vertical", "vertical cube cross"],
  ["strip", "cube strip"], ["octahedral", "octahedral"], ["equalarea", "equal area"], ["hemispheres", "two hemispheres"]];
const UNCHANGED = { yaw: 0, pitch: 0, roll: 0, stops: 0, red: 1, green: 1, blue: 1, blur: 0, field: 60, rows: 0 };

/** @param {import("../studio.js").Studio} studio */
export function lightEdits(studio) {
  const numbers = { ...UNCHANGED };
  let mapping = "", slice = "", said = "", lamps = true, grey = false;
  /** Where the view looks: azimuth and elevation, degrees. @type {[number, number] | null} */ let towards = null;
  /** The pixel of the light that was clicked. @type {[number, number] | null} */ let pixel = null;

  /** @param {keyof typeof numbers} name @param {string} text @param {string} unit */
  function field(name, text, unit) {
    const id = `edit-${name}`, input = make("input", { id, type: "number", step: "any", value: numbers[name] || name !== "rows" ? String(numbers[name]) : "",
      onchange: () => (numbers[name] = input.value === "" ? UNCHANGED[name] : Number(input.value)) });
    return make("div", { className: "row" }, make("label", { for: id }, text), input, unit);
  }

  /** @param {"red" | "green" | "blue"} name */
  function channel(name) {
    const input = make("input", { type: "number", step: "any", min: "0", id: `edit-${name}`, value: String(numbers[name]),
      onchange: () => (numbers[name] = input.value === "" ? 1 : Number(input.value)) });
    input.setAttribute("aria-label", `Scaled: ${name}`);
    return input;
  }

  /** What matte surfaces would reflect, direction by direction. */
  const integrated = () => studio.attempt(async () => {
    const { path, where } = await post("/light/diffuse", {});
    await studio.show(path, where, true);
  });

  /** Have the shot point to what comes of it. @param {string} address @param {any} body */
  const made = (address, body) => studio.attempt(async () => {
    const { state, facts } = await post(address, { ...body, revision: studio.state.revision });
    const total = (/** @type {any} */ of) => (of?.total ? ` (∫ L dω ${of.total.map((/** @type {number} */ each) => each.toPrecision(3)).join(", ")})` : "");
    said = facts.before ? `written: ${state.table.light.map}, ${facts.mapping}, ${facts.size.join(" × ")}${total(facts.after)}`
      : `written: ${state.table.light.map}; ${facts["pixels changed"]} pixels changed`;
    Object.assign(numbers, UNCHANGED, { field: numbers.field });
    [grey, pixel] = [false, null];
    studio.take(state, true);
  });

  /** Have a part of the light, or all of it, as a slice to paint on. @param {{view?: number[], box?: number[]}} part */
  const cut = (part) => studio.attempt(async () => {
    const found = await post("/light/slice", part);
    slice = found.path;
    said = `${found.path} is written: white is ${Number(found.white).toPrecision(3)}. Paint on it in any program, save it, and bring it back.`;
    studio.rebuild();
  });

  /** Whether the light is what is shown. */
  const shown = () => studio.shownPath === (studio.state.table.light?.map ?? "light.exr");

  return {
    shown,
    /** @param {number[]} box pixels of the light */
    paint: (box) => cut({ box }),
    /** A click on the map says where a view looks. @param {number} x @param {number} y */
    async clicked(x, y) {
      if (!/(^|\/)light[^/]*\.(exr|hdr)$/.test(studio.shownPath)) return;
      const found = await studio.attempt(() => json(`/pictures/${studio.number}/value?layer=0&x=${Math.floor(x)}&y=${Math.floor(y)}`));
      if (found?.azimuth === undefined) return;
      towards = [found.azimuth, found.elevation];
      pixel = shown() ? [Math.floor(x), Math.floor(y)] : null;
      grey = grey && pixel !== null;
      studio.rebuild();
    },
    build() {
      const known = studio.measured || studio.state.table.light?.map;
      if (!known) return [];
      const kind = make("select", { id: "edit-mapping", onchange: () => (mapping = kind.value) },
        ...MAPPINGS.map(([value, text]) => make("option", { value, selected: value === mapping }, text)));
      const neutral = make("input", { type: "checkbox", id: "edit-grey", checked: grey, disabled: !pixel, onchange: () => (grey = neutral.checked) });
      const keep = make("input", { type: "checkbox", id: "edit-lamps", checked: lamps, onchange: () => (lamps = keep.checked) });
      return [make("details", { open: false },
        make("summary", {}, "Edit the whole map"),
        make("p", {}, "Writes a map of its own into lights/, which the shot then names. What was measured stays, and Undo goes back to it."),
        field("yaw", "Turned", "°"), field("pitch", "Tipped", "°"), field("roll", "Rolled", "°"), field("stops", "Brighter", "stops"),
        make("div", { className: "row vector", role: "group", ariaLabel: "Scaled" }, make("label", {}, "Scaled"), ...["red", "green", "blue"].map((name) => channel(/** @type {"red"} */ (name))), "×"),
        make("div", { className: "row" }, neutral, make("label", { for: "edit-grey" }, pixel ? `Neutral about pixel ${pixel.join(", ")}` : "Neutral where the map was clicked")),
        field("blur", "Blurred by", "°"),
        make("div", { className: "row" }, make("label", { for: "edit-mapping" }, "Mapping"), kind), field("rows", "Rows", "or as fine as now"),
        make("div", { className: "row" }, make("button", { type: "button", onclick: () => made("/light/edited", {
          turn: [numbers.yaw, numbers.pitch, numbers.roll], stops: numbers.stops, gains: [numbers.red, numbers.green, numbers.blue], grey: grey ? pixel : null,
          blur: numbers.blur, mapping: mapping || null, size: numbers.rows || null }) }, "Make this the light"),
        make("button", { type: "button", onclick: integrated }, "See it diffusely integrated")),
        make("h2", {}, "Paint on it"),
        make("p", {}, towards ? `The view looks ${towards[0].toFixed(0)}° to the right and ${towards[1].toFixed(0)}° up.` : "See the map and click where a view shall look, or take the whole."),
        field("field", "Field of view", "°"),
        make("div", { className: "row" }, make("button", { type: "button", disabled: !towards, onclick: () => towards && cut({ view: [...towards, numbers.field] }) }, "Cut out the view"),
          make("button", { type: "button", onclick: () => cut({}) }, "Slice the whole map")),
        ...(slice ? [make("div", { className: "row" }, keep, make("label", { for: "edit-lamps" }, "Lights beyond white stay lights")),
          make("div", { className: "row" }, make("button", { type: "button", onclick: () => made("/light/painted", { slice, scale: lamps }) }, "Bring it back"))] : []),
        make("p", { ariaLive: "polite", data: { edited: "" } }, said))];
    },
  };
}
