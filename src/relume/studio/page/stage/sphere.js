// All directions around the subject on one disc, as Debevec's angular map has them: the middle is the camera's, half way
// to the rim is beside the subject, the rim is behind it. Lamps are dragged on it.

/** @typedef {[number, number, number]} Three */
/** @typedef {{direction: Three, colour: string, stops: number, size: number}} Lamp */

const SVG = "http://www.w3.org/2000/svg";
const STEP = (2 * Math.PI) / 180; // by an arrow key

/** Where a direction lies on the disc; x to the right, y down. @param {Three} d in the camera's axes: right, up, towards it */
export function onDisc([x, y, z]) {
  const side = Math.hypot(x, y), angle = Math.atan2(side, z) / Math.PI;
  return side > 1e-9 ? [(x / side) * angle, (-y / side) * angle] : [0, z > 0 ? 0 : -1];
}

/** The direction at a place of the disc. @param {number} x @param {number} y @returns {Three} */
export function fromDisc(x, y) {
  const radius = Math.min(Math.hypot(x, y), 1), angle = radius * Math.PI, length = Math.hypot(x, y) || 1;
  return [(x / length) * Math.sin(angle), (-y / length) * Math.sin(angle), Math.cos(angle)];
}

/** @template {keyof SVGElementTagNameMap} K @param {K} kind @param {Record<string, string | number>} has @returns {SVGElementTagNameMap[K]} */
function drawn(kind, has) {
  const made = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(has)) made.setAttribute(name, String(value));
  return made;
}

export class Sphere {
  /**
   * @param {SVGSVGElement} svg
   * @param {(lamp: number, direction: Three) => void} moved to a direction in the world
   * @param {(lamp: number) => void} chosen
   */
  constructor(svg, moved, chosen) {
    this.svg = svg;
    this.moved = moved;
    this.chosen = chosen;
    /** @type {Three[]} */ this.axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]; // the camera's, in the world; it looks along −Z
    this.ground = drawn("g", {});
    this.lamps = drawn("g", {});
    svg.append(this.ground, this.lamps);
    /** @type {number | null} */ this.held = null;
    svg.addEventListener("pointermove", (event) => {
      if (this.held === null || !event.buttons) return;
      this.moved(this.held, this.toWorld(fromDisc(...this.at(event))));
    });
    svg.addEventListener("pointerup", () => (this.held = null));
  }

  /** @param {PointerEvent} event @returns {[number, number]} */
  at(event) {
    const box = this.svg.getBoundingClientRect();
    return [(2.24 * (event.clientX - box.left)) / box.width - 1.12, (2.24 * (event.clientY - box.top)) / box.height - 1.12];
  }

  /** @param {Three} d @returns {Three} */
  toWorld(d) {
    return /** @type {Three} */ ([0, 1, 2].map((i) => this.axes[i].reduce((sum, each, k) => sum + each * d[k], 0)));
  }

  /** @param {Three} d @returns {Three} */
  toCamera(d) {
    return /** @type {Three} */ ([0, 1, 2].map((k) => this.axes.reduce((sum, row, i) => sum + row[k] * d[i], 0)));
  }

  /** @param {Three[]} axes rows of the rotation from camera to world @param {Three[]} lights of the stage */
  begin(axes, lights) {
    this.axes = axes;
    this.ground.replaceChildren(
      drawn("circle", { r: 1, class: "ground" }), drawn("circle", { r: 0.5, class: "ring" }),
      ...lights.map((each) => {
        const [cx, cy] = onDisc(this.toCamera(each));
        return drawn("circle", { cx, cy, r: 0.008, class: "light" });
      }),
    );
    for (const [text, y] of /** @type {[string, number][]} */ ([["behind", -0.9], ["above", -0.52], ["below", 0.58]])) {
      const label = drawn("text", { x: 0, y });
      label.textContent = text;
      this.ground.append(label);
    }
  }

  /** @param {Lamp[]} lamps @param {number} chosen */
  draw(lamps, chosen) {
    while (this.lamps.children.length > lamps.length) this.lamps.lastElementChild?.remove();
    lamps.forEach((lamp, number) => {
      const handle = this.lamps.children[number] ?? this.lamps.appendChild(this.handle(number));
      const camera = this.toCamera(lamp.direction), [x, y] = onDisc(camera);
      const [around, dot] = /** @type {Element[]} */ ([...handle.children]);
      for (const each of [around, dot]) each.setAttribute("cx", String(x)), each.setAttribute("cy", String(y));
      around.setAttribute("r", String(lamp.size / 360));
      dot.setAttribute("fill", lamp.colour);
      handle.setAttribute("aria-pressed", String(number === chosen));
      const degrees = (/** @type {number} */ each) => Math.round((each * 180) / Math.PI);
      const right = degrees(Math.atan2(camera[0], camera[2])), up = degrees(Math.asin(Math.min(Math.max(camera[1], -1), 1)));
      handle.setAttribute("aria-label", `Lamp ${number + 1}: ${right}° to the right of the camera, ${up}° up`);
    });
  }

  /** @param {number} number */
  handle(number) {
    const group = drawn("g", { class: "lamp", tabindex: 0, role: "button" });
    group.append(drawn("circle", { class: "softness" }), drawn("circle", { r: 0.06 }));
    group.addEventListener("pointerdown", (event) => {
      this.held = number;
      this.svg.setPointerCapture(event.pointerId);
      this.chosen(number);
      group.focus();
      event.preventDefault();
    });
    group.addEventListener("focus", () => this.chosen(number));
    group.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!by || event.shiftKey) return;
      event.preventDefault();
      event.stopPropagation();
      const x = Number(group.children[1].getAttribute("cx")), y = Number(group.children[1].getAttribute("cy"));
      const place = /** @type {[number, number]} */ ([x + (by[0] * STEP) / Math.PI, y + (by[1] * STEP) / Math.PI]);
      this.moved(number, this.toWorld(fromDisc(...place)));
    });
    return group;
  }
}
