// The studio's page: the steps along the light, one picture, and the shot file that every act edits.

import { markTwin, stopsBetween, twinPixel } from "../overlays/beside.js";
import { HdrCanvas } from "../canvas.js";
import { begin } from "../commands.js";
import { hdrSwitch } from "../extended.js";
import { plain } from "../measured.js";
import { drawNumbers } from "../overlays/numbers.js";
import { drawLegend, errorLayer, falseColourEnds } from "../overlays/legend.js";
import { cameraPane } from "./panes/camera.js";
import { deliverPane } from "./panes/deliver.js";
import { developPane } from "./panes/develop.js";
import { lightPane } from "./panes/light.js";
import { objectsPane } from "./panes/objects.js";
import { photographsPane } from "./panes/photographs.js";
import { placePane } from "./panes/place.js";
import { radiancePane } from "./panes/radiance.js";
import { make } from "./fields.js";
import { Overlay } from "./overlay.js";
import { Press } from "./press.js";
import { wholePixels } from "./projection.js";
import { bytes, json, listenTo, post, Refused } from "../requests.js";

/** @typedef {import("../source.js").PictureFacts} PictureFacts */
/** @typedef {{name: string, keys: string[], build: () => Node[], shown?: () => void, hidden?: () => void, changed?: () => void, done?: () => void,
 *   drawing?: () => import("./overlay.js").Drawing, drawn?: () => void, drag?: (event: PointerEvent, phase: "begin" | "move" | "end") => boolean,
 *   clicked?: (x: number, y: number) => void, commands?: import("../commands.js").Command[], dropped?: (files: File[], event: DragEvent) => void}} Pane keys: what of the shot it shows; done: called when a job has ended;
 *   clicked: on a point of the picture */

/** @param {string} id @returns {any} */
const element = (id) => document.getElementById(id);
const picture = /** @type {HTMLCanvasElement} */ (element("picture"));
let busy = 0;

