// Photographs: the folder sorted into brackets; which is the plate, which show the ball, and which frames count.

import { json, upload } from "../../requests.js";
import { make, quoted, typed } from "../fields.js";

/** Exposure times as photographers write them. @param {number} s */
const shutter = (s) => (s >= 0.4 ? `${Number(s.toPrecision(2))} s` : `1/${Math.round(1 / s)} s`);

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function photographsPane(studio) {
  let shown = "";
  let dragged = "";

  /** What a bracket is in the shot: "plate", "ball 1", …, "board", "map" or "". @param {any} bracket */
  function role(bracket) {
    const paths = bracket.frames.map((/** @type {any} */ each) => each.path), { table } = studio.state;
    if (paths.some((/** @type {string} */ path) => studio.state.plate.includes(path))) return "plate";
    const view = studio.state.balls.findIndex((/** @type {string[]} */ files) => paths.some((/** @type {string} */ path) => files.includes(path)));
    if (view >= 0) return `ball ${view}`;
    if (paths.includes(table.camera?.grid?.photograph)) return "board";
    return paths.includes(table.light?.map) ? "map" : "";
  }

  /** A bracket whose frames have several roles, as so many. @param {any} bracket @returns {any[]} */
  function parted(bracket) {
    const groups = new Map();
    for (const frame of bracket.frames) {
      const of = role({ frames: [frame] });
      groups.set(of, [...(groups.get(of) ?? []), frame]);
    }
    const rest = groups.get("") ?? [];
    groups.delete("");
    if (groups.size < 2) return [bracket];
    return [...groups.values()].map((frames, n) => {
      const all = n ? frames : [...frames, ...rest], patterns = all.map((/** @type {any} */ each) => each.path);
      return { ...bracket, frames: all, patterns, name: all.length > 1 ? bracket.name : patterns[0], doubts: n ? [] : bracket.doubts };
    });
  }

  /** The edits that take a bracket out of the shot. @param {string} had */
  function without(had) {
    const { table } = studio.state;
    if (had === "plate") return [{ remove: ["plate", "photographs"] }];
    if (had === "board") return [{ remove: ["camera", "grid"] }];
    if (had === "map") return [{ remove: ["light", "map"] }];
    if (!had) return [];
    return table.light.balls.length > 1 ? [{ remove: ["light", "balls", Number(had.slice(5))] }] : [{ remove: ["light", "balls"] }];
  }

  /** @param {any} bracket @param {string} wanted */
  function choose(bracket, wanted) {
    const had = role(bracket), { table } = studio.state, changes = [];
    if (had.split(" ")[0] === wanted) return studio.edit(without(had), true);
    changes.push(...without(had));
    if (wanted === "plate") changes.push({ set: ["plate", "photographs"], value: bracket.patterns });
    if (wanted === "ball") {
      if (table.light?.map) changes.push({ remove: ["light", "map"] });
      changes.push({ append: ["light", "balls"], value: { photographs: bracket.patterns } });
      const lies = table.camera?.grid ? { centre: [0, 0.05, 0] } : {};
      if (!table.light?.ball) changes.push({ set: ["light", "ball"], value: { ...lies, radius: 0.05 } });
    }
    if (wanted === "map") {
      for (const key of ["balls", "ball"]) if (table.light?.[key]) changes.push({ remove: ["light", key] });
      changes.push({ set: ["light", "map"], value: bracket.frames[0].path });
    }
    if (wanted === "board") {
      for (const key of ["ball", "pose", "lines", "file"]) if (table.camera?.[key]) changes.push({ remove: ["camera", key] });
      changes.push({ set: ["camera", "grid"], value: { photograph: bracket.frames[0].path, squares: [9, 6], square: 0.03 } });
      // The ball stood on the board's middle, until the tape measure says otherwise.
      const { ball } = table.light ?? {};
      if (ball?.radius && !ball.centre) changes.push({ set: ["light", "ball", "centre"], value: [0, ball.radius, 0] });
    }
    // A shot begun here renders as one that the command begins.
    if (!Object.keys(table).length) changes.push({ set: ["render"], value: studio.state.new_render });
    return studio.edit(changes, true);
  }

  /** The files of a role now. @param {string} of */
  const filesOf = (of) => (of === "plate" ? studio.state.plate : studio.state.balls[Number(of.slice(5))]);
  /** @param {string} of */
  const placeOf = (of) => (of === "plate" ? ["plate", "photographs"] : ["light", "balls", Number(of.slice(5)), "photographs"]);

  /** Leave a frame out of its bracket, or take it in again; of a bracket without a role it parts. @param {any} bracket @param {string} path */
  function toggle(bracket, path) {
    const of = role(bracket);
    if (of !== "plate" && !of.startsWith("ball")) return regroup(path, null);
    const files = filesOf(of);
    const wanted = files.includes(path) ? files.filter((/** @type {string} */ each) => each !== path)
      : bracket.frames.map((/** @type {any} */ each) => each.path).filter((/** @type {string} */ each) => each === path || files.includes(each));
    if (!wanted.length) return studio.say("a bracket keeps one photograph at least; choose another bracket instead");
    const all = bracket.frames.length === wanted.length && bracket.frames.every((/** @type {any} */ each) => wanted.includes(each.path));
    return studio.edit([{ set: placeOf(of), value: all ? bracket.patterns : wanted }], true);
  }

  /** A frame dropped on another bracket belongs to that one; elsewhere it has one of its own. @param {string} path @param {any} bracket */
  function regroup(path, bracket) {
    const { brackets } = studio, of = bracket ? role(bracket) : "";
    const from = brackets.find((/** @type {any} */ each) => each.frames.some((/** @type {any} */ frame) => frame.path === path));
    if (!from || from === bracket || (!bracket && from.frames.length === 1)) return;
    const frame = from.frames.find((/** @type {any} */ each) => each.path === path), had = role(from);
    const changes = [];
    if ((had === "plate" || had.startsWith("ball")) && filesOf(had).includes(path)) {
      const left = filesOf(had).filter((/** @type {string} */ each) => each !== path);
      if (!left.length) return studio.say("a bracket keeps one photograph at least");
      changes.push({ set: placeOf(had), value: left });
    }
    if (of === "plate" || of.startsWith("ball")) changes.push({ set: placeOf(of), value: [...filesOf(of), path] });
    const to = bracket ?? { ...from, name: path, frames: [], doubts: [] };
    from.frames = from.frames.filter((/** @type {any} */ each) => each !== frame);
    to.frames.push(frame);
    for (const each of [from, to]) each.patterns = each.frames.map((/** @type {any} */ one) => one.path);
    if (!bracket) brackets.splice(brackets.indexOf(from) + 1, 0, to);
    studio.brackets = brackets.filter((/** @type {any} */ each) => each.frames.length);
    if (changes.length) studio.edit(changes, true);
    else studio.rebuild();
  }

  /** What takes a dragged frame. @param {HTMLElement} area @param {any} bracket the one it then belongs to; null for one of its own */
  function takes(area, bracket) {
    area.addEventListener("dragover", (event) => {
      if (!dragged) return;
      event.preventDefault();
      area.classList.add("dropping");
    });
    area.addEventListener("dragleave", () => area.classList.remove("dropping"));
    area.addEventListener("drop", (event) => {
      if (!dragged) return;
      event.stopPropagation();
      area.classList.remove("dropping");
      regroup(dragged, bracket);
    });
    return area;
  }

  /** @param {any} bracket */
  function bracketEntry(bracket) {
    const of = role(bracket), frames = bracket.frames, inRole = of === "plate" || of.startsWith("ball") ? filesOf(of) : null;
    const times = frames.map((/** @type {any} */ each) => each.seconds).filter(Boolean).sort((/** @type {number} */ a, /** @type {number} */ b) => a - b);
    const first = frames[0], facts = [
      bracket.kind === "map" ? "radiance map" : `${frames.length} photograph${frames.length > 1 ? "s" : ""}`,
      ...(first.size ? [first.size.join(" × ")] : []),
      ...(times.length ? [times.length > 1 ? `${shutter(times[0])} … ${shutter(times[times.length - 1])}` : shutter(times[0])] : []),
      ...(first.f_number ? [`f/${first.f_number}`] : []), ...(first.iso ? [`ISO ${first.iso}`] : []),
    ].join(", ");
    const button = (/** @type {string} */ wanted, /** @type {string} */ text) => make("button", {
      type: "button", ariaPressed: String(of.split(" ")[0] === wanted), onclick: () => choose(bracket, wanted),
    }, text);
    const roles = bracket.kind === "map" ? [button("plate", "Plate"), button("map", "Light")]
      : [button("plate", "Plate"), button("ball", "Ball"), ...(frames.length === 1 ? [button("board", "Board")] : [])];
    for (const each of roles) each.setAttribute("aria-pressed", each.ariaPressed ?? "false");
    const entry = make("article", { className: "bracket", data: { name: bracket.name, role: of } },
      make("header", {}, make("h3", { title: bracket.name }, bracket.name), ...(bracket.kind === "broken" ? [] : roles)),
      make("div", { className: "facts" }, facts),
      ...bracket.doubts.map((/** @type {string} */ each) => make("p", { className: "doubt" }, each)),
      make("div", { className: "strip" }, ...(bracket.kind === "broken" ? [] : frames.map((/** @type {any} */ frame) => thumbnail(bracket, frame, inRole)))));
    return takes(entry, bracket);
  }

  /** What the shot names and the folder does not have: a pattern whose photographs were moved away. */
  function missing() {
    const { table, plate, balls } = studio.state, asked = [["plate", table.plate?.photographs, plate]];
    for (const [n, view] of (Array.isArray(table.light?.balls) ? table.light.balls : []).entries()) asked.push([`ball ${n}`, view.photographs, balls[n] ?? []]);
    return asked.filter(([, names, files]) => names?.length && !files.length).map(([of, names]) => {
      const name = [names].flat().join(", "), what = of === "plate" ? "the plate" : `view ${Number(of.slice(5)) + 1} of the ball`;
      return make("article", { className: "bracket", data: { name, role: of } },
        make("header", {}, make("h3", { title: name }, name),
          make("button", { type: "button", title: `Take ${what} out of the shot`, onclick: () => studio.edit(without(of), true) }, "Remove")),
        make("p", { className: "doubt" }, `no photograph is here under this name, which is ${what}: bring it back, choose others, or remove it`));
    });
  }

  /** @param {any} bracket @param {any} frame @param {string[] | null} inRole */
  function thumbnail(bracket, frame, inRole) {
    const doubt = make("span", { className: "doubt" });
    const image = make("img", { alt: "", loading: "lazy", draggable: false });
    const label = frame.seconds ? shutter(frame.seconds) : frame.path.split("/").pop();
    const out = inRole !== null && !inRole.includes(frame.path);
    const button = make("button", {
      type: "button", className: "thumb", title: `${frame.path}: click to see it, right-click or Delete to take it out of its bracket`,
      draggable: true, data: { path: frame.path, out: String(out) },
      onclick: () => {
        shown = frame.path;
        studio.show(frame.path);
        for (const each of document.querySelectorAll(".thumb")) each.setAttribute("aria-pressed", String(each === button));
      },
      oncontextmenu: (/** @type {Event} */ event) => (event.preventDefault(), toggle(bracket, frame.path)),
      onkeydown: (/** @type {KeyboardEvent} */ event) => event.key === "Delete" && toggle(bracket, frame.path),
      ondragstart: () => (dragged = frame.path),
      ondragend: () => (dragged = ""),
    }, image, make("span", {}, label), doubt);
    button.setAttribute("aria-pressed", String(frame.path === shown));
    button.setAttribute("aria-label", `${frame.path}, ${label}${out ? ", left out" : ""}`);
    small(frame.path).then(([address, words]) => {
      if (address) image.src = address;
      doubt.textContent = words;
    });
    return button;
  }

  /** @type {Map<string, Promise<[string, string]>>} */ const kept = new Map();
  /** A small picture and what to doubt of it; each is fetched once. @param {string} path @returns {Promise<[string, string]>} */
  function small(path) {
    let found = kept.get(path);
    if (!found) {
      found = fetch(`/thumbnail?path=${encodeURIComponent(path)}`).then(async (got) => /** @type {[string, string]} */ (
        got.ok ? [URL.createObjectURL(await got.blob()), got.headers.get("x-doubt") ?? ""] : ["", (await got.json()).error ?? "unreadable"]
      )).catch(() => /** @type {[string, string]} */ (["", ""]));
      kept.set(path, found);
    }
    return found;
  }

  return {
    name: "Photographs",
    keys: ["plate"],
    build() {
      const plate = studio.state.table.plate?.photographs ?? [];
      const names = (Array.isArray(plate) ? plate : [plate]).map(quoted).join(" ") || "plate/*.jpg";
      studio.brackets = studio.brackets.flatMap(parted);
      return [
        make("p", {}, "Choose which photographs are the plate, and which show the mirrored ball from each side. A frame dropped on another bracket "
          + "joins it; a right-click leaves it out."),
        ...(studio.brackets.some((/** @type {any} */ each) => each.frames.length > 1)
          ? [takes(make("div", { className: "drop" }, "Drop a frame here for a bracket of its own: a plate among photographs of the ball."), null)] : []),
        ...missing(),
        ...(studio.brackets.length ? studio.brackets.map(bracketEntry)
          : [make("p", {}, "No photographs are in this folder yet: drop some here.")]),
        typed(`relume merge ${names} -o plate.exr`, `import relume as rl\n\nmerged = rl.capture.merge_brackets([rl.read_bracket(["${names}"])])`),
      ];
    },
    shown() {
      if (!shown) shown = studio.platePath || studio.brackets[0]?.frames[0]?.path || "";
      if (shown) studio.show(shown);
    },
    async dropped(files) {
      await studio.attempt(async () => {
        for (const file of files) await upload(file);
        studio.brackets = (await json("/brackets")).brackets;
        studio.rebuild();
      });
    },
  };
}
