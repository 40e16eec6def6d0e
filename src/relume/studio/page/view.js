// The page of `relume view`: pictures side by side in time, exposure, wipes, values with their errors, maps from inside.

import { markTwin, stopsBetween, twinPixel } from "./overlays/beside.js";
import { HdrCanvas } from "./canvas.js";
import { begin } from "./commands.js";
import { hdrSwitch } from "./extended.js";
import { linesOfDifference, linesOfStatistics, linesOfValue, plain, print } from "./measured.js";
import { drawNumbers } from "./overlays/numbers.js";
import { drawLegend, errorLayer, falseColourEnds } from "./overlays/legend.js";
import { bytes, json, listenTo } from "./requests.js";
import { drawTree } from "./tree.js";

/** @typedef {import("./source.js").PictureFacts} PictureFacts */

/** @template {HTMLElement} T @param {string} id @returns {T} */
const element = (id) => /** @type {T} */ (document.getElementById(id));
const picture = /** @type {HTMLCanvasElement} */ (element("picture"));
const exposure = /** @type {HTMLInputElement} */ (element("exposure"));

const state = {
  /** @type {{name: string, path: string}[]} */ files: [],
  /** @type {Map<number, PictureFacts>} */ facts: new Map(),
  /** @type {Map<number, Promise<PictureFacts>>} */ coming: new Map(),
  number: -1, layer: 0, reference: -1, referenceLayer: 0,
  /** @type {[number, number, number, number] | null} */ region: null,
  /** @type {any} */ held: null,
  fitted: false, exposed: false, scene: "",
};

/** @param {unknown} error */
function failed(error) {
  element("message").textContent = error instanceof Error ? error.message : String(error);
}

let canvas = /** @type {HdrCanvas} */ (/** @type {unknown} */ (null));
try {
  canvas = new HdrCanvas(picture, drawn, failed);
} catch (error) {
  failed(error);
  throw error;
}

// Opening.

/** @param {number} number @returns {Promise<PictureFacts>} */
async function factsOf(number) {
  const kept = state.facts.get(number);
  if (kept) return kept;
  const coming = state.coming.get(number) ?? json(`/pictures/${number}`);
  state.coming.set(number, coming);
  try {
    const found = await coming;
    if (state.coming.get(number) === coming) state.facts.set(number, found);
    return found;
  } finally {
    if (state.coming.get(number) === coming) state.coming.delete(number);
  }
}

/** @param {number} number @param {number} layer @returns {import("./source.js").Fetched} */
function tilesOf(number, layer) {
  const digest = /** @type {PictureFacts} */ (state.facts.get(number)).layers[layer].digest;
  return (level, column, row, signal) => bytes(`/tiles/${number}/${layer}/${digest}/${level}/${column}/${row}`, signal);
}

let opening = 0, busy = 0;
/** @param {number} number @param {number} [layer] */
async function open(number, layer = 0) {
  const turn = ++opening;
  busy++;
  element("message").textContent = state.facts.has(number) ? "" : `opening ${state.files[number].name} …`;
  try {
    const facts = await factsOf(number);
    if (turn !== opening) return; // another was asked for meanwhile: the latest wins
    const before = state.facts.get(state.number);
    state.number = number;
    state.layer = Math.min(layer, facts.layers.length - 1);
    const errors = canvas.view.errors, ofErrors = errorLayer(facts);
    canvas.open(facts.layers[state.layer], tilesOf(number, state.layer));
    if (errors && state.layer === 0 && ofErrors >= 0) canvas.openErrors(facts.layers[ofErrors], tilesOf(number, ofErrors));
    if (!state.fitted || !before || before.size.join() !== facts.size.join()) fit();
    if (!state.exposed && facts.kind === "radiance map") await normalise();
    state.exposed = true;
    if (canvas.view.mode === "inside" && facts.mapping !== "latlong") canvas.set({ mode: "picture" });
    element("message").textContent = facts.notes.join(" · ");
    if (lastValue) read(lastValue.x, lastValue.y);
    await remeasure();
  } catch (error) {
    if (turn === opening) failed(error);
  } finally {
    busy--;
  }
  list();
}

