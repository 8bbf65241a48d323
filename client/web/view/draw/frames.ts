// Decides when frames are drawn, and how well: at once a quick one of few pixels, then, when
// nothing has moved for a while, a full one, then one with the style's light. Nothing is drawn
// while nothing changes.
import { createTarget, deleteTarget, type Target } from "./gl_objects";
import { ContextLost, type Painter } from "./painter";
import type { Quality, Variant } from "./params";
import type { Size } from "../camera/framing";
import { drawStrips } from "./strips";

// A view is at rest when it has not moved for this long.
const REST_MS = 160;
// Quick frames that took more have fewer pixels from then on, those that took less have more.
const SLOW_MS = 60,
  FAST_MS = 12;
// Images with more pixels take one ray a pixel (RenderQuality of server/render/render.h).
const SUPERSAMPLED_PIXELS_MAX = 1024 * 1024;

export const QUICK: Quality = { light: false, samples: 1, transparent: false };

/** The quality of an image at rest. */
export function restQuality(size: Size, transparent: boolean): Quality {
  const samples = size.width * size.height > SUPERSAMPLED_PIXELS_MAX ? 1 : 2;
  return { light: true, samples, transparent };
}

/** The subject of frames. */
export interface Scene {
  params(quality: Quality, size: Size): ArrayBuffer | null;
  variant(quality: Quality): Variant;
}

export interface FrameEvents {
  /** A frame is finished after so many milliseconds. */
  onFrame(milliseconds: number, atRest: boolean): void;
  /** Drawing failed for another reason than a lost context. */
  onError(error: unknown): void;
}

export class Frames {
  #scene: Scene | null = null;
  #quick: Target | null = null;
  #full: Target | null = null;
  #divisor = 2; // of the quick frame's width and height: 1, 2 or 4
  #version = 0; // of what is to be seen
  #restAt = 0; // time from which on the view is at rest
  #isRunning = false;
  #isStopped = false;

  constructor(
    private readonly painter: Painter,
    private readonly canvas: HTMLCanvasElement,
    private readonly events: FrameEvents,
    private readonly emptyColor: () => readonly [number, number, number],
  ) {}

  setScene(scene: Scene | null): void {
    this.#scene = scene;
  }

  /** Something changed; `isMoving`: and will go on changing. */
  invalidate(isMoving: boolean): void {
    ++this.#version;
    this.#restAt = performance.now() + (isMoving ? REST_MS : 0);
    if (this.#isRunning || this.#isStopped) return;
    this.#isRunning = true;
    requestAnimationFrame(() => void this.#run());
  }

  stop(): void {
    this.#isStopped = true;
    deleteTarget(this.painter.gl, this.#quick);
    deleteTarget(this.painter.gl, this.#full);
  }

  async #run(): Promise<void> {
    try {
      for (let drawn = -1; drawn !== this.#version && !this.#isStopped;) {
        drawn = this.#version;
        if (!(await this.#drawQuick())) break;
        if (drawn === this.#version) await this.#drawRest(drawn);
        if (drawn !== this.#version) await new Promise(requestAnimationFrame);
      }
    } catch (error) {
      if (!(error instanceof ContextLost) && !this.painter.gl.isContextLost())
        this.events.onError(error);
    } finally {
      this.#isRunning = false;
    }
  }

  /** Makes the canvas as large as it is on the screen; false if that is nothing. */
  #resize(): boolean {
    const {
        canvas,
        painter: { gl },
      } = this,
      ratio = devicePixelRatio || 1;
    const most = gl.getParameter(gl.MAX_RENDERBUFFER_SIZE) as number;
    const pixels = (css: number): number => Math.min(Math.round(css * ratio), most);
    const width = pixels(canvas.clientWidth),
      height = pixels(canvas.clientHeight);
    if (width < 1 || height < 1) return false;
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    return true;
  }

  #targetOf(old: Target | null, width: number, height: number): Target {
    if (old && old.width === width && old.height === height) return old;
    deleteTarget(this.painter.gl, old);
    return createTarget(this.painter.gl, width, height);
  }

  async #drawQuick(): Promise<boolean> {
    const { painter, canvas } = this,
      scene = this.#scene;
    if (!this.#resize()) return false;
    if (!scene) {
      painter.fill(this.emptyColor());
      return true;
    }
    const part = (pixels: number): number => Math.max(1, Math.round(pixels / this.#divisor));
    const size = { width: part(canvas.width), height: part(canvas.height) };
    const program = await painter.program(scene.variant(QUICK));
    const params = scene.params(QUICK, size);
    if (params === null || this.#isStopped || this.#scene !== scene) return true;
    this.#quick = this.#targetOf(this.#quick, size.width, size.height);
    const begin = performance.now();
    painter.draw(program, params, this.#quick, 0, size.height);
    painter.present(this.#quick);
    await painter.finished();
    const ms = performance.now() - begin;
    this.events.onFrame(ms, false);
    if (ms > SLOW_MS) this.#divisor = Math.min(this.#divisor * 2, 4);
    else if (ms < FAST_MS) this.#divisor = Math.max(this.#divisor / 2, 1);
    return true;
  }

  async #drawRest(version: number): Promise<void> {
    const { canvas, painter } = this,
      scene = this.#scene;
    if (!scene) return;
    const isOutdated = (): boolean => version !== this.#version || this.#isStopped;
    while (!isOutdated() && performance.now() < this.#restAt) {
      await new Promise((resolve) =>
        setTimeout(resolve, Math.max(1, this.#restAt - performance.now())),
      );
    }
    const size = { width: canvas.width, height: canvas.height };
    for (const quality of [QUICK, restQuality(size, false)]) {
      if (quality === QUICK && this.#divisor === 1) continue;
      const program = await painter.program(scene.variant(quality));
      if (isOutdated()) return;
      const params = scene.params(quality, size);
      if (params === null) return;
      this.#full = this.#targetOf(this.#full, size.width, size.height);
      const ms = await drawStrips(painter, program, params, this.#full, isOutdated);
      if (ms === null) return;
      painter.present(this.#full);
      if (quality !== QUICK) this.events.onFrame(ms, true);
    }
  }
}
