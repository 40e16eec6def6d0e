// The plate's camera: points of the world on the photograph, and points of the photograph on a level plane. The
// camera's rotation has right, up and backward as its columns; distortion is OpenCV's.

/** @typedef {{size: [number, number], focal_length: number, centre: [number, number], position: number[], rotation: number[][],
 *   distortion: number[] | null}} Lens */

/** @param {number} x @param {number} y @param {number[] | null} d @returns {[number, number]} */
function distorted(x, y, d) {
  if (!d) return [x, y];
  const [k1, k2, p1, p2, k3] = d, r = x * x + y * y, R = 1 + r * (k1 + r * (k2 + r * k3));
  return [x * R + 2 * p1 * x * y + p2 * (r + 2 * x * x), y * R + p1 * (r + 2 * y * y) + 2 * p2 * x * y];
}

/** A point of the world in pixels; NaN behind the camera. @param {Lens} lens @param {number[]} point @returns {[number, number]} */
export function project(lens, point) {
  const d = point.map((each, i) => each - lens.position[i]), r = lens.rotation;
  const [x, y, z] = [0, 1, 2].map((axis) => d[0] * r[0][axis] + d[1] * r[1][axis] + d[2] * r[2][axis]);
  if (z >= -1e-9) return [NaN, NaN];
  const [a, b] = distorted(x / -z, -y / -z, lens.distortion);
  return [lens.centre[0] + lens.focal_length * a, lens.centre[1] + lens.focal_length * b];
}

/** The direction through a pixel, not of length 1. @param {Lens} lens @param {number} x @param {number} y */
export function ray(lens, x, y) {
  const a = (x - lens.centre[0]) / lens.focal_length, b = (y - lens.centre[1]) / lens.focal_length;
  let [u, v] = [a, b];
  // Distortion is undone by repetition: it changes little from one step to the next.
  for (let i = 0; lens.distortion && i < 30; i++) {
    const [p, q] = distorted(u, v, lens.distortion);
    u += a - p;
    v += b - q;
  }
  return lens.rotation.map((row) => row[0] * u - row[1] * v - row[2]);
}

/** Where the ray through a pixel meets the plane y = height; null where it does not. @param {Lens} lens @param {number} x
 *  @param {number} y @param {number} height @returns {[number, number, number] | null} */
export function onPlane(lens, x, y, height = 0) {
  const d = ray(lens, x, y), t = (height - lens.position[1]) / d[1];
  if (!(t > 0) || !Number.isFinite(t)) return null;
  return [lens.position[0] + t * d[0], height, lens.position[2] + t * d[2]];
}

/** How high the ray through a pixel passes a vertical line: where it is nearest to it, seen from above; null where it does not come near.
 *  @param {Lens} lens @param {number} x @param {number} y @param {number} X of the vertical line, metres @param {number} Z */
export function onVertical(lens, x, y, X, Z) {
  const d = ray(lens, x, y), across = d[0] * d[0] + d[2] * d[2], [a, height, b] = lens.position;
  const t = ((X - a) * d[0] + (Z - b) * d[2]) / across;
  return t > 0 && Number.isFinite(t) ? height + t * d[1] : null;
}

/** A straight line of the world as points of the picture, bent as the lens bends it. @param {Lens} lens @param {number[]} from
 *  @param {number[]} to @param {number} [parts] @returns {[number, number][]} */
export function line(lens, from, to, parts = 16) {
  return Array.from({ length: parts + 1 }, (_, i) => project(lens, from.map((each, axis) => each + ((to[axis] - each) * i) / parts)));
}

/** A grid of straight lines before the lens, twelve fields across: as the photograph has it, and as it were without distortion.
 *  @param {Lens} lens */
export function grid(lens) {
  const [width, height] = lens.size, step = width / 12, along = 48;
  /** @type {[number, number][][]} */ const bent = [];
  /** @type {[number, number][][]} */ const straight = [];
  let furthest = 0, at = [0, 0];
  /** @param {(t: number) => [number, number]} point */
  const add = (point) => {
    const points = Array.from({ length: along + 1 }, (_, i) => point(i / along));
    straight.push(points);
    bent.push(points.map(([x, y]) => {
      const [a, b] = distorted((x - lens.centre[0]) / lens.focal_length, (y - lens.centre[1]) / lens.focal_length, lens.distortion);
      const seen = /** @type {[number, number]} */ ([lens.centre[0] + lens.focal_length * a, lens.centre[1] + lens.focal_length * b]);
      const by = Math.hypot(seen[0] - x, seen[1] - y);
      if (by > furthest) [furthest, at] = [by, seen];
      return seen;
    }));
  };
  for (let x = 0; x <= width + 1e-6; x += step) add((t) => [x, t * height]);
  for (let y = (height / 2) % step; y <= height + 1e-6; y += step) add((t) => [t * width, y]);
  return { bent, straight, furthest, at };
}

/** How many pixels of a larger picture lie along one of a smaller, which leaves out less than one of its own at the edge; 0 for other
 *  pictures. @param {[number, number]} large @param {[number, number]} small */
export function wholePixels(large, small) {
  const step = Math.floor(large[0] / small[0]);
  return step >= 1 && Math.floor(large[1] / step) === small[1] && Math.floor(large[0] / step) === small[0] ? step : 0;
}