/** @param {number} number @param {number} [layer] */
async function refer(number, layer = 0) {
  busy++;
  if (number === state.reference && layer === state.referenceLayer) {
    state.reference = -1;
    canvas.closeReference();
  } else {
    try {
      const facts = await factsOf(number);
      state.reference = number;
      state.referenceLayer = Math.min(layer, facts.layers.length - 1);
      canvas.open(facts.layers[state.referenceLayer], tilesOf(number, state.referenceLayer), true);
      if (canvas.view.mode === "picture") canvas.set({ mode: "wipe" });
    } catch (error) {
      failed(error);
    }
  }
  list();
  await remeasure();
  busy--;
}

function fit() {
  state.fitted = true;
  canvas.fit();
}

/** The exposure at which the median of the region, or of the picture, is middle grey, 18 % of white. */
async function normalise() {
  const layer = state.facts.get(state.number)?.layers[state.layer];
  if (!layer) return;
  if (!state.region && layer.median > 0) return setStops(Math.log2(0.18 / layer.median));
  const s = await json(`/pictures/${state.number}/statistics?layer=${state.layer}${boxed()}`);
  const median = s.median?.[3], mean = s.mean?.[3];
  const grey = median > 0 ? median : mean;
  if (typeof grey === "number" && grey > 0) setStops(Math.log2(0.18 / grey));
}

/** @param {number} stops */
function setStops(stops) {
  canvas.set({ stops: Math.min(Math.max(stops, -32), 32) });
}

/** @param {Partial<HdrCanvas["view"]>} change */
const change = (change) => canvas.set(change);

/** @param {import("./canvas.js").Mode} mode */
function show(mode) {
  const facts = state.facts.get(state.number);
  if (mode === "inside" && facts?.mapping !== "latlong") {
    failed(new Error("only an equirectangular (lat-long) map is seen from inside; `relume convert --to latlong` makes one"));
    return;
  }
  if (["wipe", "beside", "difference"].includes(mode) && state.reference < 0) {
    failed(new Error("choose a reference first: right-click a picture in the list, or Shift+Enter"));
    return;
  }
  element("message").textContent = "";
  change({ mode: canvas.view.mode === mode ? "picture" : mode });
}

/** Multiply the reference so that its median, in the region or everywhere, is the picture's; the panel says by what. */
async function equalise() {
  if (state.reference < 0) return;
  busy++;
  if (canvas.view.gain !== 1) change({ gain: 1 });
  else {
    const [own, other] = await Promise.all([[state.number, state.layer], [state.reference, state.referenceLayer]].map(
      ([number, layer]) => json(`/pictures/${number}/statistics?layer=${layer}${boxed()}`),
    ));
    if (own.median?.[3] > 0 && other.median?.[3] > 0) change({ gain: own.median[3] / other.median[3] });
  }
  await remeasure();
  busy--;
}

/** Exchange picture and reference. */
async function flip() {
  if (state.reference < 0) return;
  const [number, layer] = [state.number, state.layer];
  const mode = canvas.view.mode;
  const [other, otherLayer] = [state.reference, state.referenceLayer];
  state.reference = number;
  state.referenceLayer = layer;
  canvas.open((await factsOf(number)).layers[layer], tilesOf(number, layer), true);
  await open(other, otherLayer);
  change({ mode });
}

/** @param {number} by */
const step = (by) => state.files.length && open((state.number + by + state.files.length) % state.files.length, state.layer);

/** @param {number} by */
function stepLayer(by) {
  const count = state.facts.get(state.number)?.layers.length ?? 1;
  open(state.number, (state.layer + by + count) % count);
}

// Measuring.

const boxed = () => (state.region ? `&box=${state.region.join(",")}` : "");

async function remeasure() {
  const { number, layer, reference, referenceLayer } = state;
  const facts = state.facts.get(number);
  if (!facts) return;
  const jobs = [];
  if (state.region) {
    jobs.push(json(`/pictures/${number}/statistics?layer=${layer}${boxed()}`)
      .then((s) => print(element("statistics"), linesOfStatistics(s, facts.unit))));
  } else print(element("statistics"), [["None", "Draw one with Shift and the pointer, or A for all."]]);
  if (reference >= 0 && reference + referenceLayer / 1000 !== number + layer / 1000) {
    jobs.push(json(`/pictures/${number}/difference?layer=${layer}&other=${reference}&other_layer=${referenceLayer}`
      + `&gain=${canvas.view.gain}${boxed()}`)
      .then((d) => print(element("difference"), linesOfDifference(d)))
      .catch((error) => print(element("difference"), [["None", error.message]])));
  } else print(element("difference"), [["None", "Choose a reference: right-click a picture, or Shift+Enter."]]);
  await Promise.all(jobs).catch(failed);
}

