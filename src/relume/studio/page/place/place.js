// The page of a place file: edges of its blocks marked in the photographs, and what is found from the marks.

import { HdrCanvas } from "../canvas.js";
import { begin } from "../commands.js";
import { plain } from "../measured.js";
import { drawNumbers } from "../overlays/numbers.js";
import { bytes, json, listenTo, post, Refused } from "../requests.js";
import { make, quoted, typed } from "../studio/fields.js";
import { Overlay } from "../studio/overlay.js";
import { Press } from "../studio/press.js";
import { adding, known, lengths } from "./blocks.js";
import { choosing } from "./choosing.js";
import { marking } from "./marking.js";
import { solution } from "./solution.js";
import { wireframe } from "./wireframe.js";

/** @typedef {import("../source.js").PictureFacts} PictureFacts */

const NUDGE = 0.25; // pixels by which an arrow key moves the end of a mark

/** @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);
const picture = /** @type {HTMLCanvasElement} */ (element("picture"));
let busy = 0;

export class PlacePage {
  constructor() {
    /** @type {any} */ this.state = { table: {}, bodies: {}, kinds: [], there: [], found: null, lacks: null, stale: false, fault: null, job: { status: "none" }, revision: -1 };
    this.canvas = new HdrCanvas(picture, () => this.drawn(), (error) => this.say(error));
    this.overlay = new Overlay(element("overlay"), element("glass"), this.canvas);
    this.overlay.nudge = NUDGE;
    this.press = new Press(element("pane"));
    /** The photograph that is shown. */ this.photograph = "";
    /** Its size, pixels. @type {[number, number] | null} */ this.size = null;
    /** The block that is looked at, and its edge or corner that is marked. */ this.block = "";
    this.edge = "";
    /** Degrees by which the block's drawing is turned. */ this.turned = -35;
    this.namesShown = true;
    this.foundShown = true;
    this.number = -1;
    /** @type {Map<number, PictureFacts>} */ this.facts = new Map();
    /** @type {Map<string, import("./wireframe.js").Body>} */ this.bodies = new Map();
    this.marks = marking(this);
    this.showing = 0;
    this.waiting = 0;
    /** @type {Promise<unknown>} */ this.edits = Promise.resolve();
    this.failedNumber = -1;
    /** The folder's pictures that the place does not name. @type {string[]} */ this.others = [];
    /** @type {[number, number] | null} */ this.wanted = null;
    this.reading = false;
  }

  /** @param {unknown} error */
  say(error) {
    element("message").textContent = error instanceof Error ? error.message : String(error ?? "");
  }

  /** Do something that may be refused, and say so if it is. @template T @param {() => Promise<T>} act @returns {Promise<T | undefined>} */
  async attempt(act) {
    busy++;
    try {
      return await act();
    } catch (error) {
      this.say(error);
      return undefined;
    } finally {
      busy--;
    }
  }

  /** Change the place file, after what was asked for before. @param {any[]} changes @returns {Promise<unknown>} true where the file has them now */
  edit(changes) {
    this.waiting++;
    busy++;
    this.edits = this.edits.then(() => this.attempt(async () => {
      try {
        // What is drawn stays ahead of the file until the answer is there: meanwhile the server may say how it was before.
        this.take(await post("/place/edit", { changes, revision: this.state.revision }).finally(() => this.waiting--));
        this.say("");
        return true;
      } catch (error) {
        // The page shows what the file holds, not what was refused.
        this.take(await json("/place"), true);
        throw error;
      }
    }));
    return this.edits.finally(() => busy--);
  }

  /** @param {number} by */
  undo(by) {
    return this.attempt(async () => {
      await this.edits;
      this.take(await post("/place/undo", { by }));
    });
  }

  solve() {
    return this.attempt(async () => {
      await this.edits;
      this.say("");
      await post("/jobs/start", {});
    });
  }

  /** @returns {{name: string, file: string}[]} */
  get photographs() {
    return this.state.table.photographs ?? [];
  }

  /** @returns {any[]} */
  get blocks() {
    return this.state.table.blocks ?? [];
  }

