// The view of the current grid: the WebGL viewer, or pictures of the daemon where there is none.
import { isAbort, type Api } from "./api";
import { createViewer } from "../view/create_viewer";
import { levelFor, partFor, type Part } from "./detail";
import { Picture } from "./picture";
import { START } from "../view/controls";
import type { GridMeta } from "./model";
import type { Camera, Channel, GridInfo, Hit, Section, Style, Vec3, Viewer } from "../view/viewer";

const REST_MS = 250; // without a move, before a part is drawn finer
const COARSER_LEVELS = 2; // tried where a grid has too many bricks
const CACHED_BYTES_MAX = 64 << 20; // of containers; the oldest go first

/** The place of a grid and what is known of it. */
export interface Shown {
  readonly path: string; // "/v1/grids/{id}" or "/v1/jobs/{id}/frames/{index}"
  readonly meta: GridMeta;
}

export class Stage {
  viewer: Viewer | null; // null without WebGL 2, or once its context is lost for good
  readonly picture: Picture;
  level = 0; // of the grid that is shown
  declare region: readonly [Vec3, Vec3]; // the section's box in the grid's cells
  declare onLost: () => void;
  declare onProblem: (error: unknown) => void;

  #shown: Shown | null = null;
  #info: GridInfo | null = null;
  readonly #fetching = new Map<string, Promise<ArrayBuffer>>();
  readonly #cache = new Map<string, ArrayBuffer>();
  #showing = 0; // turns of exchanges
  #settled = 0; // the last one that is not under way any more
  #part: Part | null = null; // drawn in the grid's place
  #drawnLevel = 0; // of the part, or of the grid
  #rest = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly image: HTMLImageElement,
    private readonly api: Api,
    workerUrl: string,
    wantsViewer: boolean,
  ) {
    this.viewer = wantsViewer ? createViewer(canvas, workerUrl) : null;
    this.picture = new Picture(image, api);
    this.picture.onProblem = error => this.onProblem(error);
    if (this.viewer) {
      this.viewer.onCamera = () => this.#refineSoon();
      this.viewer.onLost = () => this.#lose();
    }
    canvas.hidden = !this.viewer;
    image.hidden = Boolean(this.viewer);
  }

  /** The path of what is shown: "/v1/grids/{id}", or empty. */
  get path(): string {
    return this.#shown?.path ?? "";
  }
  get grid(): GridInfo | null {
    return this.viewer ? this.viewer.grid : this.#info;
  }
  get camera(): Camera {
    return (this.viewer ?? this.picture).camera;
  }
  set camera(camera: Camera) {
    (this.viewer ?? this.picture).camera = camera;
    this.#refineSoon();
  }
  get style(): Style {
    return this.picture.style;
  }
  set style(style: Style) {
    this.picture.style = style;
    if (this.viewer) this.viewer.style = style;
    else this.picture.redraw();
  }
  get channel(): Channel | null {
    return this.viewer?.channel ?? null;
  }
  set channel(channel: Channel | null) {
    if (this.viewer) this.viewer.channel = channel;
  }
  get section(): Section {
    return this.picture.section;
  }
  set section(section: Section) {
    this.picture.section = section;
    if (this.viewer) this.viewer.section = section;
    else this.picture.redraw();
    this.#refineSoon();
  }

  /** The cell of level 0 under a point, or the first one of its cube; and cells on a cube's side. */
  cellOf({ cell }: Hit): Vec3 {
    const { scale } = this;
    return cell.map(
      (v, c) => (v + Math.floor((this.#part?.box[0][c] ?? 0) / scale)) * scale,
    ) as unknown as Vec3;
  }
  get scale(): number {
    return 2 ** this.#drawnLevel;
  }

  /** Exchanges the picture in place. Throws Problem, DecodeError, or AbortError if superseded. */
  async show(shown: Shown, keepCamera: boolean): Promise<void> {
    const turn = ++this.#showing,
      { viewer } = this;
    let level = 0;
    try {
      if (viewer) {
        const show = (bytes: ArrayBuffer) => viewer.show(bytes, { keepCamera });
        level = await this.#decode(shown, "", levelFor(shown.meta.dims), turn, show);
        this.#checkTurn(turn);
      }
    } catch (error) {
      this.#checkTurn(turn);
      if (this.viewer) throw error; // else it was disposed of: the context was lost meanwhile
    } finally {
      if (turn === this.#showing) this.#settled = turn;
    }
    if (!this.viewer) {
      level = 0;
      this.picture.show(`${shown.path}/render.png`, keepCamera ? this.picture.camera : START);
    }
    this.#shown = shown;
    this.#info = infoOf(shown.meta);
    this.#part = null;
    this.level = this.#drawnLevel = level;
    this.#refineSoon();
  }

  /**
   * Shows a grid that is still being made: the containers of its first tiles, in place of those of
   * the preview that is shown. null if that is none of the viewer. Throws as show() does.
   */
  async grow(parts: readonly ArrayBuffer[]): Promise<GridInfo | null> {
    const preview = this.#cache.get(this.path);
    if (!this.viewer || !preview) return null;
    const turn = ++this.#showing;
    try {
      return await this.viewer.showTiles(parts, preview);
    } finally {
      if (turn === this.#showing) this.#settled = turn;
    }
  }

  clear(): void {
    ++this.#showing;
    this.#shown = this.#info = this.#part = null;
    this.level = this.#drawnLevel = 0;
    this.#fetching.clear();
    this.#cache.clear();
    this.viewer?.clear();
    this.picture.show("");
  }

  /** Fetches a grid that will be shown soon. */
  prefetch({ path, meta }: Shown): void {
    if (this.viewer) void this.#fetchGrid(path, queryOf(levelFor(meta.dims))).catch(() => undefined);
  }

  #checkTurn(turn: number): void {
    if (turn !== this.#showing) throw new DOMException("", "AbortError");
  }

  #refineSoon(): void {
    clearTimeout(this.#rest);
    if (!this.level) return;
    this.#rest = setTimeout(() => {
      this.#refine().catch((error: unknown) => {
        if (!isAbort(error)) this.onProblem(error);
      });
    }, REST_MS);
  }

  // Draws what a close camera sees at a finer level, or all of it again.
  async #refine(): Promise<void> {
    const { viewer, level } = this,
      shown = this.#shown;
    if (!viewer || !shown?.meta.dims || this.#settled !== this.#showing) return;
    const seen = viewer.visibleCells(),
      part = partFor(seen, level, viewer.pixelsPerCell(), shown.meta.dims, this.#part);
    if (part === this.#part) return;
    const turn = ++this.#showing;
    try {
      const show = (bytes: ArrayBuffer | null) => viewer.showPart(bytes);
      if (!part) await show(null);
      const drawn = part
        ? await this.#decode(shown, part.box.join(), part.level, turn, show)
        : level;
      this.#checkTurn(turn);
      this.#part = part;
      this.#drawnLevel = drawn;
    } finally {
      if (turn === this.#showing) this.#settled = turn;
    }
    this.#refineSoon(); // the camera may have moved meanwhile
  }

  // Draws the region, or all, at the finest level from `level` on that the viewer can draw, which it
  // returns. A container of codec small is asked for as fast.
  async #decode(
    { path }: Shown,
    region: string,
    first: number,
    turn: number,
    show: (bytes: ArrayBuffer) => Promise<unknown>,
  ): Promise<number> {
    for (let level = first, codec = ""; ;) {
      // The error of a superseded turn is not told.
      const bytes = await this.#fetchGrid(path, queryOf(level, region, codec)).finally(() =>
        this.#checkTurn(turn),
      );
      try {
        await show(bytes);
        return level;
      } catch (error) {
        if ((error as Error).name !== "DecodeError") throw error;
        if (!codec && /codec/.test((error as Error).message)) codec = "fast";
        else if (++level > first + COARSER_LEVELS) throw error; // else it has too many bricks
      }
    }
  }

  async #fetchGrid(path: string, query: string): Promise<ArrayBuffer> {
    const key = path + query;
    const known = this.#cache.get(key) ?? this.#fetching.get(key);
    if (known) return known;
    const fetched = this.api
      .request(key, { headers: { Accept: "application/vnd.voxeld.grid" } })
      .then(response => response.arrayBuffer());
    this.#fetching.set(key, fetched);
    try {
      const bytes = await fetched;
      if (this.#fetching.get(key) === fetched) this.#keep(key, bytes); // else the cache was cleared
      return bytes;
    } finally {
      if (this.#fetching.get(key) === fetched) this.#fetching.delete(key);
    }
  }

  #keep(key: string, bytes: ArrayBuffer): void {
    this.#cache.set(key, bytes);
    let sum = 0;
    for (const kept of this.#cache.values()) sum += kept.byteLength;
    for (const [old, { byteLength }] of this.#cache) {
      if (sum <= CACHED_BYTES_MAX) break;
      this.#cache.delete(old);
      sum -= byteLength;
    }
  }

  #lose(): void {
    if (!this.viewer) return;
    const { camera } = this.viewer;
    this.viewer.dispose();
    this.viewer = this.#part = null;
    this.level = this.#drawnLevel = 0;
    if (document.activeElement === this.canvas) this.canvas.parentElement?.focus();
    this.canvas.hidden = true;
    this.image.hidden = false;
    this.onLost();
    if (this.#shown) this.picture.show(`${this.#shown.path}/render.png`, camera);
  }
}

function queryOf(level: number, region = "", codec = ""): string {
  const query = new URLSearchParams({
    ...(level > 0 ? { level: String(level) } : {}),
    ...(region ? { region } : {}),
    ...(codec ? { codec } : {}),
  }).toString();
  return query && `?${query}`;
}

function infoOf(meta: GridMeta): GridInfo | null {
  if (!meta.dims || !meta.origin || !meta.voxel_size) return null;
  const known = ["color", "normal", "material", "label", "distance", "coverage"];
  return {
    dims: meta.dims,
    origin: meta.origin,
    voxelSize: meta.voxel_size,
    voxels: meta.voxel_count ?? 0,
    channels: (meta.channels ?? []).filter(name => known.includes(name)) as Channel[],
  };
}
