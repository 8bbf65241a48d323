// Small pictures of voxels: cubes from above at an angle, painted from the back to the front.

type Rgb = readonly [number, number, number];
/** The colour of a cell, 0..255; null where it is empty. y is up. */
export type Cells = (x: number, y: number, z: number) => Rgb | null;

function shade([r, g, b]: Rgb, light: number): string {
  const by = (value: number) => Math.min(255, Math.round(value * light));
  return `rgb(${by(r)} ${by(g)} ${by(b)})`;
}

/** Paints n^3 cells into the canvas. */
export function paintVoxels(canvas: HTMLCanvasElement, n: number, cells: Cells): void {
  const context = canvas.getContext("2d");
  if (!context) return;
  const { width, height } = canvas;
  const unit = Math.min(width / (2 * n * 0.866), height / (2 * n)) * 0.98;
  const dx = unit * 0.866,
    dy = unit * 0.5;
  const face = (color: string, points: readonly (readonly [number, number])[]) => {
    context.fillStyle = context.strokeStyle = color;
    context.lineWidth = 0.6; // closes the seams between faces
    context.beginPath();
    for (const [x, y] of points) context.lineTo(x, y);
    context.closePath();
    context.fill();
    context.stroke();
  };
  context.clearRect(0, 0, width, height);
  for (let y = 0; y < n; ++y) {
    for (let z = 0; z < n; ++z) {
      for (let x = 0; x < n; ++x) {
        const color = cells(x, y, z);
        if (!color) continue;
        const left = width / 2 + (x - z) * dx,
          top = height / 2 + (x + z - n) * dy - (y + 1 - n / 2) * unit;
        if (!cells(x, y + 1, z))
          face(shade(color, 1.08), [
            [left, top],
            [left + dx, top + dy],
            [left, top + 2 * dy],
            [left - dx, top + dy],
          ]);
        if (!cells(x, y, z + 1))
          face(shade(color, 0.82), [
            [left - dx, top + dy],
            [left, top + 2 * dy],
            [left, top + 2 * dy + unit],
            [left - dx, top + dy + unit],
          ]);
        if (!cells(x + 1, y, z))
          face(shade(color, 0.64), [
            [left + dx, top + dy],
            [left, top + 2 * dy],
            [left, top + 2 * dy + unit],
            [left + dx, top + dy + unit],
          ]);
      }
    }
  }
}