/** @type {[number, number] | null} */ let wanted = null;
let asking = false;
/** Read the pixel under the pointer; of many wishes the latest alone is asked. @param {number} x @param {number} y */
async function read(x, y) {
  wanted = [x, y];
  if (asking) return;
  asking = true;
  while (wanted) {
    const [i, j] = wanted;
    wanted = null;
    const facts = state.facts.get(state.number);
    if (!facts || i < 0 || j < 0 || i >= facts.size[0] || j >= facts.size[1]) continue;
    try {
      const twin = canvas.isBeside ? twinPixel(canvas, i, j) : null;
      const [v, other] = await Promise.all([
        json(`/pictures/${state.number}/value?layer=${state.layer}&x=${i}&y=${j}`),
        twin && json(`/pictures/${state.reference}/value?layer=${state.referenceLayer}&x=${twin[0]}&y=${twin[1]}`),
      ]);
      lastValue = v;
      const beside = other ? [["beside", other.rgb.map(plain).join("  ")], ["", stopsBetween(v, other, canvas.view.gain)]] : [];
      print(element("value"), [...linesOfValue(v, facts.unit, state.held), .../** @type {[string, string][]} */ (beside)]);
    } catch (error) {
      failed(error);
    }
  }
  asking = false;
}
/** @type {any} */ let lastValue = null;

/** The tree of rays behind a pixel, where the scene file of the picture is known. @param {number} x @param {number} y */
async function drawRays(x, y) {
  if (!state.scene || state.number < 0) return;
  busy++;
  try {
    const [tree, own] = await Promise.all([json(`/tree?x=${x}&y=${y}`), json(`/pictures/${state.number}/value?layer=0&x=${x}&y=${y}`)]);
    drawTree(element("tree"), tree, own.rgb);
  } catch (error) {
    failed(error);
  }
  busy--;
}

/** The picture's pixel at a pointer event. @param {PointerEvent | MouseEvent | WheelEvent} event @returns {[number, number]} */
function screenPoint(event) {
  const box = picture.getBoundingClientRect(), density = canvas.width / box.width;
  return [(event.clientX - box.left) * density, (event.clientY - box.top) * density];
}

/** @param {number} x @param {number} y @returns {[number, number]} */
function pixelAt(x, y) {
  if (canvas.view.mode === "inside") {
    const [dx, dy, dz] = canvas.directionAt(x, y);
    const size = state.facts.get(state.number)?.size ?? [1, 1];
    const u = 0.5 + Math.atan2(dx, -dz) / (2 * Math.PI), v = Math.acos(Math.min(Math.max(dy, -1), 1)) / Math.PI;
    return [Math.min(Math.floor(u * size[0]), size[0] - 1), Math.min(Math.floor(v * size[1]), size[1] - 1)];
  }
  const [a, b] = canvas.toPicture(x, y);
  return [Math.floor(a), Math.floor(b)];
}

// The pointer: it pans, draws a region with Shift, holds a pixel by a click, and the wheel enlarges where it is.

/** @type {{x: number, y: number, moved: boolean, from: [number, number] | null} | null} */ let drag = null;
picture.addEventListener("pointerdown", (event) => {
  if (event.button !== 0) return;
  picture.setPointerCapture(event.pointerId);
  const [x, y] = screenPoint(event);
  drag = { x, y, moved: false, from: event.shiftKey && canvas.view.mode !== "inside" ? pixelAt(x, y) : null };
});
picture.addEventListener("pointermove", (event) => {
  const [x, y] = screenPoint(event);
  if (drag) {
    if (Math.hypot(x - drag.x, y - drag.y) > 3) drag.moved = true;
    if (drag.from) drawRegion(drag.from, pixelAt(x, y));
    else if (drag.moved) {
      canvas.pan(x - drag.x, y - drag.y);
      drag.x = x;
      drag.y = y;
    }
  }
  markTwin(canvas, element("twin"), x, y);
  if (!drag?.moved) read(...pixelAt(x, y));
});
picture.addEventListener("pointerup", (event) => {
  const [x, y] = screenPoint(event);
  if (drag?.from) remeasure();
  else if (drag && !drag.moved) {
    const [i, j] = pixelAt(x, y);
    state.held = state.held && state.held.x === i && state.held.y === j ? null : lastValue;
    read(i, j);
    drawRays(i, j);
  }
  drag = null;
});
picture.addEventListener("wheel", (event) => {
  event.preventDefault();
  canvas.enlarge(2 ** (-event.deltaY / (event.deltaMode ? 6 : 200)), ...screenPoint(event));
}, { passive: false });
picture.addEventListener("contextmenu", (event) => event.preventDefault());

