// What the graphics card does with a pixel: the same few lines for tiles, for two pictures compared, for a map from inside.

const DEVELOP = `
precision highp float;
precision highp sampler2D;
uniform float exposure;      // 2^stops
uniform int channel;         // 0 all, 1 red, 2 green, 3 blue, 4 luminance
uniform bool falseColour;
uniform vec2 stops;          // of false colour: log2 of the least and of the most
uniform sampler2D colours;
uniform bool clipping, marked;
const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

vec3 encoded(vec3 light) {   // sRGB, IEC 61966-2-1; its power by a polynomial in v^¼, a hundredth of a code off
  vec3 v = clamp(light, 0.0, 1.0);
  vec3 t = sqrt(sqrt(v));
  vec3 power = (((0.0813283 * t - 0.3354975) * t + 1.1226783) * t + 0.1961370) * t - 0.0646117;
  vec3 shown = mix(12.92 * v, power, step(0.0031308, v));
#ifdef EXTENDED                // for a screen that shows more than white: sRGB's curve goes on beyond 1
  return mix(shown, 1.055 * pow(max(light, 1.0), vec3(1.0 / 2.4)) - 0.055, step(1.0, light));
#else
  return shown;
#endif
}
bool hatched(float width) { return mod(gl_FragCoord.x + gl_FragCoord.y, 2.0 * width) < width; }

vec3 plainly(vec3 v) {
  if (any(isnan(v)) || any(isinf(v))) return hatched(4.0) ? vec3(1.0, 0.0, 1.0) : vec3(0.0);
  return encoded(v * exposure);
}

vec3 developed(vec3 v, float mark) {
  if (any(isnan(v)) || any(isinf(v))) return hatched(4.0) ? vec3(1.0, 0.0, 1.0) : vec3(0.0);
  vec3 light = v;
  if (channel == 4) light = vec3(dot(v, LUMINANCE));
  else if (channel > 0) light = vec3(channel == 1 ? v.r : channel == 2 ? v.g : v.b);
  vec3 result;
  if (falseColour) {
    float share = (log2(max(dot(light, LUMINANCE), 1e-30)) - stops.x) / max(stops.y - stops.x, 1e-6);
    result = texture(colours, vec2(clamp(share, 0.001, 0.999), 0.5)).rgb;
  } else {
    result = encoded(light * exposure);
  }
  if (clipping && !falseColour) {
    vec3 seen = light * exposure;
    if (any(greaterThan(seen, vec3(1.0))) && hatched(4.0)) result = vec3(0.9, 0.1, 0.1);
    else if (all(lessThan(seen, vec3(0.0003))) && hatched(4.0)) result = vec3(0.1, 0.3, 0.9);
  }
  if (marked && mark > 0.5 && hatched(3.0)) {
    result = mark < 1.5 ? vec3(1.0, 0.55, 0.0) : mark < 2.5 ? vec3(0.2, 0.5, 1.0) : vec3(0.6);
  }
  return result;
}
`;

export const QUAD = `#version 300 es
uniform vec4 place;          // of the quad, in clip space: left, bottom, right, top
uniform vec4 part;           // of the texture
uniform bool turned;         // upside down, for what takes the highest row first
out vec2 at;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  at = mix(part.xy, part.zw, corner);
  vec2 point = mix(place.xy, place.zw, corner);
  gl_Position = vec4(point.x, turned ? -point.y : point.y, 0.0, 1.0);
}`;

/** @param {string} shown what becomes of a pixel @param {string} functions that it is written in */
const tile = (shown, functions = DEVELOP) => `#version 300 es
${functions}
uniform sampler2D tile;
uniform float scale;
in vec2 at;
out vec4 colour;
void main() {
  vec4 pixel = texture(tile, at);
  colour = ${shown};
}`;
export const TILE = tile("vec4(developed(pixel.rgb * scale, pixel.a), 1.0)");
// Nothing over the picture, as nearly always: a processor that draws by software takes half the time for it.
export const PLAIN = tile("vec4(plainly(pixel.rgb * scale), 1.0)");
// A tile as it is, into a picture of floats that two of are compared in.
export const COPY = tile("vec4(pixel.rgb * scale, pixel.a)", "precision highp float;\nprecision highp sampler2D;");

