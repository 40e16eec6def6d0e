// Two ways to develop a composite side by side: presets, films and tone operators, each through `relume develop`.

import { make, typed } from "../fields.js";
import { json, post } from "../../requests.js";

/** @typedef {{preset: string, tone: string, glare: string, exposure: number}} Way */

/** @param {import("../studio.js").Studio} studio */
export function developments(studio) {
  /** @type {Way[]} */ const ways = [{ preset: "", tone: "exposure", glare: "", exposure: 0 }, { preset: "slide", tone: "", glare: "", exposure: 0 }];
  /** @type {{presets: Record<string, string>, tones: string[]}} */ let known = { presets: {}, tones: [] };
  let turn = 0, lines = ["", ""];
  /** @type {string[]} */ let doubts = [];
  const source = () => ["composite.exr", "preview.exr"].find((each) => studio.state.results.includes(each));
  const words = (/** @type {Way} */ way) => [way.preset || way.tone, way.glare && `glare of ${way.glare === "eye" ? "an eye" : "a camera"}`,
    way.exposure && `${way.exposure > 0 ? "+" : ""}${way.exposure} stops`].filter(Boolean).join(", ");

  /** @param {Way} way @param {boolean} [keep] */
  const ask = (way, keep = false) => post("/developed", { ...way, of: source(), keep });

  /** Both, with the wipe between them; of several wishes the latest. */
  async function compare() {
    const mine = ++turn;
    await studio.attempt(async () => {
      studio.say("developing …");
      const [left, right] = [await ask(ways[0]), await ask(ways[1])];
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
      compare();
    } }, group("Cameras and films", Object.entries(known.presets).map(([each, title]) => option(`preset ${each}`, each, title))),
    group("Tone operators", known.tones.map((each) => option(`tone ${each}`, each, ""))));
    const glare = make("select", { id: `${id}-glare`, onchange: () => ((way.glare = glare.value), compare()) },
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

  return {
    async fetchWays() {
      if (known.tones.length) return;
      await studio.attempt(async () => (known = await json("/ways")));
      studio.rebuild();
    },
    build: () => (known.tones.length && source() ? [
      make("h2", {}, "Two other ways, side by side"),
      ...ways.flatMap(side),
      make("div", { className: "row" }, make("button", { type: "button", onclick: compare }, "Compare them"),
        ...["left", "right"].map((name, n) => make("button", { type: "button", onclick: () => keep(ways[n]) }, `Keep the ${name}`))),
      ...doubts.map((line) => make("p", { className: "doubt" }, line)),
    ] : []),
    /** What one would type for the right one, once it was made. */
    typed: () => (lines[0] ? typed(lines[0], lines[1]) : null),
  };
}
