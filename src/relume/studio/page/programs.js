// What the canvas draws with: its shaders, each compiled when it is first needed, for a plain screen or an HDR one.

import { COMPARE, COPY, INSIDE, PLAIN, QUAD, TILE } from "./shaders.js";

/** @typedef {{program: WebGLProgram, at: (name: string) => WebGLUniformLocation | null}} Linked */
/** @typedef {"show" | "plain" | "copy" | "compare" | "inside"} Name */

/** @type {Record<Name, string>} */
const FRAGMENTS = { show: TILE, plain: PLAIN, copy: COPY, compare: COMPARE, inside: INSIDE };

export class Programs {
  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    /** @type {Map<string, Linked>} */ this.kept = new Map();
  }

  /** A program. What goes beyond white is one of its own: a processor that draws by software works out both ways of a choice
   *  that is made while it draws. @param {Name} name @param {boolean} [extended] @returns {Linked} */
  of(name, extended = false) {
    const key = `${name}${extended ? " extended" : ""}`;
    let found = this.kept.get(key);
    if (!found) this.kept.set(key, (found = linked(this.gl, extended ? beyond(FRAGMENTS[name]) : FRAGMENTS[name])));
    return found;
  }
}

/** @param {string} fragment */
const beyond = (fragment) => fragment.replace("\n", "\n#define EXTENDED\n"); // after the line that names the version

/** @param {WebGL2RenderingContext} gl @param {string} fragment @returns {Linked} */
function linked(gl, fragment) {
  const made = /** @type {WebGLProgram} */ (gl.createProgram());
  for (const [kind, text] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, QUAD], [gl.FRAGMENT_SHADER, fragment]])) {
    const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`shader: ${gl.getShaderInfoLog(shader)}`);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(`shaders: ${gl.getProgramInfoLog(made)}`);
  /** @type {Map<string, WebGLUniformLocation | null>} */
  const places = new Map();
  return {
    program: made,
    at(name) {
      if (!places.has(name)) places.set(name, gl.getUniformLocation(made, name));
      return places.get(name) ?? null;
    },
  };
}
