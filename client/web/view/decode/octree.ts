// The breadth-first octree of a tile (proto/README.md): from the root of 256 cells down to nodes of
// 2 cells, a byte per node.
import { fail } from "./decode_error";
import { bitCount } from "./morton";

const LEVELS = 8;
const BRICK_LEVEL = 5;
/** The most bytes of a tile's octree: 1 + 8 + ... + 8^7. */
export const OCTREE_BYTES_MAX = 2_396_745;

/** A node whose voxels are all occupied and have no attributes, of 2^level bricks on a side. */
export interface FullNode {
  readonly code: number; // Morton code of its first brick
  readonly level: number;
}

function broken(detail: string): never {
  fail(`grid container, octree: ${detail}`);
}

function bitsOf(bytes: Uint8Array): number {
  let count = 0;
  for (let i = 0; i < bytes.length; ++i) count += bitCount(bytes[i]!);
  return count;
}

function zerosOf(bytes: Uint8Array): number {
  let count = 0;
  for (let i = 0; i < bytes.length; ++i) if (bytes[i] === 0) ++count;
  return count;
}

/** The levels of an octree, with counts that are cheap to take. */
export class Octree {
  readonly bricks: number; // outside full nodes
  readonly maskVoxels: number; // of those bricks
  readonly voxels: number; // those of full nodes included
  readonly #levels: Uint8Array[] = [];

  constructor(bytes: Uint8Array) {
    let at = 0,
      count = 1;
    for (let level = 0; level < LEVELS; ++level) {
      if (bytes.length - at < count) broken(`level ${level} is cut off`);
      const nodes = bytes.subarray(at, at + count);
      if (level > BRICK_LEVEL && zerosOf(nodes) > 0) broken(`level ${level} has an empty node`);
      this.#levels.push(nodes);
      at += count;
      count = bitsOf(nodes);
    }
    if (at !== bytes.length) broken("bytes after the last level");
    let inFull = 0;
    for (let level = 0; level <= BRICK_LEVEL; ++level) {
      inFull += zerosOf(this.#levels[level]!) * 2 ** (3 * (LEVELS - level));
    }
    this.bricks = this.#levels[BRICK_LEVEL]!.length - zerosOf(this.#levels[BRICK_LEVEL]!);
    this.maskVoxels = count;
    this.voxels = count + inFull;
  }

  /**
   * Writes the masks of the bricks, `stride` bytes apart, from byte `at` of `masks` on, and returns
   * their Morton codes. The bytes must be zeros. Full nodes are added to `full` in ascending order.
   */
  read(masks: Uint8Array, at: number, stride: number, full: FullNode[]): Uint32Array {
    let codes = new Uint32Array(1);
    for (let level = 0; level < BRICK_LEVEL; ++level) codes = this.#childrenOf(level, codes, full);
    const bricks = new Uint32Array(this.bricks);
    const [nodes, pairs, cells] = this.#levels.slice(BRICK_LEVEL) as [
      Uint8Array,
      Uint8Array,
      Uint8Array,
    ];
    let brick = 0,
      pair = 0,
      cell = 0;
    for (let i = 0; i < codes.length; ++i) {
      const code = codes[i]!,
        node = nodes[i]!;
      if (node === 0) {
        full.push({ code, level: 0 });
        continue;
      }
      const mask = at + brick * stride;
      bricks[brick++] = code;
      for (let a = 0; a < 8; ++a) {
        if (((node >> a) & 1) === 0) continue;
        const bits = pairs[pair++]!;
        for (let b = 0; b < 8; ++b)
          if (((bits >> b) & 1) !== 0) masks[mask + 8 * a + b] = cells[cell++]!;
      }
    }
    full.sort((a, b) => a.code - b.code);
    return bricks;
  }

  #childrenOf(
    level: number,
    codes: Uint32Array,
    full: FullNode[],
  ): Uint32Array<ArrayBuffer> {
    const nodes = this.#levels[level]!,
      children = new Uint32Array(this.#levels[level + 1]!.length);
    let count = 0;
    for (let i = 0; i < codes.length; ++i) {
      const code = codes[i]!,
        mask = nodes[i]!,
        up = BRICK_LEVEL - level;
      if (mask === 0) full.push({ code: code << (3 * up), level: up });
      for (let b = 0; b < 8; ++b) if (((mask >> b) & 1) !== 0) children[count++] = (code << 3) | b;
    }
    return children;
  }
}

function fillsParent(full: readonly FullNode[], first: number): boolean {
  const { code, level } = full[first]!,
    bricks = 1 << (3 * level);
  if (level >= BRICK_LEVEL || code % (8 * bricks) !== 0) return false;
  for (let i = 0; i < 8; ++i) {
    const node = full[first + i]!;
    if (node.level !== level || node.code !== code + i * bricks) return false;
  }
  return true;
}

/** Refuses eight full nodes that fill the next larger one. `full` is in ascending order. */
export function checkFullNodes(full: readonly FullNode[]): void {
  for (let i = 0; i + 8 <= full.length; ++i) {
    if (fillsParent(full, i)) broken("a full node is spelled out");
  }
}

/** Refuses a full mask, which is a full node where voxels have no attributes. */
export function checkMasks(masks: Uint8Array, at: number, stride: number, bricks: number): void {
  for (let i = 0; i < bricks; ++i) {
    const first = at + i * stride;
    let all = 255;
    for (let b = 0; b < 64 && all === 255; ++b) all &= masks[first + b]!;
    if (all === 255) broken("a full node is spelled out");
  }
}
