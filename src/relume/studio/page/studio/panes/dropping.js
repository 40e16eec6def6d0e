// What was dropped or chosen: meshes by themselves, or with the files that they name, also as whole folders.

import { upload, uploadTogether } from "../../requests.js";

/** @typedef {import("../../requests.js").Dropped} Dropped */

export const ACCEPTED = ".glb,.gltf,.bin,.obj,.mtl,.ply,.stl,.usd,.usda,.usdc,.usdz,.jpg,.jpeg,.png,.webp,.tga,.exr,.hdr";
/** Kinds that may name files beside themselves; the others hold all they need. */
const NAMING = /\.(gltf|obj|usd|usda|usdc)$/i;

/** What an event brings, read at once: its folders are gone when the event is over. @param {File[]} files @param {DragEvent} event
 *  @returns {Promise<Dropped[]>} */
export async function allDropped(files, event) {
  const entries = [...(event.dataTransfer?.items ?? [])].map((each) => (each.kind === "file" ? each.webkitGetAsEntry?.() : null));
  if (!entries.some((each) => each?.isDirectory)) return files.map((file) => ({ name: file.name, file }));
  /** @type {Dropped[]} */ const found = [];
  /** @param {any} entry @param {string} within */
  const walk = async (entry, within) => {
    if (entry.name.startsWith(".")) return; // what file managers leave
    if (entry.isFile) {
      found.push({ name: within + entry.name, file: await new Promise((done, failed) => entry.file(done, failed)) });
      return;
    }
    const reader = entry.createReader();
    for (;;) {
      /** @type {any[]} */ const some = await new Promise((done, failed) => reader.readEntries(done, failed));
      if (!some.length) return;
      for (const each of some) await walk(each, `${within}${entry.name}/`);
    }
  };
  for (const entry of entries) if (entry) await walk(entry, "");
  return found;
}

/** Hand files over; the meshes that came, as the shot names them, and what was of no use. @param {Dropped[]} files
 *  @returns {Promise<{meshes: string[], left_out: string[]}>} */
export async function handOver(files) {
  if (files.some(({ name }) => NAMING.test(name) || name.includes("/"))) return uploadTogether(files);
  const meshes = [];
  for (const { file } of files) {
    const path = await upload(file);
    if (path.startsWith("objects/")) meshes.push(path);
  }
  return { meshes, left_out: [] };
}
