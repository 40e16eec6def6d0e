// The HDR canvas: a picture of floats, panned and enlarged, developed on the graphics card; nothing of the file changes.

import { Programs } from "./programs.js";
import { COLOURS } from "./shaders.js";
import { Source, texture, TILE } from "./source.js";

/** @typedef {import("./source.js").LayerFacts} LayerFacts */
/** @typedef {import("./programs.js").Linked} Linked */

const LARGEST_ZOOM = 256;
const INSIDE_WIDTH = 2048; // columns of a map from inside: finer than a screen shows of it
const SLOW = 24, MOVING = 150; // milliseconds: a frame that lasts longer is rough, while others follow within the second
const GAP = 2; // pixels of the screen between two pictures side by side
const ROUGH_PIXELS = 400_000; // of a rough frame, about; a processor that draws by software takes 10 ms for them

/** @typedef {"picture" | "wipe" | "beside" | "difference" | "inside"} Mode */

export class HdrCanvas {
  /** @param {HTMLCanvasElement} canvas @param {() => void} drawn called after every frame @param {(e: Error) => void} failed */
  constructor(canvas, drawn, failed) {
    this.canvas = canvas;
    this.drawn = drawn;
    this.failed = failed;
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2, which the picture is drawn by; try Firefox, Chrome, Edge or Safari");
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this graphics card draws no floats; try another browser");
    this.gl = gl;
    this.programs = new Programs(gl);
    this.colours = this.colourTexture();
    /** @type {Source | null} */ this.one = null;
    /** @type {Source | null} */ this.other = null;
    /** The relative error of each pixel of the picture, where that is known and wanted. @type {Source | null} */ this.errors = null;
    /** @type {WebGLTexture | null} */ this.map = null;
    this.mapScale = 1;
    this.mapTiles = 0; // that are still to come
    this.view = {
      x: 0, y: 0, zoom: 1, stops: 0, channel: 0, falseColour: false, low: -10, high: 10, clipping: false, marked: false, errors: false,
      /** @type {Mode} */ mode: "picture", wipe: 0.5, wipeLies: false, gain: 1, yaw: 0, pitch: 0, field: Math.PI / 2,
    };
    /** @type {{texture: WebGLTexture, buffer: WebGLFramebuffer}[]} */ this.floats = [];
    /** What shows more than white, where there is such a screen. @type {import("./extended.js").ExtendedScreen | null} */ this.screen = null;
    /** What it shows, before it goes there. @type {{texture: WebGLTexture, buffer: WebGLFramebuffer} | null} */ this.beyond = null;
    /** Where frames are drawn; null for the canvas itself. @type {WebGLFramebuffer | null} */ this.target = null;
    // The canvas in pixels of the screen. Its own buffer has fewer while frames are rough, and the browser enlarges it.
    this.width = canvas.width;
    this.height = canvas.height;
    canvas.style.imageRendering = "pixelated"; // by nearest pixels: the browser too may draw by software
    this.asked = false;
    this.moving = false; // whether the next frame shows another view, not only tiles that came
    this.last = -Infinity; // when the last frame was drawn
    this.lasting = 0; // milliseconds between frames, smoothed, while they follow each other
    this.rough = 0; // the timer of the sharp frame that follows a rough one
    new ResizeObserver(() => this.resized()).observe(canvas);
  }

  /** @param {LayerFacts} layer @param {import("./source.js").Fetched} fetched @param {boolean} reference
   *  @param {boolean} [goesOn] whether it follows what is shown, which stays until all of this is there */
  open(layer, fetched, reference = false, goesOn = false) {
    const before = reference ? this.other : this.one;
    if (before && before.layer.digest === layer.digest) return;
    if (!reference) this.closeErrors();
    const source = new Source(this.gl, layer, fetched, () => this.draw(), this.failed);
    if (goesOn && before) source.follow(before);
    else before?.close();
    if (reference) this.other = source;
    else {
      this.one = source;
      if (this.map) this.gl.deleteTexture(this.map);
      this.map = null;
    }
    this.draw();
  }

  closeReference() {
    this.other?.close();
    this.other = null;
    if (this.view.mode !== "inside") this.view.mode = "picture";
    this.draw();
  }

