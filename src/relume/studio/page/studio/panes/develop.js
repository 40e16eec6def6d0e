// Develop: how the composite becomes a photograph, and its grain, sharpness and focus matched to the plate's.

import { developments } from "./developed.js";
import { choiceField, make, numberField, typed } from "../fields.js";

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function developPane(studio) {
  const name = () => ["composite.png", "preview.png"].find((each) => studio.state.results.includes(each));

  const others = developments(studio);

  function show() {
    const found = name();
    if (found) studio.show(found, "results");
    else if (studio.platePath) studio.show(studio.platePath);
  }

  return {
    name: "Develop",
    keys: ["develop"],
    build: () => [
      make("p", {}, "Through the plate's own recovered response the objects look as that camera would have shown them."),
      choiceField(studio, "Response", ["develop", "response"], [["the plate's own", "plate"], ["sRGB", "srgb"]], "plate"),
      numberField(studio, "Exposure", ["develop", "exposure"], { range: true, min: -4, max: 4, step: 0.1, unit: " stops" }),
      make("h2", {}, "Matched to the plate"),
      choiceField(studio, "Grain", ["match", "grain"], [["yes", true], ["no", false]], true),
      choiceField(studio, "Sharpness", ["match", "sharpness"], [["yes", true], ["no", false]], true),
      make("div", { className: "row" },
        make("button", { type: "button", className: "primary", disabled: studio.state.fault !== null, onclick: () => studio.start("look") }, "Quick look"),
        make("button", { type: "button", disabled: name() === undefined, onclick: () => studio.compare(name() ?? "") }, "Wipe against the plate")),
      make("p", {}, name() ? `Shown: ${name()}` : "Nothing is rendered yet; the plate is shown."),
      ...others.build(),
      others.typed() ?? typed(`relume develop ${studio.state.out}/composite.exr -o ${studio.state.out}/film.png --preset slide`,
        `import relume as rl\n\nradiance = rl.read_radiance("${studio.state.out}/composite.exr")\npicture = rl.develop(radiance.radiance, rl.VirtualCamera())\nrl.write("${studio.state.out}/film.png", picture)`),
    ],
    shown() {
      show();
      others.fetchWays();
    },
    done() {
      show();
      others.fetchWays();
    },
    hidden: () => studio.uncompare(),
  };
}
