// What the studio's page asks of its server: answers as JSON, and refusals as one line.

export class Refused extends Error {
  /** @param {string} words @param {number} status @param {any} content */
  constructor(words, status, content) {
    super(words);
    this.status = status;
    this.content = content;
  }
}

/** @param {Response} got */
async function content(got) {
  const text = await got.text();
  let found = null;
  try {
    found = JSON.parse(text);
  } catch { /* not of ours */ }
  if (!got.ok) throw new Refused(found?.error ?? (text.slice(0, 200) || `${got.status} ${got.statusText}`), got.status, found);
  return found;
}

const GONE = "relume has ended; start it again, and open the address that it prints";

/** @param {string} address @param {RequestInit} [options] */
async function ask(address, options) {
  try {
    return await fetch(address, options);
  } catch (error) {
    if (error instanceof DOMException) throw error; // aborted
    throw new Error(GONE);
  }
}

/** @param {string} address */
export const json = async (address) => content(await ask(address));

/** @param {string} address @param {unknown} body */
export const post = async (address, body) =>
  content(await ask(address, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) }));

/** @param {string} address @param {AbortSignal} [signal] */
export async function bytes(address, signal) {
  const got = await ask(address, { signal });
  if (!got.ok) return content(got);
  return got.arrayBuffer();
}

/** @param {File} file @returns {Promise<string>} its path in the folder */
export const upload = async (file) =>
  (await content(await ask(`/uploads?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file }))).path;

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
