// Files that a person gives: dropped, pasted or chosen, one by one, together or as a folder.

/** A file and its path in what was given, with slashes. */
export interface NamedFile {
  readonly name: string;
  readonly blob: Blob;
}

/** One mesh with the files that it may refer to. */
export interface Bundle {
  readonly mesh: NamedFile;
  readonly files: readonly NamedFile[]; // with the mesh; names are relative to its folder
  readonly ignored: number; // further meshes that were left out
}

const MESHES = [
  "md5mesh",
  "gltf",
  "glb",
  "obj",
  "ply",
  "stl",
  "off",
  "3mf",
  "zip",
  "vox",
  "voxg",
  "binvox",
  "npy",
  "nrrd",
];
const COMPANIONS = [
  "mtl",
  "bin",
  "md5anim",
  "mtr",
  "png",
  "jpg",
  "jpeg",
  "tga",
  "bmp",
  "dds",
  "webp",
  "tif",
  "tiff",
  "hdr",
  "gif",
];
const FILES_MAX = 1000; // of a bundle, as the daemon has it
const LOOKED_AT_MAX = 1e5;

export function extensionOf(name: string): string {
  return name.slice(name.lastIndexOf(".") + 1).toLowerCase();
}

/** "models/bunny.ply" -> "bunny" */
export function stemOf(name: string): string {
  const last = name.slice(name.lastIndexOf("/") + 1).replace(/\.bundle\.json$/, "");
  return last.lastIndexOf(".") > 0 ? last.slice(0, last.lastIndexOf(".")) : last;
}

function isMesh(file: NamedFile): boolean {
  return MESHES.includes(extensionOf(file.name));
}

// Whether files of the mesh's format may name others.
function hasCompanions(mesh: NamedFile): boolean {
  return ["md5mesh", "gltf", "glb", "obj", "ply"].includes(extensionOf(mesh.name));
}

function isCompanion(file: NamedFile): boolean {
  return file.blob.size > 0 && COMPANIONS.includes(extensionOf(file.name));
}

async function entriesOf(folder: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = folder.createReader();
  const all: FileSystemEntry[] = [];
  for (;;) {
    // a reader gives about 100 at a time
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) =>
      reader.readEntries(resolve, reject),
    );
    if (some.length === 0) return all;
    all.push(...some);
  }
}

async function walk(entry: FileSystemEntry, path: string, found: NamedFile[]): Promise<void> {
  if (found.length >= LOOKED_AT_MAX || entry.name.startsWith(".")) return;
  if (entry.isFile) {
    const blob = await new Promise<File>((resolve, reject) =>
      (entry as FileSystemFileEntry).file(resolve, reject),
    );
    found.push({ name: path + entry.name, blob });
  } else if (entry.isDirectory) {
    for (const inner of await entriesOf(entry as FileSystemDirectoryEntry)) {
      await walk(inner, `${path}${entry.name}/`, found);
    }
  }
}

/** The files of a drop or paste; folders with all that is in them. */
export async function filesOfTransfer(transfer: DataTransfer): Promise<NamedFile[]> {
  // Both lists end with the event, so they are read before anything is awaited.
  const files = [...transfer.files];
  const entries = [...transfer.items]
    .filter(item => item.kind === "file")
    .map(item => item.webkitGetAsEntry());
  if (!entries.some(entry => entry?.isDirectory))
    return files.map(blob => ({ name: blob.name, blob }));
  const found: NamedFile[] = [];
  for (const entry of entries) {
    if (entry) await walk(entry, "", found);
  }
  return found;
}

/** The files of an input; those of a folder keep their paths. */
export function filesOfInput(input: HTMLInputElement): NamedFile[] {
  return [...(input.files ?? [])].map(blob => ({
    name: blob.webkitRelativePath || blob.name,
    blob,
  }));
}

/**
 * The mesh of the files and what goes with it; null if none is a mesh. The mesh has
 * the first format of MESHES that the files have, which begins with the most companions', and is the
 * largest file of that format.
 */
export function bundleOf(files: readonly NamedFile[]): Bundle | null {
  const meshes = files
    .filter(isMesh)
    .sort(
      (a, b) =>
        MESHES.indexOf(extensionOf(a.name)) - MESHES.indexOf(extensionOf(b.name)) ||
        b.blob.size - a.blob.size,
    );
  const mesh = meshes[0];
  if (!mesh) return null;
  const folder = mesh.name.slice(0, mesh.name.lastIndexOf("/") + 1);
  const inFolder = (file: NamedFile) => file.name.startsWith(folder);
  // A mesh in a subfolder may name files beside its folder: then all keep their paths.
  const companions = files.filter(isCompanion);
  const cut = companions.every(inFolder) ? folder.length : 0;
  const named = [mesh, ...companions].slice(0, FILES_MAX).map(file => ({
    name: file.name.slice(cut),
    blob: file.blob,
  }));
  return {
    mesh: named[0] as NamedFile,
    files: hasCompanions(mesh) ? named : [named[0] as NamedFile],
    ignored: meshes.length - 1,
  };
}

/**
 * The bundle with files that it lacked, dropped later; null if there are none among these, or the
 * mesh's format names no others.
 */
export function extended(bundle: Bundle, files: readonly NamedFile[]): Bundle | null {
  const added = files
    .filter(isCompanion)
    .map(file => ({ name: file.name.slice(file.name.lastIndexOf("/") + 1), blob: file.blob }));
  if (added.length === 0 || !hasCompanions(bundle.mesh)) return null;
  const names = new Set(added.map(file => file.name.toLowerCase()));
  return {
    ...bundle,
    files: [...bundle.files.filter(file => !names.has(file.name.toLowerCase())), ...added],
  };
}
