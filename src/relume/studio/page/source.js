// A layer of a picture as tiles: fetched when they are seen, kept on the graphics card, the longest unseen let go first.

/** @typedef {{name: string, digest: string, half: boolean, scale: number, sizes: [number, number][], smallest: number,
 *   largest: number, median: number, odd: number, marked: boolean}} LayerFacts */
/** @typedef {{name: string, kind: string, unit: string, mapping: string | null, size: [number, number],
 *   layers: LayerFacts[], notes: string[], noise: number | null}} PictureFacts */
/** @typedef {{texture: WebGLTexture, width: number, height: number}} Tile */

export const TILE = 512;
const MOST_BYTES = 512 * 1024 * 1024;
const AT_ONCE = 6;

/** Where tiles come from: their bytes, as the server or the page itself has them. */
/** @typedef {(level: number, column: number, row: number, signal: AbortSignal) => Promise<ArrayBuffer>} Fetched */

export class Source {
  /**
   * @param {WebGL2RenderingContext} gl
   * @param {LayerFacts} layer
   * @param {Fetched} fetched
   * @param {() => void} arrived called when a tile can be drawn
   * @param {(error: Error) => void} failed
   */
  constructor(gl, layer, fetched, arrived, failed) {
    this.gl = gl;
    this.layer = layer;
    this.fetched = fetched;
    this.arrived = arrived;
    this.failed = failed;
    /** @type {Map<string, Tile>} */
    this.tiles = new Map();
    /** @type {Map<string, AbortController>} */
    this.coming = new Map();
    /** @type {string[]} */
    this.wanted = [];
    this.bytes = 0;
    /** What is shown where this is not there yet. @type {Source | null} */ this.before = null;
  }

  /** Have another's tiles shown until all of this is there, if they are of the same sizes and values. @param {Source} other */
  follow(other) {
    const { layer } = this, alike = ["half", "scale", "sizes"].every((key) => JSON.stringify(layer[/** @type {"half"} */ (key)]) === JSON.stringify(other.layer[/** @type {"half"} */ (key)]));
    other.before?.close();
    other.before = null;
    if (alike) this.before = other;
    else other.close();
  }

  /** The level of which a picture pixel is at least one pixel of the screen. @param {number} zoom */
  level(zoom) {
    const wanted = Math.floor(Math.log2(1 / Math.max(zoom, 1e-9)) + 1e-6);
    return Math.min(Math.max(wanted, 0), this.layer.sizes.length - 1);
  }

  /** The tile, or null; asked for where it is not there yet, unless it is not needed.
   * @param {number} level @param {number} column @param {number} row @param {boolean} needed */
  tile(level, column, row, needed) {
    const key = `${level}/${column}/${row}`;
    const found = this.tiles.get(key);
    if (found) {
      this.tiles.delete(key); // to the end: seen last
      this.tiles.set(key, found);
      return found;
    }
    if (needed && !this.coming.has(key) && !this.wanted.includes(key)) this.wanted.push(key);
    return this.before?.tiles.get(key) ?? null;
  }

  /** Begin a frame: what is not asked for again in it need not come. */
  begin() {
    this.wanted = [];
  }

  /** Fetch what the frame asked for. */
  end() {
    this.wanted.sort((one, other) => parseInt(other) - parseInt(one)); // the small levels first
    while (this.wanted.length && this.coming.size < AT_ONCE) {
      const key = /** @type {string} */ (this.wanted.shift());
      const stop = new AbortController();
      this.coming.set(key, stop);
      const [level, column, row] = key.split("/").map(Number);
      this.fetched(level, column, row, stop.signal)
        .then((bytes) => this.keep(key, level, column, row, bytes))
        .catch((error) => {
          if (!stop.signal.aborted) this.failed(error);
        })
        .finally(() => {
          this.coming.delete(key);
          if (this.settled) {
            this.before?.close();
            this.before = null;
          }
          if (!stop.signal.aborted) this.arrived();
        });
    }
  }

  /** @param {string} key @param {number} level @param {number} column @param {number} row @param {ArrayBuffer} bytes */
  keep(key, level, column, row, bytes) {
    const [width, height] = this.layer.sizes[level];
    const w = Math.min(TILE, width - column * TILE), h = Math.min(TILE, height - row * TILE);
    this.tiles.set(key, { texture: texture(this.gl, w, h, this.layer.half, bytes), width: w, height: h });
    this.bytes += bytes.byteLength;
    for (const [old, tile] of this.tiles) {
      if (this.bytes <= MOST_BYTES || this.tiles.size <= 64) break;
      this.gl.deleteTexture(tile.texture);
      this.tiles.delete(old);
      this.bytes -= tile.width * tile.height * (this.layer.half ? 8 : 16);
    }
  }

  /** Whether all that the last frame asked for is there. */
  get settled() {
    return this.coming.size === 0 && this.wanted.length === 0;
  }

  close() {
    this.before?.close();
    this.before = null;
    for (const stop of this.coming.values()) stop.abort();
    for (const tile of this.tiles.values()) this.gl.deleteTexture(tile.texture);
    this.tiles.clear();
  }
}

/** @param {WebGL2RenderingContext} gl @param {number} width @param {number} height @param {boolean} half
 *  @param {ArrayBuffer | null} bytes */
export function texture(gl, width, height, half, bytes) {
  const made = /** @type {WebGLTexture} */ (gl.createTexture());
  gl.bindTexture(gl.TEXTURE_2D, made);
  const [inner, type] = half ? [gl.RGBA16F, gl.HALF_FLOAT] : [gl.RGBA32F, gl.FLOAT];
  const values = bytes && (half ? new Uint16Array(bytes) : new Float32Array(bytes));
  gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, gl.RGBA, type, values);
  for (const [name, value] of [
    [gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
    [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
  ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
  return made;
}
