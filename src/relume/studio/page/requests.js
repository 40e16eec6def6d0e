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

const SILENT = "relume does not answer now; what is done here waits until it does";
const LOOKED = 1000; // milliseconds between looks at whether the server is still heard
const QUIET = 8000; // after which it is said that it is not: it says something every two seconds
const AGAIN = 2000; // until a connection that was lost is tried again

/** The server's words, for as long as the page is open.
 *  @param {(said: any) => void} heard
 *  @param {(line: string) => void} gone called when the server is not heard any more
 *  @param {(line: string) => void} back called when it is heard again, or when this page itself slept, with the line that was said
 *    last: what is shown may be of before */
export function listenTo(heard, gone, back) {
  let line = "", last = performance.now(), looked = last, slept = false;
  /** @type {WebSocket} */ let socket;
  const lost = (/** @type {string} */ words) => {
    if (line !== words) gone((line = words));
  };
  const connect = () => {
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/events`);
    socket.addEventListener("message", (event) => {
      last = performance.now();
      if (line || slept) {
        const said = line;
        line = "";
        slept = false;
        back(said);
      }
      const said = JSON.parse(event.data);
      if (!("alive" in said)) heard(said);
    });
    socket.addEventListener("close", () => {
      lost(GONE);
      // A laptop that was closed: the server may still be there.
      setTimeout(connect, AGAIN);
    });
  };
  connect();
  setInterval(() => {
    const now = performance.now();
    // A page that slept itself has not listened, and hears first what there is to hear.
    if (now - looked > 5 * LOOKED) {
      slept = true;
      last = now;
    }
    looked = now;
    if (now - last > QUIET && socket.readyState === WebSocket.OPEN) lost(SILENT);
  }, LOOKED);
}
