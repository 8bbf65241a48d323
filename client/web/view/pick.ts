// The first voxel on a ray, by a walk through the tables as in dda.glsl and march.glsl of
// shaders/raymarch, in double precision.
import type { ImageRays } from "./camera/image_rays";
import type { Vec4 } from "./camera/matrix";
import { DISTANCE_STEPS } from "./decode/channels";
import { bitCount, mortonOf } from "./decode/morton";
import {
  BRICK_FIRST,
  BRICK_WORDS,
  CHILD,
  FULL,
  type Attributes,
  type PackedGrid,
} from "./pack/packed_grid";
import type { Hit, Vec3 } from "./viewer";

type Triple = [number, number, number];
const AXES = [0, 1, 2] as const;
const PARALLEL = 1e-9;

interface Ray {
  readonly origin: Vec3; // cells
  readonly direction: Vec3;
  first: number; // part of the ray that counts, from the near plane on
  last: number;
}

function rayAt(rays: ImageRays, x: number, y: number): Ray {
  const on = (plane: readonly [Vec4, Vec4, Vec4], c: 0 | 1 | 2 | 3): number =>
    plane[0][c] + x * plane[1][c] + y * plane[2][c];
  const nearW = on(rays.nearPlane, 3),
    farW = on(rays.farPlane, 3);
  const near = (c: 0 | 1 | 2): number => on(rays.nearPlane, c) / nearW;
  const way = (c: 0 | 1 | 2): number => on(rays.farPlane, c) / farW - near(c);
  return {
    origin: [near(0), near(1), near(2)],
    direction: [way(0), way(1), way(2)],
    first: 0,
    last: 1,
  };
}

/** Cuts away the part of the ray on the positive side of a plane. */
function cut(ray: Ray, plane: Vec4): void {
  let at = plane[3],
    perT = 0;
  for (const c of AXES) {
    at += plane[c] * ray.origin[c];
    perT += plane[c] * ray.direction[c];
  }
  if (perT === 0) {
    if (at > 0) ray.last = -1;
  } else if (perT < 0) {
    ray.first = Math.max(ray.first, -at / perT);
  } else {
    ray.last = Math.min(ray.last, -at / perT);
  }
}

/** Where the ray enters the box of cells, or null. */
function enter(ray: Ray, low: Vec3, high: Vec3): Triple | null {
  let { first, last } = ray;
  for (const c of AXES) {
    const d = ray.direction[c],
      o = ray.origin[c];
    if (Math.abs(d) < PARALLEL) {
      if (o < low[c] || o >= high[c]) return null;
      continue;
    }
    const a = (low[c] - o) / d,
      b = (high[c] - o) / d;
    first = Math.max(first, Math.min(a, b));
    last = Math.min(last, Math.max(a, b));
  }
  if (first > last) return null;
  ray.first = first;
  ray.last = last;
  const cell = (c: 0 | 1 | 2): number =>
    Math.min(Math.max(Math.floor(ray.origin[c] + ray.direction[c] * first), low[c]), high[c] - 1);
  return [cell(0), cell(1), cell(2)];
}

/** The voxel of a cell: the log2 of the empty cube around it, or its number, or that it is full. */
type Place = { empty: number } | { empty: -1; voxel: number | null };

