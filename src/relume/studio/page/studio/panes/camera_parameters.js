// The numbers of a virtual camera as sliders: lens, glare, tone or film and display, each with its unit and what it is unless given.

import { make } from "../fields.js";

/** @typedef {{key: string, words: string, unit: string, low: number, high: number, step: number, parts: string[], choices: any[], start: any,
 *   otherwise: any}} Parameter */
/** @typedef {{table: string, title: string, kinds: Record<string, Parameter[]>}} Part */
/** @typedef {Record<string, Record<string, any>>} Settings */

const KINDS = /** @type {Record<string, string>} */ ({ natural: "natural, cos⁴", polynomial: "by a polynomial", straight: "straight", turn: "the camera turns", eye: "an eye's", camera: "a camera's",
  fixed: "fixed exposure", "black-white": "black and white point", darkroom: "film in a darkroom", srgb: "sRGB", p3: "Display P3", pq: "HDR by PQ", hlg: "HDR by HLG",
  "gain-map": "HDR by a gain map", "": "given" });

/**
 * @param {Part[]} parts @param {string} side what the fields' ids begin with @param {Settings} settings changed in place
 * @param {(table: string) => string} above the kind that was chosen elsewhere @param {Settings} preset what the chosen camera sets
 * @param {() => void} changed @returns {Node[]}
 */
export function parameterFields(parts, side, settings, above, preset, changed) {
  return parts.map((part) => {
    const kinds = Object.keys(part.kinds), given = settings[part.table], own = preset[part.table];
    const kind = given ? given.kind ?? "" : above(part.table) || (own?.kind ?? "");
    const id = `${side}-${part.table}`, chooses = make("select", { id, onchange: () => {
      if (chooses.value === "-") delete settings[part.table];
      else {
        const chosen = chooses.value, begun = Object.fromEntries(part.kinds[chosen].filter((each) => each.start !== null).map((each) => [each.key, each.start]));
        settings[part.table] = { ...(chosen ? { kind: chosen } : {}), ...begun };
      }
      changed();
    } }, make("option", { value: "-", selected: !given }, above(part.table) ? "as chosen above" : "as it has"),
    ...kinds.map((each) => make("option", { value: each, selected: given !== undefined && each === kind }, KINDS[each] ?? each)));
    /** @param {string} key @param {any} value nothing to have it as it is unless given */
    const set = (key, value) => {
      const keys = (settings[part.table] ??= kind ? { kind } : {});
      if (value === undefined) delete keys[key];
      else keys[key] = value;
      changed();
    };
    // Unless given, a key is as the chosen camera has it, where that is of this kind.
    const asPreset = own && (own.kind ?? "") === kind ? own : {};
    const shown = part.kinds[kind] && (given || above(part.table) || own) ? part.kinds[kind].map((each) => ({ ...each, otherwise: asPreset[each.key] ?? each.otherwise })) : [];
    return make("details", { data: { part: part.table } }, make("summary", {}, given ? `${part.title} •` : part.title),
      make("div", { className: "row" }, make("label", { for: id }, part.title), chooses),
      ...shown.flatMap((each) => fields(each, `${id}-${each.key}`, given?.[each.key], (value) => set(each.key, value))));
  });
}

/** The rows of one parameter. @param {Parameter} one @param {string} id @param {any} value nothing where it is not given @param {(value: any) => void} set
 *  @returns {Node[]} */
function fields(one, id, value, set) {
  const { otherwise } = one;
  if (one.choices.length) {
    const chooses = make("select", { id, onchange: () => set(JSON.parse(chooses.value)) },
      ...one.choices.map((each) => make("option", { value: JSON.stringify(each), selected: each === (value ?? otherwise) }, String(each))));
    return [make("div", { className: "row" }, make("label", { for: id }, one.words), chooses, one.unit)];
  }
  if (typeof otherwise === "boolean") {
    const box = make("input", { type: "checkbox", id, checked: value ?? otherwise, onchange: () => set(box.checked === otherwise ? undefined : box.checked) });
    return [make("div", { className: "row" }, box, make("label", { for: id }, one.words))];
  }
  if (!one.parts.length) return [slider(one, id, one.words, value, otherwise, set)];
  const whole = () => [...(value ?? otherwise ?? one.start ?? one.parts.map(() => 0))];
  return one.parts.map((part, i) => slider(one, `${id}-${i}`, `${one.words} ${part}`, value?.[i], otherwise?.[i] ?? one.start?.[i] ?? 0, (now) => {
    const next = whole();
    next[i] = now ?? otherwise?.[i] ?? one.start?.[i] ?? 0;
    set(next);
  }));
}

/** @param {Parameter} one @param {string} id @param {string} words @param {number | undefined} value @param {number | null} otherwise
 *  @param {(value: number | undefined) => void} set */
function slider(one, id, words, value, otherwise, set) {
  const usual = otherwise === null ? "found" : String(Number(otherwise.toPrecision(4)));
  const range = make("input", { type: "range", id, min: String(one.low), max: String(one.high), step: String(one.step), title: `${words}: ${usual} unless given` });
  const number = make("input", { type: "number", step: "any", value: value ?? "", placeholder: usual, onchange: () => set(number.value === "" ? undefined : Number(number.value)) });
  number.setAttribute("aria-label", `${words}${one.unit ? `, ${one.unit}` : ""}`);
  range.value = String(value ?? otherwise ?? (one.low + one.high) / 2);
  range.addEventListener("input", () => (number.value = range.value));
  range.addEventListener("change", () => set(Number(range.value)));
  return make("div", { className: "row slider" }, make("label", { for: id }, words), range, number, make("span", {}, one.unit));
}
