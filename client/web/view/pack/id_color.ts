// Colours of ids, those of server/grid/color/id_color.cpp.

/** The colour word of voxels without an id: R | G << 8 | B << 16 | A << 24. */
const NEUTRAL = 0xffb4b4b4;

/** The sRGB word of an id. Hues of consecutive ids are a golden section of the circle apart. */
export function idColor(id: number): number {
  if (id === 0) return NEUTRAL;
  const hue = (id * 949) % 1536;
  const bright = [235, 190, 150][Math.floor(id / 7) % 3]!,
    dark = bright >> 2;
  const rising = dark + Math.floor(((bright - dark) * (hue % 256)) / 255);
  const falling = bright + dark - rising;
  const [r, g, b] = [
    [bright, rising, dark],
    [falling, bright, dark],
    [dark, bright, rising],
    [dark, falling, bright],
    [rising, dark, bright],
    [bright, dark, falling],
  ][hue >> 8] as [number, number, number];
  return (0xff000000 | (b << 16) | (g << 8) | r) >>> 0;
}
