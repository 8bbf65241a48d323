// The viewer of viewer.ts: state, and what happens when it changes.
import { orbited, subjectOf, type Size, type Subject } from "./camera/framing";
import type { ImageRays } from "./camera/image_rays";
import type { Vec4 } from "./camera/matrix";
import { visibleCells } from "./camera/visible_cells";
import { Controls, START, ZOOM_MAX, ZOOM_MIN } from "./controls";
import { channelIn, ownChannel } from "./decode/channels";
import { Decoder } from "./decoder";
import { Frames, restQuality, type Scene } from "./draw/frames";
import { createTarget, deleteTarget, GridTextures } from "./draw/gl_objects";
import { Painter } from "./draw/painter";
import { keptCells, paramsOf, planeInGrid, raysOf, variantOf, type Look } from "./draw/params";
import { encodePng } from "./draw/png";
import { drawStrips } from "./draw/strips";
import { STYLES } from "./draw/styles";
import { TABLE_COLUMNS, type PackedGrid, type Paint } from "./pack/packed_grid";
import { pickVoxel } from "./pick";
import type { Camera, Channel, GridInfo, Hit, Section, Seen, Style, Vec3, Viewer } from "./viewer";
import type { Encoded } from "./worker_messages";

const IMAGE_SIDE_MAX = 4096;
// A lost context that the browser does not give back within this time is reported.
const RESTORE_MS = 10_000;
// Rays along a side of the image that look for the voxels in front.
const SEEN_RAYS = 24;

interface Shown {
  grid: PackedGrid; // its means are those of `paint`
  readonly info: GridInfo;
  readonly subject: Subject;
  paint: Paint | null;
  painted: Channel | null; // the channel of `paint`; null: the grid's own
}

function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}

function validCamera(camera: Camera): Camera {
  const { elevation, zoom } = camera;
  return { ...camera, elevation: clamp(elevation, -90, 90), zoom: clamp(zoom, ZOOM_MIN, ZOOM_MAX) };
}

function infoOf(grid: PackedGrid): GridInfo {
  const { dims, origin, voxelSize, voxels, channels } = grid;
  return { dims, origin, voxelSize, voxels, channels };
}

class WebGlViewer implements Viewer {
  onCamera: ((camera: Camera) => void) | null = null;
  onFrame: ((milliseconds: number, atRest: boolean) => void) | null = null;
  onLost: (() => void) | null = null;

