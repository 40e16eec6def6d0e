// Radiance: the brackets merged, the response and how each photograph agrees, what is measured in them, the absolute scale.

import { at, make, quoted, rounded, typed } from "../fields.js";
import { residualBar, responsePlot } from "../plots.js";
import { plain } from "../../measured.js";
import { json } from "../../requests.js";

const LUMINANCE = [0.2126, 0.7152, 0.0722], CHANNELS = ["red", "green", "blue", "luminance"];

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function radiancePane(studio) {
  let chosen = "plate", asked = "", luminance = "", slid = false;
  /** The pixel that is held, and what it holds. @type {any} */ let spot = null;
  /** Left, top, right and bottom of the region. @type {number[] | null} */ let box = null;
  /** @type {any} */ let region = null;
  /** @type {[number, number] | null} */ let corner = null;
  const words = make("div", { ariaLive: "polite" }), table = make("div", {});

  const merged = () => studio.state.merged;
  const bracket = () => merged()?.brackets.find((/** @type {any} */ each) => each.name === chosen) ?? merged()?.brackets[0] ?? null;
  const names = () => [...(studio.state.plate.length ? ["plate"] : []), ...studio.state.balls.map((/** @type {string[]} */ _, /** @type {number} */ i) => `ball ${i + 1}`)];
  const place = () => (chosen === "plate" ? ["plate", "photographs"] : ["light", "balls", Number(chosen.slice(5)) - 1, "photographs"]);
  const files = () => (chosen === "plate" ? studio.state.plate : studio.state.balls[Number(chosen.slice(5)) - 1]) ?? [];
  const going = () => studio.going;
  /** What the brackets are merged from, in a text. @param {any} shot */
  const source = (shot) => JSON.stringify([shot?.plate, (shot?.light?.balls ?? []).map((/** @type {any} */ each) =>
    Object.entries(each).filter(([key]) => !["pick", "rim", "camera", "focal_length"].includes(key)))]);
  const stale = () => merged() !== null && source(merged().made_from) !== source(studio.state.table);

  function show() {
    const one = bracket();
    if (one && !stale()) return studio.show(one.file, "scratch").then(() => studio.canvas.set({ marked: true }));
    return files().length ? studio.show(files()[Math.floor((files().length - 1) * 0.7)]) : undefined;
  }

  /** Merge what was changed since, unless another job runs. */
  function follow() {
    const now = source(studio.state.table);
    if (!stale() || going() || studio.state.fault !== null || asked === now) return;
    asked = now;
    studio.start("merge");
  }

  /** @param {string} name */
  function choose(name) {
    chosen = name;
    spot = box = region = null;
    studio.rebuild();
    show();
    say();
  }

  const inMap = () => studio.shownPath === bracket()?.file;
  const unit = () => (bracket()?.unit === "cd/m²" ? " cd/m²" : "");

  /** Hold a pixel, and read it. @param {number} x @param {number} y */
  async function hold(x, y) {
    const number = studio.number;
    await studio.attempt(async () => {
      const found = await json(`/pictures/${number}/value?layer=0&x=${Math.floor(x)}&y=${Math.floor(y)}`);
      found.before = spot?.luminance ?? null;
      spot = found;
    });
    studio.rebuild();
    say();
    studio.drawn();
  }

  async function measure() {
    if (!box) return;
    const [l, t, r, b] = box.map(Math.round);
    await studio.attempt(async () => (region = await json(`/pictures/${studio.number}/statistics?layer=0&box=${l},${t},${Math.max(1, r - l)},${Math.max(1, b - t)}`)));
    say();
    studio.drawn();
  }

  /** What is measured, in words. */
  function say() {
    words.replaceChildren(make("p", {}, spot ? "" : "Click a place for its radiance with its error; Shift-drag for a region."));
    if (spot) {
      const error = spot.sigma?.every(Number.isFinite) ? Math.hypot(...spot.sigma.map((/** @type {number} */ each, /** @type {number} */ i) => LUMINANCE[i] * each)) : null;
      const lines = [[`at ${spot.x}, ${spot.y}`, spot.rgb.map(plain).join("  ") + (spot.sigma ? `  ± ${spot.sigma.map(plain).join("  ")}` : "")],
        ["luminance", `${plain(spot.luminance)}${error === null ? "" : ` ± ${plain(error)} (${((100 * error) / Math.max(spot.luminance, 1e-30)).toPrecision(2)} %)`}${unit()}`],
        ...(spot.mark && spot.mark !== "measured" ? [["", spot.mark]] : []),
        ...(spot.before > 0 && spot.luminance > 0 ? [["to the one before", `${Math.log2(spot.luminance / spot.before).toFixed(2)} stops`]] : [])];
      words.append(make("dl", { data: { read: "spot" } }, ...lines.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)])));
    }
    table.replaceChildren();
    if (!region?.mean) return;
    const rows = ["mean", "deviation", "least", "median", "most"].map((name) => make("tr", {}, make("th", { scope: "row" }, name),
      ...CHANNELS.map((_, i) => make("td", {}, plain(region[name][i])))));
    table.append(make("table", { data: { read: "region" } }, make("caption", {}, `${region.pixels} pixels${unit()}`),
      make("thead", {}, make("tr", {}, make("td", {}), ...CHANNELS.map((each) => make("th", { scope: "col" }, each)))), make("tbody", {}, ...rows)));
  }

  /** Each photograph with its exposure and how it agrees with the others. @param {any} one */
  function frames(one) {
    return make("ul", { className: "frames" }, ...one.frames.map((/** @type {any} */ frame) => {
      const said = frame.stops === null ? "" : `${frame.stops >= 0 ? "+" : "−"}${Math.abs(frame.stops).toFixed(2)}`;
      const out = make("button", { type: "button", title: "Merge without it", onclick: () => leaveOut(frame.path), disabled: one.frames.length < 2 }, "−");
      out.setAttribute("aria-label", `Leave out ${frame.path}`);
      return make("li", { data: { frame: frame.path } }, make("span", { title: frame.path }, frame.path.split("/").pop()), make("span", {}, frame.exposure),
        residualBar(frame.stops), make("span", { className: "stops" }, said), out);
    }));
  }

  /** @param {string} path */
  const leaveOut = (path) => studio.edit([{ set: place(), value: files().filter((/** @type {string} */ each) => each !== path) }], true);

  /** The scale in cd/m², and the place by which it is known. @param {any} one */
  function scale(one) {
    const known = at(studio.state.table, ["plate", "spot"]);
    if (chosen !== "plate") return [];
    const input = make("input", { id: "spot-luminance", type: "number", min: "0", step: "any", value: luminance || (known?.luminance ?? ""),
      data: { place: "plate.spot" }, oninput: () => (luminance = input.value) });
    const write = () => {
      const x = spot?.x ?? known?.at[0], y = spot?.y ?? known?.at[1];
      if (x === undefined || !(Number(input.value) > 0)) return studio.say("click the place in the picture, and type what the meter showed there");
      luminance = "";
      return studio.edit([{ set: ["plate", "spot"], value: { ...(known?.radius ? { radius: known.radius } : {}), at: [x, y], luminance: rounded(Number(input.value)) } }]);
    };
    input.addEventListener("keydown", (event) => event.key === "Enter" && write());
    return [
      make("h2", {}, "Absolute scale"),
      make("p", {}, one.scale ?? "Relative: click a place whose luminance a meter showed, and type it."),
      make("div", { className: "row" }, make("label", { for: "spot-luminance" }, spot ? `Luminance at ${spot.x}, ${spot.y}` : known ? `Luminance at ${known.at.join(", ")}` : "Luminance there"), input, "cd/m²",
        make("button", { type: "button", onclick: write }, "It is so"),
        ...(known ? [make("button", { type: "button", onclick: () => studio.edit([{ remove: ["plate", "spot"] }]) }, "Relative again")] : [])),
    ];
  }

  return {
    name: "Radiance",
    keys: [],
    build() {
      const one = stale() ? null : bracket(), camera = one ? merged().cameras[one.camera] : null;
      const patterns = [at(studio.state.table, place()) ?? []].flat();
      say();
      return [
        make("div", { className: "row", role: "group" }, ...names().map((each) => {
          const button = make("button", { type: "button", onclick: () => choose(each) }, each === "plate" ? "Plate" : `Ball ${each.slice(5)}`);
          button.setAttribute("aria-pressed", String(each === (one?.name ?? chosen)));
          return button;
        })),
        make("div", { className: "row" }, make("button", { type: "button", className: "primary", disabled: studio.state.fault !== null || going(),
          onclick: () => studio.start("merge") }, "Merge")),
        make("p", {}, one ? `Merged as the job does it: ${one.frames.length} photograph${one.frames.length > 1 ? "s" : ""}, ${one.unit}; ${one.clipped}.`
          : stale() ? "The photographs were changed since they were merged." : "Aligned, without ghosts, by the camera's own response, as the job does it. It takes some seconds."),
        ...(one ? one.doubts.map((/** @type {string} */ each) => make("p", { className: "doubt" }, each)) : []),
        ...(one ? [make("h2", {}, "Measured here"), words, table] : []),
        ...(one?.frames.length ? [make("h2", {}, "Photographs"), make("p", {}, "By how many stops each departs from the others:"), frames(one)] : []),
        ...(camera?.curves ? [make("h2", {}, "Response"), responsePlot(camera), make("p", {}, camera.residual
          ? `Misfit of ln exposure: ${camera.residual.map((/** @type {number} */ v) => v.toFixed(3)).join(", ")}` : "Given by a profile, or assumed.")] : []),
        ...(one ? scale(one) : []),
        typed(`relume merge ${patterns.map(quoted).join(" ")} -o ${chosen.replace(" ", "_")}.exr`,
          'import relume as rl\n\nmerged = rl.report.merge_shot(rl.read_shot("shot.toml"))\nprint(merged.residuals)'),
      ];
    },
    shown() {
      if (!names().includes(chosen)) chosen = names()[0] ?? "plate";
      show();
    },
    hidden: () => void studio.canvas.set({ marked: false }),
    changed: follow,
    done() {
      if (studio.state.job.kind !== "merge") return;
      spot = box = region = null;
      studio.rebuild();
      show();
    },
    drawing() {
      if (!inMap()) return {};
      const known = chosen === "plate" ? at(studio.state.table, ["plate", "spot"]) : null, lines = [], handles = [], marks = [];
      if (box) {
        const [l, t, r, b] = box;
        lines.push({ key: "region", d: [/** @type {[number, number][]} */ ([[l, t], [r, t], [r, b], [l, b]])], closed: true });
      }
      if (spot) marks.push({ key: "spot", x: spot.x + 0.5, y: spot.y + 0.5 });
      if (known) {
        handles.push({ key: "meter", x: known.at[0] + 0.5, y: known.at[1] + 0.5, label: "The place whose luminance is known",
          moved: (/** @type {number} */ x, /** @type {number} */ y, /** @type {boolean} */ done) => {
            const here = [Math.floor(x), Math.floor(y)];
            slid ||= here.join() !== known.at.join();
            known.at = here;
            studio.drawn();
            // A click on it reads its pixel.
            if (done && slid) studio.edit([{ set: ["plate", "spot", "at"], value: known.at }]);
            else if (done) hold(x, y);
            if (done) slid = false;
          } });
      }
      return { lines, handles, points: marks, words: known ? [{ key: "meter", x: known.at[0] + 0.5, y: known.at[1] + 0.5, text: `${known.luminance} cd/m²` }] : [] };
    },
    clicked: (x, y) => void (inMap() && hold(x, y)),
    drag(event, phase) {
      if (phase === "begin") {
        if (!event.shiftKey || !inMap()) return false;
        corner = studio.overlay.at(event);
      }
      if (!corner) return false;
      const [x, y] = studio.overlay.at(event);
      box = [Math.min(x, corner[0]), Math.min(y, corner[1]), Math.max(x, corner[0]), Math.max(y, corner[1])].map(Math.round);
      studio.drawn();
      if (phase === "end") {
        corner = null;
        measure();
      }
      return true;
    },
  };
}
