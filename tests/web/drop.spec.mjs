// Meshes that are dropped or chosen, samples, uploads.
import { execFileSync } from "node:child_process";
import { cpSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { basename, join } from "node:path";
import { run, temporaryFolder } from "./daemon.mjs";
import {
  daemon,
  DRAWN,
  download,
  drop,
  expect,
  fixtures,
  hasPicture,
  LONG,
  LONG_DRAWN,
  resize,
  settled,
  shown,
  test,
  told,
} from "./page.mjs";

/** The textures of a house, and its other files. */
function houseFiles() {
  const folder = temporaryFolder("web-bundle");
  execFileSync("unzip", ["-q", join(fixtures, "sample.obj.zip"), "-d", folder]);
  const files = execFileSync("find", [folder, "-type", "f"], { encoding: "utf8" })
    .trim()
    .split("\n");
  return {
    textures: files.filter(name => name.endsWith(".png")),
    others: files.filter(name => !name.endsWith(".png")),
  };
}

/** Drops a folder of one file, which is read when the page calls window.release(). */
async function dropSlowFolder(page, name, data) {
  await page.evaluate(
    ([name, data]) => {
      const bytes = Uint8Array.from(atob(data), c => c.charCodeAt(0));
      const file = resolve => resolve(new File([bytes], name));
      const entries = [{ name, isFile: true, file }];
      const readEntries = resolve => {
        // The first entries are held, the next ones are none.
        if (window.release) resolve([]);
        else window.release = () => resolve(entries);
      };
      const folder = { name: "slow", isDirectory: true, createReader: () => ({ readEntries }) };
      const item = DataTransferItem.prototype,
        original = item.webkitGetAsEntry;
      item.webkitGetAsEntry = () => folder;
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File([""], "slow"));
      document
        .getElementById("view")
        .dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
      item.webkitGetAsEntry = original;
    },
    [name, data.toString("base64")],
  );
}

test("a dropped mesh is described, shown, and saved with the bytes of the CLI", DRAWN, async ({
  page,
}) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#card-model")).toContainText("25,600 triangles");
  await expect(page.locator("#card-model")).toContainText("watertight");
  await settled(page);
  expect(await hasPicture(page)).toBe(true);
  await page.selectOption("#format", "npz");
  await expect(page.locator("#card-take")).toContainText(/about [\d.]+ [KM]B/);
  const taken = await download(page, () => page.click("#card-take button.primary"));
  expect(taken.name).toBe("sample.npz");
  const own = join(temporaryFolder("web-cli"), "own.npz");
  run("voxel", ["--url", daemon.url, join(fixtures, "sample.ply"), "--size", "256", "-o", own]);
  expect(taken.bytes.equals(readFileSync(own))).toBe(true);
});

test("the samples become voxels, one after the other", LONG_DRAWN, async ({ page }) => {
  await page.goto(daemon.url);
  for (const [name, fact] of [
    ["Rocket", "watertight"],
    ["Planet", "1 texture"],
    ["Knot", "watertight"],
  ]) {
    await test.step(name, async () => {
      await page.click(`.sample:has-text("${name}")`);
      await shown(page, 256);
      await expect(page.locator("#card-model")).toContainText(fact);
      await expect(page.locator("#card-model .warn")).toBeHidden();
      await settled(page);
      expect(await hasPicture(page)).toBe(true);
      await page.click("#new");
    });
  }
});

test("several files are one mesh, and a missing texture is named and added later", async ({
  page,
}) => {
  const { textures, others } = houseFiles();
  await page.goto(daemon.url);
  await drop(page, ...others);
  await expect(page.locator("#card-model .warn")).toContainText(textures[0].split("/").pop());
  await drop(page, ...textures);
  await expect(page.locator("#card-model .warn")).toBeHidden(); // until the mesh is described again
  await expect(page.locator("#card-model")).toContainText("2 textures");
  await expect(page.locator("#card-model .warn")).toBeHidden();
  await shown(page, 256);
  await page.click("#delete");
  await told(page, "house and its results are deleted");
  const { results } = await daemon.json("/v1/results?limit=1000"),
    { assets } = await daemon.json("/v1/assets?limit=1000");
  const left = [...results, ...assets].map(one => one.filename).filter(name => /^house.*(voxg|bundle)/.test(name));
  expect(left).toEqual([]);
});

test("a folder's other files keep its mesh not out", async ({ page }) => {
  const folder = temporaryFolder("web-folder"),
    many = join(folder, ".git");
  for (const name of [many, join(folder, "stone"), join(folder, "wood")]) mkdirSync(name);
  for (let i = 0; i < 1000; ++i) writeFileSync(join(many, `${i}`), "x");
  writeFileSync(join(folder, "empty.png"), "");
  for (const name of ["a.mtl", "stone/d.png", "wood/d.png"]) writeFileSync(join(folder, name), name);
  cpSync(join(fixtures, "sample.ply"), join(folder, "sample.ply"));
  await page.goto(daemon.url);
  await page.setInputFiles("#folder", folder);
  await shown(page, 256);
  await page.click("#commands summary");
  const command = page.locator("#commands pre");
  await expect(command).toContainText("stone/d.png");
  // These two find the files of folders by themselves, and refuse equal names.
  await page.click('#commands button:text-is("CLI")');
  await expect(command).toContainText("voxel sample.ply a.mtl --");
  await page.click('#commands button:text-is("Python")');
  await expect(command).toContainText('(["sample.ply", "a.mtl"], ');
});