  /** What the server says the place is. @param {any} state @param {boolean} [anyway] */
  take(state, anyway = false) {
    const before = this.state;
    // Another window's change may have come before the answer to ours, which is in it then.
    if (!this.waiting) this.marks.caughtUp();
    if (state.revision < before.revision) return this.drawn();
    this.state = state;
    element("title").textContent = `${state.folder.split("/").pop()}/${state.name}`;
    element("title").title = `${state.folder}/${state.name}`;
    element("undo").disabled = !state.undo;
    element("redo").disabled = !state.redo;
    element("fault").hidden = state.fault === null;
    element("fault").textContent = state.fault === null ? "" : state.readable ? `To do: ${state.fault}`
      : `${state.name}: ${state.fault} – the last good values are shown; mend the file, or undo`;
    this.showJob(state.job);
    if (!this.blocks.some((each) => each.name === this.block)) {
      this.block = this.blocks[0]?.name ?? "";
      this.edge = "";
    }
    const names = this.photographs.map((each) => each.name);
    if (!names.includes(this.photograph)) this.show(names.find((_, i) => state.there[i]) ?? names[0] ?? "");
    if (anyway || state.revision !== before.revision || state.job.status !== before.job.status) this.rebuild();
    this.drawn();
  }

  /** @param {any} job */
  showJob(job) {
    const going = ["waiting", "running", "stopping"].includes(job.status);
    const words = { waiting: "waiting", running: job.step || "starting", stopping: "stopping …", done: `solved, ${job.seconds} s`, stopped: "stopped" };
    element("job-words").textContent = words[/** @type {"done"} */ (job.status)] ?? "";
    element("job-stop").hidden = !going || job.status === "stopping";
    element("solve").disabled = going || this.state.fault !== null;
    if (job.status === "failed" && this.failedNumber !== job.number) {
      this.failedNumber = job.number;
      this.say(`not solved: ${job.error}`);
    }
  }

  /** Show a photograph; of several asked for at once the latest. @param {string} name */
  async show(name) {
    const turn = ++this.showing, index = this.photographs.findIndex((each) => each.name === name);
    this.photograph = name;
    this.rebuild();
    if (index < 0) return undefined;
    return this.attempt(async () => {
      const { number } = await post("/opened", { photograph: index }).catch((error) => {
        if (error instanceof Refused && error.status === 404) throw new Error(`${this.photographs[index].file} is not there; it can be marked where it is`);
        throw error;
      });
      const facts = await this.factsOf(number);
      if (turn !== this.showing) return;
      this.number = number;
      const another = this.shownName !== name;
      this.size = facts.size;
      this.canvas.open(facts.layers[0], this.tilesOf(number));
      if (another) this.canvas.fit();
      this.shownName = name;
      if (another && facts.kind === "radiance map") {
        const median = (await json(`/pictures/${number}/statistics?layer=0`)).median?.[3];
        if (turn === this.showing && median > 0) this.canvas.set({ stops: Math.log2(0.18 / median) });
      }
      element("caption").textContent = name;
      this.drawn();
    });
  }
  shownName = "";

  /** The next photograph, or the one before. @param {number} by */
  step(by) {
    const names = this.photographs.filter((_, i) => this.state.there[i]).map((each) => each.name);
    if (names.length) this.show(names[(names.indexOf(this.photograph) + by + names.length) % names.length]);
  }

  /** Choose what is marked next. @param {string} block @param {string} edge */
  pick(block, edge) {
    this.block = block;
    this.edge = edge;
    this.rebuild();
    this.say("");
    this.drawn();
  }

  /** The next edge of the block, or the one before. @param {number} by */
  stepEdge(by) {
    const body = this.state.bodies[this.block], names = body ? [...body.edges, ...body.corners] : [];
    if (names.length) this.pick(this.block, names[(names.indexOf(this.edge) + by + names.length) % names.length]);
  }

  /** Look which pictures of the folder are left. */
  lookForOthers() {
    return this.attempt(async () => {
      this.others = (await json("/photographs")).files;
      this.rebuild();
    });
  }

  /** @param {number} number @returns {Promise<PictureFacts>} */
  async factsOf(number) {
    let found = this.facts.get(number);
    if (!found) this.facts.set(number, (found = /** @type {PictureFacts} */ (await json(`/pictures/${number}`))));
    return found;
  }

  /** @param {number} number @returns {import("../source.js").Fetched} */
  tilesOf(number) {
    const digest = /** @type {PictureFacts} */ (this.facts.get(number)).layers[0].digest;
    return async (level, column, row, signal) => {
      try {
        return await bytes(`/tiles/${number}/0/${digest}/${level}/${column}/${row}`, signal);
      } catch (error) {
        // Written anew since: it is shown as it is now.
        if (!(error instanceof Refused && error.status === 410)) throw error;
        this.changed(number);
        return new Promise(() => {});
      }
    };
  }

