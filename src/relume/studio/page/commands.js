// Every act of the page by name and key: the keys, the sheet of keys and the palette are this one list.

/** @typedef {{name: string, keys: string[], act: () => void}} Command */

/** How a key press is written in the list: Ctrl+K, Shift+E, ArrowLeft, ?. @param {KeyboardEvent} event */
export function written(event) {
  const letter = event.key.length === 1 ? event.key : event.key;
  const shifted = event.shiftKey && (event.key.length > 1 || /[a-z]/i.test(event.key));
  return [event.ctrlKey || event.metaKey ? "Ctrl+" : "", event.altKey ? "Alt+" : "", shifted ? "Shift+" : "",
    letter.length === 1 ? letter.toUpperCase() : letter].join("");
}

/** Listen for the keys of the list, except where text is typed. @param {Command[]} commands */
export function listen(commands) {
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

/** The sheet of keys. @param {HTMLDialogElement} dialog @param {HTMLElement} list @param {Command[]} commands */
export function fillSheet(dialog, list, commands) {
  list.replaceChildren(...commands.filter((command) => command.keys.length).flatMap((command) => {
    const dt = document.createElement("dt"), dd = document.createElement("dd");
    for (const key of command.keys) {
      const shown = document.createElement("kbd");
      shown.textContent = key === " " ? "Space" : key.replace("Arrow", "").replace(/(?<=.)\+(?=.)/g, " ");
      dt.append(shown, " ");
    }
    dd.textContent = command.name;
    return [dt, dd];
  }));
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
}

/** The palette: type a part of a name, Enter does it. @param {HTMLDialogElement} dialog @param {Command[]} commands */
export function palette(dialog, commands) {
  const text = /** @type {HTMLInputElement} */ (dialog.querySelector("input"));
  const list = /** @type {HTMLElement} */ (dialog.querySelector("ul"));
  let chosen = 0;
  /** @type {Command[]} */ let shown = [];
  const fill = () => {
    const words = text.value.toLowerCase().split(/\s+/).filter(Boolean);
    shown = commands.filter((command) => words.every((word) => command.name.toLowerCase().includes(word)));
    chosen = Math.min(chosen, Math.max(shown.length - 1, 0));
    list.replaceChildren(...shown.map((command, place) => {
      const item = document.createElement("li"), name = document.createElement("span"), key = document.createElement("kbd");
      item.setAttribute("role", "option");
      item.id = `command-${place}`;
      item.setAttribute("aria-selected", String(place === chosen));
      name.textContent = command.name;
      key.textContent = command.keys[0] ?? "";
      item.append(name, ...(command.keys.length ? [key] : []));
      item.addEventListener("click", () => run(place));
      return item;
    }));
    text.setAttribute("aria-activedescendant", `command-${chosen}`);
    list.children[chosen]?.scrollIntoView({ block: "nearest" });
  };
  const run = (/** @type {number} */ place) => {
    dialog.close();
    shown[place]?.act();
  };
  text.addEventListener("input", () => ((chosen = 0), fill()));
  text.addEventListener("keydown", (event) => {
    if (event.key === "ArrowDown" || event.key === "ArrowUp") {
      chosen = (chosen + (event.key === "ArrowDown" ? 1 : shown.length - 1)) % Math.max(shown.length, 1);
      fill();
    } else if (event.key === "Enter") run(chosen);
    else return;
    event.preventDefault();
  });
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  return () => {
    text.value = "";
    chosen = 0;
    fill();
    dialog.showModal();
    text.focus();
  };
}
