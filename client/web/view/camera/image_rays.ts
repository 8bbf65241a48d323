// Rays and sizes that follow from a camera (server/render/camera.cpp).
import type { PackedGrid } from "../pack/packed_grid";
import type { Vec3 } from "../viewer";
import type { Size, Subject } from "./framing";
import {
  apply,
  inverse,
  length,
  minus,
  normalized,
  pointOf,
  scaling,
  times,
  translation,
  type Matrix,
  type Vec4,
} from "./matrix";

/** A camera in grid space; a plane is at[0] + x * at[1] + y * at[2] for clip positions x and y. */
export interface ImageRays {
  readonly clipFromGrid: Matrix;
  readonly nearPlane: readonly [Vec4, Vec4, Vec4];
  readonly farPlane: readonly [Vec4, Vec4, Vec4];
  readonly right: Vec3; // unit vectors of the world, at the middle of the image
  readonly up: Vec3;
  readonly toEye: Vec3;
  readonly worldPerPixel: number; // at the middle of the subject
}

function lerp(a: Vec4, b: Vec4, t: number): Vec4 {
  const at = (c: 0 | 1 | 2 | 3): number => a[c] * (1 - t) + b[c] * t;
  return [at(0), at(1), at(2), at(3)];
}

/** null if the camera cannot be inverted. */
export function imageRays(
  clipFromWorld: Matrix,
  grid: PackedGrid,
  subject: Subject,
  size: Size,
): ImageRays | null {
  const worldFromGrid = times(translation(...grid.origin), scaling(...grid.voxelSize));
  const clipFromGrid = times(clipFromWorld, worldFromGrid),
    gridFromClip = inverse(clipFromGrid);
  if (gridFromClip === null) return null;
  const at = (x: number, y: number, z: number, w: number): Vec4 => apply(gridFromClip, x, y, z, w);
  const worldAt = (x: number, y: number, z: number): Vec3 =>
    pointOf(apply(worldFromGrid, ...at(x, y, z, 1)));
  const middle = worldAt(0, 0, 0);
  const toEye = normalized(minus(worldAt(0, 0, -1), middle));
  const right = normalized(minus(worldAt(1e-3, 0, 0), middle));
  const up = normalized(minus(worldAt(0, 1e-3, 0), middle));
  const center = (c: 0 | 1 | 2): number => 0.5 * (subject.low[c] + subject.high[c]);
  const clip = apply(clipFromWorld, center(0), center(1), center(2), 1);
  const depth = Math.min(Math.max(clip[2] / clip[3], -1), 1);
  const width = length(minus(worldAt(1, 0, depth), worldAt(-1, 0, depth)));
  return {
    clipFromGrid,
    right,
    up,
    toEye,
    worldPerPixel: width / size.width,
    nearPlane: [at(0, 0, -1, 1), at(1, 0, 0, 0), at(0, 1, 0, 0)],
    farPlane: [at(0, 0, 1, 1), at(1, 0, 0, 0), at(0, 1, 0, 0)],
  };
}

/** The part of the grid that a pixel in the middle spans, in sides of a voxel: at the near plane,
 * and its growth per unit of distance. */
export function pixelFootprint(
  rays: ImageRays,
  size: Size,
  voxelSize: Vec3,
): { atNear: number; perDistance: number } {
  const longest = Math.max(...voxelSize);
  const on = (plane: readonly [Vec4, Vec4, Vec4], x: number, y: number): Vec4 => {
    const c = (i: 0 | 1 | 2 | 3): number => plane[0][i] + x * plane[1][i] + y * plane[2][i];
    return [c(0), c(1), c(2), c(3)];
  };
  const at = (depth: number, x: number, y: number): Vec3 => {
    const p = pointOf(lerp(on(rays.nearPlane, x, y), on(rays.farPlane, x, y), depth));
    return [
      (p[0] * voxelSize[0]) / longest,
      (p[1] * voxelSize[1]) / longest,
      (p[2] * voxelSize[2]) / longest,
    ];
  };
  const span = (depth: number): number => {
    const middle = at(depth, 0, 0);
    return Math.min(
      length(minus(at(depth, 2 / size.width, 0), middle)),
      length(minus(at(depth, 0, 2 / size.height), middle)),
    );
  };
  const near = span(0),
    far = span(0.5),
    distance = length(minus(at(0.5, 0, 0), at(0, 0, 0)));
  if (!(far > near) || !(distance > 0)) return { atNear: Math.min(near, far), perDistance: 0 };
  return { atNear: near, perDistance: (far - near) / distance };
}
