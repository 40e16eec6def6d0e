// What is drawn over the picture: lines, and handles that are dragged or moved by the arrow keys, with a glass.

/** @typedef {{key: string, d: [number, number][][], className?: string, closed?: boolean}} Line in pixels of the picture */
/** @typedef {{key: string, x: number, y: number, label: string, moved: (x: number, y: number, done: boolean) => void}} Handle */
/** @typedef {{key: string, x: number, y: number}} Point */
/** @typedef {{key: string, x: number, y: number, text: string, row?: number}} Words row: below the first that stand there */
/** @typedef {{lines?: Line[], handles?: Handle[], points?: Point[], words?: Words[]}} Drawing */

const SVG = "http://www.w3.org/2000/svg";

export class Overlay {
  /** @param {SVGSVGElement} svg @param {HTMLCanvasElement} glass @param {import("../canvas.js").HdrCanvas} canvas */
  constructor(svg, glass, canvas) {
    this.svg = svg;
    this.glass = glass;
    this.canvas = canvas;
    /** @type {Map<string, SVGElement>} */ this.kept = new Map();
    /** @type {Map<string, Handle>} */ this.handles = new Map();
    /** @type {{key: string, dx: number, dy: number} | null} */ this.dragged = null;
    /** Pixels of the picture by which an arrow key moves a handle; with Shift ten times as many. */ this.nudge = 1;
    svg.addEventListener("pointerdown", (event) => this.begin(event));
    svg.addEventListener("pointermove", (event) => this.move(event, false));
    svg.addEventListener("pointerup", (event) => this.move(event, true));
    svg.addEventListener("keydown", (event) => this.typed(event));
  }

  /** Where a pointer is in the picture. @param {MouseEvent} event @returns {[number, number]} */
  at(event) {
    const box = this.canvas.canvas.getBoundingClientRect(), density = this.canvas.width / box.width;
    const [x, y] = this.canvas.toPicture((event.clientX - box.left) * density, (event.clientY - box.top) * density);
    return [x, y];
  }

  /** @param {PointerEvent} event */
  begin(event) {
    const key = /** @type {SVGElement} */ (event.target).dataset?.handle;
    const handle = key === undefined ? undefined : this.handles.get(key);
    if (!handle || key === undefined || event.button !== 0) return;
    event.preventDefault();
    this.svg.setPointerCapture(event.pointerId);
    const [x, y] = this.at(event);
    this.dragged = { key, dx: handle.x - x, dy: handle.y - y };
    this.kept.get(`handle ${key}`)?.focus();
  }

  /** @param {PointerEvent} event @param {boolean} done */
  move(event, done) {
    if (!this.dragged) return;
    const handle = this.handles.get(this.dragged.key), [x, y] = this.at(event);
    handle?.moved(x + this.dragged.dx, y + this.dragged.dy, done);
    this.look(done ? null : event);
    if (done) this.dragged = null;
  }

  /** @param {KeyboardEvent} event */
  typed(event) {
    const key = /** @type {SVGElement} */ (event.target).dataset?.handle;
    const handle = key === undefined ? undefined : this.handles.get(key);
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!handle || !by) return;
    event.preventDefault();
    event.stopPropagation();
    const step = (event.shiftKey ? 10 : 1) * this.nudge;
    handle.moved(handle.x + step * by[0], handle.y + step * by[1], true);
  }

  /** The glass: what is under the pointer, six times as large. @param {MouseEvent | null} event */
  look(event) {
    this.glass.hidden = event === null;
    if (!event) return;
    const context = /** @type {CanvasRenderingContext2D} */ (this.glass.getContext("2d"));
    const box = this.canvas.canvas.getBoundingClientRect(), density = this.canvas.width / box.width;
    const x = (event.clientX - box.left) * density, y = (event.clientY - box.top) * density, side = this.glass.width, part = side / 6;
    context.imageSmoothingEnabled = false;
    context.fillStyle = "#121314";
    context.fillRect(0, 0, side, side);
    const drawn = this.canvas.canvas, finer = drawn.width / this.canvas.width; // below 1 while frames are rough
    context.drawImage(drawn, finer * (x - part / 2), finer * (y - part / 2), finer * part, finer * part, 0, 0, side, side);
    context.strokeStyle = "#f0a132";
    context.strokeRect(side / 2 - 3, side / 2 - 3, 6, 6);
    const right = event.clientX - box.left + 24 + side > box.width;
    this.glass.style.left = `${event.clientX - box.left + (right ? -24 - side : 24)}px`;
    this.glass.style.top = `${Math.max(0, event.clientY - box.top - side - 12)}px`;
  }

  /** @param {Drawing} drawing */
  draw({ lines = [], handles = [], points = [], words = [] }) {
    const { canvas } = this, density = canvas.width / Math.max(canvas.canvas.clientWidth, 1);
    const screen = (/** @type {number} */ x, /** @type {number} */ y) => canvas.toScreen(x, y).map((each) => each / density);
    /** @type {Set<string>} */ const seen = new Set();
    const element = (/** @type {string} */ key, /** @type {string} */ kind) => {
      seen.add(key);
      let found = this.kept.get(key);
      if (!found) {
        found = /** @type {SVGElement} */ (document.createElementNS(SVG, kind));
        this.kept.set(key, found);
        this.svg.append(found);
      }
      return found;
    };
    for (const line of lines) {
      // What lies behind the camera has no place in the picture.
      const d = line.d.map((part) => part.filter(([x, y]) => Number.isFinite(x + y))).filter((part) => part.length > 1).map((part) => `M${part
        .map(([x, y]) => screen(x, y).map((each) => each.toFixed(2)).join(",")).join("L")}${line.closed ? "Z" : ""}`).join("");
      for (const [key, name] of [[`under ${line.key}`, "under"], [`line ${line.key}`, line.className ?? ""]]) {
        const path = element(key, "path");
        path.setAttribute("d", d);
        path.setAttribute("class", name);
      }
    }
    for (const point of points) {
      const circle = element(`point ${point.key}`, "circle"), [x, y] = screen(point.x, point.y);
      for (const [name, value] of [["cx", x], ["cy", y], ["r", 2.2], ["class", "point"]]) circle.setAttribute(String(name), String(value));
    }
    for (const each of words) {
      const text = element(`words ${each.key}`, "text"), [x, y] = screen(each.x, each.y);
      text.setAttribute("x", String(x + 9));
      text.setAttribute("y", String(y - 7 + 14 * (each.row ?? 0)));
      text.textContent = each.text;
    }
    this.handles = new Map(handles.map((each) => [each.key, each]));
    for (const handle of handles) {
      const circle = element(`handle ${handle.key}`, "circle"), [x, y] = screen(handle.x, handle.y);
      circle.dataset.handle = handle.key;
      for (const [name, value] of [["cx", x], ["cy", y], ["r", 6], ["tabindex", 0], ["role", "button"], ["aria-label", handle.label]]) {
        circle.setAttribute(String(name), String(value));
      }
    }
    for (const [key, old] of this.kept) {
      if (seen.has(key)) continue;
      old.remove();
      this.kept.delete(key);
    }
  }
}
