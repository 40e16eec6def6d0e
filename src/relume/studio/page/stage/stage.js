// The page of a light stage: lamps are dragged, a map is turned, and the subject follows; at rest it is `relume`'s own.

import { HdrCanvas } from "../canvas.js";
import { begin } from "../commands.js";
import { linesOfValue, plain, print } from "../measured.js";
import { answer, json, Refused } from "../requests.js";
import { commandOf, rgbOf } from "./command.js";
import { LivePicture } from "./live.js";
import { Sphere } from "./sphere.js";

/** @typedef {import("./sphere.js").Lamp} Lamp */
/** @typedef {import("./sphere.js").Three} Three */
/** @typedef {{name: string, path: string, step: string, share: number, failed: string, notes: string[], maps: {name: string}[],
 *   size: [number, number], reduced: number, lights: Three[], axes: Three[], error: {random: number, single: number} | null,
 *   surface: string[]}} Facts */

const AT_ONCE = 2; // pictures on their way: one is summed while the other is shown
const SLOW = 33; // milliseconds that a picture may last from wish to screen; machines that need longer get smaller ones
const REST = 250; // milliseconds without a change after which the exact picture is asked for
const LAYERS = [["", "relit"], ["normal", "normals"], ["albedo", "albedo"], ["specular_energy", "specular energy"],
  ["specular_reflectance", "specular reflectance"], ["roughness", "roughness"]];

/** @template {Element} T @param {string} id @returns {T} */
const element = (id) => /** @type {T} */ (/** @type {unknown} */ (document.getElementById(id)));
const input = (/** @type {string} */ id) => /** @type {HTMLInputElement} */ (element(id));
const picture = /** @type {HTMLCanvasElement} */ (element("picture"));
const map = /** @type {HTMLSelectElement} */ (element("map"));

const state = {
  /** @type {Facts | null} */ facts: null,
  /** @type {Lamp[]} */ lamps: [],
  chosen: 0, map: /** @type {number | null} */ (null), turn: 0, stops: 0,
  layer: "", exact: false, shown: "", pictures: 0, exposed: false,
};

/** @param {unknown} error */
function failed(error) {
  element("message").textContent = error instanceof Error ? error.message : String(error);
}

/** @param {Response} got @returns {Promise<import("./live.js").Picture>} */
async function pixels(got) {
  const [width, height] = (got.headers.get("x-size") ?? "").split(",").map(Number);
  return {
    name: got.headers.get("x-picture") ?? "", half: got.headers.get("x-half") === "1", width, height, bytes: await got.arrayBuffer(),
  };
}

const canvas = new HdrCanvas(picture, drawn, failed);
const live = new LivePicture(canvas.gl);

// The picture: of many wishes the latest alone is asked for; the exact one when nothing moves.

let loading = 0, asking = 0, wanted = false, resting = 0, /** @type {AbortController | null} */ stop = null;
let asked = 0, latest = 0; // pictures asked for, and the number of the one that is shown: an older one comes too late
let slow = false; // until nothing moves
let took = 0; // milliseconds of the last picture

function light() {
  return {
    lamps: state.lamps.map((lamp) => ({
      direction: lamp.direction, irradiance: rgbOf(lamp), diameter: lamp.size,
    })),
    map: state.map, turn: state.turn, stops: state.stops,
  };
}

async function relight() {
  wanted = true;
  state.exact = false;
  clearTimeout(resting);
  stop?.abort();
  if (asking >= AT_ONCE || !state.facts?.size) return;
  asking++;
  try {
    while (wanted) {
      wanted = false;
      const turn = ++asked, begun = performance.now(), body = JSON.stringify({ ...light(), small: slow });
      const got = await pixels(await answer("/stage/picture", { method: "POST", body }));
      if (state.layer) break;
      took = performance.now() - begun;
      slow ||= took > SLOW;
      if (turn < latest) continue;
      latest = turn;
      show(got);
      state.pictures++;
    }
  } catch (error) {
    failed(error);
  }
  asking--;
  if (asking) return;
  about();
  resting = window.setTimeout(finish, Math.max(REST, 2 * took)); // a busy machine pauses without being at rest
}

/** `relume`'s own picture of the same light, which takes longer. */
async function finish() {
  resting = 0;
  slow = false;
  if (state.layer || state.exact) return;
  const own = (stop = new AbortController());
  try {
    const body = JSON.stringify({ ...light(), exact: true });
    const got = await pixels(await answer("/stage/picture", { method: "POST", body, signal: own.signal }));
    if (own.signal.aborted || state.layer) return;
    show(got);
    state.exact = true;
    about();
  } catch (error) {
    if (!own.signal.aborted && !(error instanceof Refused && error.status === 409)) failed(error);
  }
}

