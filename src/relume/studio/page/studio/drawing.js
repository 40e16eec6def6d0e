// Objects drawn while they are dragged: triangles through the plate's camera, matte, under the light that was measured,
// each with a shadow on the table away from what throws the sharpest.

const VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 corner; layout(location = 1) in vec3 normal; layout(location = 2) in vec3 colour;
uniform mat3 turn; uniform vec3 foot, moved; uniform float scale;
uniform mat3 rotation; uniform vec3 position; uniform float focal; uniform vec2 centre; uniform float lens[5];
uniform vec3 view; uniform vec2 canvas; uniform bool shadow; uniform vec3 light; uniform float ground;
out vec3 facing, albedo;
void main() {
  vec3 p = turn * (corner - foot) * scale + foot + moved;
  if (shadow) p -= light * ((p.y - ground - 0.0005) / max(light.y, 0.05));
  vec3 q = transpose(rotation) * (p - position);
  float w = -q.z;
  vec2 s = vec2(q.x, -q.y) / w;
  float r = dot(s, s), R = 1.0 + r * (lens[0] + r * (lens[1] + r * lens[4]));
  s = vec2(s.x * R + 2.0 * lens[2] * s.x * s.y + lens[3] * (r + 2.0 * s.x * s.x),
           s.y * R + lens[2] * (r + 2.0 * s.y * s.y) + 2.0 * lens[3] * s.x * s.y);
  vec2 screen = (centre + focal * s - view.xy) * view.z / canvas * 2.0;
  gl_Position = vec4(screen.x * w, -screen.y * w, (1.0 - 0.02 / w) * w, w);
  facing = turn * normal;
  albedo = colour;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 facing, albedo; out vec4 colour;
uniform vec3 irradiance[9]; uniform float exposure; uniform bool shadow, chosen; uniform mat3 unturned;
void main() {
  if (shadow) { colour = vec4(0.0, 0.0, 0.0, 0.4); return; }
  vec3 n = unturned * normalize(facing);
  vec3 E = irradiance[0] + irradiance[1] * n.x + irradiance[2] * n.y + irradiance[3] * n.z + irradiance[4] * n.x * n.y
    + irradiance[5] * n.y * n.z + irradiance[6] * n.z * n.x + irradiance[7] * (n.x * n.x - n.y * n.y) + irradiance[8] * (3.0 * n.z * n.z - 1.0);
  vec3 L = clamp(max(E, 0.0) * albedo * exposure / 3.14159265, 0.0, 1.0);
  L = mix(12.92 * L, 1.055 * pow(L, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), L));
  colour = vec4(L, 1.0);
}`;

/** @typedef {{buffers: WebGLBuffer[], array: WebGLVertexArrayObject, count: number}} Mesh */
/** @typedef {{mesh: Mesh, foot: number[], moved: number[], turn: number, scale: number}} Placed */

export class Drawing {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.software = drawnBySoftware();
    const gl = canvas.getContext("webgl2", { alpha: true, stencil: true, antialias: !this.software, premultipliedAlpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2, which objects are drawn by");
    this.gl = gl;
    this.program = /** @type {WebGLProgram} */ (gl.createProgram());
    for (const [kind, text] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]])) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`shader: ${gl.getShaderInfoLog(shader)}`);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) throw new Error(`shaders: ${gl.getProgramInfoLog(this.program)}`);
  }

  /** @param {ArrayBuffer} bytes the number of vertices, nine floats each (place, normal, colour), the triangles' corners @returns {Mesh} */
  mesh(bytes) {
    const { gl } = this, [vertices] = new Uint32Array(bytes, 0, 1), corners = new Uint32Array(bytes, 4 + 36 * vertices);
    const array = /** @type {WebGLVertexArrayObject} */ (gl.createVertexArray());
    const buffers = [gl.createBuffer(), gl.createBuffer()].map((each) => /** @type {WebGLBuffer} */ (each));
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(bytes, 4, 9 * vertices), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[1]);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    for (let i = 0; i < 3; i++) {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, 3, gl.FLOAT, false, 36, 12 * i);
    }
    gl.bindVertexArray(null);
    return { buffers, array, count: corners.length };
  }

  /** @param {Mesh} mesh */
  forget(mesh) {
    this.gl.deleteVertexArray(mesh.array);
    for (const each of mesh.buffers) this.gl.deleteBuffer(each);
  }

  /**
   * @param {Placed[]} objects
   * @param {import("./projection.js").Lens} lens
   * @param {{x: number, y: number, zoom: number}} view
   * @param {{irradiance: number[][], lamp: number[], exposure: number, turn: number, ground: number}} light turn: degrees about +Y
   * @param {boolean} moving whether something is dragged: without a graphics card it is drawn at half the size meanwhile
   */
  draw(objects, lens, view, light, moving) {
    const { gl, canvas } = this, density = window.devicePixelRatio || 1, finer = moving && this.software ? 0.5 : 1;
    const width = Math.max(1, Math.round(canvas.clientWidth * density)), height = Math.max(1, Math.round(canvas.clientHeight * density));
    const [across, down] = [width, height].map((each) => Math.ceil(finer * each));
    if (canvas.width !== across || canvas.height !== down) Object.assign(canvas, { width: across, height: down });
    gl.viewport(0, 0, across, down);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.useProgram(this.program);
    const at = (/** @type {string} */ name) => gl.getUniformLocation(this.program, name), r = lens.rotation;
    gl.uniformMatrix3fv(at("rotation"), false, [r[0][0], r[1][0], r[2][0], r[0][1], r[1][1], r[2][1], r[0][2], r[1][2], r[2][2]]);
    gl.uniform3fv(at("position"), lens.position);
    gl.uniform1f(at("focal"), lens.focal_length);
    gl.uniform2fv(at("centre"), lens.centre);
    gl.uniform1fv(at("lens"), lens.distortion ?? [0, 0, 0, 0, 0]);
    gl.uniform3f(at("view"), view.x, view.y, view.zoom);
    gl.uniform2f(at("canvas"), width, height);
    gl.uniform3fv(at("irradiance"), light.irradiance.flat());
    gl.uniform1f(at("exposure"), light.exposure);
    gl.uniformMatrix3fv(at("unturned"), false, about(-light.turn));
    gl.uniform1f(at("ground"), light.ground);
    gl.uniform3fv(at("light"), turned(light.lamp, light.turn));
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    for (const shadow of [true, false]) {
      gl.uniform1i(at("shadow"), shadow ? 1 : 0);
      // A place that two triangles shade is dark once.
      if (shadow) {
        gl.disable(gl.DEPTH_TEST);
        gl.enable(gl.STENCIL_TEST);
        gl.stencilFunc(gl.EQUAL, 0, 0xff);
        gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
      } else {
        gl.disable(gl.STENCIL_TEST);
        gl.enable(gl.DEPTH_TEST);
      }
      for (const each of objects) {
        gl.uniform3fv(at("foot"), each.foot);
        gl.uniform3fv(at("moved"), each.moved);
        gl.uniform1f(at("scale"), each.scale);
        gl.uniformMatrix3fv(at("turn"), false, about(each.turn));
        gl.bindVertexArray(each.mesh.array);
        gl.drawElements(gl.TRIANGLES, each.mesh.count, gl.UNSIGNED_INT, 0);
      }
    }
    gl.bindVertexArray(null);
  }
}

/** Whether there is no graphics card: smooth edges take a processor twice the time. */
function drawnBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2"), names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && names ? String(gl.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/** The turn about +Y, column by column. @param {number} degrees */
function about(degrees) {
  const c = Math.cos((degrees * Math.PI) / 180), s = Math.sin((degrees * Math.PI) / 180);
  return [c, 0, -s, 0, 1, 0, s, 0, c];
}

/** @param {number[]} towards @param {number} turn degrees about +Y */
function turned(towards, turn) {
  const [x, y, z] = towards, m = about(turn);
  return [m[0] * x + m[6] * z, y, m[2] * x + m[8] * z];
}
