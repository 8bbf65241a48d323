// Reads arrays of a Zarr store over HTTP with zarrita, as viewers in a browser do.
//
//   node read_store.mjs URL VERSION FOLDER PATH...
//
// Writes the elements of the array at each path as FOLDER/N.bin, N its place among the paths, and prints JSON: shapes,
// types and attributes of the root.
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import * as zarr from "zarrita";

const [url, version, folder, ...paths] = process.argv.slice(2);
const open = version === "3" ? zarr.open.v3 : zarr.open.v2;
const root = await open(new zarr.FetchStore(url), { kind: "group" });
const arrays = [];
for (const [place, path] of paths.entries()) {
  const array = await open(root.resolve(path), { kind: "array" });
  const { data, shape } = await zarr.get(array);
  writeFileSync(join(folder, `${place}.bin`), Buffer.from(data.buffer, data.byteOffset, data.byteLength));
  arrays.push({ shape, type: array.dtype });
}
console.log(JSON.stringify({ arrays, attributes: root.attrs }));