/** @param {import("./live.js").Picture} got */
function show(got) {
  const first = !state.shown, small = !first && !state.layer && got.width !== state.facts?.size[0];
  live.fill(got, small);
  if (!small) state.shown = got.name; // pixels are read of whole pictures
  canvas.one = /** @type {any} */ (live);
  if (first) canvas.fit();
  if (!state.exposed) expose();
  canvas.draw(small);
  if (last && !small) read(...last);
}

/** The exposure at which the brightest hundredth of what is lit is white. */
async function expose() {
  if (state.layer) return canvas.set({ stops: 0 });
  const got = await pixels(await answer("/stage/picture", { method: "POST", body: JSON.stringify(light()) }));
  const values = got.half ? Float32Array.from(new Uint16Array(got.bytes), half) : new Float32Array(got.bytes);
  const lit = Array.from(values.filter((_, i) => i % 7 === 0)).sort((a, b) => a - b);
  const bright = lit[Math.floor(0.99 * lit.length)];
  if (bright > 0) {
    state.exposed = true;
    canvas.set({ stops: -Math.log2(bright) });
  }
}

/** The number that a half float's sixteen bits are, above 0. @param {number} bits */
const half = (bits) => (bits & 0x8000 ? 0 : bits >> 10 ? (1 + (bits & 1023) / 1024) * 2 ** ((bits >> 10) - 15) : (bits & 1023) * 2 ** -24);

/** A layer of the surface, or "" for the relit subject. @param {string} name */
async function layer(name) {
  state.layer = name;
  layers();
  if (!name) {
    state.exposed = false;
    return relight();
  }
  stop?.abort();
  element("message").textContent = "measuring the surface …";
  loading++;
  try {
    const got = await pixels(await answer(`/stage/surface/${name}`));
    element("message").textContent = "";
    if (state.layer !== name) return;
    show(got);
    canvas.set({ stops: 0 });
  } catch (error) {
    failed(error);
  }
  loading--;
  about();
}

// The lamps.

const sphere = new Sphere(element("sphere"), (number, direction) => {
  state.lamps[number].direction = direction;
  changed();
}, choose);

/** @param {number} number */
function choose(number) {
  state.chosen = number;
  controls();
}

function changed() {
  controls();
  if (!state.layer) relight();
}

function controls() {
  sphere.draw(state.lamps, state.chosen);
  const lamp = state.lamps[state.chosen];
  for (const id of ["colour", "strength", "size"]) input(id).disabled = !lamp;
  /** @type {HTMLButtonElement} */ (element("remove")).disabled = !lamp;
  if (lamp) {
    input("colour").value = lamp.colour;
    input("strength").value = String(lamp.stops);
    input("size").value = String(lamp.size);
  }
  for (const id of ["turn", "dim"]) input(id).disabled = state.map === null;
  input("turn").value = String(state.turn);
  input("dim").value = String(state.stops);
  element("command").textContent = commandOf(state);
  drawMap();
}

function add() {
  const place = (state.lamps.length * 2.4) % (2 * Math.PI);
  const direction = sphere.toWorld([Math.sin(place) * 0.6, 0.5, Math.cos(place) * 0.62]);
  const length = Math.hypot(...direction);
  state.lamps.push({ direction: /** @type {Three} */ (direction.map((each) => each / length)), colour: "#ffffff", stops: 0, size: 0 });
  state.chosen = state.lamps.length - 1;
  changed();
}

function remove() {
  if (!state.lamps.length) return;
  state.lamps.splice(state.chosen, 1);
  state.chosen = Math.max(0, Math.min(state.chosen, state.lamps.length - 1));
  changed();
}

for (const [id, change] of /** @type {[string, (lamp: Lamp, value: string) => void][]} */ ([
  ["colour", (lamp, value) => (lamp.colour = value)],
  ["strength", (lamp, value) => (lamp.stops = Number(value))],
  ["size", (lamp, value) => (lamp.size = Number(value))],
])) {
  input(id).addEventListener("input", () => {
    change(state.lamps[state.chosen], input(id).value);
    changed();
  });
}
element("add").addEventListener("click", add);
element("remove").addEventListener("click", remove);

// The map.

/** @type {ImageData | null} */ let seen = null;

