// Options that a compiler accepts, and mistakes that it finds: each line below "@ts-expect-error" must be an error.
import type { components } from "./api.js";

type Schemas = components["schemas"];

export const right: Schemas["VoxelizeOptions"] = {
  size: 64, voxel_size: [0.1, 0.1, 0.2], bounds: "0,0,0,1,1,1", channels: ["color", "normal"], fill: "solid", cache: false,
};
export const view: Schemas["JobRequest"] = { kind: "render", grid: "sha256-…", options: { samples: 2, shadow: true } };
export const echoed = (options: Schemas["EchoedOptions"]): number => (options.azimuth ?? 0) + (options.dims?.[0] ?? 0);

// @ts-expect-error: a word that fill does not have
export const word: Schemas["VoxelizeOptions"] = { fill: "solidd" };
// @ts-expect-error: an unknown option
export const name: Schemas["VoxelizeOptions"] = { siez: 64 };
// @ts-expect-error: an option of images
export const scope: Schemas["JobRequest"] = { kind: "voxelize", asset: "sha256-…", options: { azimuth: 30 } };
// @ts-expect-error: a list for a number
export const type: Schemas["VoxelizeOptions"] = { size: [64] };
// @ts-expect-error: an echoed number is never a text
export const text = (options: Schemas["EchoedOptions"]): string | undefined => options.azimuth;
