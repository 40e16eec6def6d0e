// All views of the ball side by side: each photograph with its own rim and handles.

import { HdrCanvas } from "../../canvas.js";
import { make } from "../fields.js";
import { Overlay } from "../overlay.js";
import { json, post } from "../../requests.js";

const SVG = "http://www.w3.org/2000/svg";
/** Views beside each other: a browser keeps some sixteen pictures that the graphics card draws. */
const MOST = 8;

/** @typedef {{canvas: HdrCanvas, overlay: Overlay, said: HTMLElement, name: HTMLElement, box: HTMLElement, path: string}} Cell */

/** @param {import("../studio.js").Studio} studio @param {(view: number) => import("./ball_rim.js").BallRim} rimOf @param {(view: number) => void} chosen
 *  called when a view is touched */
export function ballViews(studio, rimOf, chosen) {
  const grid = make("div", { id: "views", hidden: true, role: "group" });
  grid.setAttribute("aria-label", "The views of the ball");
  document.getElementById("overlay")?.after(grid);
  /** @type {Cell[]} */ const cells = [];

  /** @param {number} view @returns {Cell} */
  function cell(view) {
    const element = make("canvas", { tabIndex: 0 }), svg = document.createElementNS(SVG, "svg"), glass = make("canvas", { width: 132, height: 132, hidden: true, className: "glass" });
    element.setAttribute("role", "img");
    element.setAttribute("aria-label", `View ${view + 1} of the ball`);
    svg.setAttribute("class", "overlay");
    svg.setAttribute("aria-label", `The rim in view ${view + 1}`);
    glass.setAttribute("aria-hidden", "true");
    const said = make("span", {}), name = make("b", {}), box = make("figure", { data: { view: String(view) } }, make("div", {}, element, svg, glass), make("figcaption", {}, name, said));
    grid.append(box);
    const canvas = new HdrCanvas(element, () => draw(view), (error) => studio.say(error)), overlay = new Overlay(/** @type {SVGSVGElement} */ (svg), glass, canvas);
    box.addEventListener("pointerdown", () => chosen(view), true);
    box.addEventListener("focusin", () => chosen(view));
    begin(element, canvas);
    return { canvas, overlay, said, name, box, path: "" };
  }

  /** Drag pans, the wheel enlarges. @param {HTMLCanvasElement} element @param {HdrCanvas} canvas */
  function begin(element, canvas) {
    /** @type {[number, number] | null} */ let from = null;
    const point = (/** @type {MouseEvent} */ event) => {
      const box = element.getBoundingClientRect(), density = canvas.width / box.width;
      return /** @type {[number, number]} */ ([(event.clientX - box.left) * density, (event.clientY - box.top) * density]);
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      from = point(event);
    });
    element.addEventListener("pointermove", (event) => {
      if (!from) return;
      const to = point(event);
      canvas.pan(to[0] - from[0], to[1] - from[1]);
      from = to;
    });
    element.addEventListener("pointerup", () => (from = null));
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      canvas.enlarge(2 ** (-event.deltaY / (event.deltaMode ? 6 : 200)), ...point(event));
    }, { passive: false });
  }

  /** @param {number} view */
  function draw(view) {
    const one = cells[view];
    if (!one || grid.hidden) return;
    const rim = rimOf(view);
    one.overlay.draw(rim.path() === one.path ? rim.drawing() : {});
    one.name.textContent = `View ${view + 1}: ${rim.path().split("/").pop()}`;
    one.said.textContent = rim.said;
  }

  /** The photograph of a view, as bright as it is. @param {number} view */
  const show = (view) => studio.attempt(async () => {
    const one = cells[view], path = rimOf(view).path();
    if (!path || one.path === path) return;
    one.path = path;
    const { number } = await post("/opened", { path, where: "folder" });
    const facts = /** @type {import("../../source.js").PictureFacts} */ (await json(`/pictures/${number}`));
    studio.facts.set(number, facts);
    one.canvas.resized();
    one.canvas.open(facts.layers[0], studio.tilesOf(number, 0));
    one.canvas.fit();
  });

  return {
    get open() {
      return !grid.hidden;
    },
    /** @param {boolean} wanted @param {number} now the view that is worked on */
    async set(wanted, now) {
      grid.hidden = !wanted;
      document.getElementById("overlay")?.toggleAttribute("hidden", wanted);
      if (!wanted) return;
      const count = Math.min(studio.state.balls.length, MOST);
      while (cells.length < count) cells.push(cell(cells.length));
      cells.forEach((one, view) => (one.box.hidden = view >= count));
      this.mark(now);
      for (let view = 0; view < count; view++) {
        rimOf(view).begin();
        await show(view);
      }
    },
    /** @param {number} now */
    mark(now) {
      cells.forEach((one, view) => (one.box.dataset.chosen = String(view === now)));
    },
    draw,
    show,
  };
}
