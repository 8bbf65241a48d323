// The timeline of an animation: frames by a slider, and played at their rate.
import { h } from "./dom";
import { t, T } from "./texts";

const AHEAD = 8; // frames that are fetched before they are shown

export interface TimelineHooks {
  show(frame: number): Promise<void>;
  prefetch(frame: number): void;
  onProblem(error: unknown): void;
}

export class Timeline {
  #frames = 0; // that can be shown
  #total = 0;
  #frame = 0;
  #fps = 24;
  #isPlaying = false;
  #turn = 0; // of playing and pausing
  #isDrawing = false;
  readonly #slider = h("input", {
    type: "range",
    value: 0,
    "aria-label": T.frame,
  });
  // An output is a live region, which would be read with each frame.
  readonly #text = h("output", { "aria-live": "off" });
  readonly #button = h("button", { onclick: () => this.#play(!this.#isPlaying) }, T.play);

  constructor(
    private readonly element: HTMLElement,
    private readonly hooks: TimelineHooks,
  ) {
    element.append(this.#button, this.#slider, this.#text);
    this.#slider.oninput = () => {
      this.#play(false);
      void this.#seek(Number(this.#slider.value));
    };
  }

  /** The number of frames that there are so far, of `total`. 0, 0: no animation. */
  show(frames: number, total: number, fps: number): void {
    this.#frames = frames;
    this.#total = total;
    this.#fps = fps;
    this.element.hidden = total < 2;
    this.#slider.max = String(Math.max(0, frames - 1));
    if (this.#frame >= frames) this.#frame = 0;
    if (this.element.hidden) this.#play(false);
    this.#showText();
  }

  get current(): number {
    return this.#frame;
  }

  #showText(): void {
    this.#slider.value = String(this.#frame);
    this.#text.textContent = t(T.frameOf, { n: this.#frame + 1, total: this.#total });
    this.#slider.setAttribute("aria-valuetext", this.#text.textContent);
  }

  async #seek(frame: number): Promise<void> {
    this.#frame = frame;
    this.#showText();
    if (this.#isDrawing) return; // the newest follows
    this.#isDrawing = true;
    try {
      for (let drawn = -1; this.#frames && drawn !== this.#frame;) {
        drawn = this.#frame;
        await this.hooks.show(drawn);
      }
    } catch (error) {
      this.#play(false);
      this.hooks.onProblem(error);
    } finally {
      this.#isDrawing = false;
    }
  }

  #play(isPlaying: boolean): void {
    if (this.#isPlaying === isPlaying) return;
    this.#isPlaying = isPlaying;
    ++this.#turn;
    this.#button.textContent = (isPlaying ? T.pause : T.play);
    if (isPlaying) void this.#run(this.#turn);
  }

  // Frames that cannot be drawn in time are skipped, so that the animation keeps its rate.
  async #run(turn: number): Promise<void> {
    let start = performance.now() - (1000 * this.#frame) / this.#fps;
    for (;;) {
      await new Promise(resolve => requestAnimationFrame(resolve));
      if (turn !== this.#turn) return;
      const due = Math.floor(((performance.now() - start) / 1000) * this.#fps);
      const frame = due % this.#frames;
      if (due >= this.#frames * 1000) start = performance.now();
      if (frame === this.#frame) continue;
      for (let i = 1; i <= AHEAD; ++i) this.hooks.prefetch((frame + i) % this.#frames);
      await this.#seek(frame);
    }
  }
}
