// Means of colours and normals of bricks and blocks, which are drawn in place of small voxels.
// Numbers are integers as in server/render/mean_voxel.cpp, so that both packings are equal.
import { bitCount } from "../decode/morton";
import {
  BLOCK_COLOR,
  BLOCK_ENTRIES,
  BLOCK_NORMAL,
  BRICK_COLOR,
  BRICK_FIRST,
  BRICK_NORMAL,
  BRICK_WORDS,
  CHILD,
  TILE_ENTRIES,
  type PackedGrid,
  type Words,
} from "./packed_grid";

function linearTable(one: number): Uint32Array {
  const table = new Uint32Array(256);
  for (let i = 0; i < 256; ++i) {
    const c = i / 255;
    table[i] = Math.round(one * (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  }
  return table;
}

// 16-bit linear light of each sRGB byte.
const LINEAR = /* @__PURE__ */ linearTable(65535);

/** The sRGB byte with the nearest linear light. */
function srgbByte(linear: number): number {
  let low = 0,
    high = 255;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (LINEAR[middle]! < linear) low = middle + 1;
    else high = middle;
  }
  if (low === 0) return 0;
  return LINEAR[low]! - linear < linear - LINEAR[low - 1]! ? low : low - 1;
}

/**
 * The mean, in linear light, of words [first, first + count). Words of alpha 0 count only if there
 * are no others; then the mean has alpha 0. 0 if there are none.
 */
export function meanColor(words: Uint32Array, first: number, count: number): number {
  if (count === 0) return 0;
  let visible = 0;
  for (let i = first; i < first + count; ++i) visible += words[i]! >>> 24 === 0 ? 0 : 1;
  const used = visible === 0 ? count : visible;
  let r = 0,
    g = 0,
    b = 0;
  for (let i = first; i < first + count; ++i) {
    const word = words[i]!;
    if (visible !== 0 && word >>> 24 === 0) continue;
    r += LINEAR[word & 255]!;
    g += LINEAR[(word >>> 8) & 255]!;
    b += LINEAR[(word >>> 16) & 255]!;
  }
  const half = used >> 1;
  const byte = (sum: number): number => srgbByte(Math.floor((sum + half) / used));
  const alpha = visible === 0 ? 0 : 0xff000000;
  return (alpha | (byte(b) << 16) | (byte(g) << 8) | byte(r)) >>> 0;
}

/** The mean of packed normals; 0 if there are none. */
export function meanNormal(words: Uint32Array, first: number, count: number): number {
  if (count === 0) return 0;
  let x = 0,
    y = 0,
    z = 0;
  for (let i = first; i < first + count; ++i) {
    const word = words[i]!;
    x += (word << 24) >> 24;
    y += (word << 16) >> 24;
    z += (word << 8) >> 24;
  }
  const byte = (sum: number): number => Math.trunc(sum / count) & 255;
  return byte(x) | (byte(y) << 8) | (byte(z) << 16);
}

/**
 * The mean of all voxels' colours as sRGB, weighted by alpha; a grey if all of it is 0. Integers as
 * in server/grid/color/mean_color.cpp.
 */
export function meanOfAll(words: Uint32Array, count: number): [number, number, number] {
  const table = linearTable(1 << 20),
    mean: number[] = [];
  for (const shift of [0, 8, 16]) {
    const alphas = new Float64Array(256); // by byte: products with the table exceed 53 bits
    for (let i = 0; i < count; ++i) alphas[(words[i]! >>> shift) & 255]! += words[i]! >>> 24;
    let sum = 0n,
      weight = 0n,
      byte = 0;
    alphas.forEach((alpha, value) => {
      weight += BigInt(alpha);
      sum += BigInt(alpha) * BigInt(table[value]!);
    });
    if (weight === 0n) return [180, 180, 180];
    const linear = Number((sum + weight / 2n) / weight);
    while (byte < 255 && 2 * linear > table[byte]! + table[byte + 1]!) ++byte;
    mean.push(byte);
  }
  return mean as [number, number, number];
}

/**
 * The median luminance (Rec. 709) in linear light of at most some 100,000 words, without those of
 * alpha 0; 1 if none is left.
 */
export function medianLuminance(words: Uint32Array, count: number): number {
  const step = Math.floor(count / 100_000) + 1;
  const samples = new Float64Array(Math.ceil(count / step));
  let visible = 0;
  for (let i = 0; i < count; i += step) {
    const word = words[i]!;
    if (word >>> 24 === 0) continue;
    samples[visible++] =
      0.2126 * (LINEAR[word & 255]! / 65535) +
      0.7152 * (LINEAR[(word >>> 8) & 255]! / 65535) +
      0.0722 * (LINEAR[(word >>> 16) & 255]! / 65535);
  }
  if (visible === 0) return 1;
  return samples.subarray(0, visible).sort()[visible >> 1]!;
}

function voxelsOfBrick(bricks: Uint32Array, at: number): number {
  let count = 0;
  for (let i = 0; i < 16; ++i) count += bitCount(bricks[at + i]!);
  return count;
}

/** Offsets of the tables of the grid's blocks. */
function blockTables(grid: Pick<PackedGrid, "nodes" | "tileDims">): number[] {
  const { nodes, tileDims } = grid,
    tables: number[] = [];
  for (let tile = 0; tile < tileDims[0] * tileDims[1] * tileDims[2]; ++tile) {
    const entry = nodes[tile]!;
    if ((entry & CHILD) === 0) continue;
    const table = entry & ~CHILD;
    for (let i = 0; i < TILE_ENTRIES; ++i) {
      const block = nodes[table + i]!;
      if ((block & CHILD) !== 0) tables.push(block & ~CHILD);
    }
  }
  return tables;
}

type Tables = Pick<PackedGrid, "nodes" | "tileDims" | "bricks" | "brickCount">;

function setMeans(
  grid: Tables,
  values: Words,
  brickWord: number,
  blockWord: number,
  mean: (words: Uint32Array, first: number, count: number) => number,
): void {
  const { nodes, bricks } = grid;
  for (let brick = 0; brick < grid.brickCount; ++brick) {
    const at = brick * BRICK_WORDS;
    bricks[at + brickWord] = mean(values, bricks[at + BRICK_FIRST]!, voxelsOfBrick(bricks, at));
  }
  const means = new Uint32Array(BLOCK_ENTRIES);
  for (const table of blockTables(grid)) {
    let count = 0;
    for (let i = 0; i < BLOCK_ENTRIES; ++i) {
      const entry = nodes[table + i]!;
      if ((entry & CHILD) !== 0)
        means[count++] = bricks[(entry & ~CHILD) * BRICK_WORDS + brickWord]!;
    }
    nodes[table + blockWord] = mean(means, 0, count);
  }
}

/** Writes the means of the colours into the tables of bricks and blocks. */
export function setColorMeans(grid: Tables, colors: Words): void {
  setMeans(grid, colors, BRICK_COLOR, BLOCK_COLOR, meanColor);
}
export function setNormalMeans(grid: Tables, normals: Words): void {
  setMeans(grid, normals, BRICK_NORMAL, BLOCK_NORMAL, meanNormal);
}
