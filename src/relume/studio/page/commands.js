// Every act of the page by name and key: the keys, the sheet of keys and the palette are this one list.

/** @typedef {{name: string, keys: string[], act: () => void}} Command */

/** How a key press is written in the list: Ctrl+K, Shift+E, ArrowLeft, ?. @param {KeyboardEvent} event */
export function written(event) {
  const shifted = event.shiftKey && (event.key.length > 1 || /[a-z]/i.test(event.key));
  return [event.ctrlKey || event.metaKey ? "Ctrl+" : "", event.altKey ? "Alt+" : "", shifted ? "Shift+" : "",
    event.key.length === 1 ? event.key.toUpperCase() : event.key].join("");
}

/** Listen for the keys of the list, except where text is typed. @param {Command[]} commands */
function listen(commands) {
  document.addEventListener("keydown", (event) => {
    const target = /** @type {HTMLElement} */ (event.target);
    if (document.querySelector("dialog[open]")) return;
    const typed = written(event);
    const inField = target instanceof HTMLInputElement && !typed.startsWith("Alt+"); // which types nothing
    if (inField && (target.type !== "range" || typed.startsWith("Arrow"))) return;
    if (target instanceof HTMLButtonElement && (event.key === " " || event.key === "Enter")) return;
    if (target.getAttribute("role") === "slider" && typed.startsWith("Arrow")) return;
    const found = commands.find((command) => command.keys.includes(typed));
    if (!found) return;
    event.preventDefault();
    found.act();
  });
}

/** A key as it stands on the keyboard. @param {string} key */
function keyCap(key) {
  const cap = document.createElement("kbd");
  cap.textContent = key === " " ? "Space" : key.replace("Arrow", "").replace(/(?<=.)\+(?=.)/g, " ");
  return cap;
}

/** The sheet of keys. @param {Command[]} commands */
function sheet(commands) {
  const dialog = document.createElement("dialog");
  dialog.id = "sheet";
  dialog.setAttribute("aria-labelledby", "sheet-title");
  dialog.innerHTML = `<h2 id="sheet-title">Keys</h2><dl id="keys"></dl><form method="dialog"><button>Close</button></form>`;
  const list = /** @type {HTMLElement} */ (dialog.querySelector("dl"));
  list.replaceChildren(...commands.filter((command) => command.keys.length).flatMap((command) => {
    const dt = document.createElement("dt"), dd = document.createElement("dd");
    for (const key of command.keys) dt.append(keyCap(key), " ");
    dd.textContent = command.name;
    return [dt, dd];
  }));
  shown(dialog);
  return () => {
    dialog.showModal(); // which scrolls to the button that it focuses
    dialog.scrollTop = 0;
  };
}

/** A dialog in the page, which a click beside it closes. @param {HTMLDialogElement} dialog */
function shown(dialog) {
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  document.body.append(dialog);
}

/** What opens the palette: type a part of a name, Enter does it. @param {Command[]} commands */
function palette(commands) {
  const dialog = document.createElement("dialog");
  dialog.id = "palette";
  dialog.setAttribute("aria-label", "Commands");
  dialog.innerHTML = `<input id="palette-text" type="text" role="combobox" aria-expanded="true" aria-controls="palette-list"
    aria-label="Find a command" autocomplete="off"><ul id="palette-list" role="listbox" aria-label="Commands"></ul>`;
  const text = /** @type {HTMLInputElement} */ (dialog.querySelector("input"));
  const list = /** @type {HTMLElement} */ (dialog.querySelector("ul"));
  let chosen = 0;
  /** @type {Command[]} */ let fitting = [];
  const fill = () => {
    const words = text.value.toLowerCase().split(/\s+/).filter(Boolean);
    fitting = commands.filter((command) => words.every((word) => command.name.toLowerCase().includes(word)));
    chosen = Math.min(chosen, Math.max(fitting.length - 1, 0));
    list.replaceChildren(...fitting.map((command, place) => {
      const item = document.createElement("li"), name = document.createElement("span");
      item.setAttribute("role", "option");
      item.id = `command-${place}`;
      item.setAttribute("aria-selected", String(place === chosen));
      name.textContent = command.name;
      item.append(name, ...command.keys.slice(0, 1).map(keyCap));
      item.addEventListener("click", () => run(place));
      return item;
    }));
    text.setAttribute("aria-activedescendant", `command-${chosen}`);
    list.children[chosen]?.scrollIntoView({ block: "nearest" });
  };
  const run = (/** @type {number} */ place) => {
    dialog.close();
    fitting[place]?.act();
  };
  text.addEventListener("input", () => ((chosen = 0), fill()));
  text.addEventListener("keydown", (event) => {
    if (event.key === "ArrowDown" || event.key === "ArrowUp") {
      chosen = (chosen + (event.key === "ArrowDown" ? 1 : fitting.length - 1)) % Math.max(fitting.length, 1);
      fill();
    } else if (event.key === "Enter") run(chosen);
    else return;
    event.preventDefault();
  });
  shown(dialog);
  return () => {
    text.value = "";
    chosen = 0;
    fill();
    dialog.showModal();
    text.focus();
  };
}

/** The page's commands by key, by palette and by the two buttons of its header. @param {Command[]} own */
export function begin(own) {
  const ways = [{ name: "Commands", keys: ["Ctrl+K"], act: () => find() }, { name: "Keys", keys: ["?"], act: () => list() }];
  const all = [...own, ...ways];
  const find = palette(all), list = sheet(all);
  listen(all);
  for (const { name, keys, act } of ways) {
    const button = document.createElement("button");
    Object.assign(button, { id: `open-${name.toLowerCase()}`, type: "button", title: `${name} (${keys[0]})` });
    button.append(`${name} `, keyCap(keys[0]));
    button.addEventListener("click", act);
    document.querySelector("header")?.append(button);
  }
}