  /** A file holds another picture now. @param {number} number */
  changed(number) {
    this.facts.delete(number);
    if (number === this.number) this.show(this.photograph);
  }

  /** Show everything as it is now, after what was not heard. @param {string} line that was said meanwhile */
  async lookAgain(line) {
    if (element("message").textContent === line) this.say("");
    await this.attempt(async () => {
      this.facts.clear();
      const state = await json("/place");
      // Another server counts from its own beginning.
      if (state.revision < this.state.revision) this.state.revision = -1;
      this.take(state, true);
      await this.show(this.photograph);
    });
  }

  // The pane.

  /** Build the pane anew, with the focus where it was; not while something of it is pressed. */
  rebuild() {
    this.press.wait(() => this.replace());
  }

  replace() {
    const root = element("pane"), focused = document.activeElement, top = root.scrollTop;
    const inside = root.contains(focused) ? [...root.querySelectorAll("button, input, select, summary")].indexOf(/** @type {Element} */ (focused)) : -1;
    const open = [...root.querySelectorAll("details[open]")].map((/** @type {any} */ each) => each.dataset.part);
    root.replaceChildren(...this.build());
    root.querySelectorAll("details").forEach((/** @type {any} */ each) => (each.open = open.includes(each.dataset.part)));
    root.scrollTop = top;
    if (inside >= 0) root.querySelectorAll("button, input, select, summary")[inside]?.focus();
    this.drawBody();
  }

  build() {
    const { name } = this.state, number = this.blocks.findIndex((each) => each.name === this.block), { edges, corners } = this.state.bodies[this.block] ?? { edges: [], corners: [] };
    const names = make("input", { type: "checkbox", id: "names-shown", checked: this.namesShown, onchange: () => {
      this.namesShown = names.checked;
      this.drawn();
    } });
    return [
      make("div", { className: "strip", role: "group", ariaLabel: "Photographs" }, ...this.photographs.map((each, i) => this.thumbnail(each, i))),
      make("h2", {}, "Blocks"),
      make("div", { className: "blocks", role: "group", ariaLabel: "Blocks" }, ...this.blocks.map((each) => make("button", { type: "button", ariaPressed: String(each.name === this.block),
        data: { block: each.name }, title: each.kind, onclick: () => this.pick(each.name, "") }, each.name))),
      make("div", { id: "drawing" }),
      make("div", { className: "row" }, ...[["Turn it to the left", -45], ["Turn it to the right", 45]].map(([text, by]) => make("button", { type: "button", onclick: () => {
        this.turned += Number(by);
        this.drawBody();
      } }, String(text)))),
      this.edgeList(edges, "Edges"),
      part("corners", "Corners", ...(corners.length ? [this.edgeList(corners, "Corners")] : ["It has none."])),
      make("p", { id: "to-do" }, this.marks.words()),
      make("div", { className: "row" },
        make("button", { type: "button", id: "put", disabled: !this.edge || this.marks.points(this.block, this.edge) !== null, onclick: () => this.marks.put() }, "Put it there"),
        make("button", { type: "button", id: "remove", disabled: !this.edge || this.marks.points(this.block, this.edge) === null, onclick: () => this.marks.remove() }, "Remove the mark")),
      make("div", { className: "row" }, names, make("label", { for: "names-shown" }, "Write the names on the photograph")),
      make("h2", {}, "Found"),
      ...solution(this),
      part("known", `What is known of ${this.block}`, ...known(this, number)),
      part("adding", "Add a block", ...adding(this)),
      part("photographs", "Photographs", ...choosing(this)),
      part("lengths", "Measured lengths", ...lengths(this)),
      typed(`relume model ${quoted(name ?? "")} -o ${quoted(name ?? "")}`, `import relume as rl\n\nplace = rl.model_place("${name}", out="${name}")\nprint(place.facts())`),
    ];
  }

  /** @param {{name: string, file: string}} photograph @param {number} i */
  thumbnail({ name, file }, i) {
    const camera = this.state.found?.cameras[name];
    const button = make("button", { type: "button", className: "thumb", title: file, ariaPressed: String(name === this.photograph), data: { photograph: name }, onclick: () => this.show(name) });
    if (this.state.there[i]) button.append(make("img", { alt: "", src: `/photographs/${i}?${encodeURIComponent(file)}` }));
    button.append(make("span", {}, name), make("span", {}, camera ? `${camera.residual.toFixed(2)} px` : ""), ...(this.state.there[i] ? [] : [make("span", { className: "doubt" }, "not there")]));
    return button;
  }