/** @param {[number, number]} from @param {[number, number]} to */
function drawRegion(from, to) {
  const size = state.facts.get(state.number)?.size ?? [1, 1];
  const low = [0, 1].map((i) => Math.max(0, Math.min(from[i], to[i])));
  const high = [0, 1].map((i) => Math.min(size[i] - 1, Math.max(from[i], to[i])));
  if (high[0] < low[0] || high[1] < low[1]) return;
  state.region = [low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1];
  drawn();
}

const wipe = element("wipe");
wipe.addEventListener("pointerdown", (event) => wipe.setPointerCapture(event.pointerId));
wipe.addEventListener("pointermove", (event) => {
  if (!wipe.hasPointerCapture(event.pointerId)) return;
  const box = picture.getBoundingClientRect();
  change({ wipe: Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1) });
});
wipe.addEventListener("keydown", (event) => {
  const by = { ArrowLeft: -0.01, ArrowRight: 0.01 }[event.key];
  if (by) change({ wipe: Math.min(Math.max(canvas.view.wipe + by, 0), 1) });
});
exposure.addEventListener("input", () => setStops(Number(exposure.value)));

// What is shown beside the picture.

function list() {
  const file = (/** @type {{name: string, path: string}} */ each, /** @type {number} */ number) => {
    const button = document.createElement("button"), name = document.createElement("span"), as = document.createElement("span");
    name.textContent = each.name;
    as.className = "as";
    as.textContent = number === state.reference ? "reference" : "";
    button.type = "button";
    button.title = each.path;
    button.append(name, as);
    button.setAttribute("aria-current", String(number === state.number));
    button.dataset.reference = String(number === state.reference);
    button.addEventListener("click", (event) => (event.shiftKey ? refer(number) : open(number)));
    button.addEventListener("contextmenu", (event) => {
      event.preventDefault();
      refer(number);
    });
    button.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" || !event.shiftKey) return;
      event.preventDefault();
      refer(number);
    });
    const item = document.createElement("li");
    item.append(button);
    return item;
  };
  const focused = document.activeElement?.closest("#files, #layers")?.id;
  element("files").replaceChildren(...state.files.map(file));
  const facts = state.facts.get(state.number);
  element("layers").replaceChildren(...(facts?.layers ?? []).map((each, number) => {
    const item = document.createElement("li"), button = document.createElement("button"), name = document.createElement("span");
    name.textContent = each.name;
    button.type = "button";
    button.append(name);
    button.setAttribute("aria-current", String(number === state.layer));
    button.addEventListener("click", () => open(state.number, number));
    button.addEventListener("contextmenu", (event) => {
      event.preventDefault();
      refer(state.number, number);
    });
    item.append(button);
    return item;
  }));
  if (focused) /** @type {HTMLElement | null} */ (document.querySelector(`#${focused} [aria-current="true"]`))?.focus();
  if (facts) {
    const odd = facts.layers[state.layer].odd;
    element("title").textContent = `${facts.name}: ${facts.size.join(" × ")}, ${facts.kind}, ${facts.unit}`
      + (facts.mapping ? `, ${facts.mapping} map` : "") + (odd ? `, ${odd.toLocaleString("en")} values are not finite` : "");
    document.title = `${facts.name} – relume`;
  }
}

