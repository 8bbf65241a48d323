// Turns pointers, wheel and keys into camera moves.
import { zoomed } from "./camera/framing";
import type { Camera } from "./viewer";

export const START: Camera = {
  azimuth: 30,
  elevation: 20,
  zoom: 1,
  pan: [0, 0],
  projection: "perspective",
};

export const ZOOM_MIN = 0.01;
export const ZOOM_MAX = 1000;

const DEGREES_PER_HEIGHT = 200; // a drag over the canvas's height turns so far
const DEGREES_PER_KEY = 5;
const PAN_PER_KEY = 0.05;
const ZOOM_PER_KEY = 1.2;
const ZOOM_PER_WHEEL_PIXEL = 0.0015;
const WHEEL_PIXELS = [1, 16, 400]; // by WheelEvent.deltaMode: pixels, lines, pages
const RESET_MS = 250;

export interface ControlTarget {
  camera(): Camera;
  /** Moves by the user's hand. */
  move(camera: Camera): void;
  turn(azimuth: number, elevation: number): void;
}

interface Point {
  readonly x: number; // CSS pixels in the canvas
  readonly y: number;
}

export class Controls {
  readonly #pointers = new Map<number, Point>();
  readonly #listeners = new AbortController();
  #isPanning = false;
  #resetting = 0;

  constructor(
    private readonly canvas: HTMLElement,
    private readonly target: ControlTarget,
  ) {
    if (!canvas.hasAttribute("tabindex")) canvas.tabIndex = 0;
    canvas.style.touchAction = "none";
    const { signal } = this.#listeners;
    canvas.addEventListener("pointerdown", (event) => this.#down(event), { signal });
    canvas.addEventListener("pointermove", (event) => this.#moved(event), { signal });
    for (const end of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(end, (event) => this.#pointers.delete(event.pointerId), { signal });
    }
    canvas.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { signal, passive: false });
    canvas.addEventListener("keydown", (event) => this.#key(event), { signal });
  }

  dispose(): void {
    this.#listeners.abort();
    cancelAnimationFrame(this.#resetting);
  }

  #place(event: MouseEvent): Point {
    const box = this.canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  /** Fractions of the height from the middle, y up. */
  #fractions(point: Point): Point {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return { x: (point.x - width / 2) / height, y: (height / 2 - point.y) / height };
  }

  #down(event: PointerEvent): void {
    cancelAnimationFrame(this.#resetting);
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, this.#place(event));
    this.#isPanning = event.button !== 0 || event.shiftKey || event.ctrlKey;
    event.preventDefault();
  }

  #moved(event: PointerEvent): void {
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    const now = this.#place(event),
      height = this.canvas.clientHeight;
    if (this.#pointers.size === 2) this.#pinch(event.pointerId, before, now);
    else if (this.#pointers.size === 1 && this.#isPanning)
      this.#pan((now.x - before.x) / height, (before.y - now.y) / height);
    else if (this.#pointers.size === 1) this.#turn(before, now);
    this.#pointers.set(event.pointerId, now);
  }

  #turn(before: Point, now: Point): void {
    const per = DEGREES_PER_HEIGHT / this.canvas.clientHeight,
      camera = this.target.camera();
    this.target.turn(
      camera.azimuth - (now.x - before.x) * per,
      camera.elevation + (now.y - before.y) * per,
    );
  }

  #pan(x: number, y: number): void {
    cancelAnimationFrame(this.#resetting);
    const camera = this.target.camera();
    this.target.move({ ...camera, pan: [camera.pan[0] + x, camera.pan[1] + y] });
  }

  /** Two fingers: their distance zooms around the point between them, which pans. */
  #pinch(id: number, before: Point, now: Point): void {
    const other = [...this.#pointers].find(([pointer]) => pointer !== id)![1];
    const apart = (p: Point): number => Math.max(Math.hypot(p.x - other.x, p.y - other.y), 1);
    const middle = (p: Point): Point =>
      this.#fractions({ x: (p.x + other.x) / 2, y: (p.y + other.y) / 2 });
    const from = middle(before),
      to = middle(now);
    this.#pan(to.x - from.x, to.y - from.y);
    this.#zoom(apart(now) / apart(before), to);
  }

  #zoom(by: number, at: Point): void {
    cancelAnimationFrame(this.#resetting);
    const camera = this.target.camera();
    // At its limits the zoom pans no more.
    const zoom = Math.min(Math.max(camera.zoom * by, ZOOM_MIN), ZOOM_MAX);
    this.target.move(zoomed(camera, zoom, at.x, at.y));
  }

  #wheel(event: WheelEvent): void {
    event.preventDefault();
    const pixels = event.deltaY * WHEEL_PIXELS[event.deltaMode]!;
    this.#zoom(Math.exp(-pixels * ZOOM_PER_WHEEL_PIXEL), this.#fractions(this.#place(event)));
  }

  #key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const arrows: Record<string, readonly [number, number]> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, 1],
      ArrowDown: [0, -1],
    };
    const arrow = arrows[event.key],
      middle = { x: 0, y: 0 },
      camera = this.target.camera();
    if (arrow && event.shiftKey) this.#pan(arrow[0] * PAN_PER_KEY, arrow[1] * PAN_PER_KEY);
    else if (arrow) {
      cancelAnimationFrame(this.#resetting);
      this.target.turn(
        camera.azimuth + arrow[0] * DEGREES_PER_KEY,
        camera.elevation + arrow[1] * DEGREES_PER_KEY,
      );
    } else if (event.key === "+" || event.key === "=") this.#zoom(ZOOM_PER_KEY, middle);
    else if (event.key === "-" || event.key === "_") this.#zoom(1 / ZOOM_PER_KEY, middle);
    else if (event.key === "r" || event.key === "R") this.#reset();
    else return;
    event.preventDefault();
  }

  /** Goes to the start; at once if the user prefers less motion. */
  #reset(): void {
    cancelAnimationFrame(this.#resetting);
    const from = this.target.camera(),
      to: Camera = { ...START, projection: from.projection };
    if (matchMedia("(prefers-reduced-motion: reduce)").matches)
      return this.target.move(to);
    // The shorter way around.
    const turn = ((((to.azimuth - from.azimuth) % 360) + 540) % 360) - 180,
      begin = performance.now();
    const step = (now: number): void => {
      const t = Math.min(Math.max((now - begin) / RESET_MS, 0), 1),
        s = t * t * (3 - 2 * t);
      const mix = (a: number, b: number): number => a + s * (b - a);
      if (t < 1) this.#resetting = requestAnimationFrame(step);
      this.target.move(
        t === 1
          ? to
          : {
              ...to,
              azimuth: from.azimuth + s * turn,
              elevation: mix(from.elevation, to.elevation),
              zoom: from.zoom * (to.zoom / from.zoom) ** s,
              pan: [mix(from.pan[0], 0), mix(from.pan[1], 0)],
            },
      );
    };
    this.#resetting = requestAnimationFrame(step);
  }
}
