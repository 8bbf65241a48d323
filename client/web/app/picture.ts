// The view without WebGL 2: pictures that the daemon draws. While the camera moves they are small
// and one is asked for at a time; at rest one follows in full.
import type { Api } from "./api";
import { isAbort } from "./api";
import type { Camera, Section, Style } from "../view/viewer";

const REST_MS = 180;
const SIDE_MAX = 2048; // pixels of a picture at rest
const DEGREES_PER_PIXEL = 0.4;

export const START: Readonly<Camera> = {
  azimuth: 30,
  elevation: 20,
  zoom: 1,
  pan: [0, 0],
  projection: "perspective",
};

/** The options of /v1/grids/{id}/render.png for a view. The daemon has no pan. */
export function viewOptions(
  camera: Camera,
  style: Style,
  section: Section,
): Record<string, string> {
  const isFixed = style === "iso";
  return {
    style,
    ...(isFixed
      ? {}
      : { azimuth: camera.azimuth.toFixed(1), elevation: camera.elevation.toFixed(1) }),
    ...(camera.zoom === 1 ? {} : { zoom: camera.zoom.toFixed(3) }),
    ...(section.plane
      ? { section: section.plane.map(value => Number(value.toPrecision(9))).join(",") }
      : {}),
  };
}

export class Picture {
  style: Style = "voxel";
  section: Section = { plane: null, box: null };
  onCamera: ((camera: Camera) => void) | null = null;
  onProblem: (error: unknown) => void = () => undefined;

  #current: Camera = { ...START };
  #path = ""; // of the picture, without its query
  #loading: AbortController | null = null;
  #isStale = false;
  #dragging: AbortController | null = null;
  #rest = 0;
  #url = "";

  constructor(
    private readonly image: HTMLImageElement,
    private readonly api: Api,
  ) {
    image.addEventListener("pointerdown", event => this.#drag(event));
    image.addEventListener("dragstart", event => event.preventDefault());
    image.addEventListener(
      "wheel",
      event => {
        event.preventDefault();
        this.#zoomBy(Math.exp(-event.deltaY / 500));
      },
      { passive: false },
    );
    image.addEventListener("keydown", event => this.#press(event));
  }

  get camera(): Camera {
    return { ...this.#current };
  }
  set camera(camera: Camera) {
    this.#current = { ...camera };
    this.redraw();
  }

  /** Shows pictures of `path` (…/render.png); empty: nothing. */
  show(path: string, camera: Camera = START): void {
    this.#path = path;
    this.camera = camera;
    if (path) return;
    window.clearTimeout(this.#rest);
    this.#loading?.abort();
    this.#isStale = false;
    this.image.removeAttribute("src");
    URL.revokeObjectURL(this.#url);
    this.#url = "";
  }

  /** Draws anew after a change: at once and small, and in full when nothing changes any more. */
  redraw(): void {
    window.clearTimeout(this.#rest);
    this.#rest = window.setTimeout(() => void this.#load(true), REST_MS);
    void this.#load(false);
  }

  async #load(isAtRest: boolean): Promise<void> {
    if (!this.#path) return;
    if (this.#loading && !isAtRest) {
      // the next one starts when this one is there
      this.#isStale = true;
      return;
    }
    this.#loading?.abort();
    const loading = (this.#loading = new AbortController());
    const box = this.image.getBoundingClientRect();
    const scale = isAtRest ? Math.min(window.devicePixelRatio, 2) : 0.5;
    const side = (length: number) =>
      String(Math.max(16, Math.min(SIDE_MAX, Math.round(length * scale))));
    const query = new URLSearchParams({
      ...viewOptions(this.#current, this.style, this.section),
      background: "transparent",
      width: side(box.width),
      height: side(box.height),
      samples: isAtRest ? "auto" : "1",
    });
    try {
      const blob = await (
        await this.api.request(`${this.#path}?${query}`, { signal: loading.signal })
      ).blob();
      loading.signal.throwIfAborted();
      const old = this.#url;
      this.#url = this.image.src = URL.createObjectURL(blob);
      URL.revokeObjectURL(old);
    } catch (error) {
      if (!isAbort(error)) this.onProblem(error);
    }
    if (this.#loading !== loading) return;
    this.#loading = null;
    if (this.#isStale) {
      this.#isStale = false;
      void this.#load(false);
    }
  }

  #moved(): void {
    this.onCamera?.(this.camera);
    this.redraw();
  }

  #turn(azimuth: number, elevation: number): void {
    this.#current.azimuth = (this.#current.azimuth + azimuth) % 360;
    this.#current.elevation = Math.max(-90, Math.min(90, this.#current.elevation + elevation));
    this.#moved();
  }

  #zoomBy(factor: number): void {
    this.#current.zoom = Math.max(0.05, Math.min(200, this.#current.zoom * factor));
    this.#moved();
  }

  #drag(start: PointerEvent): void {
    this.image.setPointerCapture(start.pointerId);
    this.#dragging?.abort();
    const dragging = (this.#dragging = new AbortController()),
      { signal } = dragging;
    let { clientX: x, clientY: y } = start;
    const move = (event: PointerEvent) => {
      this.#turn((x - event.clientX) * DEGREES_PER_PIXEL, (event.clientY - y) * DEGREES_PER_PIXEL);
      ({ clientX: x, clientY: y } = event);
    };
    this.image.addEventListener("pointermove", move, { signal });
    for (const end of ["pointerup", "pointercancel"])
      this.image.addEventListener(end, () => dragging.abort(), { signal });
  }

  #press(event: KeyboardEvent): void {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const turns: Record<string, readonly [number, number]> = {
      ArrowLeft: [-10, 0],
      ArrowRight: [10, 0],
      ArrowUp: [0, 10],
      ArrowDown: [0, -10],
    };
    const by = turns[event.key];
    if (by) this.#turn(...by);
    else if (event.key === "+" || event.key === "=") this.#zoomBy(1.2);
    else if (event.key === "-") this.#zoomBy(1 / 1.2);
    else if (event.key === "f" || event.key === "F") this.#zoomBy(1 / this.#current.zoom);
    else if (event.key === "r" || event.key === "R") {
      this.#current = { ...START };
      this.#moved();
    } else return;
    event.preventDefault();
  }
}
