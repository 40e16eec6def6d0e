"""A part of a page on which a light map is turned by hand and the subject follows: WebGL, without a server.

A relit picture is a sum of K pictures, and the amount of picture k is ∫ L(ω) c_k(ω) dω with a function c_k over the
sphere (a low-rank basis of the field). Turning the light turns only the arguments of c_k, which is quick anywhere.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relume.image.bilinear import bilinear
from relume.image.colour import encode_srgb
from relume.image.files.photographs.png import encode
from relume.lightstage.relighting.interpolation import Smooth
from relume.lightstage.relighting.low_rank import LowRank
from relume.sphere.directions import rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

ROWS = 48
"""Of the functions c_k: 3.75 degrees, finer than stages' lights stand."""
LIGHT_ROWS = 64
# Amounts are found as `InteractiveBasis.amounts` finds them; the sum of pictures is the graphics card's.
AMOUNTS = """
function turn(yaw, pitch) {
  const c = Math.cos(yaw), s = Math.sin(yaw), d = Math.cos(pitch), t = Math.sin(pitch);
  return [c, s * t, s * d, 0, d, -t, -s, c * t, c * d];
}
function amounts(stage, flux, yaw, pitch) {
  const r = turn(yaw, pitch), K = stage.count, R = stage.rows, C = 2 * R;
  const rows = stage.light_rows, columns = 2 * rows, out = new Float64Array(3 * K), f = stage.functions;
  for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) {
    const at = 3 * (j * columns + i), red = flux[at], green = flux[at + 1], blue = flux[at + 2];
    if (red + green + blue === 0) continue;
    const polar = Math.PI * (j + 0.5) / rows, longitude = 2 * Math.PI * ((i + 0.5) / columns - 0.5);
    const ring = Math.sin(polar), x0 = ring * Math.sin(longitude), y0 = Math.cos(polar);
    const z0 = -ring * Math.cos(longitude), x = r[0] * x0 + r[1] * y0 + r[2] * z0;
    const y = r[3] * x0 + r[4] * y0 + r[5] * z0, z = r[6] * x0 + r[7] * y0 + r[8] * z0;
    const u = (0.5 + Math.atan2(x, -z) / (2 * Math.PI)) * C - 0.5;
    const v = Math.min(Math.max(Math.atan2(Math.hypot(x, z), y) / Math.PI * R - 0.5, 0), R - 1);
    const left = Math.floor(u), top = Math.min(Math.floor(v), R - 2), a = u - left, b = v - top;
    const first = ((left % C) + C) % C, second = (first + 1) % C;
    const p = (top * C + first) * K, q = (top * C + second) * K, low = C * K;
    for (let k = 0; k < K; k++) {
      const upper = f[p + k] * (1 - a) + f[q + k] * a, lower = f[p + low + k] * (1 - a) + f[q + low + k] * a;
      const value = upper * (1 - b) + lower * b;
      out[3 * k] += value * red; out[3 * k + 1] += value * green; out[3 * k + 2] += value * blue;
    }
  }
  return out;
}
"""

