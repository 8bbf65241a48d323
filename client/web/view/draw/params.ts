// The parameters of an image, as shaders/shared/raymarch.h lays them out and
// server/render/raymarch_params.cpp fills them.
import { clipFromWorld, type Size, type Subject } from "../camera/framing";
import { imageRays, pixelFootprint, type ImageRays } from "../camera/image_rays";
import { length, minus, normalized, scaled, type Vec4 } from "../camera/matrix";
import type { PackedGrid, Paint } from "../pack/packed_grid";
import type { Camera, Section, Style, Vec3 } from "../viewer";
import { STYLES, type Srgb } from "./styles";

export const PARAMS_BYTES = 432;

// RAYMARCH_HAS_COLOR and so on.
const HAS_COLOR = 1,
  HAS_NORMAL = 2,
  HAS_SECTION = 4,
  PHONG = 8,
  OCCLUSION = 16,
  SHADOW = 32,
  HIGHLIGHT = 64,
  HAS_GROUND = 128;

// Length of occlusion rays as a fraction of the box's diagonal, and its least number of voxels.
const OCCLUSION_LENGTH = 0.06,
  OCCLUSION_VOXELS_MIN = 6;
// Edges of faces, in voxels and pixels.
const EDGE_VOXELS = 0.05,
  EDGE_PIXELS = 1,
  EDGE_DARKNESS = 0.3;
const EDGE_VOXEL_PIXELS_MIN = 4,
  EDGE_VOXEL_PIXELS_MAX = 10;
// Lines of a section's hatch to the image's smaller side, and their smallest distance in pixels.
const HATCH_LINES = 56,
  HATCH_PIXELS_MIN = 5;
// Voxels by which a section is moved to the side that it keeps.
const SECTION_MARGIN = 1 / 256;
// Luminance that the median of dark colours gets, and the largest factor for that.
const MEDIAN_LUMINANCE = 0.2,
  EXPOSURE_MAX = 4;
// The floor begins to fade this far from the middle of the box, in halves of its diagonal.
const GROUND_FADE = 0.75;
const LINE: Srgb = [226, 236, 250];
const FACE_SHARE = 0.6,
  CUBE_FACE_SHARE = 1;

export interface Look {
  readonly camera: Camera;
  readonly style: Style;
  readonly section: Section;
  readonly paint: Paint | null; // colours of the voxels, if they have some
  readonly hasChannel: boolean; // the colours are a channel's, which every style shows
}

export interface Quality {
  readonly light: boolean; // occlusion, shadow and ground where the style has them
  readonly samples: number; // rays along each side of a pixel
  readonly transparent: boolean; // no background
}

/** The parts of the ray march that an image needs; the others are compiled out. */
export interface Variant {
  readonly attributes: boolean;
  readonly smooth: boolean;
  readonly light: boolean;
  readonly ground: boolean;
  readonly outline: boolean;
}

function showsColor(look: Look): boolean {
  return look.paint !== null && (look.style !== "clay" || look.hasChannel);
}

export function variantOf(grid: PackedGrid, look: Look, quality: Quality): Variant {
  const style = STYLES[look.style],
    light = quality.light && (style.occlusion || style.shadow);
  const hasNormal = grid.attributes.normal !== undefined;
  return {
    attributes: look.paint !== null || hasNormal,
    smooth: (look.style !== "iso" || light) && !hasNormal,
    light,
    ground: quality.light && style.ground,
    outline: look.style === "blueprint",
  };
}

function linear(byte: number): number {
  const c = byte / 255;
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
}

function linearColor(color: Srgb | Vec3, alpha: number): Vec4 {
  return [linear(color[0]), linear(color[1]), linear(color[2]), alpha];
}

function smoothStep(from: number, to: number, at: number): number {
  const t = Math.min(Math.max((at - from) / (to - from), 0), 1);
  return t * t * (3 - 2 * t);
}

/** How much voxels of so many pixels look like cubes, 0..1. */
function cubeShare(voxelPixels: number, style: Style): number {
  return smoothStep(2, style === "blueprint" ? 4 : 8, voxelPixels);
}

