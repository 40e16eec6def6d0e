// What is known of a block: its kind, what it stands on, its sizes, sides and turn as numbers or as another block's; new
// blocks, and lengths that were measured.

import { at, make } from "../studio/fields.js";

/** @typedef {import("./place.js").PlacePage} PlacePage */

const SIZES = ["width", "height", "depth"];
const SIDES = [["x", "left", "centre_x", "right"], ["y", "bottom", "centre_y", "top"], ["z", "back", "centre_z", "front"]];
let fields = 0;

/** The block's table: every constraint that the place file knows. @param {PlacePage} page @param {number} number of the block */
export function known(page, number) {
  const block = page.blocks[number], above = page.blocks.slice(0, number).map((each) => each.name), place = ["blocks", number];
  if (!block) return [];
  const words = (/** @type {string[]} */ names) => above.flatMap((each) => names.map((name) => `${each}.${name}`));
  return [
    choice(page, "Kind", [...place, "kind"], page.state.kinds),
    choice(page, "Stands on", [...place, "on"], ["", ...above], ["the ground"]),
    ...SIZES.map((size) => valueField(page, size[0].toUpperCase() + size.slice(1), [...place, size], words([size]), "found")),
    ...SIDES.map(([axis, ...names]) => sideField(page, axis, names, place, words)),
    valueField(page, "Turn", [...place, "turn"], ["unknown", ...above], "as the first"),
    mirrorField(page, place, above, words),
    ...(block.kind === "revolution" ? [profileField(page, place)] : []),
    make("div", { className: "row" }, make("button", { type: "button", onclick: () => removeBlock(page, number) }, `Take out ${block.name}`)),
  ];
}

/** Take a block out with its marks. @param {PlacePage} page @param {number} number */
function removeBlock(page, number) {
  const { name } = page.blocks[number], marks = Object.entries(page.state.table.marks ?? {});
  const marked = marks.filter(([, of]) => /** @type {any} */ (of)[name] !== undefined).map(([photograph]) => ({ remove: ["marks", photograph, name] }));
  return page.edit([...marked, { remove: ["blocks", number] }]);
}

/** A form for a new block. @param {PlacePage} page */
export function adding(page) {
  const names = page.blocks.map((each) => each.name), id = ++fields;
  const name = make("input", { type: "text", id: `new-name-${id}`, placeholder: "annex" });
  const kind = make("select", { id: `new-kind-${id}` }, ...page.state.kinds.map((/** @type {string} */ each) => make("option", { value: each }, each)));
  const on = make("select", { id: `new-on-${id}` }, ...["", ...names].map((each) => make("option", { value: each }, each || "the ground")));
  const add = async () => {
    const made = name.value.trim();
    if (!made) return page.say("give the block a name of its own");
    const done = await page.edit([{ append: ["blocks"], value: { name: made, kind: kind.value, ...(on.value ? { on: on.value } : {}) } }]);
    if (done) page.pick(made, "");
    return undefined;
  };
  const row = (/** @type {string} */ text, /** @type {HTMLElement} */ field) => make("div", { className: "row" }, make("label", { for: field.id }, text), field);
  return [row("Name", name), row("Kind", kind), row("Stands on", on), make("div", { className: "row" }, make("button", { type: "button", onclick: add, id: "add-block" }, "Add the block"))];
}

/** Lengths that were measured between corners. @param {PlacePage} page */
export function lengths(page) {
  const corners = Object.entries(page.state.bodies).flatMap(([block, body]) => /** @type {any} */ (body).corners.map((/** @type {string} */ each) => `${block}.${each}`));
  const list = page.state.table.lengths ?? [], id = ++fields;
  const suggested = make("datalist", { id: `corners-${id}` }, ...corners.map((/** @type {string} */ each) => make("option", { value: each })));
  const ends = ["From", "To"].map((text) => {
    const field = make("input", { type: "text", id: `length-${text}-${id}`, placeholder: corners[0] ?? "" });
    field.setAttribute("list", suggested.id);
    return field;
  });
  const metres = make("input", { type: "number", step: "any", id: `length-metres-${id}` });
  const add = () => page.edit([{ append: ["lengths"], value: { between: ends.map((each) => each.value), metres: Number(metres.value) } }]);
  return [
    make("ul", { className: "lengths" }, ...list.map((/** @type {any} */ each, /** @type {number} */ i) => make("li", {},
      make("span", {}, `${each.between?.join(" – ")}: ${each.metres} m`),
      make("button", { type: "button", ariaLabel: `Take out length ${i + 1}`, onclick: () => page.edit([{ remove: ["lengths", i] }]) }, "−")))),
    suggested,
    ...ends.map((each, i) => make("div", { className: "row" }, make("label", { for: each.id }, ["From", "To"][i]), each)),
    make("div", { className: "row" }, make("label", { for: metres.id }, "Metres"), metres, make("button", { type: "button", onclick: add }, "Add the length")),
  ];
}