export const COMPARE = `#version 300 es
${DEVELOP}
uniform sampler2D one, other;
uniform int mode;            // 1 wipe, 2 signed difference, 3 the other is the relative error of the one
uniform vec2 edge;           // of the wipe: its place, 0 to 1, and 0 where it is upright, 1 where it lies
in vec2 at;
out vec4 colour;
const vec3 GROUND = vec3(0.07);
const vec2 ERRORS = vec2(-9.965784, 0.0);   // log2 of the least and of the most that is shown: a thousandth, the whole
void main() {
  vec4 a = texture(one, at), b = texture(other, at);
  if (mode == 1) {
    bool first = edge.y < 0.5 ? at.x < edge.x : at.y > 1.0 - edge.x;
    vec4 pixel = first ? a : b;
    colour = vec4(pixel.a < -0.5 ? GROUND : developed(pixel.rgb, pixel.a), 1.0);
  } else if (a.a < -0.5 || b.a < -0.5) {
    colour = vec4(GROUND, 1.0);
  } else if (mode == 3) {
    // The picture in grey, as far as its error leaves it: by false colour where there is one, of the channel that has most.
    float error = max(b.r, max(b.g, b.b)), share = (log2(max(error, 1e-30)) - ERRORS.x) / (ERRORS.y - ERRORS.x);
    vec3 grey = vec3(dot(developed(a.rgb, a.a), LUMINANCE));
    bool unknown = any(isnan(b.rgb)) || any(isinf(b.rgb));
    vec3 over = unknown ? vec3(hatched(4.0) ? 0.55 : 0.1) : texture(colours, vec2(clamp(share, 0.001, 0.999), 0.5)).rgb;
    colour = vec4(mix(grey, over, unknown ? 1.0 : error > 0.0 ? 0.7 : 0.0), 1.0);
  } else {
    vec3 more = (a.rgb - b.rgb) * exposure;   // warm where the picture is brighter than the reference, blue where darker
    float d = dot(more, LUMINANCE);
    if (isnan(d) || isinf(d)) colour = vec4(hatched(4.0) ? vec3(1.0, 0.0, 1.0) : vec3(0.0), 1.0);
    else colour = vec4(channel == 0 ? encoded(0.18 + more) : encoded(d > 0.0 ? vec3(d, 0.45 * d, 0.0) : vec3(0.0, -0.35 * d, -d)), 1.0);
  }
}`;

// An equirectangular map from inside: −Z in the middle, +X to its right.
export const INSIDE = `#version 300 es
${DEVELOP}
uniform sampler2D map;
uniform float scale;
uniform vec3 right, up, ahead;   // of the view, right and up as long as the tangents of half its angles
in vec2 at;
out vec4 colour;
const float PI = 3.14159265358979;
void main() {
  vec2 p = 2.0 * at - 1.0;
  vec3 d = normalize(ahead + p.x * right + p.y * up);
  vec2 uv = vec2(0.5 + atan(d.x, -d.z) / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
  vec4 pixel = textureLod(map, uv, 0.0);
  colour = vec4(developed(pixel.rgb * scale, pixel.a), 1.0);
}`;

// Viridis in eight steps (Smith & van der Walt, 2015; CC0), between which the card interpolates.
export const COLOURS = new Uint8Array([
  68, 1, 84, 255, 70, 50, 126, 255, 54, 92, 141, 255, 39, 127, 142, 255, 31, 161, 135, 255, 74, 193, 109, 255,
  160, 218, 57, 255, 253, 231, 37, 255,
]);
