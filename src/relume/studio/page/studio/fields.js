// Small parts of panes: elements, fields that edit one place of the shot file, and what one would type instead.

/** @template {keyof HTMLElementTagNameMap} K @param {K} name @param {Record<string, any>} [given]
 *  @param {(Node | string)[]} inside @returns {HTMLElementTagNameMap[K]} */
export function make(name, given = {}, ...inside) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(given)) {
    if (key === "data") Object.assign(made.dataset, value);
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key.startsWith("aria") || key === "for" || key === "role") made.setAttribute(key.replace("aria", "aria-").toLowerCase(), value);
    else /** @type {any} */ (made)[key] = value;
  }
  made.append(...inside);
  return made;
}

/** What stands at a place of a table. @param {any} table @param {(string | number)[]} place */
export const at = (table, place) => place.reduce((here, part) => (here === undefined || here === null ? undefined : here[part]), table);

/** To six digits after the point, as a shot file is written. @param {number} value */
export const rounded = (value) => Math.round(value * 1e6) / 1e6;

let numbers = 0;

/** A number of the shot file. @param {any} studio @param {string} text @param {(string | number)[]} place
 *  @param {{otherwise?: number, unit?: string, step?: number, min?: number, max?: number, whole?: boolean, range?: boolean, found?: number}} [options]
 *  found: what it is where the file does not say it */
export function numberField(studio, text, place, options = {}) {
  const id = `field-${++numbers}`, value = at(studio.state.table, place) ?? options.otherwise;
  const input = make("input", {
    id, type: options.range ? "range" : "number", step: options.step ?? "any", value: value ?? "", data: { place: place.join(".") },
    onchange: () => {
      if (input.value === "") return studio.edit([{ remove: place }]);
      const given = Number(input.value);
      return studio.edit([{ set: place, value: options.whole ? Math.round(given) : rounded(given) }]);
    },
  });
  if (options.found !== undefined) input.placeholder = String(Number(options.found.toPrecision(4)));
  if (options.min !== undefined) input.min = String(options.min);
  if (options.max !== undefined) input.max = String(options.max);
  if (options.range) input.value = String(value ?? 0);
  const said = make("span", {}, options.range ? `${value ?? 0}${options.unit ?? ""}` : options.unit ?? "");
  if (options.range) input.addEventListener("input", () => (said.textContent = `${input.value}${options.unit ?? ""}`));
  return make("div", { className: "row" }, make("label", { for: id }, text), input, said);
}

/** Several numbers that stand together. @param {any} studio @param {string} text @param {(string | number)[]} place
 *  @param {string[]} names @param {string} [unit] */
export function vectorField(studio, text, place, names, unit = "m") {
  const value = at(studio.state.table, place) ?? [];
  const inputs = names.map((name, i) => make("input", {
    type: "number", step: "any", value: value[i] ?? "", ariaLabel: `${text} ${name}`, placeholder: name, data: { place: place.join(".") },
    onchange: () => {
      if (inputs.some((each) => each.value === "")) return undefined;
      return studio.edit([{ set: place, value: inputs.map((each) => rounded(Number(each.value))) }], true);
    },
  }));
  for (const each of inputs) each.setAttribute("aria-label", `${text} ${each.placeholder}`);
  return make("div", { className: "row vector", role: "group" }, make("label", {}, text), ...inputs, unit);
}

/** @param {any} studio @param {string} text @param {(string | number)[]} place @param {[string, any][]} choices @param {any} otherwise */
export function choiceField(studio, text, place, choices, otherwise) {
  const id = `field-${++numbers}`, value = JSON.stringify(at(studio.state.table, place) ?? otherwise);
  const select = make("select", { id, onchange: () => studio.edit([{ set: place, value: JSON.parse(select.value) }]) },
    ...choices.map(([name, each]) => make("option", { value: JSON.stringify(each), selected: JSON.stringify(each) === value }, name)));
  return make("div", { className: "row" }, make("label", { for: id }, text), select);
}

/** What one would type in place of a pane. @param {string} command @param {string} python */
export function typed(command, python) {
  const line = (/** @type {string} */ text, /** @type {string} */ what) => {
    const button = make("button", { type: "button", onclick: async () => {
      await navigator.clipboard?.writeText(text);
      button.textContent = "Copied";
    } }, `Copy the ${what}`);
    return [make("pre", { className: "typed", tabIndex: 0, role: "region", ariaLabel: `The ${what}`, data: { typed: what } }, text), button];
  };
  return make("details", {}, make("summary", {}, "What would I type?"), ...line(command, "command"), ...line(python, "Python"));
}

/** A name for the command line, quoted where a shell needs it. @param {string} name */
export const quoted = (name) => (/^[\w./*-]+$/.test(name) ? name : `'${name.replaceAll("'", "'\\''")}'`);
