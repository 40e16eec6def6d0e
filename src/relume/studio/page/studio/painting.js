// A matte painted over the plate: how much of each pixel a thing in front covers, as the alpha of a canvas of its size.

const SHOWN = [240, 161, 50, 0.45];

export class Painting {
  /** @param {number} width @param {number} height of the plate @param {HTMLCanvasElement} over where it is shown */
  constructor(width, height, over) {
    this.matte = document.createElement("canvas");
    Object.assign(this.matte, { width, height });
    this.context = /** @type {CanvasRenderingContext2D} */ (this.matte.getContext("2d", { willReadFrequently: true }));
    this.over = over;
    /** @type {[number, number] | null} */ this.last = null;
  }

  /** Take over a matte that was painted elsewhere: its alpha, or where that is whole its grey. @param {ImageBitmap} picture */
  load(picture) {
    this.context.clearRect(0, 0, this.matte.width, this.matte.height);
    this.context.drawImage(picture, 0, 0);
    const pixels = this.context.getImageData(0, 0, this.matte.width, this.matte.height), { data } = pixels;
    let whole = true;
    for (let i = 3; i < data.length && whole; i += 4) whole = data[i] === 255;
    for (let i = 0; i < data.length; i += 4) {
      if (whole) data[i + 3] = data[i];
      data[i] = data[i + 1] = data[i + 2] = 255;
    }
    this.context.putImageData(pixels, 0, 0);
  }

  clear() {
    this.context.clearRect(0, 0, this.matte.width, this.matte.height);
  }

  /** From the last point of a stroke to here. @param {number} x @param {number} y @param {number} radius @param {boolean} erase */
  stroke(x, y, radius, erase) {
    const { context } = this, [a, b] = this.last ?? [x, y];
    this.last = [x, y];
    context.globalCompositeOperation = erase ? "destination-out" : "source-over";
    Object.assign(context, { strokeStyle: "#fff", lineWidth: 2 * radius, lineCap: "round", lineJoin: "round" });
    context.beginPath();
    context.moveTo(a, b);
    context.lineTo(x + (a === x && b === y ? 0.001 : 0), y);
    context.stroke();
  }

  end() {
    this.last = null;
  }

  /** @param {[number, number][]} corners @param {boolean} erase */
  fill(corners, erase) {
    const { context } = this;
    context.globalCompositeOperation = erase ? "destination-out" : "source-over";
    context.fillStyle = "#fff";
    context.beginPath();
    corners.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.closePath();
    context.fill();
  }

  /** @returns {Promise<Blob>} PNG, whose alpha is the matte */
  png() {
    return new Promise((done, failed) => this.matte.toBlob((blob) => (blob ? done(blob) : failed(new Error("the matte cannot be written"))), "image/png"));
  }

  /** Show it over the picture. @param {{toScreen: (x: number, y: number) => number[]}} canvas @param {number} width @param {number} height of the screen, its own pixels */
  draw(canvas, width, height) {
    const { over } = this;
    if (over.width !== width || over.height !== height) Object.assign(over, { width, height });
    const context = /** @type {CanvasRenderingContext2D} */ (over.getContext("2d")), [l, t] = canvas.toScreen(0, 0);
    const [r, b] = canvas.toScreen(this.matte.width, this.matte.height);
    context.globalCompositeOperation = "copy";
    context.drawImage(this.matte, l, t, r - l, b - t);
    context.globalCompositeOperation = "source-in";
    context.fillStyle = `rgba(${SHOWN.join()})`;
    context.fillRect(0, 0, width, height);
  }
}
