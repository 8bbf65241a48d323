// The part of a large grid that is drawn at a finer level when the camera is close.
import type { Box, Seen, Vec3 } from "../view/viewer";

// Cells on a side that are shown at most; of a part, most of which is empty.
const SHOWN_SIDE_MAX = 1024,
  PART_SIDE_MAX = 2048;
// Share of the box in view on each side: the camera may move so far before another part is fetched.
const MARGIN = 0.25;

/** The level at which so many cells on a side are at most `most`. */
export function levelFor(cells: readonly number[] = [], most = SHOWN_SIDE_MAX): number {
  return Math.max(0, Math.ceil(Math.log2(Math.max(1, ...cells) / most)));
}

export interface Part {
  readonly level: number;
  readonly box: Box; // cells of level 0
}

/**
 * The part to draw of a grid of these dims that is shown at `level`, with cells of so many pixels.
 * Its cells have about a pixel, or it is the finest that has the voxels in front; those behind are
 * in it as far as PART_SIDE_MAX allows. `drawn` if that still does; null: the grid as it is.
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
  const sides = front[1].map((end, c) => scale * (end - front[0][c]!));
  const finest = Math.max(
    level - Math.ceil(Math.log2(Math.max(1, pixels))),
    levelFor(sides, PART_SIDE_MAX),
  );
  if (finest >= level) return null;
  const isHeld = (low: number, c: number): boolean =>
    low <= scale * front[0][c]! && drawn!.box[1][c]! >= Math.min(dims[c]!, scale * front[1][c]!);
  if (drawn?.level === finest && drawn.box[0].every(isHeld)) return drawn;
  const edge = (end: 0 | 1, c: number): number => {
    const sign = 2 * end - 1,
      room = (PART_SIDE_MAX * 2 ** finest - sides[c]!) / 2,
      margin = MARGIN * sides[c]!,
      at = (box: Box): number => sign * scale * box[end][c]!;
    const wanted = Math.min(at(all) + margin, at(front) + room);
    return Math.min(Math.max(0, Math.trunc(sign * wanted)), dims[c]!);
  };
  const corner = (end: 0 | 1): Vec3 => [edge(end, 0), edge(end, 1), edge(end, 2)];
  return { level: finest, box: [corner(0), corner(1)] };
}
