// A grid as the ray march reads it: the tables of shaders/shared/raymarch.h, with the values of its
// voxels for the pointer and for other colours.
import type { Channel, Vec3 } from "../viewer";

/** Words in a row of the textures that hold the tables. */
export const TABLE_COLUMNS = 4096;
/** The most words of a table, 64 MiB; larger grids are refused. Textures may be that large. */
export const TABLE_WORDS_MAX = TABLE_COLUMNS * 4096;

export const TILE_ENTRIES = 512;
export const BLOCK_ENTRIES = 64;
export const BLOCK_COLOR = 64;
export const BLOCK_NORMAL = 65;
export const BLOCK_WORDS = 66;
export const BRICK_FIRST = 16;
export const BRICK_NODES = 17;
export const BRICK_COLOR = 18;
export const BRICK_NORMAL = 19;
export const BRICK_WORDS = 20;
/** Entries: the bit of a table or brick, and a full part. */
export const CHILD = 0x80000000;
export const FULL = 0x40000000;

export type Words = Uint32Array<ArrayBuffer>;

/** Values of the voxels outside full nodes, in storage order. */
export interface Attributes {
  color?: Words; // R | G << 8 | B << 16 | A << 24
  normal?: Words; // x | y << 8 | z << 16, signed bytes
  material?: Uint16Array<ArrayBuffer>;
  label?: Uint16Array<ArrayBuffer>;
  distance?: Int16Array<ArrayBuffer>; // in 1/128 voxel
  coverage?: Uint8Array<ArrayBuffer>;
}

/** Colours of the voxels as they are drawn. */
export interface Paint {
  readonly colors: Words; // a word per voxel, padded to whole rows
  readonly fullColor: Vec3 | null; // sRGB of the voxels in full nodes; null: neutral
  readonly luminance: number; // median in linear light, 0..1; 1: not to be brightened
}

/** Tables are padded with zeros to whole rows of TABLE_COLUMNS words. */
export interface PackedGrid {
  readonly dims: Vec3;
  readonly origin: Vec3;
  readonly voxelSize: Vec3;
  readonly voxels: number;
  readonly channels: readonly Channel[];
  readonly tileDims: Vec3;
  readonly nodes: Words;
  readonly nodeWords: number; // without padding
  readonly bricks: Words;
  readonly brickCount: number;
  readonly attributeCount: number; // voxels outside full nodes
  readonly inner: Vec3 | null; // sRGB of voxels inside of solids, which have no colour; null: none are
  readonly attributes: Attributes; // colours and normals are padded
  readonly paint: Paint | null; // its own colours or those of its ids; null: it has neither
  readonly occupiedMin: Vec3; // cells; the whole grid if no voxel is there
  readonly occupiedMax: Vec3;
  readonly hull: Int32Array<ArrayBuffer>; // x, y, z of points in cells, whose hull holds all voxels
}

/** Zeros for at least so many words, in whole rows. */
export function tableOf(words: number): Words {
  return new Uint32Array(Math.max(1, Math.ceil(words / TABLE_COLUMNS)) * TABLE_COLUMNS);
}
