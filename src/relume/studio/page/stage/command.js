// What one would type for the light of the page.

/** A colour of the screen as linear red, green, blue whose greatest is 1, times the lamp's strength. @param {import("./sphere.js").Lamp} lamp */
export function rgbOf({ colour, stops }) {
  const codes = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255);
  return codes.map((v) => 2 ** stops * (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
}

/** A path for a shell, in quotes where it needs them. @param {string} text */
const quoted = (text) => (/^[\w./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

/** @param {number[]} values */
const list = (values) => values.map((each) => Number(each.toPrecision(6))).join(",");

/** @param {{facts: {path: string, maps: {name: string}[]} | null, lamps: import("./sphere.js").Lamp[], map: number | null,
 *   turn: number, stops: number}} state */
export function commandOf({ facts, lamps, map, turn, stops }) {
  if (!facts || (!lamps.length && map === null)) return "";
  const words = ["relume stage relight", quoted(facts.path), "--no-mesh"];
  if (map !== null) words.push("--light", quoted(facts.maps[map].name));
  if (map !== null && turn) words.push("--rotate", String(turn));
  for (const lamp of lamps) words.push("--direction", `${list(lamp.direction)}=${list(rgbOf(lamp))}`);
  const sizes = [...new Set(lamps.map((lamp) => lamp.size))];
  if (sizes.length === 1 && sizes[0]) words.push("--size", String(sizes[0]));
  words.push("-o relit.exr");
  const notes = [];
  if (sizes.length > 1) notes.push("the command has one size for all lamps");
  if (map !== null && stops) notes.push(`the map is brightened by ${stops} stops first (relume edit)`);
  return words.join(" ") + (notes.length ? `   # ${notes.join("; ")}` : "");
}
