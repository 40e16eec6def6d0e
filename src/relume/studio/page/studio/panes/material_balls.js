// Materials as balls under the measured light: one is clicked for the chosen object, or dragged onto any in the photograph.

import { make } from "../fields.js";
import { bytes, json } from "../../requests.js";

const KIND = "application/x-relume-material";
const ACROSS = 6; // of them in a row, by which the arrow keys move

/** @typedef {{name: string, table: any, object: number | null, left_out: string[]}} Ball */

/** @param {number} linear */
const encoded = (linear) => 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * Math.min(linear, 1) ** (1 / 2.4) - 0.055);

/**
 * @param {import("../studio.js").Studio} studio
 * @param {{chosen: () => number, choose: (n: number) => void, under: (x: number, y: number) => number, exposure: () => number}} objects
 *   under: the object at a pixel of the plate; exposure: what radiance is multiplied by on the screen
 */
export function materialBalls(studio, objects) {
  /** @type {{size: number, digest: string, balls: Ball[]} | null} */ let found = null;
  /** @type {Float32Array | null} */ let pixels = null;
  let asked = "", coming = false, said = "", focused = 0, drawn = NaN;
  /** @type {Map<number, HTMLCanvasElement>} by the ball's number */ const canvases = new Map();

  /** What the balls depend on. */
  function wanted() {
    const { objects: list = [], light = {} } = studio.state.table;
    const { camera, light: _, irradiance } = studio.measured ?? {};
    return JSON.stringify([camera, irradiance, light.turn, light.heading, light.exposure,
      list.map((/** @type {any} */ each) => [each.mesh, Object.keys(each.material ?? {}).some((key) => key !== "preset") ? each.material : null])]);
  }

  /** Ask for the balls where they are others now; the latest wish counts. */
  async function fetchBalls() {
    if (!studio.measured || studio.state.fault !== null || coming || asked === wanted()) return;
    coming = true;
    while (asked !== wanted() && studio.state.fault === null) {
      asked = wanted();
      try {
        const facts = await json("/materials");
        pixels = new Float32Array(await bytes(`/materials/${facts.digest}`));
        found = facts;
        said = "";
      } catch (error) {
        said = error instanceof Error ? error.message : String(error);
      }
    }
    coming = false;
    if (studio.panes[studio.step]?.name === "Objects") studio.rebuild();
  }

  /** The material of an object as the shot file has it. @param {number} n */
  const kept = (n) => JSON.stringify(studio.state.table.objects?.[n]?.material ?? {});

  /** Give an object a material. @param {number} n @param {any} table */
  function give(n, table) {
    const one = studio.state.table.objects?.[n];
    if (!one || kept(n) === JSON.stringify(table)) return undefined;
    const place = ["objects", n, "material"], plain = !Object.keys(table).length;
    return studio.edit(plain ? [{ remove: place }] : [{ set: place, value: table }]);
  }

  /** The balls that stand in the strip: an object's own for itself alone. */
  const shown = () => (found?.balls ?? []).flatMap((ball, number) =>
    (ball.object === null || ball.object === objects.chosen() || Object.keys(ball.table).length ? [{ ball, number }] : []));

  function draw() {
    if (!found || !pixels) return;
    const { size } = found, gain = objects.exposure(), count = size * size;
    drawn = gain;
    for (const [number, canvas] of canvases) {
      const context = canvas.getContext("2d"), image = new ImageData(size, size), from = 4 * count * number;
      for (let i = 0; i < 4 * count; i += 4) {
        for (let c = 0; c < 3; c++) image.data[i + c] = encoded(Math.max(0, gain * pixels[from + i + c]));
        image.data[i + 3] = 255 * pixels[from + i + 3];
      }
      context?.putImageData(image, 0, 0);
    }
  }

  /** One stop of Tab for the whole strip; arrow keys go on within it. @param {KeyboardEvent} event */
  function moved(event) {
    const by = { ArrowRight: 1, ArrowLeft: -1, ArrowDown: ACROSS, ArrowUp: -ACROSS, Home: -Infinity, End: Infinity }[event.key];
    const strip = /** @type {HTMLElement} */ (event.currentTarget), buttons = [...strip.querySelectorAll("button")];
    const now = buttons.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
    if (by === undefined || now < 0) return;
    event.preventDefault();
    event.stopPropagation();
    const next = Math.min(Math.max(now + by, 0), buttons.length - 1);
    buttons[now].tabIndex = -1;
    buttons[next].tabIndex = 0;
    focused = next;
    buttons[next].focus();
  }

  /** A ball that is dragged over the photograph marks the object below it. @param {DragEvent} event */
  const aimed = (event) => objects.under(...studio.overlay.at(event));
  const picture = studio.canvas.canvas;
  const here = (/** @type {DragEvent} */ event) => studio.panes[studio.step]?.name === "Objects" && event.dataTransfer?.types.includes(KIND);
  picture.addEventListener("dragover", (event) => {
    if (!here(event) || aimed(event) < 0) return;
    event.preventDefault();
    objects.choose(aimed(event));
  });
  picture.addEventListener("drop", (event) => {
    const n = here(event) ? aimed(event) : -1;
    if (n < 0) return;
    event.preventDefault();
    objects.choose(n);
    give(n, JSON.parse(event.dataTransfer?.getData(KIND) ?? "{}"));
  });

  return {
    fetchBalls,
    /** After every frame: as bright as the picture is. */
    drawn: () => void (objects.exposure() !== drawn && draw()),
    build() {
      canvases.clear();
      if (!studio.measured) return [make("p", {}, "Materials are shown as balls under this light once it is measured: take a quick look.")];
      if (!found) return [make("p", { ariaLive: "polite" }, said || "Balls of the materials are being made …")];
      const list = shown(), now = kept(objects.chosen());
      const current = list.findIndex(({ ball }) => JSON.stringify(ball.table) === now);
      focused = Math.min(focused, list.length - 1);
      const strip = make("div", { className: "balls", role: "toolbar", onkeydown: moved }, ...list.map(({ ball, number }, i) => {
        const canvas = make("canvas", { width: found?.size, height: found?.size });
        canvas.setAttribute("aria-hidden", "true");
        canvases.set(number, canvas);
        const words = ball.name.replaceAll("_", " "), missing = ball.left_out.length ? `; the ball does not show ${ball.left_out.join(", ")}` : "";
        const button = make("button", { type: "button", title: words + missing, draggable: true, tabIndex: i === focused ? 0 : -1,
          data: { ball: ball.name }, onclick: () => ((focused = i), give(objects.chosen(), ball.table)),
          ondragstart: (/** @type {DragEvent} */ event) => event.dataTransfer?.setData(KIND, JSON.stringify(ball.table)),
        }, canvas);
        button.setAttribute("aria-label", words + missing);
        button.setAttribute("aria-pressed", String(i === current));
        return button;
      }));
      strip.setAttribute("aria-label", "Materials under this light");
      draw();
      return [strip, make("p", {}, "Click a ball for this object, or drag it onto another. Each is as it would look here, without shadow or table."),
        ...(said ? [make("p", { className: "doubt" }, said)] : [])];
    },
  };
}
