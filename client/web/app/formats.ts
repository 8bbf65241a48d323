// The formats of a grid to take home, as proto/output_format.h lists them, and their few options.
import { names, T } from "./texts";

export interface FormatOption {
  readonly name: string;
  readonly values: readonly string[]; // the first is the default; empty: a number
  readonly range?: readonly [number, number, number]; // least, greatest, default
}

export interface OutputFormat {
  readonly name: string;
  readonly extension: string;
  readonly text: string;
  readonly group: T;
  readonly options: readonly FormatOption[];
}

const LAYOUT: FormatOption = { name: "layout", values: ["dense", "sparse"] };
const DTYPE: FormatOption = { name: "dtype", values: ["uint8", "bool", "float32"] };
const AXES: FormatOption = { name: "axes", values: ["zyx", "xyz"] };
const MESH: FormatOption = { name: "mesh", values: ["greedy", "faces", "smooth"] };
const DITHER: FormatOption = { name: "dither", values: ["none", "bayer", "error"] };
// All channels; the menu offers those that the grid has.
const CHANNEL: FormatOption = {
  name: "channel",
  values: ["occupancy", "color", "normal", "material", "label", "distance", "coverage"],
};
const BLOCKS: FormatOption = {
  name: "blocks",
  values: ["all", "concrete", "wool", "terracotta", "planks", "stone"],
};
const PALETTE: FormatOption = {
  name: "palette",
  values: ["-", "bw", "gray4", "rgb8", "zx15", "gray16", "sepia16", "cga16", "html16", "cpc27"],
};

// "name text" of each format, or "name extension:text" where the extension is not the name.
const groups: readonly (readonly [T, ...string[]])[] = [
  [T.groupArrays, "npz NumPy archive", "npy NumPy array", "raw raw.zip:Bare array"],
  [T.groupEditors, "vox MagicaVoxel", "qb Qubicle", "binvox binvox", "ldr LDraw bricks"],
  [T.groupMinecraft, "schem Sponge schematic", "litematic Litematica", "nbt Structure block"],
  [T.groupMeshes, "glb glTF binary", "ply PLY", "obj OBJ", "vtu VTK cells", "inp Abaqus"],
  [T.groupPoints, "xyz Text, x y z", "csv CSV", "pcd PCL", "bt OctoMap"],
  [
    T.groupVolumes,
    "vdb OpenVDB",
    "nvdb NanoVDB",
    "vti VTK image",
    "nrrd NRRD",
    "mha MetaImage",
    "zarr zarr.zip:OME-Zarr",
    "nii nii.gz:NIfTI",
    "ktx2 KTX texture",
    "slices slices.zip:PNG slices",
  ],
  [T.groupNative, "native voxg:Native container"],
];

const options: { readonly [format: string]: readonly FormatOption[] } = {
  npz: [LAYOUT, DTYPE, AXES],
  npy: [LAYOUT, DTYPE, AXES],
  vox: [{ name: "palette", values: [], range: [1, 255, 255] }, DITHER],
  qb: [PALETTE],
  ldr: [PALETTE],
  schem: [{ name: "schem_version", values: ["2", "3"] }, BLOCKS, DITHER],
  litematic: [BLOCKS, DITHER],
  nbt: [BLOCKS, DITHER],
  glb: [
    { name: "mesh", values: ["greedy", "faces", "smooth", "instances"] },
    { name: "compress", values: ["none", "meshopt"] },
    PALETTE,
  ],
  ply: [MESH, PALETTE],
  obj: [MESH, PALETTE],
  raw: [CHANNEL, DTYPE],
  nrrd: [CHANNEL, DTYPE],
  mha: [CHANNEL, DTYPE],
  nii: [CHANNEL, DTYPE],
  ktx2: [CHANNEL],
  slices: [CHANNEL, { name: "layout", values: ["dense", "atlas"] }],
  zarr: [{ name: "zarr_version", values: ["3", "2"] }],
  native: [{ name: "codec", values: ["fast", "small"] }],
};

export const formats: readonly OutputFormat[] = groups.flatMap(([group, ...lines]) =>
  lines.map(line => {
    const [name = "", rest = ""] = line.split(/ (.*)/);
    const [text = "", extension = name] = rest.split(":").reverse();
    return { name, extension: "." + extension, text, group, options: options[name] ?? [] };
  }),
);

export function formatOf(name: string): OutputFormat {
  return formats.find(format => format.name === name) ?? (formats[0] as OutputFormat);
}

/** The label of an option. */
export function optionText(option: FormatOption): string {
  return names[`option_${option.name}${option.range ? "_max" : ""}`]!;
}