  /** Draw the picture's errors over it, which stays for the next picture where that has them. @param {LayerFacts} layer @param {import("./source.js").Fetched} fetched */
  openErrors(layer, fetched) {
    if (this.errors?.layer.digest !== layer.digest) {
      this.errors?.close();
      this.errors = new Source(this.gl, layer, fetched, () => this.draw(), this.failed);
    }
    this.set({ errors: true });
  }

  closeErrors() {
    this.errors?.close();
    this.errors = null;
    this.view.errors = false;
    this.draw();
  }

  resized() {
    const density = window.devicePixelRatio || 1;
    const width = Math.max(1, Math.round(this.canvas.clientWidth * density));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * density));
    if (this.width === width && this.height === height) return;
    this.width = width;
    this.height = height;
    this.draw();
  }

  /** Have so many pixels to draw. @param {number} width @param {number} height */
  buffered(width, height) {
    const { canvas, gl } = this;
    if (canvas.width === width && canvas.height === height) return;
    canvas.width = width;
    canvas.height = height;
    for (const each of [...this.floats, ...(this.beyond ? [this.beyond] : [])]) {
      gl.deleteTexture(each.texture);
      gl.deleteFramebuffer(each.buffer);
    }
    this.floats = [];
    this.beyond = null;
  }

  // Where things are. Screen coordinates are pixels of the screen, from its left and top.

  /** How wide the picture's part of the screen is: a half, where another one is beside it. */
  get across() {
    return this.isBeside ? Math.max(1, Math.floor((this.width - GAP) / 2)) : this.width;
  }

  get isBeside() {
    return this.view.mode === "beside" && this.other !== null;
  }

  /** Where the picture to the right begins, as a screen's column. */
  get right() {
    return this.width - this.across;
  }

  /** A column of the screen as one of the picture's own part: both show the same place there. @param {number} x */
  within(x) {
    return this.isBeside && x >= this.right ? x - this.right : x;
  }

  /** How many pixels of the picture one of another has as its side, where both show the same; 1 where they do not.
   *  @param {Source} source */
  ratio(source) {
    if (!this.one || source === this.one) return 1;
    const [[w, h], [a, b]] = [this.one.layer.sizes[0], source.layer.sizes[0]], found = w / a;
    return Math.abs(found * b - h) <= Math.max(1, found) ? found : 1;
  }

  /** @param {number} x @param {number} y */
  toPicture(x, y) {
    const { view } = this;
    return [view.x + (this.within(x) - this.across / 2) / view.zoom, view.y + (y - this.height / 2) / view.zoom];
  }

  /** @param {number} x @param {number} y */
  toScreen(x, y) {
    const { view } = this;
    return [(x - view.x) * view.zoom + this.across / 2, (y - view.y) * view.zoom + this.height / 2];
  }

  /** The unit vector of the world that a screen point shows of a map from inside. @param {number} x @param {number} y */
  directionAt(x, y) {
    const { right, up, ahead } = this.axes();
    const a = (2 * x) / this.width - 1, b = 1 - (2 * y) / this.height;
    const d = ahead.map((each, i) => each + a * right[i] + b * up[i]);
    const length = Math.hypot(...d);
    return d.map((each) => each / length);
  }

  axes() {
    const { yaw, pitch, field } = this.view;
    const tall = Math.tan(field / 2), wide = (tall * this.width) / this.height;
    const s = Math.sin(yaw), c = Math.cos(yaw), t = Math.sin(pitch), d = Math.cos(pitch);
    return {
      ahead: [s * d, t, -c * d],
      right: [c * wide, 0, s * wide],
      up: [-s * t * tall, d * tall, c * t * tall],
    };
  }

  // What the view is.

  /** @param {Partial<HdrCanvas["view"]>} change */
  set(change) {
    Object.assign(this.view, change);
    this.draw(true);
  }

  fit() {
    if (!this.one) return;
    const [width, height] = this.one.layer.sizes[0];
    const zoom = Math.min(this.across / width, this.height / height, LARGEST_ZOOM);
    this.set({ x: width / 2, y: height / 2, zoom, yaw: 0, pitch: 0, field: Math.PI / 2 });
  }

  /** Enlarge about a point of the screen, which stays where it is. @param {number} factor @param {number} x @param {number} y */
  enlarge(factor, x, y) {
    if (this.view.mode === "inside") {
      this.set({ field: Math.min(Math.max(this.view.field / factor, 0.02), 2.6) });
      return;
    }
    if (!this.one) return;
    const [width, height] = this.one.layer.sizes[0];
    const least = Math.min(1, this.across / width, this.height / height) / 4;
    const zoom = Math.min(Math.max(this.view.zoom * factor, least), LARGEST_ZOOM);
    const [a, b] = this.toPicture(x, y);
    this.set({ zoom, x: a - (this.within(x) - this.across / 2) / zoom, y: b - (y - this.height / 2) / zoom });
  }

  /** By pixels of the screen. @param {number} right @param {number} down */
  pan(right, down) {
    const { view } = this;
    if (view.mode === "inside") {
      const angle = view.field / this.height;
      const pitch = Math.min(Math.max(view.pitch + down * angle, -Math.PI / 2), Math.PI / 2);
      this.set({ yaw: view.yaw - right * angle, pitch });
    } else this.set({ x: view.x - right / view.zoom, y: view.y - down / view.zoom });
  }

  // Drawing.

  /** @param {boolean} [moving] whether the view changed, not only what is seen of it */
  draw(moving = false) {
    this.moving ||= moving;
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((now) => {
      this.asked = false;
      const rough = this.isSlow(now);
      this.moving = false;
      clearTimeout(this.rough);
      this.rough = rough ? window.setTimeout(() => this.sharpen(), MOVING) : 0;
      this.drawNow(rough);
      this.drawn();
    });
  }

  /** Whether frames follow each other more slowly than the eye likes. @param {number} now */
  isSlow(now) {
    const gap = now - this.last;
    this.last = now;
    if (gap > MOVING) this.lasting = 0;
    else this.lasting = this.lasting ? 0.8 * this.lasting + 0.2 * gap : gap;
    // Once rough, it stays so until nothing moves: the picture does not flicker between the two.
    return gap <= MOVING && (this.rough > 0 || (this.moving && this.lasting > SLOW));
  }

  sharpen() {
    this.rough = 0;
    this.last = -Infinity;
    this.draw();
  }

  /** @param {boolean} [rough] by fewer pixels, as slow machines do while the picture moves */
  drawNow(rough = false) {
    const { gl, width, height } = this;
    const part = rough ? Math.max(2, Math.round(Math.sqrt((width * height) / ROUGH_PIXELS))) : 1;
    this.buffered(Math.ceil(width / part), Math.ceil(height / part));
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    this.drawView();
    if (this.screen) this.drawBeyond(this.screen);
  }

  /** The same frame once more, not cut at white. @param {import("./extended.js").ExtendedScreen} screen */
  drawBeyond(screen) {
    const { gl } = this, { width, height } = this.canvas, halves = new Uint16Array(4 * width * height);
    this.beyond ??= this.floatBuffer(true);
    this.target = this.beyond.buffer;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    this.drawView();
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.HALF_FLOAT, halves);
    this.target = null;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    screen.show(width, height, halves);
  }

  drawView() {
    const { gl, view } = this;
    gl.clearColor(0.07, 0.07, 0.075, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (!this.one) return;
    if (view.mode === "inside") this.drawInside();
    else if ((view.mode === "wipe" || view.mode === "difference") && this.other) this.drawCompared(this.one, this.other, view.mode);
    else if (this.isBeside) this.drawBeside(this.one, /** @type {Source} */ (this.other));
    else if (view.errors && this.errors) this.drawCompared(this.one, this.errors, "errors");
    else this.drawPicture(this.one);
  }

  /** @param {Source} source @param {number} [gain] */
  drawPicture(source, gain = 1) {
    const { view } = this, plain = !view.channel && !view.falseColour && !view.clipping && !view.marked;
    const linked = this.program(plain ? "plain" : "show");
    this.gl.useProgram(linked.program);
    this.developing(linked);
    this.drawTiles(linked, source, gain);
  }

  /** Two pictures at the same place of each, by the same exposure. @param {Source} one @param {Source} other */
  drawBeside(one, other) {
    const { gl } = this, { width, height } = this.canvas, finer = width / this.width;
    const across = Math.round(this.across * finer);
    gl.viewport(0, 0, across, height);
    this.drawPicture(one);
    gl.viewport(width - across, 0, across, height);
    this.drawPicture(other, this.view.gain);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(across, 0, width - 2 * across, height);
    gl.clearColor(0.35, 0.36, 0.38, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.disable(gl.SCISSOR_TEST);
  }

  /** @param {Linked} linked @param {Source} source @param {number} [gain] */
  drawTiles(linked, source, gain = 1) {
    const { gl } = this, { sizes } = source.layer, scale = gain * source.layer.scale;
    const ratio = this.ratio(source), wanted = source.level(this.view.zoom * ratio);
    const [width, height] = sizes[0].map((each) => each * ratio); // in pixels of the picture
    const [left, top] = this.toPicture(0, 0), right = left + this.across / this.view.zoom, bottom = top + this.height / this.view.zoom;
    gl.uniform1f(linked.at("scale"), scale);
    gl.uniform1i(linked.at("tile"), 0);
    gl.activeTexture(gl.TEXTURE0);
    source.begin();
    /** The tiles of a level that are seen; null for those that have not come. @param {number} level @param {boolean} needed */
    const seen = (level, needed) => {
      const [w, h] = sizes[level], across = width / w, down = height / h, found = [];
      const first = [Math.max(0, Math.floor(left / across / TILE)), Math.max(0, Math.floor(top / down / TILE))];
      const last = [
        Math.min(Math.ceil(w / TILE) - 1, Math.floor(right / across / TILE)),
        Math.min(Math.ceil(h / TILE) - 1, Math.floor(bottom / down / TILE)),
      ];
      for (let row = first[1]; row <= last[1]; row++) for (let column = first[0]; column <= last[0]; column++) {
        found.push({ tile: source.tile(level, column, row, needed), column, row });
      }
      return found;
    };
    // The smallest level first: what has not come yet is seen less sharply until it has. What was seen before one enlarged
    // is sharper, and is not fetched for this alone.
    const sharp = seen(wanted, true), complete = sharp.every(({ tile }) => tile);
    const coarser = complete ? [] : [...new Set([sizes.length - 1, wanted + 1])].filter((each) => each > wanted && each < sizes.length);
    for (const level of [...coarser, wanted]) {
      const [w, h] = sizes[level], across = width / w, down = height / h;
      for (const { tile, column, row } of level === wanted ? sharp : seen(level, level === sizes.length - 1)) {
        if (!tile) continue;
        const [x0, y0] = this.toScreen(column * TILE * across, row * TILE * down);
        const [x1, y1] = this.toScreen(
          Math.min((column * TILE + tile.width) * across, width), Math.min((row * TILE + tile.height) * down, height),
        );
        gl.bindTexture(gl.TEXTURE_2D, tile.texture);
        gl.uniform4f(
          linked.at("place"), (2 * x0) / this.across - 1, 1 - (2 * y1) / this.height,
          (2 * x1) / this.across - 1, 1 - (2 * y0) / this.height,
        );
        gl.uniform4f(linked.at("part"), 0, 1, 1, 0); // row 0 is at the top
        gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
      }
    }
    source.end();
  }

  /** @param {Source} one @param {Source} other @param {"wipe" | "difference" | "errors"} mode */
  drawCompared(one, other, mode) {
    const { gl, view } = this;
    if (!this.floats.length) this.floats = [this.floatBuffer(), this.floatBuffer()];
    const copy = this.programs.of("copy");
    gl.useProgram(copy.program);
    for (const [source, target] of /** @type {[Source, typeof this.floats[0]][]} */ ([[one, this.floats[0]], [other, this.floats[1]]])) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.buffer);
      gl.clearColor(0, 0, 0, -1);
      gl.clear(gl.COLOR_BUFFER_BIT);
      this.drawTiles(copy, source, source === other && mode !== "errors" ? view.gain : 1);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    const linked = this.program("compare");
    gl.useProgram(linked.program);
    this.developing(linked);
    for (const [unit, name] of /** @type {[number, string][]} */ ([[0, "one"], [1, "other"]])) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, this.floats[unit].texture);
      gl.uniform1i(linked.at(name), unit);
    }
    gl.uniform1i(linked.at("mode"), { wipe: 1, difference: 2, errors: 3 }[mode]);
    gl.uniform2f(linked.at("edge"), view.wipe, view.wipeLies ? 1 : 0);
    gl.uniform4f(linked.at("place"), -1, -1, 1, 1);
    gl.uniform4f(linked.at("part"), 0, 0, 1, 1);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  drawInside() {
    const { gl } = this, source = /** @type {Source} */ (this.one);
    if (!this.map) {
      this.loadMap(source);
      return;
    }
    const linked = this.program("inside"), { right, up, ahead } = this.axes();
    gl.useProgram(linked.program);
    this.developing(linked);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    gl.uniform1i(linked.at("map"), 0);
    gl.uniform1f(linked.at("scale"), this.mapScale);
    for (const [name, axis] of /** @type {[string, number[]][]} */ ([["right", right], ["up", up], ["ahead", ahead]])) {
      gl.uniform3fv(linked.at(name), axis);
    }
    gl.uniform4f(linked.at("place"), -1, -1, 1, 1);
    gl.uniform4f(linked.at("part"), 0, 0, 1, 1);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  /** One texture of a whole map, at the level that is fine enough. @param {Source} source */
  loadMap(source) {
    const { gl } = this, { sizes, half, scale } = source.layer;
    const level = Math.max(0, sizes.findIndex(([width]) => width <= INSIDE_WIDTH));
    const [width, height] = sizes[level];
    const map = texture(gl, width, height, half, null);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.REPEAT);
    if (half) {
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    }
    this.map = map;
    this.mapScale = scale;
    const stop = new AbortController();
    for (let row = 0; row * TILE < height; row++) for (let column = 0; column * TILE < width; column++) {
      this.mapTiles++;
      source.fetched(level, column, row, stop.signal).finally(() => this.mapTiles--).then((bytes) => {
        if (this.map !== map) return;
        const w = Math.min(TILE, width - column * TILE), h = Math.min(TILE, height - row * TILE);
        gl.bindTexture(gl.TEXTURE_2D, map);
        const values = half ? new Uint16Array(bytes) : new Float32Array(bytes);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, column * TILE, row * TILE, w, h, gl.RGBA, half ? gl.HALF_FLOAT : gl.FLOAT, values);
        this.draw();
      }).catch(this.failed);
    }
  }

  /** What draws to where frames are drawn now. @param {import("./programs.js").Name} name */
  program(name) {
    return this.programs.of(name, this.target !== null);
  }

  /** @param {Linked} linked */
  developing(linked) {
    const { gl, view } = this;
    gl.uniform1f(linked.at("exposure"), 2 ** view.stops);
    gl.uniform1i(linked.at("channel"), view.channel);
    gl.uniform1i(linked.at("falseColour"), view.falseColour ? 1 : 0);
    gl.uniform2f(linked.at("stops"), view.low, view.high);
    gl.uniform1i(linked.at("clipping"), view.clipping ? 1 : 0);
    gl.uniform1i(linked.at("marked"), view.marked ? 1 : 0);
    gl.uniform1i(linked.at("turned"), this.target ? 1 : 0);
    gl.activeTexture(gl.TEXTURE7);
    gl.bindTexture(gl.TEXTURE_2D, this.colours);
    gl.uniform1i(linked.at("colours"), 7);
  }

  /** @param {boolean} [half] */
  floatBuffer(half = false) {
    const { gl, canvas } = this;
    const made = texture(gl, canvas.width, canvas.height, half, null);
    const buffer = /** @type {WebGLFramebuffer} */ (gl.createFramebuffer());
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, made, 0);
    return { texture: made, buffer };
  }

  colourTexture() {
    const { gl } = this;
    const made = /** @type {WebGLTexture} */ (gl.createTexture());
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, COLOURS.length / 4, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, COLOURS);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    return made;
  }

  /** The screen's own bytes (red, green, blue, alpha) at a point. @param {number} x @param {number} y */
  screenAt(x, y) {
    this.drawNow();
    const found = new Uint8Array(4);
    this.gl.readPixels(Math.floor(x), this.height - 1 - Math.floor(y), 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, found);
    return Array.from(found);
  }

  /** Whether every tile of the last frame is there. */
  get settled() {
    return !this.asked && !this.rough && !this.mapTiles && (this.one?.settled ?? true) && (this.other?.settled ?? true)
      && (this.errors?.settled ?? true);
  }
}
