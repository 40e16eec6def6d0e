// Which photographs of the folder belong to the place: one is left out with its marks, or taken in.

import { make } from "../studio/fields.js";

/** @typedef {import("./place.js").PlacePage} PlacePage */

/** @param {PlacePage} page */
export function choosing(page) {
  const number = page.photographs.findIndex((each) => each.name === page.photograph), shown = page.photographs[number];
  return [
    ...(shown ? [make("div", { className: "row" }, make("button", { type: "button", id: "leave-out", onclick: () => leaveOut(page, number) }, `Leave ${shown.name} out`))] : []),
    ...(page.others.length ? [make("p", {}, "In the folder, and not in the place:")] : []),
    ...page.others.map((file) => make("div", { className: "row" }, make("button", { type: "button", data: { take: file }, onclick: () => takeIn(page, file) }, `Take ${file} in`))),
  ];
}

/** Of a photograph that is left out the marks go too; Undo brings both back. @param {PlacePage} page @param {number} number */
async function leaveOut(page, number) {
  const { name } = page.photographs[number], marked = page.state.table.marks?.[name] !== undefined;
  await page.edit([...(marked ? [{ remove: ["marks", name] }] : []), { remove: ["photographs", number] }]);
  return page.lookForOthers();
}

/** @param {PlacePage} page @param {string} file */
async function takeIn(page, file) {
  const names = page.photographs.map((each) => each.name), plain = (/** @type {string} */ text) => text.replaceAll(/[^\p{L}\p{N}_-]+/gu, "_");
  const stem = plain(/** @type {string} */ (file.split("/").pop()).replace(/\.[^.]*$/, "")), name = names.includes(stem) ? plain(file) : stem;
  if (await page.edit([{ append: ["photographs"], value: { name, file } }])) await page.show(name);
  return page.lookForOthers();
}
