// What pages ask of their server: answers, and refusals as one line.

export class Refused extends Error {
  /** @param {string} words @param {number} status @param {any} content */
  constructor(words, status, content) {
    super(words);
    this.status = status;
    this.content = content;
  }
}

const GONE = "relume has ended; start it again, and open the address that it prints";

/** What the server answers; throws `Refused` where it refuses. @param {string} address @param {RequestInit} [options] */
export async function answer(address, options) {
  let got;
  try {
    got = await fetch(address, options);
  } catch (error) {
    if (error instanceof DOMException) throw error; // aborted
    throw new Error(GONE);
  }
  if (got.ok) return got;
  const text = await got.text();
  let found = null;
  try {
    found = JSON.parse(text);
  } catch { /* not of ours */ }
  throw new Refused(found?.error ?? (text.slice(0, 200) || `${got.status} ${got.statusText}`), got.status, found);
}

/** @param {string} address @param {RequestInit} [options] */
export const json = async (address, options) => (await answer(address, options)).json();

/** @typedef {{name: string, file: File}} Dropped name: with the folders that it was dropped in */

/** Meshes with the files that they name, in one request. @param {Dropped[]} files @returns {Promise<{meshes: string[], left_out: string[]}>} */
export const uploadTogether = (files) => json("/uploads/together", { method: "POST",
  body: new Blob([`${JSON.stringify(files.map((each) => [each.name, each.file.size]))}\n`, ...files.map((each) => each.file)]) });

/** @param {string} address @param {unknown} body */
export const post = (address, body) =>
  json(address, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });

/** @param {string} address @param {AbortSignal} [signal] */
export const bytes = async (address, signal) => (await answer(address, { signal })).arrayBuffer();

/** @param {File} file @returns {Promise<string>} its path in the folder */
export const upload = async (file) =>
  (await json(`/uploads?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file })).path;

/** The server's words, for as long as the page is open. @param {(said: any) => void} heard @param {(line: string) => void} gone */
export function listenTo(heard, gone) {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/events`);
  socket.addEventListener("message", (event) => heard(JSON.parse(event.data)));
  socket.addEventListener("close", () => {
    gone(GONE);
    // A laptop that was closed: the server may still be there.
    setTimeout(() => listenTo(heard, gone), 2000);
  });
}
