// The corners of voxels that can lie on the outline of an image, whatever the camera: the points of
// server/render/hull.cpp, to which the camera is fitted.
import { compact } from "../decode/morton";
import type { FullNode } from "../decode/octree";
import type { Vec3 } from "../viewer";

const ROWS_PER_SIDE_MAX = 1024;
const EMPTY = 0x7fffffff;
/**
 * One side of the convex hull of points in ascending `along`: Andrew's monotone chain ("Another
 * efficient algorithm for convex hulls in two dimensions", 1979). sign 1: the side of small
 * `across`; -1: of large.
 */
class Chain {
  readonly along: number[] = [];
  readonly across: number[] = [];

  constructor(private readonly sign: 1 | -1) {}

  add(along: number, across: number): void {
    for (let last = this.along.length - 1; last >= 1; --last) {
      const al = this.along[last - 1]!,
        ac = this.across[last - 1]!;
      const turn =
        (this.along[last]! - al) * (across - ac) - (this.across[last]! - ac) * (along - al);
      if (this.sign * turn > 0) break;
      this.along.pop();
      this.across.pop();
    }
    this.along.push(along);
    this.across.push(across);
  }
}

/** First and end of the occupied cubes of each row along x; cubes are 2^shift cells a side. */
export class Rows {
  readonly #shift: number;
  readonly #size: Vec3;
  readonly #begin: Int32Array;
  readonly #end: Int32Array;

  constructor(private readonly dims: Vec3) {
    let shift = 0;
    while ((Math.max(...dims) + (1 << shift) - 1) >> shift > ROWS_PER_SIDE_MAX) ++shift;
    const cubes = (cells: number): number => (cells + (1 << shift) - 1) >> shift;
    this.#shift = shift;
    this.#size = [cubes(dims[0]), cubes(dims[1]), cubes(dims[2])];
    this.#begin = new Int32Array(this.#size[1] * this.#size[2]).fill(EMPTY);
    this.#end = new Int32Array(this.#begin.length).fill(-1);
  }

  #grow(row: number, begin: number, end: number): void {
    if (begin < this.#begin[row]!) this.#begin[row] = begin;
    if (end > this.#end[row]!) this.#end[row] = end;
  }

  /** Adds the cells of a cube of `side` at a corner. */
  addCube(x: number, y: number, z: number, side: number): void {
    const last = (low: number, size: number): number =>
      Math.min((low + side - 1) >> this.#shift, size - 1);
    const xLast = last(x, this.#size[0]),
      yLast = last(y, this.#size[1]),
      zLast = last(z, this.#size[2]);
    for (let k = z >> this.#shift; k <= zLast; ++k) {
      for (let j = y >> this.#shift; j <= yLast; ++j) {
        this.#grow(j + this.#size[1] * k, x >> this.#shift, xLast + 1);
      }
    }
  }

  addFull(node: FullNode, base: Vec3): void {
    this.addCube(
      base[0] + 8 * compact(node.code),
      base[1] + 8 * compact(node.code >> 1),
      base[2] + 8 * compact(node.code >> 2),
      8 << node.level,
    );
  }

  /** Adds a brick at a corner by its mask of 64 bytes from byte `at` of `masks` on. */
  addBrick(x: number, y: number, z: number, masks: Uint8Array, at: number): void {
    if (this.#shift >= 3) {
      this.addCube(x, y, z, 8);
      return;
    }
    const shift = this.#shift,
      rows = this.#size[1];
    for (let node = 0; node < 64; ++node) {
      const byte = masks[at + node]!;
      if (byte === 0) continue;
      const nx = x + 2 * compact(node),
        ny = y + 2 * compact(node >> 1),
        nz = z + 2 * compact(node >> 2);
      for (let pair = 0; pair < 4; ++pair) {
        // two cells along x
        const bits = (byte >> (2 * pair)) & 3;
        if (bits === 0) continue;
        const row = ((ny + (pair & 1)) >> shift) + rows * ((nz + (pair >> 1)) >> shift);
        const first = (nx + (bits === 2 ? 1 : 0)) >> shift,
          last = (nx + (bits >= 2 ? 1 : 0)) >> shift;
        this.#grow(row, first, last + 1);
      }
    }
  }

  /** The corners of the cubes at the ends of rows, without those inside the hull of their slice. */
  #corners(): number[] {
    const corners: number[] = [];
    for (let z = 0; z < this.#size[2]; ++z) {
      const low = new Chain(1),
        high = new Chain(-1);
      for (let y = 0; y < this.#size[1]; ++y) {
        const row = y + this.#size[1] * z,
          begin = this.#begin[row]!,
          end = this.#end[row]!;
        if (begin >= end) continue;
        low.add(y, begin);
        low.add(y + 1, begin);
        high.add(y, end);
        high.add(y + 1, end);
      }
      for (const chain of [low, high]) {
        for (let i = 0; i < chain.along.length; ++i) {
          corners.push(
            keyOf(chain.along[i]!, z, chain.across[i]!),
            keyOf(chain.along[i]!, z + 1, chain.across[i]!),
          );
        }
      }
    }
    return corners;
  }

  /** x, y, z of points whose convex hull holds all cells; none without cells. */
  points(): Int32Array<ArrayBuffer> {
    const { dims } = this,
      shift = this.#shift;
    // By y, z and x; then by x, y and z; then by z, y and x.
    const ofSlices = reduced(this.#corners(), (y, z, x) => keyOf(x, y, z));
    const keys = sorted(
      reduced(ofSlices, (x, y, z) =>
        keyOf(
          Math.min(z << shift, dims[2]),
          Math.min(y << shift, dims[1]),
          Math.min(x << shift, dims[0]),
        ),
      ),
    );
    const points = new Int32Array(3 * keys.length);
    keys.forEach((key, i) => points.set([third(key), second(key), first(key)], 3 * i));
    return points;
  }
}

// A point is one number, so that points sort fast: three coordinates of 15 bits.
const COORD = 32768;

function keyOf(a: number, b: number, c: number): number {
  return (a * COORD + b) * COORD + c;
}
function first(key: number): number {
  return Math.floor(key / (COORD * COORD));
}
function second(key: number): number {
  return Math.floor(key / COORD) % COORD;
}
function third(key: number): number {
  return key % COORD;
}

/** In ascending order, and each once. */
function sorted(keys: readonly number[]): Float64Array {
  const all = Float64Array.from(keys).sort();
  let count = 0;
  for (let i = 0; i < all.length; ++i) if (i === 0 || all[i] !== all[i - 1]) all[count++] = all[i]!;
  return all.subarray(0, count);
}

/** Removes the points that are not on the hull of those with the same first coordinate. `keyed`
 * makes the keys of the rest from a point's coordinates. */
function reduced(
  keys: readonly number[],
  keyed: (a: number, b: number, c: number) => number,
): number[] {
  const points = sorted(keys),
    left: number[] = [];
  for (let begin = 0, end = 0; begin < points.length; begin = end) {
    const plane = first(points[begin]!),
      low = new Chain(1),
      high = new Chain(-1);
    for (; end < points.length && first(points[end]!) === plane; ++end) {
      low.add(second(points[end]!), third(points[end]!));
      high.add(second(points[end]!), third(points[end]!));
    }
    for (const chain of [low, high]) {
      for (let i = 0; i < chain.along.length; ++i)
        left.push(keyed(plane, chain.along[i]!, chain.across[i]!));
    }
  }
  return left;
}
