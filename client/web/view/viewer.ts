// The page's interface to its viewer: an orbit view of one voxel grid in a canvas, drawn by the
// daemon's own ray-march shader in WebGL2. createViewer() (create_viewer.ts) makes one.

export type Vec3 = readonly [number, number, number];
export type Style = "voxel" | "smooth" | "clay" | "iso" | "blueprint";
export type Channel = "color" | "normal" | "material" | "label" | "distance" | "coverage";

/** A decoded grid: its own cells, of 2^level cells of level 0 on a side. */
export interface GridInfo {
  readonly dims: Vec3; // cells
  readonly origin: Vec3; // corner of cell (0, 0, 0), world units
  readonly voxelSize: Vec3; // world units
  readonly voxels: number;
  readonly channels: readonly Channel[];
}

/** An orbit camera with the meaning of the options of /v1/render. */
export interface Camera {
  azimuth: number; // degrees around +y; 0 looks along -z from +z
  elevation: number; // degrees, -90..90
  zoom: number; // > 1 is closer; 1 fits the occupied voxels
  pan: readonly [number, number]; // shift of the picture, in fractions of its height
  projection: "perspective" | "orthographic";
}

/** Cuts away what lies outside; null: nothing. World units. */
export interface Section {
  readonly plane: readonly [number, number, number, number] | null; // a x + b y + c z + d > 0 is cut
  readonly box: readonly [Vec3, Vec3] | null; // least and greatest corner of what stays
}

/** Cells [least, greatest + 1) of a grid. */
export type Box = readonly [Vec3, Vec3];

/** The cells of the grid that the canvas shows. */
export interface Seen {
  readonly all: Box; // the occupied cells' box, as far as it lies in the image
  readonly front: Box; // around the voxels in front that a lattice of rays finds
}

/** The voxel under a point of the canvas. */
export interface Hit {
  readonly cell: Vec3; // of the grid, or of the part that is drawn in its place
  readonly color?: readonly [number, number, number, number]; // sRGB and alpha, 0..255
  readonly normal?: Vec3;
  readonly material?: number;
  readonly label?: number;
  readonly distance?: number; // negative inside; in voxels, with distance=world in shortest edges
  readonly coverage?: number; // 0..1
}

export interface Viewer {
  /**
   * Shows a native container (.voxg, codec fast) in place of the grid before; it is decoded in a
   * worker. Rejects with a DecodeError for malformed bytes; the grid before then stays. A later
   * call supersedes an earlier one that is still being decoded: the earlier one rejects with an
   * AbortError.
   */
  show(container: ArrayBuffer, options?: { keepCamera?: boolean }): Promise<GridInfo>;
  /**
   * Shows a grid that is still being made: the containers of its first tiles, in order, and `preview`,
   * the same mesh in larger cells, in place of the other tiles, as full blocks of 8 cells. The camera
   * stays. Rejects as show() does.
   */
  showTiles(parts: readonly ArrayBuffer[], preview: ArrayBuffer): Promise<GridInfo>;
  /**
   * Draws a container of a part of the grid, at any level, in the grid's place; the camera stays.
   * null: the grid again, as does show(). Rejects as show() does.
   */
  showPart(container: ArrayBuffer | null): Promise<void>;
  /** Shows nothing. */
  clear(): void;
  readonly grid: GridInfo | null;

  camera: Camera; // a copy; assign to move
  style: Style;
  /** The channel that colours the voxels; null: the style's own colours. */
  channel: Channel | null;
  section: Section;
  /** null if the canvas shows no voxel. */
  visibleCells(): Seen | null;
  /** Pixels of the canvas that one cell covers about, at the middle of the grid. */
  pixelsPerCell(): number;

  /** x and y in CSS pixels from the canvas's upper left corner. */
  pick(x: number, y: number): Hit | null;
  /** A PNG of the view as it is set now, at rest. Sizes in pixels, 1..4096. */
  image(width: number, height: number, transparent: boolean): Promise<Blob>;

  /** After the camera moved by pointer, touch or keys. */
  onCamera: ((camera: Camera) => void) | null;
  /** The time of one finished frame in milliseconds, as the GPU's fence tells it. */
  onFrame: ((milliseconds: number, atRest: boolean) => void) | null;
  /** WebGL lost its context and could not be rebuilt. */
  onLost: (() => void) | null;
  dispose(): void;
}
