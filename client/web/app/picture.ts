// The view without WebGL 2: pictures that the daemon draws. While the camera moves they are small
// and one is asked for at a time; at rest one follows in full.
import type { Api } from "./api";
import { isAbort } from "./api";
import { Controls, START } from "../view/controls";
import type { Camera, Section, Style } from "../view/viewer";

const REST_MS = 180;
const SIDE_MAX = 2048; // pixels of a picture at rest

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
  declare onProblem: (error: unknown) => void;

  #current: Camera = { ...START };
  #path = ""; // of the picture, without its query
  #loading: AbortController | null = null;
  #isStale = false;
  #rest = 0;
  #url = "";

  constructor(
    private readonly image: HTMLImageElement,
    private readonly api: Api,
  ) {
    new Controls(image, {
      camera: () => this.#current,
      move: camera => {
        this.camera = camera;
      },
      turn: (azimuth, elevation) => {
        const up = Math.max(-90, Math.min(90, elevation));
        this.camera = { ...this.#current, azimuth: azimuth % 360, elevation: up };
      },
    });
    image.addEventListener("dragstart", event => event.preventDefault());
  }

  get camera(): Camera {
    return { ...this.#current };
  }
  set camera(camera: Camera) {
    this.#current = { ...camera };
    this.redraw();
  }

  /** Shows pictures of `path` (…/render.png); empty: nothing. */
  show(path: string, camera = START): void {
    this.#path = path;
    this.camera = camera;
    if (path) return;
    clearTimeout(this.#rest);
    this.#loading?.abort();
    this.#isStale = false;
    this.image.removeAttribute("src");
    URL.revokeObjectURL(this.#url);
    this.#url = "";
  }

  /** Draws anew after a change: at once and small, and in full when nothing changes any more. */
  redraw(): void {
    clearTimeout(this.#rest);
    this.#rest = setTimeout(() => void this.#load(true), REST_MS);
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
    const scale = isAtRest ? Math.min(devicePixelRatio, 2) : 0.5;
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
}
