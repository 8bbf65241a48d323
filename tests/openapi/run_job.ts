// Uploads a mesh, voxelizes it as a job and prints its state, options and dims: run_job.js URL FILE
import { readFile } from "node:fs/promises";
import createClient from "openapi-fetch";
import type { paths } from "./api.js";

const [baseUrl = "", file = ""] = process.argv.slice(2);
const voxeld = createClient<paths>({ baseUrl });
const asset = await voxeld.POST("/v1/assets", {
  params: { query: { filename: "mesh.ply" } },
  body: await readFile(file), bodySerializer: (mesh) => mesh as Uint8Array<ArrayBuffer>,
});
if (asset.error) throw new Error(asset.error.detail);
const job = await voxeld.POST("/v1/jobs", {
  params: { header: { Prefer: "wait=30" } },
  body: { kind: "voxelize", asset: asset.data.id, options: { size: 32, fill: "solid", format: "npy" } },
});
if (job.error || !("state" in job.data)) throw new Error(job.error?.detail ?? "no job");
const result = await voxeld.GET("/v1/jobs/{id}/result", {
  params: { path: { id: job.data.id } }, parseAs: "arrayBuffer",
});
console.log(JSON.stringify({ state: job.data.state, options: job.data.options, bytes: result.data?.byteLength }));
