// Objects: dropped on the photograph, dragged on the table, turned and scaled; drawn at once, rendered when they rest.

import { addedLights } from "./added_lights.js";
import { ACCEPTED, allDropped, handOver } from "./dropping.js";
import { materialBalls } from "./material_balls.js";
import { choiceField, make, numberField, rounded, typed } from "../fields.js";
import { Drawing } from "../drawing.js";
import { line, onPlane, project, wholePixels } from "../projection.js";
import { bytes, json, post } from "../../requests.js";

const IDENTITY = { moved: [0, 0, 0], turn: 0, scale: 1 };

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function objectsPane(studio) {
  const live = /** @type {HTMLCanvasElement} */ (document.getElementById("live"));
  /** @type {Drawing | null} */ let drawing = null;
  /** @type {{low: number[], high: number[], foot: number[], digest: string, mesh: import("../drawing.js").Mesh | null}[]} */ let objects = [];
  let fetched = -1, coming = Promise.resolve(), chosen = 0, looks = true, shining = 1, presets = /** @type {string[]} */ ([]), fault = "", lastJob = -1, begun = 0;
  /** @type {{number: number, from: number[], moved: number[], turn: number, scale: number} | null} */ let act = null;

  const added = addedLights(studio), tables = () => studio.state.table.objects ?? [];
  const lens = () => studio.measured?.camera ?? null;
  const balls = materialBalls(studio, {
    chosen: () => chosen,
    choose(n) {
      if (n === chosen) return;
      chosen = n;
      studio.drawn();
    },
    under: (x, y) => (lens() ? under(x * ofPlate(), y * ofPlate()) : -1),
    exposure: () => (studio.shownPath === "preview.exr" ? 1 : shining) * 2 ** studio.canvas.view.stops,
  });
  /** The quick look is of a smaller plate. */
  const ofPlate = () => (studio.shownPath === "preview.exr" && wholePixels(lens().size, studio.facts.get(studio.number)?.size ?? lens().size)) || 1;

  /** The objects where the shot has them now. */
  const fetchObjects = () => (coming = coming.then(fetchNow));

  async function fetchNow() {
    if (fetched === studio.state.revision) return;
    const revision = studio.state.revision;
    await studio.attempt(async () => {
      try {
        const found = studio.state.fault === null ? await json("/objects") : { objects: [], presets };
        drawing ??= new Drawing(live);
        // What stands as it stood is drawn as it was.
        const before = [...objects], kept = found.objects.map((/** @type {any} */ each) => {
          const i = before.findIndex(({ digest, mesh }) => mesh && digest === each.digest);
          return i < 0 ? null : before.splice(i, 1)[0].mesh;
        });
        const meshes = lens() ? await Promise.all(kept.map(async (/** @type {any} */ mesh, /** @type {number} */ i) =>
          mesh ?? /** @type {Drawing} */ (drawing).mesh(/** @type {ArrayBuffer} */ (await bytes(`/objects/${i}`))))) : kept;
        for (const each of before) if (each.mesh) drawing.forget(each.mesh);
        objects = found.objects.map((/** @type {any} */ each, /** @type {number} */ i) => ({ ...each, mesh: meshes[i] ?? null }));
        ({ presets } = found);
        fault = "";
        act = null;
      } catch (error) {
        fault = error instanceof Error ? error.message : String(error);
      }
    });
    fetched = revision;
    if (studio.panes[studio.step]?.name === "Objects") studio.rebuild();
    studio.drawn();
  }

  /** The plate, under what is drawn at once; or the last quick look. @param {boolean} looked */
  async function show(looked) {
    if (live.hidden !== looked) {
      live.hidden = looked;
      studio.rebuild();
    }
    if (looked) return studio.show("preview.exr", "results");
    if (studio.platePath && studio.shownPath !== studio.platePath) await studio.show(studio.platePath);
    await exposed();
    return studio.drawn();
  }

  /** How many times the plate's photograph is as bright as radiance: by the medians of it and of the quick look. */
  async function exposed() {
    if (!studio.state.results.includes("preview.exr") || studio.shownPath !== studio.platePath) return;
    await studio.attempt(async () => {
      const { number } = await post("/opened", { path: "preview.exr", where: "results" });
      shining = (await studio.ratio(studio.number, number)) ?? shining;
    });
  }

  /** The edits that move, turn about its foot and scale an object. @param {number} n @param {{moved: number[], turn: number, scale: number}} by */
  function edits(n, by) {
    const table = tables()[n], foot = objects[n]?.foot ?? [0, 0, 0], changes = [];
    const ofBall = !["grid", "pose", "lines", "file"].some((key) => studio.state.table.camera?.[key]);
    const stands = Array.isArray(table.stand) || (table.stand === undefined && ofBall && !table.translate?.some(Boolean) && !table.stage);
    const rotate = turnedBy(table.rotate ?? [0, 0, 0], by.turn);
    if (by.turn) changes.push({ set: ["objects", n, "rotate"], value: rotate.map(rounded) });
    if (by.scale !== 1) {
      if (table.size) changes.push({ set: ["objects", n, "size"], value: rounded(table.size * by.scale) });
      else changes.push({ set: ["objects", n, "scale"], value: rounded((table.scale ?? 1) * by.scale) });
    }
    if (stands && (by.moved[0] || by.moved[2])) {
      const [x, z] = table.stand ?? [0, 0];
      changes.push({ set: ["objects", n, "stand"], value: [rounded(x + by.moved[0]), rounded(z + by.moved[2])] });
    } else if (!stands) {
      // v' = k·T(v − foot) + foot + moved, for v = s·R·p + t: T goes to the rotation, and the rest to t.
      const t = (table.translate ?? [0, 0, 0]).map((/** @type {number} */ each, /** @type {number} */ i) => each - foot[i]);
      const c = Math.cos((by.turn * Math.PI) / 180), s = Math.sin((by.turn * Math.PI) / 180);
      const turned = [c * t[0] + s * t[2], t[1], c * t[2] - s * t[0]].map((each, i) => rounded(by.scale * each + foot[i] + by.moved[i]));
      if (turned.some((each, i) => Math.abs(each - (table.translate?.[i] ?? 0)) > 1e-9)) changes.push({ set: ["objects", n, "translate"], value: turned });
    }
    return changes;
  }

  /** Write an act, and look at the result where that is wanted. @param {number} n @param {{moved: number[], turn: number, scale: number}} by */
  async function write(n, by) {
    await studio.edit(async () => {
      await fetchObjects(); // its foot, where the act before has left it
      return edits(n, by);
    });
    look();
  }

  /** Look at the result of an act, where that is wanted. */
  function look() {
    if (looks && studio.measured && studio.state.fault === null) studio.start("look");
  }

  /** @param {Promise<import("./dropping.js").Dropped[]>} dropped @param {[number, number]} [where] metres on the table */
  const add = (dropped, where = [0, 0]) => studio.attempt(async () => {
    const beside = 2.8 * (studio.state.table.light?.ball?.radius ?? 0.05), { meshes, left_out: left } = await handOver(await dropped);
    let came = false;
    for (const [n, path] of meshes.entries()) {
      // Several stand side by side, each to be had by the pointer.
      const stand = [where[0] + (n - (meshes.length - 1) / 2) * beside, where[1]];
      await studio.edit([{ append: ["objects"], value: { mesh: path, stand: stand.map(rounded) } }], true);
      await fetchObjects();
      came = true;
      chosen = tables().length - 1;
      // What is no thing for a table gets the size of two balls; its file may be in other units.
      const one = objects[chosen], radius = studio.state.table.light?.ball?.radius ?? 0.05;
      const side = longest(one) ?? 0;
      if (side > 16 * radius || (side > 0 && side < 0.4 * radius)) await studio.edit([{ set: ["objects", chosen, "size"], value: rounded(4 * radius) }]);
    }
    studio.rebuild();
    show(false);
    if (left.length) studio.say(`left out, as no part of a mesh: ${left.join(", ")}`);
    if (came) look();
  });

  /** Where an event is in the plate. @param {MouseEvent} event */
  const at = (event) => studio.overlay.at(event).map((each) => each * ofPlate());

  /** The object under a point of the picture: the nearest of those whose box shows there. @param {number} x @param {number} y */
  function under(x, y) {
    let found = -1, nearest = Infinity;
    objects.forEach((each, n) => {
      const corners = boxOf(each).map((corner) => project(lens(), corner));
      const [xs, ys] = [0, 1].map((axis) => corners.map((each) => each[axis]));
      const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
      const away = Math.hypot(...each.foot.map((v, i) => v - lens().position[i]));
      if (x >= left && x <= right && y >= top && y <= bottom && away < nearest) [found, nearest] = [n, away];
    });
    return found;
  }

  /** @param {number} turn @param {number} scale @param {number[]} [moved] */
  const nudge = (turn, scale, moved = [0, 0, 0]) => {
    if (tables()[chosen]) write(chosen, { moved, turn, scale });
  };
  /** Along the table as the camera sees it: to the right, and away. @param {number} right @param {number} away */
  function along(right, away) {
    if (!lens()) return;
    const r = lens().rotation, x = [r[0][0], r[2][0]], length = Math.hypot(x[0], x[1]);
    const [a, b] = x.map((each) => each / length);
    nudge(0, 1, [right * a + away * b, 0, right * b - away * a].map(rounded));
  }

  return {
    name: "Objects",
    keys: ["objects"],
    build() {
      const list = tables().map((/** @type {any} */ each, /** @type {number} */ n) => {
        const button = make("button", { type: "button", onclick: () => ((chosen = n), studio.rebuild(), studio.drawn()) }, String(each.mesh).split("/").pop() ?? "");
        button.setAttribute("aria-pressed", String(n === chosen));
        return make("li", {}, button);
      });
      const input = make("input", { type: "file", multiple: true, accept: ACCEPTED, hidden: true,
        onchange: () => add(Promise.resolve([...(input.files ?? [])].map((file) => ({ name: file.name, file })))) });
      const drop = make("div", { className: "drop" }, "Drop a glTF, OBJ, PLY, STL or USD on the photograph, with the files that belong to it or as a folder, or ",
        make("button", { type: "button", onclick: () => input.click() }, "choose one"), input);
      input.setAttribute("aria-label", "Mesh files");
      const one = tables()[chosen], box = make("input", { type: "checkbox", id: "objects-look", checked: looks, onchange: () => (looks = box.checked) });
      return [
        drop,
        ...(fault ? [make("p", { className: "doubt" }, fault)] : []),
        make("ul", { className: "things" }, ...list),
        ...(one ? [
          make("h2", {}, String(one.mesh).split("/").pop() ?? ""),
          make("p", {}, lens() ? "Drag it on the table. Shift-drag turns it. Keys: Shift and arrows move it by a centimetre, [ and ] turn it, full stop and comma scale it."
            : "The camera is not known yet: find it under Camera, then objects can be dragged."),
          numberField(studio, "Longest side", ["objects", chosen, "size"], { unit: "m", step: 0.01, min: 0, found: longest(objects[chosen]) }),
          numberField(studio, "Scale", ["objects", chosen, "scale"], { otherwise: 1, step: 0.01, min: 0 }),
          numberField(studio, "Smooth up to", ["objects", chosen, "smooth"], { unit: "°", step: 5, min: 5, max: 180 }),
          make("div", { className: "row" }, ...[["Turn left", 15, 1], ["Turn right", -15, 1], ["Larger", 0, 1.1], ["Smaller", 0, 1 / 1.1]].map(([text, turn, scale]) =>
            make("button", { type: "button", onclick: () => nudge(Number(turn), Number(scale)) }, String(text)))),
          choiceField(studio, "Material", ["objects", chosen, "material"],
            [["its own", {}], ...presets.map((each) => /** @type {[string, any]} */ ([each, { preset: each }])),
              ...(one.material && !presets.includes(one.material.preset) ? [/** @type {[string, any]} */ (["as in the shot file", one.material])] : [])], {}),
          ...balls.build(),
          make("div", { className: "row" }, make("button", { type: "button", onclick: () => {
            studio.edit([{ remove: ["objects", chosen] }]).then(() => tables().length && look());
            chosen = 0;
          } }, "Take it out")),
        ] : []),
        ...added.build(),
        make("h2", {}, "Look"),
        make("div", { className: "row" }, box, make("label", { for: "objects-look" }, "Look after every act")),
        make("div", { className: "row" },
          make("button", { type: "button", className: "primary", disabled: studio.state.fault !== null, onclick: () => studio.start("look") }, "Quick look"),
          make("button", { type: "button", disabled: !studio.state.results.includes("preview.exr"), onclick: () => show(live.hidden === false) }, live.hidden ? "Show it live" : "Show the look")),
        typed(`relume insert shot.toml --preview -o ${studio.state.out}`,
          `import relume as rl\n\nresult = rl.insert(rl.read_shot("shot.toml"), "${studio.state.out}", preview=True)`),
      ];
    },
    shown() {
      fetched = -1;
      fetchObjects();
      balls.fetchBalls();
      show(false);
    },
    hidden: () => void (live.hidden = true),
    changed() {
      const { job } = studio.state;
      if (lens() && objects.some((each) => !each.mesh)) fetched = -1; // the camera has come since
      fetchObjects();
      balls.fetchBalls();
      if (job.status === "running" && job.steps.includes("first picture") && begun !== job.number && !act) {
        begun = job.number;
        show(true);
      }
      if (job.status === "done" && job.number !== lastJob && job.kind !== "check") {
        if (lastJob >= 0 || studio.shownPath === "preview.exr") show(true);
      }
      if (job.status === "done") lastJob = job.number;
      else if (lastJob < 0) lastJob = 0;
    },
    drawn() {
      balls.drawn();
      if (live.hidden || !drawing || !lens() || studio.shownPath !== studio.platePath) return;
      const { light } = studio.state.table, placed = objects.flatMap((each, n) => (each.mesh
        ? [{ mesh: each.mesh, foot: each.foot, ...(act?.number === n ? { moved: act.moved, turn: act.turn, scale: act.scale } : IDENTITY) }] : []));
      drawing.draw(placed, lens(), studio.canvas.view, {
        irradiance: studio.measured.irradiance, lamp: studio.measured.lamp, exposure: shining * 2 ** (studio.canvas.view.stops + (light?.exposure ?? 0)),
        turn: (light?.turn ?? 0) + (light?.heading ?? 0), ground: 0,
      }, act !== null);
    },
    drawing() {
      const one = objects[chosen];
      if (!one || !lens() || live.hidden) return {};
      const by = act?.number === chosen ? act : IDENTITY, y = one.low[1], d = [];
      const place = (/** @type {number} */ x, /** @type {number} */ z) => {
        const c = Math.cos((by.turn * Math.PI) / 180), s = Math.sin((by.turn * Math.PI) / 180), a = (x - one.foot[0]) * by.scale, b = (z - one.foot[2]) * by.scale;
        return [c * a + s * b + one.foot[0] + by.moved[0], y, c * b - s * a + one.foot[2] + by.moved[2]];
      };
      const [l, r, t, b] = [one.low[0], one.high[0], one.low[2], one.high[2]];
      for (const [p, q] of [[[l, t], [r, t]], [[r, t], [r, b]], [[r, b], [l, b]], [[l, b], [l, t]]]) d.push(line(lens(), place(p[0], p[1]), place(q[0], q[1])));
      return { lines: [{ key: "foot", d }] };
    },
    clicked(x, y) {
      if (!added.aiming || !lens()) return;
      added.place(x * ofPlate(), y * ofPlate());
    },
    drag(event, phase) {
      if (!lens() || added.aiming) return false;
      const [x, y] = at(event);
      if (phase === "begin") {
        const n = under(x, y);
        if (n < 0) return false;
        chosen = n;
        const height = objects[n].low[1], from = onPlane(lens(), x, y, height);
        if (!from) return false;
        act = { number: n, from: event.shiftKey ? [x] : from, moved: [0, 0, 0], turn: 0, scale: 1 };
        show(false);
        studio.rebuild();
        return true;
      }
      if (!act) return false;
      if (event.shiftKey || act.from.length === 1) act.turn = act.from.length === 1 ? Math.round((x - act.from[0]) * 0.5) : act.turn;
      else {
        const here = onPlane(lens(), x, y, objects[act.number].low[1]);
        if (here) act.moved = [here[0] - act.from[0], 0, here[2] - act.from[2]];
      }
      studio.drawn();
      if (phase === "end") {
        const { number, moved, turn, scale } = act;
        // What is drawn stays until the shot's own objects have come.
        if (turn || moved.some((each) => Math.abs(each) > 1e-6)) write(number, { moved, turn, scale });
        else act = null;
      }
      return true;
    },
    dropped(files, event) {
      const [x, y] = lens() ? at(event) : [0, 0], hit = lens() && onPlane(lens(), x, y, 0);
      add(allDropped(files, event), hit ? [hit[0], hit[2]] : [0, 0]);
    },
    commands: [
      { name: "turn it to the left", keys: ["["], act: () => nudge(15, 1) },
      { name: "turn it to the right", keys: ["]"], act: () => nudge(-15, 1) },
      { name: "larger", keys: ["."], act: () => nudge(0, 1.1) },
      { name: "smaller", keys: [","], act: () => nudge(0, 1 / 1.1) },
      { name: "a centimetre to the right", keys: ["Shift+ArrowRight"], act: () => along(0.01, 0) },
      { name: "a centimetre to the left", keys: ["Shift+ArrowLeft"], act: () => along(-0.01, 0) },
      { name: "a centimetre away", keys: ["Shift+ArrowUp"], act: () => along(0, 0.01) },
      { name: "a centimetre nearer", keys: ["Shift+ArrowDown"], act: () => along(0, -0.01) },
      { name: "the next object", keys: ["O"], act: () => {
        chosen = tables().length ? (chosen + 1) % tables().length : 0;
        studio.rebuild();
        studio.drawn();
      } },
    ],
  };
}

