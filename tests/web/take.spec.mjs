// Downloads, pictures, links and commands.
import { execFileSync } from "node:child_process";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { temporaryFolder } from "./daemon.mjs";
import { daemon, download, drop, expect, fixtures, LONG, resize, shown, test } from "./page.mjs";

/** The files of a sample, written to a folder of their own. */
async function sampleFiles(page, name) {
  const script = execFileSync(
    "esbuild",
    [
      join(process.env.VOXELD_ROOT_DIR, "client/web/app/samples.ts"),
      "--bundle",
      "--global-name=own",
    ],
    { encoding: "utf8" },
  );
  const files = await page.evaluate(
    `(async () => {
      ${script}
      const files = await own.samples.find(one => one.name === ${JSON.stringify(name)}).make();
      return Promise.all(files.map(async ({ name, blob }) => [
        name,
        Array.from(new Uint8Array(await blob.arrayBuffer())),
      ]));
    })()`,
  );
  const folder = temporaryFolder("web-sample");
  for (const [file, bytes] of files) writeFileSync(join(folder, file), Uint8Array.from(bytes));
  return folder;
}

for (const [name, size, ...formats] of [
  ["Rocket", 48, "vox", "glb", "slices Channel=color", "schem Dithering=bayer Blocks=wool"],
  ["Planet", 40, "ply"], // a bundle
  ["Worm", 16, "vox", "xyz"], // an animation: one file, and a zip of a file for each frame
]) {
  const tags = name === "Planet" ? LONG : {};
  test(`commands that the page shows for the ${name} make the same bytes`, tags, async ({ page }) => {
    await page.goto(daemon.url);
    await page.click(`.sample:has-text("${name}")`);
    await resize(page, size);
    await shown(page, size);
    const files = await sampleFiles(page, `sample${name}`);
    await page.click("#commands summary");
    for (const wanted of formats) {
      const [format, ...choices] = wanted.split(" ");
      await page.selectOption("#format", format);
      for (const [label, value] of choices.map(choice => choice.split("="))) {
        await page.locator("#card-take").getByLabel(label, { exact: true }).selectOption(value);
      }
      const taken = await download(page, () => page.click("#card-take button.primary"));
      for (const language of ["curl", "CLI", "Python"]) {
        await page.click(`#commands button:text-is("${language}")`);
        const folder = temporaryFolder("web-commands");
        execFileSync("cp", ["-r", `${files}/.`, folder]);
        const [program, flags] =
          language === "Python" ? ["/usr/bin/python3", ["-Bc"]] : ["sh", ["-ec"]];
        execFileSync(program, [...flags, await page.textContent("#commands pre")], {
          cwd: folder,
          stdio: "pipe",
          env: {
            ...process.env,
            PATH: `${process.env.VOXELD_BIN_DIR}:${process.env.PATH}`,
            PYTHONPATH: join(process.env.VOXELD_ROOT_DIR, "python"),
          },
        });
        const isInput = existsSync(join(files, taken.name)); // which must stay
        const made = readFileSync(join(folder, (isInput ? "voxels-" : "") + taken.name));
        expect(made.equals(taken.bytes), `${wanted} by ${language}`).toBe(true);
        execFileSync("sh", ["-ec", 'for name in *; do cmp "$name" "$1/$name"; done', "sh", folder], { cwd: files });
      }
    }
    await page.click('#commands button:text-is("C++")');
    await expect(page.locator("#commands pre")).toHaveText(
      /out = std::fopen\(.*if \(!out\) return 1;.*client\.start\(/s,
    );
  });
}

const isJob = request => request.method() === "POST" && request.url().endsWith("/v1/jobs");

test("a picture, a turntable and a link that others can open", async ({ page, request }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Rocket")');
  await resize(page, 32);
  await shown(page, 32);
  await page.click("#pictures summary");
  await page.fill('#pictures input[aria-label="Width"]', "320");
  await page.fill('#pictures input[aria-label="Height"]', "200");
  const png = await download(page, () => page.click("#png"));
  expect([png.name, png.bytes.readUInt32BE(16), png.bytes.readUInt32BE(20)]).toEqual([
    "rocket.png",
    320,
    200,
  ]);
  await page.check('#card-look input[value="box"]', { force: true });
  await page.getByLabel("Box along y to").fill("20");
  const gifButton = 'button:text-is("Turntable GIF")';
  await page.getByLabel("Box along y from").fill("20");
  await page.click(gifButton);
  await expect(page.locator("#banner")).toContainText("The box is empty.");
  await page.getByLabel("Box along y from").fill("0");
  const asked = page.waitForRequest(isJob);
  const gif = await download(page, () => page.click(gifButton));
  expect((await asked).postDataJSON().options.region).toMatch(/^0,0,0,\d+,20,\d+$/);
  expect([gif.name, gif.bytes.subarray(0, 6).toString()]).toEqual(["rocket.gif", "GIF89a"]);
  await page.selectOption("#format", "vox");
  await page.click('button:text-is("Share link")');
  const link = page.locator('input[aria-label="Share link"]');
  await expect(link).toHaveValue(/\/v1\/jobs\/.*signature=/);
  const shared = await request.get(await link.inputValue());
  expect([shared.status(), (await shared.body()).subarray(0, 4).toString()]).toEqual([200, "VOX "]);
  expect(shared.headers()["content-disposition"]).toContain('"rocket.vox"');
});

test("options of a format stay for the next result and format that have them", async ({ page }) => {
  const card = page.locator("#card-take"),
    command = page.locator("#commands pre"),
    option = name => card.getByLabel(name, { exact: true });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 32);
  await shown(page, 32);
  await page.selectOption("#format", "slices");
  await option("Channel").selectOption("color");
  await option("Layout").selectOption("atlas");
  await resize(page, 40);
  await expect(command).toContainText("size=40");
  await expect(command).toContainText("channel=color");
  await expect(command).toContainText("layout=atlas");
  await expect(option("Channel")).toHaveValue("color");
  await expect(option("Layout")).toHaveValue("atlas");
  // Another format while a result is being made.
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/v1/grids/**", async route => {
    await held;
    await route.continue();
  });
  await resize(page, 48);
  await expect(card.locator("button.primary")).toBeDisabled();
  await page.selectOption("#format", "raw");
  await expect(option("Channel")).toHaveValue("color");
  await page.selectOption("#format", "slices");
  release();
  await expect(command).toContainText("size=48");
  await expect(command).toContainText("channel=color");
  await expect(option("Channel")).toHaveValue("color");
  await option("Layout").selectOption("atlas");
  await page.selectOption('#card-voxels select:has(option[value="average"])', "none");
  await expect(command).toContainText("color=none");
  await expect(command).toContainText("layout=atlas");
  await expect(command).not.toContainText("channel=");
  await expect(option("Channel")).toHaveValue("occupancy");
  await page.selectOption("#format", "npz");
  await expect(option("Layout")).toHaveValue("dense"); // it has no atlas
  await option("Layout").selectOption("sparse");
  await page.selectOption("#format", "npy");
  await expect(command).toContainText("layout=sparse");
  await page.selectOption("#format", "vox");
  await expect(command).not.toContainText("layout");
  const colors = option("Colours, at most");
  await colors.fill("16");
  await colors.press("Enter");
  await expect(command).toContainText("palette=16");
  await colors.fill("");
  await colors.press("Enter");
  await expect(colors).toHaveValue("255");
  await expect(command).not.toContainText("palette");
  await page.selectOption("#format", "qb");
  await expect(option("Palette")).toHaveValue("-");
});

test("a grid that cannot be shown can be taken home", async ({ page }) => {
  await page.route(/\/v1\/grids\/[^/?]+(\?|$)/, route => route.fulfill({ body: "no grid" }));
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await expect(page.locator("#banner")).toBeVisible();
  const file = await download(page, () => page.click("#card-take button.primary"));
  expect(file.bytes.subarray(0, 2).toString()).toBe("PK"); // an npz
});

test("the box of another grid than that to take is in no GIF", LONG, async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 32);
  await shown(page, 32);
  await page.check('#card-look input[value="box"]', { force: true });
  await page.getByLabel("Box along y to").fill("10");
  await page.route(/\/v1\/grids\/[^/?]+(\?|$)/, route => route.fulfill({ body: "no grid" }));
  await resize(page, 24);
  await expect(page.locator("#banner")).toBeVisible();
  await expect(page.locator("#commands pre")).toContainText("size=24"); // the result to take
  await page.click("#pictures summary");
  const asked = page.waitForRequest(isJob);
  await download(page, () => page.click('button:text-is("Turntable GIF")'));
  expect((await asked).postDataJSON().options.region).toBeUndefined();
});

test("a link that comes after another result is not shown", LONG, async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route(/\/share\?/, async route => {
    await held;
    await route.continue();
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 32);
  await shown(page, 32);
  await expect(page.locator("#commands pre")).toContainText("size=32");
  const asked = page.waitForRequest(/\/share\?/);
  await page.click('button:text-is("Share link")');
  await asked;
  await resize(page, 40);
  await expect(page.locator("#commands pre")).toContainText("size=40"); // the result to take
  const came = page.waitForResponse(/\/share\?/);
  release();
  await came;
  // Another response: the page has read the link by then.
  await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
  await expect(page.locator('input[aria-label="Share link"]')).toBeHidden();
});
