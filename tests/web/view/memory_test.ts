// Memory of the viewer. Runs in the long form alone.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Session } from "./browser/session";

const session = new Session(300, 200);

test("a grid of 1024 takes less than 30 MB of the page", async () => {
  const { daemon, server, browser } = session;
  const query = { size: 1024, format: "native" };
  server.data.set("fine.voxg", await daemon.post("voxelize", "sample.ply", query));
  const { voxels } = await browser.call("show", "fine.voxg");
  await browser.send("HeapProfiler.collectGarbage");
  const heap = await browser.send<{ usedSize: number; backingStorageSize: number }>(
    "Runtime.getHeapUsage",
  );
  const bytes = heap.usedSize + heap.backingStorageSize;
  console.log(`${voxels} voxels: ${bytes} bytes`);
  assert.ok(voxels > 1e6 && bytes > 1e6 && bytes < 30e6, `${voxels} voxels, ${bytes} bytes`);
});
