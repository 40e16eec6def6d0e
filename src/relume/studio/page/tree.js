// The tree of rays behind a pixel: what each kind of ray brings, and that it adds up to the pixel's value.

import { plain } from "./measured.js";

/** @typedef {{kind: "eye" | "S" | "T" | "L", parent: number, shape: string | null, light: number, weight: number[],
 *   intensity: number[], sent: number[]}} Node */
/** @typedef {{x: number, y: number, nodes: Node[], rays: number, left_out: number[], sum: number[]}} Tree */

const NAMES = { eye: "from the eye", S: "S, reflected", T: "T, refracted", L: "L, towards a light" };

/** @param {string} kind @param {string} text @param {string} [title] */
function made(kind, text, title = "") {
  const found = document.createElement(kind);
  found.textContent = text;
  if (title) found.title = title;
  return found;
}

/** @param {number[]} values */
const three = (values) => values.map((each) => plain(Number(each.toPrecision(4)))).join("  ");

/** Draw it: each ray below the one at whose end it begins. @param {HTMLElement} place @param {Tree} tree
 *  @param {number[] | null} pixel the picture's own value there */
export function drawTree(place, tree, pixel) {
  const said = made("p", `pixel ${tree.x}, ${tree.y}: ${tree.rays} ${tree.rays === 1 ? "ray" : "rays"}`);
  said.className = "said";
  const root = document.createElement("ul");
  root.className = "rays";
  /** @type {HTMLElement[]} */ const lists = [];
  tree.nodes.forEach((node, number) => {
    const item = document.createElement("li"), below = document.createElement("ul"), line = document.createElement("div");
    const badge = made("b", node.kind, NAMES[node.kind]);
    badge.className = `kind ${node.kind}`;
    const where = node.kind === "L" ? `light ${node.light + 1}${node.shape ? `, through ${node.shape}` : ""}` : node.shape ?? "sky";
    line.append(badge, made("span", where), made("span", `× ${plain(Number(Math.max(...node.weight).toPrecision(3)))}`,
      "the share of the pixel that its radiance has"), made("span", three(node.intensity), "radiance; below: what it adds by itself"));
    item.append(line, below);
    item.dataset.node = String(number);
    lists.push(below);
    (node.parent < 0 ? root : lists[node.parent]).append(item);
  });
  for (const list of lists) if (!list.children.length) list.remove();
  const sums = made("p", `all rays add up to ${three(tree.sum)}`
    + (tree.nodes.length < tree.rays ? `, of which ${three(tree.left_out)} by ${tree.rays - tree.nodes.length} weak ones not drawn` : "")
    + (pixel ? `; the picture has ${three(pixel)}${alike(tree.sum, pixel) ? "" : ", the mean of several trees"}` : ""));
  sums.className = "said sums";
  place.replaceChildren(said, root, sums);
}

/** To the picture's float32. @param {number[]} one @param {number[]} other */
const alike = (one, other) => one.every((each, i) => Math.abs(each - other[i]) <= 1e-5 * Math.max(Math.abs(each), 1e-6));