/** @param {number | null} number */
async function chooseMap(number) {
  state.map = number;
  map.value = String(number ?? "");
  seen = null;
  element("map-picture").toggleAttribute("hidden", number === null);
  changed();
  if (number === null) return;
  try {
    const got = await pixels(await answer(`/stage/maps/${number}`));
    if (state.map !== number) return;
    const values = got.half ? Float32Array.from(new Uint16Array(got.bytes), half) : new Float32Array(got.bytes);
    const lit = Array.from(values).sort((a, b) => a - b), grey = lit[lit.length >> 1] || 1;
    seen = new ImageData(got.width, got.height);
    for (let i = 0; i < values.length / 3; i++) {
      for (let c = 0; c < 3; c++) seen.data[4 * i + c] = 255 * Math.min((0.18 * values[3 * i + c]) / grey, 1) ** (1 / 2.2);
      seen.data[4 * i + 3] = 255;
    }
    drawMap();
  } catch (error) {
    failed(error);
  }
}

/** The map as it stands, turned: to the right is where −Z turns to. */
function drawMap() {
  const shown = /** @type {HTMLCanvasElement} */ (element("map-picture")), context = shown.getContext("2d");
  if (!seen || !context) return;
  const width = shown.width, at = ((Math.round((-state.turn / 360) * width) % width) + width) % width;
  context.putImageData(seen, at, 0);
  context.putImageData(seen, at - width, 0);
}

/** @param {number} degrees */
function turn(degrees) {
  if (state.map === null) return;
  state.turn = ((((degrees + 180) % 360) + 360) % 360) - 180;
  changed();
}

map.addEventListener("change", () => chooseMap(map.value === "" ? null : Number(map.value)));
input("turn").addEventListener("input", () => turn(Number(input("turn").value)));
input("dim").addEventListener("input", () => {
  state.stops = Number(input("dim").value);
  changed();
});
const mapPicture = /** @type {HTMLCanvasElement} */ (element("map-picture"));
mapPicture.addEventListener("pointerdown", (event) => mapPicture.setPointerCapture(event.pointerId));
mapPicture.addEventListener("pointermove", (event) => {
  if (event.buttons) turn(state.turn - (360 * event.movementX) / mapPicture.clientWidth);
});

// The pointer over the picture: it reads, pans, and turns the light with Shift.

/** @type {[number, number] | null} */ let last = null;
let reading = false, /** @type {[number, number] | null} */ next = null;
/** @param {number} x @param {number} y */
async function read(x, y) {
  next = [x, y];
  if (reading) return;
  reading = true;
  while (next) {
    const [i, j] = next, size = live.layer.sizes[0];
    next = null;
    if (i < 0 || j < 0 || i >= size[0] || j >= size[1]) continue;
    last = [i, j];
    try {
      const got = await json(`/stage/value?picture=${state.shown}&x=${i}&y=${j}`);
      print(element("value"), linesOfValue(got, "relative"));
    } catch (error) {
      if (!(error instanceof Refused && error.status === 404)) failed(error); // a picture that was followed by others
    }
  }
  reading = false;
}

/** @param {MouseEvent} event @returns {[number, number]} */
function point(event) {
  const box = picture.getBoundingClientRect(), density = canvas.width / box.width;
  return [(event.clientX - box.left) * density, (event.clientY - box.top) * density];
}

/** @type {[number, number] | null} */ let drag = null;
picture.addEventListener("pointerdown", (event) => {
  picture.setPointerCapture(event.pointerId);
  drag = point(event);
});
picture.addEventListener("pointerup", () => (drag = null));
picture.addEventListener("pointermove", (event) => {
  const [x, y] = point(event);
  if (drag && event.shiftKey) turn(state.turn + ((x - drag[0]) / canvas.width) * 180);
  else if (drag) canvas.pan(x - drag[0], y - drag[1]);
  if (drag) drag = [x, y];
  else read(.../** @type {[number, number]} */ (canvas.toPicture(x, y).map(Math.floor)));
});
picture.addEventListener("wheel", (event) => {
  event.preventDefault();
  canvas.enlarge(2 ** (-event.deltaY / (event.deltaMode ? 6 : 200)), ...point(event));
}, { passive: false });
input("exposure").addEventListener("input", () => canvas.set({ stops: Number(input("exposure").value) }));

// What is said.

function drawn() {
  const { view } = canvas;
  input("exposure").value = String(view.stops);
  element("exposure-shown").textContent = `${view.stops >= 0 ? "+" : "−"}${Math.abs(view.stops).toFixed(2)} stops`;
  element("zoom-shown").textContent = `${plain(100 * view.zoom)} %`;
}

