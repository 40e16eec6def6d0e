// Light: the ball's rim on its photograph, the map that it shows beside it while the rim is dragged, and the measured map.

import { HdrCanvas } from "../../canvas.js";
import { ballRim } from "./ball_rim.js";
import { ballViews } from "./ball_views.js";
import { cropping } from "./cropping.js";
import { lightEdits } from "./light_edits.js";
import { lightFilm } from "../light_film.js";
import { make, numberField, quoted, typed } from "../fields.js";
import { json } from "../../requests.js";

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function lightPane(studio) {
  let view = 0, exposed = false, cropped = "";
  const canvas = make("canvas", { tabIndex: 0, ariaLabel: "The light, unwrapped: drag to look round" });
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "The light that the ball shows, unwrapped; E and Shift+E on it change its exposure");
  const box = make("div", { className: "map" }, canvas), words = make("p", { ariaLive: "polite" });
  /** @type {HdrCanvas | null} */ let map = null;
  /** @type {import("./ball_rim.js").BallRim[]} */ const rims = [];
  const here = () => studio.panes[studio.step]?.name === "Light";

  /** @param {number} i @returns {import("./ball_rim.js").BallRim} */
  function rimOf(i) {
    while (rims.length <= i) {
      const mine = rims.length;
      rims.push(ballRim(studio, mine, {
        drawn() {
          if (mine === view) words.textContent = rims[mine].said;
          if (views.open) views.draw(mine);
          else studio.drawn();
        },
        unwrapped: async (rim) => void (rim.view === view && (await showMap(rim.number))),
        found: () => void (here() && studio.rebuild()),
      }));
    }
    return rims[i];
  }
  const one = () => rimOf(view);
  const views = ballViews(studio, rimOf, (i) => {
    if (i === view) return;
    view = i;
    views.mark(i);
    studio.rebuild();
    words.textContent = one().said;
    if (one().number >= 0) studio.attempt(() => showMap(one().number));
  });

  /** @param {number} shown of the map in the library */
  async function showMap(shown) {
    map ??= new HdrCanvas(canvas, () => {}, (error) => studio.say(error));
    map.resized();
    const facts = /** @type {import("../../source.js").PictureFacts} */ (await json(`/pictures/${shown}`));
    studio.facts.set(shown, facts);
    map.open(facts.layers[0], studio.tilesOf(shown, 0));
    map.fit();
    if (!exposed) {
      const stops = await studio.greyStops(shown);
      if (stops !== null) map.set({ stops, marked: true });
      exposed = true;
    }
  }

  /** @param {number} chosen */
  function choose(chosen) {
    view = chosen;
    if (views.open) views.set(false, view);
    begin();
    studio.rebuild();
  }

  function begin() {
    if (!one().path()) return;
    studio.show(one().path());
    one().begin(true);
  }

  /** All views, or one of them. */
  function beside() {
    views.set(!views.open, view);
    if (!views.open) begin();
    studio.rebuild();
  }

  /** What each view gave of the measured map. */
  function shares() {
    const found = studio.measured?.views ?? [];
    if (found.length < 2) return [];
    return [make("ul", { className: "found" }, ...found.map((/** @type {any} */ each, /** @type {number} */ i) => make("li", { data: { share: String(i) } },
      make("span", { className: `share v${i % 6}` }, ""), `View ${i + 1}: ${Math.round(100 * each.directions)} % of all directions, ${Math.round(100 * each.light)} % of the light`))),
    make("div", { className: "row" }, make("button", { type: "button", onclick: () => {
      views.set(false, view);
      studio.show("views.exr", "scratch", true);
      studio.rebuild();
    } }, "See which view gave what"))];
  }

  const measure = () => studio.start("look"), whole = lightEdits(studio), crop = cropping(studio, whole.paint, whole.shown), film = lightFilm(studio);
  return {
    name: "Light",
    keys: ["light"],
    build() {
      const light = studio.state.table.light ?? {};
      const turned = [
        make("h2", {}, "Changed"),
        numberField(studio, "Turned", ["light", "turn"], { range: true, min: -180, max: 180, step: 1, unit: "°" }),
        numberField(studio, "Brighter", ["light", "exposure"], { range: true, min: -4, max: 4, step: 0.1, unit: " stops" }),
        make("p", {}, light.turn || light.exposure ? `The light is not as it was measured: ${light.turn ? `turned by ${light.turn}°` : ""} `
          + `${light.exposure ? `${light.exposure} stops` : ""}` : "The light is as it was measured."),
      ];
      const measured = [
        make("h2", {}, "Measured"),
        make("div", { className: "row" }, make("button", { type: "button", className: "primary", onclick: measure }, "Measure the light"),
          ...(studio.measured ? [make("button", { type: "button", onclick: () => {
            views.set(false, view);
            studio.show("light.exr", "scratch", true);
            studio.rebuild();
          } }, "See the map")] : [])),
        make("p", {}, studio.measured ? `All views blended; the camera's own response, ${studio.measured.unit}.`
          : "Merges every bracket by the camera's own response and blends the views. The first time takes a minute or two; then it is kept."),
        ...shares(),
      ];
      if (light.map) return [make("p", {}, `The light is a finished map: ${light.map}`),
        numberField(studio, "Heading", ["light", "heading"], { range: true, min: -180, max: 180, step: 1, unit: "°" }), ...turned, ...measured,
        make("div", { className: "row" }, make("button", { type: "button", onclick: () => studio.show(light.map, "folder", true) }, "See the map itself")), ...whole.build(), ...crop.build()];
      if (light.maps || light.sky) return [make("p", {}, light.maps ? `The light is maps that follow one another: ${light.maps}` : "The light is a clear sky, as the shot file says."),
        ...(light.maps ? film.build(JSON.stringify([light.maps, light.rate])) : []),
        numberField(studio, "Heading", ["light", "heading"], { range: true, min: -180, max: 180, step: 1, unit: "°" }), ...turned, ...measured];
      if (!studio.state.balls.length) return [make("p", {}, "No photographs of the ball are chosen yet: mark them as Ball under Photographs.")];
      const name = `light-view-${view}`, rim = one(), table = rim.table();
      const pick = rim.way === "pick" ? "" : " --pick-exactly", circle = rim.rim ? rim.rim.map((each) => each.toFixed(1)).join(",") : "auto";
      const names = [table.photographs ?? []].flat().map(quoted).join(" ");
      const all = make("button", { type: "button", onclick: beside }, "Side by side");
      all.setAttribute("aria-pressed", String(views.open));
      const way = make("select", { id: "light-way", onchange: () => (one().way = way.value) },
        make("option", { value: "pick", selected: rim.way === "pick" }, "is followed to the rim near it"), make("option", { value: "rim", selected: rim.way === "rim" }, "is taken exactly"));
      return [
        make("div", { className: "row", role: "group" }, ...studio.state.balls.map((/** @type {string[]} */ _, /** @type {number} */ i) => {
          const button = make("button", { type: "button", onclick: () => choose(i) }, `View ${i + 1}`);
          button.setAttribute("aria-pressed", String(i === view));
          return button;
        }), ...(studio.state.balls.length > 1 ? [all] : [])),
        make("div", { className: "row" }, make("label", { for: name }, "Seen in"), make("select", {
          id: name, onchange: (/** @type {Event} */ event) => {
            one().frame = /** @type {HTMLSelectElement} */ (event.target).selectedIndex;
            if (views.open) views.show(view);
            else studio.show(one().path());
          },
        }, ...rim.files().map((/** @type {string} */ each) => make("option", { selected: each === rim.path() }, each)))),
        make("h2", {}, studio.state.balls.length > 1 ? `Rim in view ${view + 1}` : "Rim"),
        make("p", {}, "Drag the middle or the rim; the arrow keys move a handle by a pixel."),
        make("div", { className: "row" },
          make("button", { type: "button", onclick: () => one().find() }, "Find it"),
          make("button", { type: "button", onclick: () => one().write() }, "Keep it"),
          make("button", { type: "button", disabled: !table.rim && !table.pick, onclick: () => studio.edit(
            ["rim", "pick"].filter((key) => table[key]).map((key) => ({ remove: ["light", "balls", view, key] })), true) }, "As found")),
        make("div", { className: "row" }, make("label", { for: "light-way" }, "What is drawn"), way),
        box, words,
        make("p", {}, "Unwrapped from this photograph alone, seen from in front of the ball; grey is what no view shows."),
        make("h2", {}, "Ball"),
        numberField(studio, "Radius", ["light", "ball", "radius"], { unit: "m", step: 0.001, min: 0 }),
        ...measured, ...turned, ...whole.build(), ...crop.build(),
        typed(`relume probe ${names} --pick ${circle}${pick} -o light.exr`,
          `import relume as rl\n\nfound = rl.probe.probe_ball(rl.probe.find_ball_photographs([${JSON.stringify(names)}]))\nrl.probe.write_probe("light.exr", found.probe)`),
      ];
    },
    shown() {
      if (studio.state.table.light?.maps) film.look();
      else begin();
    },
    hidden() {
      views.set(false, view);
      film.stop();
    },
    clicked: (x, y) => void whole.clicked(x, y),
    drag: crop.drag,
    drawn() {
      film.drawn();
      if (cropped === studio.shownPath) return;
      cropped = studio.shownPath;
      crop.forget();
      if (here() && !film.isShown()) studio.rebuild();
    },
    changed() {
      view = Math.min(view, Math.max(studio.state.balls.length - 1, 0));
      for (const each of rims) each.changed();
    },
    drawing: () => crop.drawing() ?? film.drawing() ?? (studio.shownPath === one().path() && !views.open ? one().drawing() : {}),
  };
}
