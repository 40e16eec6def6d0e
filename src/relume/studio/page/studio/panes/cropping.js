// A rectangle of the picture that is shown, drawn on it: cut out as a picture of its own, or, of the light, painted on.

import { make, quoted } from "../fields.js";
import { post } from "../../requests.js";

/** @typedef {[number, number, number, number]} Box left, top, width, height in whole pixels */

const NAMES = ["left", "top", "width", "height"];

/** @param {import("../studio.js").Studio} studio @param {(box: Box) => void} paint has that part of the light painted on
 *  @param {() => boolean} isLight whether the light is what is shown */
export function cropping(studio, paint, isLight) {
  let drawing = false, said = "";
  /** @type {Box | null} */ let box = null;
  /** Where a drag began. @type {[number, number] | null} */ let from = null;

  const facts = () => studio.facts.get(studio.number), size = () => facts()?.size ?? [1, 1];
  /** Whole pixels of the picture between two points of it. @param {number[]} a @param {number[]} b @returns {Box} */
  function between(a, b) {
    const [low, high] = [Math.min, Math.max].map((pick, end) => [0, 1].map((i) => {
      const edge = end ? Math.ceil(pick(a[i], b[i])) : Math.floor(pick(a[i], b[i]));
      return Math.min(Math.max(edge, 0), size()[i]);
    }));
    const [left, top] = low.map((each, i) => Math.min(each, size()[i] - 1));
    return [left, top, Math.max(high[0] - left, 1), Math.max(high[1] - top, 1)];
  }
  /** @param {[number, number]} moved a corner @param {[number, number]} other @param {boolean} done */
  function to(moved, other, done) {
    box = between(moved, other);
    if (done) studio.rebuild();
    studio.drawn();
  }

  function begin() {
    drawing = !drawing;
    const [width, height] = size();
    box = drawing ? between([width / 4, height / 4], [0.75 * width, 0.75 * height]) : null;
    said = "";
    studio.rebuild();
    studio.drawn();
  }

  const cut = () => studio.attempt(async () => {
    const found = await post("/crop", { path: studio.shownPath, where: studio.shownWhere, box });
    // What was measured stands among the results once they are rendered.
    const source = studio.shownWhere === "folder" ? studio.shownPath : `${studio.state.out}/${studio.shownPath}`;
    const command = `relume convert ${quoted(source)} -o ${quoted(found.path)} --roi ${box?.join(",")}`;
    said = `written: ${found.path}, ${found.size.join(" × ")}.`
      + (facts()?.mapping ? " It is a picture and no map: a part of a sphere has lost its directions." : "") + ` The same: ${command}`;
    studio.rebuild();
  });

  /** One of the four numbers, as whole pixels within the picture. @param {number} i */
  function field(i) {
    const input = make("input", { type: "number", step: 1, value: String(box?.[i] ?? ""), data: { crop: NAMES[i] }, onchange: () => {
      if (!box) return;
      const next = /** @type {Box} */ ([...box]);
      next[i] = Math.round(Number(input.value)) || 0;
      box = between(next, [next[0] + Math.max(next[2], 1), next[1] + Math.max(next[3], 1)]);
      studio.rebuild();
      studio.drawn();
    } });
    input.setAttribute("aria-label", `Rectangle ${NAMES[i]}`);
    return input;
  }

  return {
    build() {
      const toggle = make("button", { type: "button", onclick: begin, disabled: studio.number < 0 }, drawing ? "No rectangle" : "Draw a rectangle");
      toggle.setAttribute("aria-pressed", String(drawing));
      return [make("h2", {}, "Crop"), make("div", { className: "row" }, toggle), ...(drawing && box ? [
        make("p", {}, "Drag over the picture, or its corners; the arrow keys move a corner by a pixel."),
        make("div", { className: "row vector", role: "group" }, make("label", {}, "Rectangle"), ...NAMES.map((_, i) => field(i)), "px"),
        make("div", { className: "row" }, make("button", { type: "button", onclick: cut }, "Cut it out"),
          ...(isLight() ? [make("button", { type: "button", onclick: () => box && paint(box) }, "Slice it to paint on")] : [])),
      ] : []), ...(said ? [make("p", { ariaLive: "polite", data: { cropped: "" } }, said)] : [])];
    },
    /** Another picture is shown: its rectangle would be another. */
    forget() {
      [drawing, box] = [false, null];
    },
    /** @param {PointerEvent} event @param {"begin" | "move" | "end"} phase */
    drag(event, phase) {
      if (!drawing) return false;
      const here = studio.overlay.at(event);
      if (phase === "begin") from = here;
      else if (from) to(here, from, phase === "end");
      return true;
    },
    /** @returns {import("../overlay.js").Drawing | null} */
    drawing() {
      if (!box) return null;
      const [left, top, width, height] = box, [right, bottom] = [left + width, top + height];
      const corner = (/** @type {string} */ key, /** @type {[number, number]} */ [x, y], /** @type {[number, number]} */ other) => ({
        key, x, y, label: `The rectangle's ${key} corner`, moved: (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) =>
          to([Math.round(a), Math.round(b)], other, done),
      });
      return {
        lines: [{ key: "crop", d: [[[left, top], [right, top], [right, bottom], [left, bottom]]], closed: true, className: "filled" }],
        handles: [corner("upper left", [left, top], [right, bottom]), corner("lower right", [right, bottom], [left, top])],
        words: [{ key: "crop", x: left, y: top, text: `${left}, ${top}: ${width} × ${height}` }],
      };
    },
  };
}
