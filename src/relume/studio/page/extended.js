// True HDR: what the canvas draws beyond white goes to the screen by WebGPU, where the screen and the browser can.
// WebGL draws as ever; the same pixels as half floats, not cut at white, are shown by a canvas that lies over its own.

import { Refused } from "./requests.js";

/** Whether the screen shows more than white now, and the browser can hand it over. @param {any} [win] the window */
export const canExtend = (win = window) => Boolean(win.navigator.gpu) && win.matchMedia("(dynamic-range: high)").matches;

export class ExtendedScreen {
  /** @param {any} device @param {any} context @param {HTMLCanvasElement} shown */
  constructor(device, context, shown) {
    this.device = device;
    this.context = context;
    this.shown = shown;
  }

  /** A screen over a canvas; throws where the graphics card gives none. @param {HTMLCanvasElement} canvas
   *  @param {() => void} lost called when the card takes it away */
  static async over(canvas, lost) {
    const adapter = await /** @type {any} */ (navigator).gpu.requestAdapter();
    const device = await adapter?.requestDevice();
    if (!device) throw new Refused("this browser has no WebGPU for this graphics card; the picture stays as it is", 0, null);
    const shown = document.createElement("canvas"), context = /** @type {any} */ (shown.getContext("webgpu"));
    const { GPUTextureUsage: use } = /** @type {any} */ (window);
    context.configure({ device, format: "rgba16float", colorSpace: "srgb", alphaMode: "opaque", toneMapping: { mode: "extended" },
      usage: use.RENDER_ATTACHMENT | use.COPY_DST | use.COPY_SRC });
    // A browser that knows no tone mapping leaves it out: its picture would end at white as WebGL's does.
    if (context.getConfiguration?.().toneMapping?.mode !== "extended") {
      device.destroy();
      throw new Refused("this browser ends its pictures at white; the picture stays as it is", 0, null);
    }
    shown.className = "extended";
    shown.setAttribute("aria-hidden", "true");
    canvas.after(shown);
    device.lost.then(lost);
    return new ExtendedScreen(device, context, shown);
  }

  /** Show a frame. @param {number} width @param {number} height @param {Uint16Array} halves RGBA, extended sRGB, the highest row
   *  first */
  show(width, height, halves) {
    if (this.shown.width !== width || this.shown.height !== height) Object.assign(this.shown, { width, height });
    const layout = { bytesPerRow: 8 * width, rowsPerImage: height };
    this.device.queue.writeTexture({ texture: this.context.getCurrentTexture() }, halves, layout, [width, height]);
  }

  close() {
    this.shown.remove();
    this.device.destroy();
  }
}

/** The switch of a page: its button, hidden where there is no such screen, and its command.
 *  @param {import("./canvas.js").HdrCanvas} canvas @param {(error: unknown) => void} say */
export function hdrSwitch(canvas, say) {
  const button = document.createElement("button");
  Object.assign(button, { id: "hdr", type: "button", textContent: "HDR", title: "Beyond white as bright as the screen can (H)" });
  const show = () => {
    button.hidden = !canExtend();
    button.setAttribute("aria-pressed", String(canvas.screen !== null));
  };
  const off = () => {
    const { screen } = canvas;
    canvas.screen = null;
    screen?.close();
    show();
    canvas.draw();
  };
  const act = async () => {
    if (canvas.screen) return off();
    if (!canExtend()) return say("this screen or browser shows nothing beyond white");
    try {
      /** @type {ExtendedScreen} */ const screen = await ExtendedScreen.over(canvas.canvas, () => canvas.screen === screen && off());
      if (canvas.screen) return screen.close(); // asked for twice
      canvas.screen = screen;
      show();
      canvas.draw();
    } catch (error) {
      say(error);
    }
  };
  button.addEventListener("click", act);
  // The window may be moved to another screen.
  matchMedia("(dynamic-range: high)").addEventListener("change", () => (canvas.screen && !canExtend() ? off() : show()));
  show();
  return { button, command: { name: "True HDR: beyond white as bright as the screen can", keys: ["H"], act } };
}