  /** @param {string[]} names of edges or corners @param {string} what */
  edgeList(names, what) {
    return make("div", { className: "edges", role: "group", ariaLabel: `${what} of ${this.block}` }, ...names.map((name) => {
      const times = this.marks.times(this.block, name), here = this.marks.points(this.block, name) !== null;
      const title = `${here ? "marked here; " : ""}marked in ${times} photograph${times === 1 ? "" : "s"}`;
      return make("button", { type: "button", data: { edge: name }, ariaPressed: String(name === this.edge), title, onclick: () => this.pick(this.block, name) },
        make("span", {}, name.replaceAll("_", " ")), make("span", { className: here ? "here" : "" }, times ? `${here ? "●" : ""}${times}` : ""));
    }));
  }

  /** Draw the block that is looked at, once its body is known. */
  async drawBody() {
    const block = this.blocks.find((each) => each.name === this.block), key = JSON.stringify([block?.name, block?.kind, block?.profile]);
    if (!block || !this.state.bodies[block.name]) return element("drawing").replaceChildren();
    const found = this.bodies.get(key) ?? (await this.attempt(() => json(`/place/body?block=${encodeURIComponent(block.name)}`)));
    if (!found) return undefined;
    this.bodies.set(key, found);
    if (block.name !== this.block) return undefined;
    // Sizes that are not known yet are drawn as large as those that are given.
    const given = ["width", "height", "depth"].map((each) => (typeof block[each] === "number" ? block[each] : 0));
    const size = this.state.found?.blocks[block.name]?.size ?? given.map((each) => each || Math.max(...given) || 1);
    return element("drawing").replaceChildren(wireframe(found, {
      turn: this.turned, chosen: this.edge, size, choose: (name) => this.pick(block.name, name),
      state: (name) => (this.marks.points(block.name, name) ? "here" : this.marks.times(block.name, name) ? "elsewhere" : ""),
    }));
  }

  /** After every frame. */
  drawn() {
    const { view } = this.canvas;
    element("exposure").value = String(view.stops);
    element("exposure-shown").textContent = `${view.stops >= 0 ? "+" : "−"}${Math.abs(view.stops).toFixed(2)} stops`;
    this.overlay.draw(this.shownName === this.photograph ? this.marks.drawing() : {});
    const digest = this.facts.get(this.number)?.layers[0].digest ?? "";
    drawNumbers(element("numbers"), this.canvas, { address: `/pictures/${this.number}/values?layer=0`, digest }, null, (error) => this.say(error));
  }

  /** Read the pixel under the pointer. @param {number} x @param {number} y */
  async read(x, y) {
    this.wanted = [x, y];
    if (this.reading) return;
    this.reading = true;
    while (this.wanted) {
      const [a, b] = this.wanted, [i, j] = this.wanted.map(Math.floor), facts = this.facts.get(this.number);
      this.wanted = null;
      if (!facts || i < 0 || j < 0 || i >= facts.size[0] || j >= facts.size[1]) continue;
      try {
        const value = await json(`/pictures/${this.number}/value?layer=0&x=${i}&y=${j}`);
        element("value").textContent = `${a.toFixed(1)}, ${b.toFixed(1)}: ${value.rgb.map(plain).join("  ")}`;
      } catch { /* the picture went meanwhile */ }
    }
    this.reading = false;
  }
}

/** A part of the pane that is folded away until it is wanted. @param {string} name @param {string} title @param {(Node | string)[]} inside */
const part = (name, title, ...inside) => make("details", { data: { part: name } }, make("summary", {}, title), ...inside);

const page = new PlacePage();

// The pointer: a mark that is drawn takes it, else it pans; the wheel enlarges where it is.

