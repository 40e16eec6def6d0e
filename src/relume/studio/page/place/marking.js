// The marks of the photograph that is shown: drawn with their edges' names, laid along an edge by the pointer, moved by
// their handles under a glass, and taken out.

/** @typedef {import("./place.js").PlacePage} PlacePage */
/** @typedef {[number, number][]} Points pixels of the photograph, x to the right and y down from its corner */

const NEAR = 9; // pixels of the screen within which a click means a mark
const SHORT = 6; // pixels of the screen: what is shorter is a click, no edge
const LETTER = 6, ROW = 14; // pixels of the window that a letter and a line of words take
const INSIDE = 0.12; // share of an edge that is left free at its ends, where it is laid by what was found

/** @param {PlacePage} page */
export function marking(page) {
  /** Marks ahead of the file, by photograph, block and edge. @type {Map<string, Points | null>} */ const ahead = new Map();
  /** An edge that is being drawn. @type {Points | null} */ let draft = null;

  const key = (/** @type {string[]} */ ...names) => names.join("\n");
  const inFile = () => page.state.table.marks?.[page.photograph] ?? {};

  /** What is marked here on an edge or at a corner; null where nothing is. @param {string} block @param {string} edge @returns {Points | null} */
  function points(block, edge) {
    const found = ahead.get(key(page.photograph, block, edge));
    return found !== undefined ? found : inFile()[block]?.[edge] ?? null;
  }

  /** All marks of this photograph. @returns {{block: string, edge: string, points: Points}[]} */
  function all() {
    const own = Object.entries(inFile()).flatMap(([block, edges]) => Object.keys(/** @type {any} */ (edges)).map((edge) => [block, edge]));
    for (const each of ahead.keys()) {
      const [photograph, block, edge] = each.split("\n");
      if (photograph === page.photograph && !own.some(([a, b]) => a === block && b === edge)) own.push([block, edge]);
    }
    return own.flatMap(([block, edge]) => {
      const found = points(block, edge);
      return found ? [{ block, edge, points: found }] : [];
    });
  }

  /** Write a mark; null takes it out. @param {string} block @param {string} edge @param {Points | null} value */
  function write(block, edge, value) {
    const place = ["marks", page.photograph, block, edge], own = key(page.photograph, block, edge);
    ahead.set(own, value);
    page.drawn();
    return page.edit([value ? { set: place, value } : { remove: place }]);
  }

  const chosenPoints = () => (page.edge ? points(page.block, page.edge) : null);
  const isCurve = () => page.state.bodies[page.block]?.curved.includes(page.edge) ?? false;
  const isCorner = () => page.state.bodies[page.block]?.corners.includes(page.edge) ?? false;
  /** Whether a drag draws the chosen edge. */
  const drawing = () => page.edge !== "" && !isCurve() && !isCorner() && !chosenPoints();
  const hundredths = (/** @type {number} */ x, /** @type {number} */ y) => /** @type {[number, number]} */ ([x, y].map((each) => Math.round(each * 100) / 100));

  /** Pixels of the screen between a point of the photograph and a mark. @param {Points} mark @param {number} x @param {number} y */
  function away(mark, x, y) {
    const zoom = page.canvas.view.zoom, curved = mark.length > 2;
    const ends = curved || mark.length === 1 ? mark.map((each) => [each, each]) : [mark];
    return zoom * Math.min(...ends.map(([[ax, ay], [bx, by]]) => {
      const [dx, dy] = [bx - ax, by - ay], t = Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1), 0), 1);
      return Math.hypot(x - ax - t * dx, y - ay - t * dy);
    }));
  }

  /** Where an edge may be laid before it is dragged: where it was found, else in the middle of what is seen. @returns {Points} */
  function proposed() {
    const line = page.state.found?.lines[page.photograph]?.[page.block]?.[page.edge], [w, h] = page.size ?? [1, 1];
    const inside = (line ?? []).filter((/** @type {number[]} */ [x, y]) => x > 0 && y > 0 && x < w && y < h);
    if (line && inside.length === line.length) {
      if (isCorner()) return [line[0]];
      if (isCurve()) return [0, 1, 2, 3, 4, 5].map((i) => line[Math.floor(((i + 0.5) / 6) * line.length)]);
      const [[ax, ay], [bx, by]] = [line[0], line[line.length - 1]];
      return [INSIDE, 1 - INSIDE].map((t) => hundredths(ax + t * (bx - ax), ay + t * (by - ay)));
    }
    const { x, y, zoom } = page.canvas.view, reach = page.canvas.height / zoom / 8;
    return isCorner() || isCurve() ? [hundredths(x, y)] : [hundredths(x - reach, y), hundredths(x + reach, y)];
  }

  return {
    points, all,
    /** In how many photographs an edge is marked. @param {string} block @param {string} edge */
    times: (block, edge) => Object.values(page.state.table.marks ?? {}).filter((/** @type {any} */ each) => each?.[block]?.[edge]).length,

    /** The file has all that was done. */
    caughtUp() {
      ahead.clear();
    },

    /** What is to be done with the chosen edge, in words. */
    words() {
      if (!page.edge) return "Pick an edge below, then drag along it in the photograph, from one end to the other.";
      if (chosenPoints()) return isCurve() ? "Click more points along the curve; drag a point to move it." : "Drag the handles; arrow keys move one by a quarter of a pixel.";
      if (isCorner()) return "Click the corner in the photograph.";
      return isCurve() ? "Click points along the curve in the photograph, two or more." : "Drag along the edge in the photograph, from one end to the other.";
    },

    /** Lay the chosen edge by the keyboard. */
    put: () => page.edge && !chosenPoints() && write(page.block, page.edge, proposed()),

    /** Take out the point whose handle has the focus, or the whole mark where two points would be too few. */
    remove() {
      const found = chosenPoints(), handle = /** @type {any} */ (document.activeElement)?.dataset?.handle, least = isCurve() ? 1 : 2;
      if (!found) return;
      const left = handle === undefined || found.length <= least ? null : found.filter((_, i) => String(i) !== handle);
      write(page.block, page.edge, left);
    },

    /** @param {PointerEvent} event @param {"begin" | "move" | "end"} phase */
    drag(event, phase) {
      const [x, y] = hundredths(...page.overlay.at(event));
      if (phase === "begin") {
        if (!drawing() || event.shiftKey) return false;
        draft = [[x, y], [x, y]];
      } else if (draft) draft[1] = [x, y];
      page.overlay.look(phase === "end" ? null : event);
      if (phase === "end" && draft) {
        const [[ax, ay], [bx, by]] = draft, length = Math.hypot(bx - ax, by - ay) * page.canvas.view.zoom, made = draft;
        draft = null;
        if (length >= SHORT) write(page.block, page.edge, made);
        else if (!this.choose(x, y)) page.say(this.words());
      }
      page.drawn();
      return true;
    },

    /** Choose the mark at a point of the photograph, if there is one. @param {number} x @param {number} y */
    choose(x, y) {
      const [nearest] = all().map((each) => ({ ...each, away: away(each.points, x, y) })).sort((a, b) => a.away - b.away);
      if (!nearest || nearest.away > NEAR) return false;
      page.pick(nearest.block, nearest.edge);
      return true;
    },

    /** @param {number} x @param {number} y */
    clicked(x, y) {
      const found = chosenPoints();
      if (page.edge && isCurve()) write(page.block, page.edge, [...(found ?? []), hundredths(x, y)]);
      else if (page.edge && isCorner() && !found) write(page.block, page.edge, [hundredths(x, y)]);
      else this.choose(x, y);
    },

    /** Look closely before an edge is begun. @param {PointerEvent | null} event */
    hovered(event) {
      page.overlay.look(event && (drawing() || (page.edge && (isCurve() || (isCorner() && !chosenPoints())))) ? event : null);
    },

    /** @returns {import("../studio/overlay.js").Drawing} */
    drawing() {
      /** @type {import("../studio/overlay.js").Line[]} */ const lines = [];
      /** @type {import("../studio/overlay.js").Point[]} */ const dots = [];
      /** @type {import("../studio/overlay.js").Words[]} */ const words = [];
      /** @type {[number, number, number][]} */ const written = [];
      /** The first row below a place that no words stand in yet. @param {number} x @param {number} y @param {string} text */
      const freeRow = (x, y, text) => {
        const [left, top] = page.canvas.toScreen(x, y).map((each) => (each * page.canvas.canvas.clientWidth) / page.canvas.width), right = left + LETTER * text.length;
        const taken = (/** @type {number} */ row) => written.some(([a, b, c]) => a < right && c > left && Math.abs(b - top - ROW * row) < ROW);
        const row = [0, 1, -1, 2, -2].find((each) => !taken(each)) ?? 0;
        written.push([left, top + ROW * row, right]);
        return row;
      };
      const { found, stale } = page.state, distances = found?.distances[page.photograph] ?? {};
      // First, whether they are there or not, so that marks lie over them.
      for (const { name } of page.blocks) {
        const edges = page.foundShown ? found?.lines[page.photograph]?.[name] ?? {} : {};
        const d = Object.values(/** @type {Record<string, Points>} */ (edges)).filter((each) => each.length > 1);
        lines.push({ key: `found ${name}`, d, className: stale ? "stale" : "found" });
      }
      for (const { block, edge, points: mark } of all()) {
        const name = `${block}.${edge}`, chosen = block === page.block && edge === page.edge, off = ahead.size ? undefined : distances[block]?.[edge];
        if (mark.length === 2) lines.push({ key: name, d: [mark], className: chosen ? "chosen" : "mark" });
        if (!chosen) mark.forEach(([x, y], i) => dots.push({ key: `${name} ${i}`, x, y }));
        if (!chosen && !page.namesShown) continue;
        const [x, y] = mark.length === 2 ? [0, 1].map((i) => (mark[0][i] + mark[1][i]) / 2) : mark[0];
        const text = off ? `${name} ${rms(off).toFixed(2)}` : name;
        words.push({ key: name, x, y, text, row: freeRow(x, y, text) });
      }
      if (draft) lines.push({ key: "draft", d: [draft], className: "chosen" });
      const own = draft ? null : chosenPoints();
      return { lines, points: dots, words, handles: (own ?? []).map(([x, y], i) => ({
        key: String(i), x, y, label: `Point ${i + 1} of ${page.block}.${page.edge}`,
        moved: (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) => {
          const moved = /** @type {Points} */ (own).map((each, j) => (i === j ? hundredths(a, b) : each));
          ahead.set(key(page.photograph, page.block, page.edge), moved);
          if (done) write(page.block, page.edge, moved);
          else page.drawn();
        },
      })) };
    },
  };
}

/** @param {number[]} values */
export const rms = (values) => Math.sqrt(values.reduce((sum, each) => sum + each * each, 0) / Math.max(values.length, 1));