export class Studio {
  constructor() {
    /** @type {any} */ this.state = { table: {}, fault: null, job: { status: "none" }, revision: -1, plate: [], balls: [], results: [], measured: null, merged: null };
    this.canvas = new HdrCanvas(picture, () => this.drawn(), (error) => this.say(error));
    this.overlay = new Overlay(element("overlay"), element("glass"), this.canvas);
    this.press = new Press(element("pane"));
    /** @type {Map<number, PictureFacts>} */ this.facts = new Map();
    this.number = -1;
    this.shownPath = this.shownWhere = "";
    /** What the last job measured, for panes to draw. @type {any} */ this.measured = null;
    /** @type {any[]} */ this.brackets = [];
    /** @type {Pane[]} */ this.panes = [];
    this.step = -1;
    this.turn = 0;
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

  /** Change the shot file, after what was asked for before. @param {any[] | (() => Promise<any[]>)} wanted the changes, or what says
   *  them once the changes before are made @param {boolean} [unfinished] whether the shot may lack something after it
   *  @returns {Promise<unknown>} true where the file has them now */
  edit(wanted, unfinished = false) {
    const answer = async () => {
      const changes = typeof wanted === "function" ? await wanted() : wanted;
      return changes.length ? post("/shot/edit", { changes, revision: this.state.revision, unfinished: unfinished || this.state.fault !== null }) : null;
    };
    this.edits = this.edits.then(() => this.attempt(async () => {
      try {
        // What is drawn stays ahead of the file until the answer is there: meanwhile the server may say how it was before.
        const state = await answer().finally(() => this.waiting--);
        this.take(state ?? this.state); // as it is, too: what was said meanwhile is followed now
        if (!state) return undefined;
        this.say("");
        return true;
      } catch (error) {
        // The page shows what the file holds, not what was refused.
        this.take(await json("/shot"), true);
        throw error;
      }
    }));
    busy++;
    this.waiting++;
    return this.edits.finally(() => busy--);
  }
  /** Edits that the file does not have yet. */
  waiting = 0;
  /** @type {Promise<unknown>} */ edits = Promise.resolve();

  /** Whether the job is not at its end. */
  get going() {
    return ["waiting", "running", "paused", "stopping"].includes(this.state.job.status);
  }

  /** @param {number} by */
  undo(by) {
    return this.attempt(async () => this.take(await post("/shot/undo", { by })));
  }

  /** @param {"check" | "merge" | "look" | "insert"} kind */
  start(kind) {
    return this.attempt(async () => {
      this.say("");
      await post("/jobs/start", { kind, about: this.lookedAt() });
    });
  }

  /** Where the pointer is in the plate, for its surroundings to be rendered first: shares of its width and height; null elsewhere.
   *  @returns {[number, number] | null} */
  lookedAt() {
    const ofPlate = this.shownPath === this.platePath || (this.shownWhere === "results" && /^(composite|preview)\./.test(this.shownPath));
    if (!this.pointer || !this.size || !ofPlate) return null;
    const [u, v] = this.canvas.toPicture(...this.pointer).map((each, i) => each / /** @type {[number, number]} */ (this.size)[i]);
    return u >= 0 && u <= 1 && v >= 0 && v <= 1 ? [u, v] : null;
  }
  /** The pointer on the screen, while it is over the picture. @type {[number, number] | null} */ pointer = null;

  /** Hold the job, or let it go on. */
  pause() {
    return this.attempt(() => post("/jobs/pause", { paused: this.state.job.status !== "paused" }));
  }

  stop() {
    return this.attempt(() => post("/jobs/stop", {}));
  }

  /** Show a picture; of several asked for at once the latest. @param {string} path @param {string} [where] @param {boolean} [fit]
   *  @param {boolean} [goesOn] whether it follows what is shown, as in a film: that stays until all of this is there */
  async show(path, where = "folder", fit = false, goesOn = false) {
    const turn = ++this.turn;
    return this.attempt(async () => {
      // A preview may be gone by now: the job that wrote it has ended.
      const found = await post("/opened", { path, where }).catch((error) => {
        if (!(where === "results" && error instanceof Refused && error.status === 404)) throw error;
      });
      if (!found) return;
      const { number } = found, facts = await this.factsOf(number);
      if (turn !== this.turn) return;
      const before = this.size;
      this.number = number;
      this.size = facts.size;
      this.shownPath = path;
      this.shownWhere = where;
      const errors = this.canvas.view.errors;
      this.canvas.open(facts.layers[0], this.tilesOf(number, 0), false, goesOn);
      if (errors && !this.canvas.view.errors) await this.showErrors(false);
      if (turn !== this.turn) return;
      if (fit || !before || !this.keepPlace(before, facts.size)) this.canvas.fit();
      // Kept as it is set while pictures of one kind are looked at.
      const ofPlate = where === "results" && /^(composite|preview)\./.test(path) && facts.kind === "radiance map", kind = ofPlate ? "over the plate" : facts.kind;
      if (this.exposedFor !== kind) {
        const stops = facts.kind !== "radiance map" ? 0 : (ofPlate ? await this.plateStops(number) : null) ?? (await this.greyStops(number));
        if (turn === this.turn && stops !== null) this.canvas.set({ stops });
      }
      if (turn !== this.turn) return;
      this.exposedFor = kind;
      const { noise } = facts;
      element("caption").textContent = path + (typeof noise === "number" ? `: noise ${plain(Number((100 * noise).toPrecision(2)))} %` : "");
      this.drawn();
    });
  }
  exposedFor = "";
  /** Of the picture that is shown: its file may be another by now. @type {[number, number] | null} */ size = null;

  /** Look at the same place of another picture of the same thing, whose pixels are a few of the other's or parts of them; whether it is.
   *  @param {[number, number]} before @param {[number, number]} now */
  keepPlace(before, now) {
    const step = wholePixels(now, before), other = wholePixels(before, now), { view } = this.canvas;
    if (!step && !other) return false;
    const k = step || 1 / other;
    if (k !== 1) this.canvas.set({ x: view.x * k, y: view.y * k, zoom: view.zoom / k });
    return true;
  }

  /** A result against the plate, made as bright by the medians. @param {string} name @param {"wipe" | "beside" | "difference"} [mode] */
  async compare(name, mode = "wipe") {
    await this.show(name, "results");
    return this.attempt(async () => {
      const { number } = await post("/opened", { path: this.platePath }), facts = await this.factsOf(number);
      const ratio = await this.ratio(this.number, number);
      this.canvas.open(facts.layers[0], this.tilesOf(number, 0), true);
      this.reference = number;
      this.canvas.set({ mode, wipe: 0.5, gain: ratio ?? 1 });
      this.say({
        wipe: "left: the composite; right: the plate. Drag, or use the arrow keys; W ends it",
        beside: "left: the composite; right: the plate, as bright by their medians. Both move together; B ends it",
        difference: "the composite less the plate, as bright by their medians: grey is alike; D ends it",
      }[mode]);
    });
  }

  /** The last render, or the quick look, against the plate; or that ended. @param {"wipe" | "beside" | "difference"} mode */
  async against(mode) {
    if (this.canvas.view.mode === mode) return this.uncompare();
    const name = ["composite.exr", "preview.exr"].find((each) => this.state.results.includes(each));
    return name ? this.compare(name, mode) : this.say("there is no picture to compare yet: take a quick look (L), or render the composite");
  }

  /** How uncertain each pixel is, drawn over the picture; or that ended. @param {boolean} [asked] whether it is said where nothing is
   *  known, and not only that the picture is another by now */
  async showErrors(asked = true) {
    if (this.canvas.view.errors) {
      this.say("");
      return this.canvas.closeErrors();
    }
    return this.openErrors(asked);
  }

  /** The errors as their file holds them now. @param {boolean} asked */
  openErrors(asked) {
    const { turn } = this;
    return this.attempt(async () => {
      // What a render leaves of the composite's noise stands in its layers.
      const ofRender = this.shownWhere === "results" && /^composite\./.test(this.shownPath) && this.state.results.includes("layers.exr");
      const number = ofRender ? (await post("/opened", { path: "layers.exr", where: "results" })).number : this.number;
      const facts = await this.factsOf(number), layer = errorLayer(facts);
      // Another picture is shown by now.
      if (turn !== this.turn) return;
      if (layer < 0) return asked && this.say("nothing says how uncertain these pixels are; merged radiance (under Radiance) and renders do");
      this.canvas.set({ falseColour: false, mode: "picture" });
      this.canvas.openErrors(facts.layers[layer], this.tilesOf(number, layer));
      this.errorsNumber = number;
      if (asked) this.say(ofRender ? "the error that the render's rays leave in each pixel, before the denoiser; U ends it" : "the error of each pixel, as a share of it; U ends it");
    });
  }
  /** The picture that the errors were read of: a render's are in a file of their own, which is written after the composite. */
  errorsNumber = -1;

  /** A file holds another picture now. @param {number} number */
  changed(number) {
    this.facts.delete(number);
    const { shownPath, shownWhere, state: { results } } = this;
    // A preview goes when the job that wrote it has ended.
    if (number === this.number && (shownWhere !== "results" || results.includes(shownPath))) this.show(shownPath, shownWhere);
    else if (number === this.errorsNumber && this.canvas.view.errors) this.openErrors(false);
  }

  /** Wipe between two pictures of one size, each as it is. @param {{path: string, where: string}} left @param {{path: string, where: string}} right
   *  @param {string} words what is on either side */
  async beside(left, right, words) {
    await this.show(left.path, left.where);
    return this.attempt(async () => {
      const { number } = await post("/opened", right), facts = await this.factsOf(number);
      this.canvas.open(facts.layers[0], this.tilesOf(number, 0), true);
      this.reference = number;
      this.canvas.set({ mode: "wipe", gain: 1 });
      this.say(words);
    });
  }

  /** The picture that this one is compared with. */
  reference = -1;

  uncompare() {
    this.canvas.closeReference();
    this.canvas.set({ mode: "picture" });
    this.say("");
  }

  /** How many times one picture is as bright as another, by their medians. @param {number} one @param {number} other @returns {Promise<number | null>} */
  async ratio(one, other) {
    const [a, b] = (await Promise.all([one, other].map((each) => json(`/pictures/${each}/statistics?layer=0`)))).map((each) => each.median?.[3]);
    return a > 0 && b > 0 ? a / b : null;
  }

  /** Stops at which a result is as bright as the plate's photograph; null where the plate is none. @param {number} number */
  async plateStops(number) {
    if (!this.platePath) return null;
    const plate = (await post("/opened", { path: this.platePath })).number;
    const ratio = (await this.factsOf(plate)).kind === "radiance map" ? null : await this.ratio(plate, number);
    return ratio === null ? null : Math.log2(ratio);
  }

  /** Stops at which a picture's median is middle grey. @param {number} number @returns {Promise<number | null>} */
  async greyStops(number) {
    const median = (await json(`/pictures/${number}/statistics?layer=0`)).median?.[3];
    return median > 0 ? Math.log2(0.18 / median) : null;
  }

  /** @param {number} number @returns {Promise<PictureFacts>} */
  async factsOf(number) {
    let found = this.facts.get(number);
    if (!found) this.facts.set(number, (found = /** @type {PictureFacts} */ (await json(`/pictures/${number}`))));
    return found;
  }

  /** @param {number} number @param {number} layer @returns {import("../source.js").Fetched} */
  tilesOf(number, layer) {
    const digest = /** @type {PictureFacts} */ (this.facts.get(number)).layers[layer].digest;
    return async (level, column, row, signal) => {
      try {
        return /** @type {ArrayBuffer} */ (await bytes(`/tiles/${number}/${layer}/${digest}/${level}/${column}/${row}`, signal));
      } catch (error) {
        // Written anew since: it is shown as it is now.
        if (error instanceof Refused && error.status === 410 && this.facts.get(number)?.layers[layer].digest === digest) {
          this.facts.delete(number);
          if (number === this.number) this.show(this.shownPath, this.shownWhere);
          else if (number === this.errorsNumber && this.canvas.view.errors) this.openErrors(false);
          return new Promise(() => {});
        }
        throw error;
      }
    };
  }

  /** The photograph of the plate that shows most: one of the brighter ones. */
  get platePath() {
    const files = this.state.plate;
    return files.length ? files[Math.floor((files.length - 1) * 0.7)] : "";
  }

  /** Show everything as it is now, after what was not heard. @param {string} line that was said meanwhile */
  async lookAgain(line) {
    if (element("message").textContent === line) this.say("");
    await this.attempt(async () => {
      this.facts.clear();
      const state = await json("/shot");
      // Another server counts from its own beginning.
      if (state.revision < this.state.revision) this.state.revision = -1;
      this.take(state, true);
      this.brackets = (await json("/brackets")).brackets;
      this.rebuild();
      const { shownPath, shownWhere, state: { results } } = this;
      if (shownPath && (shownWhere !== "results" || results.includes(shownPath))) await this.show(shownPath, shownWhere);
    });
  }

  /** What the server says the shot is. @param {any} state @param {boolean} [anyway] */
  take(state, anyway = false) {
    const before = this.state;
    // Another window's change may have come before the answer to ours, which is in it then.
    if (state.revision < before.revision) return void (this.waiting || this.panes[this.step]?.changed?.());
    this.state = state;
    const job = state.job, old = before.job;
    this.measured = state.measured;
    element("title").textContent = `${state.folder.split("/").pop()}/${state.name}`;
    element("title").title = `${state.folder}/${state.name}`;
    element("undo").disabled = !state.undo;
    element("redo").disabled = !state.redo;
    const fault = /** @type {HTMLElement} */ (element("fault"));
    fault.hidden = state.fault === null;
    fault.textContent = state.fault === null ? "" : state.readable ? `To do: ${state.fault}`
      : `${state.name}: ${state.fault} – the last good values are shown; mend the file, or undo`;
    document.querySelectorAll("#steps button").forEach((button, i) => {
      const key = (state.fault ?? "").split(/[.:\s]/)[0];
      /** @type {HTMLElement} */ (button).dataset.doubt = String(this.panes[i].keys.includes(key));
    });
    this.showJob(job);
    if (anyway || state.revision !== before.revision || job.status !== old.status || job.number !== old.number
      || state.results.join() !== before.results.join()) this.rebuild();
    if (job.status === "done" && (old.status !== "done" || job.number !== old.number)) this.panes[this.step]?.done?.();
    // What a pane draws is ahead of the file until the last of its edits is there.
    if (!this.waiting) this.panes[this.step]?.changed?.();
    // That a job goes on changes nothing of what is drawn.
    if (anyway || state.revision !== before.revision || job.status !== old.status || job.number !== old.number) this.drawn();
  }

  /** @param {any} job */
  showJob(job) {
    const words = { none: "", waiting: "waiting", paused: "paused", running: (job.step || "starting") + this.timeLeft(job), stopping: "stopping …", done: "", stopped: "stopped",
      failed: "" }[/** @type {string} */ (job.status)] ?? job.status;
    const going = this.going, names = { check: "check", merge: "merge", look: "quick look", insert: "render" };
    const name = names[/** @type {"check"} */ (job.kind)] ?? "";
    element("job-words").textContent = job.status === "done" ? `${name} done, ${job.seconds} s` : going || words ? `${name}: ${words}` : "";
    element("job-share").hidden = !going;
    element("job-share").value = job.share ?? 0;
    element("job-stop").hidden = !going || job.status === "stopping";
    element("job-pause").hidden = !["running", "paused"].includes(job.status);
    element("job-pause").textContent = job.status === "paused" ? "Go on" : "Pause";
    if (job.status === "failed" && this.failedNumber !== job.number) {
      this.failedNumber = job.number;
      this.say(`${name}: ${job.error}`);
    }
  }
  failedNumber = -1;

  /** In words, how long the step of a job will take yet, by how long its share so far took; nothing where it is short. @param {any} job */
  timeLeft(job) {
    const key = `${job.number} ${job.step}`;
    if (this.stepBegun.key !== key) this.stepBegun = { key, seconds: job.seconds ?? 0, share: job.share };
    const { seconds, share } = this.stepBegun, left = ((job.seconds - seconds) * (1 - job.share)) / (job.share - share);
    if (!(job.share > share && left > 5)) return "";
    return left < 90 ? `, ${Math.ceil(left / 5) * 5} s left` : `, ${Math.round(left / 60)} min left`;
  }
  stepBegun = { key: "", seconds: 0, share: 0 };

  /** Build the pane anew, with the focus where it was; not while something of it is pressed. @param {boolean} [another] whether it is another one than before */
  rebuild(another = false) {
    this.press.wait(() => this.replace(another));
  }

  /** @param {boolean} another */
  replace(another) {
    const pane = this.panes[this.step];
    if (!pane) return;
    const root = element("pane"), focused = /** @type {HTMLElement | null} */ (document.activeElement), top = root.scrollTop;
    const inside = !another && root.contains(focused) ? [...root.querySelectorAll("button, input, select, summary")].indexOf(/** @type {Element} */ (focused)) : -1;
    const open = another ? [] : [...root.querySelectorAll("details")].map((/** @type {any} */ each) => each.open);
    root.replaceChildren(...pane.build());
    // What is doubtful of this step's own part of the shot stands above what one would type.
    const doubts = (this.measured?.doubts ?? []).filter((/** @type {string} */ line) => pane.keys.includes(line.split(/[.:\s]/)[0]));
    root.querySelector("details:last-child")?.before(...doubts.map((/** @type {string} */ line) => make("p", { className: "doubt" }, line)));
    root.querySelectorAll("details").forEach((/** @type {any} */ each, /** @type {number} */ i) => (each.open = open[i] ?? false));
    root.scrollTop = top;
    if (inside >= 0) /** @type {HTMLElement | undefined} */ (root.querySelectorAll("button, input, select, summary")[inside])?.focus();
    const place = (this.state.fault ?? "").split(":")[0];
    for (const input of root.querySelectorAll("[data-place]")) {
      input.setAttribute("aria-invalid", String(place !== "" && (/** @type {HTMLElement} */ (input).dataset.place ?? "").startsWith(place)));
    }
  }

  /** @param {number} step */
  go(step) {
    if (step === this.step || !this.panes[step]) return;
    this.panes[this.step]?.hidden?.();
    if (this.canvas.isBeside) this.uncompare();
    this.step = step;
    document.querySelectorAll("#steps button").forEach((button, i) => {
      if (i === step) button.setAttribute("aria-current", "step");
      else button.removeAttribute("aria-current");
    });
    element("pane").scrollTop = 0;
    element("live").hidden = true;
    this.say("");
    location.hash = this.panes[step].name.toLowerCase();
    this.rebuild(true);
    this.panes[step].shown?.();
    this.drawn();
  }

  /** After every frame. */
  drawn() {
    const { view } = this.canvas;
    /** @type {HTMLInputElement} */ (element("exposure")).value = String(view.stops);
    element("exposure-shown").textContent = `${view.stops >= 0 ? "+" : "−"}${Math.abs(view.stops).toFixed(2)} stops`;
    const pane = this.panes[this.step];
    // What is drawn on the picture stays in its own half.
    element("overlay").style.clipPath = this.canvas.isBeside ? "inset(0 50% 0 0)" : "";
    if (!this.canvas.isBeside) element("twin").hidden = true;
    this.overlay.draw(pane?.drawing?.() ?? {});
    pane?.drawn?.();
    drawLegend(this.canvas, this.facts.get(this.number)?.unit ?? "");
    const printed = (/** @type {number} */ number) => ({ address: `/pictures/${number}/values?layer=0`, digest: this.facts.get(number)?.layers[0].digest ?? "" });
    drawNumbers(element("numbers"), this.canvas, printed(this.number), this.reference < 0 ? null : printed(this.reference), (error) => this.say(error));
  }

  /** Read the pixel under the pointer. @param {number} x @param {number} y */
  async read(x, y) {
    this.wanted = [Math.floor(x), Math.floor(y)];
    if (this.reading) return;
    this.reading = true;
    while (this.wanted) {
      const [i, j] = this.wanted, facts = this.facts.get(this.number);
      this.wanted = null;
      if (!facts || i < 0 || j < 0 || i >= facts.size[0] || j >= facts.size[1]) continue;
      try {
        const twin = this.canvas.isBeside ? twinPixel(this.canvas, i, j) : null;
        const [v, other] = await Promise.all([json(`/pictures/${this.number}/value?layer=0&x=${i}&y=${j}`),
          twin && json(`/pictures/${this.reference}/value?layer=0&x=${twin[0]}&y=${twin[1]}`)]);
        const sigma = v.sigma ? ` ± ${v.sigma.map(plain).join(" ")}` : "";
        element("value").textContent = `${i}, ${j}: ${v.rgb.map(plain).join("  ")}${sigma}${facts.unit === "cd/m²" ? " cd/m²" : ""}`
          + (v.codes ? `  (${v.codes.join(" ")})` : "") + (other ? `  |  ${other.rgb.map(plain).join("  ")}, ${stopsBetween(v, other, this.canvas.view.gain)}` : "");
      } catch { /* the picture went meanwhile */ }
    }
    this.reading = false;
  }
  /** @type {[number, number] | null} */ wanted = null;
  reading = false;
}

const studio = new Studio();
studio.panes = [photographsPane, radiancePane, lightPane, cameraPane, placePane, objectsPane, developPane, deliverPane].map((build) => build(studio));

// The pointer: a pane may take it, else it pans; the wheel enlarges where it is.

/** @param {MouseEvent} event */
function screenPoint(event) {
  const box = picture.getBoundingClientRect(), density = studio.canvas.width / box.width;
  return /** @type {[number, number]} */ ([(event.clientX - box.left) * density, (event.clientY - box.top) * density]);
}
/** @type {{x: number, y: number, taken: boolean, from: [number, number]} | null} */ let drag = null;
picture.addEventListener("pointerdown", (event) => {
  if (event.button !== 0) return;
  picture.setPointerCapture(event.pointerId);
  const [x, y] = screenPoint(event);
  if (studio.canvas.view.mode === "wipe") {
    studio.canvas.set({ wipe: x / studio.canvas.width });
    drag = { x, y, taken: false, from: [NaN, NaN] };
    return;
  }
  // Side by side both move together: nothing is dragged on them.
  const taken = !studio.canvas.isBeside && (studio.panes[studio.step]?.drag?.(event, "begin") ?? false);
  drag = { x, y, taken, from: [x, y] };
});
picture.addEventListener("pointerleave", () => (studio.pointer = null));
picture.addEventListener("pointermove", (event) => {
  const [x, y] = screenPoint(event);
  studio.pointer = [x, y];
  if (drag && studio.canvas.view.mode === "wipe") studio.canvas.set({ wipe: Math.min(Math.max(x / studio.canvas.width, 0), 1) });
  else if (drag?.taken) studio.panes[studio.step].drag?.(event, "move");
  else if (drag) {
    studio.canvas.pan(x - drag.x, y - drag.y);
    Object.assign(drag, { x, y });
  } else studio.read(...studio.overlay.at(event));
  markTwin(studio.canvas, element("twin"), x, y);
});
picture.addEventListener("pointerup", (event) => {
  const [x, y] = screenPoint(event);
  if (drag?.taken) studio.panes[studio.step].drag?.(event, "end");
  else if (drag && Math.hypot(x - drag.from[0], y - drag.from[1]) < 4) studio.panes[studio.step]?.clicked?.(...studio.overlay.at(event));
  drag = null;
});
picture.addEventListener("wheel", (event) => {
  event.preventDefault();
  studio.canvas.enlarge(2 ** (-event.deltaY / (event.deltaMode ? 6 : 200)), ...screenPoint(event));
}, { passive: false });
element("exposure").addEventListener("input", (/** @type {Event} */ event) => studio.canvas.set({ stops: Number(/** @type {HTMLInputElement} */ (event.target).value) }));

// Files dropped anywhere go to the pane that takes them.

document.addEventListener("dragover", (event) => event.dataTransfer?.types.includes("Files") && event.preventDefault());
document.addEventListener("drop", (event) => {
  const files = [...(event.dataTransfer?.files ?? [])];
  if (!files.length) return;
  event.preventDefault();
  (studio.panes[studio.step].dropped ?? studio.panes[0].dropped)?.(files, event);
});

// Commands and keys.

const middle = () => /** @type {[number, number]} */ ([studio.canvas.width / 2, studio.canvas.height / 2]);
const hdr = hdrSwitch(studio.canvas, (error) => studio.say(error));
/** @type {import("../commands.js").Command[]} */
const commands = [
  ...studio.panes.map((pane, i) => ({ name: `Step: ${pane.name}`, keys: [`Alt+${i + 1}`], act: () => studio.go(i) })),
  { name: "Undo", keys: ["Ctrl+Z"], act: () => studio.undo(1) },
  { name: "Redo", keys: ["Ctrl+Shift+Z", "Ctrl+Y"], act: () => studio.undo(-1) },
  { name: "A quick look at the composite", keys: ["L"], act: () => studio.start("look") },
  { name: "Check what the photographs show", keys: [], act: () => studio.start("check") },
  { name: "Render the composite", keys: ["Ctrl+Enter"], act: () => studio.start("insert") },
  { name: "Stop the job", keys: ["Escape"], act: () => studio.going && studio.stop() },
  { name: "Pause the job, and let it go on", keys: ["P"], act: () => ["running", "paused"].includes(studio.state.job.status) && studio.pause() },
  { name: "Half a stop brighter", keys: ["E"], act: () => studio.canvas.set({ stops: studio.canvas.view.stops + 0.5 }) },
  { name: "Half a stop darker", keys: ["Shift+E"], act: () => studio.canvas.set({ stops: studio.canvas.view.stops - 0.5 }) },
  { name: "Exposure to middle grey", keys: ["N"], act: () => studio.attempt(async () => {
    const stops = await studio.greyStops(studio.number);
    if (stops !== null) studio.canvas.set({ stops });
  }) },
  { name: "Exposure as it is in the file", keys: ["R"], act: () => studio.canvas.set({ stops: 0 }) },
  { name: "Fit the picture", keys: ["F"], act: () => studio.canvas.fit() },
  { name: "One pixel to one pixel", keys: ["1"], act: () => studio.canvas.enlarge(1 / studio.canvas.view.zoom, ...middle()) },
  { name: "Enlarge", keys: ["+", "="], act: () => studio.canvas.enlarge(2, ...middle()) },
  { name: "Reduce", keys: ["-"], act: () => studio.canvas.enlarge(0.5, ...middle()) },
  { name: "Wipe against the plate", keys: ["W"], act: () => studio.against("wipe") },
  { name: "Side by side with the plate", keys: ["B"], act: () => studio.against("beside") },
  { name: "Difference from the plate", keys: ["D"], act: () => studio.against("difference") },
  hdr.command,
  { name: "Wipe to the left", keys: ["ArrowLeft"], act: () => studio.canvas.set({ wipe: Math.max(studio.canvas.view.wipe - 0.02, 0) }) },
  { name: "Wipe to the right", keys: ["ArrowRight"], act: () => studio.canvas.set({ wipe: Math.min(studio.canvas.view.wipe + 0.02, 1) }) },
  { name: "Clipping: stripes above white and below black", keys: ["X"], act: () => studio.canvas.set({ clipping: !studio.canvas.view.clipping }) },
  { name: "False colour by the logarithm of luminance", keys: ["V"], act: () => studio.canvas.set({
    falseColour: !studio.canvas.view.falseColour, errors: false, ...falseColourEnds(studio.facts.get(studio.number)?.layers[0]),
  }) },
  { name: "Errors: how uncertain each pixel is", keys: ["U"], act: () => studio.showErrors() },
  { name: "Marks: what no photograph measured", keys: ["M"], act: () => studio.canvas.set({ marked: !studio.canvas.view.marked }) },
  ...["All channels", "Red", "Green", "Blue", "Luminance"].map((name, channel) => ({ name, keys: [["C"], ["Shift+R"], ["Shift+G"], ["Shift+B"], []][channel],
    act: () => studio.canvas.set({ channel }) })),
  ...studio.panes.flatMap((pane, i) => (pane.commands ?? []).map((each) => ({
    ...each, name: `${pane.name}: ${each.name}`, act: () => studio.step === i && each.act(),
  }))),
];
element("value").before(hdr.button);
begin(commands);
element("undo").addEventListener("click", () => studio.undo(1));
element("redo").addEventListener("click", () => studio.undo(-1));
element("job-stop").addEventListener("click", () => studio.stop());
element("job-pause").addEventListener("click", () => studio.pause());
element("steps").replaceChildren(...studio.panes.map((/** @type {Pane} */ pane, /** @type {number} */ i) => {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = pane.name;
  button.title = `Alt+${i + 1}`;
  button.addEventListener("click", () => studio.go(i));
  return button;
}));

/** For tests: the page's own state, and whether all that was asked for is shown. */
Object.assign(window, { relume: { canvas: studio.canvas, studio, settled: () => studio.canvas.settled && !busy && !studio.press.held && studio.state.revision >= 0 } });

studio.attempt(async () => {
  studio.take(await json("/shot"));
  studio.brackets = (await json("/brackets")).brackets;
  const named = studio.panes.findIndex((pane) => `#${pane.name.toLowerCase()}` === location.hash);
  studio.go(Math.max(named, 0));
  listenTo(({ state, changed }) => {
    if (state) studio.take(state);
    if (changed !== undefined) studio.changed(changed);
  }, (line) => studio.say(line), (line) => studio.lookAgain(line));
}).catch((error) => error instanceof Refused && studio.say(error));
