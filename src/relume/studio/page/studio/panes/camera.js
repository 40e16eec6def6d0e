// Camera: from a board that is found and drawn, from lines along the axes, or from the ball where the plate shows it.

import { at, choiceField, make, numberField, rounded, typed, vectorField } from "../fields.js";
import { grid, line, project } from "../projection.js";
import { post } from "../../requests.js";

const AXES = /** @type {const} */ (["x", "y", "z"]);

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function cameraPane(studio) {
  /** The board as it was found just now. @type {any} */ let board = null;
  let boardWords = "", asked = "", inFile = "", gridShown = false;
  /** Rim of the ball as the plate would show it. @type {number[] | null} */ let rim = null;
  /** Where its stand meets the table, while that is dragged. @type {number[] | null} */ let foot = null;

  const camera = () => studio.state.table.camera ?? {};
  const source = () => ["grid", "pose", "lines", "file"].find((key) => camera()[key] !== undefined) ?? "ball";
  const picture = () => (source() === "grid" ? camera().grid.photograph : studio.platePath);

  /** @param {string} wanted */
  async function choose(wanted) {
    if (wanted === source()) return;
    const changes = ["grid", "pose", "lines", "file", "ball"].filter((key) => camera()[key] !== undefined).map((key) => ({ remove: ["camera", key] }));
    const { light } = studio.state.table, { facts } = studio, size = facts.get(studio.number)?.size ?? [768, 512];
    if (wanted === "grid") {
      const single = studio.brackets.filter((each) => each.kind === "photographs" && each.frames.length === 1).map((each) => each.frames[0].path);
      const photograph = single.find((each) => /grid|board|chess|calib/i.test(each)) ?? single[0] ?? studio.platePath;
      changes.push(/** @type {any} */ ({ set: ["camera", "grid"], value: { photograph, squares: [9, 6], square: 0.03 } }));
    }
    if (wanted === "lines") {
      const [w, h] = size, s = (/** @type {number[]} */ ...v) => v.map((each, i) => Math.round(each * (i % 2 ? h : w)));
      changes.push(/** @type {any} */ ({ set: ["camera", "lines"], value: {
        x: [s(0.25, 0.55, 0.75, 0.55), s(0.25, 0.8, 0.75, 0.8)], z: [s(0.35, 0.85, 0.42, 0.5), s(0.65, 0.85, 0.58, 0.5)],
        origin: s(0.5, 0.7), length: { between: [s(0.4, 0.7), s(0.6, 0.7)], metres: 0.5 },
      } }));
    }
    if (wanted !== "ball" && light?.ball && !light.ball.centre) changes.push(/** @type {any} */ ({ set: ["light", "ball", "centre"], value: [0, light.ball.radius, 0] }));
    if (wanted === "ball") {
      if (light?.ball?.centre) changes.push({ remove: ["light", "ball", "centre"] });
      if (light?.balls?.[0]?.camera) changes.push(/** @type {any} */ ({ remove: ["light", "balls", 0, "camera"] }));
    }
    await studio.edit(changes, true);
    shown();
  }

  async function findBoard() {
    const { grid, focal_length } = camera();
    if (!grid) return;
    const key = JSON.stringify([grid, focal_length]);
    if (key === asked) return;
    asked = key;
    boardWords = "seeking the board …";
    board = null;
    await studio.attempt(async () => {
      try {
        board = await post("/board", { photograph: grid.photograph, squares: grid.squares, square: grid.square, focal_length });
        boardWords = `the board is there: the camera stood ${board.camera.position[1].toFixed(3)} m above it, `
          + `${Math.hypot(...board.camera.position).toFixed(3)} m from its middle`;
      } catch (error) {
        boardWords = error instanceof Error ? error.message : String(error);
      }
    });
    if (studio.panes[studio.step]?.name === "Camera") studio.rebuild();
    studio.drawn();
  }

  function shown() {
    rim = at(camera(), ["ball", "rim"]) ?? null;
    if (picture()) studio.show(picture());
    if (source() === "grid") findBoard();
  }

  const lens = () => studio.measured?.camera ?? null;

  /** Where the foot of the ball's stand is drawn: dragged, given, or as it was found. */
  function footAt() {
    return foot ?? at(camera(), ["ball", "foot"]) ?? (lens() && project(lens(), [0, 0, 0]));
  }

  /** Say what the ball stood on, and look again. @param {"raised" | "foot" | ""} key @param {any} [value] */
  async function standsOn(key, value) {
    const had = ["raised", "foot", ...(key === "foot" ? ["camera_height"] : [])].filter((each) => at(camera(), ["ball", each]) !== undefined);
    await studio.edit([...had.filter((each) => each !== key).map((each) => ({ remove: ["camera", "ball", each] })),
      ...(key ? [{ set: ["camera", "ball", key], value }] : [])], true);
    foot = null;
    if (studio.measured && studio.state.fault === null) studio.start("look");
  }

  /** The place under the ball, with a handle: its axes, squares as large as the ball, and the rim that the camera was found by. */
  function drawnFoot() {
    if (!lens() || !studio.measured.points.length) return { lines: [], handles: [], words: [] };
    const view = /** @type {import("../projection.js").Lens} */ (lens()), r = studio.state.table.light?.ball?.radius ?? at(camera(), ["ball", "radius"]) ?? 0.05, d = [], o = [0, 0, 0];
    for (let i = -4; i <= 4; i++) d.push(line(view, [2 * i * r, 0, -8 * r], [2 * i * r, 0, 8 * r]), line(view, [-8 * r, 0, 2 * i * r], [8 * r, 0, 2 * i * r]));
    /** @type {[number, number][]} */ const points = studio.measured.points, middle = [0, 1].map((i) => points.reduce((sum, each) => sum + each[i], 0) / points.length);
    const round = [...points].sort((a, b) => Math.atan2(a[1] - middle[1], a[0] - middle[0]) - Math.atan2(b[1] - middle[1], b[0] - middle[0]));
    const [x, y] = footAt();
    return {
      lines: [{ key: "squares", d, className: "thin" }, ...(rim ? [] : [{ key: "rim", d: [round], closed: true }]), ...AXES.map((axis, i) => ({ key: `axis ${axis}`, className: axis,
        d: [line(view, o, o.map((_, j) => (i === j ? 4 * r : 0)))] }))],
      handles: [{ key: "foot", x, y, label: "Where the ball's stand meets the table",
        moved: (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) => {
          foot = [a, b].map((each) => Math.round(each * 100) / 100);
          studio.drawn();
          if (done) standsOn("foot", foot);
        } }],
      words: [{ key: "foot", x, y, text: "objects stand here" }],
    };
  }

  /** Where the ball's rim is in the plate. @param {number[]} now @param {boolean} done */
  function rimMoved(now, done) {
    rim = now;
    studio.drawn();
    if (done) studio.edit([{ set: ["camera", "ball", "rim"], value: now.map((each) => Math.round(each * 100) / 100) }], true);
  }

  /** Put a number of [camera.lines] where a handle is. @param {(string | number)[]} place @param {number[]} value @param {number} i
   *  @returns {(x: number, y: number, done: boolean) => void} */
  const lineMoved = (place, value, i) => (x, y, done) => {
    value[i] = Math.round(x * 100) / 100;
    value[i + 1] = Math.round(y * 100) / 100;
    studio.drawn();
    if (done) studio.edit([{ set: ["camera", "lines", ...place], value: [...value] }], true);
  };

  /** What is drawn of lines, with their handles. */
  function drawnLines() {
    const { lines } = camera(), drawn = [], handles = [], words = [];
    for (const axis of AXES) for (const [n, each] of (lines[axis] ?? []).entries()) {
      drawn.push({ key: `${axis}${n}`, className: axis, d: [/** @type {[number, number][]} */ ([[each[0], each[1]], [each[2], each[3]]])] });
      for (const i of [0, 2]) handles.push({ key: `${axis}${n}${i}`, x: each[i], y: each[i + 1], label: `End of line ${n + 1} along ${axis}`, moved: lineMoved([axis, n], each, i) });
    }
    handles.push({ key: "origin", x: lines.origin[0], y: lines.origin[1], label: "Origin", moved: lineMoved(["origin"], lines.origin, 0) });
    words.push({ key: "origin", x: lines.origin[0], y: lines.origin[1], text: "origin" });
    if (lines.length) {
      const ends = lines.length.between;
      drawn.push({ key: "length", d: [ends] });
      for (const i of [0, 1]) handles.push({ key: `length${i}`, x: ends[i][0], y: ends[i][1], label: "End of the length that was measured",
        moved: lineMoved(["length", "between", i], ends[i], 0) });
      words.push({ key: "length", x: (ends[0][0] + ends[1][0]) / 2, y: (ends[0][1] + ends[1][1]) / 2, text: `${lines.length.metres} m` });
    }
    return { lines: drawn, handles, words };
  }

  /** Straight lines of the world as the lens bends them, and where a lens without distortion would have them.
   *  @param {import("../projection.js").Lens} lens */
  function drawnLens(lens) {
    const bent = grid(lens), furthest = bent.furthest.toFixed(bent.furthest < 10 ? 1 : 0);
    return { lines: [{ key: "straight", d: bent.straight, className: "faint" }, { key: "bent", d: bent.bent, className: "thin" }],
      words: [{ key: "lens", x: bent.at[0], y: bent.at[1], text: `the lens bends by up to ${furthest} pixels` }] };
  }

  /** The board's squares as a camera sees them. @param {import("../projection.js").Lens} lens @param {number} height */
  function drawnBoard(lens, height) {
    const { squares, square } = camera().grid, x = (squares[0] * square) / 2, z = (squares[1] * square) / 2, d = [];
    for (let i = 0; i <= squares[0]; i++) d.push(line(lens, [i * square - x, height, -z], [i * square - x, height, z]));
    for (let i = 0; i <= squares[1]; i++) d.push(line(lens, [-x, height, i * square - z], [x, height, i * square - z]));
    const o = [0, height, 0];
    return [
      { key: "board", d, className: "thin" }, { key: "axis x", d: [line(lens, o, [0.1, height, 0])], className: "x" },
      { key: "axis y", d: [line(lens, o, [0, height + 0.1, 0])], className: "y" }, { key: "axis z", d: [line(lens, o, [0, height, 0.1])], className: "z" },
    ];
  }

  function ofBoard() {
    const photographs = studio.brackets.filter((each) => each.kind === "photographs").flatMap((each) => each.frames.map((/** @type {any} */ one) => one.path));
    return [
      choiceField(studio, "Photograph", ["camera", "grid", "photograph"], photographs.map((each) => [each, each]), null),
      vectorField(studio, "Squares", ["camera", "grid", "squares"], ["long", "short"], ""),
      numberField(studio, "Side of one", ["camera", "grid", "square"], { unit: "m", step: 0.001, min: 0 }),
      numberField(studio, "Thickness", ["camera", "grid", "thickness"], { otherwise: 0, unit: "m", step: 0.001, min: 0 }),
      choiceField(studio, "Bend of the lens", ["camera", "grid", "estimate_k1"], [["none", false], ["found from the board", true]], false),
      make("p", { ariaLive: "polite" }, boardWords),
    ];
  }

  function ofLines() {
    const axis = (/** @type {"x" | "y" | "z"} */ name, /** @type {string} */ text) => make("button", { type: "button", onclick: () => {
      const { view } = studio.canvas, n = camera().lines[name]?.length ?? 0, [x, y] = [view.x, view.y + 20 * n];
      studio.edit([{ append: ["camera", "lines", name], value: [x - 60, y, x + 60, y].map(Math.round) }], true);
    } }, text);
    return [
      make("p", {}, "Lay lines along edges that run as the red and the blue axis do at the place (X to the right, Z towards you), two of each; "
        + "set the origin, and the ends of a length on the table that was measured."),
      make("div", { className: "row" }, axis("x", "+ along X"), axis("z", "+ along Z"), axis("y", "+ upright")),
      numberField(studio, "The length", ["camera", "lines", "length", "metres"], { unit: "m", min: 0 }),
    ];
  }

  function ofBall() {
    const { raised, foot: given } = camera().ball ?? {}, way = given ? "foot" : raised === 0 ? "table" : raised ? "raised" : "seen";
    const stand = make("select", { id: "camera-stand", onchange: () => {
      if (stand.value === "foot") return standsOn("foot", footAt().map((/** @type {number} */ each) => Math.round(each * 100) / 100));
      return stand.value === "seen" ? standsOn("") : standsOn("raised", stand.value === "table" ? 0 : raised);
    } }, ...[["seen", "what the photographs show"], ["table", "the table itself"], ...(lens() || given ? [["foot", "a stand, whose foot is drawn"]] : []),
      ...(raised ? [["raised", `a stand of ${raised} m`]] : [])].map(([value, text]) => make("option", { value, selected: value === way }, text)));
    return [
      make("p", {}, rim ? "Drag the circle to where the plate shows the ball, or would show it." : "The ball's photograph from the plate's own place says "
        + "where the camera stood. Where only crops of the ball exist, draw where the plate would show it:"),
      make("div", { className: "row" }, make("button", { type: "button", onclick: () => {
        if (rim) return studio.edit([{ remove: ["camera", "ball", "rim"] }], true).then(() => ((rim = null), studio.drawn()));
        const size = studio.facts.get(studio.number)?.size ?? [768, 512];
        rimMoved([size[0] / 2, 0.62 * size[1], 0.06 * size[0]], true);
        return studio.rebuild();
      } }, rim ? "Leave the circle out" : "Draw the ball")),
      ...(studio.state.table.light?.ball ? [] : [numberField(studio, "Ball's radius", ["camera", "ball", "radius"], { unit: "m", step: 0.001, min: 0 })]),
      make("div", { className: "row" }, make("label", { for: "camera-stand" }, "It stood on"), stand),
      ...(lens() ? [make("p", {}, "The squares lie on the table, each as wide as the ball. Drag the handle to where the ball, or its stand, met the table.")] : []),
      numberField(studio, "Looked down", ["camera", "ball", "pitch"], { unit: "°" }),
      numberField(studio, "Lens above table", ["camera", "ball", "camera_height"], { unit: "m" }),
    ];
  }

  return {
    name: "Camera",
    keys: ["camera"],
    build() {
      const id = "camera-source", now = source(), { light } = studio.state.table;
      const sources = [["ball", "the ball"], ["grid", "a chequered board"], ["lines", "lines on the photograph"], ...(now === "pose" || now === "file" ? [[now, now]] : [])];
      const tape = now === "ball" || !light?.balls ? [] : [
        make("h2", {}, "By tape measure"),
        vectorField(studio, "Ball's middle", ["light", "ball", "centre"], ["x", "y", "z"]),
        ...light.balls.map((/** @type {any} */ _, /** @type {number} */ i) => vectorField(studio, `Camera of view ${i + 1}`, ["light", "balls", i, "camera"], ["x", "y", "z"])),
      ];
      const lens = studio.measured?.camera ?? board?.camera, stood = studio.measured?.camera.position, shows = make("input", { type: "checkbox", id: "camera-grid", checked: gridShown, disabled: !lens?.distortion,
        onchange: () => ((gridShown = shows.checked), studio.drawn()) });
      return [
        make("div", { className: "row" }, make("label", { for: id }, "Found from"), make("select", {
          id, onchange: (/** @type {Event} */ event) => choose(/** @type {HTMLSelectElement} */ (event.target).value),
        }, ...sources.map(([value, text]) => make("option", { value, selected: value === now }, text)))),
        ...(now === "grid" ? ofBoard() : now === "lines" ? ofLines() : now === "ball" ? ofBall() : [make("p", {}, `As [camera] ${now} in the shot file says.`)]),
        numberField(studio, "Focal length", ["camera", "focal_length"], { unit: "pixels", min: 1, found: studio.measured?.camera.focal_length }),
        ...tape,
        make("h2", {}, "Lens"),
        make("div", { className: "row" }, shows, make("label", { for: "camera-grid" }, lens?.distortion ? "Show how it bends straight lines"
          : lens ? "It bends nothing, as far as is known" : "Shown once the camera is found")),
        make("h2", {}, "Measured"),
        make("div", { className: "row" }, make("button", { type: "button", className: "primary", onclick: () => studio.start("look") }, "Find the camera")),
        make("p", {}, stood ? `By ${studio.measured.agreement}. The lens was ${stood[1].toFixed(3)} m above the table and ${Math.hypot(stood[0], stood[2]).toFixed(3)} m beside the origin.`
          : "Not yet: a quick look finds camera and light together."),
        typed("relume insert shot.toml --dry-run -o " + studio.state.out,
          'import relume as rl\n\nprint(rl.report.check_shot(rl.read_shot("shot.toml")).facts)'),
      ];
    },
    shown,
    changed() {
      if (source() === "grid") findBoard();
      const now = JSON.stringify(at(camera(), ["ball", "rim"]) ?? null);
      if (now !== inFile) rim = JSON.parse(now);
      inFile = now;
    },
    drawing() {
      if (studio.shownPath !== picture()) return {};
      const now = source(), measured = studio.measured?.camera;
      if (gridShown && (measured ?? board?.camera)?.distortion) return drawnLens(measured ?? board.camera);
      if (now === "lines") return drawnLines();
      if (now === "grid") {
        const lens = board?.camera ?? measured, height = board ? 0 : camera().grid.thickness ?? 0;
        if (!lens) return {};
        return { lines: drawnBoard(lens, height), words: AXES.map((axis, i) => {
          const [x, y] = project(lens, [i === 0 ? 0.1 : 0, height + (i === 1 ? 0.1 : 0), i === 2 ? 0.1 : 0]);
          return { key: axis, x, y, text: axis.toUpperCase() };
        }) };
      }
      const place = drawnFoot();
      if (!rim) return place;
      const [x, y, r] = rim;
      const circle = /** @type {[number, number][]} */ (Array.from({ length: 90 }, (_, i) => [x + r * Math.cos((i * Math.PI) / 45), y + r * Math.sin((i * Math.PI) / 45)]));
      return {
        words: place.words,
        lines: [...place.lines, { key: "rim", d: [circle], closed: true }],
        handles: [
          ...place.handles,
          { key: "middle", x, y, label: "The ball's middle in the plate", moved: (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) => rimMoved([a, b, r], done) },
          { key: "edge", x: x + r, y, label: "The ball's rim in the plate",
            moved: (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) => rimMoved([x, y, rounded(Math.max(2, Math.hypot(a - x, b - y)))], done) },
        ],
      };
    },
  };
}