function drawn() {
  const { view } = canvas, facts = state.facts.get(state.number);
  const density = canvas.width / Math.max(picture.clientWidth, 1);
  exposure.value = String(view.stops);
  element("exposure-shown").textContent = `${view.stops >= 0 ? "+" : "−"}${Math.abs(view.stops).toFixed(2)} stops`;
  element("zoom-shown").textContent = view.mode === "inside" ? `${((view.field * 180) / Math.PI).toFixed(0)}° high`
    : `${plain(100 * view.zoom)} %`;
  for (const button of document.querySelectorAll("footer [data-channel]")) {
    button.setAttribute("aria-pressed", String(Number(/** @type {HTMLElement} */ (button).dataset.channel) === view.channel));
  }
  for (const button of document.querySelectorAll("footer [data-mode]")) {
    const name = /** @type {string} */ (/** @type {HTMLElement} */ (button).dataset.mode);
    const on = name === "false colour" ? view.falseColour : name === "errors" ? view.errors : name === "clipping" ? view.clipping : name === "marks" ? view.marked
      : view.mode === name;
    button.setAttribute("aria-pressed", String(on));
  }
  const region = element("region");
  region.hidden = !state.region || view.mode === "inside";
  if (state.region) {
    const [x, y] = canvas.toScreen(state.region[0], state.region[1]);
    const [a, b] = canvas.toScreen(state.region[0] + state.region[2], state.region[1] + state.region[3]);
    Object.assign(region.style, {
      left: `${x / density}px`, top: `${y / density}px`, width: `${(a - x) / density}px`, height: `${(b - y) / density}px`,
    });
  }
  wipe.hidden = view.mode !== "wipe";
  wipe.style.left = `${100 * view.wipe}%`;
  wipe.setAttribute("aria-valuenow", String(Math.round(100 * view.wipe)));
  if (!canvas.isBeside) element("twin").hidden = true;
  drawLegend(canvas, facts?.unit ?? "");
  const printed = (/** @type {number} */ number, /** @type {number} */ layer) =>
    ({ address: `/pictures/${number}/values?layer=${layer}`, digest: state.facts.get(number)?.layers[layer]?.digest ?? "" });
  drawNumbers(/** @type {HTMLCanvasElement} */ (element("numbers")), canvas, printed(state.number, state.layer),
    state.reference < 0 ? null : printed(state.reference, state.referenceLayer), failed);
}

function toggleFalseColour() {
  const layer = state.facts.get(state.number)?.layers[state.layer];
  change({ falseColour: !canvas.view.falseColour, errors: false, ...falseColourEnds(layer) });
}

function toggleErrors() {
  const { number } = state, layer = errorLayer(state.facts.get(number));
  if (canvas.view.errors) return canvas.closeErrors();
  if (layer < 0 || state.layer !== 0) {
    failed(new Error("the file does not say how uncertain these pixels are; merged radiance and renders do"));
    return;
  }
  element("message").textContent = "";
  change({ falseColour: false, mode: "picture" });
  canvas.openErrors(/** @type {PictureFacts} */ (state.facts.get(number)).layers[layer], tilesOf(number, layer));
}

// Commands, keys and buttons.

const hdr = hdrSwitch(canvas, failed);

