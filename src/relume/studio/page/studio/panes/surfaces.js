// Tables, walls, boxes and lamps drawn on the photograph: a stroke on the table's plane, then a height by dragging
// upward; handles move them afterwards. Each is an entry of [[local]] or a place in light.lamps.

import { choiceField, make, numberField, rounded, vectorField } from "../fields.js";
import { line, onPlane, onVertical, project } from "../projection.js";
import { between, corners, edits, inWorld, ofSolid, outline, placed, solidOf, turnOf, wallBetween } from "./solids.js";

/** @typedef {import("./solids.js").Solid} Solid */
/** @typedef {"table" | "wall" | "box" | "lamp"} Kind */
const NAMES = { table: "Table", wall: "Wall", box: "Box", lamp: "Lamp" };
const HINTS = { table: "Drag over the table's plane from one corner to the other.", wall: "Drag along the foot of the wall, then drag upward to its height.",
  box: "Drag over its foot from one corner to the other, then drag upward to its height.", lamp: "Press at the place on the table below the lamp, and drag upward to where it hangs." };
const SMALLEST = 0.005;
/** In place of its number while a surface is drawn for the first time. */
const NEW = -2;
/** Metres of a wall and of a lamp whose height was not dragged. */
const USUAL = { wall: 1, lamp: 1 };