  readonly #decoder: Decoder;
  readonly #controls: Controls;
  readonly #resizes: ResizeObserver;
  readonly #listeners = new AbortController();
  #painter!: Painter;
  #frames!: Frames;
  #shown: Shown | null = null;
  #part: Shown | null = null; // drawn in the grid's place
  #view: Camera = START;
  #look: Style = "voxel";
  #channelShown: Channel | null = null;
  #cut: Section = { plane: null, box: null };
  #lostTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly gl: WebGL2RenderingContext,
    workerUrl: string,
  ) {
    this.#decoder = new Decoder(workerUrl);
    this.#begin();
    this.#controls = new Controls(canvas, {
      camera: () => this.#view,
      move: (camera) => this.#moveByHand(camera),
      turn: (azimuth, elevation) => this.#turnByHand(azimuth, elevation),
    });
    this.#resizes = new ResizeObserver(() => this.#frames.invalidate(false));
    this.#resizes.observe(canvas);
    this.#watchRatio();
    addEventListener("resize", () => this.#frames.invalidate(false), {
      signal: this.#listeners.signal,
    });
    const { signal } = this.#listeners;
    canvas.addEventListener("webglcontextlost", (event) => this.#lost(event), { signal });
    canvas.addEventListener("webglcontextrestored", () => this.#restored(), { signal });
  }

  get grid(): GridInfo | null {
    return this.#shown?.info ?? null;
  }

  show(container: ArrayBuffer, options?: { keepCamera?: boolean }): Promise<GridInfo> {
    return this.#show({ parts: [container] }, options?.keepCamera ?? false);
  }

  showTiles(parts: readonly ArrayBuffer[], preview: ArrayBuffer): Promise<GridInfo> {
    return this.#show({ parts, preview }, true);
  }

  async #show(encoded: Encoded, keepCamera: boolean): Promise<GridInfo> {
    const channel = this.#channelShown,
      grid = await this.#decoder.decode(encoded, channel);
    const info = infoOf(grid);
    this.#shown = {
      grid,
      info,
      subject: subjectOf(grid),
      paint: grid.paint,
      painted: channelIn(grid, channel),
    };
    this.#part = null;
    if (!keepCamera) this.#view = { ...START, projection: this.#view.projection };
    this.#upload();
    await this.#repaint();
    return info;
  }

  async showPart(container: ArrayBuffer | null): Promise<void> {
    const shown = this.#shown,
      channel = this.#channelShown,
      encoded = container && { parts: [container], inner: shown?.grid.inner },
      grid = encoded && (await this.#decoder.decode(encoded, channel));
    if (!shown || (!grid && !this.#part)) return;
    this.#part = grid && {
      ...shown,
      grid,
      info: infoOf(grid),
      paint: grid.paint,
      painted: channelIn(grid, channel),
    };
    this.#upload();
    await this.#repaint();
  }

  clear(): void {
    const painter = this.#painter;
    this.#decoder.abort();
    this.#shown = this.#part = null;
    if (painter.textures.images === 0) painter.textures.dispose(); // else the last image does
    painter.textures = new GridTextures(painter.gl);
    this.#frames.setScene(null);
    this.#frames.invalidate(false);
  }

  get camera(): Camera {
    return { ...this.#view };
  }
  set camera(camera: Camera) {
    this.#view = validCamera(camera);
    this.#frames.invalidate(true);
  }
  get style(): Style {
    return this.#look;
  }
  set style(style: Style) {
    this.#look = style;
    this.#frames.invalidate(false);
  }
  get channel(): Channel | null {
    return this.#channelShown;
  }
  set channel(channel: Channel | null) {
    this.#channelShown = channel;
    this.#repaint().catch((error: unknown) => this.#fail(error));
  }
  get section(): Section {
    return this.#cut;
  }
  set section(section: Section) {
    this.#cut = section;
    this.#frames.invalidate(true);
  }

  visibleCells(): Seen | null {
    const found = this.#raysInto(this.#shown);
    if (!found) return null;
    const { grid, rays, low, high, plane } = found,
      all = visibleCells(rays.clipFromGrid, low, high);
    const from: [number, number, number] = [Infinity, Infinity, Infinity],
      to: [number, number, number] = [-1, -1, -1];
    const at = (i: number): number => (2 * i) / SEEN_RAYS - 1;
    for (let i = 0; i <= SEEN_RAYS; ++i) {
      for (let j = 0; j <= SEEN_RAYS; ++j) {
        pickVoxel(grid, rays, at(i), at(j), low, high, plane)?.cell.forEach((v, c) => {
          from[c] = Math.min(from[c]!, v);
          to[c] = Math.max(to[c]!, v + 1);
        });
      }
    }
    return all && to[0] >= 0 ? { all, front: [from, to] } : null;
  }

  pixelsPerCell(): number {
    if (!this.#shown) return 0;
    const { grid, subject } = this.#shown,
      rays = raysOf(grid, subject, this.#view, this.#size());
    return rays ? Math.max(...grid.voxelSize) / rays.worldPerPixel : 0;
  }

  pick(x: number, y: number): Hit | null {
    const { canvas } = this,
      found = this.#raysInto(this.#drawn);
    if (!found) return null;
    const { grid, rays, low, high, plane } = found;
    return pickVoxel(
      grid,
      rays,
      (2 * x) / canvas.clientWidth - 1,
      1 - (2 * y) / canvas.clientHeight,
      low,
      high,
      plane,
    );
  }

  async image(width: number, height: number, transparent: boolean): Promise<Blob> {
    for (const side of [width, height]) {
      if (!Number.isInteger(side) || side < 1 || side > IMAGE_SIDE_MAX) {
        throw new RangeError(`image side: expected 1 to ${IMAGE_SIDE_MAX} pixels, got ${side}`);
      }
    }
    const size = { width, height },
      quality = restQuality(size, transparent);
    await this.#repaint(); // the channel may have been set just now
    const painter = this.#painter,
      { gl, textures } = painter,
      scene = this.#scene();
    if (!scene) throw new Error("no grid is shown");
    const params = scene.params(quality, size);
    if (!params) throw new Error("the camera cannot be inverted");
    const target = createTarget(gl, width, height);
    ++textures.images; // from here on, others are uploaded beside them
    try {
      const program = await painter.program(scene.variant(quality));
      await drawStrips(painter, program, params, target, () => false, textures);
      return await encodePng(painter.read(target), width, height);
    } finally {
      deleteTarget(gl, target);
      if (--textures.images === 0 && textures !== painter.textures) textures.dispose();
    }
  }

  dispose(): void {
    clearTimeout(this.#lostTimer);
    this.#listeners.abort();
    this.#resizes.disconnect();
    this.#controls.dispose();
    this.#decoder.dispose();
    this.#frames.stop();
    this.#shown = this.#part = null;
    this.#painter.textures.dispose(); // the context stays, for another viewer of the canvas
  }

  get #drawn(): Shown | null {
    return this.#part ?? this.#shown;
  }

  // The camera's rays, and what a section leaves of the cells.
  #raysInto(
    shown: Shown | null,
  ): { grid: PackedGrid; rays: ImageRays; low: Vec3; high: Vec3; plane: Vec4 | null } | null {
    const kept = shown && keptCells(shown.grid, this.#cut);
    if (!shown || !kept) return null;
    const { grid, subject } = shown,
      [low, high] = kept,
      rays = raysOf(grid, subject, this.#view, this.#size());
    const plane = this.#cut.plane && planeInGrid(this.#cut.plane, grid);
    return rays && { grid, rays, low, high, plane };
  }

  /** Draws again when the ratio of device pixels changes: on another screen, for example. */
  #watchRatio(): void {
    const query = matchMedia(`(resolution: ${devicePixelRatio}dppx)`);
    query.addEventListener(
      "change",
      () => {
        this.#frames.invalidate(false);
        this.#watchRatio();
      },
      { once: true, signal: this.#listeners.signal },
    );
  }

  #size(): Size {
    const { canvas } = this,
      ratio = devicePixelRatio || 1;
    return {
      width: Math.max(1, Math.round(canvas.clientWidth * ratio)),
      height: Math.max(1, Math.round(canvas.clientHeight * ratio)),
    };
  }

  #moveByHand(camera: Camera): void {
    this.camera = camera;
    this.onCamera?.(this.camera);
  }

  #turnByHand(azimuth: number, elevation: number): void {
    const up = clamp(elevation, -90, 90),
      around = ((azimuth % 360) + 360) % 360;
    if (this.#shown)
      this.#moveByHand(orbited(this.#view, this.#shown.subject, this.#size(), around, up));
    else this.#moveByHand({ ...this.#view, azimuth: around, elevation: up });
  }

  // A part is as bright as its grid.
  #lookOf(shown: Shown): Look {
    const { paint, painted } = shown,
      whole = this.#shown;
    return {
      camera: this.#view,
      style: this.#look,
      section: this.#cut,
      paint:
        paint && whole?.paint && whole.painted === painted
          ? { ...paint, luminance: whole.paint.luminance }
          : paint,
      hasChannel: painted !== null,
    };
  }

  #scene(): Scene | null {
    const shown = this.#drawn;
    if (!shown) return null;
    return {
      params: (quality, size) =>
        paramsOf(shown.grid, shown.subject, this.#lookOf(shown), quality, size),
      variant: (quality) => variantOf(shown.grid, this.#lookOf(shown), quality),
    };
  }

  #upload(): void {
    const shown = this.#drawn;
    if (!shown) return;
    const painter = this.#painter;
    if (painter.textures.images > 0) painter.textures = new GridTextures(painter.gl);
    painter.textures.upload(shown.grid, shown.paint?.colors ?? null);
    this.#frames.setScene(this.#scene());
    this.#frames.invalidate(false);
  }

  /** Makes the colours those of the channel that is to be shown. */
  async #repaint(): Promise<void> {
    const shown = this.#drawn;
    if (!shown) return;
    const wanted = channelIn(shown.info, this.#channelShown);
    if (shown.painted === wanted) return;
    // The grid's own colours may be those of a channel; their tables were overwritten.
    const channel = wanted ?? ownChannel(shown.info.channels);
    if (channel === null) {
      shown.paint = null;
    } else {
      const { attributes, attributeCount, inner, nodes, bricks, brickCount, tileDims } =
        shown.grid;
      const painted = await this.#decoder.paint(channel, {
        attributes: { [channel]: attributes[channel] },
        attributeCount,
        inner,
        nodes,
        bricks,
        brickCount,
        tileDims,
      });
      if (!painted || this.#drawn !== shown) return;
      shown.grid = { ...shown.grid, nodes: painted.nodes, bricks: painted.bricks };
      shown.paint = painted.paint;
    }
    shown.painted = wanted;
    this.#upload();
    return this.#repaint();
  }

  #fail(error: unknown): void {
    if (error instanceof DOMException && error.name === "AbortError") return; // disposed of
    console.error(error);
    this.onLost?.();
  }

  /** Creates the objects of a WebGL context. */
  #begin(): void {
    this.#painter = new Painter(this.gl);
    this.#frames = new Frames(
      this.#painter,
      this.canvas,
      {
        onFrame: (milliseconds, atRest) => this.onFrame?.(milliseconds, atRest),
        onError: (error) => this.#fail(error),
      },
      () => {
        const [r, g, b] = STYLES[this.#look].bottom;
        return [r / 255, g / 255, b / 255];
      },
    );
  }

  #lost(event: Event): void {
    event.preventDefault(); // asks the browser for another context
    this.#frames.stop();
    clearTimeout(this.#lostTimer);
    this.#lostTimer = setTimeout(() => this.onLost?.(), RESTORE_MS);
  }

  #restored(): void {
    clearTimeout(this.#lostTimer);
    this.#begin();
    this.#upload();
    this.#frames.invalidate(false);
  }
}

/** null where the browser has no WebGL2, or one with too small textures. */
export function createViewer(canvas: HTMLCanvasElement, workerUrl: string): Viewer | null {
  const gl = canvas.getContext("webgl2", {
    alpha: false,
    antialias: false,
    depth: false,
    stencil: false,
  });
  if (!gl || (gl.getParameter(gl.MAX_TEXTURE_SIZE) as number) < TABLE_COLUMNS) return null;
  return new WebGlViewer(canvas, gl, workerUrl);
}