function outlineDepth(voxelPixels: number): number {
  const smooth = 1.8 + 2.5 / voxelPixels;
  return smooth + (0.2 - smooth) * cubeShare(voxelPixels, "blueprint");
}

function exposureOf(look: Look): number {
  if (look.style === "iso" || look.paint === null) return 1;
  const at = Math.max(look.paint.luminance, 1e-4);
  const factor = (MEDIAN_LUMINANCE * (1 - at)) / (at * (1 - MEDIAN_LUMINANCE));
  return Math.min(Math.max(factor, 1), EXPOSURE_MAX);
}

/** A plane of the world as one of the grid, moved a little to the side that it keeps. */
export function planeInGrid(plane: Vec4, grid: PackedGrid): Vec4 {
  const { voxelSize: v, origin: o } = grid,
    normal: Vec3 = [plane[0] * v[0], plane[1] * v[1], plane[2] * v[2]];
  const margin = SECTION_MARGIN * normal.reduce((sum, n) => sum + Math.abs(n), 0);
  return [...normal, plane[0] * o[0] + plane[1] * o[1] + plane[2] * o[2] + plane[3] + margin];
}

/** The occupied cells [low, high) that a section's box leaves, by their middles; null: none. */
export function keptCells(grid: PackedGrid, section: Section): readonly [Vec3, Vec3] | null {
  const { occupiedMin: low, occupiedMax: high, origin, voxelSize } = grid,
    { box } = section;
  if (!box) return [low, high];
  const cell = (p: Vec3, c: 0 | 1 | 2): number =>
    Math.ceil((p[c] - origin[c]) / voxelSize[c] - 0.5);
  const from = (c: 0 | 1 | 2): number => Math.max(low[c], cell(box[0], c));
  const to = (c: 0 | 1 | 2): number => Math.min(high[c], cell(box[1], c));
  const kept: [Vec3, Vec3] = [
    [from(0), from(1), from(2)],
    [to(0), to(1), to(2)],
  ];
  return kept[0].every((v, c) => v < kept[1][c]!) ? kept : null;
}

/** The camera of an image in the grid, or null if it cannot be inverted. */
export function raysOf(
  grid: PackedGrid,
  subject: Subject,
  camera: Camera,
  size: Size,
): ImageRays | null {
  return imageRays(clipFromWorld(camera, subject, size), grid, subject, size);
}

/** Writes vectors of four numbers by their place in the block. */
class Block {
  readonly buffer = new ArrayBuffer(PARAMS_BYTES);
  readonly #floats = new Float32Array(this.buffer);
  readonly #ints = new Int32Array(this.buffer);

  vec4(place: number, v: readonly number[]): void {
    this.#floats.set(v, 4 * place);
  }
  ivec4(place: number, v: readonly number[]): void {
    this.#ints.set(v, 4 * place);
  }
}

// Places in the block, in vectors. Members with suffix _low stay 0: ES has single precision.
const NEAR = 0,
  FAR = 3,
  SECTION = 6,
  VOXEL_SIZE = 14,
  LIGHT_WORLD = 15,
  BACKGROUND = 16,
  BACKGROUND_TOP = 17,
  LINE_COLOR = 18,
  FULL_COLOR = 19,
  FOOTPRINT = 20,
  TONE = 21,
  GROUND = 22,
  BOX_LOW = 23,
  BOX_HIGH = 24,
  TILE_DIMS = 25,
  IMAGE = 26;

function flagsOf(grid: PackedGrid, look: Look, quality: Quality, hasGround: boolean): number {
  const style = STYLES[look.style],
    flag = (on: boolean, bit: number): number => (on ? bit : 0);
  return (
    flag(showsColor(look), HAS_COLOR) |
    flag(grid.attributes.normal !== undefined, HAS_NORMAL) |
    flag(look.section.plane !== null, HAS_SECTION) |
    flag(look.style !== "iso", PHONG) |
    flag(look.style === "smooth", HIGHLIGHT) |
    flag(quality.light && style.occlusion, OCCLUSION) |
    flag(quality.light && style.shadow, SHADOW) |
    flag(hasGround, HAS_GROUND)
  );
}