/** What a field's text means: nothing, a number, or words. @param {string} text */
const meant = (text) => (text.trim() === "" ? undefined : Number.isFinite(Number(text)) ? Number(text) : text.trim());

/** @param {(string | number)[]} place @param {any} value */
const change = (place, value) => (value === undefined ? { remove: place } : { set: place, value });

/** A number of metres, or another block's. @param {PlacePage} page @param {string} text @param {(string | number)[]} place @param {string[]} suggestions
 *  @param {string} empty what it is while nothing is given */
function valueField(page, text, place, suggestions, empty) {
  const { input, list } = textField(page, place, suggestions, empty, (value) => change(place, value));
  return make("div", { className: "row" }, make("label", { for: input.id }, text), input, list);
}

/** @param {PlacePage} page @param {(string | number)[]} place @param {string[]} suggestions @param {string} empty @param {(value: any) => any} changed */
function textField(page, place, suggestions, empty, changed) {
  const id = `known-${++fields}`, before = at(page.state.table, place);
  const list = make("datalist", { id: `${id}-list` }, ...suggestions.map((each) => make("option", { value: each })));
  const input = make("input", { type: "text", id, value: before ?? "", placeholder: empty, data: { place: place.join(".") },
    onchange: () => meant(input.value) !== before && page.edit([changed(meant(input.value))]) });
  input.setAttribute("list", list.id);
  return { input, list };
}

/** Which side of an axis is given, and where that lies. @param {PlacePage} page @param {string} axis @param {string[]} names @param {(string | number)[]} place
 *  @param {(names: string[]) => string[]} words */
function sideField(page, axis, names, place, words) {
  const table = at(page.state.table, place), given = names.find((each) => table[each] !== undefined), side = given ?? names[1];
  const { input, list } = textField(page, [...place, side], words(names), axis === "y" ? "as it stands" : "found", (value) => change([...place, select.value], value));
  const select = make("select", { ariaLabel: `Side along ${axis}`, onchange: () =>
    given && page.edit([{ remove: [...place, given] }, { set: [...place, select.value], value: table[given] }]) },
    ...names.map((each) => make("option", { value: each, selected: each === side }, each)));
  input.setAttribute("aria-label", `Where the side along ${axis} lies`);
  return make("div", { className: "row side" }, select, input, list);
}

/** @param {PlacePage} page @param {(string | number)[]} place @param {string[]} above @param {(names: string[]) => string[]} words */
function mirrorField(page, place, above, words) {
  const before = at(page.state.table, [...place, "mirrored"]), name = `mirror-${++fields}`;
  const of = make("select", { id: name }, ...["", ...above].map((each) => make("option", { value: each, selected: each === (before?.of ?? "") }, each || "none")));
  const across = make("input", { type: "text", value: before?.across ?? "", placeholder: "across house.centre_x", ariaLabel: "Across which plane" });
  const list = make("datalist", { id: `${name}-list` }, ...words(["left", "centre_x", "right", "back", "centre_z", "front"]).map((each) => make("option", { value: each })));
  across.setAttribute("list", list.id);
  across.setAttribute("aria-label", "Across which plane");
  const changed = () => {
    if (!of.value && before) return page.edit([{ remove: [...place, "mirrored"] }]);
    if (of.value && across.value.trim()) return page.edit([{ set: [...place, "mirrored"], value: { of: of.value, across: across.value.trim() } }]);
    return undefined;
  };
  of.addEventListener("change", changed);
  across.addEventListener("change", changed);
  return make("div", { className: "row side" }, make("label", { for: name }, "Mirrored"), of, across, list);
}

/** A revolution's profile, as the file has it. @param {PlacePage} page @param {(string | number)[]} place */
function profileField(page, place) {
  const before = at(page.state.table, [...place, "profile"]), id = `profile-${++fields}`;
  const input = make("input", { type: "text", id, value: before ? JSON.stringify(before) : "", placeholder: "[[1, 0], [1, 1]]", onchange: () => {
    try {
      return page.edit([change([...place, "profile"], input.value.trim() ? JSON.parse(input.value) : undefined)]);
    } catch {
      return page.say("a profile is a list of (radius, height) from the bottom to the top, as shares: [[1, 0], [1, 1]]");
    }
  } });
  return make("div", { className: "row" }, make("label", { for: id }, "Profile"), input);
}

/** @param {PlacePage} page @param {string} text @param {(string | number)[]} place @param {string[]} values @param {string[]} [shown] of the first of them */
function choice(page, text, place, values, shown = []) {
  const id = `choice-${++fields}`, before = at(page.state.table, place) ?? "";
  const select = make("select", { id, onchange: () => page.edit([change(place, select.value || undefined)]) },
    ...values.map((each, i) => make("option", { value: each, selected: each === before }, shown[i] ?? each)));
  return make("div", { className: "row" }, make("label", { for: id }, text), select);
}
