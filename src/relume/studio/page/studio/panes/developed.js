// Two ways to develop a composite side by side: presets, films and tone operators, each through `relume develop`.

import { parameterFields } from "./camera_parameters.js";
import { make, typed } from "../fields.js";
import { json, post } from "../../requests.js";

/** @typedef {{preset: string, tone: string, glare: string, exposure: number, settings: import("./camera_parameters.js").Settings}} Way */

/** @param {import("../studio.js").Studio} studio */
export function developments(studio) {
  /** @type {Way[]} */ const ways = [{ preset: "", tone: "exposure", glare: "", exposure: 0, settings: {} }, { preset: "slide", tone: "", glare: "", exposure: 0, settings: {} }];
  /** @type {{presets: Record<string, string>, own: Record<string, import("./camera_parameters.js").Settings>, tones: string[], parameters: import("./camera_parameters.js").Part[]}} */
  let known = { presets: {}, own: {}, tones: [], parameters: [] };
  let worked = 1, withDepth = false; // the side whose parameters are shown
  let turn = 0, lines = ["", ""];
  /** @type {string[]} */ let doubts = [];
  const source = () => ["composite.exr", "preview.exr"].find((each) => studio.state.results.includes(each));
  const words = (/** @type {Way} */ way) => [way.preset || way.tone, way.glare && `glare of ${way.glare === "eye" ? "an eye" : "a camera"}`,
    way.exposure && `${way.exposure > 0 ? "+" : ""}${way.exposure} stops`, ...Object.entries(way.settings).map(([table, keys]) =>
      `${known.parameters.find((each) => each.table === table)?.title.toLowerCase() ?? table}${keys.kind ? ` ${keys.kind}` : ""} set`)].filter(Boolean).join(", ");

  /** @param {Way} way @param {boolean} [keep] */
  const ask = (way, keep = false) => post("/developed", { ...way, of: source(), keep });

  /** Both, with the wipe between them; of several wishes the latest. */
  async function compare() {
    const mine = ++turn;
    await studio.attempt(async () => {
      studio.say("developing …");
      const left = await ask(ways[0]);
      if (mine !== turn) return;
      const right = await ask(ways[1]);
      if (mine !== turn) return;
      lines = [right.command, right.python];
      doubts = [...new Set([...left.doubts, ...right.doubts])];
      await studio.beside(left, right, `left: ${words(ways[0])}; right: ${words(ways[1])}. Drag, or use the arrow keys; W ends it`);
      studio.rebuild();
    });
  }

  /** @param {Way} way */
  async function keep(way) {
    const found = await studio.attempt(() => ask(way, true));
    if (found) studio.say(`written: ${studio.state.out}/${found.path}`);
  }

  /** The fields of one side. @param {Way} way @param {number} n */
  function side(way, n) {
    const name = ["left", "right"][n], id = `develop-${name}`;
    const option = (/** @type {string} */ value, /** @type {string} */ text, /** @type {string} */ title) => make("option", { value, title, selected: value === `${way.preset && "preset"}${way.tone && "tone"} ${way.preset || way.tone}` }, text);
    const group = (/** @type {string} */ label, /** @type {HTMLOptionElement[]} */ options) => make("optgroup", { label }, ...options);
    const chooses = make("select", { id, onchange: () => {
      const [kind, chosen] = chooses.value.split(" ");
      Object.assign(way, { preset: "", tone: "", [kind]: chosen });
      delete way.settings.tone;
      compare();
    } }, group("Cameras and films", Object.entries(known.presets).map(([each, title]) => option(`preset ${each}`, each, title))),
    group("Tone operators", known.tones.map((each) => option(`tone ${each}`, each, ""))));
    const glare = make("select", { id: `${id}-glare`, onchange: () => {
      way.glare = glare.value;
      delete way.settings.glare;
      compare();
    } },
      ...[["", "as it has"], ["eye", "an eye's"], ["camera", "a camera's"]].map(([value, text]) => make("option", { value, selected: value === way.glare }, text)));
    const said = make("span", {}, `${way.exposure} stops`);
    const exposure = make("input", { id: `${id}-exposure`, type: "range", min: "-4", max: "4", step: "0.1", value: String(way.exposure),
      oninput: () => (said.textContent = `${exposure.value} stops`), onchange: () => ((way.exposure = Number(exposure.value)), compare()) });
    exposure.value = String(way.exposure);
    return [
      make("div", { className: "row" }, make("label", { for: id }, n ? "Right" : "Left"), chooses),
      make("div", { className: "row" }, make("label", { for: glare.id }, "Glare"), glare),
      make("div", { className: "row" }, make("label", { for: exposure.id }, "Exposure"), exposure, said),
    ];
  }

  /** The numbers of one side's camera. */
  function parameters() {
    const way = ways[worked], side = ["left", "right"][worked];
    const of = ["left", "right"].map((name, n) => {
      const button = make("button", { type: "button", onclick: () => ((worked = n), studio.rebuild()) }, `Of the ${name}`);
      button.setAttribute("aria-pressed", String(n === worked));
      return button;
    });
    return [make("h2", {}, "Its lens, glare, film and display"), make("div", { className: "row", role: "group" }, ...of,
      make("button", { type: "button", disabled: !Object.keys(way.settings).length, onclick: () => ((way.settings = {}), compare()) }, "All as it has")),
    ...parameterFields(known.parameters, side, way.settings, (table) => (table === "tone" ? way.tone : table === "glare" ? way.glare : ""), known.own[way.preset] ?? {}, () => {
      studio.rebuild();
      compare();
    })];
  }

  return {
    async fetchWays() {
      const depth = studio.state.results.includes("composite.exr");
      if (known.tones.length && depth === withDepth) return;
      withDepth = depth;
      await studio.attempt(async () => (known = await json("/ways")));
      studio.rebuild();
    },
    build: () => (known.tones.length && source() ? [
      make("h2", {}, "Two other ways, side by side"),
      ...ways.flatMap(side),
      make("div", { className: "row" }, make("button", { type: "button", onclick: compare }, "Compare them"),
        ...["left", "right"].map((name, n) => make("button", { type: "button", onclick: () => keep(ways[n]) }, `Keep the ${name}`))),
      ...parameters(),
      ...doubts.map((line) => make("p", { className: "doubt" }, line)),
    ] : []),
    /** What one would type for the right one, once it was made. */
    typed: () => (lines[0] ? typed(lines[0], lines[1]) : null),
  };
}