const middle = () => /** @type {[number, number]} */ ([canvas.width / 2, canvas.height / 2]);
/** @type {import("./commands.js").Command[]} */
const commands = [
  { name: "Half a stop brighter", keys: ["E"], act: () => setStops(canvas.view.stops + 0.5) },
  { name: "Half a stop darker", keys: ["Shift+E"], act: () => setStops(canvas.view.stops - 0.5) },
  { name: "Exposure to middle grey, of the region or the picture", keys: ["N"], act: normalise },
  { name: "Exposure as it is in the file", keys: ["R"], act: () => setStops(0) },
  { name: "Fit the picture", keys: ["F"], act: fit },
  { name: "One pixel to one pixel", keys: ["1"], act: () => canvas.enlarge(1 / canvas.view.zoom, ...middle()) },
  { name: "Enlarge", keys: ["+", "="], act: () => canvas.enlarge(2, ...middle()) },
  { name: "Reduce", keys: ["-"], act: () => canvas.enlarge(0.5, ...middle()) },
  { name: "Move left", keys: ["Shift+ArrowLeft"], act: () => canvas.pan(80, 0) },
  { name: "Move right", keys: ["Shift+ArrowRight"], act: () => canvas.pan(-80, 0) },
  { name: "Move up", keys: ["Shift+ArrowUp"], act: () => canvas.pan(0, 80) },
  { name: "Move down", keys: ["Shift+ArrowDown"], act: () => canvas.pan(0, -80) },
  { name: "Next picture", keys: ["ArrowDown"], act: () => step(1) },
  { name: "Picture before", keys: ["ArrowUp"], act: () => step(-1) },
  { name: "Next layer", keys: ["ArrowRight"], act: () => stepLayer(1) },
  { name: "Layer before", keys: ["ArrowLeft"], act: () => stepLayer(-1) },
  { name: "Make this picture the reference", keys: ["Shift+Enter"], act: () => refer(state.number, state.layer) },
  { name: "Exchange picture and reference", keys: [" "], act: flip },
  { name: "Wipe against the reference", keys: ["W"], act: () => show("wipe") },
  { name: "Difference from the reference", keys: ["D"], act: () => show("difference") },
  { name: "The reference at the brightness of the picture, and as it is", keys: ["G"], act: equalise },
  { name: "Side by side with the reference", keys: ["B"], act: () => show("beside") },
  { name: "Turn the wipe", keys: ["Shift+W"], act: () => change({ wipeLies: !canvas.view.wipeLies }) },
  { name: "All channels", keys: ["C"], act: () => change({ channel: 0 }) },
  { name: "Red", keys: ["Shift+R"], act: () => change({ channel: 1 }) },
  { name: "Green", keys: ["Shift+G"], act: () => change({ channel: 2 }) },
  { name: "Blue", keys: ["Shift+B"], act: () => change({ channel: 3 }) },
  { name: "Luminance", keys: ["L"], act: () => change({ channel: 4 }) },
  { name: "False colour", keys: ["V"], act: toggleFalseColour },
  { name: "Clipping: stripes above white and below black", keys: ["X"], act: () => change({ clipping: !canvas.view.clipping }) },
  { name: "Marks: what no photograph measured", keys: ["M"], act: () => change({ marked: !canvas.view.marked }) },
  { name: "Errors: how uncertain each pixel is", keys: ["U"], act: toggleErrors },
  { name: "The map from inside", keys: ["I"], act: () => show("inside") },
  { name: "Tree of rays behind the pixel that was read last", keys: ["T"], act: () => lastValue && drawRays(lastValue.x, lastValue.y) },
  { name: "Measure the whole picture", keys: ["A"], act: () => {
    const size = state.facts.get(state.number)?.size;
    if (size) drawRegion([0, 0], [size[0] - 1, size[1] - 1]), remeasure();
  } },
  hdr.command,
  { name: "No region, nothing held", keys: ["Escape"], act: () => {
    state.region = state.held = null;
    drawn();
    remeasure();
  } },
];

/** @param {string} group @param {[string, Record<string, string>, () => void][]} wanted */
function buttons(group, wanted) {
  element(group).replaceChildren(...wanted.map(([text, data, act]) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    Object.assign(button.dataset, data);
    button.addEventListener("click", act);
    return button;
  }));
}

buttons("channels", ["RGB", "R", "G", "B", "Lum"].map((text, channel) => [text, { channel: String(channel) }, () => change({ channel })]));
buttons("modes", [
  ["Wipe", { mode: "wipe" }, () => show("wipe")],
  ["Side by side", { mode: "beside" }, () => show("beside")],
  ["Difference", { mode: "difference" }, () => show("difference")],
  ["False colour", { mode: "false colour" }, toggleFalseColour],
  ["Clipping", { mode: "clipping" }, () => change({ clipping: !canvas.view.clipping })],
  ["Marks", { mode: "marks" }, () => change({ marked: !canvas.view.marked })],
  ["Errors", { mode: "errors" }, toggleErrors],
  ["Inside", { mode: "inside" }, () => show("inside")],
]);
element("modes").append(hdr.button);
begin(commands);

// Files that change on disk are shown anew; a server that is gone is said.

/** @param {{changed: number}} said */
async function changed({ changed }) {
  state.facts.delete(changed);
  state.coming.delete(changed);
  if (changed === state.number) await open(changed, state.layer);
  if (changed === state.reference) {
    const layer = state.referenceLayer;
    canvas.open((await factsOf(changed)).layers[layer], tilesOf(changed, layer), true);
    await remeasure();
  }
}

/** For tests: the page's own state, and whether all that was asked for is shown. */
Object.assign(window, { relume: { canvas, state, settled: () => canvas.settled && !asking && !busy && state.number >= 0 } });

factsOf(0).catch(() => {}); // together with the list of files; what is wrong with it is said when it is opened
json("/pictures").then(async ({ files, scene }) => {
  state.files = files;
  state.scene = scene ?? "";
  element("tree-part").hidden = !scene;
  list();
  listenTo(changed, failed, async (line) => {
    if (element("message").textContent === line) element("message").textContent = "";
    state.coming.clear();
    for (const number of [...state.facts.keys()]) await changed({ changed: number });
  });
  await open(0);
}).catch(failed);
