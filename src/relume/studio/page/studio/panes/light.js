// Light: the ball's rim on its photograph, the map that it shows beside it while the rim is dragged, and the measured map.

import { HdrCanvas } from "../../canvas.js";
import { cropping } from "./cropping.js";
import { lightEdits } from "./light_edits.js";
import { at, make, numberField, quoted, typed } from "../fields.js";
import { json, post, Refused } from "../../requests.js";

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function lightPane(studio) {
  let view = 0, frame = -1, number = -1, said = "", way = "pick";
  /** x, y, radius as it is drawn. @type {number[] | null} */ let rim = null;
  /** @type {[number, number][]} */ let points = [];
  const canvas = make("canvas", { tabIndex: 0, ariaLabel: "The light, unwrapped: drag to look round" });
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "The light that the ball shows, unwrapped; E and Shift+E on it change its exposure");
  const box = make("div", { className: "map" }, canvas), words = make("p", { ariaLive: "polite" });
  /** @type {HdrCanvas | null} */ let map = null;
  /** @type {number[] | null | undefined} */ let wanted;
  let asking = false, exposed = false, inFile = "";

  const files = () => studio.state.balls[view] ?? [];
  const path = () => files()[frame >= 0 && frame < files().length ? frame : Math.floor((files().length - 1) * 0.8)] ?? "";
  const table = () => at(studio.state.table, ["light", "balls", view]) ?? {};

  /** The rim that the shot file has, as a circle. */
  function kept() {
    const given = table().rim ?? table().pick;
    if (table().rim) way = "rim";
    else if (table().pick) way = "pick";
    return Array.isArray(given) && given.length === 3 ? [...given] : null;
  }

  /** Unwrap what is drawn; of many wishes the latest alone is asked. @param {number[] | null} asked null to search */
  async function unwrap(asked) {
    wanted = asked;
    if (asking || !path()) return;
    asking = true;
    while (wanted !== undefined) {
      const now = wanted;
      wanted = undefined;
      words.textContent = now ? words.textContent : "seeking the ball …";
      await studio.attempt(async () => {
        try {
          const found = await post("/ball", { path: path(), rim: now });
          if (wanted !== undefined) return;
          if (!now) rim = found.rim;
          points = now ? [] : found.points;
          number = found.number;
          said = `rim ${rim?.map((each) => each.toFixed(1)).join(", ")}${now ? "" : `; an edge was seen along ${Math.round(100 * found.coverage)} % of it`}; `
            + `${(100 * found.unseen / (4 * Math.PI)).toFixed(0)} % of all directions are unseen from here`
            + found.doubts.map((/** @type {string} */ each) => `; ${each}`).join("");
          await showMap(number);
        } catch (error) {
          said = error instanceof Error ? error.message : String(error);
          const candidates = error instanceof Refused ? error.content?.candidates : null;
          if (candidates?.length && !rim) rim = [...candidates[0]];
        }
      });
      words.textContent = said;
      if (now === null && studio.panes[studio.step]?.name === "Light") studio.rebuild();
      studio.drawn();
    }
    asking = false;
  }

  /** @param {number} shown of the map in the library */
  async function showMap(shown) {
    map ??= new HdrCanvas(canvas, () => {}, (error) => studio.say(error));
    map.resized();
    const facts = /** @type {import("../../source.js").PictureFacts} */ (await json(`/pictures/${shown}`));
    studio.facts.set(shown, facts);
    map.open(facts.layers[0], studio.tilesOf(shown, 0));
    map.fit();
    if (!exposed) {
      const stops = await studio.greyStops(shown);
      if (stops !== null) map.set({ stops, marked: true });
      exposed = true;
    }
  }

  function write() {
    if (!rim) return;
    const value = rim.map((each) => Math.round(each * 100) / 100), other = way === "rim" ? "pick" : "rim";
    studio.edit([...(table()[other] ? [{ remove: ["light", "balls", view, other] }] : []), { set: ["light", "balls", view, way], value }], true);
  }

  /** @param {number} x @param {number} y @param {boolean} done */
  function moved(x, y, done) {
    if (!rim) return;
    rim = [x, y, rim[2]];
    follow(done);
  }

  /** @param {number} radius @param {boolean} done */
  function grown(radius, done) {
    if (!rim) return;
    rim = [rim[0], rim[1], Math.max(3, radius)];
    follow(done);
  }

  /** @param {boolean} done */
  function follow(done) {
    points = [];
    studio.drawn();
    unwrap(rim);
    if (done) write();
  }

  /** @param {number} chosen */
  function choose(chosen) {
    view = chosen;
    frame = -1;
    begin();
    studio.rebuild();
  }

  function begin() {
    rim = kept();
    inFile = JSON.stringify(rim);
    points = [];
    if (!path()) return;
    studio.show(path());
    unwrap(rim);
  }

  const measure = () => studio.start("look"), whole = lightEdits(studio), crop = cropping(studio, whole.paint, whole.shown);
  let cropped = "";

  return {
    name: "Light",
    keys: ["light"],
    build() {
      const light = studio.state.table.light ?? {};
      const turned = [
        make("h2", {}, "Changed"),
        numberField(studio, "Turned", ["light", "turn"], { range: true, min: -180, max: 180, step: 1, unit: "°" }),
        numberField(studio, "Brighter", ["light", "exposure"], { range: true, min: -4, max: 4, step: 0.1, unit: " stops" }),
        make("p", {}, light.turn || light.exposure ? `The light is not as it was measured: ${light.turn ? `turned by ${light.turn}°` : ""} `
          + `${light.exposure ? `${light.exposure} stops` : ""}` : "The light is as it was measured."),
      ];
      const measured = [
        make("h2", {}, "Measured"),
        make("div", { className: "row" }, make("button", { type: "button", className: "primary", onclick: measure }, "Measure the light"),
          ...(studio.measured ? [make("button", { type: "button", onclick: () => studio.show("light.exr", "scratch", true) }, "See the map")] : [])),
        make("p", {}, studio.measured ? `All views blended; the camera's own response, ${studio.measured.unit}.`
          : "Merges every bracket by the camera's own response and blends the views. The first time takes a minute or two; then it is kept."),
      ];
      if (light.map) return [make("p", {}, `The light is a finished map: ${light.map}`),
        numberField(studio, "Heading", ["light", "heading"], { range: true, min: -180, max: 180, step: 1, unit: "°" }), ...turned, ...measured,
        make("div", { className: "row" }, make("button", { type: "button", onclick: () => studio.show(light.map, "folder", true) }, "See the map itself")), ...whole.build(), ...crop.build()];
      if (!studio.state.balls.length) return [make("p", {}, "No photographs of the ball are chosen yet: mark them as Ball under Photographs.")];
      const name = `light-view-${view}`;
      const pick = way === "pick" ? "" : " --pick-exactly", circle = rim ? rim.map((each) => each.toFixed(1)).join(",") : "auto";
      const names = [table().photographs ?? []].flat().map(quoted).join(" ");
      return [
        make("div", { className: "row", role: "group" }, ...studio.state.balls.map((/** @type {string[]} */ _, /** @type {number} */ i) => {
          const button = make("button", { type: "button", onclick: () => choose(i) }, `View ${i + 1}`);
          button.setAttribute("aria-pressed", String(i === view));
          return button;
        })),
        make("div", { className: "row" }, make("label", { for: name }, "Seen in"), make("select", {
          id: name, onchange: (/** @type {Event} */ event) => {
            frame = /** @type {HTMLSelectElement} */ (event.target).selectedIndex;
            studio.show(path());
            unwrap(rim);
          },
        }, ...files().map((/** @type {string} */ each) => make("option", { selected: each === path() }, each)))),
        make("h2", {}, "Rim"),
        make("p", {}, "Drag the middle or the rim; the arrow keys move a handle by a pixel."),
        make("div", { className: "row" },
          make("button", { type: "button", onclick: () => ((rim = null), unwrap(null)) }, "Find it"),
          make("button", { type: "button", onclick: write }, "Keep it"),
          make("button", { type: "button", disabled: !table().rim && !table().pick, onclick: () => studio.edit(
            ["rim", "pick"].filter((key) => table()[key]).map((key) => ({ remove: ["light", "balls", view, key] })), true) }, "As found")),
        make("div", { className: "row" }, make("label", { for: "light-way" }, "What is drawn"), make("select", { id: "light-way", onchange: () => {
          way = /** @type {HTMLSelectElement} */ (document.getElementById("light-way")).value;
          write();
        } }, make("option", { value: "pick", selected: way === "pick" }, "is followed to the rim near it"),
        make("option", { value: "rim", selected: way === "rim" }, "is taken exactly"))),
        box, words,
        make("p", {}, "Unwrapped from this photograph alone, seen from in front of the ball; grey is what no view shows."),
        make("h2", {}, "Ball"),
        numberField(studio, "Radius", ["light", "ball", "radius"], { unit: "m", step: 0.001, min: 0 }),
        ...measured, ...turned, ...whole.build(), ...crop.build(),
        typed(`relume probe ${names} --pick ${circle}${pick} -o light.exr`,
          `import relume as rl\n\nfound = rl.probe.probe_ball(rl.probe.find_ball_photographs([${JSON.stringify(names)}]))\nrl.probe.write_probe("light.exr", found.probe)`),
      ];
    },
    shown: begin,
    clicked: (x, y) => void whole.clicked(x, y),
    drag: crop.drag,
    drawn() {
      if (cropped === studio.shownPath) return;
      cropped = studio.shownPath;
      crop.forget();
      if (studio.panes[studio.step]?.name === "Light") studio.rebuild();
    },
    changed() {
      // What the file says counts when it changes there, not while a handle is dragged.
      const now = JSON.stringify(kept());
      if (now === inFile) return;
      inFile = now;
      const circle = kept();
      if (!circle || JSON.stringify(circle) === JSON.stringify(rim?.map((each) => Math.round(each * 100) / 100))) return;
      rim = circle;
      unwrap(rim);
    },
    drawing() {
      const rectangle = crop.drawing();
      if (rectangle) return rectangle;
      if (!rim || studio.shownPath !== path()) return {};
      const [x, y, r] = rim;
      const circle = /** @type {[number, number][]} */ (Array.from({ length: 180 }, (_, i) => [x + r * Math.cos((i * Math.PI) / 90), y + r * Math.sin((i * Math.PI) / 90)]));
      const reach = (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) => grown(Math.hypot(a - x, b - y), done);
      return {
        lines: [{ key: "rim", d: [circle], closed: true }],
        points: points.map(([a, b], i) => ({ key: String(i), x: a, y: b })),
        handles: [
          { key: "middle", x, y, label: "The ball's middle", moved },
          ...[["right", 1, 0], ["below", 0, 1], ["left", -1, 0], ["above", 0, -1]].map(([key, a, b]) => ({
            key: String(key), x: x + Number(a) * r, y: y + Number(b) * r, label: `The ball's rim, ${key}`, moved: reach,
          })),
        ],
      };
    },
  };
}