_PAGE = """
const floats = text => new Float32Array(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
const data = JSON.parse(document.getElementById("stage").textContent);
const stage = { ...data, functions: floats(data.functions) };
const lights = data.lights.map(each => ({ ...each, flux: floats(each.flux) }));
const canvas = document.getElementById("subject"), gl = canvas.getContext("webgl2");
const seen = document.getElementById("seen"), said = document.getElementById("said");
let yaw = 0, pitch = 0, chosen = 0, stops = 0, waiting = false;
const VERTEX = `#version 300 es
void main() { gl_Position = vec4(4.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0, 0, 1); }`;
const FRAGMENT = `#version 300 es
precision highp float; precision highp sampler2DArray; out vec4 colour;
uniform sampler2DArray pictures; uniform vec3 amount[${stage.count}]; uniform vec3 constant; uniform float gain;
void main() {
  vec3 sum = constant; ivec2 at = ivec2(gl_FragCoord.xy);
  at.y = textureSize(pictures, 0).y - 1 - at.y;
  for (int k = 0; k < ${stage.count}; k++) sum += amount[k] * texelFetch(pictures, ivec3(at, k), 0).rgb;
  vec3 v = max(gain * sum, 0.0);
  colour = vec4(mix(12.92 * v, 1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, v)), 1);
}`;
function shader(kind, source) {
  const made = gl.createShader(kind); gl.shaderSource(made, source); gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
  return made;
}
async function start() {
  if (!gl) { said.textContent = "This browser has no WebGL 2; the pictures above are what there is."; return; }
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, VERTEX));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, FRAGMENT));
  gl.linkProgram(program); gl.useProgram(program);
  gl.bindTexture(gl.TEXTURE_2D_ARRAY, gl.createTexture());
  gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA8, stage.width, stage.height, stage.count);
  gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  for (let k = 0; k < stage.count; k++) {
    const image = new Image(); image.src = "data:image/png;base64," + data.pictures[k]; await image.decode();
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, k, stage.width, stage.height, 1, gl.RGBA, gl.UNSIGNED_BYTE, image);
  }
  gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  const place = name => gl.getUniformLocation(program, name);
  const where = { amount: place("amount"), constant: place("constant"), gain: place("gain") };
  const draw = () => {
    waiting = false;
    const light = lights[chosen], found = amounts(stage, light.flux, yaw, pitch);
    const scaled = new Float32Array(3 * stage.count), constant = new Float32Array(3);
    for (let k = 0; k < stage.count; k++) for (let c = 0; c < 3; c++) {
      scaled[3 * k + c] = found[3 * k + c] * stage.step[k] * 255;
      constant[c] += found[3 * k + c] * stage.lowest[k];
    }
    gl.uniform3fv(where.amount, scaled); gl.uniform3fv(where.constant, constant);
    gl.uniform1f(where.gain, light.gain * Math.pow(2, stops));
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 3);
    seen.style.backgroundImage = `url(data:image/png;base64,${light.picture})`;
    seen.style.backgroundPositionX = `${-yaw / (2 * Math.PI) * seen.clientWidth}px`;
    const degrees = angle => Math.round(angle * 180 / Math.PI);
    const about = ((degrees(yaw) % 360) + 360) % 360;
    said.textContent = `turned by ${about}° about the vertical, tipped by ${degrees(pitch)}°`;
  };
  const ask = () => { if (!waiting) { waiting = true; requestAnimationFrame(draw); } };
  for (const element of [canvas, seen]) {
    element.addEventListener("pointerdown", event => element.setPointerCapture(event.pointerId));
    element.addEventListener("pointermove", event => {
      if (!event.buttons) return;
      yaw -= event.movementX / element.clientWidth * 2 * Math.PI;
      pitch = Math.min(Math.max(pitch + event.movementY / element.clientHeight * Math.PI, -Math.PI / 2), Math.PI / 2);
      ask();
    });
  }
  const changed = (name, kind, use) =>
    document.getElementById(name).addEventListener(kind, event => { use(Number(event.target.value)); ask(); });
  changed("light", "change", value => { chosen = value; });
  changed("stops", "input", value => { stops = value; });
  changed("turn", "input", value => { yaw = value * Math.PI / 180; });
  draw();
}
start();
"""


@dataclass(frozen=True, eq=False)
class InteractiveBasis:
    """What a page needs to relight a subject.

    codes : (K, H, W, 3) uint8; picture k is lowest[k] + step[k] · codes[k]
    lowest, step : (K,) float32
    functions : (ROWS, 2·ROWS, K) float32, c_k on a lat-long map
    """

    codes: np.ndarray
    lowest: np.ndarray
    step: np.ndarray
    functions: np.ndarray

    def amounts(self, light: EnvironmentMap, yaw: float, pitch: float) -> np.ndarray:
        """∫ L c_k dω, (K, 3), of a lat-long light turned by `yaw` about +Y after `pitch` about +X, radians."""
        flux = flux_of(light)
        turned = pixel_directions(LatLong(), flux.shape[0]) @ turn(yaw, pitch).T
        rows, columns = self.functions.shape[:2]
        x, y = np.moveaxis(LatLong().image_points(turned) * [columns, rows], -1, 0)
        # Round the seam; the rows of the poles go on over them.
        values = bilinear(np.pad(self.functions, ((0, 0), (1, 1), (0, 0)), mode="wrap"), x + 1, y)
        return np.einsum("hwk,hwc->kc", values, flux)

    def picture(self, amounts: np.ndarray) -> np.ndarray:
        """The relit picture (H, W, 3) float32."""
        scaled = (amounts * self.step[:, None]).astype(np.float32)
        return np.einsum("khwc,kc->hwc", self.codes, scaled, dtype=np.float32) + self.lowest @ amounts


