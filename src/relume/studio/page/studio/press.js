// A pane that is built anew between press and release would lose the click: the browser gives it to what was pressed,
// which is no longer there. So building waits for the release.

/** What of a pane is clicked. A list of choices is not among them: a browser may keep its release for itself. */
const CLICKED = "button, summary, label, input[type=checkbox]";

export class Press {
  /** @param {HTMLElement} root the pane */
  constructor(root) {
    this.held = false;
    /** @type {(() => void) | null} */ this.due = null;
    root.addEventListener("pointerdown", (event) => {
      this.held = /** @type {Element} */ (event.target).closest(CLICKED) !== null;
    }, true);
    // The click comes after the release, and before what is put off here.
    for (const each of ["pointerup", "pointercancel", "blur"]) window.addEventListener(each, () => setTimeout(() => this.release()), true);
  }

  /** Do something as soon as nothing is pressed: now or at the release; of several the last. @param {() => void} act */
  wait(act) {
    if (this.held) this.due = act;
    else act();
  }

  release() {
    const act = this.due;
    this.held = false;
    this.due = null;
    act?.();
  }
}
