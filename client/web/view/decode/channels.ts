// The channels of a container in the order of their bits (proto/README.md).
import type { Channel } from "../viewer";

export interface ChannelInfo {
  readonly name: Channel;
  readonly planes: number; // bytes per voxel, each a plane of its own
}

export const CHANNELS: readonly ChannelInfo[] = [
  { name: "color", planes: 4 },
  { name: "normal", planes: 3 },
  { name: "material", planes: 2 },
  { name: "label", planes: 2 },
  { name: "distance", planes: 2 },
  { name: "coverage", planes: 1 },
];

/** Steps of the distance channel per voxel; with distance=world, per shortest edge of one. */
export const DISTANCE_STEPS = 128;

/** The channel if a grid has it. */
export function channelIn(
  { channels }: { readonly channels: readonly Channel[] },
  channel: Channel | null,
): Channel | null {
  return channel && channels.includes(channel) ? channel : null;
}

/** The channel that colours a grid by itself: colours, else labels, else materials. */
export function ownChannel(channels: readonly Channel[]): Channel | null {
  for (const channel of ["color", "label", "material"] as const) {
    if (channels.includes(channel)) return channel;
  }
  return null;
}