def interactive_basis(basis: LowRank) -> InteractiveBasis:
    """The basis in 8 bits, and its functions of direction; glints, which no small basis holds, are left out."""
    pictures = np.asarray(basis.basis, np.float32)
    lowest = pictures.min(axis=(1, 2, 3))
    step = np.maximum((pictures.max(axis=(1, 2, 3)) - lowest) / 255, np.finfo(np.float32).tiny)
    codes = np.rint((pictures - lowest[:, None, None, None]) / step[:, None, None, None]).astype(np.uint8)
    directions = pixel_directions(LatLong(), ROWS)
    weights = Smooth().weights(basis.lights, directions.reshape(-1, 3))
    functions = (weights @ np.asarray(basis.coefficients, np.float64).T).reshape(ROWS, 2 * ROWS, -1)
    return InteractiveBasis(codes, lowest, step, functions.astype(np.float32))


def flux_of(light: EnvironmentMap) -> np.ndarray:
    """Radiance × solid angle (LIGHT_ROWS, 2·LIGHT_ROWS, 3) of a map made as small as a page can carry."""
    small = light.remapped(LatLong(), LIGHT_ROWS)
    return small.radiance.astype(np.float64) * small.mapping.solid_angles(LIGHT_ROWS)[..., None]


def turn(yaw: float, pitch: float) -> np.ndarray:
    """The rotation that tips by `pitch` about +X and then turns by `yaw` about +Y."""
    return rotation_about((0.0, 1.0, 0.0), yaw) @ rotation_about((1.0, 0.0, 0.0), pitch)


def turning_part(stage: InteractiveBasis, lights: Mapping[str, EnvironmentMap]) -> str:
    """HTML of the subject under maps that are turned by dragging.

    lights : by the name that is shown; at 0 stops the brightest hundredth of the subject is white under each
    """
    count, height, width = stage.codes.shape[:3]
    data = {
        "count": count, "height": height, "width": width, "rows": stage.functions.shape[0],
        "light_rows": 0, "lowest": stage.lowest.tolist(), "step": stage.step.tolist(),
        "functions": _packed(stage.functions),
        "pictures": [_text(encode(each, b"")) for each in stage.codes],
        "lights": [],
    }  # fmt: skip
    for light in lights.values():
        flux = flux_of(light)
        data["light_rows"] = flux.shape[0]
        bright = float(np.quantile(stage.picture(stage.amounts(light, 0.0, 0.0)), 0.99))
        shown = light.remapped(light.mapping, 2 * flux.shape[0]) if light.size > 2 * flux.shape[0] else light
        level = 0.5 / max(float(np.median(shown.radiance)), 1e-12)
        pixels = np.rint(255 * encode_srgb(np.clip(shown.radiance * level, 0, 1))).astype(np.uint8)
        data["lights"].append(
            {
                "flux": _packed(flux),
                "gain": 1 / max(bright, 1e-12),
                "picture": _text(encode(pixels, b"")),
            }
        )
    options = "".join(f'<option value="{i}">{html.escape(name)}</option>' for i, name in enumerate(lights))
    # "</" would end the element wherever it stood in the data.
    stored = json.dumps(data).replace("</", "<\\/")
    return (
        '<div class="turning" style="touch-action: none; user-select: none">'
        f'<canvas id="subject" width="{width}" height="{height}" style="width: min(100%, {2 * width}px); '
        'cursor: grab; background: #000"></canvas>'
        '<div id="seen" style="height: 9rem; aspect-ratio: 2; background-size: 100% 100%; background-repeat: repeat-x; '
        'cursor: grab; margin: .5rem 0"></div>'
        f'<p><label>light <select id="light">{options}</select></label> '
        '<label>turn <input id="turn" type="range" min="0" max="360" value="0"></label> '
        '<label>exposure <input id="stops" type="range" min="-4" max="4" step="0.1" value="0"></label> '
        '<span id="said"></span></p></div>'
        f'<script id="stage" type="application/json">{stored}</script><script>{AMOUNTS}{_PAGE}</script>'
    )


def _packed(values: np.ndarray) -> str:
    """Floats as a page can carry them: little-endian, in base 64."""
    return _text(np.ascontiguousarray(values, "<f4").tobytes())


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