test("a texture that is refused leaves the mesh as it was", async ({ page }) => {
  const { textures, others } = houseFiles();
  const another = join(temporaryFolder("web-texture"), basename(textures[0]));
  writeFileSync(another, "no picture that the daemon knows");
  await page.route(/\/v1\/assets\?filename=.*png/, route =>
    route.fulfill({ status: 413, json: { code: "payload-too-large", detail: "it is too large" } }),
  );
  await page.goto(daemon.url);
  await drop(page, ...others);
  await shown(page, 256);
  await drop(page, another);
  await expect(page.locator("#banner")).toContainText("it is too large");
  await expect(page.locator("#card-model .warn")).toContainText(basename(textures[0]));
  await shown(page, 256);
});

test("of two meshes dropped at once the later one is loaded", LONG, async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 32);
  await shown(page, 32);
  const sent = [];
  page.on("request", request => {
    if (request.method() === "POST") sent.push(request.postData() ?? "");
  });
  const text = name => readFileSync(join(fixtures, name), "utf8");
  await page.evaluate(
    files => {
      for (const [name, text] of files) {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File([text], name));
        document
          .getElementById("view")
          .dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
      }
    },
    [
      ["first.obj", text("concave.obj")],
      ["second.off", text("sample.off")],
    ],
  );
  await expect(page.locator("#card-model h2")).toHaveText("second");
  await expect(page.locator("#card-model")).toContainText("OFF");
  await shown(page, 32);
  expect(sent.filter(body => body.includes("second.off"))).not.toEqual([]);
  expect(sent.filter(body => body.includes("first.obj"))).toEqual([]);
});

test("a folder that is read for long does not supersede a mesh dropped later", LONG, async ({ page }) => {
  await page.goto(daemon.url);
  await dropSlowFolder(page, "slow.obj", Buffer.from("v 0 0 0"));
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  // A page that begins with the folder's mesh has done so before a response comes.
  await page.evaluate(async () => {
    window.release();
    await (await fetch("/v1/me")).blob();
  });
  await expect(page.locator("#card-model h2")).toHaveText("sample");
});

test("a texture that is read for long is added to one that was dropped later", LONG, async ({ page }) => {
  const { textures, others } = houseFiles(),
    [slow, quick] = textures;
  const missing = page.locator("#card-model .warn");
  await page.goto(daemon.url);
  await drop(page, ...others);
  await expect(missing).toContainText(basename(slow));
  await expect(missing).toContainText(basename(quick));
  await dropSlowFolder(page, basename(slow), readFileSync(slow));
  await drop(page, quick);
  await expect(missing).not.toContainText(basename(quick)); // the mesh is described again
  await expect(missing).toBeVisible();
  await page.evaluate(() => window.release());
  await expect(missing).toBeHidden(); // until the mesh is described again
  await expect(page.locator("#card-model")).toContainText("2 textures");
  await expect(missing).toBeHidden();
});

test("an upload shows its progress, and a known file is not sent again", async ({ page }) => {
  await page.goto(daemon.url);
  const client = await page.context().newCDPSession(page);
  await client.send("Network.enable");
  await client.send("Network.emulateNetworkConditions", {
    offline: false,
    latency: 0,
    downloadThroughput: -1,
    uploadThroughput: 20_000, // over a minute, if it were not lifted
  });
  await drop(page, join(fixtures, "sample.stl"));
  await expect(page.locator("#over progress")).toBeVisible();
  await expect(page.locator("#over")).toContainText(
    /Uploading sample\.stl: [\d.]+ [KM]?B of 1\.3 MB/,
  );
  await client.send("Network.emulateNetworkConditions", {
    offline: false,
    latency: 0,
    downloadThroughput: -1,
    uploadThroughput: -1,
  });
  await shown(page, 256);
  const posts = [];
  page.on("request", request => {
    if (request.method() === "POST") posts.push(new URL(request.url()).pathname);
  });
  await page.click("#new");
  await drop(page, join(fixtures, "sample.stl"));
  await shown(page, 256);
  expect(posts).not.toContain("/v1/assets");
});

test("an error says what was expected and what came", async ({ page }) => {
  await page.goto(daemon.url);
  const [bad] = JSON.parse(readFileSync(join(fixtures, "bad/list.json")));
  await drop(page, join(fixtures, "bad", bad.file));
  const banner = page.locator("#banner");
  await expect(banner).toBeVisible();
  await expect(banner).toContainText(bad.message);
  await expect(banner).toContainText(/expected .+got .+/);
  await expect(banner).toHaveAttribute("role", "alert");
  // The description and the job fail one after the other.
  await expect(async () => {
    if (await banner.isVisible()) await banner.getByRole("button").click();
    await expect(banner).toBeHidden({ timeout: 1000 });
  }).toPass();
});
