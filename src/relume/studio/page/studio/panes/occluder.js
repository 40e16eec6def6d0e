// What stands in front of the objects: painted on the plate by brush and polygon, kept as match.occluder.

import { make } from "../fields.js";
import { Painting } from "../painting.js";
import { answer, json } from "../../requests.js";

/** @typedef {"" | "brush" | "erase" | "polygon"} Tool */

/** @param {import("../studio.js").Studio} studio @param {() => void} begun called when something is to be painted */
export function occluder(studio, begun) {
  /** @type {Painting | null} */ let painting = null;
  /** @type {Tool} */ let tool = "";
  /** @type {[number, number][]} */ let corners = [];
  let radius = 12, shownFile = "", changed = false;
  const over = document.createElement("canvas");
  over.setAttribute("aria-hidden", "true");
  over.id = "matte";
  over.hidden = true;
  document.getElementById("live")?.after(over);

  const file = () => studio.state.table.match?.occluder ?? "";
  const onPlate = () => studio.shownPath === studio.platePath && studio.platePath !== "";

  /** The painting as the shot has it. */
  async function open() {
    const size = studio.facts.get(studio.number)?.size;
    if (!onPlate() || !size) return null;
    if (painting && painting.matte.width === size[0] && painting.matte.height === size[1] && (shownFile === file() || changed)) return painting;
    painting = new Painting(size[0], size[1], over);
    shownFile = file();
    changed = false;
    if (shownFile) await studio.attempt(async () => painting?.load(await createImageBitmap(await (await answer(`/occluder?path=${encodeURIComponent(shownFile)}`)).blob())));
    studio.drawn();
    return painting;
  }

  /** @param {Tool} wanted */
  async function take(wanted) {
    tool = tool === wanted ? "" : wanted;
    corners = [];
    if (tool) begun();
    await open();
    studio.rebuild();
    studio.drawn();
  }

  /** @param {boolean} erase */
  async function fill(erase) {
    (await open())?.fill(corners, erase);
    corners = [];
    changed = true;
    studio.rebuild();
    studio.drawn();
  }

  /** Write it, and have the shot name it. */
  async function keep() {
    if (!painting || !changed) return;
    await studio.attempt(async () => {
      const { path } = await json("/occluder", { method: "POST", body: await painting?.png() });
      changed = false;
      shownFile = path;
      await studio.edit([{ set: ["match", "occluder"], value: path }]);
    });
    studio.rebuild();
  }

  async function drop() {
    painting?.clear();
    [corners, changed, shownFile, tool] = [[], false, "", ""];
    if (file()) await studio.edit([{ remove: ["match", "occluder"] }]);
    studio.rebuild();
    studio.drawn();
  }

  const button = (/** @type {string} */ text, /** @type {() => unknown} */ onclick, /** @type {boolean | null} */ pressed = null, disabled = false) => {
    const made = make("button", { type: "button", onclick, disabled }, text);
    if (pressed !== null) made.setAttribute("aria-pressed", String(pressed));
    return made;
  };

  return {
    build() {
      const size = make("input", { id: "brush", type: "range", min: "1", max: "80", step: "1", value: String(radius), oninput: () => (radius = Number(size.value)) });
      const middle = () => /** @type {[number, number]} */ ([studio.canvas.view.x + 12 * corners.length, studio.canvas.view.y]);
      return [
        make("h2", {}, "In front of the objects"),
        make("div", { className: "row", role: "group" }, button("Brush", () => take("brush"), tool === "brush"), button("Eraser", () => take("erase"), tool === "erase"),
          button("Polygon", () => take("polygon"), tool === "polygon")),
        ...(tool === "brush" || tool === "erase" ? [make("div", { className: "row" }, make("label", { for: "brush" }, "Radius"), size)] : []),
        ...(tool === "polygon" ? [make("p", {}, "Click its corners round the thing; drag them, or move them by the arrow keys."),
          make("div", { className: "row" }, button("+ corner", () => (corners.push(middle()), studio.rebuild(), studio.drawn())),
            button("Fill it", () => fill(false), null, corners.length < 3), button("Cut it out", () => fill(true), null, corners.length < 3))] : []),
        make("div", { className: "row" }, button("Keep it", keep, null, !changed), button("Nothing is in front", drop, null, !file() && !changed)),
        make("p", {}, file() ? `${file()} stands in front.` : "Paint what stands between the camera and the objects: a plant, the edge of a box."),
      ];
    },
    /** Put the tools down: something else is drawn. */
    rest() {
      [tool, corners] = ["", []];
    },
    shown: () => void open(),
    hidden() {
      over.hidden = true;
      tool = "";
      keep();
    },
    /** The file was changed elsewhere, or undone. */
    changed: () => void (shownFile !== file() && !changed && open()),
    drawn() {
      over.hidden = !painting || !onPlate();
      if (painting && !over.hidden) painting.draw(studio.canvas, studio.canvas.width, studio.canvas.height);
    },
    drawing: () => (tool !== "polygon" ? {} : {
      lines: corners.length > 1 ? [{ key: "polygon", d: [corners], closed: corners.length > 2 }] : [],
      handles: corners.map(([x, y], i) => ({ key: `corner ${i}`, x, y, label: `Corner ${i + 1}`,
        moved: (/** @type {number} */ a, /** @type {number} */ b) => {
          corners[i] = [a, b];
          studio.drawn();
        } })),
    }),
    /** @param {number} x @param {number} y */
    clicked(x, y) {
      if (tool !== "polygon" || !onPlate()) return;
      corners.push([x, y]);
      studio.rebuild();
      studio.drawn();
    },
    /** @param {PointerEvent} event @param {"begin" | "move" | "end"} phase */
    drag(event, phase) {
      if ((tool !== "brush" && tool !== "erase") || !painting || !onPlate()) return false;
      const [x, y] = studio.overlay.at(event);
      painting.stroke(x, y, radius, tool === "erase");
      if (phase === "end") {
        painting.end();
        if (!changed) {
          changed = true;
          studio.rebuild();
        }
      }
      studio.drawn();
      return true;
    },
  };
}
