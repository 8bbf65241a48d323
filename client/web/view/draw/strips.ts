// Draws an image strip by strip, so that the page and other pages stay responsive on slow devices.
import type { Target } from "./gl_objects";
import type { Painter } from "./painter";

const FIRST_ROWS = 32;
const STRIP_MS = 40; // aimed at

/**
 * Draws the whole image. Returns the milliseconds that it took, or null if isOutdated() became true
 * between strips.
 */
export async function drawStrips(
  painter: Painter,
  program: WebGLProgram,
  params: ArrayBuffer,
  target: Target,
  isOutdated: () => boolean,
  textures = painter.textures,
): Promise<number | null> {
  let rows = FIRST_ROWS,
    total = 0;
  for (let first = 0; first < target.height;) {
    const end = Math.min(first + rows, target.height),
      begin = performance.now();
    painter.draw(program, params, target, first, end, textures);
    await painter.finished();
    const ms = performance.now() - begin;
    total += ms;
    if (isOutdated()) return null;
    rows = Math.max(8, Math.round(rows * Math.min(Math.max(STRIP_MS / ms, 0.25), 4)));
    first = end;
  }
  return total;
}
