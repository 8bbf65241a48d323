// Sizes of the empty cubes in tables, which rays cross in one step.
import type { Vec3 } from "../viewer";
import { FULL } from "./packed_grid";

/**
 * Writes into the empty entries of the table at `first` the size of the aligned empty cube around
 * each, as a power of two of cells. entryShift: that of one entry. A cube of twice the side is
 * empty if its eight halves are; entries outside the table count as empty.
 */
export function markEmptyCubes(
  nodes: Uint32Array,
  first: number,
  dims: Vec3,
  entryShift: number,
): void {
  const [width, height, depth] = dims,
    count = width * height * depth;
  for (let i = first; i < first + count; ++i) if (nodes[i]! < FULL) nodes[i] = entryShift;
  let shift = entryShift;
  for (let half = 1; half < Math.max(width, height, depth); half *= 2) {
    const side = 2 * half;
    ++shift;
    for (let z = 0; z < depth; z += side) {
      for (let y = 0; y < height; y += side) {
        for (let x = 0; x < width; x += side) joinCube(nodes, first, dims, [x, y, z], half, shift);
      }
    }
  }
}

function joinCube(
  nodes: Uint32Array,
  first: number,
  dims: Vec3,
  low: Vec3,
  half: number,
  shift: number,
): void {
  const xEnd = Math.min(low[0] + 2 * half, dims[0]),
    yEnd = Math.min(low[1] + 2 * half, dims[1]);
  const zEnd = Math.min(low[2] + 2 * half, dims[2]);
  for (let z = low[2]; z < zEnd; z += half) {
    for (let y = low[1]; y < yEnd; y += half) {
      const row = first + dims[0] * (y + dims[1] * z);
      // A half is empty if its first entry was raised to the half's size.
      for (let x = low[0]; x < xEnd; x += half) if (nodes[row + x] !== shift - 1) return;
    }
  }
  for (let z = low[2]; z < zEnd; ++z) {
    for (let y = low[1]; y < yEnd; ++y) {
      const row = first + dims[0] * (y + dims[1] * z);
      nodes.fill(shift, row + low[0], row + xEnd);
    }
  }
}
