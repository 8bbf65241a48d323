// Files of others are those whose checksums are listed.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";

test("the files of fzstd have their checksums", () => {
  const folder = join(process.env["VOXELD_SOURCE_DIR"]!, "client/web/third_party/fzstd");
  const sums = readFileSync(join(folder, "SHA256SUMS"), "utf8")
    .trim()
    .split("\n")
    .map((line) => line.split(/ +/));
  assert.deepEqual(
    sums.map(([, name]) => name),
    ["fzstd.js", "LICENSE"],
  );
  for (const [sum, name] of sums) {
    assert.equal(
      createHash("sha256")
        .update(readFileSync(join(folder, name!)))
        .digest("hex"),
      sum,
      name,
    );
  }
});
