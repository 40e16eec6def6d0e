// The rim of the ball in one view: sought, drawn, dragged, kept in the shot file, and the light that it would show.

import { at } from "../fields.js";
import { post, Refused } from "../../requests.js";

/** @typedef {ReturnType<typeof ballRim>} BallRim */

/** @param {import("../studio.js").Studio} studio @param {number} view
 *  @param {{drawn: () => void, unwrapped: (rim: BallRim) => Promise<void>, found: () => void}} calls drawn: what is drawn of it changed; unwrapped: its
 *  map came; found: it was sought and found, or not */
export function ballRim(studio, view, calls) {
  /** The number of the frame that is looked at; one of the brighter ones where it is none. */
  let frame = -1;
  /** x, y, radius as it is drawn. @type {number[] | null} */ let rim = null;
  /** @type {[number, number][]} */ let points = [];
  /** @type {number[] | null | undefined} */ let wanted;
  let way = "pick", said = "", number = -1, asking = false, inFile = "", begun = "";

  const files = () => studio.state.balls[view] ?? [];
  const path = () => files()[frame >= 0 && frame < files().length ? frame : Math.floor((files().length - 1) * 0.8)] ?? "";
  const table = () => at(studio.state.table, ["light", "balls", view]) ?? {};

  /** The rim that the shot file has, as a circle. */
  function kept() {
    const given = table().rim ?? table().pick;
    if (table().rim) way = "rim";
    else if (table().pick) way = "pick";
    return Array.isArray(given) && given.length === 3 ? [...given] : null;
  }

  /** Unwrap what is drawn; of many wishes the latest alone is asked. @param {number[] | null} asked null to search */
  async function unwrap(asked) {
    wanted = asked;
    if (asking || !path()) return;
    asking = true;
    while (wanted !== undefined) {
      const now = wanted;
      wanted = undefined;
      if (!now) said = "seeking the ball …";
      await studio.attempt(async () => {
        try {
          const found = await post("/ball", { path: path(), rim: now });
          if (wanted !== undefined) return;
          if (!now) rim = found.rim;
          points = now ? [] : found.points;
          number = found.number;
          said = `rim ${rim?.map((each) => each.toFixed(1)).join(", ")}${now ? "" : `; an edge was seen along ${Math.round(100 * found.coverage)} % of it`}; `
            + `${(100 * found.unseen / (4 * Math.PI)).toFixed(0)} % of all directions are unseen from here`
            + found.doubts.map((/** @type {string} */ each) => `; ${each}`).join("");
          await calls.unwrapped(result);
        } catch (error) {
          said = error instanceof Error ? error.message : String(error);
          const candidates = error instanceof Refused ? error.content?.candidates : null;
          if (candidates?.length && !rim) rim = [...candidates[0]];
        }
      });
      if (now === null) calls.found();
      calls.drawn();
    }
    asking = false;
  }

  function write() {
    if (!rim) return;
    const value = rim.map((each) => Math.round(each * 100) / 100), other = way === "rim" ? "pick" : "rim";
    studio.edit([...(table()[other] ? [{ remove: ["light", "balls", view, other] }] : []), { set: ["light", "balls", view, way], value }], true);
  }

  /** @param {number[]} now @param {boolean} done */
  function follow(now, done) {
    rim = now;
    points = [];
    calls.drawn();
    unwrap(rim);
    if (done) write();
  }

  const result = {
    view, files, path, table, write,
    get rim() {
      return rim;
    },
    get said() {
      return said;
    },
    /** Of the map that this view shows, in the library. */
    get number() {
      return number;
    },
    get way() {
      return way;
    },
    /** @param {string} wanted */
    set way(wanted) {
      way = wanted;
      write();
    },
    /** @param {number} chosen */
    set frame(chosen) {
      frame = chosen;
      unwrap(rim);
    },
    /** The rim as the file has it, or sought; again only where that is of other photographs than before. @param {boolean} [anew] */
    begin(anew = false) {
      if (!anew && begun === path() && inFile === JSON.stringify(kept())) return;
      begun = path();
      rim = kept();
      inFile = JSON.stringify(rim);
      points = [];
      unwrap(rim);
    },
    find() {
      rim = null;
      unwrap(null);
    },
    /** What the file says counts when it changes there, not while a handle is dragged. */
    changed() {
      const circle = kept(), now = JSON.stringify(circle);
      if (now === inFile) return;
      inFile = now;
      if (!circle || now === JSON.stringify(rim?.map((each) => Math.round(each * 100) / 100))) return;
      rim = circle;
      unwrap(rim);
    },
    /** @returns {import("../overlay.js").Drawing} */
    drawing() {
      if (!rim) return {};
      const [x, y, r] = rim;
      const circle = /** @type {[number, number][]} */ (Array.from({ length: 180 }, (_, i) => [x + r * Math.cos((i * Math.PI) / 90), y + r * Math.sin((i * Math.PI) / 90)]));
      const reach = (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) => follow([x, y, Math.max(3, Math.hypot(a - x, b - y))], done);
      return {
        lines: [{ key: "rim", d: [circle], closed: true }],
        points: points.map(([a, b], i) => ({ key: String(i), x: a, y: b })),
        handles: [
          { key: "middle", x, y, label: `The ball's middle${studio.state.balls.length > 1 ? ` in view ${view + 1}` : ""}`,
            moved: (/** @type {number} */ a, /** @type {number} */ b, /** @type {boolean} */ done) => follow([a, b, r], done) },
          ...[["right", 1, 0], ["below", 0, 1], ["left", -1, 0], ["above", 0, -1]].map(([key, a, b]) => ({
            key: String(key), x: x + Number(a) * r, y: y + Number(b) * r, moved: reach,
            label: `The ball's rim, ${key}${studio.state.balls.length > 1 ? `, in view ${view + 1}` : ""}`,
          })),
        ],
      };
    },
  };
  return result;
}