/** @param {import("../studio.js").Studio} studio @param {() => void} begun called when something is to be drawn here */
export function surfaces(studio, begun) {
  /** @type {Kind | ""} */ let tool = "";
  /** @type {{lamp: boolean, i: number}} */ let chosen = { lamp: false, i: -1 };
  /** What is drawn or dragged now, ahead of the file. @type {{lamp: boolean, i: number, solid?: Solid, lampAt?: number[]} | null} */ let draft = null;
  /** Where a stroke began. @type {number[] | null} */ let from = null;
  /** The surface whose height the next stroke drags. @type {{i: number, begun: number | null} | null} */ let raising = null;

  const tables = () => studio.state.table.local ?? [];
  const lamps = () => studio.state.table.light?.lamps ?? [];
  const lens = () => studio.measured?.camera ?? null;
  const ready = () => lens() !== null && studio.shownPath === studio.platePath;
  /** The first table: what all else is drawn on. */
  const main = () => tables().findIndex((/** @type {any} */ each) => each.shape === "plane" && !each.rotate?.[0] && !each.rotate?.[2]);
  const ground = () => (tables()[main()]?.height ?? 0) + (tables()[main()]?.translate?.[1] ?? 0);
  /** @param {number} i @returns {Solid | null} */
  const solid = (i) => (draft && !draft.lamp && draft.i === i && draft.solid) || (tables()[i] ? solidOf(tables()[i]) : i === -1 && !tables().length ? usual() : null);
  const lamp = (/** @type {number} */ i) => (draft?.lamp && draft.i === i && draft.lampAt) || lamps()[i];
  const picked = () => (chosen.lamp ? (lamps()[chosen.i] ? chosen : { lamp: false, i: main() }) : tables()[chosen.i] ? chosen : { lamp: false, i: main() });

  /** The table that is taken where none is described: of usual size about the ball. @returns {Solid} */
  function usual() {
    const radius = studio.state.table.light?.ball?.radius ?? 0.05;
    return { kind: "table", x: 0, y: 0, z: 0, w: 24 * radius, d: 24 * radius, h: 0, turn: 0 };
  }

  /** @param {any} table */
  function nameOf(table) {
    const found = solidOf(table);
    if (found) return NAMES[found.kind];
    return table.mesh ?? (table.shape === "plane" && !table.size ? "Table without an end" : table.shape);
  }

  /** What a new entry holds. @param {Solid} s */
  const entry = (s) => ({ ...placed(s), reflectance: "recover" });

  /** Add a surface; the table that was taken without a word is then described too, lest it go. @param {Solid} s
   *  @returns {Promise<boolean>} whether it was not refused */
  async function add(s) {
    const written = await studio.edit(async () => {
      const ofBall = !["grid", "pose", "lines", "file"].some((key) => studio.state.table.camera?.[key]);
      const first = tables().length || s.kind === "table" ? [] : [{ append: ["local"], value: ofBall ? entry(usual()) : { shape: "plane", reflectance: "recover" } }];
      return [...first, { append: ["local"], value: entry(s) }];
    });
    return chooseLast(false, written === true);
  }

  /** Choose what was added, unless it was refused. @param {boolean} isLamp @param {boolean} written */
  function chooseLast(isLamp, written) {
    if (written) choose(isLamp, (isLamp ? lamps() : tables()).length - 1);
    else choose(chosen.lamp, chosen.i);
    return written;
  }

  /** @param {boolean} isLamp @param {number} i */
  function choose(isLamp, i) {
    chosen = { lamp: isLamp, i };
    draft = null;
    studio.rebuild();
    studio.drawn();
  }

  /** @param {number[][]} value */
  const writeLamps = (value) => studio.edit([value.length ? { set: ["light", "lamps"], value: value.map((each) => each.map(rounded)) } : { remove: ["light", "lamps"] }]);

  /** Draw a surface as it is dragged, and write it at the end. @param {number} i @param {Solid} s @param {boolean} done */
  function follow(i, s, done) {
    const mine = (draft = { lamp: false, i, solid: s });
    studio.drawn();
    if (!done) return;
    if (i < 0) add(s);
    else studio.edit(async () => edits(i, tables()[i], s)).then(() => settle(mine));
  }

  /** What was dragged is in the file: that is shown from now on. @param {unknown} mine */
  function settle(mine) {
    if (draft !== mine) return;
    draft = null;
    studio.drawn();
  }

  /** @param {number} i @param {number[]} where @param {boolean} done */
  function followLamp(i, where, done) {
    const mine = (draft = { lamp: true, i, lampAt: where });
    studio.drawn();
    if (!done) return;
    studio.edit([{ set: ["light", "lamps", i], value: where.map(rounded) }]).then(() => settle(mine));
  }

  /** @param {Kind | ""} wanted */
  function take(wanted) {
    tool = tool === wanted ? "" : wanted;
    [draft, from, raising] = [null, null, null];
    if (tool) begun();
    studio.rebuild();
    studio.drawn();
  }

  /** One in the middle of what is seen, for hands that do not drag. */
  async function addUsual() {
    const kind = tool, { x, y } = studio.canvas.view;
    const hit = (lens() && onPlane(lens(), x, y, ground())) ?? [0, ground(), 0], w = usual().w / 6;
    take("");
    if (kind === "lamp") {
      chooseLast(true, await writeLamps([...lamps(), [hit[0], ground() + USUAL.lamp, hit[2]]]) === true);
    } else if (kind === "wall") await add(wallBetween(lens(), [hit[0] - w, hit[1], hit[2]], [hit[0] + w, hit[1], hit[2]], USUAL.wall));
    else if (kind) await add(between(kind, [hit[0] - w, hit[1], hit[2] - w], [hit[0] + w, hit[1], hit[2] + w], kind === "box" ? w : 0));
  }

  /** The handles of the chosen surface. @param {number} i @param {Solid} s */
  function handles(i, s) {
    const view = lens(), [w, h] = view.size, name = NAMES[s.kind].toLowerCase();
    /** @type {import("../overlay.js").Handle[]} */ const found = [];
    const add = (/** @type {string} */ key, /** @type {number[]} */ point, /** @type {string} */ label, /** @type {(x: number, y: number) => Solid | null} */ to) => {
      const [x, y] = project(view, point);
      if (Number.isFinite(x)) found.push({ key, x, y, label, moved: (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) => {
        const next = to(a, b);
        if (next) follow(i, next, done);
      } });
    };
    const hit = (/** @type {number} */ x, /** @type {number} */ y) => onPlane(view, x, y, s.y);
    /** @type {(x: number, y: number) => Solid | null} */
    const raised = (x, y) => {
      const top = onVertical(view, x, y, s.x, s.z);
      return top === null ? null : { ...s, h: Math.max(top - s.y, SMALLEST) };
    };
    if (s.kind === "wall") {
      const [foot, top] = corners(s);
      foot.forEach((end, n) => add(`end ${n}`, end, `The wall's ${n ? "second" : "first"} end`, (x, y) => {
        const there = hit(x, y);
        return there && wallBetween(view, n ? foot[0] : there, n ? there : foot[1], s.h);
      }));
      add("top", top[0].map((each, axis) => (each + top[1][axis]) / 2), "The wall's height", raised);
      return found;
    }
    // A side is held in the middle of what the picture shows of it.
    const [foot] = corners(s), sides = [[3, 0], [1, 2], [0, 1], [3, 2]];
    sides.forEach(([a, b], side) => {
      const seen = Array.from({ length: 65 }, (_, n) => foot[a].map((each, axis) => each + ((foot[b][axis] - each) * n) / 64)).filter((each) => {
        const [u, v] = project(view, each);
        return u > 0 && v > 0 && u < w && v < h;
      });
      if (!seen.length) return;
      const along = side < 2 ? 0 : 1, sign = side % 2 ? 1 : -1;
      add(`side ${side}`, seen[seen.length >> 1], `The ${name}'s ${["left", "right", "back", "front"][side]} side`, (x, y) => {
        const there = hit(x, y);
        if (!there) return null;
        const half = (along ? s.d : s.w) / 2, wide = sign * ofSolid(s, there)[along] + half, by = (sign * (wide - 2 * half)) / 2;
        if (wide < 0.01) return null;
        const [X, , Z] = inWorld(s, along ? 0 : by, 0, along ? by : 0);
        return { ...s, x: X, z: Z, [along ? "d" : "w"]: wide };
      });
    });
    add("turn", foot[2], `Turn the ${name} about its middle`, (x, y) => {
      const there = hit(x, y);
      return there && { ...s, turn: turnOf(((Math.atan2(-(there[2] - s.z), there[0] - s.x) - Math.atan2(-s.d, s.w)) * 180) / Math.PI) };
    });
    if (s.kind === "box") {
      add("top", inWorld(s, 0, s.h, 0), "The box's height", raised);
      add("move", inWorld(s, 0, 0, 0), "Move the box on the table", (x, y) => {
        const there = hit(x, y);
        return there && { ...s, x: there[0], z: there[2] };
      });
    } else if (i !== main()) {
      add("top", inWorld(s, 0, 0, 0), "The table's height", (x, y) => {
        const top = onVertical(view, x, y, s.x, s.z);
        return top === null ? null : { ...s, y: top };
      });
    }
    return found;
  }

  /** A lamp's cord, with handles for its place and its height. @param {number} i */
  function drawnLamp(i) {
    const view = lens(), where = lamp(i), foot = [where[0], ground(), where[2]], [[x, y], [a, b]] = [project(view, foot), project(view, where)];
    const held = !chosen.lamp || picked().i !== i || tool ? [] : [
      { key: `lamp ${i} foot`, x, y, label: `Below lamp ${i + 1}, on the table`, moved: (/** @type {number} */ u, /** @type {number} */ v, /** @type {boolean} */ done) => {
        const there = onPlane(view, u, v, ground());
        if (there) followLamp(i, [there[0], where[1], there[2]], done);
      } },
      { key: `lamp ${i}`, x: a, y: b, label: `Lamp ${i + 1}'s height`, moved: (/** @type {number} */ u, /** @type {number} */ v, /** @type {boolean} */ done) => {
        const top = onVertical(view, u, v, where[0], where[2]);
        if (top !== null) followLamp(i, [where[0], top, where[2]], done);
      } },
    ];
    return { lines: [{ key: `lamp ${i}`, d: [line(view, foot, where)], className: "y" }], handles: held.filter((each) => Number.isFinite(each.x)),
      words: Number.isFinite(a) ? [{ key: `lamp ${i}`, x: a, y: b, text: `lamp ${i + 1}, ${(where[1] - ground()).toFixed(2)} m above the table` }] : [] };
  }

  /** Where the light comes from most, as a line from where it was measured: a lamp hangs on it. */
  function guide() {
    const { probe, lamp: towards } = studio.measured;
    if (!probe || !towards) return [];
    const turn = ((studio.state.table.light?.heading ?? 0) * Math.PI) / 180, [x, y, z] = towards;
    const there = [Math.cos(turn) * x + Math.sin(turn) * z, y, Math.cos(turn) * z - Math.sin(turn) * x];
    return [{ key: "towards", d: [line(lens(), probe, probe.map((/** @type {number} */ each, /** @type {number} */ i) => each + 4 * there[i]), 64)], className: "z" }];
  }

  /** What is being drawn: its shape, from where the stroke began to here. @param {number[]} here @returns {Solid} */
  const stroke = (here) => {
    const start = /** @type {number[]} */ (from);
    if (tool === "wall") return wallBetween(lens(), start, here, SMALLEST);
    return between(tool === "box" ? "box" : "table", start, here, tool === "box" ? SMALLEST : 0);
  };

  return {
    rest() {
      [tool, draft, from, raising] = ["", null, null, null];
    },
    solid,
    build() {
      const now = picked(), buttons = /** @type {Kind[]} */ (["table", "wall", "box", "lamp"]).map((each) => {
        const made = make("button", { type: "button", disabled: !lens(), onclick: () => take(each) }, `Draw a ${each}`);
        made.setAttribute("aria-pressed", String(tool === each));
        return made;
      });
      const listed = (/** @type {string} */ text, /** @type {boolean} */ isLamp, /** @type {number} */ i) => {
        const made = make("button", { type: "button", data: { surface: isLamp ? `lamp ${i}` : String(i) }, onclick: () => choose(isLamp, i) }, text);
        made.setAttribute("aria-pressed", String(now.lamp === isLamp && now.i === i));
        return make("li", {}, made);
      };
      const lead = [
        make("h2", {}, "Surfaces and lamps"),
        make("div", { className: "row", role: "group", ariaLabel: "Draw on the photograph" }, ...buttons),
        ...(tool ? [make("p", {}, HINTS[tool]), make("div", { className: "row" }, make("button", { type: "button", onclick: addUsual }, "Put one in the middle"))]
          : raising ? [make("p", {}, "Drag upward in the photograph to its height.")] : []),
        make("ul", { className: "things" }, ...tables().map((/** @type {any} */ each, /** @type {number} */ i) =>
          listed(`${i + 1} ${nameOf(each)}`, false, i)),
        ...lamps().map((/** @type {unknown} */ _, /** @type {number} */ i) => listed(`Lamp ${i + 1}`, true, i))),
      ];
      if (now.lamp) return [...lead, vectorField(studio, `Lamp ${now.i + 1}`, ["light", "lamps", now.i], ["x", "y", "z"]),
        make("p", {}, "The measured light has to show it there, within 6°; the blue line leads to where most light comes from."),
        make("div", { className: "row" }, make("button", { type: "button", onclick: () => writeLamps(lamps().filter((/** @type {unknown} */ _, /** @type {number} */ i) => i !== now.i)) }, "Take it out"))];
      const table = tables()[now.i], i = now.i;
      if (!table) return [...lead, make("p", {}, "None is described; one of usual size about the ball is taken."),
        make("div", { className: "row" }, make("button", { type: "button", onclick: () => add(usual()) }, "Describe it"))];
      const known = [["found in every pixel", "recover"], ["found, one colour", "recover even"],
        ...(Array.isArray(table.reflectance) ? [[`given: ${table.reflectance.join(", ")}`, table.reflectance]] : [])];
      const gloss = [["matte", false], ["found", "recover"], ...(table.gloss && typeof table.gloss === "object" ? [["given", table.gloss]] : [])];
      const endless = table.shape === "plane" && !table.size, shape = solidOf(table);
      return [...lead,
        ...(endless ? [make("div", { className: "row" }, make("button", { type: "button", onclick: () => studio.edit([{ set: ["local", i, "size"], value: [1.2, 1.2] }]) }, "It is endless: give it a size"))] : []),
        ...(table.size ? [vectorField(studio, "Size", ["local", i, "size"], shape?.kind === "wall" ? ["along", "up"] : ["x", "z"])] : []),
        ...(table.shape === "plane" && shape?.kind !== "wall" ? [numberField(studio, "Height", ["local", i, "height"], { otherwise: 0, unit: "m", step: 0.001 })] : []),
        ...(table.low ? [vectorField(studio, "Low corner", ["local", i, "low"], ["x", "y", "z"]), vectorField(studio, "High corner", ["local", i, "high"], ["x", "y", "z"])] : []),
        ...(table.translate ? [vectorField(studio, "Moved by", ["local", i, "translate"], ["x", "y", "z"])] : []),
        choiceField(studio, "Reflectance", ["local", i, "reflectance"], /** @type {[string, any][]} */ (known), "recover"),
        choiceField(studio, "Gloss", ["local", i, "gloss"], /** @type {[string, any][]} */ (gloss), false),
        make("div", { className: "row" }, make("button", { type: "button", onclick: () => {
          choose(false, -1);
          studio.edit(tables().length > 1 ? [{ remove: ["local", i] }] : [{ remove: ["local"] }]);
        } }, "Take it out")),
      ];
    },
    drawing() {
      const view = lens(), now = picked();
      if (!ready() || !view) return { lines: [], handles: [], words: [] };
      /** @type {import("../overlay.js").Line[]} */ const lines = [];
      const held = [], words = [];
      // Where none is described the one that is taken can be drawn on.
      for (let i = tables().length ? 0 : -1; i < tables().length; i++) {
        const s = solid(i), mine = !now.lamp && now.i === i && !tool;
        if (!s) continue;
        lines.push(...outline(view, s, i === main() ? "table" : `surface ${i}`, mine));
        if (mine && !raising) held.push(...handles(i, s));
      }
      if (draft?.solid && draft.i === NEW) lines.push(...outline(view, draft.solid, "draft", true));
      const hanging = lamps().length + (draft?.lamp && draft.i === lamps().length ? 1 : 0);
      for (let i = 0; i < hanging; i++) {
        const drawn = drawnLamp(i);
        lines.push(...drawn.lines);
        held.push(...drawn.handles);
        words.push(...drawn.words);
      }
      if (tool === "lamp" || now.lamp) lines.push(...guide());
      return { lines, handles: held, words };
    },
    /** @param {PointerEvent} event @param {"begin" | "move" | "end"} phase */
    drag(event, phase) {
      if ((!tool && !raising) || !ready()) return false;
      const view = lens(), [x, y] = studio.overlay.at(event);
      if (raising) {
        const { i } = raising, s = solid(i), here = s && onVertical(view, x, y, s.x, s.z);
        if (!s || here === null) return false;
        if (phase === "begin") raising.begun = here;
        const next = { ...s, h: Math.max(here - (raising.begun ?? s.y), SMALLEST) }, done = phase === "end";
        // A click alone leaves the height as it is.
        if (done) raising = null;
        if (done && next.h <= SMALLEST) draft = null;
        else follow(i, next, done);
        if (done) studio.rebuild();
        studio.drawn();
        return true;
      }
      if (phase === "begin") from = onPlane(view, x, y, ground());
      if (!from) return phase === "begin" ? (studio.say("that is beyond the table's plane: begin below the horizon"), true) : true;
      if (tool === "lamp") {
        const top = onVertical(view, x, y, from[0], from[2]), up = top === null ? 0 : top - ground();
        draft = { lamp: true, i: lamps().length, lampAt: [from[0], ground() + (up > 0.02 ? up : USUAL.lamp), from[2]] };
      } else {
        const here = onPlane(view, x, y, ground());
        if (here) draft = { lamp: false, i: NEW, solid: stroke(here) };
      }
      if (phase === "end") finish();
      studio.drawn();
      return true;
    },
  };

  /** The end of a stroke: what was drawn is written, and of walls and boxes the height comes next. */
  async function finish() {
    const drawn = draft, kind = tool;
    [tool, from] = ["", null];
    if (!drawn || (drawn.solid && drawn.solid.w < 0.02)) {
      draft = null;
      return studio.rebuild();
    }
    if (drawn.lampAt) {
      const where = drawn.lampAt;
      return chooseLast(true, await writeLamps([...lamps(), where]) === true);
    }
    const s = /** @type {Solid} */ (drawn.solid);
    if (kind === "table") return add(s);
    if (!(await add({ ...s, h: kind === "wall" ? USUAL.wall : Math.min(s.w, s.d) }))) return;
    raising = { i: tables().length - 1, begun: null };
    studio.rebuild();
    studio.drawn();
  }
}

/** What was found of a surface, as lines to write on it: reflectance, then gloss, each with its error. @param {any} found */
export function foundWords(found) {
  const three = (/** @type {number[]} */ each) => each.map((v) => v.toFixed(3)).join(" ");
  const lines = found.reflectance ? [`reflectance ${three(found.reflectance)} ± ${three(found.spread ?? [0, 0, 0])}`] : [];
  const { gloss } = found, errors = gloss?.found;
  if (gloss) lines.push(errors ? `gloss F₀ ${gloss.f0.toFixed(3)} ± ${errors.f0_error.toFixed(3)}, roughness ${gloss.roughness.toFixed(2)} ± ${errors.roughness_error.toFixed(2)}`
    : `gloss given: F₀ ${gloss.f0.toFixed(3)}, roughness ${gloss.roughness.toFixed(2)}`);
  return lines;
}
