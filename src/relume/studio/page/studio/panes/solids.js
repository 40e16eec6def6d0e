// The real surfaces of a shot as they are drawn: tables, walls and boxes that stand upright, as entries of [[local]]
// and back. Lengths in metres, the turn in degrees about +Y.

import { rounded } from "../fields.js";
import { line } from "../projection.js";

/** @typedef {{kind: "table" | "wall" | "box", x: number, y: number, z: number, w: number, d: number, h: number, turn: number}} Solid the middle of
 *  its foot, its width along its own x, depth along its own z, and height */
/** @typedef {import("../projection.js").Lens} Lens */

/** A surface's own (a, up, c) in the world. @param {Solid} s @param {number} a @param {number} up @param {number} c */
export function inWorld(s, a, up, c) {
  const t = (s.turn * Math.PI) / 180, [sin, cos] = [Math.sin(t), Math.cos(t)];
  return [s.x + cos * a + sin * c, s.y + up, s.z - sin * a + cos * c];
}

/** A point of the world along a surface's own x and z. @param {Solid} s @param {number[]} p @returns {[number, number]} */
export function ofSolid(s, [x, , z]) {
  const t = (s.turn * Math.PI) / 180, [sin, cos] = [Math.sin(t), Math.cos(t)], [a, c] = [x - s.x, z - s.z];
  return [cos * a - sin * c, sin * a + cos * c];
}

/** A turn as it is written. @param {number} degrees */
export const turnOf = (degrees) => rounded(Math.round(((((degrees + 180) % 360) + 360) % 360) * 10) / 10 - 180);

/** The surface of an entry of [[local]]; null where it is of another kind, leans or is endless. @param {any} table @returns {Solid | null} */
export function solidOf(table) {
  const [lean, turn, roll] = table.rotate ?? [0, 0, 0], [x, y, z] = table.translate ?? [0, 0, 0];
  if (roll || (table.scale ?? 1) !== 1) return null;
  if (table.shape === "plane" && table.size && !lean) {
    return { kind: "table", x, y: y + (table.height ?? 0), z, w: table.size[0], d: table.size[1], h: 0, turn };
  }
  if (table.shape === "plane" && table.size && lean === 90 && !table.height) {
    return { kind: "wall", x, y: y - table.size[1] / 2, z, w: table.size[0], d: 0, h: table.size[1], turn };
  }
  if (table.shape !== "box" || lean || !table.low || !table.high) return null;
  const { low, high } = table, size = high.map((/** @type {number} */ each, /** @type {number} */ i) => each - low[i]);
  const middle = inWorld({ kind: "box", x, y, z, w: 0, d: 0, h: 0, turn }, (low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2);
  return { kind: "box", x: middle[0], y: middle[1], z: middle[2], w: size[0], d: size[2], h: size[1], turn };
}

/** What an entry of [[local]] says of a surface's shape and place. @param {Solid} s @param {any} [before] the entry as it is
 *  @returns {Record<string, any>} */
export function placed(s, before = {}) {
  if (s.kind === "wall") {
    return { shape: "plane", size: [s.w, s.h].map(rounded), rotate: [90, turnOf(s.turn), 0], translate: [s.x, s.y + s.h / 2, s.z].map(rounded) };
  }
  const rotate = s.turn ? { rotate: [0, turnOf(s.turn), 0] } : {};
  if (s.kind === "table") {
    const raised = before.translate?.[1] ?? 0, height = rounded(s.y - raised), middle = [s.x, raised, s.z].map(rounded);
    return { shape: "plane", size: [s.w, s.d].map(rounded), ...(height || before.height !== undefined ? { height } : {}), ...rotate,
      ...(middle.some((each) => Math.abs(each) > 1e-4) ? { translate: middle } : {}) };
  }
  const low = [-s.w / 2, 0, -s.d / 2], high = [s.w / 2, s.h, s.d / 2], foot = [s.x, s.y, s.z];
  if (s.turn) return { shape: "box", low: low.map(rounded), high: high.map(rounded), ...rotate, translate: foot.map(rounded) };
  return { shape: "box", low: low.map((each, i) => rounded(each + foot[i])), high: high.map((each, i) => rounded(each + foot[i])) };
}

/** The edits that put an entry of [[local]] where a surface is drawn. @param {number} i @param {any} before @param {Solid} s @returns {any[]} */
export function edits(i, before, s) {
  const now = placed(s, before), keys = ["size", "height", "low", "high", "rotate", "translate"];
  const changed = keys.filter((key) => JSON.stringify(now[key]) !== JSON.stringify(before[key]));
  return changed.map((key) => (now[key] === undefined ? { remove: ["local", i, key] } : { set: ["local", i, key], value: now[key] }));
}

/** A wall between two points of the table; it faces the camera. @param {Lens} lens @param {number[]} from @param {number[]} to @param {number} h @returns {Solid} */
export function wallBetween(lens, from, to, h) {
  const [x, z] = [(from[0] + to[0]) / 2, (from[2] + to[2]) / 2], w = Math.max(Math.hypot(to[0] - from[0], to[2] - from[2]), 0.01);
  let [a, c] = [(to[0] - from[0]) / w, (to[2] - from[2]) / w];
  if (-c * (lens.position[0] - x) + a * (lens.position[2] - z) < 0) [a, c] = [-a, -c];
  return { kind: "wall", x, y: from[1], z, w, d: 0, h, turn: (Math.atan2(-c, a) * 180) / Math.PI };
}

/** The rectangle between two points of a level plane. @param {"table" | "box"} kind @param {number[]} from @param {number[]} to @param {number} h @returns {Solid} */
export const between = (kind, from, to, h) => ({ kind, x: (from[0] + to[0]) / 2, y: from[1], z: (from[2] + to[2]) / 2,
  w: Math.max(Math.abs(to[0] - from[0]), 0.01), d: Math.max(Math.abs(to[2] - from[2]), 0.01), h, turn: 0 });

/** Its corners: the foot, then the top of what has a height. @param {Solid} s */
export function corners(s) {
  const round = s.kind === "wall" ? [[-1, 0], [1, 0]] : [[-1, -1], [1, -1], [1, 1], [-1, 1]];
  return (s.h ? [0, s.h] : [0]).map((up) => round.map(([a, c]) => inWorld(s, (a * s.w) / 2, up, (c * s.d) / 2)));
}

/** Its edges as lines of the picture: what is closed is filled. @param {Lens} lens @param {Solid} s @param {string} key @param {boolean} chosen
 *  @returns {import("../overlay.js").Line[]} */
export function outline(lens, s, key, chosen) {
  const [foot, top] = corners(s), ring = (/** @type {number[][]} */ of) => of.flatMap((each, i) => line(lens, each, of[(i + 1) % of.length]));
  const className = chosen ? "filled" : "thin";
  if (s.kind === "wall") return [{ key, closed: true, className, d: [[[foot[0], foot[1]], [foot[1], top[1]], [top[1], top[0]], [top[0], foot[0]]].flatMap(([a, b]) => line(lens, a, b))] }];
  if (s.kind === "table") return [{ key, closed: true, className, d: [ring(foot)] }];
  return [{ key, closed: true, className, d: [ring(foot), ring(top)] },
    { key: `${key} edges`, className: chosen ? "" : "thin", d: foot.map((each, i) => line(lens, each, top[i])) }];
}
