// Light that changes with time: its maps one after another, the lights that stand for each, a matte ball lit by it.

import { make } from "./fields.js";
import { post } from "../requests.js";

const SIDE = 144, ALBEDO = 0.8, CORNERS = 24;
/** @typedef {{path: string, frame: number, count: number, rate: number, unit: string, irradiance: number[][],
 *   lights: {x: number, y: number, share: number}[]}} Frame */

/** A matte ball as a camera sees it that looks along −Z. @param {Uint8ClampedArray} pixels SIDE × SIDE, RGBA
 *  @param {number[][]} c of the irradiance, as `irradiance_facts` has them @param {number} exposure @param {number} turn of the light about +Y, degrees */
export function shade(pixels, c, exposure, turn) {
  const cos = Math.cos((turn * Math.PI) / 180), sin = Math.sin((turn * Math.PI) / 180);
  for (let row = 0, at = 0; row < SIDE; row++) {
    for (let column = 0; column < SIDE; column++, at += 4) {
      const a = (2 * (column + 0.5)) / SIDE - 1, y = 1 - (2 * (row + 0.5)) / SIDE, depth = 1 - a * a - y * y;
      pixels[at + 3] = depth > 0 ? 255 : 0;
      if (depth <= 0) continue;
      // The normal in the map's own frame.
      const b = Math.sqrt(depth), x = cos * a - sin * b, z = sin * a + cos * b;
      const basis = [1, x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1];
      for (let i = 0; i < 3; i++) {
        let E = 0;
        for (let k = 0; k < 9; k++) E += c[k][i] * basis[k];
        const L = Math.min(Math.max((E * ALBEDO * exposure) / Math.PI, 0), 1);
        pixels[at + i] = Math.round(255 * (L <= 0.0031308 ? 12.92 * L : 1.055 * L ** (1 / 2.4) - 0.055));
      }
    }
  }
}

/** @param {import("./studio.js").Studio} studio */
export function lightFilm(studio) {
  /** @type {Frame | null} */ let shown = null;
  let playing = false, number = 1, asked = 0, maps = "", drawn = "", withLights = true;
  // These stay, whatever else the pane shows: a slider that is dragged is not taken away.
  const slider = make("input", { type: "range", id: "light-frame", min: "1", max: "1", step: "1", value: "1", oninput: () => {
    playing = false;
    go(Number(slider.value));
  } });
  const button = make("button", { type: "button", id: "light-play", onclick: () => (playing ? stop() : play()) }, "Play");
  const words = make("span", { id: "light-frame-words" }), ball = make("canvas", { id: "light-ball", width: SIDE, height: SIDE });
  ball.setAttribute("role", "img");
  ball.setAttribute("aria-label", "A matte ball under the light of this frame, from the front");
  const lights = make("input", { type: "checkbox", id: "light-lights", checked: true, onchange: () => {
    withLights = lights.checked;
    studio.drawn();
  } });

  function state() {
    button.textContent = playing ? "Pause" : "Play";
    button.setAttribute("aria-pressed", String(playing));
    if (!shown) return;
    slider.max = String(shown.count);
    slider.value = String(number);
    words.textContent = `${shown.frame} of ${shown.count}, ${((shown.frame - 1) / shown.rate).toFixed(2)} s`;
  }

  /** Show a frame; of several asked for at once the latest. @param {number} wanted */
  async function go(wanted) {
    const turn = ++asked;
    number = wanted;
    return studio.attempt(async () => {
      const found = /** @type {Frame} */ (await post("/light/frame", { frame: wanted }));
      if (turn !== asked) return false;
      const first = shown === null || !isShown();
      shown = found;
      await studio.show(found.path, "folder", first, !first);
      state();
      studio.drawn();
      return true;
    }).then((done) => {
      if (done === undefined) playing = false; // it was refused
      return done;
    });
  }

  /** One after another at the maps' own rate; where that is too fast, some are left out. */
  async function play() {
    playing = true;
    state();
    if (!shown && !(await go(1))) return state();
    const begun = performance.now(), from = number;
    while (playing && shown) {
      const { count, rate } = shown, due = from - 1 + Math.max(1, Math.floor(((performance.now() - begun) / 1000) * rate));
      const next = (due % count) + 1;
      if (next === number && count > 1) {
        await new Promise((then) => setTimeout(then, 4));
        continue;
      }
      if (!(await go(next)) || count === 1) break;
      await arrived();
    }
    stop();
  }

  /** The frame's pixels are there. */
  async function arrived() {
    for (let i = 0; i < 500 && playing && !studio.canvas.settled; i++) await new Promise((then) => setTimeout(then, 4));
  }

  function stop() {
    playing = false;
    state();
  }

  const isShown = () => shown !== null && studio.shownPath === shown.path && studio.shownWhere === "folder";

  function drawBall() {
    if (!shown) return;
    const light = studio.state.table.light ?? {}, turn = (light.turn ?? 0) + (light.heading ?? 0);
    const exposure = 2 ** (studio.canvas.view.stops + (light.exposure ?? 0)), key = JSON.stringify([shown.path, turn, exposure]);
    if (key === drawn) return;
    drawn = key;
    const context = /** @type {CanvasRenderingContext2D} */ (ball.getContext("2d")), image = context.createImageData(SIDE, SIDE);
    shade(image.data, shown.irradiance, exposure, turn);
    context.putImageData(image, 0, 0);
  }

  return {
    isShown,
    /** What is shown where the shot's light is maps. @param {string} names of them */
    build(names) {
      if (names !== maps) {
        [maps, shown, drawn, number, playing] = [names, null, "", 1, false];
        go(1);
      }
      state();
      return [
        make("h2", {}, "Frame by frame"),
        make("div", { className: "row" }, button, make("label", { for: "light-frame" }, "Frame"), slider, words),
        make("div", { className: "row" }, lights, make("label", { for: "light-lights" }, "The lights that stand for it, drawn on it")),
        ball,
        make("p", {}, "The ball is matte, of albedo 0.8, seen along −Z, with the light turned and as bright as the shot has it, at the picture's exposure (E and Shift+E)."),
      ];
    },
    stop,
    /** Show the frame that was shown last. */
    look: () => void (shown && go(number)),
    /** After every drawing of the picture: another exposure is another ball. */
    drawn: drawBall,
    /** @returns {import("./overlay.js").Drawing | null} */
    drawing() {
      if (!shown || !isShown() || !withLights) return null;
      const rows = studio.size?.[1] ?? 1;
      return {
        points: shown.lights.map((each, i) => ({ key: `light ${i}`, x: each.x, y: each.y })),
        // As large as it is strong.
        lines: shown.lights.filter((each) => each.share > 0).map((each, i) => ({ key: `light ${i}`, closed: true, d: [Array.from({ length: CORNERS }, (_, k) => {
          const angle = (2 * Math.PI * k) / CORNERS, radius = 0.2 * rows * Math.sqrt(each.share);
          return /** @type {[number, number]} */ ([each.x + radius * Math.cos(angle), each.y + radius * Math.sin(angle)]);
        })] })),
      };
    },
  };
}
