// The colours in which a channel is shown.
import type { Channel, Vec3 } from "../viewer";
import { idColor } from "./id_color";
import { medianLuminance } from "./means";
import { tableOf, type Attributes, type PackedGrid, type Paint, type Words } from "./packed_grid";

/** sRGB stops of the ramps, evenly spaced; those of coverage after viridis of matplotlib. */
const COVERAGE_STOPS: readonly Vec3[] = [
  [68, 1, 84],
  [59, 82, 139],
  [33, 145, 140],
  [94, 201, 98],
  [253, 231, 37],
];
const DISTANCE_STOPS: readonly Vec3[] = [
  [33, 102, 172],
  [146, 197, 222],
  [247, 247, 247],
  [244, 165, 130],
  [178, 24, 43],
];

function word(r: number, g: number, b: number): number {
  return (0xff000000 | (b << 16) | (g << 8) | r) >>> 0;
}

/** A colour word of each of 256 steps along the stops. */
function rampOf(stops: readonly Vec3[]): Words {
  const ramp = new Uint32Array(256);
  for (let i = 0; i < 256; ++i) {
    const at = (i / 255) * (stops.length - 1),
      low = Math.min(Math.floor(at), stops.length - 2);
    const mix = (c: number): number =>
      Math.round(stops[low]![c]! + (at - low) * (stops[low + 1]![c]! - stops[low]![c]!));
    ramp[i] = word(mix(0), mix(1), mix(2));
  }
  return ramp;
}

function idPaint(ids: Uint16Array): Words {
  const colors = tableOf(ids.length),
    known = new Map<number, number>();
  for (let i = 0; i < ids.length; ++i) {
    const id = ids[i]!;
    let color = known.get(id);
    if (color === undefined) known.set(id, (color = idColor(id)));
    colors[i] = color;
  }
  return colors;
}

/** Blue inside, white on the surface, red outside; the ends are the farthest voxels. */
function distancePaint(distances: Int16Array): Words {
  const colors = tableOf(distances.length),
    ramp = rampOf(DISTANCE_STOPS);
  let most = 1;
  for (let i = 0; i < distances.length; ++i) most = Math.max(most, Math.abs(distances[i]!));
  for (let i = 0; i < distances.length; ++i) {
    colors[i] = ramp[Math.round((distances[i]! / most + 1) * 127.5)]!;
  }
  return colors;
}

function normalPaint(normals: Words, count: number): Words {
  const colors = tableOf(count);
  for (let i = 0; i < count; ++i) {
    // Each signed byte, -127..127, becomes 1..255.
    colors[i] = (((normals[i]! & 0xffffff) ^ 0x808080) | 0xff000000) >>> 0;
  }
  return colors;
}

function colorsOf(attributes: Attributes, channel: Channel, count: number): Words | null {
  const { color, normal, material, label, distance, coverage } = attributes;
  switch (channel) {
    case "color":
      return color ?? null;
    case "normal":
      return normal ? normalPaint(normal, count) : null;
    case "material":
      return material ? idPaint(material) : null;
    case "label":
      return label ? idPaint(label) : null;
    case "distance":
      return distance ? distancePaint(distance) : null;
    case "coverage": {
      if (!coverage) return null;
      const ramp = rampOf(COVERAGE_STOPS),
        colors = tableOf(count);
      for (let i = 0; i < count; ++i) colors[i] = ramp[coverage[i]!]!;
      return colors;
    }
  }
}

/**
 * Colours whose voxels inside of solids, which are (0,0,0,0), have that of `inner`, with alpha 0:
 * means leave it out.
 */
function withInner(colors: Words, count: number, [r, g, b]: Vec3): Words {
  const all = tableOf(count),
    inner = word(r, g, b) & 0xffffff;
  for (let i = 0; i < count; ++i) all[i] = colors[i] || inner;
  return all;
}

/** The colours of a channel, or null if the grid lacks it. */
export function paintOf(
  grid: Pick<PackedGrid, "attributes" | "attributeCount" | "inner">,
  channel: Channel,
): Paint | null {
  const { attributes, attributeCount: count, inner } = grid;
  let colors = colorsOf(attributes, channel, count);
  if (!colors) return null;
  // Measures and normals keep their colours; the others are brightened as the daemon does.
  const isMeasure = channel === "normal" || channel === "distance" || channel === "coverage";
  let fullColor = channel === "color" ? inner : null;
  if (fullColor && colors.subarray(0, count).includes(0))
    colors = withInner(colors, count, fullColor);
  if (channel === "coverage") fullColor = COVERAGE_STOPS[COVERAGE_STOPS.length - 1]!;
  return { colors, fullColor, luminance: isMeasure ? 1 : medianLuminance(colors, count) };
}
