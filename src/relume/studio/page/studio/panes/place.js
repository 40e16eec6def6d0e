// Place: tables, walls, boxes and lamps drawn on the photograph, with what was found of their reflectance; the walls
// that the light comes from.

import { at, choiceField, make, typed, vectorField } from "../fields.js";
import { occluder } from "./occluder.js";
import { line, project } from "../projection.js";
import { inWorld } from "./solids.js";
import { foundWords, surfaces } from "./surfaces.js";

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function placePane(studio) {
  const real = surfaces(studio, () => front.rest()), front = occluder(studio, () => real.rest());
  const lens = () => studio.measured?.camera ?? null;
  let written = true;

  /** The edges of the room. */
  function room() {
    const box = studio.state.table.light?.distant;
    if (box?.shape !== "box" || !lens()) return [];
    const corner = (/** @type {number} */ i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? box.high : box.low)[axis]), d = [];
    for (let i = 0; i < 8; i++) for (const axis of [0, 1, 2]) if (!((i >> axis) & 1)) d.push(line(lens(), corner(i), corner(i | (1 << axis))));
    return [{ key: "room", d, className: "thin" }];
  }

  /** What was found of the surfaces, and whether each is still as it was then. */
  const found = () => (studio.measured?.surfaces ?? []).map((/** @type {any} */ each) => {
    const now = (studio.state.table.local ?? [])[each.number];
    return { ...each, stale: now !== undefined && inOrder(now) !== inOrder(each.given) };
  });

  /** The words on a surface, in the middle of what the picture shows of it. @param {any} each */
  function onSurface(each) {
    const s = real.solid(each.number), view = lens(), [w, h] = view.size;
    /** @type {[number, number][]} */ const seen = [];
    if (!s) return [];
    const wall = s.kind === "wall";
    for (let a = -0.45; a <= 0.46; a += 0.1) for (let c = -0.45; c <= 0.46; c += 0.1) {
      const [x, y] = project(view, wall ? inWorld(s, a * s.w, (c + 0.5) * s.h, 0) : inWorld(s, a * s.w, s.h, c * s.d));
      if (x > 0 && y > 0 && x < w && y < h) seen.push([x, y]);
    }
    if (!seen.length) return [];
    const [x, y] = [0, 1].map((axis) => seen.reduce((sum, point) => sum + point[axis], 0) / seen.length);
    return foundWords(each).map((text, row) => ({ key: `found ${each.number} ${row}`, x, y, text: `${row ? "" : `${each.number + 1}: `}${text}`, row }));
  }

  /** What was found, as the pane says it. @param {any} each */
  function said(each) {
    const { gloss, pixels } = each, errors = gloss?.found, lines = foundWords(each);
    if (errors) lines.push(`from ${errors.points} places that ${errors.views === 2 ? "the probe and the plate show" : "the plate alone shows"}`, ...errors.notes);
    return make("li", { data: { found: String(each.number) } }, `${each.number + 1}: ${lines.join("; ") || "given, not found"}${pixels ? ` (${pixels} pixels)` : ""}`
      + `${each.stale ? "; as it was before the last change" : ""}`);
  }

  return {
    name: "Place",
    keys: ["local", "match"],
    build() {
      const all = found(), shown = make("input", { type: "checkbox", id: "place-found", checked: written, onchange: () => ((written = shown.checked), studio.drawn()) });
      const distant = at(studio.state.table, ["light", "distant", "shape"]);
      return [
        make("p", {}, lens() ? "Drag the sides of what is drawn to where it ends in the photograph, and draw what else stands there."
          : "The camera is not known yet; find it first, under Camera."),
        ...real.build(),
        ...(all.length ? [
          make("h2", {}, "Found of the surfaces"),
          make("ul", { className: "found" }, ...all.map(said)),
          make("p", {}, "Reflectance is the median over a surface's pixels, ± how much it varies over them; gloss has its standard deviation."),
          make("div", { className: "row" }, shown, make("label", { for: "place-found" }, "Write it on the photograph")),
        ] : []),
        make("h2", {}, "Where the light comes from"),
        choiceField(studio, "Distant scene", ["light", "distant"], /** @type {[string, any][]} */ ([
          ["infinitely far", { shape: "infinite" }], ["a room", distant === "box" ? studio.state.table.light.distant
            : { shape: "box", low: [-2.5, -0.75, -2.5], high: [2.5, 1.95, 2.5] }],
          ...(["dome", "mesh"].includes(distant) ? [["as in the shot file", studio.state.table.light.distant]] : []),
        ]), { shape: "infinite" }),
        ...(distant === "box" ? [
          vectorField(studio, "Low corner", ["light", "distant", "low"], ["x", "y", "z"]), vectorField(studio, "High corner", ["light", "distant", "high"], ["x", "y", "z"]),
        ] : []),
        ...(studio.state.table.light?.map ? [vectorField(studio, "Map taken at", ["light", "probe"], ["x", "y", "z"])] : []),
        ...front.build(),
        typed(`relume insert shot.toml --dry-run -o ${studio.state.out}`, 'import relume as rl\n\nprint(rl.read_shot("shot.toml").surfaces())'),
      ];
    },
    async shown() {
      if (studio.platePath) await studio.show(studio.platePath);
      front.shown();
    },
    hidden() {
      real.rest();
      front.hidden();
    },
    changed: front.changed,
    drawn: front.drawn,
    clicked: front.clicked,
    drag: (event, phase) => real.drag(event, phase) || front.drag(event, phase),
    drawing() {
      const painted = front.drawing();
      if (painted.handles || !lens() || studio.shownPath !== studio.platePath) return painted;
      const { lines, handles, words } = real.drawing();
      return { lines: [...room(), ...lines], handles, words: [...words, ...(written ? found().filter((/** @type {any} */ each) => !each.stale).flatMap(onSurface) : [])] };
    },
  };
}

/** A value as text, whatever order its keys are in. @param {any} value @returns {string} */
function inOrder(value) {
  if (Array.isArray(value)) return `[${value.map(inOrder).join()}]`;
  if (value === null || typeof value !== "object") return JSON.stringify(value);
  return `{${Object.keys(value).sort().map((key) => `${key}:${inOrder(value[key])}`).join()}}`;
}
