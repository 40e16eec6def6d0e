// Deliver: the render with its progress, what was written, what is to doubt, and what one would type.

import { choiceField, make, numberField, typed } from "../fields.js";

/** @param {import("../studio.js").Studio} studio @returns {import("../studio.js").Pane} */
export function deliverPane(studio) {
  function show() {
    const { results } = studio.state, name = ["composite.png", "preview.png"].find((each) => results.includes(each));
    if (name) studio.show(name, "results");
    else if (studio.platePath) studio.show(studio.platePath);
  }

  /** The render that is watched as it refines. */
  let watched = -1;
  function watch() {
    const { job, results } = studio.state;
    if (job.kind !== "insert" || job.status !== "running" || job.step !== "render" || watched === job.number) return;
    if (!results.includes("preview.exr")) return;
    watched = job.number;
    studio.show("preview.exr", "results");
  }

  return {
    name: "Deliver",
    keys: ["render", "sequence"],
    build() {
      const { job, results, out, fault } = studio.state, going = studio.going;
      const result = job.status === "done" ? job.result : null;
      const open = (/** @type {string} */ name) => (name === "report.html" ? make("a", { href: `/results/${name}`, target: "_blank", rel: "noopener" }, name)
        : /\.(exr|hdr|png|jpg)$/.test(name) ? make("button", { type: "button", onclick: () => studio.show(name, "results") }, name) : name);
      return [
        make("h2", {}, "Render"),
        numberField(studio, "Rays a pixel", ["render", "samples"], { otherwise: 256, whole: true, min: 2, step: 1 }),
        numberField(studio, "Or until noise is", ["render", "noise"], { min: 0, step: 0.001 }),
        choiceField(studio, "Denoise", ["render", "denoise"], [["no", false], ["yes", true]], false),
        numberField(studio, "Seed", ["render", "seed"], { otherwise: 0, whole: true, min: 0, step: 1 }),
        make("div", { className: "row" },
          make("button", { type: "button", className: "primary", disabled: fault !== null || going, onclick: () => studio.start("insert") }, "Render the composite"),
          make("button", { type: "button", disabled: fault !== null || going, onclick: () => studio.start("look") }, "Quick look"),
          make("button", { type: "button", disabled: fault !== null || going, onclick: () => studio.start("check") }, "Check"),
          ...(going ? [make("button", { type: "button", onclick: () => studio.stop() }, "Stop")] : [])),
        make("p", {}, fault !== null ? "The shot is not finished; the line above says what it lacks."
          : "What is rendered here, the command does not render again, and the other way round."),
        ...(result?.facts ? [make("h2", {}, "What the photographs show"), make("dl", {}, ...Object.entries(result.facts).flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, String(value))]))] : []),
        ...(result?.kept ? [make("p", {}, `${job.seconds} s; kept from before: ${result.kept.join(", ") || "nothing"}`)] : []),
        ...(result?.doubts?.length ? [make("h2", {}, "To doubt"), ...result.doubts.map((/** @type {string} */ each) => make("p", { className: "doubt" }, each))] : []),
        make("h2", {}, `In ${out}`),
        ...(results.length ? [make("ul", { className: "files" }, ...results.map((/** @type {string} */ each) => make("li", {}, open(each))))] : [make("p", {}, "Nothing yet.")]),
        make("div", { className: "row" }, make("button", { type: "button", disabled: !results.includes("composite.exr"), onclick: () => studio.compare("composite.png") }, "Wipe against the plate")),
        typed(`relume insert ${studio.state.name} -o ${out}`,
          `import relume as rl\n\nresult = rl.insert(rl.read_shot("${studio.state.name}"), "${out}")\nrl.write_report(result, "${out}")`),
      ];
    },
    shown: show,
    changed: watch,
    done: show,
    hidden: () => studio.uncompare(),
  };
}