/** The corners of an object's box. @param {{low: number[], high: number[]}} one */
const boxOf = (one) => Array.from({ length: 8 }, (_, i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? one.high : one.low)[axis]));

/** The longest side of an object's box, metres; nothing where there is none yet. @param {{low: number[], high: number[]} | undefined} one */
const longest = (one) => (one ? Math.max(...one.high.map((each, i) => each - one.low[i])) : undefined);

/** Angles about x, then y, then z after a further turn about +Y, degrees. @param {number[]} rotate @param {number} turn */
function turnedBy(rotate, turn) {
  if (!rotate[0] && !rotate[2]) return [0, ((((rotate[1] + turn + 180) % 360) + 360) % 360) - 180, 0];
  const [a, b, c] = rotate.map((each) => (each * Math.PI) / 180), [sa, sb, sc] = [a, b, c].map(Math.sin), [ca, cb, cc] = [a, b, c].map(Math.cos);
  // R = Rz·Ry·Rx, then Ry(turn)·R; rows x, y, z.
  const R = [[cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa], [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa], [-sb, cb * sa, cb * ca]];
  const t = (turn * Math.PI) / 180, [s, k] = [Math.sin(t), Math.cos(t)];
  const T = [0, 1, 2].map((i) => k * R[0][i] + s * R[2][i]), Z = [0, 1, 2].map((i) => k * R[2][i] - s * R[0][i]);
  return [Math.atan2(Z[1], Z[2]), Math.asin(-Math.min(Math.max(Z[0], -1), 1)), Math.atan2(R[1][0], T[0])].map((each) => (each * 180) / Math.PI);
}