function setLook(
  block: Block,
  look: Look,
  quality: Quality,
  rays: ImageRays,
  voxelPixels: number,
  size: Size,
): void {
  const style = STYLES[look.style],
    cubes = cubeShare(voxelPixels, look.style);
  const share = look.style === "voxel" || look.style === "blueprint" ? CUBE_FACE_SHARE : FACE_SHARE;
  const key = (c: 0 | 1 | 2): number => rays.toEye[c] + 0.45 * rays.right[c] + 0.65 * rays.up[c];
  block.vec4(LIGHT_WORLD, [...normalized([key(0), key(1), key(2)]), share * cubes]);
  const alpha = quality.transparent ? 0 : 1;
  block.vec4(BACKGROUND, quality.transparent ? [0, 0, 0, 0] : linearColor(style.bottom, alpha));
  block.vec4(BACKGROUND_TOP, quality.transparent ? [0, 0, 0, 0] : linearColor(style.top, alpha));
  block.vec4(LINE_COLOR, linearColor(LINE, outlineDepth(voxelPixels)));
  if (look.paint?.fullColor) block.vec4(FULL_COLOR, linearColor(look.paint.fullColor, 1));
  const edges =
    look.style === "voxel"
      ? smoothStep(EDGE_VOXEL_PIXELS_MIN, EDGE_VOXEL_PIXELS_MAX, voxelPixels)
      : 0;
  block.vec4(TONE, [
    exposureOf(look),
    Math.max(EDGE_VOXELS, EDGE_PIXELS / voxelPixels),
    EDGE_DARKNESS * edges,
    Math.max(HATCH_PIXELS_MIN, Math.min(size.width, size.height) / HATCH_LINES),
  ]);
}

/** The block of an image, or null if the camera cannot be inverted. */
export function paramsOf(
  grid: PackedGrid,
  subject: Subject,
  look: Look,
  quality: Quality,
  size: Size,
): ArrayBuffer | null {
  const rays = raysOf(grid, subject, look.camera, size);
  if (rays === null) return null;
  const block = new Block(),
    { voxelSize } = grid,
    voxelMax = Math.max(...voxelSize);
  rays.nearPlane.forEach((v, i) => block.vec4(NEAR + i, v));
  rays.farPlane.forEach((v, i) => block.vec4(FAR + i, v));
  if (look.section.plane) block.vec4(SECTION, planeInGrid(look.section.plane, grid));
  block.vec4(VOXEL_SIZE, [...voxelSize, voxelMax]);
  const voxelPixels = voxelMax / rays.worldPerPixel;
  setLook(block, look, quality, rays, voxelPixels, size);
  const footprint = pixelFootprint(rays, size, voxelSize);
  const diagonal = length(scaled(minus(subject.high, subject.low), 1 / voxelMax));
  block.vec4(FOOTPRINT, [
    footprint.atNear,
    footprint.perDistance,
    Math.max(OCCLUSION_VOXELS_MIN, OCCLUSION_LENGTH * diagonal),
    cubeShare(voxelPixels, look.style),
  ]);
  const { occupiedMin: low, occupiedMax: high, origin, tileDims } = grid;
  const cell = (world: number, c: 0 | 1 | 2): number => (world - origin[c]) / voxelSize[c];
  const middle = (c: 0 | 1 | 2): number => cell(0.5 * (subject.low[c] + subject.high[c]), c);
  block.vec4(GROUND, [
    middle(0),
    cell(subject.low[1], 1),
    middle(2),
    0.5 * GROUND_FADE * diagonal,
  ]);
  const kept = keptCells(grid, look.section),
    box = kept ?? [low, high];
  // Every step crosses a plane between cells of the box, and a ray crosses each plane only once.
  const extent = minus(high, low),
    steps = extent[0] + extent[1] + extent[2] + 8;
  block.ivec4(BOX_LOW, [...box[0], kept ? steps : 0]);
  block.ivec4(BOX_HIGH, [...box[1], quality.samples]);
  block.ivec4(TILE_DIMS, [...tileDims, 0]);
  const hasGround = quality.light && STYLES[look.style].ground && kept !== null;
  block.ivec4(IMAGE, [size.width, size.height, flagsOf(grid, look, quality, hasGround), 0]);
  return block.buffer;
}
