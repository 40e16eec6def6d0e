// Place: the table drawn on the photograph, with what is known of its reflectance; the walls that the light comes from.

import { at, choiceField, make, numberField, rounded, typed, vectorField } from "../fields.js";
import { occluder } from "./occluder.js";
import { line, onPlane } from "../projection.js";

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function placePane(studio) {
  /** The rectangle while it is dragged: left, right, back, front. @type {number[] | null} */ let dragged = null;

  const front = occluder(studio);
  const tables = () => studio.state.table.local ?? [];
  const index = () => tables().findIndex((/** @type {any} */ each) => each.shape === "plane");
  const plane = () => tables()[index()] ?? null;
  const height = () => (plane()?.height ?? 0) + (plane()?.translate?.[1] ?? 0);
  const lens = () => studio.measured?.camera ?? null;

  /** Left, right, back and front of the table, metres; null where it is endless. */
  function sides() {
    if (dragged) return dragged;
    const table = plane();
    if (table && !table.size) return null;
    const radius = studio.state.table.light?.ball?.radius ?? 0.05, [w, d] = table?.size ?? [24 * radius, 24 * radius];
    const [x, , z] = table?.translate ?? [0, 0, 0];
    return [x - w / 2, x + w / 2, z - d / 2, z + d / 2];
  }

  /** Write a rectangle. @param {number[]} s */
  function write(s) {
    const size = [rounded(s[1] - s[0]), rounded(s[3] - s[2])], middle = [rounded((s[0] + s[1]) / 2), 0, rounded((s[2] + s[3]) / 2)];
    const i = index(), moved = middle.some((each) => Math.abs(each) > 1e-4);
    if (i < 0) {
      studio.edit([{ append: ["local"], value: { shape: "plane", size, reflectance: "recover", ...(moved ? { translate: middle } : {}) } }]);
      return;
    }
    if (plane().translate) middle[1] = plane().translate[1];
    const place = moved || plane().translate?.[1] ? [{ set: ["local", i, "translate"], value: middle }] : plane().translate ? [{ remove: ["local", i, "translate"] }] : [];
    studio.edit([{ set: ["local", i, "size"], value: size }, ...place]);
  }

  /** @param {number} side 0 left, 1 right, 2 back, 3 front @returns {(x: number, y: number, done: boolean) => void} */
  const moved = (side) => (x, y, done) => {
    const s = sides(), hit = lens() && onPlane(lens(), x, y, height());
    if (!s || !hit) return;
    dragged = [...s];
    dragged[side] = side < 2 ? hit[0] : hit[2];
    if (dragged[1] - dragged[0] < 0.01 || dragged[3] - dragged[2] < 0.01) dragged = [...s];
    studio.drawn();
    if (!done) return;
    write(dragged);
    dragged = null;
  };

  /** The edges of the room. */
  function room() {
    const box = studio.state.table.light?.distant;
    if (box?.shape !== "box" || !lens()) return [];
    const corner = (/** @type {number} */ i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? box.high : box.low)[axis]), d = [];
    for (let i = 0; i < 8; i++) for (const axis of [0, 1, 2]) if (!((i >> axis) & 1)) d.push(line(lens(), corner(i), corner(i | (1 << axis))));
    return [{ key: "room", d, className: "thin" }];
  }

  return {
    name: "Place",
    keys: ["local", "match"],
    build() {
      const table = plane(), i = index(), found = studio.measured?.reflectance ?? [];
      const known = [["found in every pixel", "recover"], ["found, one colour", "recover even"],
        ...(Array.isArray(table?.reflectance) ? [[`given: ${table.reflectance.join(", ")}`, table.reflectance]] : [])];
      const gloss = [["matte", false], ["found", "recover"], ...(table?.gloss && typeof table.gloss === "object" ? [["given", table.gloss]] : [])];
      return [
        make("p", {}, lens() ? "Drag the table's sides to where it ends in the photograph." : "The camera is not known yet; find it first, under Camera."),
        make("h2", {}, "Table"),
        ...(table === null ? [make("p", {}, "None is described; one of usual size about the ball is taken."),
          make("div", { className: "row" }, make("button", { type: "button", onclick: () => write(sides() ?? [-0.6, 0.6, -0.6, 0.6]) }, "Describe it"))]
          : [
            ...(table.size ? [vectorField(studio, "Size", ["local", i, "size"], ["x", "z"])]
              : [make("div", { className: "row" }, make("button", { type: "button", onclick: () => write([-0.6, 0.6, -0.6, 0.6]) }, "It is endless: give it a size"))]),
            numberField(studio, "Height", ["local", i, "height"], { otherwise: 0, unit: "m", step: 0.001 }),
            choiceField(studio, "Reflectance", ["local", i, "reflectance"], /** @type {[string, any][]} */ (known), "recover"),
            choiceField(studio, "Gloss", ["local", i, "gloss"], /** @type {[string, any][]} */ (gloss), false),
          ]),
        ...(found.length ? [make("p", {}, `Measured reflectance: ${found.map((/** @type {number[]} */ each) => each.map((v) => v.toFixed(3)).join(" ")).join("; ")}`)] : []),
        ...tables().length > (table ? 1 : 0) ? [make("p", {}, `${tables().length - (table ? 1 : 0)} more surfaces are in the shot file.`)] : [],
        make("h2", {}, "Where the light comes from"),
        choiceField(studio, "Distant scene", ["light", "distant"], /** @type {[string, any][]} */ ([
          ["infinitely far", { shape: "infinite" }], ["a room", at(studio.state.table, ["light", "distant", "shape"]) === "box" ? studio.state.table.light.distant
            : { shape: "box", low: [-2.5, -0.75, -2.5], high: [2.5, 1.95, 2.5] }],
          ...(["dome", "mesh"].includes(at(studio.state.table, ["light", "distant", "shape"])) ? [["as in the shot file", studio.state.table.light.distant]] : []),
        ]), { shape: "infinite" }),
        ...(at(studio.state.table, ["light", "distant", "shape"]) === "box" ? [
          vectorField(studio, "Low corner", ["light", "distant", "low"], ["x", "y", "z"]), vectorField(studio, "High corner", ["light", "distant", "high"], ["x", "y", "z"]),
        ] : []),
        ...front.build(),
        typed(`relume insert shot.toml --dry-run -o ${studio.state.out}`, 'import relume as rl\n\nprint(rl.read_shot("shot.toml").surfaces())'),
      ];
    },
    async shown() {
      if (studio.platePath) await studio.show(studio.platePath);
      front.shown();
    },
    hidden: front.hidden,
    changed: front.changed,
    drawn: front.drawn,
    clicked: front.clicked,
    drag: front.drag,
    drawing() {
      const s = sides(), view = lens(), painted = front.drawing();
      if (painted.handles || !view || !s || studio.shownPath !== studio.platePath) return painted;
      const y = height(), corners = [[s[0], y, s[2]], [s[1], y, s[2]], [s[1], y, s[3]], [s[0], y, s[3]]];
      const edge = corners.flatMap((corner, i) => line(view, corner, corners[(i + 1) % 4])).filter(([a]) => Number.isFinite(a));
      // A side is held in the middle of what the picture shows of it.
      const [w, h] = view.size, held = [[3, 0], [1, 2], [0, 1], [3, 2]].map(([a, b]) => {
        const seen = line(view, corners[a], corners[b], 64).filter(([u, v]) => u > 0 && v > 0 && u < w && v < h);
        return seen[seen.length >> 1];
      });
      return {
        lines: [...room(), { key: "table", d: [edge], closed: true, className: "filled" }],
        handles: held.flatMap((point, side) => (point ? [{ key: `side ${side}`, x: point[0], y: point[1],
          label: `The table's ${["left", "right", "back", "front"][side]} side`, moved: moved(side) }] : [])),
      };
    },
  };
}