/** @param {MouseEvent} event */
function screenPoint(event) {
  const box = picture.getBoundingClientRect(), density = page.canvas.width / box.width;
  return /** @type {[number, number]} */ ([(event.clientX - box.left) * density, (event.clientY - box.top) * density]);
}
/** @type {{x: number, y: number, taken: boolean, from: [number, number]} | null} */ let drag = null;
picture.addEventListener("pointerdown", (event) => {
  if (event.button !== 0) return;
  picture.setPointerCapture(event.pointerId);
  const [x, y] = screenPoint(event);
  drag = { x, y, taken: page.marks.drag(event, "begin"), from: [x, y] };
});
picture.addEventListener("pointermove", (event) => {
  const [x, y] = screenPoint(event);
  if (drag?.taken) page.marks.drag(event, "move");
  else if (drag) {
    page.canvas.pan(x - drag.x, y - drag.y);
    Object.assign(drag, { x, y });
  } else {
    page.read(...page.overlay.at(event));
    page.marks.hovered(event);
  }
});
picture.addEventListener("pointerleave", () => page.marks.hovered(null));
picture.addEventListener("pointerup", (event) => {
  const [x, y] = screenPoint(event);
  if (drag?.taken) page.marks.drag(event, "end");
  else if (drag && Math.hypot(x - drag.from[0], y - drag.from[1]) < 4) page.marks.clicked(...page.overlay.at(event));
  drag = null;
});
picture.addEventListener("wheel", (event) => {
  event.preventDefault();
  page.canvas.enlarge(2 ** (-event.deltaY / (event.deltaMode ? 6 : 200)), ...screenPoint(event));
}, { passive: false });
element("exposure").addEventListener("input", (/** @type {Event} */ event) => page.canvas.set({ stops: Number(/** @type {HTMLInputElement} */ (event.target).value) }));

// Commands and keys.

const middle = () => /** @type {[number, number]} */ ([page.canvas.width / 2, page.canvas.height / 2]);
begin([
  { name: "Undo", keys: ["Ctrl+Z"], act: () => page.undo(1) },
  { name: "Redo", keys: ["Ctrl+Shift+Z", "Ctrl+Y"], act: () => page.undo(-1) },
  { name: "Solve: find cameras and sizes", keys: ["Ctrl+Enter"], act: () => page.solve() },
  { name: "Stop solving", keys: [], act: () => page.attempt(() => post("/jobs/stop", {})) },
  { name: "Next photograph", keys: ["ArrowRight"], act: () => page.step(1) },
  { name: "Photograph before", keys: ["ArrowLeft"], act: () => page.step(-1) },
  { name: "Next edge of the block", keys: ["ArrowDown"], act: () => page.stepEdge(1) },
  { name: "Edge before", keys: ["ArrowUp"], act: () => page.stepEdge(-1) },
  { name: "Put the chosen edge there", keys: ["P"], act: () => page.marks.put() },
  { name: "Remove the mark, or the chosen point of it", keys: ["Delete", "Backspace"], act: () => page.marks.remove() },
  { name: "Choose no edge", keys: ["Escape"], act: () => page.pick(page.block, "") },
  { name: "Half a stop brighter", keys: ["E"], act: () => page.canvas.set({ stops: page.canvas.view.stops + 0.5 }) },
  { name: "Half a stop darker", keys: ["Shift+E"], act: () => page.canvas.set({ stops: page.canvas.view.stops - 0.5 }) },
  { name: "Exposure as it is in the file", keys: ["R"], act: () => page.canvas.set({ stops: 0 }) },
  { name: "Fit the photograph", keys: ["F"], act: () => page.canvas.fit() },
  { name: "One pixel to one pixel", keys: ["1"], act: () => page.canvas.enlarge(1 / page.canvas.view.zoom, ...middle()) },
  { name: "Enlarge", keys: ["+", "="], act: () => page.canvas.enlarge(2, ...middle()) },
  { name: "Reduce", keys: ["-"], act: () => page.canvas.enlarge(0.5, ...middle()) },
]);
element("undo").addEventListener("click", () => page.undo(1));
element("redo").addEventListener("click", () => page.undo(-1));
element("solve").addEventListener("click", () => page.solve());
element("job-stop").addEventListener("click", () => page.attempt(() => post("/jobs/stop", {})));

/** For tests: the page's own state, and whether all that was asked for is shown. */
Object.assign(window, { relume: { canvas: page.canvas, page, settled: () => page.canvas.settled && !busy && !page.press.held && page.state.revision >= 0 } });

page.attempt(async () => {
  page.take(await json("/place"), true);
  page.lookForOthers();
  listenTo(({ state, changed }) => {
    if (state) page.take(state);
    if (changed !== undefined) page.changed(changed);
  }, (line) => page.say(line), (line) => page.lookAgain(line));
});
