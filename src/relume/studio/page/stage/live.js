// A picture that comes anew many times a second: the same textures, filled again, for the HDR canvas to draw.

import { TILE } from "../source.js";

/** @typedef {{name: string, half: boolean, width: number, height: number, bytes: ArrayBuffer}} Picture */

/** Where pictures go: it stands for a `Source` of one level, whose tiles are always there. */
export class LivePicture {
  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    this.layer = /** @type {import("../source.js").LayerFacts} */ ({
      name: "picture", digest: "", half: true, scale: 1, sizes: [[1, 1]], smallest: 0, largest: 1, median: 0, odd: 0, marked: false,
    });
    /** @type {Map<string, import("../source.js").Tile>} */ this.tiles = new Map();
    this.settled = true;
    this.shown = 0; // the level of the last picture: whole, or at half its size
  }

  level() {
    return this.shown;
  }

  /** @param {number} level @param {number} column @param {number} row */
  tile(level, column, row) {
    return level === this.shown ? this.tiles.get(`${level}/${column}/${row}`) ?? null : null;
  }

  begin() {}
  end() {}
  close() {}

  /** Show another picture: of any size, or the one that is there, at half its size. @param {Picture} picture @param {boolean} [small] */
  fill({ name, half, width, height, bytes }, small = false) {
    const { gl, layer } = this, level = small ? 1 : 0, [w, h] = layer.sizes[level] ?? [0, 0];
    if (w !== width || h !== height || layer.half !== half) {
      for (const [key, tile] of this.tiles) {
        if (small && layer.half === half && key.startsWith("0/")) continue;
        gl.deleteTexture(tile.texture);
        this.tiles.delete(key);
      }
      layer.sizes = small ? [layer.sizes[0], [width, height]] : [[width, height]];
    }
    this.shown = level;
    layer.digest = name;
    layer.half = half;
    const values = half ? new Uint16Array(bytes) : new Float32Array(bytes), type = half ? gl.HALF_FLOAT : gl.FLOAT;
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.pixelStorei(gl.UNPACK_ROW_LENGTH, width);
    for (let row = 0; row * TILE < height; row++) for (let column = 0; column * TILE < width; column++) {
      const across = Math.min(TILE, width - column * TILE), down = Math.min(TILE, height - row * TILE);
      const key = `${level}/${column}/${row}`;
      let tile = this.tiles.get(key);
      if (!tile) this.tiles.set(key, (tile = { texture: storage(gl, across, down, half), width: across, height: down }));
      gl.bindTexture(gl.TEXTURE_2D, tile.texture);
      gl.pixelStorei(gl.UNPACK_SKIP_PIXELS, column * TILE);
      gl.pixelStorei(gl.UNPACK_SKIP_ROWS, row * TILE);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, across, down, gl.RGB, type, values);
    }
    for (const name of [gl.UNPACK_ROW_LENGTH, gl.UNPACK_SKIP_PIXELS, gl.UNPACK_SKIP_ROWS]) gl.pixelStorei(name, 0);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  }
}

/** @param {WebGL2RenderingContext} gl @param {number} width @param {number} height @param {boolean} half */
function storage(gl, width, height, half) {
  const made = /** @type {WebGLTexture} */ (gl.createTexture());
  gl.bindTexture(gl.TEXTURE_2D, made);
  gl.texStorage2D(gl.TEXTURE_2D, 1, half ? gl.RGB16F : gl.RGB32F, width, height);
  for (const [name, value] of [
    [gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
    [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
  ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
  return made;
}