function about() {
  const facts = state.facts;
  if (!facts?.size) return;
  const share = (/** @type {number} */ each) => `${plain(Number((100 * each).toPrecision(2)))} %`;
  /** @type {[string, string][]} */
  const lines = [["lights", `${facts.lights.length} of the stage`]];
  if (facts.reduced > 1) lines.push(["pixels", `means of ${facts.reduced} × ${facts.reduced} of the stage's`]);
  if (!state.layer && state.exact) lines.push(["shown", "as relume stage relight --no-mesh makes it"]);
  else if (!state.layer && facts.error) {
    lines.push(["shown", `compressed: ${share(facts.error.random)} off under light from everywhere, ${share(facts.error.single)} under one`]);
  } else if (!state.layer) lines.push(["shown", "the sum of the stage's pictures"]);
  if (facts.step !== "ready") lines.push(["now", `${facts.step}, ${Math.round(100 * facts.share)} %`]);
  print(element("about"), lines);
}

function layers() {
  element("layers").replaceChildren(...LAYERS.map(([name, text]) => {
    const item = document.createElement("li"), button = document.createElement("button"), label = document.createElement("span");
    label.textContent = text;
    button.type = "button";
    button.append(label);
    button.setAttribute("aria-current", String(name === state.layer));
    button.addEventListener("click", () => layer(name));
    item.append(button);
    return item;
  }));
}

/** @param {number} by */
const stepLayer = (by) => layer(LAYERS[(LAYERS.findIndex(([name]) => name === state.layer) + by + LAYERS.length) % LAYERS.length][0]);
/** @param {number} by */
const stops = (by) => canvas.set({ stops: canvas.view.stops + by });
const middle = () => /** @type {[number, number]} */ ([canvas.width / 2, canvas.height / 2]);
/** @type {import("../commands.js").Command[]} */
const commands = [
  { name: "Add a lamp", keys: ["A"], act: add },
  { name: "Remove the chosen lamp", keys: ["Delete", "Backspace"], act: remove },
  { name: "Next lamp", keys: ["N"], act: () => state.lamps.length && choose((state.chosen + 1) % state.lamps.length) },
  { name: "Turn the map by 5° to the left", keys: ["["], act: () => turn(state.turn + 5) },
  { name: "Turn the map by 5° to the right", keys: ["]"], act: () => turn(state.turn - 5) },
  { name: "Next layer", keys: ["ArrowRight"], act: () => stepLayer(1) },
  { name: "Layer before", keys: ["ArrowLeft"], act: () => stepLayer(-1) },
  { name: "Half a stop brighter", keys: ["E"], act: () => stops(0.5) },
  { name: "Half a stop darker", keys: ["Shift+E"], act: () => stops(-0.5) },
  { name: "Exposure by what is lit", keys: ["X"], act: () => ((state.exposed = false), expose()) },
  { name: "Exposure as it is", keys: ["R"], act: () => canvas.set({ stops: 0 }) },
  { name: "Fit the picture", keys: ["F"], act: () => canvas.fit() },
  { name: "One pixel to one pixel", keys: ["1"], act: () => canvas.enlarge(1 / canvas.view.zoom, ...middle()) },
  { name: "Enlarge", keys: ["+", "="], act: () => canvas.enlarge(2, ...middle()) },
  { name: "Reduce", keys: ["-"], act: () => canvas.enlarge(0.5, ...middle()) },
  { name: "Copy the command", keys: [], act: copy },
];
begin(commands);
element("copy").addEventListener("click", copy);

function copy() {
  navigator.clipboard.writeText(element("command").textContent ?? "").catch(failed);
}

// Opening: the stage is read behind the page, which asks how far it is.

async function follow() {
  try {
    const before = state.facts;
    const facts = (state.facts = /** @type {Facts} */ (await json("/stage")));
    if (facts.failed) return failed(facts.failed);
    element("title").textContent = facts.size ? `${facts.name}: ${facts.lights.length} lights, ${facts.size.join(" × ")}` : facts.name;
    document.title = `${facts.name} – relume`;
    if (!before) {
      map.replaceChildren(...[["", "no map"], ...facts.maps.map((each, i) => [String(i), each.name])].map(([value, text]) => {
        const option = document.createElement("option");
        option.value = value;
        option.textContent = text;
        return option;
      }));
      layers();
      controls();
    }
    if (facts.size && !before?.size) {
      element("message").textContent = "";
      sphere.begin(facts.axes, facts.lights);
      add();
    } else if (!facts.size) element("message").textContent = `${facts.step} … ${Math.round(100 * facts.share)} %`;
    if (facts.step === "ready") element("message").textContent ||= facts.notes.join(" · ");
    about();
    if (facts.step !== "ready") window.setTimeout(follow, 300);
  } catch (error) {
    failed(error);
  }
}
follow();

/** For tests: the page's own state, and whether all that was asked for is shown. */
Object.assign(window, { relume: {
  canvas, state, live, light,
  settled: () => state.facts?.step === "ready" && !asking && !loading && !resting && (state.exact || !!state.layer) && !reading && canvas.settled,
} });
