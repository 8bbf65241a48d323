// The part of a large grid that is drawn at a finer level when the camera is close.
import type { Box, Seen, Vec3 } from "../view/viewer";

/** Cells on a side that are shown at most: coarser levels stand for larger grids. */
export const SHOWN_SIDE_MAX = 1024;
// Of the box in view, on each side: the camera may move so far before another part is fetched.
const MARGIN = 0.25;

/** The level at which so many cells on a side are at most SHOWN_SIDE_MAX. */
export function levelFor(cells: readonly number[] = []): number {
  return Math.max(0, Math.ceil(Math.log2(Math.max(1, ...cells) / SHOWN_SIDE_MAX)));
}

export interface Part {
  readonly level: number;
  readonly box: Box; // cells of level 0
}

/**
 * The part to draw of a grid of these dims that is shown at `level`, with cells of so many pixels.
 * Its cells have about a pixel, or it is the finest that has the voxels in front; those behind are
 * in it as far as SHOWN_SIDE_MAX allows. `drawn` if that still does; null: the grid as it is.
 */
export function partFor(
  seen: Seen | null,
  level: number,
  pixels: number,
  dims: Vec3,
  drawn: Part | null,
): Part | null {
  if (!seen) return null;
  const scale = 2 ** level,
    { all, front } = seen;
  const pads = front[1].map((end, c) => Math.ceil(MARGIN * (end - front[0][c]!)) * scale);
  const sides = pads.map((pad, c) => scale * (front[1][c]! - front[0][c]!) + 2 * pad);
  const finest = Math.max(level - Math.ceil(Math.log2(Math.max(1, pixels))), levelFor(sides));
  if (finest >= level) return null;
  const isHeld = (low: number, c: number): boolean =>
    low <= scale * front[0][c]! && drawn!.box[1][c]! >= Math.min(dims[c]!, scale * front[1][c]!);
  if (drawn?.level === finest && drawn.box[0].every(isHeld)) return drawn;
  const room = (c: number): number => pads[c]! + (SHOWN_SIDE_MAX * 2 ** finest - sides[c]!) / 2;
  const low = dims.map((_, c) =>
    Math.max(0, scale * all[0][c]! - pads[c]!, Math.ceil(scale * front[0][c]! - room(c))),
  );
  const high = dims.map((end, c) =>
    Math.min(end, scale * all[1][c]! + pads[c]!, Math.floor(scale * front[1][c]! + room(c))),
  );
  return { level: finest, box: [low, high] as unknown as Box };
}