function placeOf(grid: PackedGrid, [x, y, z]: Triple): Place {
  const { nodes, bricks, tileDims } = grid;
  let entry = nodes[(x >> 8) + tileDims[0] * ((y >> 8) + tileDims[1] * (z >> 8))]!;
  if ((entry & CHILD) !== 0) {
    entry = nodes[(entry & ~CHILD) + ((x >> 5) & 7) + 8 * ((y >> 5) & 7) + 64 * ((z >> 5) & 7)]!;
    if ((entry & CHILD) !== 0) {
      entry = nodes[(entry & ~CHILD) + ((x >> 3) & 3) + 4 * ((y >> 3) & 3) + 16 * ((z >> 3) & 3)]!;
    }
  }
  if ((entry & CHILD) === 0) return entry >= FULL ? { empty: -1, voxel: null } : { empty: entry };
  const brick = (entry & ~CHILD) * BRICK_WORDS,
    bit = mortonOf(x & 7, y & 7, z & 7);
  if (((bricks[brick + (bit >> 5)]! >>> (bit & 31)) & 1) === 0) return { empty: 0 };
  let voxel =
    bricks[brick + BRICK_FIRST]! + bitCount(bricks[brick + (bit >> 5)]! & ((1 << (bit & 31)) - 1));
  for (let word = 0; word < bit >> 5; ++word) voxel += bitCount(bricks[brick + word]!);
  return { empty: -1, voxel };
}

/** Steps out of the aligned cube of 2^shift cells around the cell; returns the distance there. */
function leave(ray: Ray, cell: Triple, shift: number): number {
  let t = Infinity,
    axis: 0 | 1 | 2 = 0;
  const low: Triple = [0, 0, 0];
  for (const c of AXES) {
    const d = ray.direction[c];
    low[c] = (cell[c] >> shift) << shift;
    if (Math.abs(d) < PARALLEL) continue;
    const at = (low[c] + (d > 0 ? 1 << shift : 0) - ray.origin[c]) / d;
    if (at < t) [t, axis] = [at, c];
  }
  for (const c of AXES) {
    const isUp = ray.direction[c] > 0;
    if (c === axis) {
      cell[c] = isUp ? low[c] + (1 << shift) : low[c] - 1;
      continue;
    }
    const at = Math.min(
      Math.max(Math.floor(ray.origin[c] + ray.direction[c] * t), low[c]),
      low[c] + (1 << shift) - 1,
    );
    // Rounding must not lead back to cells that the ray has passed.
    cell[c] = isUp ? Math.max(at, cell[c]) : Math.min(at, cell[c]);
  }
  return t;
}

function valuesOf(attributes: Attributes, voxel: number): Partial<Hit> {
  const { color, normal, material, label, distance, coverage } = attributes;
  const values: { -readonly [K in keyof Hit]?: Hit[K] } = {};
  if (color) {
    const word = color[voxel]!;
    values.color = [word & 255, (word >>> 8) & 255, (word >>> 16) & 255, word >>> 24];
  }
  if (normal) {
    const word = normal[voxel]!;
    values.normal = [
      ((word << 24) >> 24) / 127,
      ((word << 16) >> 24) / 127,
      ((word << 8) >> 24) / 127,
    ];
  }
  if (material) values.material = material[voxel]!;
  if (label) values.label = label[voxel]!;
  if (distance) values.distance = distance[voxel]! / DISTANCE_STEPS;
  if (coverage) values.coverage = coverage[voxel]! / 255;
  return values;
}

/**
 * The voxel under a clip position (-1..1, y up), among the cells [low, high), on the kept side of a
 * plane of the grid. Voxels of full nodes have no values.
 */
export function pickVoxel(
  grid: PackedGrid,
  rays: ImageRays,
  x: number,
  y: number,
  low: Vec3,
  high: Vec3,
  plane: Vec4 | null,
): Hit | null {
  const ray = rayAt(rays, x, y);
  if (plane) cut(ray, plane);
  const cell = ray.first <= ray.last ? enter(ray, low, high) : null;
  if (cell === null) return null;
  // A ray crosses each plane between cells at most once.
  const steps = high[0] + high[1] + high[2] - low[0] - low[1] - low[2] + 8;
  for (let i = 0; i < steps; ++i) {
    if (AXES.some((c) => cell[c] < low[c] || cell[c] >= high[c])) return null;
    const place = placeOf(grid, cell);
    if ("voxel" in place) {
      return { cell, ...(place.voxel === null ? {} : valuesOf(grid.attributes, place.voxel)) };
    }
    if (leave(ray, cell, place.empty) > ray.last) return null;
  }
  return null;
}
